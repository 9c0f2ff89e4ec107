"""What a worker of the study does: one case, by one code, in a process of its own, so that its memory is its own."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from comparisons.peers.models import CODES, NAMED
from comparisons.study.children import environment
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem.conditions import Contact

TASK: Final = f"{__name__}:run"
"""As `comparisons.study` names it."""

GETFEM: Final = "PYTHON_WITH_GETFEM"
"""Environment variable: another Python, in which GetFEM is installed."""

WARM_UP: Final = 2
"""Cells a side of the case that loads all libraries."""

_PROCESS: Final = Path(__file__).with_name("codes") / "process.py"
_GRADINGS: Final = ((12, 0.6), (24, 0.7), (48, 0.8))  # up to so many cells a side
_FINEST_GRADING: Final = 0.9
_LAST_WORDS: Final = 200


class ProcessError(RuntimeError):
    """The process of a case ended without an answer."""


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a case of the study, see `codes.process.repeated`.

    Parameters
    ----------
    case : Mapping
        "friction", "model" (a name of `MODELS`), "cells", "repetitions".

    Raises
    ------
    ProcessError
        If the process fails; the message has its last words.

    """
    model = NAMED[case["model"]]
    ratio = 1.0 if model.mesh == "uniform" else grading(case["cells"])
    order = {
        "module": CODES[model.code].module, "options": dict(model.options), "repetitions": case["repetitions"],
        "case": plate(case["friction"], case["cells"], ratio), "warm_up": plate(case["friction"], WARM_UP, ratio),
    }  # fmt: skip
    other = os.environ.get(GETFEM) if model.code == "getfem" else None
    return answer_of(order, other or sys.executable)


def grading(cells: int) -> float:
    """Ratio of each cell to the one before it on graded meshes with so many cells a side."""
    return next((ratio for most, ratio in _GRADINGS if cells <= most), _FINEST_GRADING)


def plate(friction: float, cells: int, ratio: float) -> dict[str, Any]:
    """`compressed_plate` as plain data.

    The grid lines "x" and "y", "young", "poisson" (plane stress), "displacement" U and "friction" μ; and "cells" and
    "grading", which the lines come from.
    """
    problem = compressed_plate(friction, cells=(cells, cells), grading=ratio)
    (contact,) = (condition for condition in problem.conditions if isinstance(condition, Contact))
    material: Any = problem.material
    gap: Any = contact.gap
    return {
        "x": problem.grid.x.tolist(), "y": problem.grid.y.tolist(), "young": material.young,
        "poisson": material.poisson, "displacement": -float(gap), "friction": friction,
        "cells": cells, "grading": ratio,
    }  # fmt: skip


def answer_of(order: Mapping[str, Any], interpreter: str) -> dict[str, Any]:
    """What the process says, on one thread; another Python must not find the packages of this one."""
    surroundings = environment(threads=1)
    if interpreter != sys.executable:
        del surroundings["PYTHONPATH"]
    done = subprocess.run(
        [interpreter, str(_PROCESS)],
        input=json.dumps(order).encode(), capture_output=True, env=surroundings, check=False,
    )  # fmt: skip
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
        raise ProcessError(f"{Path(interpreter).name} ended with status {done.returncode}: {words[-1][-_LAST_WORDS:]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer
