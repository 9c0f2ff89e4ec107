"""Values to which independent codes converge: the references of several studies."""

from collections.abc import Mapping
from typing import Final

SETTLED: Final = {0.05: 210.60643, 0.1: 212.24243, 0.15: 213.55884, 0.2: 214.23323, 0.25: 214.36766, 1.0: 214.36766}
"""P/2 of `compressed_plate` by μ [MPa × length], by GetFEM 5.4.2 and NGSolve 6.2; from μ = 0.25 on all sticks."""

UNCERTAINTY: Final = 3e-5
"""Uncertainty of `SETTLED`, either way [MPa × length]."""

SOURCE: Final = "GetFEM 5.4.2 and NGSolve 6.2, agreeing; ± 3e-5"
"""Source of `SETTLED`, for tables."""

LIMITS: Final = {
    0.05: (210.606417984, 1e-7),
    0.1: (212.24242433, 1e-7),
    0.2: (214.23323205, 2e-7),
    1.0: (214.367658387, 2e-7),
}
"""P/2 of `compressed_plate` by μ and its uncertainty either way [MPa × length], see `LIMITS_SOURCE`."""

LIMITS_SOURCE: Final = (
    "the limit of triangles of high degree on meshes bisected further than here, computed once by a trial code apart "
    "from this package; what NGSolve of degree 6 settles on differs by less than the uncertainty"
)
"""Source of `LIMITS`, for tables."""

TRANSITIONS: Final[Mapping[float, float]] = {0.05: 0.0117, 0.1: 0.1793, 0.2: 0.749}
"""μ → x of the plate at which stick ends and slip begins, from a first solution. Meshes are graded to this point."""
