"""What a worker of the study does: one case, by one code, in a process of its own, so that its memory is its own."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from comparisons.lab.study.children import environment
from comparisons.peers.meshes import FAMILIES, plain_mesh
from comparisons.peers.models import CODES, NAMED
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem.conditions import Contact

TASK: Final = f"{__name__}:run"
"""As `comparisons.lab.study` names it."""

GETFEM: Final = "PYTHON_WITH_GETFEM"
"""Environment variable: another Python, in which GetFEM is installed."""

_WARM_UP: Final = {True: 2, False: 0}  # number, by `Family.counted`, of the case that loads all libraries
_PROCESS: Final = Path(__file__).with_name("codes") / "process.py"
_LAST_WORDS: Final = 200


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
    interpreter, surroundings = other or sys.executable, environment(threads=1)
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
