"""The study of a run, and what a worker does for a case: the plate as plain data, solved by one code.

Each case has a process of its own, so that its memory is its own.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from comparisons.lab.machine import PACKAGES
from comparisons.lab.study import Study
from comparisons.lab.study.declaration import Values
from comparisons.peers import LEVELS
from comparisons.peers.meshes import FAMILIES, plain_mesh
from comparisons.peers.models import CODES, MODELS, NAMED
from qvi_contact.errors import InputError
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem.conditions import Contact
from qvi_contact.runs import THREADS

GETFEM: Final = "PYTHON_WITH_GETFEM"
"""Environment variable: another Python, in which GetFEM is installed."""

_WARM_UP: Final = {True: 2, False: 0}  # number, by `Family.counted`, of the case that loads all libraries
_PROCESS: Final = Path(__file__).with_name("codes") / "process.py"
_LAST_WORDS: Final = 200
_LOOKING: Final = 60.0  # seconds for another Python to say what it has


def peers_study(friction: tuple[float, ...], cells: tuple[int, ...], repetitions: int, levels: int = LEVELS) -> Study:
    """Every model whose code is installed, at every coefficient μ, on the meshes of its family.

    Those are of so many `cells` a side, or the first `levels`. Codes take turns on meshes of one number, so that what
    else the machine does meets all of them.

    Raises
    ------
    InputError
        If the Python that should have GetFEM has not.

    """
    missing, chosen = missing_codes(), {True: set(cells), False: set(range(levels))}
    factors: dict[str, tuple[Any, ...]] = {
        "friction": tuple(dict.fromkeys(friction)),
        "number": tuple(sorted(chosen[True] | chosen[False])),
        "model": tuple(model.name for model in MODELS if model.code not in missing),
        "repetitions": (repetitions,),
    }

    def keep(case: Values) -> bool:
        return case["number"] in chosen[NAMED[case["model"]].family.counted]

    return Study("peers", 2, run, factors, keep=keep, packages=(*PACKAGES, "ngsolve"))


def missing_codes() -> tuple[str, ...]:
    """Keys of the codes that are not installed."""
    return tuple(key for key in CODES if not _installed(key))


def _installed(key: str) -> bool:
    """Whether this Python finds the code, or another one that was named for it does, which has to."""
    code, other = CODES[key], os.environ.get(GETFEM)
    if key != "getfem" or not other:
        return find_spec(code.library) is not None
    look = f"import importlib.util, sys; sys.exit(importlib.util.find_spec({code.library!r}) is None)"
    try:
        found = subprocess.run([other, "-c", look], capture_output=True, timeout=_LOOKING, check=False).returncode
    except (OSError, ValueError, subprocess.SubprocessError):
        found = 1
    if found:
        raise InputError("getfem", other, f"give a Python that finds the module {code.library}")
    return True


class ProcessError(RuntimeError):
    """The process of a case ended without an answer."""


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a case of the study, see `codes.process.repeated`.

    Parameters
    ----------
    case : Mapping
        "friction", "model" (a name of `MODELS`), "number" (of the mesh in the model's family), "repetitions".

    Raises
    ------
    ProcessError
        If the process fails; the message has its last words.

    """
    model = NAMED[case["model"]]
    order = {
        "module": CODES[model.code].module, "options": dict(model.options), "repetitions": case["repetitions"],
        "case": plate(case["friction"], model.mesh, case["number"]),
        "warm_up": plate(case["friction"], model.mesh, _WARM_UP[FAMILIES[model.mesh].counted]),
    }  # fmt: skip
    return answer_of(order, model.code)


def plate(friction: float, family: str, number: int) -> dict[str, Any]:
    """`compressed_plate` as plain data.

    A mesh (see `plain_mesh`) and its number, "young", "poisson" (plane stress), "displacement" U and "friction" μ.
    """
    problem = compressed_plate(friction)
    (contact,) = (condition for condition in problem.conditions if isinstance(condition, Contact))
    material: Any = problem.material
    gap: Any = contact.gap
    return {
        **plain_mesh(family, friction, number), "number": number,
        "young": material.young, "poisson": material.poisson, "displacement": -float(gap), "friction": friction,
    }  # fmt: skip


def answer_of(order: Mapping[str, Any], code: str) -> dict[str, Any]:
    """What a code, a key of `CODES`, says in a process of its own, on one thread.

    Another Python for GetFEM must not find the packages of this one.
    """
    other = os.environ.get(GETFEM) if code == "getfem" else None
    interpreter, surroundings = other or sys.executable, {**os.environ, **dict.fromkeys(THREADS, "1")}
    surroundings["PYTHONPATH"] = "" if other else os.pathsep.join(sys.path)
    done = subprocess.run(
        [interpreter, str(_PROCESS)],
        input=json.dumps(order).encode(), capture_output=True, env=surroundings, check=False,
    )  # fmt: skip
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
        raise ProcessError(f"{Path(interpreter).name} ended with status {done.returncode}: {words[-1][-_LAST_WORDS:]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer
