"""A row of the manual: a computed number, its reference, the proof of the result, and whether the row passes."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import wraps
from typing import Any, Final

import numpy as np

from qvi_contact import ContactResult
from qvi_contact.companion import CompanionResult
from qvi_contact.limit.load_factor import LimitLoad
from solvers import QVISolution, Status
from solvers.certificate.feasibility import is_farkas

GAP: Final = 1e-7
"""Largest relative gap between a limit load and its dual bound, and largest violation of the contact laws."""

Value = float | str
"""A number, or a word such as a status."""

RELATIVE, ABSOLUTE, EXCESS, SHORTFALL, EQUAL = "relative", "absolute", "excess", "shortfall", "equal"


class Kind(StrEnum):
    """Where a reference comes from."""

    ANALYTIC = "analytic"
    PUBLISHED = "published"
    EXTERNAL = "external code"
    METHODS = "method against method"


@dataclass(frozen=True)
class Proof:
    """Whether a result is certified, and by what, in a few words; a row whose proof has not passed fails."""

    passed: bool
    text: str


def certified(*results: ContactResult | QVISolution) -> Proof:
    """The certificates of results or algebraic solutions, all of which must be solved."""
    solutions = [result.solution if isinstance(result, ContactResult) else result for result in results]
    failed = [
        each.status.value for each in solutions if each.status is not Status.SOLVED or not each.certificate.passed
    ]
    return Proof(not failed and bool(results), ", ".join(["failed", *failed]) if failed else "certificate")


def certified_companion(companion: CompanionResult, *, guaranteed: bool = False) -> Proof:
    """The certificate of a displacement model; with `guaranteed` its energy must be an upper bound."""
    if not (companion.status is Status.SOLVED and companion.certificate.passed):
        return Proof(passed=False, text=f"failed, {companion.status.value}")
    if guaranteed and companion.reasons:
        return Proof(passed=False, text=f"failed, {companion.reasons[0]}")
    return Proof(passed=True, text="certificate, bound guaranteed" if guaranteed else "certificate")


def infeasible(result: ContactResult) -> Proof:
    """A mechanism proves that no stress carries the load, and multipliers (Farkas) prove it for the mesh."""
    proof, moved = result.solution.farkas, result.mechanism is not None and result.mechanism.overload > 1.0
    passed = moved and proof is not None and is_farkas(result.solution.problem, *proof)
    return Proof(passed, "mechanism, Farkas proof" if passed else "failed, no proof")


def bounded(limit: LimitLoad) -> Proof:
    """The dual bound of a mesh's limit load agrees with it, and the limit load is below that of the mechanism.

    For a body that yields: stresses carry the lower number, and a flow proves the upper one.
    """
    room = GAP * (1.0 + abs(limit.lower))
    passed = bool(np.isfinite(limit.lower)) and limit.lower <= limit.upper + room and limit.violation <= GAP
    if limit.collapse is not None:
        return Proof(passed, "stress and flow" if passed else "failed, bounds apart")
    passed = passed and limit.bound - limit.lower <= room
    return Proof(passed, "dual bound" if passed else "failed, bounds apart")


def both(*proofs: Proof) -> Proof:
    """All of several proofs."""
    texts = dict.fromkeys(text for proof in proofs for text in proof.text.split(", "))
    return Proof(all(proof.passed for proof in proofs) and bool(proofs), ", ".join(texts))


def by_hand(passed: bool, text: str) -> Proof:
    """A proof computed by the chapter, for results without a certificate."""
    return Proof(bool(passed), text if passed else f"failed: {text}")


@dataclass(frozen=True)
class Row:
    """One comparison of a quantity, named with its unit: the reference and the computed value.

    `kind` is None if the problem failed; `source` is an equation, a test case or a code, with its uncertainty. The
    error is ≥ 0, infinite or NaN without a number. By `measure` it is "relative" to the reference, "absolute" in the
    unit of the quantity, the "excess" over an upper limit, the "shortfall" from a lower limit, or "equal" for words.
    `element` is empty for rows that concern no element.
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
    element: str = ""

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance and the result certified; a NaN is neither."""
        return self.proof.passed and bool(self.error <= self.tolerance)

    @property
    def ratio(self) -> float:
        """Error over tolerance; infinite if the error is not finite."""
        if not np.isfinite(self.error):
            return np.inf
        if self.tolerance == 0.0:
            return 0.0 if self.error == 0.0 else np.inf
        return self.error / self.tolerance


@dataclass(frozen=True)
class Check:
    """Makes the rows of one result, with the values they share; a row may replace them.

    The source of a row stands before the shared source.
    """

    proof: Proof
    source: str = ""
    tolerance: float = 0.0
    kind: Kind = Kind.ANALYTIC

    def relative(self, quantity: str, ours: float, known: float, source: str = "", **other: Any) -> Row:
        """Compare with a reference other than zero: error |ours − known| / |known|."""
        return self._row(quantity, ours, known, abs(ours - known) / abs(known), RELATIVE, source, other)

    def absolute(self, quantity: str, ours: float, known: float, source: str = "", **other: Any) -> Row:
        """Compare in the unit of the quantity: error |ours − known|."""
        return self._row(quantity, ours, known, abs(ours - known), ABSOLUTE, source, other)

    def at_most(self, quantity: str, ours: float, limit: float, source: str = "", **other: Any) -> Row:
        """An inequality ours ≤ limit: error max(ours − limit, 0), in the unit of the quantity; a NaN stays one."""
        return self._row(quantity, ours, limit, np.maximum(ours - limit, 0.0), EXCESS, source, other)

    def at_least(self, quantity: str, ours: float, limit: float, source: str = "", **other: Any) -> Row:
        """An inequality ours ≥ limit: error max(limit − ours, 0), in the unit of the quantity; a NaN stays one."""
        return self._row(quantity, ours, limit, np.maximum(limit - ours, 0.0), SHORTFALL, source, other)

    def enclosed(self, quantity: str, bounds: tuple[float, float], known: float) -> Iterator[Row]:
        """Rows of a lower and an upper bound of a known value; {} in the quantity is replaced by their names."""
        yield self.at_most(quantity.format("lower bound"), bounds[0], known)
        yield self.at_least(quantity.format("upper bound"), bounds[1], known)

    def word(self, quantity: str, ours: str, expected: str, source: str = "") -> Row:
        """Compare words: error 0 if they are equal, else infinity."""
        error = 0.0 if ours == expected else np.inf
        return self._row(quantity, ours, expected, error, EQUAL, source, {"tolerance": 0.0})

    def _row(
        self, quantity: str, ours: Value, known: Value, error: float, measure: str, source: str, other: dict[str, Any]
    ) -> Row:
        shared = replace(self, **other)
        source = "; ".join(filter(None, (source, shared.source)))
        ours, known = (each if isinstance(each, str) else float(each) for each in (ours, known))
        return Row(quantity, known, ours, shared.kind, source, float(error), measure, shared.tolerance, shared.proof)


def crash(reason: str) -> Row:
    """The row of a problem that ended with an error."""
    return Row("runs to its end", "no error", reason, None, "", np.inf, EQUAL, 0.0, Proof(passed=False, text="none"))


Problem = Callable[[bool], Iterator[Row]]
"""A problem of the manual yields its rows, given True from coarse meshes and few cases. Its docstring is printed."""

Chapters = Mapping[str, Mapping[str, Problem]]
"""Name of a chapter → name of a problem → the problem; these names are those of the command line."""


class Chapter(dict[str, Problem]):
    """Name of a problem → the problem, in the order in which a chapter of the manual defines them."""

    def __call__(self, name: str, *degrees: int) -> Callable[[Callable[..., Iterator[Row]]], Problem]:
        """Make a function a problem of this chapter: `rows(quick)`, or `rows(p, quick)` for each of these degrees.

        The degrees p are those of Φ on triangles; rows name them. Quick runs take the second, if there are several.
        """

        def known(rows: Callable[..., Iterator[Row]]) -> Problem:
            @wraps(rows)
            def on_each(quick: bool) -> Iterator[Row]:
                for p in degrees[:2][-1:] if quick else degrees:
                    for row in rows(p, quick):
                        yield replace(row, element=f"triangles of degree {p}")

            self[name] = on_each if degrees else rows
            return self[name]

        return known
