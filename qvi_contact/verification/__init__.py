"""Whether a result is what it claims to be, from its own data alone."""

from qvi_contact.verification.verification import Check, Verification, verify_file, verify_result

__all__ = ["Check", "Verification", "verify_file", "verify_result"]
