"""What the command line says of a limit load."""

import math
from typing import Any

from qvi_contact.solution.limit import LimitLoad


def sentence(limit: LimitLoad) -> str:
    """How much the mesh and the body carry."""
    if limit.upper == -math.inf:
        return "no multiple can be carried"
    if limit.upper == limit.lower == math.inf:
        return "no upper limit"
    mesh = "this mesh carries " + _multiple(limit.lower)
    body = "no stress of the body carries more than " + _multiple(limit.upper)
    return f"{mesh} these loads; {body if limit.upper < math.inf else 'for the body there is no upper limit'}"


def document(limit: LimitLoad) -> dict[str, Any]:
    """The same for programs: factors that are not finite are None, `outcome` says what they stand for."""
    outcome = "none" if limit.upper == -math.inf else "unbounded" if limit.upper == math.inf else "bounded"
    lower, upper = (value + 0.0 if math.isfinite(value) else None for value in (limit.lower, limit.upper))
    return {"outcome": outcome, "factor": lower, "upper": upper, "message": sentence(limit)}


def _multiple(factor: float) -> str:
    """A factor in a sentence."""
    if math.isinf(factor):
        return "any multiple of" if factor > 0.0 else "no multiple of"
    return f"{factor + 0.0:.9g} times"
