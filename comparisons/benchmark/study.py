"""The studies of the benchmark and their tasks: whole solves, sequences, walls.

Every case has a process of its own, so that peak memory and times do not depend on earlier cases. Times of whole solves
are wall times [s], of sequences and walls CPU times. Solves use the defaults of `solve`.
"""

import gc
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np

from comparisons.lab.studies import Study
from comparisons.peers.codes.process import peak_memory
from qvi_contact import ContactResult, TriangleMesh, discretize, solve, solve_history, solve_sweep
from qvi_contact.errors import InputError
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Polynomial, Traction
from qvi_contact.runs.processes import THREADS
from qvi_contact.solution.settings import Parameter
from qvi_contact.solution.sweep import SweepTask
from qvi_contact.types import Field
from solvers.basics.types import Sparse
from solvers.factorisation.choice import CHOICES, available_backends, factorise, resolve

TOLERANCE: Final = 1e-8
"""Tolerance of the certificate of every solve."""


def _study(name: str, version: int, cases: Iterable[dict[str, Any]], **limits: Any) -> Study:
    """A study of this module, by the name of its task; each case has a process of its own."""
    reported = "benchmark" if name == "whole" else f"benchmark-{name}"
    return Study(reported, version, f"comparisons.benchmark.study:solve_{name}", [*cases], fresh=True, **limits)


def whole(cells: Sequence[int], friction: Sequence[float], factorisation: str) -> Study:
    """Whole solves on equal cells."""
    if factorisation not in CHOICES:
        raise InputError("factorisation", factorisation, f"choose one of {', '.join(CHOICES)}")
    fixed = {"friction": sorted(set(friction)), "sparse": resolve(factorisation)}
    return _study("whole", 2, ({"cells": each, **fixed} for each in sorted(set(cells))))


def sequences(quick: bool = False) -> Study:
    """Histories and sweeps, each solved in the three ways of `WAYS`, on one thread."""
    return _study("sequences", 2, ({"sequence": name, "quick": quick} for name in CHAINS), threads=1)


def walls(blocks: Sequence[int], loads: Sequence[float]) -> Study:
    """Walls of n × n blocks, pushed from the side by a share of their weight."""
    cases = product(sorted(set(loads)), sorted(set(blocks)))
    return _study("wall", 2, ({"load": load, "blocks": each} for load, each in cases))


# whole solves and factorisations

_THREADS: Final = int(os.environ.get(THREADS[0], "1"))
_NOTHING: Final = np.zeros(0, dtype=np.int64)
PARTS: Final = ("whole", "assembly", "solve", "factorisation", "interior_point", "certificate", "rest")
"""Times of a solve [s]: whole = assembly + solve; the other four are parts of solve."""

_WARM_UP: Final = 4  # cells a side of a first solve, which loads all libraries
_REPETITIONS: Final = ((32, 5), (64, 3))  # most cells a side, repetitions; two for more cells


def solve_whole(case: Mapping[str, Any]) -> dict[str, Any]:
    """Whole solves on n × n equal cells for each μ, in turn with plain factorisations of the same K.

    "solves" has an entry for each μ, see `_whole`, "plain" one for each back end, see `_factorised`; their "seconds"
    are the times of all repetitions (on large meshes one only for back ends other than the solve's). "peak" is the
    largest resident memory [bytes] after the first solve.
    """
    cells, backend = case["cells"], case["sparse"]
    settings = {"method": "condensed", "factorisation": backend, "threads": _THREADS, "tolerance": TOLERANCE}
    solve(_plate(0.2, _WARM_UP), **settings)
    solves: dict[float, list[dict[str, Any]]] = {mu: [] for mu in case["friction"]}
    plain: dict[str, list[dict[str, Any]]] = {}
    for turn in range(next((count for most, count in _REPETITIONS if cells <= most), 2)):
        for mu, found in solves.items():
            found.append(_whole(cells, mu, settings))
        if turn == 0:
            K = discretize(_plate(0.2, cells)).qvi.K
        for name in available_backends():
            if turn == 0 or name == backend or cells <= _REPETITIONS[0][0]:
                plain.setdefault(name, []).append(_factorised(K, name))
    return {
        "solves": [{"friction": mu, **_together(found)} for mu, found in solves.items()],
        "plain": [{"backend": name, **_together(found)} for name, found in plain.items()],
        "peak": next(iter(solves.values()))[0]["peak"],
    }  # fmt: skip


def _together(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The first failed repetition, or else the last one, with the times of all repetitions."""
    shown = next((each for each in found if each["status"] not in ("solved", "done")), found[-1])
    seconds = {part: [each["seconds"][part] for each in found] for part in shown["seconds"]}
    return {name: value for name, value in shown.items() if name != "peak"} | {"seconds": seconds}


def _plate(friction: float, cells: int) -> ContactProblem:
    return compressed_plate(friction, cells=(cells, cells))


def _whole(cells: int, friction: float, settings: Mapping[str, Any]) -> dict[str, Any]:
    """One solve from the problem to the certified result, then `discretize` alone on another problem.

    "seconds" has the times of `PARTS`.
    """
    gc.collect()
    began = time.perf_counter()
    result = solve(_plate(friction, cells), **settings)
    whole, peak, solution = time.perf_counter() - began, peak_memory(), result.solution
    timings, factor = solution.timings, solution.problem.stiffness.factor
    parts = {
        "factorisation": float(sum(factor.seconds.values())) if factor is not None else 0.0,  # Schur complement too
        "interior_point": timings.get("interior point", timings.get("solve", 0.0)),
        "certificate": timings.get("certificate", 0.0),
    }
    record = {
        "status": result.status.value, "message": result.message, "unknowns": solution.problem.n, "peak": peak,
        "iterations": result.iterations, "accuracy": result.certificate.accuracy, "library": solution.factorisation,
        "half_force": result.contacts["plate"].normal_force if result.has_state else None,
    }  # fmt: skip
    del result, solution, factor
    began = time.perf_counter()
    discretize(_plate(friction, cells))
    assembly = time.perf_counter() - began
    rest = whole - assembly - sum(parts.values())
    return record | {
        "seconds": {"whole": whole, **parts, "assembly": assembly, "solve": whole - assembly, "rest": rest}
    }


def _factorised(K: Sparse, backend: str) -> dict[str, Any]:
    """One plain factorisation, without Schur complement."""
    gc.collect()
    began = time.perf_counter()
    factor = factorise(K, _NOTHING, backend, _THREADS)
    seconds = {"plain": time.perf_counter() - began, **factor.seconds}
    return {"status": "done", "message": "", "version": factor.version, "seconds": seconds}


def solve_wall(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a wall, after a small solve that loads all libraries; then one plain factorisation of the same K."""
    blocks, load = case["blocks"], case["load"]
    solve(wall_of(2, load), method="condensed", system="sparse", threads=_THREADS)
    began = time.process_time()
    discretization = discretize(wall_of(blocks, load))
    ready = time.process_time()
    result = solve(discretization, method="condensed", tolerance=TOLERANCE, threads=_THREADS)
    times = {"assembly": ready - began, "solve": time.process_time() - ready}
    peak, K, solution = peak_memory(), discretization.qvi.K, result.solution
    found = {
        "status": result.status.value, "message": "" if solution.solved else result.message, "unknowns": K.shape[0],
        "contact_points": solution.problem.m, "form": solution.form, "iterations": result.iterations,
        "accuracy": result.certificate.accuracy,
    }  # fmt: skip
    del result, solution, discretization
    gc.collect()
    began = time.process_time()
    factorise(K, _NOTHING, resolve(), _THREADS)
    return {**found, **times, "factorisation": time.process_time() - began, "peak": peak}


# sequences of problems

_DEPTH: Final = 0.01


class Chain(NamedTuple):
    """A sequence of problems."""

    title: str  # name in tables
    problem: Callable[[tuple[int, int]], ContactProblem]  # by numbers of cells
    cells: tuple[int, int]
    coarse: tuple[int, int]  # cells of a quick run
    parameter: Parameter  # the datum that changes
    values: Sequence[float]  # its values; a quick run takes every fifth
    history: bool = False  # whether slip accumulates over the steps


_PUNCH: Final = Polynomial([[2.0 * _DEPTH], [-4.0 * _DEPTH], [2.0 * _DEPTH]])
"""The gap 2 (x − 1)² times `_DEPTH`."""


def layer(cells: tuple[int, int], gap: Field = -_DEPTH, offset: float = 0.0) -> ContactProblem:
    """A layer on a rigid base, 2 wide and 1 high, under a rough obstacle."""
    mesh = TriangleMesh.rectangle(cells, 2.0, 1.0)
    sides = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    held = Displacement("bottom", x=0.0, y=0.0)
    return ContactProblem(mesh, Material(1000.0, 0.3), [Contact("top", 0.3, gap, offset, "obstacle"), held, *sides])


CHAINS: Final = {
    "cycle": Chain(
        "history: 21 offsets of a full cycle, layer 32 × 64", layer, (64, 32), (16, 8), "offset",
        (_DEPTH * np.sin(np.linspace(0.0, 2.0 * np.pi, 21))).tolist(), history=True,
    ),
    "friction": Chain(
        "sweep: 20 values of μ, plate 32 × 32", partial(compressed_plate, 0.2), (32, 32), (8, 8), "friction",
        np.linspace(0.05, 1.0, 20).tolist(),
    ),
    "compression": Chain(
        "sweep: 11 compressions, sheared layer 32 × 64", partial(layer, gap=0.0, offset=0.5 * _DEPTH),
        (64, 32), (16, 8), "gap", np.linspace(-0.5 * _DEPTH, -_DEPTH, 11).tolist(),
    ),
    "depth": Chain(
        "sweep: 11 depths of a round punch, layer 32 × 64", partial(layer, gap=_PUNCH), (64, 32), (16, 8), "gap",
        np.linspace(-0.2 * _DEPTH, -2.0 * _DEPTH, 11).tolist(),
    ),
}  # fmt: skip
"""Name → sequence. In "depth" the contact grows with each problem."""


WAYS: Final = ("single", "cold", "warm")
"""Each problem by itself; one factorisation for all; one factorisation, and a start from the problem before."""

EVERY: Final = 4
"""Single solves take every fourth problem."""


def solve_sequences(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a sequence in all ways, one after the other in this process.

    Meshes keep matrices, so each way, and each single solve, has a new mesh. Single solves of a history do not know the
    slip of earlier steps; only their times are used. Every way has lists, an entry for each problem (single solves: for
    every fourth): processor seconds, status, accuracy, normal and tangential force on the contact.
    """
    chain, every = CHAINS[case["sequence"]], 5 if case["quick"] else 1
    values = chain.values[::every]

    def new_task() -> SweepTask:
        base = chain.problem(chain.coarse if case["quick"] else chain.cells)
        return SweepTask(base, chain.parameter, tuple(contact.name for contact in base.contacts))

    names = ("seconds", "status", "accuracy", "normal", "tangential")
    found: dict[str, Any] = {}
    for way in WAYS:
        entries: list[tuple[Any, ...]] = []
        last = [0.0]

        def record(_: int, result: ContactResult, entries: list[Any] = entries, last: list[float] = last) -> None:
            seconds, line = time.process_time() - last[0], next(iter(result.contacts.values()))
            accuracy = result.certificate.accuracy
            entries.append((seconds, str(result.status), accuracy, line.normal_force, line.tangential_force))
            last[0] = time.process_time()

        if way == "single":
            for problem in [new_task().changed(value) for value in values[::EVERY]]:
                last[0] = time.process_time()
                record(0, solve(problem))
        else:
            task = new_task()
            problems = [task.changed(value) for value in values]
            last[0] = time.process_time()
            if chain.history:
                solve_history(problems, record, warm_start=way == "warm")
            else:
                solve_sweep(task.problem, chain.parameter, values, callback=record, warm_start=way == "warm")
        found[way] = dict(zip(names, map(list, zip(*entries, strict=True)), strict=True))
    return found


# walls

_CELLS: Final = 4  # cells along a side of a block
_WEIGHT: Final = 24.0  # kN/m³
_FRICTION: Final = 0.6


def wall_of(blocks: int, load: float) -> ContactProblem:
    """A wall of blocks × blocks metres on the ground, under its weight and a push from the left of `load` times it.

    Units are m and kPa. For load = 0.02 only single edges slip, for 0.3 beds open and slip; with the friction 0.6 every
    bed slides as a whole at 0.6.
    """
    cells, size = _CELLS * blocks, float(blocks)
    lines = np.linspace(0.0, size, cells + 1)
    beds = {f"bed {course}": ((0.0, float(course)), (size, float(course))) for course in range(1, blocks)}
    mesh = TriangleMesh.grid(lines, lines, joints=beds)
    free = [Traction(edges, x=0.0, y=0.0) for edges in ("right", "top")]
    contacts = [Contact(name, friction=_FRICTION) for name in ("bottom", *beds)]
    push = Traction("left", x=load * _WEIGHT * size, y=0.0)
    weight = {"body_potential": lambda x, y: _WEIGHT * y + 0.0 * x}
    return ContactProblem(mesh, Material(5e6, 0.2), [push, *free, *contacts], **weight)  # type: ignore[arg-type]
