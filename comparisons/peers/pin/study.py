"""The loaded pin as plain data, so that every code solves the gallery's own problem; the study of a run."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from comparisons.lab.machine import PACKAGES
from comparisons.lab.study import Study
from comparisons.peers.meshes import counter_clockwise
from comparisons.peers.study import answer_of
from qvi_contact import TriangleMesh
from qvi_contact.gallery import loaded_pin

MEASURED: Final[Mapping[str, str]] = {
    "moved": "u_x on the axis at the hole [mm]",
    "normal": "∫ pressure [N/mm]",
    "shear": "∫ shear [N/mm]",
    "carried": "force along x [N/mm]",
}
"""Name of a measured number → what it is: of the sheet, and of the tractions along half of the hole."""

OWN: Final = "triangles, p = 4"
FINITE: Final = ", finite strain"
"""Behind the name of a model: what it is with finite strain."""

MODELS: Final[Mapping[str, tuple[str, str, Mapping[str, Any]]]] = {
    OWN: ("triangles", "own_pin", {"degree": 4}),
    "NGSolve, p = 3": ("ngsolve", "ngsolve_pin", {"order": 3}),
    "NGSolve, p = 4": ("ngsolve", "ngsolve_pin", {"order": 4}),
    "GetFEM, P2": ("getfem", "getfem_pin", {"degree": 2}),
    "GetFEM, P3": ("getfem", "getfem_pin", {"degree": 3}),
    f"NGSolve, p = 3{FINITE}": ("ngsolve", "ngsolve_pin", {"order": 3, "finite": True}),
}
"""Name → key of `models.CODES`, module, options."""

_WARM_UP: Final = 4  # edges in a quarter of the case that loads all libraries
_SIDES: Final = ("load", "axis", "wall")
_FORCE, _RADIUS, _EYE, _HALF = 1e4, 50.0, 100.0, 10.0  # of `loaded_pin`, upper half


def pin_study(friction: tuple[float, ...], sectors: tuple[int, ...], missing: Sequence[str]) -> Study:
    """Every model whose code is installed, at every coefficient μ, with so many edges of the hole in a quarter."""
    models = tuple(name for name, (code, *_) in MODELS.items() if code not in missing)
    factors: dict[str, tuple[Any, ...]] = {
        "friction": tuple(dict.fromkeys(friction)), "sectors": tuple(sorted(set(sectors))), "model": models,
    }  # fmt: skip
    return Study("peers-pin", 1, run, factors, packages=(*PACKAGES, "ngsolve"))


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a case of the study, see `codes.process.repeated`.

    Parameters
    ----------
    case : Mapping
        "friction", "sectors", "model" (a name of `MODELS`).

    Raises
    ------
    ProcessError
        If the process fails; the message has its last words.

    """
    code, module, options = MODELS[case["model"]]
    plain = plain_pin(case["friction"], case["sectors"])
    order = {"module": module, "options": dict(options), "repetitions": 1, "case": plain,
             "warm_up": plain_pin(case["friction"], _WARM_UP)}  # fmt: skip
    return answer_of(order, code)


def plain_pin(friction: float, sectors: int) -> dict[str, Any]:
    """`loaded_pin` as plain data.

    Returns
    -------
    dict
        "vertices", coordinates (n, 2); "cells", their vertices (m, 3), counter-clockwise; "pin", for each cell whether
        it is in the pin; "sides", the edges of "hole", "load", "axis", "wall" and "eye" by their vertices; "arcs",
        radius by side; "radius" of the hole; "traction" along x on the load and its "force"; "young" by body,
        "poisson", plane strain; "friction" and "sectors".

    """
    mesh: Any = loaded_pin(sectors, friction).mesh
    if not isinstance(mesh, TriangleMesh):
        raise TypeError(mesh)
    inside = np.zeros(len(mesh.cells), dtype=bool)
    inside[mesh.region("pin")] = True
    sides = {"hole": mesh.edge_sets["pin"], "eye": mesh.edge_sets["eye"], **{n: mesh.edge_sets[n] for n in _SIDES}}
    return {
        "vertices": mesh.vertices.tolist(), "cells": counter_clockwise(mesh.vertices, mesh.cells).tolist(),
        "pin": inside.tolist(), "sides": {name: pairs.tolist() for name, pairs in sides.items()},
        "arcs": {"hole": _RADIUS, "eye": _EYE}, "radius": _RADIUS, "traction": _FORCE / (2.0 * _HALF), "force": _FORCE,
        "young": {"sheet": 7e4, "pin": 21e4}, "poisson": 0.3, "friction": friction, "sectors": sectors,
    }  # fmt: skip
