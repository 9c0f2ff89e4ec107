"""The report of the comparison and its tables, from the stored rows alone."""

from collections import Counter
from functools import partial
from itertools import chain
from typing import Final

from pandas import DataFrame, Series, concat

from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.report.numbers import NOTHING, count, percent, scientific, seconds, significant
from comparisons.lab.study import StoredStudy
from comparisons.lab.tables import Form, Grid, crossed
from comparisons.solvers import measures
from comparisons.solvers.accuracies import LEVELS, METHODS, TABLE, Backend
from comparisons.solvers.figures import figures
from comparisons.solvers.measures import CONE_ENERGY, ERRORS, UNDOUBLED, ranking, runs_of, values_of
from comparisons.solvers.outcomes import FALSE_ALARM
from comparisons.solvers.tasks import INNER, OUTER
from solvers.inner.registry import how_to_install

KINDS: Final = {
    "inner": "single inner problems",
    "sequence": "sequences of inner problems",
    "outer": "whole inequalities (condensed)",
}
"""Kind of task → its name; sequences are warm where the solver can keep something."""

_WITHIN: Final = {"fastest": 1.0, "within 2 ×": 2.0, "within 10 ×": 10.0}  # the fastest time
_LONGEST_LIST: Final = 40
_UNKNOWN: Final = Backend(NOTHING, {})  # of stored rows
_SIZES: Final = ("unknowns", "condensed", "points", "equations")
_SHARES: Final = ("open", "stick", "slip")

FORMS: Final[dict[str, Form]] = {
    **dict.fromkeys(("share", "true", "spread", "within", *_SHARES), percent),
    **dict.fromkeys((*ERRORS, "condition"), scientific), **dict.fromkeys((FALSE_ALARM, *_SIZES), count),
    **dict.fromkeys(("mean", "smallest", "largest", "power"), partial(significant, digits=2)),
    "iterations": significant, "words": lambda words: words or NOTHING,
}  # fmt: skip
"""Column of a table → how its values read."""


def tables_of(runs: DataFrame) -> dict[str, DataFrame | Grid]:
    """The tables by name."""
    return {
        "overview": overview(runs), "truth": truth(runs), "first": first(runs),
        **{f"times-{kind}": speeds(measures.of_kind(runs, kind)) for kind in KINDS},
        "kinds": kinds(runs), "twins": twins(runs), "warm": warm(runs), "forms": forms(runs),
        "infeasible": infeasible(runs), "errors": errors(runs), "powers": powers(runs),
        "problems": problems(runs), "failures": failures(runs),
    }  # fmt: skip


def _joined(runs: DataFrame, *names: str) -> list[str]:
    """Some factors of each run as the name of its group."""
    return [", ".join(each) for each in zip(*(runs[name] for name in names), strict=True)]


def first(runs: DataFrame) -> DataFrame:
    """Who solves most at the accuracy in the middle, and then most within twice the fastest time."""
    lines = [
        (name, solver, f"{solved} of {given}", within)
        for kind, name in KINDS.items()
        for solver, solved, given, within in ranking(runs, kind)
    ]
    return DataFrame(lines, columns=["kind", "solver", "solved", "within"])


def powers(runs: DataFrame) -> DataFrame:
    """How the median error follows the tolerance asked for."""
    found = measures.error_powers(runs)
    energy = ["one more cone" if solver in CONE_ENERGY else "as it is" for solver in found]
    return DataFrame({"solver": [*found], "power": [*found.values()], "energy": energy})


def overview(runs: DataFrame) -> DataFrame:
    """Shares certified, by kind of task and level, and how often "solved" was untrue."""
    names = [f"{kind}, {level}" for kind in KINDS for level in LEVELS]
    by_kind = concat({kind: measures.of_kind(runs, kind) for kind in KINDS}, names=["which"]).reset_index("which")
    columns = by_kind.which + ", " + by_kind.level
    shares = by_kind.certified.groupby([by_kind.solver, columns]).agg(_share).unstack().reindex(columns=names)
    told = shares.join(measures.told_by(runs)[["share", FALSE_ALARM]], how="outer").reindex(runs.solver.unique())
    return told.rename_axis("solver").reset_index()


def _share(certified: "Series[bool]") -> str:
    """How many of so many runs are certified."""
    return f"{percent(certified.mean())} of {len(certified)}"


def _certified(runs: DataFrame) -> str:
    return _share(runs.certified)


def truth(runs: DataFrame) -> DataFrame:
    """What was said of each inner problem, beside whether it was true."""
    told = measures.told_by(runs).reset_index()
    return told.assign(true=1.0 - told.share)


def speeds(chosen: DataFrame) -> DataFrame:
    """Shares of the profile, and shifted geometric means, by solver."""
    told = concat([_speeds_at(chosen[chosen.level == level]).add_prefix(f"{level}: ") for level in LEVELS], axis=1)
    return told.reindex(chosen.solver.unique()).rename_axis("solver").reset_index()


def _speeds_at(runs: DataFrame) -> DataFrame:
    """Solver → texts of its shares and means at one level."""
    ratios, times = measures.performance_ratios(runs), runs.dropna(subset="time").groupby("solver").time
    limited = runs.time.fillna(runs.limit).groupby(runs.solver)
    return DataFrame({
        **{name: measures.profile(ratios, at).map(percent) for name, at in _WITHIN.items()},
        "mean time": times.agg(measures.shifted_mean).map(seconds) + times.size().map(" ({})".format),
        "mean, failures at the limit": limited.agg(measures.shifted_mean).map(seconds),
    })  # fmt: skip


def errors(runs: DataFrame) -> DataFrame:
    """Medians of the certificate's errors of single inner problems, and of iterations."""
    groups = runs[runs.feasible & (runs.task == INNER)].groupby(["solver", "level"], sort=False)
    medians = groups[[*ERRORS, "iterations", "spread"]].median()
    failed = [
        f"{size - sure} of {size}" for sure, size in groups.certified.agg(["sum", "size"]).itertuples(index=False)
    ]
    return medians.reset_index().assign(failed=failed)


def kinds(runs: DataFrame) -> Grid:
    """Shares certified of single inner problems, by kind of problem and form."""
    chosen = runs[runs.feasible & (runs.task == INNER)]
    return crossed(chosen.assign(column=_joined(chosen, "kind", "form")), "solver", "column", _certified)


def twins(runs: DataFrame) -> Grid:
    """Single inner problems with rows given twice, beside the same with each given once."""
    pairs = measures.paired(runs, UNDOUBLED)
    once = pairs.assign(problem=pairs.twin, certified=pairs.certified_beside, lost=pairs.lost_beside)
    both = concat([pairs, once])[["solver", "problem", "certified", "lost"]]
    names = [name for doubled in pairs.problem.unique() for name in (doubled, UNDOUBLED[doubled])]
    shares = crossed(both, "solver", "problem", _certified, names)
    lost = crossed(both, "solver", "problem", lambda found: str(found.lost.sum()), names)
    rows = [(solver, *chain(*zip(each, others, strict=True)))
            for (solver, *each), (_, *others) in zip(shares.rows, lost.rows, strict=True)]  # fmt: skip
    return Grid("", ("solver", *(f"{name}: {text}" for name in names for text in ("certified", "no answer"))), rows)


def warm(runs: DataFrame) -> DataFrame:
    """Time of warm over that of cold sequences."""
    found = measures.by_solver(measures.warm_ratios(runs)).reset_index()
    found["kept"] = [TABLE.get(solver, _UNKNOWN).keeps or NOTHING for solver in found.solver]
    found["faster"] = [f"{each.below} of {each.number}" for each in found.itertuples()]
    return found


def forms(runs: DataFrame) -> DataFrame:
    """Time in all unknowns over that of the condensed form."""
    names = {INNER: "inner problem", OUTER: "outer loop"}
    found = {name: measures.by_solver(measures.condensed_ratios(runs, task)) for task, name in names.items()}
    return concat(found, names=["what", "solver"]).reset_index()


def infeasible(runs: DataFrame) -> Grid:
    """What was said of problems without a solution."""
    chosen = runs[~runs.feasible]
    return crossed(chosen.assign(column=_joined(chosen, "problem", "task", "form")), "solver", "column", _words)


def _words(runs: DataFrame) -> str:
    counts = Counter(status.replace("_", " ") for status in runs.status)
    return ", ".join(f"{word} ({number})" for word, number in sorted(counts.items()))


def failures(runs: DataFrame) -> DataFrame:
    """Runs that ended without an answer or by a failure of the back end, grouped by what was said."""
    lost = runs[runs.lost]
    lost = lost.assign(
        words=lost.reason.str[:120], status=lost.status.str.replace("_", " "),
        where=_joined(lost, "problem", "form", "task", "level"),
    )  # fmt: skip
    key = ["solver", "status", "words"]
    found = lost.groupby(key, as_index=False).agg(runs=("where", "size"), where=("where", "first"))
    return found.sort_values("runs", ascending=False, kind="stable").head(_LONGEST_LIST)


def problems(runs: DataFrame) -> DataFrame:
    """Sizes and conditions of the problems."""
    found = runs.dropna(subset="facts").drop_duplicates("problem")
    facts = DataFrame([*found.facts], columns=[*_SIZES, "condition", *_SHARES]).astype(float)
    return facts.assign(problem=found.problem.array, kind=found.kind.array)


def settings(runs: DataFrame) -> Grid:
    """The table of accuracies, as the runs were given it."""
    given = crossed(runs.dropna(subset="options"), "solver", "level", _options, tuple(LEVELS))
    headings = ("solver", "what it is", *(f"{level}: certified at {LEVELS[level]:.0e}" for level in LEVELS))
    rows = [(solver, TABLE.get(solver, _UNKNOWN).remark, *texts) for solver, *texts in given.rows]
    return Grid("What every solver was asked for", headings, rows)


def _options(runs: DataFrame) -> str:
    return ", ".join(f"`{name}={value}`" for name, value in sorted(runs.options.iloc[0].items())) or "no option"


def left_out(runs: DataFrame) -> Grid:
    """Solvers that were not compared, and how to get them."""
    rows = [(name, _how_to_compare(name)) for name in TABLE if name not in set(runs.solver)]
    return Grid("Not compared", ("solver", "how to get it"), rows)


def _how_to_compare(name: str) -> str:
    return "name it by --only" if name in METHODS else f"python -m {how_to_install(name)}, unless --only left it out"


def report_of(study: StoredStudy) -> Document:
    """The report; the same rows give the same one."""
    runs = runs_of(study.rows)
    grids = [settings(runs), left_out(runs), *environment_grids(study.rows)]
    values = values_of(study.declaration, runs)
    name, tables = study.declaration["name"], tables_of(runs)
    return render("comparisons.solvers", name, values, tables, figures(runs), grids, forms=FORMS)
