"""What the meshes are compared with: exact and external values where there are any, else our most certain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame, Series

from comparisons.convergence.mesh.problems import ENERGY, FORCE, TRACTIONS, Problem
from comparisons.convergence.mesh.study import COMPANION, EQUILIBRIUM, REFERENCE, SEQUENCES, UNIFORM
from comparisons.convergence.mesh.tractions import difference, size

if TYPE_CHECKING:
    from comparisons.convergence.mesh.errors import Overview

FLOOR: Final = 1e-8
"""Relative errors that the accuracy asked of the solves leaves."""


@dataclass(frozen=True)
class Reference:
    """A value or field to compare with, its uncertainty, what errors are divided by, and where it comes from.

    `sequence` is the one of this study's meshes that it was taken from; empty if it is known from elsewhere.
    """

    value: Any
    uncertainty: float
    unit: float
    source: str
    sequence: str = ""

    @property
    def least(self) -> float:
        """Relative errors from here down mean nothing."""
        return max(self.uncertainty / self.unit, FLOOR)


def references_of(meshes: Overview, problem: Problem) -> dict[str, Reference]:
    """Measure → what it is compared with: force, energy, tractions, ends of zones."""
    found = {measure: list(_numbers(meshes, problem, measure)) for measure in (FORCE, ENERGY)}
    found |= {TRACTIONS: list(_fields(meshes, problem)), **_ends(meshes, problem)}
    return {
        measure: min(candidates, key=lambda each: each.uncertainty / each.unit)
        for measure, candidates in found.items()
        if candidates
    }


def _numbers(meshes: Overview, problem: Problem, measure: str) -> Iterator[Reference]:
    """What is known, else the mean of both models on the finest adaptive mesh, and the middle of the closest bounds."""
    if measure in problem.known:
        known = problem.known[measure]
        yield Reference(known.value, known.uncertainty, abs(known.value), known.source)
        return
    both = [meshes.of(problem, REFERENCE, model) for model in (EQUILIBRIUM, COMPANION)]
    if all(map(len, both)):
        one, other = (float(each[measure].iloc[-1]) for each in both)
        source = f"stresses and displacements on {both[0].cells.iloc[-1]} adaptive cells; ± their difference"
        yield Reference((one + other) / 2.0, abs(one - other), abs(one + other) / 2.0, source, REFERENCE)
    closed = meshes.brackets(problem)
    if measure == ENERGY and len(closed):
        best = closed.loc[closed.gap.idxmin()]
        value = (best.lower + best.upper) / 2.0
        source = f"guaranteed bounds on {best.cells} cells"
        yield Reference(value, abs(best.gap) / 2.0, abs(value), source, best.sequence)


def _fields(meshes: Overview, problem: Problem) -> Iterator[Reference]:
    """Exact tractions, else those of the finest meshes, uncertain by their distance to the mesh before."""
    if problem.tractions is not None:
        lines = meshes.of(problem, UNIFORM).tractions.iloc[-1].lines
        yield Reference(problem.tractions, 0.0, size(problem.tractions, lines), "closed form")
        return
    for sequence in (REFERENCE, UNIFORM):
        finest = meshes.of(problem, sequence).tail(2)
        if len(finest) == 2:
            before, last = finest.tractions
            source = f"{finest.cells.iloc[-1]} cells ({sequence}); ± the distance to the mesh before"
            yield Reference(last, difference(last, before), size(last, last.lines), source)


def _ends(meshes: Overview, problem: Problem) -> dict[str, list[Reference]]:
    """Kind of an end of a zone → what is known, or what each mesh that has a coarser one before it says."""
    finest = meshes.of(problem, UNIFORM).iloc[-1]
    length = float(np.ptp(finest.tractions.lines))
    found = {
        kind: [Reference(known.value, known.uncertainty, length, known.source)]
        for kind, known in problem.known.items()
        if kind not in (FORCE, ENERGY)
    }
    for kind in dict.fromkeys(end["kind"] for end in finest.ends):  # on coarse meshes single edges may seem to be zones
        if end_of(finest.ends, kind):
            found.setdefault(kind, list(_candidates(meshes, problem, kind, length)))
    return found


def _candidates(meshes: Overview, problem: Problem, kind: str, length: float) -> Iterator[Reference]:
    """What the meshes say of an end, and how uncertain that is.

    The middle of the root and the extrapolated end, uncertain by what is not known on the mesh and by twice the
    distance to the mesh before: ends converge slowly, with an order of about ½ to 1.
    """
    for sequence in SEQUENCES:
        found = meshes.of(problem, sequence)
        ends = [end_of(each, kind) for each in found.ends]
        seen = [(cells, end) for cells, end in zip(found.cells, ends, strict=True) if end is not None]
        for (_, before), (cells, end) in pairwise(seen):
            middle = _middle(end)
            least = uncertainty(end) + 2.0 * abs(middle - _middle(before))
            source = f"{cells} cells ({sequence}); ± its own two values and twice the distance to the mesh before"
            yield Reference(middle, least, length, source, sequence)


def _middle(end: Mapping[str, Any]) -> float:
    """Between the root and the extrapolated end."""
    other = end["position"] if end["extrapolated"] is None else end["extrapolated"]
    return float(end["position"] + other) / 2.0


def uncertainty(end: Mapping[str, Any]) -> float:
    """What is not known about an end: its distance to the extrapolated one, and between the points around it."""
    apart = 0.0 if end["extrapolated"] is None else abs(end["position"] - end["extrapolated"])
    return float(max(apart, end["high"] - end["low"]))


def end_of(ends: Any, kind: str) -> Mapping[str, Any] | None:
    """The end of this kind, if a mesh has just one: with several it does not show the zones there are."""
    found = [end for end in ends if end["kind"] == kind] if isinstance(ends, list) else []
    return found[0] if len(found) == 1 else None


def errors_of(meshes: DataFrame, measure: str, known: Reference) -> Series:
    """Relative errors of meshes, NaN where one has no such value."""
    if measure in (FORCE, ENERGY):
        return (meshes[measure] - known.value).abs() / known.unit
    if measure == TRACTIONS:
        off = [np.nan if own is None else difference(own, known.value) for own in meshes.tractions]
    else:
        ends = (end_of(each, measure) for each in meshes.ends)
        off = [np.nan if end is None else abs(end["position"] - known.value) for end in ends]
    return Series(off, meshes.index, dtype=float) / known.unit
