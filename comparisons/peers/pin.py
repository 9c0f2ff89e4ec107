"""The loaded pin of NAFEMS by displacement codes beside this package: same mesh, same law, numbers side by side."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.lab.numbers import count, fixed, scientific
from comparisons.lab.reports import Report, render
from comparisons.lab.studies import PACKAGES, Row, Study, frame_of
from comparisons.peers.meshes import counter_clockwise
from comparisons.peers.study import CODES, answer_of
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

MODELS_OF_PIN: Final[Mapping[str, tuple[str, Mapping[str, Any]]]] = {
    OWN: ("triangles", {"degree": 4}),
    "NGSolve, p = 3": ("ngsolve", {"order": 3}),
    "NGSolve, p = 4": ("ngsolve", {"order": 4}),
    f"NGSolve, p = 3{FINITE}": ("ngsolve", {"order": 3, "finite": True}),
}
"""Name → key of `study.CODES`, options."""

_WARM_UP: Final = 4  # edges in a quarter of the case that loads all libraries
_SIDES: Final = ("load", "axis", "wall")
_FORCE, _RADIUS, _EYE, _HALF = 1e4, 50.0, 100.0, 10.0  # of `loaded_pin`, upper half


def pin_study(friction: Sequence[float], sectors: Sequence[int], missing: Sequence[str]) -> Study:
    """Every model whose code is installed, at every coefficient μ, with so many edges of the hole in a quarter."""
    cases = [
        {"friction": mu, "sectors": count, "model": name}
        for mu in friction
        for count in sorted(set(sectors))
        for name, (code, _) in MODELS_OF_PIN.items()
        if code not in missing
    ]
    return Study("peers-pin", 1, "comparisons.peers.pin:run_pin", cases, packages=(*PACKAGES, "ngsolve"), threads=1)


def run_pin(case: Mapping[str, Any]) -> dict[str, Any]:
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
    code, options = MODELS_OF_PIN[case["model"]]
    order = {
        "module": CODES[code].module, "problem": "pin", "options": dict(options), "repetitions": 1,
        "case": plain_pin(case["friction"], case["sectors"]), "warm_up": plain_pin(case["friction"], _WARM_UP),
    }  # fmt: skip
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
    inside = np.zeros(len(mesh.cells), dtype=bool)
    inside[mesh.region("pin")] = True
    sides = {"hole": mesh.edge_sets["pin"], "eye": mesh.edge_sets["eye"], **{n: mesh.edge_sets[n] for n in _SIDES}}
    return {
        "vertices": mesh.vertices.tolist(), "cells": counter_clockwise(mesh.vertices, mesh.cells).tolist(),
        "pin": inside.tolist(), "sides": {name: pairs.tolist() for name, pairs in sides.items()},
        "arcs": {"hole": _RADIUS, "eye": _EYE}, "radius": _RADIUS, "traction": _FORCE / (2.0 * _HALF), "force": _FORCE,
        "young": {"sheet": 7e4, "pin": 21e4}, "poisson": 0.3, "friction": friction, "sectors": sectors,
    }  # fmt: skip


PUBLISHED: Final = (
    {"test, mesh": "SSNP156 A, elements of 4 nodes", "small strain [mm]": "0.72092", "finite strain [mm]": "0.71799"},
    {"test, mesh": "SSNP156 B, elements of 8 nodes", "small strain [mm]": "0.73924", "finite strain [mm]": "0.73617"},
)
"""u_x [mm] on the axis at the hole by Code_Aster, μ = 0.1, 820 quadrilaterals: small strain, finite strain."""

_FORMS: Final[dict[str, Any]] = {
    "friction": "{:g}".format, **dict.fromkeys(MEASURED, fixed(".7g")), "unknowns": count,
    "residual": partial(scientific, digits=1),
}  # fmt: skip


def pin_report(rows: Sequence[Row]) -> Report:
    """The report of these rows; the same rows give the same report."""
    runs = frame_of(rows, (*MEASURED, "residual"), ("message", "unknowns"))
    runs["message"] = runs.message.where(runs.has, runs.reason)
    runs["plain"] = runs.model.str.removesuffix(FINITE)  # the same model with small strain
    # the solved runs on the finest mesh of each μ that has any, with small strain and with finite strain
    small, finite = (runs[(runs.status == "solved") & ((runs.plain != runs.model) == each)] for each in (False, True))
    small, finite = (
        found[found.sectors == found.groupby("friction").sectors.transform("max")] for found in (small, finite)
    )
    apart = []  # by μ: u_x of this package, and the smallest and largest distance of another code from it, relative
    for friction, here in small.groupby("friction", sort=False):
        own, others = here[here.model == OWN], here[here.model != OWN]
        if len(own) and len(others):
            moved, sectors = own.moved.iloc[0], own.sectors.iloc[0]
            off = (others.moved / moved - 1.0).abs()
            apart.append({
                "friction": friction, "sectors": sectors, "moved": moved, "least": off.min(), "worst": off.max(),
            })  # fmt: skip
    key = ["friction", "sectors", "plain"]
    both = finite.merge(runs[runs.status == "solved"], left_on=key, right_on=[*key[:2], "model"])
    changes = [{"friction": each.friction, "change": each.moved_x / each.moved_y - 1.0} for each in both.itertuples()]
    # the command that measures the same, without the place of its files and of other Pythons
    words = ["python -m comparisons peers-pin --friction", *(f"{each:g}" for each in runs.friction.unique())]
    words += ["--cells", *map(str, runs.sectors.unique())]
    tables = {
        "numbers": runs.assign(ended=runs.message.where(runs.message != "", runs.status)),
        "published": DataFrame(PUBLISHED),
    }  # fmt: skip
    values = {"command": " ".join(words), "apart": apart, "finite": changes}
    return render("comparisons.peers", "peers-pin", values, tables, {}, rows, forms=_FORMS, template="pin.md")
