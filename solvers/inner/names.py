"""Names of the inner solvers with strict bounds."""

STRICT_DEFAULT = "strict-direct:clarabel"


def is_strict(inner: str | None) -> bool:
    """Whether an inner solver, ``"kind:name"``, bounds tractions on whole edges."""
    return str(inner or "").lower().split(":")[0] in ("strict", "strict-direct")
