"""The study: a sweep into a fresh store, by so many processes, each several times."""

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from comparisons.lab.study import Study
from qvi_contact import solve_sweep
from qvi_contact.gallery import compressed_plate
from solvers import Status

PROCESSES: Final = (1, 2)
REPEATS: Final = 2

CELLS: Final = {False: 32, True: 6}
"""Cells across the plate, by whether it is a quick run."""

VALUES: Final = {False: 400, True: 24}
"""Values of friction, evenly from 0.05 to 1."""


def declared(processes: Sequence[int], quick: bool) -> Study:
    """The study of these numbers of processes, or a quick one of a coarse mesh and few values under another name."""
    factors = {"processes": tuple(dict.fromkeys(processes or PROCESSES)), "quick": (quick,)}
    return Study("scaling-quick" if quick else "scaling", 1, run, factors, repeats=1 if quick else REPEATS)


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Task of the study: sweep over friction.

    Returns
    -------
    dict
        seconds until the first row and until all, seconds of processor time in all processes, number of values, and
        how many were solved

    """
    cells, count = CELLS[case["quick"]], VALUES[case["quick"]]
    plate, seen = compressed_plate(0.2, (cells, cells)), list[float]()
    values = np.linspace(0.05, 1.0, count).tolist()
    began, used = time.perf_counter(), _processor_time()
    with TemporaryDirectory() as folder:
        sweep = solve_sweep(
            plate, "friction", values, store=Path(folder) / "rows", workers=case["processes"], threads=1,
            callback=lambda *_: seen.append(time.perf_counter() - began),
        )  # fmt: skip
        solved = sweep.statuses.count(Status.SOLVED)
    return {
        "first": seen[0], "whole": time.perf_counter() - began, "used": _processor_time() - used,
        "values": count, "solved": solved, "cores": os.cpu_count(),
    }  # fmt: skip


def _processor_time() -> float:
    """Of this process, and of those it has started that have ended."""
    found = os.times()
    return found.user + found.system + found.children_user + found.children_system
