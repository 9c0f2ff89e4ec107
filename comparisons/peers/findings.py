"""What the numbers of a run say, in sentences computed from them."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

from comparisons.benchmark.ratios import growth
from comparisons.peers.models import EQUILIBRIUM

Document = dict[str, Any]
Row = dict[str, Any]

BUDGETS: Final = (0.03, 0.1, 1.0, 10.0)
"""Seconds at which the nearest model is named."""

TARGETS: Final = (1e-4, 1e-5, 1e-6)
"""Relative errors of P/2 at which the equilibrium models and the others are compared."""


def findings(document: Document) -> list[str]:
    """The sentences."""
    return [*_counted(document), *_missing(document), *_by_friction(document)]


def _counted(document: Document) -> Iterator[str]:
    """How many runs have a solution, and which have not."""
    rows = document["rows"]
    failed = [row for row in rows if row["status"] != "solved"]
    yield f"{len(rows) - len(failed)} of {len(rows)} runs end with a solution."
    for model in dict.fromkeys(row["model"] for row in failed):
        where = [row for row in failed if row["model"] == model]
        reasons = (f"{row['cells']}² at μ = {row['friction']:g} ({row['status']}: {row['message']})" for row in where)
        yield f"{model} fails on {'; '.join(reasons)}."


def _missing(document: Document) -> Iterator[str]:
    for code in document["missing"]:
        yield f"{code['code']} is not installed and was not run: {code['remedy']}."


def _by_friction(document: Document) -> Iterator[str]:
    for settled in document["settled"]:
        mu, floor = settled["friction"], settled["meaningless"]
        if floor is None:
            yield f"At μ = {mu:g} no settled value is known: no errors are given."
            continue
        rows = [row for row in document["rows"] if row["friction"] == mu and row["error"] is not None]
        yield from _by_chance(rows, mu, floor)
        yield from _nearest(rows, mu, floor)
        yield from _targets(rows, mu)
        yield from _orders(rows, mu, floor)
        yield from _sides(rows, settled)


def lasting_error(rows: Sequence[Row], row: Row) -> float:
    """The largest error of a row's model on its mesh and on all with more cells.

    Forces of contact with friction may cross the settled value: an error that a finer mesh does not confirm is small by
    chance, and is not what the model is worth.
    """
    finer = [other["error"] for other in rows if other["model"] == row["model"] and other["cells"] >= row["cells"]]
    return float(max(finer))


def _by_chance(rows: Sequence[Row], friction: float, floor: float) -> Iterator[str]:
    """The models whose errors grow somewhere as meshes get finer, beyond the settled value's uncertainty."""
    crossing = dict.fromkeys(row["model"] for row in rows if lasting_error(rows, row) > max(row["error"], floor))
    if crossing:
        yield (
            f"At μ = {friction:g} some errors of {'; '.join(crossing)} are smaller than on a finer mesh, that is by "
            "chance; below, an error counts as reached only if no finer mesh of the same model has a larger one."
        )


def _nearest(rows: Sequence[Row], friction: float, floor: float) -> Iterator[str]:
    """The model with the smallest error within each time; errors below the settled value's uncertainty count alike."""
    said = None
    for budget in BUDGETS:
        within = [row for row in rows if row["whole"] <= budget]
        best = min(within, key=lambda row: (max(lasting_error(rows, row), floor), row["whole"]), default=None)
        if best is None or best is said:
            continue
        said = best
        yield (
            f"Within {budget:g} s at μ = {friction:g} the nearest is {_named(best)}: "
            f"{_error(lasting_error(rows, best), floor)} in {_seconds(best['whole'])} with {best['unknowns']} unknowns."
        )


def _targets(rows: Sequence[Row], friction: float) -> Iterator[str]:
    """The quickest of the equilibrium models beside the quickest displacement model for each error."""
    ours = [row for row in rows if row["code"] == EQUILIBRIUM]
    others = [row for row in rows if row["code"] != EQUILIBRIUM]
    for target in TARGETS if ours and others else ():
        mine, theirs = _quickest(ours, target), _quickest(others, target)
        start = f"An error of {target:.0e} at μ = {friction:g}"
        if mine is None and theirs is None:
            yield f"{start} is reached by no model on these meshes."
        elif mine is None or theirs is None:
            found, other = (mine, "displacement") if theirs is None else (theirs, "equilibrium")
            assert found is not None
            yield (
                f"{start} is reached by {_named(found)} in {_seconds(found['whole'])} with "
                f"{found['unknowns']} unknowns, and by no {other} model on these meshes."
            )
        else:
            yield (
                f"{start} takes {_named(mine)} {_seconds(mine['whole'])} and {mine['unknowns']} unknowns, "
                f"{_named(theirs)} {_seconds(theirs['whole'])} and {theirs['unknowns']} unknowns."
            )


def _quickest(rows: Sequence[Row], target: float) -> Row | None:
    reached = (row for row in rows if lasting_error(rows, row) <= target)
    return min(reached, key=lambda row: row["whole"], default=None)


def _orders(rows: Sequence[Row], friction: float, floor: float) -> Iterator[str]:
    """How fast errors fall on uniform meshes, between the coarsest and the finest that still mean something."""
    slopes = []
    for model in dict.fromkeys(row["model"] for row in rows if row["mesh"] == "uniform"):
        found = [row for row in rows if row["model"] == model and row["error"] > floor]
        slope = _slope(found) if len(found) > 1 else None
        if slope is not None:
            slopes.append(f"{-slope:.2f} ({model})")
    if slopes:
        start = f"On uniform meshes at μ = {friction:g} errors fall like unknowns to the power of −p"
        yield f"{start}, p = {', '.join(slopes)}."


def _sides(rows: Sequence[Row], settled: dict[str, Any]) -> Iterator[str]:
    """Which models stay on one side of the settled value on all meshes."""
    sides: dict[str, list[str]] = {"below": [], "above": []}
    for model in dict.fromkeys(row["model"] for row in rows):
        found = [row["half_force"] for row in rows if row["model"] == model and row["error"] > settled["meaningless"]]
        if found and max(found) < settled["half_force"]:
            sides["below"].append(model)
        elif found and min(found) > settled["half_force"]:
            sides["above"].append(model)
    for side, models in sides.items():
        if models:
            yield f"At μ = {settled['friction']:g} {'; '.join(models)}: {side} the settled value on all meshes."


def _slope(rows: Sequence[Row]) -> float | None:
    first, last = (end(rows, key=lambda row: row["unknowns"]) for end in (min, max))
    return growth((first["unknowns"], first["error"]), (last["unknowns"], last["error"]))


def _named(row: Row) -> str:
    return f"{row['model']}, {row['cells']}² cells"


def _error(value: float, floor: float) -> str:
    return f"an error within the uncertainty of {floor:.0e}" if value <= floor else f"an error of {value:.1e}"


def _seconds(value: float) -> str:
    return f"{1e3 * value:.0f} ms" if value < 1.0 else f"{value:.1f} s"
