r"""The problems on which loops over the friction bound are compared, by name, mesh and friction.

plate       the paper's quarter plate with the paper's elements (`paper.plate`); all of it sticks from μ = 0.25 on
ssnv128     Code_Aster's SSNV128 on triangles, with the law at Gauss points; opens, slips and sticks, hard from μ = 2 on
block       a block on triangles, under the pressure p = 1, dragged by uniform shear T = 0.1: carried for μ > 0.1
contacts    no mesh: unknowns are the tractions of 8 points; solution and contraction of the loop are known exactly

**Contacts.** z = (p, t), σ_N = −p, σ_T = t, K = [[I, C], [C, I]], C = Q diag(c) Qᵀ with orthonormal cosine vectors Q
and c = 0.8, 0.7, …, 0.1. For any pressures p* > 0 and push q* > 0 the loads

    f_N = p* + C t*,    f_T = C p* + t* + q*,    t* = μ p*

make (p*, t*) a solution that slips everywhere, with m_T = q*. There p = f_N − μ C s, so that the plain loop multiplies
errors by −μ C: its contraction is 0.8 μ, that damped by θ is max |1 − θ − θ μ c|, and it converges for μ < 1.25 only.
"""

import time
from functools import lru_cache
from statistics import median
from typing import Any, Final, NamedTuple

import numpy as np
from pandas import DataFrame
from scipy.fft import dct
from scipy.sparse import csc_array

from qvi_contact import Contact, ContactProblem, Material, Traction, TriangleMesh, discretize, paper
from qvi_contact.gallery import ssnv128
from qvi_contact.problem.conditions import Condition
from solvers import FrictionQVI, QVISolution, solve_qvi

PLACE: Final = ["problem", "cells", "friction"]
"""Columns that identify a problem, see `body`."""

NAMES: Final = {"contacts": "8 contacts", "block": "dragged block", "ssnv128": "SSNV128"}
"""Problem → its name in texts, if it differs."""

POINTS: Final = 8
"""Points of the problem without a mesh."""

COUPLINGS: Final = np.arange(POINTS, 0, -1) / 10.0
"""Eigenvalues c of the coupling of "contacts"."""

_PUSH: Final = 0.1 + 0.05 * np.sin(1.0 + np.arange(POINTS) ** 2)  # q*, with a part of every mode


class Body(NamedTuple):
    """A dimensionless problem; its units of resultants [stress × length] and displacements [length], 1 without mesh."""

    qvi: FrictionQVI
    force: float = 1.0
    displacement: float = 1.0


def dragged_block(
    friction: float, cells: tuple[int, int], shear: float = 0.1, pressure: float = 1.0, young: float = 1000.0
) -> ContactProblem:
    """A block [0, 2] × [0, 1] under pressure, dragged over its base by uniform shear; ν = 0.3."""
    conditions: list[Condition] = [
        Traction("top", x=shear, y=-pressure), Traction("right", x=0.0, y=shear), Traction("left", x=0.0, y=-shear),
        Contact("bottom", friction=friction, name="base"),
    ]  # fmt: skip
    return ContactProblem(TriangleMesh.rectangle(cells, 2.0, 1.0), Material(young, 0.3), conditions)


def contacts(friction: float) -> FrictionQVI:
    """The problem "contacts", without a mesh."""
    Q = dct(np.eye(POINTS), norm="ortho", axis=0)
    C = (Q.T * COUPLINGS) @ Q
    p = 1.0 + 0.3 * np.cos(np.arange(POINTS))
    t = friction * p
    unit, zero = np.eye(2 * POINTS), np.zeros(POINTS)
    return FrictionQVI.from_arrays(
        K=csc_array(np.block([[np.eye(POINTS), C], [C, np.eye(POINTS)]])),
        f=np.concatenate([p + C @ t, C @ p + t + _PUSH]),
        N=csc_array(-unit[:POINTS]), n0=zero, T=csc_array(unit[POINTS:]), t0=zero,
        mu=np.full(POINTS, friction), W=np.ones(POINTS),
    )  # fmt: skip


def body(problem: str, cells: int, friction: float) -> Body:
    """Build a problem by its name, with `cells` a side (along the height), 0 without a mesh."""
    if problem == "contacts":
        return Body(contacts(friction))
    if problem == "plate":
        plate = paper.plate(friction, (cells, cells))
        return Body(plate.qvi, plate.stress_unit * plate.length_unit, plate.displacement)
    block = ssnv128((cells, cells), friction) if problem == "ssnv128" else dragged_block(friction, (2 * cells, cells))
    discretization = discretize(block, law_on="points")
    scales = discretization.scales
    return Body(discretization.qvi, scales.stress * scales.length, scales.displacement)


class Reference(NamedTuple):
    """A problem, its solution by the condensed method, and the dimensionless resultant of σ_N of the solution."""

    body: Body
    solution: QVISolution
    resultant: float


@lru_cache(maxsize=8)
def reference(problem: str, cells: int, friction: float) -> Reference:
    """The reference of a problem; the last eight are kept, since many cases share one."""
    found = body(problem, cells, friction)
    solution = solve_qvi(found.qvi, method="condensed", tolerance=1e-9)
    if not solution.solved:
        raise ArithmeticError(f"no reference: {solution.message}")
    return Reference(found, solution, found.qvi.resultant(solution.z))


# Solves of the studies of loops: times, entries of rows, and frames of these rows.


REPEATS: Final = 3
"""Repetitions of a quick solve."""

_BUDGET: Final = 0.5  # seconds after which no further repetition begins


def timed(place: tuple[str, int, float], **options: Any) -> tuple[QVISolution, list[float]]:
    """The solution, and the times of solves [s], each of a problem built anew, so that none finds a factorisation."""
    seconds: list[float] = []
    while True:
        qvi = body(*place).qvi
        began = time.perf_counter()
        solution = solve_qvi(qvi, **options)
        seconds.append(time.perf_counter() - began)
        if len(seconds) == REPEATS or sum(seconds) > _BUDGET:
            return solution, seconds


def ending(solution: QVISolution) -> dict[str, Any]:
    """Status, message, iterations; of the certificate whether it passed, tolerance, accuracy and worst measure."""
    return {
        "status": solution.status.value, "message": solution.message, "iterations": solution.iterations,
        "certificate": {
            name: getattr(solution.certificate, name) for name in ("passed", "tolerance", "accuracy", "worst")
        },
    }  # fmt: skip


def in_words(runs: DataFrame) -> DataFrame:
    """The runs with median times, and in words "name", the problem, and "body", the problem with its mesh."""
    names = runs.problem.replace(NAMES)
    bodies = names + [f", {cells}²" if cells else "" for cells in runs.cells]
    return runs.assign(seconds=runs.seconds.map(median, na_action="ignore"), name=names, body=bodies)
