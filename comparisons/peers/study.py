"""The study of the plate: its models, one line each, and the task of a case.

To add a model, add a line to `MODELS`. To add a code, add a module to `codes` with a function `plate`
(`codes.process.Build`), and a line to `CODES`. A case is the plate as plain data, solved by one code in a process
of its own, which shows the memory.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

from comparisons.lab.studies import PACKAGES, Study
from comparisons.peers import LEVELS
from comparisons.peers.meshes import FAMILIES, Family, plain_mesh
from qvi_contact.errors import InputError
from qvi_contact.gallery import compressed_plate
from qvi_contact.runs.processes import THREADS

GETFEM: Final = "PYTHON_WITH_GETFEM"
"""Environment variable with the path of a Python in which GetFEM is installed."""

TRIANGLES: Final = "triangles"
BRACKET: Final = "bracket"

_WARM_UP: Final = {True: 2, False: 0}  # number, by `Family.counted`, of the mesh of the case that loads all libraries
_LAST_WORDS: Final = 200  # characters of a failed process's last line that are reported
_LOOKING: Final = 60.0  # seconds for another Python to import its packages


class Code(NamedTuple):
    """A code: name, its Python module, the module of `codes` that calls it, and marker."""

    name: str
    library: str
    module: str
    marker: str


CODES: Final[Mapping[str, Code]] = {
    TRIANGLES: Code("this package", "qvi_contact", "own", "o"),
    BRACKET: Code("the bracket", "qvi_contact", "own", "x"),
    "ngsolve": Code("NGSolve", "ngsolve", "with_ngsolve", "v"),
    "getfem": Code("GetFEM", "getfem", "with_getfem", ">"),
}
"""Key → code."""


class Model(NamedTuple):
    """A discretisation of the plate: a key of `CODES`, one of `meshes.FAMILIES`, and options of the code."""

    code: str
    mesh: str
    options: Mapping[str, Any]

    @property
    def family(self) -> Family:
        """The family of its meshes."""
        return FAMILIES[self.mesh]


MODELS: Final[Mapping[str, Model]] = {
    "triangles, p = 4, cut squares": Model(TRIANGLES, "cut squares", {"degree": 4}),
    **{f"triangles, p = {p}, bisected": Model(TRIANGLES, "bisected", {"degree": p}) for p in (3, 4, 5, 6)},
    **{f"triangles, p = {p}, layers": Model(TRIANGLES, "layers", {"degree": p}) for p in (6, 7, 8)},
    **{
        f"NGSolve, p = {p}, {variant}, {mesh}": Model("ngsolve", mesh, {"order": p, "variant": variant})
        for p, mesh, variant in (
            (2, "uniform", "symmetric"), (3, "graded", "symmetric"),
            *((p, "bisected", "symmetric") for p in (2, 3, 4, 5, 6)),
            *((p, "layers", "symmetric") for p in (4, 6, 7, 8)), (3, "strips", "symmetric"), (4, "strips", "skew"),
            (4, "narrow strips", "symmetric"), (6, "narrow strips", "symmetric"),
        )
    },
    **{
        f"GetFEM, Q{p}, {mesh}": Model("getfem", mesh, {"degree": p})
        for p, mesh in ((2, "uniform"), (2, "graded"), (2, "strips"), (3, "strips"), (4, "strips"))
    },
    "bracket, p = 5, bisected": Model(BRACKET, "bisected", {"degree": 5, "bracket": 5}),
    "bracket, p = 5, adaptive": Model(BRACKET, "adaptive", {"degree": 5, "adaptive": True}),
}  # fmt: skip
"""Name → model, in the order of the tables."""


def peers_study(friction: Sequence[float], cells: Sequence[int], repetitions: int, levels: int = LEVELS) -> Study:
    """The study of every model whose code is installed, at every μ, on the meshes of its family.

    Meshes have `cells` a side, or are the first `levels` of the family. Codes take turns on meshes of one number, so
    that other load of the machine affects all of them. `InputError` if the Python named for GetFEM lacks it.
    """
    missing, chosen = missing_codes(), {True: set(cells), False: set(range(levels))}
    cases = [
        {"friction": mu, "number": number, "model": name, "repetitions": repetitions}
        for mu in friction
        for number in sorted(chosen[True] | chosen[False])
        for name, model in MODELS.items()
        if model.code not in missing and number in chosen[model.family.counted]
    ]
    packages = (*PACKAGES, "ngsolve")
    return Study("peers", 2, "comparisons.peers.study:run", cases, packages=packages, threads=1)


def missing_codes() -> tuple[str, ...]:
    """Keys of the codes that are not installed; `InputError` if a Python named for GetFEM does not have it."""
    other = os.environ.get(GETFEM)
    missing = [key for key, code in CODES.items() if not (key == "getfem" and other) and not find_spec(code.library)]
    if other:
        look = "import importlib.util, sys; sys.exit(importlib.util.find_spec('getfem') is None)"
        try:
            done = subprocess.run([other, "-c", look], capture_output=True, timeout=_LOOKING, check=False)
            found = not done.returncode
        except (OSError, ValueError, subprocess.SubprocessError):
            found = False
        if not found:
            raise InputError("getfem", other, "give a Python that finds the module getfem")
    return tuple(missing)


class ProcessError(RuntimeError):
    """The process of a case ended without an answer."""


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a case, "friction", "model", "number" (of its mesh), "repetitions", on one thread, see `codes.process`."""
    model = MODELS[case["model"]]
    order = {
        "module": CODES[model.code].module, "options": dict(model.options), "repetitions": case["repetitions"],
        "case": plate(case["friction"], model.mesh, case["number"]),
        "warm_up": plate(case["friction"], model.mesh, _WARM_UP[model.family.counted]),
    }  # fmt: skip
    # another Python must not import the packages of this one
    other = os.environ.get(GETFEM) if model.code == "getfem" else None
    interpreter, surroundings = other or sys.executable, {**os.environ, **dict.fromkeys(THREADS, "1")}
    surroundings["PYTHONPATH"] = "" if other else os.pathsep.join(sys.path)
    script = Path(__file__).with_name("codes") / "process.py"
    done = subprocess.run(
        [interpreter, str(script)], input=json.dumps(order).encode(), capture_output=True, env=surroundings, check=False
    )
    if done.returncode:
        words = done.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
        raise ProcessError(f"{Path(interpreter).name} ended with status {done.returncode}: {words[-1][-_LAST_WORDS:]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def plate(friction: float, family: str, number: int) -> dict[str, Any]:
    """`compressed_plate` as plain data.

    A mesh, see `plain_mesh`, and its "number", "young", "poisson" (plane stress), "displacement" U and "friction" μ.
    """
    problem = compressed_plate(friction)
    material: Any = problem.material
    (contact,) = problem.contacts
    assert not callable(contact.gap)
    return {
        **plain_mesh(family, friction, number), "number": number,
        "young": material.young, "poisson": material.poisson, "displacement": -contact.gap, "friction": friction,
    }  # fmt: skip
