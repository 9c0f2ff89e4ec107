"""Whether a result is what it claims to be, from its own data alone."""

from qvi_contact.verification.verification import Check, Verification, verify_file, verify_result
from solvers.basics.front import front

__all__ = ["Check", "Verification", "verify_file", "verify_result"]

__getattr__ = front(
    __name__,
    {
        "claims": ("difference", "missed_tractions", "problem_difference", "scales_difference", "worse_than_claimed"),
    },
)
