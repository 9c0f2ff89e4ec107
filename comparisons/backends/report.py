"""The report of the comparison, from the stored rows alone."""

from collections.abc import Sequence

from comparisons.backends import figures, tables
from comparisons.backends.accuracies import MARGIN
from comparisons.backends.findings import findings
from comparisons.backends.measures import Run, runs_of
from comparisons.report import Exhibit, Figure, Report, Section, environment_grids
from comparisons.report.numbers import count_of
from comparisons.study import Row, StoredStudy

_PROFILE = (
    "For each solver the share of problems that it solves within a multiple of the fastest solver's time; a problem "
    "is a mesh in one form. The height at 1 says how often it is the fastest, the height at the right end how often "
    f"it succeeds. The {figures.HIGHLIGHTED} curves with the largest area are coloured, best first in the legend "
    "with the number of problems solved; all others are grey, their values are in the table of times."
)
_PROFILE_FAILURE = (
    "A run that the certificate does not confirm has an infinite ratio: its curve never counts it. A problem that "
    "nobody solves keeps every curve below 1."
)


def report_of(study: StoredStudy) -> Report:
    """The report; the same rows give the same one."""
    rows = study.rows
    runs = runs_of(rows)
    name = str(study.declaration["name"])
    return Report(
        name, "Solvers compared on frictional contact", _introduction(study, runs), findings(runs),
        [_truth(runs), _speed(runs), _difficulties(runs), _sequences(runs), _details(runs, rows)],
        [tables.settings(rows), tables.left_out(sorted({run.solver for run in runs})), *environment_grids(rows)],
        _limitations(),
    )  # fmt: skip


def _introduction(study: StoredStudy, runs: Sequence[Run]) -> str:
    solvers = len({run.solver for run in runs})
    problems = len({run.problem for run in runs})
    cases = int(study.declaration["cases"])
    partly = "" if len(study.rows) == cases else f" (so far: {cases} cases are declared)"
    command = "python -m comparisons solvers" + (" --quick" if study.declaration["name"] != "solvers" else "")
    return (
        f"{count_of(solvers, 'solver')} on {count_of(problems, 'problem')} of frictional contact, "
        f"{count_of(len(runs), 'run')}{partly}, by `{command}`: convex inner problems with a given friction bound, the "
        "sequences of them that an outer loop meets, and whole outer loops, in all unknowns and condensed on the "
        "contact, at three levels of accuracy. Nothing counts as solved unless the package's certificate passes on the "
        "original data."
    )


def _truth(runs: Sequence[Run]) -> Section:
    picture = Figure(
        "truth-shares", "What was said, and what was true", figures.truth(runs, "truth-shares"),
        "A bar for each solver, the most reliable at the top: shares of the inner problems that at least one solver "
        "solved at that level and in that form. "
        "*right*: said solved, and it is. *untrue*: said solved, and the certificate fails. *false alarm*: said "
        "infeasible or unbounded. *modest*: did not say solved, and the certificate passes. *gave up*: said so.",
        "*right* and *modest* are certified; *untrue* and *false alarm* are wrong answers, the rest honest failures.",
    )  # fmt: skip
    paragraph = (
        "An answer is judged by the certificate on the original data: primal and dual feasibility, stationarity, both "
        "complementarities with the signs of the multipliers, the gap of energies, natural map. "
        f"Solvers measure in norms of their own; each was asked for {MARGIN:g} of the tolerance that it is judged by."
    )
    return Section('How true is "solved"?', [paragraph], [tables.overview(runs), picture, tables.truth(runs)])


def _speed(runs: Sequence[Run]) -> Section:
    exhibits: list[Exhibit] = []
    for kind, name in tables.KINDS:
        chosen = tables.of_kind(runs, kind)
        svg = figures.profiles(chosen, f"profiles-{kind}")
        title = f"Performance profiles: {name}"
        exhibits.append(Figure(f"profiles-{kind}", title, svg, _PROFILE, _PROFILE_FAILURE))
        exhibits.append(tables.speeds(runs, kind, name))
    paragraph = (
        "Times are medians of wall times. Profiles show relative speed and robustness at once (Dolan and Moré 2002). "
        "Sequences are solved warm by solvers that can keep something, cold by the others."
    )
    return Section("How fast?", [paragraph], exhibits)


def _difficulties(runs: Sequence[Run]) -> Section:
    paragraph = (
        "Strongly graded meshes, contact that opens, sharp edges, rows given twice, and problems without a solution."
    )
    return Section("What is difficult?", [paragraph], [tables.kinds(runs), tables.forms(runs), tables.infeasible(runs)])


def _sequences(runs: Sequence[Run]) -> Section:
    picture = Figure(
        "warmth", "Warm against cold", figures.warmth(runs, "warmth"),
        "A dot for each sequence of inner problems: its time warm over its time cold; diamonds are geometric means. "
        "Left of the dashed line warm is faster.",
        "Sequences that failed, warm or cold, have no dot.",
    )  # fmt: skip
    paragraph = (
        "An outer loop solves one inner problem after the other, with the same matrices and a bound that changes "
        "less and less. Cold, each begins with a new object; warm, the solver keeps its object, or gets the last "
        "answer as a start."
    )
    return Section("Sequences", [paragraph], [picture, tables.warm(runs)])


def _details(runs: Sequence[Run], rows: Sequence[Row]) -> Section:
    picture = Figure(
        "accuracies", "Accuracy reached", figures.accuracy(runs, "accuracies"),
        "For each solver and level the smallest tolerance at which the certificate of a single inner problem passes: "
        "marks are medians, lines go from the best to the worst problem. Dotted lines are the levels' tolerances.",
        "Whatever lies right of the dotted line of its own level has failed. Runs without an answer are not drawn.",
    )  # fmt: skip
    return Section("Details", [], [picture, tables.errors(runs), tables.problems(rows), tables.failures(runs)])


def _limitations() -> list[str]:
    return [
        "Times are wall times on one machine, of small and medium problems: with several workers at a time they "
        "disturb each other, more or less alike for all solvers. Ratios below 1.2 mean nothing.",
        "Most back ends are called through `qpsolvers` or `cvxpy`, whose conversions are part of the times, and of "
        "what can go wrong: that is how they are used here, not the best that can be done with them.",
        "Each solver has the one setting of the table below; others may suit it better. Tolerances mean something "
        "else for each of them.",
        "Times of inner problems do not contain the factorisation of the stiffness nor the condensation, which all "
        "solvers share; an outer loop condenses anew.",
        "Strict admissibility on whole edges (`strict:`, `strict-direct:`) is another problem and not compared.",
        "The problems are of one family: plane contact with dense coupling of the contact points, strictly convex "
        "inner problems. Nothing follows for others.",
        "Warm starts are those the package makes use of: a start for the unknowns, kept factors, kept multipliers. "
        "What a solver could do beyond is not measured.",
    ]
