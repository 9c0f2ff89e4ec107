"""The measurements: what is done for one case of each study. Times are wall times [s], of walls CPU times."""

import gc
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from comparisons.benchmark.naive import cvxpy_loop
from comparisons.benchmark.study import GENERAL, METHODS
from comparisons.benchmark.wall import wall_of
from qvi_contact import ContactProblem, ContactResult, discretize, solve
from qvi_contact.gallery import compressed_plate
from qvi_contact.runs import THREADS
from solvers.basics.types import Sparse
from solvers.factorisation import available_backends, factorise, resolve

TOLERANCE: Final = 1e-8
"""That the certificate of every solve must confirm."""

TOO_LONG: Final = 60.0
"""Seconds beyond which a plain factorisation is not measured."""

_T = TypeVar("_T")
_THREADS: Final = int(os.environ.get(THREADS[0], "1"))
_NOTHING: Final = np.zeros(0, dtype=np.int64)
_PARTS: Final = ("factorisation", "interior_point", "certificate")
_WARM_UP: Final = 4  # cells a side of a solve that loads all libraries
_REPETITIONS: Final = ((128, 5), (512, 3))  # up to so many cells a side; beyond the last one, two
_OFTEN: Final = 10.0  # seconds up to which other libraries' factorisations are repeated
_FREE: Final = 128  # cells a side up to which nothing is predicted, and of the problem that a prediction starts from
_LOOP_RUNS: Final = 3
_LOOP_BUDGET: Final = 10.0  # seconds after which a loop is not repeated


def repetitions(cells: int, runs: int | None) -> int:
    """Of a whole solve on this many cells a side, unless their number is given."""
    return runs or next((count for most, count in _REPETITIONS if cells <= most), 2)


def whole(case: Mapping[str, Any]) -> dict[str, Any]:
    """Whole solves on n × n equal cells for each μ, in turn with plain factorisations of the same K.

    "solves" has an entry for each μ, see `_whole`, "plain" one for each back end, see `_factorised`; their "seconds"
    are the times of all repetitions. "peak" is the largest resident memory [bytes] after the first solve, "imports"
    before it.
    """
    cells, count, backend = case["cells"], repetitions(case["cells"], case["runs"]), case["sparse"]
    settings = _settings(backend)
    _attempt(partial(_timed, compressed_plate(0.2, cells=(_WARM_UP, _WARM_UP)), settings))
    imports, peak, K = peak_memory(), None, None
    solves: dict[float, list[dict[str, Any]]] = {mu: [] for mu in case["friction"]}
    plain: dict[str, list[dict[str, Any]]] = {}
    often: dict[str, int] = {}
    for turn in range(count):
        for mu, found in solves.items():
            found.append(_attempt(partial(_whole, cells, mu, settings)))
            measured = found[-1].pop("peak", None)
            peak = peak or measured
        if K is None:  # after the first solve, whose peak memory counts
            K = _matrix(cells)
            often = _beside(case["path"], backend, cells, count, plain)
        for name, most in often.items():
            if turn < most:
                plain.setdefault(name, []).append(_attempt(partial(_factorised, K, name)))
    return {
        "solves": [{"friction": mu, **_together(found)} for mu, found in solves.items()],
        "plain": [{"backend": name, **_together(found)} for name, found in plain.items()],
        "peak": peak, "imports": imports,
    }  # fmt: skip


def _settings(factorisation: str) -> dict[str, Any]:
    return {"method": "condensed", "factorisation": factorisation, "threads": _THREADS}


def _matrix(cells: int) -> Sparse:
    """K of the plate on n × n equal cells."""
    return discretize(compressed_plate(0.2, cells=(cells, cells)), element="bfs").qvi.K


def _beside(path: str, own: str, cells: int, count: int, plain: dict[str, list[dict[str, Any]]]) -> dict[str, int]:
    """How often each back end factorises K beside a path; what would take too long is told in `plain`."""
    if path != GENERAL:
        return {own: count}
    small = _matrix(_FREE) if cells > _FREE else None
    expected = {
        backend: 0.0 if small is None else predicted(_probed(small, backend), _FREE**2, cells**2)
        for backend in available_backends()
    }
    return affordable(expected, own, count, plain)


def affordable(
    expected: Mapping[str, float], own: str, count: int, plain: dict[str, list[dict[str, Any]]]
) -> dict[str, int]:
    """How often each back end is measured: `own` every time, others by the seconds that are expected of them.

    What would take more than `TOO_LONG` is not measured; that is told in `plain`.
    """
    often = {}
    for backend, seconds in expected.items():
        if seconds > TOO_LONG and backend != own:
            message = f"not run: about {seconds:.0f} s expected"
            plain[backend] = [{"status": "skipped", "message": message, "seconds": {}}]
        else:
            often[backend] = count if backend == own or seconds <= _OFTEN else 1
    return often


def _probed(K: Sparse, backend: str) -> float:
    """Seconds of one plain factorisation; 0 if it fails."""
    return float(_attempt(partial(_factorised, K, backend))["seconds"].get("plain", 0.0))


def predicted(seconds: float, known: int, wanted: int) -> float:
    """Seconds of a sparse factorisation of a plane problem from those of another size: they grow like unknowns^1.5."""
    return float(seconds * (wanted / known) ** 1.5)


def _together(found: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The first repetition that went wrong, or the last one, with the times of all."""
    shown = next((each for each in found if each["status"] not in ("solved", "done")), found[-1])
    parts = dict.fromkeys(part for each in found for part in each["seconds"])
    times = {part: [each["seconds"][part] for each in found if part in each["seconds"]] for part in parts}
    return {**shown, "seconds": times}


def _attempt(measure: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The measurement, or the error that ended it."""
    try:
        return measure()
    except Exception as error:
        return {"status": "error", "message": f"{type(error).__name__}: {error}", "seconds": {}}


def _whole(cells: int, friction: float, settings: dict[str, Any]) -> dict[str, Any]:
    """One solve from the problem to the certified result, then `discretize` alone on a problem of its own.

    The parts of "seconds" are those of `measures.PARTS`.
    """
    gc.collect()
    record = _timed(compressed_plate(friction, cells=(cells, cells)), settings)
    record["peak"] = peak_memory()
    _, assembly = _clocked(time.perf_counter, lambda: _discretised(friction, cells))
    seconds = record["seconds"]
    seconds |= {"assembly": assembly, "solve": seconds["whole"] - assembly}
    seconds["rest"] = seconds["solve"] - sum(seconds[part] for part in _PARTS)
    return record


def _discretised(friction: float, cells: int) -> Any:
    return discretize(compressed_plate(friction, cells=(cells, cells)), element="bfs")


def _clocked(clock: Callable[[], float], work: Callable[[], _T]) -> tuple[_T, float]:
    """What it returns, and its seconds by this clock."""
    began = clock()
    found = work()
    return found, clock() - began


def _timed(problem: ContactProblem, settings: dict[str, Any]) -> dict[str, Any]:
    solving = partial(solve, problem, element="bfs", tolerance=TOLERANCE, **settings)
    result, seconds = _clocked(time.perf_counter, solving)
    timings, factor = result.solution.timings, result.solution.problem.operator.factor
    parts = {
        "factorisation": float(sum(factor.seconds.values())) if factor is not None else 0.0,  # with Schur complement
        "interior_point": timings.get("interior point", timings.get("solve", 0.0)),
        "certificate": timings.get("certificate", 0.0),
    }
    return {**_answer(result), "seconds": {"whole": seconds, **parts}}


def _answer(result: ContactResult) -> dict[str, Any]:
    """What became of a solve, as plain data."""
    solution = result.solution
    return {
        "status": result.status.value, "message": result.message, "unknowns": solution.problem.n,
        "contact_points": solution.problem.m, "iterations": result.iterations,
        "corrections": len(solution.corrections), "accuracy": result.certificate.accuracy,
        "half_force": result.contacts["plate"].normal_force if result.has_state else None,
        "library": solution.factorisation,
    }  # fmt: skip


def _factorised(K: Sparse, backend: str) -> dict[str, Any]:
    """One plain factorisation, without Schur complement."""
    gc.collect()
    factor, seconds = _clocked(time.perf_counter, lambda: factorise(K, _NOTHING, backend, _THREADS))
    found = {"status": "done", "message": "", "unknowns": int(K.shape[0]), "version": factor.version,
             "seconds": {"plain": seconds, **factor.seconds}}  # fmt: skip
    factor.release()
    return found


def graded(case: Mapping[str, Any]) -> dict[str, Any]:
    """Whole solves on a graded mesh, from `discretize` to the certified result: the last answer, all times."""
    (cells, grading), mu, settings = case["mesh"], case["friction"], _settings(case["sparse"])
    _timed(compressed_plate(0.2, cells=(_WARM_UP, _WARM_UP)), settings)
    found = [_timed(compressed_plate(mu, cells=(cells, cells), grading=grading), settings) for _ in range(case["runs"])]
    return {**found[-1], "seconds": [each["seconds"]["whole"] for each in found]}


def loop(case: Mapping[str, Any]) -> dict[str, Any]:
    """Another method, on a problem that is discretised before any time is taken; repeated where it is quick."""
    options: dict[str, Any] = METHODS[case["loop"]].options
    seconds: list[float] = []
    found: dict[str, Any] = {}
    while len(seconds) < _LOOP_RUNS and sum(seconds) < _LOOP_BUDGET:
        discretization = _discretised(case["friction"], case["cells"])
        solving = partial(solve, discretization, tolerance=TOLERANCE, threads=_THREADS, **options)
        by_hand = partial(cvxpy_loop, discretization, TOLERANCE)
        began = time.perf_counter()
        found = _answer(solving()) if options else by_hand()
        seconds.append(time.perf_counter() - began)
    return {**found, "seconds": seconds}


def wall(case: Mapping[str, Any]) -> dict[str, Any]:
    """A wall's solve, after a small one that loads all libraries, and then a plain factorisation of the same K."""
    blocks, load, element = case["blocks"], case["load"], case["element"]
    solve(wall_of(2, load), element=element, method="condensed", system="sparse", threads=_THREADS)
    cpu = partial(_clocked, time.process_time)
    discretization, assembly = cpu(partial(discretize, wall_of(blocks, load), element=element))
    result, seconds = cpu(partial(solve, discretization, method="condensed", tolerance=TOLERANCE, threads=_THREADS))
    peak, K, solution = peak_memory(), discretization.qvi.K, result.solution
    found = {
        "status": result.status.value, "message": "" if solution.solved else result.message, "unknowns": K.shape[0],
        "contact_points": solution.problem.m, "form": solution.form, "iterations": result.iterations,
        "accuracy": result.certificate.accuracy,
    }  # fmt: skip
    del result, solution, discretization
    gc.collect()
    _, plain = cpu(lambda: factorise(K, _NOTHING, resolve(), _THREADS))
    return {**found, "assembly": assembly, "factorisation": plain, "solve": seconds, "peak": peak}


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
