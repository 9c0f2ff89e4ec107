"""The study of the plate: its models, one line each, and what is done for a case.

A further model is a line in `MODELS`; a further code is a line in `CODES` and a module beside this one that has
`plate`, which makes of a case and the model's options what solves it. A case is solved in a process of its own, so that
its memory is its own.
"""

import gc
import time
from collections.abc import Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final, NamedTuple

from comparisons.lab.studies import PACKAGES, Study, peak_memory
from comparisons.peers import LEVELS
from comparisons.peers.meshes import FAMILIES, plain_mesh
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem.conditions import Contact

TRIANGLES: Final = "triangles"
BRACKET: Final = "bracket"
NGSOLVE: Final = "ngsolve"

BUDGET: Final = 5.0
"""Seconds after which no further repetition begins."""


class Code(NamedTuple):
    """A code: its name, the module of this folder that uses it, and its marker."""

    name: str
    module: str
    marker: str


CODES: Final[Mapping[str, Code]] = {
    TRIANGLES: Code("this package", "own", "o"),
    BRACKET: Code("the bracket", "own", "x"),
    NGSOLVE: Code("NGSolve", "with_ngsolve", "v"),
}
"""Key → code."""


class Model(NamedTuple):
    """A discretisation of the plate: a key of `CODES`, one of `meshes.FAMILIES`, and what the code takes besides."""

    code: str
    mesh: str
    options: Mapping[str, Any]


MODELS: Final[Mapping[str, Model]] = {
    **{f"triangles, p = {p}, bisected": Model(TRIANGLES, "bisected", {"degree": p}) for p in (3, 4, 5, 6)},
    **{
        f"NGSolve, p = {p}, {variant}, {mesh}": Model(NGSOLVE, mesh, {"order": p, "variant": variant})
        for p, mesh, variant in (
            *((p, "bisected", "symmetric") for p in (2, 3, 4, 5, 6)),
            (3, "strips", "symmetric"), (4, "strips", "skew"),
            (4, "narrow strips", "symmetric"), (6, "narrow strips", "symmetric"),
        )
    },
    "bracket, p = 5, bisected": Model(BRACKET, "bisected", {"degree": 5, "bracket": 5}),
    "bracket, p = 5, adaptive": Model(BRACKET, "adaptive", {"degree": 5, "adaptive": True}),
}  # fmt: skip
"""Name → model, in the order of the tables."""


def peers_study(friction: Sequence[float], repetitions: int, levels: int = LEVELS) -> Study:
    """Every model whose code is installed, at every coefficient μ, on the first `levels` meshes of its family.

    Codes take turns on meshes of one level, so that what else the machine does meets all of them.
    """
    cases = [
        {"friction": mu, "number": number, "model": name, "repetitions": repetitions}
        for mu in friction
        for number in range(levels)
        for name, model in MODELS.items()
        if model.code != NGSOLVE or find_spec("ngsolve")
    ]
    task = "comparisons.peers.study:run"
    return Study("peers", 2, task, cases, packages=(*PACKAGES, "ngsolve"), fresh=True, threads=1)


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a case, "friction", "model", "number" (of its mesh), and again, "repetitions" in all while `BUDGET` lasts.

    Returns the last answer with "setup" and "solve", lists of processor times in seconds, and "before" and "peak", the
    largest resident memory [bytes] with all libraries loaded by the coarsest mesh, and after the first solve.
    """
    model = MODELS[case["model"]]
    build = import_module(f"comparisons.peers.{CODES[model.code].module}").plate
    given, answer, peak = plate(case["friction"], model.mesh, case["number"]), dict[str, Any](), None
    times: dict[str, list[float]] = {"setup": [], "solve": []}
    build(plate(case["friction"], model.mesh, 0), **model.options)()
    before, began = peak_memory(), time.perf_counter()
    while not answer or (len(times["solve"]) < case["repetitions"] and time.perf_counter() - began <= BUDGET):
        gc.collect()
        start = time.process_time()  # that of the clock would count what else the machine does
        solve = build(given, **model.options)
        built = time.process_time()
        answer = solve()
        times["setup"].append(built - start)
        times["solve"].append(time.process_time() - built)
        del solve
        peak = peak or peak_memory()
    return {**answer, **times, "before": before, "peak": peak}


def plate(friction: float, family: str, number: int) -> dict[str, Any]:
    """`compressed_plate` as plain data.

    A mesh (see `plain_mesh`) and its number, "young", "poisson" (plane stress), "displacement" U and "friction" μ.
    """
    problem = compressed_plate(friction)
    (contact,) = (condition for condition in problem.conditions if isinstance(condition, Contact))
    gap: Any = contact.gap
    return {
        **plain_mesh(FAMILIES[family](friction, number)), "number": number, "young": problem.material.young,
        "poisson": problem.material.poisson, "displacement": -float(gap), "friction": friction,
    }  # fmt: skip
