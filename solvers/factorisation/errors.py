"""The error of a factorisation that cannot be done."""

from typing import Any, Final, Literal, TypeAlias

from solvers.errors import QVIError

Reason: TypeAlias = Literal["singular", "memory", "time", "backend"]
"""Why a factorisation failed: not positive definite, out of memory, too long for the time limit, or what else the back
end reports."""

_REMEDY: Final[dict[Reason, str]] = {
    "singular": "fix the free modes and give positive stiffnesses, so that K is positive definite",
    "memory": "take fewer cells, or a machine with more memory",
    "time": "allow more time (time_limit), or take fewer cells",
    "backend": "choose another back end with QVI_CONTACT_FACTORISATION or set_default",
}


class FactorisationError(QVIError):
    """K could not be factorised, or a solve with the factors failed.

    Attributes
    ----------
    reason : "singular", "memory", "time" or "backend"
        "singular" covers indefinite matrices too; "time": it would take far longer than the time limit allows.
    backend : str
        Name of the back end.

    """

    def __init__(self, reason: Reason, backend: str, detail: str) -> None:
        self.reason = reason
        self.backend = backend
        self._detail = detail
        super().__init__(f"factorisation by {backend}: {detail}; {_REMEDY[reason]}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickles, as worker processes send it."""
        return type(self), (self.reason, self.backend, self._detail)
