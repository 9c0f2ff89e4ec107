"""Chapter on strict admissibility: the friction law on whole edges instead of at four points of each."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from comparisons.verification.elements import BOTH, QUINTIC, RECTANGLES, TRIANGLES, Chapter, Element
from comparisons.verification.measures import FORCE, between_points, mean_pressure
from comparisons.verification.proof import both, certified, certified_algebra
from comparisons.verification.row import Kind, Row, absolute, at_most, relative
from qvi_contact import ContactProblem, ContactResult
from qvi_contact.gallery import compressed_plate
from solvers import solve_qvi

PROBLEMS: Final = Chapter()

_TOLERANCE: Final = 1e-9  # of the solves; excess counts against the mean pressure, the certificate against the largest
EXCESS: Final = 1e-8
_CONES: Final = ("strict:clarabel", "strict-direct:clarabel")
_MESHES: Final = {"16² cells graded by 0.8": (16, 0.8), "16² equal cells": (16, 1.0)}
_COARSE: Final = {"8² cells graded by 0.8": (8, 0.8)}
"""Cells a side and grading; the second of quick runs."""


@PROBLEMS.on("whole-edges", RECTANGLES)
def whole_edges(element: Element, quick: bool) -> Iterator[Row]:
    """σ_T at 1000 points of every edge against μ|σ_N| there, and σ_N against zero, on the paper's plate."""
    for name, mesh in _meshes(quick):
        for inner in _CONES[1:] if quick else _CONES:
            for friction in _frictions(quick):
                result = element.solve(_plate(friction, *mesh), inner=inner, tolerance=_TOLERANCE)
                yield from _kept(result, f"μ = {friction:g}, {name}, {inner}")


@PROBLEMS.on("whole-edges-triangles", TRIANGLES, QUINTIC)
def whole_edges_by_coefficients(element: Element, quick: bool) -> Iterator[Row]:
    """The same on triangles, where Bernstein coefficients of tractions hold the law on whole edges without cones."""
    for name, mesh in _meshes(quick):
        for friction in _frictions(quick):
            result = element.solve(_plate(friction, *mesh), tolerance=_TOLERANCE)
            yield from _kept(result, f"μ = {friction:g}, {name}")


@PROBLEMS.on("reported-excess", *BOTH)
def reported_excess(element: Element, quick: bool) -> Iterator[Row]:
    """What a collocated result says about its own violation between the points, against 1000 points of every edge."""
    for name, mesh in _meshes(quick):
        result = element.solve(_plate(0.1, *mesh), contact_rows="gauss")
        line = result.contacts["plate"]
        sampled, _ = _sampled(result)
        quantity = "largest |σ_T| − bound between the points [MPa]"
        source, proof = f"polynomials through the points of each edge, sampled; {name}", certified(result)
        yield relative(quantity, line.excess_between_points, sampled, 1e-4, source, proof)


@PROBLEMS.on("strict-energy", RECTANGLES)
def energy_of_the_smaller_set(element: Element, quick: bool) -> Iterator[Row]:
    """For one fixed bound the strict complementary energy is not below the collocated one: K strict ⊂ K collocated."""
    (_, mesh), *_ = _meshes(quick)
    for friction in _frictions(quick):
        qvi = element.solve(_plate(friction, *mesh)).solution.problem
        start = solve_qvi(qvi, tolerance=_TOLERANCE)
        bound = qvi.threshold(qvi.pressure(start.z))
        given = qvi.changed(mu=0.0 * qvi.mu, cohesion=bound, cap=np.full(qvi.m, np.inf))
        loose = solve_qvi(given, tolerance=_TOLERANCE)
        strict = solve_qvi(given, inner="strict-direct:clarabel", tolerance=_TOLERANCE)
        energies = [float(0.5 * s.z @ (given.K @ s.z) - given.f @ s.z) for s in (loose, strict)]
        scale = abs(energies[0])
        proof = both(certified_algebra(start), certified_algebra(loose), certified_algebra(strict))
        source = f"K strict ⊂ K collocated; μ = {friction:g}"
        difference = (energies[0] - energies[1]) / scale
        yield at_most("collocated less strict energy over their size", difference, 0.0, 1e-9, source, proof)


@PROBLEMS.on("strict-solvers", RECTANGLES)
def two_cone_solvers(element: Element, quick: bool) -> Iterator[Row]:
    """Cones through cvxpy against Clarabel itself, and both against the collocated problem where nothing slips."""
    (name, mesh), *_ = _meshes(quick)
    for friction in _frictions(quick):
        through, direct = (
            element.solve(_plate(friction, *mesh), inner=inner, tolerance=_TOLERANCE) for inner in _CONES
        )
        proof = certified(through, direct)
        quantity = f"P/2, μ = {friction:g} [{FORCE}]"
        yield relative(quantity, _force(direct), _force(through), 1e-7, f"cvxpy; {name}", proof, Kind.METHODS)
    stuck, strict = element.solve(_plate(0.5, *mesh)), _strictly(element, _plate(0.5, *mesh))
    source, proof = f"collocated, full stick; {name}", certified(stuck, strict)
    yield relative(f"P/2, μ = 0.5 [{FORCE}]", _force(strict), _force(stuck), 1e-9, source, proof, Kind.METHODS)


@PROBLEMS.on("strict-refinement", *BOTH, few=1)
def refinement(element: Element, quick: bool) -> Iterator[Row]:
    """Strict and collocated forces approach each other under refinement."""
    counts = (8, 16) if quick else (8, 16, 32)
    plates = [_plate(0.1, count) for count in counts]
    pairs = [(element.solve(plate, contact_rows="gauss"), _strictly(element, plate)) for plate in plates]
    apart = [abs(_force(strict) / _force(loose) - 1.0) for loose, strict in pairs]
    proof = certified(*[result for pair in pairs for result in pair])
    for first, second, n in zip(apart[:-1], apart[1:], counts[1:], strict=True):
        quantity = f"difference of P on {n}² cells over that on {n // 2}²"
        yield at_most(quantity, second / first, 1.0, 0.0, "both tend to the same limit", proof, Kind.METHODS)
    quantity = f"difference of P on {counts[-1]}² cells"
    yield absolute(quantity, apart[-1], 0.0, 1e-3, "strict against collocated", proof, Kind.METHODS)


def _meshes(quick: bool) -> Iterator[tuple[str, tuple[int, float]]]:
    yield from (_COARSE if quick else _MESHES).items()


def _frictions(quick: bool) -> tuple[float, ...]:
    return (0.1,) if quick else (0.05, 0.1, 0.2)


def _plate(friction: float, cells: int, grading: float = 1.0) -> ContactProblem:
    return compressed_plate(friction, (cells, cells), grading=grading)


def _strictly(element: Element, problem: ContactProblem) -> ContactResult:
    """With the law on whole edges: by Bernstein coefficients on triangles, by cones on rectangles."""
    options = {} if element.has_triangles else {"inner": _CONES[1]}
    return element.solve(problem, tolerance=_TOLERANCE, **options)


def _kept(result: ContactResult, where: str) -> Iterator[Row]:
    """Rows on the law between the points."""
    excess, pull = (value / mean_pressure(result.contacts["plate"]) for value in _sampled(result))
    source = f"|σ_T| ≤ μ|σ_N|; {where}"
    yield at_most("largest |σ_T| − bound over the mean pressure", excess, 0.0, EXCESS, source, certified(result))
    yield at_most("largest σ_N over the mean pressure", pull, 0.0, EXCESS, f"σ_N ≤ 0; {where}", certified(result))


def _force(result: ContactResult) -> float:
    return result.contacts["plate"].normal_force


def _sampled(result: ContactResult) -> tuple[float, float]:
    """Largest |σ_T| − μ|σ_N| and σ_N at 1000 points of every edge of the plate, ≥ 0 [stress]."""
    line = result.contacts["plate"]
    count = line.points_per_edge
    normal, tangential = (between_points(values, count) for values in (line.normal_stress, line.tangential_stress))
    friction = line.friction.reshape(-1, count)[:, :1]
    excess = np.abs(tangential) - friction * np.abs(normal)
    return float(max(excess.max(), 0.0)), float(max(normal.max(), 0.0))
