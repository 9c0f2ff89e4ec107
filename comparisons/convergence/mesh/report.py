"""The report on convergence in the mesh and its tables, from the stored rows alone."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from pandas import DataFrame, concat

from comparisons.convergence.mesh.errors import NAMES, Overview, ends_among, meshes_of, slug
from comparisons.convergence.mesh.figures import figures
from comparisons.convergence.mesh.measures import CLOSED, brackets_of, costs_of, models_of, values_of
from comparisons.convergence.mesh.problems import ENERGY, FORCE, TRACTIONS, Problem
from comparisons.convergence.mesh.references import end_of
from comparisons.convergence.mesh.study import APART, BRACKET, COMPANION, EQUILIBRIUM, GRADED, STRICT, UNIFORM
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.report.numbers import NOTHING, fixed, scientific, seconds, significant
from comparisons.lab.study import Row
from comparisons.lab.tables import Form, Grid, grid_of


def _known(form: Form) -> Form:
    """What is missing is left empty."""
    return lambda value: "" if value is None or value != value else form(value)


_NINE: Final = _known(partial(significant, digits=9))
_ORDER: Final = _known(lambda order: f"{round(order, 2) + 0.0:.2f}")


def tables_of(overview: Overview) -> dict[str, DataFrame | Grid]:
    """The tables by name."""
    meshes = dict(iter(_with_models(overview).groupby("problem")))
    single = {f"meshes-{slug(each)}": _meshes(overview, each, meshes[each.name]) for each in overview.problems}
    costs, exact = costs_of(overview), [problem.name for problem in overview.exact]
    return {
        "costs": costs.assign(times=list(map(_times, costs.low, costs.high))), "brackets": brackets_of(overview),
        "models": models_of(overview), "zones": DataFrame(_zones(overview)),
        "references": DataFrame(_references(overview)), "failures": failures(overview),
        "orders": overview.orders[~overview.orders.problem.isin(exact)], **single,
    }  # fmt: skip


def _cost(unknowns: float) -> str:
    return "not reached" if unknowns == float("inf") else f"{unknowns:.0f}"


def _times(low: float, high: float) -> str:
    """A number that is known as well as an `advantage` is."""
    if low != low:
        return ""
    least = significant(low, 2)
    return f"> {least}" if high != high else f"{least} to {significant(high, 2)}"


_BOUNDS: Final = ("lower", "upper", "gap", "guaranteed", "bracketed")
_ERRORS: Final = {FORCE: "its error", ENERGY: "energy error", TRACTIONS: "tractions' error"}
_OWN: Final = {True: "these models", False: "elsewhere"}


def _gap(gap: float) -> str:
    return "closed" if gap < CLOSED else scientific(gap)


def _change(change: float) -> str:
    return "0" if abs(change) < CLOSED else scientific(change)


FORMS: Final[dict[str, Form]] = {
    "target": partial(scientific, digits=1), **dict.fromkeys(NAMES, _known(_cost)), "own": _OWN.__getitem__,
    "gap": _gap, "change": _known(_change), "sequence": NAMES.__getitem__, "last": _ORDER, "fitted": _ORDER,
    "expected": _known("{:.3g}".format), "unknowns": fixed(".0f"), "seconds": seconds,
    **dict.fromkeys(("force", f"force {STRICT}", f"force {COMPANION}", "lower", "upper"), _NINE),
    **dict.fromkeys((f"error of {name}" for name in _ERRORS), _known(str)),
}  # fmt: skip
"""Column of a table → how its values read."""


def _zones(overview: Overview) -> Iterator[dict[str, str]]:
    """Where zones end, and how far off the finest equal cells are."""
    for problem in overview.problems:
        for kind in ends_among(overview.references[problem.name]):
            place, points = overview.references[problem.name][kind], overview.curve(problem, kind, UNIFORM)
            equal = overview.of(problem, UNIFORM)
            missed = [cells for cells, ends in zip(equal.cells, equal.ends, strict=True) if end_of(ends, kind) is None]
            cells, off = NOTHING, ""
            if len(points):
                last = points.iloc[-1]
                cells = last.cells
                off = scientific(last.error * place.unit) if last.meant else "within the uncertainty"
                off = "gave the value" if place.sequence == UNIFORM else off
            yield {
                "problem": problem.name, "end": kind, "at x": significant(place.value, 4),
                "uncertainty": scientific(place.uncertainty) if place.uncertainty else "exact",
                "unit": problem.units[1], "finest equal cells": cells, "are off by": off,
                "not shown on": ", ".join(missed) if len(points) else "all",
            }  # fmt: skip


def _references(overview: Overview) -> Iterator[dict[str, str]]:
    """What errors are taken against."""
    for problem in overview.problems:
        for measure, known in overview.references[problem.name].items():
            yield {
                "problem": problem.name, "measure": measure,
                "value": "a function" if measure == TRACTIONS else significant(known.value, 9),
                "relative uncertainty": scientific(known.uncertainty / known.unit), "source": known.source,
            }  # fmt: skip


def _with_models(overview: Overview) -> DataFrame:
    """Every mesh with stresses: its errors as texts, and what other models gave on the same mesh."""
    solved, errors = overview.meshes[overview.meshes.solved], overview.errors
    texts = [scientific(error) if meant else f"({scientific(error)})"
             for error, meant in zip(errors.error, errors.meant, strict=True)]  # fmt: skip
    told = errors.assign(text=texts).pivot(index="mesh", columns="measure", values="text").add_prefix("error of ")
    usual = solved.model == np.where(solved.sequence == APART, BRACKET, EQUILIBRIUM)
    meshes, place = solved[usual & solved.sequence.isin([*NAMES])].join(told), ["problem", "sequence", "size"]
    for model in (STRICT, COMPANION, BRACKET):
        same = solved[(solved.model == model) & solved.sequence.isin([UNIFORM, GRADED])]
        meshes = meshes.join(same.set_index(place)[["force", *_BOUNDS]].add_suffix(f" {model}"), on=place)
    for name in _BOUNDS:
        meshes[name] = meshes[name].where(meshes.sequence == APART, meshes[f"{name} {BRACKET}"])
    return meshes.assign(kind=[_kind(mesh) for mesh in meshes.itertuples()])


def _meshes(overview: Overview, problem: Problem, meshes: DataFrame) -> Grid:
    """Those of a problem, with the ends of its zones."""
    stress, length = problem.units
    ends = ends_among(overview.references[problem.name])
    meshes = meshes.assign(**{end: [_end(each, end) for each in meshes.ends] for end in ends})
    headings = {
        "sequence": "meshes", "cells": "cells", "unknowns": "unknowns", "force": f"force [{stress} {length}]",
        **{f"error of {name}": heading for name, heading in _ERRORS.items()},
        **{end: f"{end} at [{length}]" for end in ends},
        f"force {STRICT}": "force, law on whole edges", f"force {COMPANION}": "force by displacements",
        "lower": "lower energy", "upper": "upper energy", "kind": "bounds", "seconds": "time",
    }  # fmt: skip
    return grid_of(meshes.reindex(columns=list(headings)), headings, FORMS)


def _kind(mesh: Any) -> str:
    if mesh.bracketed != True:  # noqa: E712 - nothing where that model was not run on this mesh
        return ""
    return "one is missing" if mesh.gap != mesh.gap else "guaranteed" if mesh.guaranteed else "indicator"


def _end(ends: Any, kind: str) -> str:
    end = end_of(ends, kind)
    if end is None:
        return ""
    other = "" if end["extrapolated"] is None else f"; {significant(end['extrapolated'], 4)}"
    return f"{significant(end['position'], 4)}{other}"


def failures(overview: Overview) -> DataFrame:
    """Meshes without a certified answer, and bounds that are missing."""
    meshes = overview.meshes
    open_ = meshes[meshes.solved & (meshes.model == BRACKET) & meshes.gap.isna()]
    open_ = open_.assign(status="bound missing", message=open_.reasons.map(" ".join))
    return concat([meshes[~meshes.solved], open_]).rename(columns={"sequence": "meshes"})


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    overview = Overview(meshes_of(rows))
    return render(
        "comparisons.convergence.mesh", "convergence-mesh-quick" if quick else "convergence-mesh",
        {"quick": quick, **values_of(overview)}, tables_of(overview), figures(overview), environment_grids(rows),
        forms=FORMS,
    )  # fmt: skip
