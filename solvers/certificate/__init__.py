"""What is true of a state: the certificate, its measures, feasibility and uniqueness."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "certificate": ("EXPONENTS", "MEASURES", "CertificateRow", "Measure", "law_residuals", "scales_at"),
        "feasibility": ("AdmissibleRows", "Feasibility", "check_feasibility", "is_farkas"),
        "uniqueness": ("LARGEST", "UniquenessBound", "uniqueness_bound"),
    },
)
