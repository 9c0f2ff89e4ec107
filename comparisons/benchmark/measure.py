"""The measurements, made in a process of their own (`worker`). All times are wall times in seconds."""

import gc
import math
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

import numpy as np

from comparisons.benchmark.naive import cvxpy_loop
from comparisons.benchmark.plan import TOLERANCE
from comparisons.benchmark.wall import wall
from qvi_contact import ContactProblem, ContactResult, discretize, solve
from qvi_contact.discretization.families import ElementName
from qvi_contact.gallery import compressed_plate
from solvers.basics.types import Sparse
from solvers.factorisation import factorise, resolve

_T = TypeVar("_T")
_NOTHING: Final = np.zeros(0, dtype=np.int64)
_PARTS: Final = ("factorisation", "interior_point", "certificate")
_WARM_UP: Final = 4  # cells of a solve that loads all libraries


class Emit(Protocol):
    """Takes a record."""

    def __call__(self, **record: Any) -> None: ...  # noqa: D102


def solves(
    emit: Emit,
    cells: int,
    friction: Sequence[float],
    factorisation: str,
    threads: int,
    repetitions: int,
    plain: Mapping[str, int],
) -> None:
    """Whole solves on n × n equal cells, in turn with plain factorisations of the same K.

    Records: "memory" after the first solve, "solve" for each friction and repetition, "plain" for each back end in
    `plain`, which says how often it is measured.
    """
    settings: dict[str, Any] = {"method": "condensed", "factorisation": factorisation, "threads": threads}
    _warm_up(settings, plain, threads)
    before = peak_memory()
    matrix = _Matrix(cells)
    for repetition in range(max(repetitions, *plain.values(), 0)):
        for number, mu in enumerate(friction if repetition < repetitions else ()):
            record = _attempt(partial(_whole, cells, mu, settings))
            if repetition == number == 0:
                emit(kind="memory", peak=record.pop("peak", None), imports=before)
            record.pop("peak", None)
            emit(kind="solve", friction=mu, **record)
        for backend, count in plain.items():
            if repetition < count:
                emit(kind="plain", backend=backend, **_attempt(partial(_factorised, matrix, backend, threads)))


class _Matrix:
    """K on n × n equal cells, assembled on first use: after the first solve, whose peak memory counts."""

    def __init__(self, cells: int) -> None:
        self._cells = cells

    @cached_property
    def K(self) -> Sparse:  # noqa: N802  # the matrix of (D2)
        """The matrix."""
        return discretize(compressed_plate(0.2, cells=(self._cells, self._cells)), element="bfs").qvi.K


def _warm_up(settings: dict[str, Any], plain: Iterable[str], threads: int) -> None:
    """Load all libraries."""
    small = compressed_plate(0.2, cells=(_WARM_UP, _WARM_UP))
    _attempt(partial(_timed, small, settings))
    for backend in plain:
        _attempt(partial(_factorised, _Matrix(_WARM_UP), backend, threads))


def loop(emit: Emit, cells: int, friction: float, threads: int, options: dict[str, Any]) -> None:
    """One run of another method; the record is "loop"."""
    discretization = discretize(compressed_plate(friction, cells=(cells, cells)), element="bfs")

    def run() -> dict[str, Any]:
        start = time.perf_counter()
        if options:
            found = _answer(solve(discretization, tolerance=TOLERANCE, threads=threads, **options))
        else:
            found = cvxpy_loop(discretization, TOLERANCE)
        return {**found, "seconds": {"solve": time.perf_counter() - start}}

    emit(kind="loop", **_attempt(run))


def accuracy(
    emit: Emit,
    meshes: Sequence[tuple[int, float]],
    friction: Sequence[float],
    factorisation: str,
    threads: int,
    repetitions: int,
) -> None:
    """Whole solves on graded meshes, from `discretize` to the certified result; a record "graded" for each."""
    settings: dict[str, Any] = {"method": "condensed", "factorisation": factorisation, "threads": threads}
    _warm_up(settings, (), threads)
    for cells, grading in meshes:
        for mu in friction:
            record = _repeated(cells, grading, mu, settings, repetitions)
            emit(kind="graded", cells=cells, grading=grading, friction=mu, **record)


def of_wall(emit: Emit, blocks: int, load: float, element: ElementName, threads: int) -> None:
    """One wall in CPU seconds; the record is "wall"."""
    emit(kind="wall", **_attempt(partial(_wall, blocks, load, element, threads)))


def _wall(blocks: int, load: float, element: ElementName, threads: int) -> dict[str, Any]:
    """Its solve, after a small one that loads all libraries, and then a plain factorisation of the same K."""
    solve(wall(2, load), element=element, method="condensed", system="sparse", threads=threads)
    discretization, assembly = _cpu(partial(discretize, wall(blocks, load), element=element))
    result, seconds = _cpu(partial(solve, discretization, method="condensed", tolerance=TOLERANCE, threads=threads))
    peak, K, solution, accuracy = peak_memory(), discretization.qvi.K, result.solution, result.certificate.accuracy
    found = {
        "status": result.status.value, "message": "" if solution.solved else result.message, "unknowns": K.shape[0],
        "contact_points": solution.problem.m, "form": solution.form, "iterations": result.iterations,
        "accuracy": accuracy if math.isfinite(accuracy) else None,
    }  # fmt: skip
    del result, solution, discretization
    gc.collect()
    _, plain = _cpu(partial(factorise, K, _NOTHING, resolve(), threads))
    return {**found, "assembly": assembly, "factorisation": plain, "solve": seconds, "peak": peak}


def _cpu(work: Callable[[], _T]) -> tuple[_T, float]:
    """What it returns, and the CPU seconds of the process."""
    began = time.process_time()
    return work(), time.process_time() - began


def _repeated(cells: int, grading: float, mu: float, settings: dict[str, Any], repetitions: int) -> dict[str, Any]:
    """The last answer on a graded mesh, and the seconds of all repetitions."""
    record: dict[str, Any] = {}
    seconds: list[float] = []
    for _ in range(repetitions):
        record = _attempt(partial(_timed, compressed_plate(mu, cells=(cells, cells), grading=grading), settings))
        seconds += [record["seconds"]["whole"]] if record["seconds"] else []
    return {**record, "seconds": seconds}


def _whole(cells: int, friction: float, settings: dict[str, Any]) -> dict[str, Any]:
    """One solve from the problem to the certified result, then `discretize` alone on a problem of its own."""
    gc.collect()
    record = _timed(compressed_plate(friction, cells=(cells, cells)), settings)
    record["peak"] = peak_memory()
    problem = compressed_plate(friction, cells=(cells, cells))
    start = time.perf_counter()
    discretize(problem, element="bfs")
    record["seconds"]["assembly"] = time.perf_counter() - start
    seconds = record["seconds"]
    seconds["solve"] = seconds["whole"] - seconds["assembly"]
    seconds["rest"] = seconds["solve"] - sum(seconds[part] for part in _PARTS)
    return record


def _timed(problem: ContactProblem, settings: dict[str, Any]) -> dict[str, Any]:
    start = time.perf_counter()
    result = solve(problem, element="bfs", tolerance=TOLERANCE, **settings)
    whole = time.perf_counter() - start
    timings = dict(result.solution.timings)
    parts = {
        "factorisation": _factorisation_seconds(result),
        "interior_point": timings.get("interior point", timings.get("solve", 0.0)),
        "certificate": timings.get("certificate", 0.0),
    }
    return {**_answer(result), "seconds": {"whole": whole, **parts}, "timings": timings}


def _answer(result: ContactResult) -> dict[str, Any]:
    """What became of a solve, as plain data."""
    solution, accuracy = result.solution, result.certificate.accuracy
    return {
        "status": result.status.value,
        "message": result.message,
        "unknowns": solution.problem.n,
        "contact_points": solution.problem.m,
        "iterations": result.iterations,
        "corrections": len(solution.corrections),
        "accuracy": accuracy if math.isfinite(accuracy) else None,
        "half_force": result.contacts["plate"].normal_force if result.has_state else None,
        "factorisation": solution.factorisation,
    }


def _factorisation_seconds(result: ContactResult) -> float:
    """Analysis and elimination together, with the Schur complement, as the factorisation itself counts them."""
    factor = result.solution.problem.operator.factor
    return float(sum(factor.seconds.values())) if factor is not None else 0.0


def _factorised(matrix: _Matrix, backend: str, threads: int) -> dict[str, Any]:
    """One plain factorisation, without Schur complement."""
    K = matrix.K
    gc.collect()
    start = time.perf_counter()
    factor = factorise(K, _NOTHING, backend, threads)
    seconds = {"plain": time.perf_counter() - start, **factor.seconds}
    factor.release()
    unknowns = int(K.shape[0])
    return {"status": "done", "message": "", "unknowns": unknowns, "version": factor.version, "seconds": seconds}


def _attempt(measure: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The measurement, or the error that ended it."""
    try:
        return measure()
    except Exception as error:
        return {"status": "error", "message": f"{type(error).__name__}: {error}", "seconds": {}}


def peak_memory() -> int | None:
    """Largest resident memory of this process so far [bytes]; None where the system does not tell."""
    with suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):  # ru_maxrss would begin with that of the process that started this one
                return 1024 * int(line.split()[1])
    with suppress(ImportError):
        import resource

        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return int(peak) if sys.platform == "darwin" else 1024 * int(peak)
    return None


TASKS: Final[dict[str, Callable[..., None]]] = {
    "solves": solves, "loop": loop, "accuracy": accuracy, "wall": of_wall
}  # fmt: skip
"""What `worker` can do, by name."""
