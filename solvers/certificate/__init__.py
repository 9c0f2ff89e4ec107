"""What is true of a state: the certificate, its measures, feasibility and uniqueness."""

from solvers.basics.front import front
from solvers.certificate.certificate import (
    EXPONENTS,
    MEASURES,
    Certificate,
    CertificateRow,
    Measure,
    body_scales,
    certify,
    law_residuals,
    scales_at,
)
from solvers.certificate.feasibility import AdmissibleRows, Feasibility, check_feasibility, is_farkas
from solvers.certificate.uniqueness import UniquenessBound, uniqueness_bound

__all__ = [
    "EXPONENTS",
    "MEASURES",
    "AdmissibleRows",
    "Certificate",
    "CertificateRow",
    "Feasibility",
    "Measure",
    "UniquenessBound",
    "body_scales",
    "certify",
    "check_feasibility",
    "is_farkas",
    "law_residuals",
    "scales_at",
    "uniqueness_bound",
]

__getattr__ = front(
    __name__,
    {
        "uniqueness": ("LARGEST",),
    },
)
