"""A row of the manual: one number of ours beside a reference, and whether it passes."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np

from comparisons.verification.proof import Proof

Value = float | str
"""A number, or a word such as a status."""

RELATIVE: Final = "relative"
ABSOLUTE: Final = "absolute"
EXCESS: Final = "excess"
SHORTFALL: Final = "shortfall"
EQUAL: Final = "equal"


class Kind(StrEnum):
    """Where a reference comes from; nothing is compared with itself."""

    ANALYTIC = "analytic"
    PUBLISHED = "published"
    EXTERNAL = "external code"
    METHODS = "method against method"


@dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes
    ----------
    quantity : str
        What is compared, with its unit.
    reference, ours : float or str
        The known value and the computed one.
    kind : Kind or None
        Where the reference comes from; None where a problem did not get so far.
    source : str
        Equation, test case, uncertainty of the reference.
    error : float
        ≥ 0, measured as `measure` says; infinity or NaN where there is none.
    measure : str
        "relative" to the reference, "absolute" in the unit of the quantity, "excess" over a reference that must not be
        exceeded, "shortfall" from one that must be reached, or "equal" for words.
    tolerance : float
        Largest error that passes.
    proof : Proof
        Whether the results behind the number are certified.
    problem : str
        Name of the problem.
    element : str
        The element it was solved with; empty where there is none, or only the one that the problem is about.

    """

    quantity: str
    reference: Value
    ours: Value
    kind: Kind | None
    source: str
    error: float
    measure: str
    tolerance: float
    proof: Proof
    problem: str = ""
    element: str = ""

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance and the result certified; a NaN is neither."""
        return self.proof.passed and bool(self.error <= self.tolerance)

    @property
    def ratio(self) -> float:
        """Error over tolerance; infinity where there is none."""
        if not np.isfinite(self.error):
            return np.inf
        if self.tolerance == 0.0:
            return 0.0 if self.error == 0.0 else np.inf
        return self.error / self.tolerance

    def of(self, problem: str) -> "Row":
        """The row with the name of its problem."""
        return replace(self, problem=problem)


def relative(
    quantity: str, ours: float, known: float, tolerance: float, source: str, proof: Proof, kind: Kind = Kind.ANALYTIC
) -> Row:
    """Compare with a reference other than zero: error |ours − known| / |known|."""
    error = float(abs(ours - known) / abs(known))
    return Row(quantity, float(known), float(ours), kind, source, error, RELATIVE, tolerance, proof)


def absolute(
    quantity: str, ours: float, known: float, tolerance: float, source: str, proof: Proof, kind: Kind = Kind.ANALYTIC
) -> Row:
    """Compare in the unit of the quantity: error |ours − known|."""
    error = float(abs(ours - known))
    return Row(quantity, float(known), float(ours), kind, source, error, ABSOLUTE, tolerance, proof)


def at_most(
    quantity: str, ours: float, limit: float, tolerance: float, source: str, proof: Proof, kind: Kind = Kind.ANALYTIC
) -> Row:
    """An inequality ours ≤ limit: error max(ours − limit, 0), in the unit of the quantity."""
    error = float(np.maximum(ours - limit, 0.0))  # a NaN stays one
    return Row(quantity, float(limit), float(ours), kind, source, error, EXCESS, tolerance, proof)


def at_least(
    quantity: str, ours: float, limit: float, tolerance: float, source: str, proof: Proof, kind: Kind = Kind.ANALYTIC
) -> Row:
    """An inequality ours ≥ limit: error max(limit − ours, 0), in the unit of the quantity."""
    error = float(np.maximum(limit - ours, 0.0))  # a NaN stays one
    return Row(quantity, float(limit), float(ours), kind, source, error, SHORTFALL, tolerance, proof)


def enclosed(
    quantity: str,
    bounds: tuple[float, float],
    known: float,
    tolerance: float,
    source: str,
    proof: Proof,
    kind: Kind = Kind.ANALYTIC,
) -> Iterator[Row]:
    """Lower and upper bound around what is known; {} in the quantity says which of them."""
    lower, upper = bounds
    yield at_most(quantity.format("lower bound"), lower, known, tolerance, source, proof, kind)
    yield at_least(quantity.format("upper bound"), upper, known, tolerance, source, proof, kind)


def word(quantity: str, ours: str, expected: str, source: str, proof: Proof, kind: Kind = Kind.ANALYTIC) -> Row:
    """Compare words: error 0 if they are equal, else infinity."""
    error = 0.0 if ours == expected else float("inf")
    return Row(quantity, expected, ours, kind, source, error, EQUAL, 0.0, proof)


def crash(problem: str, reason: str) -> Row:
    """The row of a problem that did not come to its end."""
    proof = Proof(passed=False, text="none")
    nothing = float("inf")
    return Row("runs to its end", "no error", reason, None, "", nothing, EQUAL, 0.0, proof, problem)


Problem = Callable[[bool], Iterator[Row]]
"""A problem of the manual yields its rows, given True from coarse meshes and few cases. Its docstring is printed."""

Chapters = Mapping[str, Mapping[str, Problem]]
"""Name of a chapter → name of a problem → the problem; these names are those of the command line."""
