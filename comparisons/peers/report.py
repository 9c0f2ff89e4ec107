"""The report of the plate: its runs as one frame, what an error costs each code, guaranteed intervals, pictures."""

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from pandas import DataFrame, concat, factorize, to_numeric

from comparisons.lab.drawing import drawn, grid, legend_below
from comparisons.lab.numbers import (
    NOTHING,
    count,
    fixed,
    listing,
    memory,
    percent,
    scientific,
    seconds,
    significant,
    span,
)  # fmt: skip
from comparisons.lab.reports import Report, render
from comparisons.lab.studies import DONE, Row
from comparisons.peers.codes.own import COULOMB
from comparisons.peers.meshes import FAMILIES, ratio
from comparisons.peers.study import BRACKET, CODES, MODELS, TRIANGLES
from comparisons.settled import LIMITS, LIMITS_SOURCE, SETTLED, SOURCE, UNCERTAINTY
from qvi_contact.plots import BLUE, GREEN, GREY, VERMILLION
from qvi_contact.plots.style import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INVERTED: Final = "inverted"
"""Status of a bracket whose lower end is above its upper one by more than twice `RESOLUTION`: it proves nothing."""

STICKING: Final = 0.25
"""From this μ on the whole contact sticks."""

RESOLUTION: Final = 1e-8
"""Relative: bounds hold up to the tolerance of the solves, so that nothing smaller is resolved by any of them."""

TARGETS: Final = (1e-4, 2e-5, 3e-6, 1e-6, 1e-7, 1e-8)
"""Relative errors of P/2 that codes are asked for."""

COARSE: Final = 3e-6
"""The error whose cost is told beside that of the smallest one that is compared."""

OTHERS: Final = ("ngsolve", "getfem")
"""Keys of the codes that are not this package's."""

NUMBERS: Final = ("half_force", "unknowns", "iterations", "residual", "before", "peak")
"""Entries of a result that are numbers; NaN where a run has none."""

BOUNDS: Final = ("lower", "upper", "width", "strain_error")
"""The same of a bracket, see `codes.own`."""


class Reference(NamedTuple):
    """P/2 at one μ lies within value ± uncertainty [N/mm], by this source."""

    value: float
    uncertainty: float
    source: str

    @property
    def floor(self) -> float:
        """The same uncertainty, relative: errors below it are not resolved."""
        return self.uncertainty / abs(self.value)


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by μ, model and mesh.

    The columns are friction (μ), model, code and mesh (keys of `CODES` and `FAMILIES`), number and label of the mesh,
    run (model and mesh in words), status, message, solved,
    half_force (P/2) [N/mm], unknowns, iterations, residual of the code's own check, setup and solve (times of the
    repetitions) [s], seconds (the smallest sum of both: what else the machine does can only add to it), spread (the
    largest less the smallest over the median), before and peak (largest resident memory before the case and after its
    first solve) [bytes], version; of brackets lower, upper, width, strain_error, guaranteed, kind, and low and high:
    guaranteed bounds of P/2, wider by `RESOLUTION`. Of runs that are solved, where P/2 is known: floor (what is
    resolved), error (relative), lasting, confirmed.

    An error that a finer mesh contradicts is small by chance, since forces of contact with friction may cross the right
    value. So lasting is the largest error of the model on this and all finer meshes that are solved; confirmed says
    whether there is a finer one.
    """
    lines = []
    for row in rows:
        model, number = MODELS[row.case["model"]], row.case["number"]
        result = row.result if row.status == DONE else {"status": row.status, "message": row.reason}
        times = {name: tuple(result.get(name, ())) for name in ("setup", "solve")}
        whole = [sum(pair) for pair in zip(times["setup"], times["solve"], strict=True)]
        middle = statistics.median(whole) if len(whole) > 1 else 0.0
        line = {
            "friction": row.case["friction"], "model": row.case["model"], "code": model.code, "mesh": model.mesh,
            "number": number, "label": model.family.label(number), "order": list(MODELS).index(row.case["model"]),
            "rank": list(CODES).index(model.code), "status": result["status"], "message": result["message"],
            **{name: result.get(name) for name in NUMBERS}, **times, "seconds": min(whole, default=None),
            "spread": (max(whole) - min(whole)) / middle if middle > 0.0 else None, "version": result.get("version"),
            **dict.fromkeys((*BOUNDS, "kind", "low", "high")), "guaranteed": False,
        }  # fmt: skip
        lines.append(line | _bounds(result) if model.code == BRACKET and result["status"] == "solved" else line)
    runs = DataFrame(lines)
    for name in (*NUMBERS, *BOUNDS, "seconds", "spread", "low", "high"):
        runs[name] = to_numeric(runs[name]).replace([math.inf, -math.inf], math.nan)
    runs["run"] = runs.model + ", " + runs.label
    runs["solved"] = runs.status == "solved"
    runs["bounded"] = runs.solved & runs.low.notna()
    runs["first"] = factorize(runs.friction)[0]
    runs = runs.sort_values(["first", "order", "number"], kind="stable", ignore_index=True)
    known = known_of(runs)
    runs["floor"] = runs.friction.map({friction: each.floor for friction, each in known.items()})
    value = runs.friction.map({friction: each.value for friction, each in known.items()})
    runs["error"] = (runs.half_force / value - 1.0).abs().where(runs.solved)
    curves = runs[::-1].groupby(["first", "order"])  # numbers fall
    runs["lasting"] = curves.error.cummax()
    finest = runs.number.where(runs.error.notna()).groupby([runs["first"], runs.order]).transform("max")
    return runs.assign(confirmed=runs.number < finest)


def _bounds(result: Any) -> dict[str, Any]:
    """What a bracket says, and its status if its ends are in the wrong order."""
    found = {name: result[name] for name in (*BOUNDS, "kind", "guaranteed")}
    ends = [end for end in (found["lower"], found["upper"]) if end is not None and math.isfinite(end)]
    known, inverted = "", found["width"] < -RESOLUTION
    if found["guaranteed"] and len(ends) == 2:
        lower, upper = ends
        found |= {"low": lower - RESOLUTION * abs(lower), "high": upper + RESOLUTION * abs(upper)}
        known, inverted = f", P/2 from {lower:.7f} to {upper:.7f} N/mm", inverted or found["low"] > found["high"]
    if inverted:
        text = f"the lower end is above the upper one: half width {scientific(found['width'])}{known}"
        found |= {"status": INVERTED, "message": text}
    return found


def guaranteed(runs: DataFrame) -> DataFrame:
    """The brackets that bound P/2, the narrowest first."""
    sure = runs[runs.bounded]
    return sure.assign(gap=sure.high - sure.low).sort_values("gap", kind="stable")


def intervals_of(runs: DataFrame) -> DataFrame:
    """The narrowest guaranteed interval of P/2 at each μ that has one.

    The columns are those of the runs, and for each code of `OTHERS` how many of its solved forces are outside, as
    "5 of 88".
    """
    lines = []
    for _, here in _by_friction(runs):
        sure = guaranteed(here)
        if sure.empty or contradictory(here):
            continue
        best = sure.iloc[0]
        forces = {key: here[(here.code == key) & here.solved].half_force for key in OTHERS}
        outside = {key: int((~each.between(best.low, best.high)).sum()) for key, each in forces.items()}
        lines.append({**best, **{key: f"{outside[key]} of {len(each)}" for key, each in forces.items()}})
    return DataFrame(lines, columns=[*runs, *OTHERS])


def contradictory(runs: DataFrame) -> bool:
    """Whether no value of P/2 is inside all guaranteed bounds of these runs at one μ, so that some are wrong."""
    sure = runs[runs.bounded]
    return bool(sure.low.max() > sure.high.min())


def known_of(runs: DataFrame) -> dict[float, Reference]:
    """μ → the value that errors are relative to, where one is known."""
    found = {float(friction): reference(here, float(friction)) for friction, here in _by_friction(runs)}
    return {friction: each for friction, each in found.items() if each is not None}


def _by_friction(runs: DataFrame) -> list[tuple[Any, DataFrame]]:
    """μ → its runs, in the order of the study."""
    return list(runs.groupby("friction", sort=False))


def reference(here: DataFrame, friction: float) -> Reference | None:
    """The limit or value that is known from elsewhere, or the narrowest guaranteed bounds of these runs if narrower.

    Bounds that contradict each other are not taken.
    """
    known, at = [], 1.0 if friction >= STICKING else friction
    if at in LIMITS:
        known.append(Reference(*LIMITS[at], LIMITS_SOURCE))
    elif at in SETTLED:
        known.append(Reference(SETTLED[at], UNCERTAINTY, SOURCE))
    for run in [] if contradictory(here) else guaranteed(here).itertuples():
        source = f"the guaranteed bounds of {run.run}"
        known.append(Reference((run.low + run.high) / 2.0, (run.high - run.low) / 2.0, source))
    return min(known, key=lambda each: each.uncertainty, default=None)


def costs_of(runs: DataFrame) -> DataFrame:
    """What each code needs for an error: a line for each μ, target and code that reaches it.

    A target is reached by runs whose lasting error is within it, and the uncertainty of the reference counts against
    them. The columns are friction, target, code, quickest (run), seconds, smallest (run with the fewest unknowns),
    unknowns, sure (the quickest is confirmed) and sure_smallest; time_ratio and unknowns_ratio are over triangles. Runs
    that a finer mesh confirms come before all others.
    """
    key = ["friction", "target", "code"]
    reach = runs.lasting + runs.floor
    found = concat([runs[reach <= target].assign(target=target) for target in TARGETS])
    quick = found.sort_values(["confirmed", "seconds"], ascending=[False, True]).drop_duplicates(key)
    small = found.sort_values(["confirmed", "unknowns", "seconds"], ascending=[False, True, True]).drop_duplicates(key)
    quick = quick.sort_values(["first", "target", "rank"], ascending=[True, False, True])
    quick = quick.rename(columns={"run": "quickest", "confirmed": "sure"})[[*key, "quickest", "seconds", "sure"]]
    small = small.rename(columns={"run": "smallest", "confirmed": "sure_smallest"})
    costs = quick.merge(small[[*key, "smallest", "unknowns", "sure_smallest"]], on=key)
    own = costs[costs.code == TRIANGLES][["friction", "target", "seconds", "unknowns"]]
    costs = costs.merge(own, on=["friction", "target"], how="left", suffixes=("", "_own"))
    return costs.assign(
        time_ratio=costs.seconds / costs.seconds_own, unknowns_ratio=costs.unknowns / costs.unknowns_own
    )


def compared_of(costs: DataFrame) -> DataFrame:
    """Triangles beside the best of the other codes: a line for each μ and target that both reach.

    The quickest other code (code, seconds) and the one with the fewest unknowns (smallest_code, unknowns) may be two.
    """
    key = ["friction", "target"]
    others = costs[costs.code.isin(OTHERS) & costs.seconds_own.notna()]
    small = others.sort_values("unknowns", kind="stable").drop_duplicates(key).rename(columns={"code": "smallest_code"})
    quick = others.sort_values("seconds", kind="stable").drop_duplicates(key).sort_index()
    return quick[[*key, "seconds_own", "seconds", "code", "time_ratio"]].merge(
        small[[*key, "unknowns_own", "unknowns", "smallest_code", "unknowns_ratio"]], on=key
    )


def least_of(runs: DataFrame) -> DataFrame:
    """The run of each code at each μ with the smallest lasting error that a finer mesh confirms."""
    sure = runs[runs.confirmed & runs.lasting.notna()].sort_values("lasting", kind="stable")
    return sure.drop_duplicates(["first", "code"]).sort_values(["first", "rank"])


def _at_most(error: float, floor: float) -> float:
    """What an error is at most, as far as is known: one that is not resolved has the uncertainty of the reference."""
    return error if error > floor else error + floor


def _slug(friction: float) -> str:
    """μ inside the name of a table or figure."""
    return f"mu-{friction:g}".replace(".", "_")


def values_of(runs: DataFrame, costs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences, with what errors cost, see `costs_of`."""
    compared, least = compared_of(costs), least_of(runs)
    triangles = least[least.code == TRIANGLES]
    reached = [_at_most(run.lasting, run.floor) for run in triangles.itertuples()]
    failed = runs[~runs.solved]
    sure = {friction: guaranteed(here) for friction, here in _by_friction(runs)}
    doubtful = [friction for friction, here in _by_friction(runs) if contradictory(here)]
    return {
        "fine": _compared(compared, compared.target.min()),
        "coarse": _compared(compared, COARSE if compared.target.min() < COARSE else math.nan),
        "triangles": max(reached, default=None),
        "bounds": [{"friction": friction, "name": _slug(friction), **found.iloc[0]} for friction, found in sure.items()
                   if len(found) and friction not in doubtful],
        "doubtful": [{"friction": friction, "count": len(sure[friction])} for friction in doubtful],
        "runs": len(runs), "solved": int(runs.solved.sum()),
        "failing": listing([f"{number} of {CODES[code].name}" for code, number in failed.code.value_counts().items()]),
        "missing": [key for key in CODES if key not in set(runs.code)],
        "chance": sorted({*costs[~costs.sure].quickest, *costs[~costs.sure_smallest].smallest}),
    }  # fmt: skip


def _compared(compared: DataFrame, target: float) -> dict[str, Any] | None:
    """Costs of one error over all μ at which triangles and another code reach it."""
    found = compared[compared.target == target]
    return None if found.empty else {
        "target": target, "own": span(found.seconds_own, seconds), "ratios": span(found.time_ratio, _factor),
        "unknowns": span(found.unknowns_ratio, _factor),
    }  # fmt: skip


def _factor(value: float) -> str:
    """How many times as much."""
    return significant(value, 2)


KINDS: Final = {
    "PROBLEM": "the problem itself",
    COULOMB: "the problem itself, under Coulomb's law",
    "ONE_SENSE": "the problem itself, if it slips in one sense",
    "STICKING": "the tied problem",
    "GIVEN_BOUND": "the problem with the friction bound of the computed state held fixed",
}
"""Name of a `BracketKind`, or `COULOMB` → what is bracketed; two are of rows that earlier versions made."""


def _code(key: str) -> str:
    return CODES[key].name


_force, _first = fixed(".7f"), partial(scientific, digits=1)
FORMS: Final[Mapping[str, Callable[[Any], str]]] = {
    "friction": "{:g}".format, "target": _first, "code": _code, "smallest_code": _code, "seconds_own": seconds,
    "seconds": seconds, "setup": lambda times: seconds(min(times, default=None)), "time_ratio": _factor,
    "unknowns_own": count, "unknowns": count, "unknowns_ratio": _factor, "half_force": _force, "spread": percent,
    "peak": memory, "residual": _first, "low": _force, "high": _force, "lower": _force, "upper": _force,
    "half": scientific, "width": scientific, "strain_error": scientific, "sure": lambda sure: "yes" if sure else "no",
    "kind": lambda kind: KINDS.get(kind, NOTHING), "message": lambda text: text or NOTHING,
}  # fmt: skip
"""Column of a table → how its values read."""


def tables_of(runs: DataFrame, costs: DataFrame) -> dict[str, DataFrame]:
    """The tables by name; `costs` is that of `costs_of`."""

    def told(error: float, floor: float) -> str:
        """An error; one that is not resolved as what it is at most."""
        return f"{'' if error != error or error > floor else '≤ '}{scientific(_at_most(error, floor))}"

    shown = runs.assign(
        shown=list(map(told, runs.error, runs.floor)), half=0.5 * (runs.high - runs.low) / runs.low,
        sure=runs.guaranteed & runs.solved, lower=runs.lower.where(runs.guaranteed),
        upper=runs.upper.where(runs.guaranteed),
    )  # fmt: skip
    least, absent = least_of(shown), [key for key in CODES if key not in set(runs.code)]
    remedies = DataFrame([(key, CODES[key].remedy) for key in absent], columns=["code", "how to get it"])
    tables = {
        "costs": compared_of(costs), "least": least.assign(shown=list(map(told, least.lasting, least.floor))),
        "intervals": intervals_of(shown), "failures": shown[~shown.solved],
        "missing": remedies,
    }  # fmt: skip
    for friction, here in _by_friction(shown):
        name, bracket = _slug(friction), here.code == BRACKET
        tables[f"costs-{name}"] = costs[costs.friction == friction]
        tables[f"brackets-{name}"] = here[bracket]
        tables[f"rows-{name}"] = here[~bracket]
    return tables


def _settings(runs: DataFrame, known: Mapping[float, Reference]) -> dict[str, DataFrame]:
    """Values that errors are relative to, models with the memory of their processes before a case, and meshes."""
    references = [
        {"μ": f"{friction:g}", "P/2 [N/mm]": _force(each.value), "±": scientific(each.uncertainty),
         "smallest error resolved": scientific(each.floor), "from": each.source}
        for friction, each in known.items()
    ]  # fmt: skip
    models = []
    for name, found in runs.sort_values("order", kind="stable").groupby("model", sort=False):
        model, said = MODELS[str(name)], sorted(set(found.version.dropna()) - {""})
        options = ", ".join(f"{option} = {value}" for option, value in model.options.items())
        models.append({
            "model": name, "code": _code(model.code), "version, as it says": ", ".join(said) or NOTHING,
            "options": options or NOTHING, "memory with its libraries": memory(found.before.dropna().median()),
        })  # fmt: skip
    meshes = []
    for name, family in FAMILIES.items():
        numbers = sorted(set(runs[runs.mesh == name].number))
        told = [f"{each} (each cell {ratio(each):g} of the one before it)" if name == "graded" else str(each)
                for each in numbers]  # fmt: skip
        if numbers:
            meshes.append({"family": name, "what it is": family.reading, "cells a side, or levels": listing(told)})
    frames = map(DataFrame, (references, models, meshes))
    return dict(zip(("Values that errors are relative to", "Models", "Meshes"), frames, strict=True))


def report(rows: Sequence[Row]) -> Report:
    """The report of these rows; the same rows give the same report."""
    runs = runs_of(rows)
    known, costs, pictures, places = known_of(runs), costs_of(runs), {}, []
    for name, draw in figures_of(runs, known).items():
        pictures[name] = drawn(name, draw)
    for friction, here in _by_friction(runs):
        name = _slug(friction)
        places.append({
            "friction": friction, "name": name, "known": known.get(friction),
            "errors": f"best-time-{name}" in pictures, "intervals": f"intervals-{name}" in pictures,
            "slips": not {COULOMB, "ONE_SENSE"}.isdisjoint(here.kind),
        })  # fmt: skip
    # the command that measures the same, without the place of its files and of other Pythons
    counted = runs.mesh.isin([name for name, family in FAMILIES.items() if family.counted])
    words = ["python -m comparisons peers --friction", *(f"{friction:g}" for friction in runs.friction.unique())]
    words += ["--cells", *map(str, sorted(set(runs.number[counted])))] if counted.any() else []
    words += [f"--levels {max(runs.number[~counted]) + 1}"] if not counted.all() else []
    words += [f"--repeat {rows[0].case['repetitions']}"]
    values = {
        **values_of(runs, costs), "resolution": RESOLUTION, "codes": CODES, "command": " ".join(words),
        "places": places,
    }  # fmt: skip
    tables, settings = tables_of(runs, costs), _settings(runs, known)
    return render("comparisons.peers", "peers", values, tables, pictures, rows, settings, forms=FORMS)


# pictures

COSTS: Final = {"unknowns": "unknowns [-]", "seconds": "processor time of set-up and solve [s]"}
"""What an error is drawn against: column of the runs → label."""

_COLOURS: Final = {TRIANGLES: BLUE, BRACKET: "#000000", "ngsolve": VERMILLION, "getfem": GREEN}
_MARGIN: Final = 2.0  # factor between the outermost marks and the frame
_NARROW: Final = 30.0  # largest over smallest cost, below which powers of ten are too few to label an axis


def figures_of(runs: DataFrame, known: Mapping[float, Reference]) -> "dict[str, Callable[[], Figure]]":
    """Name of a picture → what draws it.

    For each μ at which P/2 is known, and some error, the best error that each code has over all its models and meshes,
    against unknowns and against time; for each with guaranteed bounds, these intervals beside the forces of all codes.
    """
    found: dict[str, Callable[[], Figure]] = {}
    for friction, here in _by_friction(runs):
        name, value = _slug(friction), known.get(friction)
        if here.error.notna().any():
            found[f"best-unknowns-{name}"] = partial(_panel, partial(_fronts, here, "unknowns"))
            found[f"best-time-{name}"] = partial(_panel, partial(_fronts, here, "seconds"))
        if value is not None and here.bounded.any():
            found[f"intervals-{name}"] = partial(_panel, partial(_intervals, here, value))
    return found


def _panel(draw: "Callable[[Axes], None]") -> "Figure":
    """A picture with its legend below."""
    figure = new_figure(5.2, 3.6)
    axes = figure.subplots()
    draw(axes)
    grid(axes)
    axes.set_axisbelow(True)
    legend_below(figure, 2, 7)
    return figure


def _fronts(runs: DataFrame, cost: str, axes: "Axes") -> None:
    """For each code its costs in ascending order, where the error falls."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    known = runs[runs.error.notna()]
    for code, about in CODES.items():
        here = known[(known.code == code) & (known[cost] > 0.0)]
        here = here.assign(height=here.lasting.clip(lower=here.floor)).sort_values([cost, "height"])
        front = here[here.height < here.height.cummin().shift(fill_value=math.inf)]
        if len(front):
            axes.plot(front[cost], front.height, color=_COLOURS[code], marker=about.marker, linewidth=1.2, markersize=5,
                      label=about.name)  # fmt: skip
    axes.set(xscale="log", yscale="log", xlabel=COSTS[cost], ylabel="relative error of P/2 [-]")
    if len(known) and max(known[cost]) < _NARROW * min(known[cost]):  # labels at 1, 2, 5 times powers of ten
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _intervals(runs: DataFrame, known: Reference, axes: "Axes") -> None:
    """Guaranteed intervals, each narrower than those of fewer unknowns, and the forces of all models of all codes."""
    axes.set_xscale("log")
    axes.set_yscale("symlog", linthresh=known.floor)
    axes.axhspan(-known.floor, known.floor, color=GREY, alpha=0.2, linewidth=0, label="not resolved")
    for code in (*OTHERS, TRIANGLES):
        about, here = CODES[code], runs[(runs.code == code) & runs.solved]
        if len(here):
            axes.plot(here.unknowns, here.half_force / known.value - 1.0, color=_COLOURS[code], marker=about.marker,
                      linestyle="none", markersize=4, markerfacecolor="none", label=about.name)  # fmt: skip
    sure = runs[runs.bounded].sort_values("unknowns")
    sure = sure[sure.width < sure.width.cummin().shift(fill_value=math.inf)]
    ends = [sure.low / known.value - 1.0, sure.high / known.value - 1.0]
    axes.vlines(sure.unknowns, *ends, color=_COLOURS[BRACKET], linewidth=3, alpha=0.6, label="guaranteed interval")
    # all bars and marks are inside the frame, and so is the grey band; labels do not meet in it
    bounded = runs[runs.bounded]
    places = [*bounded.lower, *bounded.upper, *runs.half_force[runs.solved].dropna()]
    heights = [place / known.value - 1.0 for place in places]
    bottom, top = _MARGIN * min(-known.floor, *heights), _MARGIN * max(known.floor, *heights)
    powers = range(math.ceil(math.log10(3.0 * known.floor)), math.floor(math.log10(max(top, -bottom))) + 1)
    ticks = [0.0, *(10.0**power for power in powers), *(-(10.0**power) for power in powers)]
    axes.set_ylim(bottom, top)
    axes.set_yticks([each for each in ticks if bottom <= each <= top])
    axes.set_yticks([], minor=True)
    axes.set(xlabel=COSTS["unknowns"], ylabel="P/2, relative difference [-]")
