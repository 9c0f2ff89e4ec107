"""The report of the comparison, from the stored rows alone."""

from collections.abc import Sequence

from comparisons.lab.report import environment_grids
from comparisons.lab.report.numbers import count_of, scientific
from comparisons.lab.report.old import Exhibit, Figure, Report, Section
from comparisons.lab.study import Row, StoredStudy
from comparisons.solvers import figures, tables
from comparisons.solvers.accuracies import LEVELS, MARGIN
from comparisons.solvers.findings import findings
from comparisons.solvers.measures import NEGLIGIBLE, Run, runs_of
from comparisons.solvers.study import QUICK_NAME

_PROFILE = (
    "For each solver the share of problems that it solves within a multiple of the fastest solver's time; a problem "
    "is a mesh in one form. The height at 1 says how often it is the fastest, the height at the right end how often "
    f"it succeeds within {figures.UNTIL:g} times the fastest. Coloured are the {figures.HIGHLIGHTED} curves with the "
    "largest area below them (their mean height on the axis shown), largest first in the legend with the number of "
    "problems solved; all others are grey, their values are in the table of times."
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
    title = "Solvers compared on frictional contact" + (" (quick)" if name == QUICK_NAME else "")
    return Report(
        name, title, _introduction(study, runs), findings(runs),
        [_truth(runs), _speed(runs), _difficulties(runs), _sequences(runs), _details(runs, rows)],
        [tables.settings(rows), tables.left_out(sorted({run.solver for run in runs})), *environment_grids(rows)],
        _limitations(),
    )  # fmt: skip


def _introduction(study: StoredStudy, runs: Sequence[Run]) -> str:
    solvers = len({run.solver for run in runs})
    problems = len({run.problem for run in runs})
    cases = int(study.declaration["cases"])
    partly = "" if len(study.rows) == cases else f" (so far: {cases} cases are declared)"
    command = "python -m comparisons solvers" + (" --quick" if study.declaration["name"] == QUICK_NAME else "")
    levels = ", ".join(f"{level} {scientific(tolerance, 1)}" for level, tolerance in LEVELS.items())
    return (
        f"{count_of(solvers, 'solver')} on {count_of(problems, 'problem')} of frictional contact, "
        f"{count_of(len(runs), 'run')}{partly}, by `{command}`: convex inner problems with a given friction bound, the "
        "sequences of them that an outer loop meets, and whole outer loops, in all unknowns and condensed on the "
        f"contact, at these levels of accuracy: {levels}. Nothing counts as solved unless the package's certificate "
        "passes at that tolerance on the original data."
    )


def _truth(runs: Sequence[Run]) -> Section:
    picture = Figure(
        "truth-shares", "What was said, and what was true", figures.truth(runs, "truth-shares"),
        "A bar for each solver, the largest share of *right* at the top: shares of the inner problems that have a "
        "solution, also of those that no solver was certified on. "
        "*right*: said solved, and it is. *untrue*: said solved, and the certificate fails. *false alarm*: said "
        "infeasible or unbounded. *modest*: did not say solved, and the certificate passes. *gave up*: said so.",
        "*right* and *modest* are certified; *untrue* and *false alarm* are wrong answers, the rest honest failures.",
    )  # fmt: skip
    paragraph = (
        "An answer is judged by the certificate on the original data: primal and dual feasibility, stationarity, both "
        "complementarities with the signs of the multipliers, the gap of energies, natural map. "
        f"Solvers measure in norms of their own; all that take a tolerance were asked for {MARGIN:g} of "
        "the one they are judged by, as far as they accept it (see the table of what every solver was asked for)."
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
    return Section("What is difficult?", [paragraph], [
        tables.kinds(runs), tables.twins(runs), tables.forms(runs), tables.infeasible(runs),
    ])  # fmt: skip


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
        "disturb each other, more or less alike for all solvers. Ratios of times "
        f"between {1.0 / NEGLIGIBLE:.2f} and {NEGLIGIBLE:g} mean nothing.",
        "Most back ends are called through `qpsolvers` or `cvxpy`, whose conversions are part of the times, and of "
        "what can go wrong: that is how they are used here, not the best that can be done with them.",
        "Each solver has the one setting of the table below; others may suit it better. Tolerances mean something "
        "else for each of them.",
        "Solvers that take linear objectives only (ECOS through `qpsolvers` and `cvxpy`, CVXOPT through `cvxpy`) are "
        "given the energy as one more second-order cone by those libraries. An objective within ε of the least one "
        "fixes the unknowns to about √ε only: they are asked for the same ε as all others, and nothing is done to make "
        "up for it.",
        "Times of inner problems contain the making of the solver's object, but neither the factorisation of the "
        f"stiffness nor the condensation, which all solvers share. {tables.OUTER_TIMES}",
        "Uzawa's method was given one step on all problems, not one tuned to each.",
        "Strict admissibility on whole edges (`strict:`, `strict-direct:`) is another problem and not compared.",
        "The problems are of one family: plane contact with dense coupling of the contact points, strictly convex "
        "inner problems. Nothing follows for others.",
        "Warm starts are those the package makes use of: a start for the unknowns, kept factors, kept multipliers. "
        "What a solver could do beyond is not measured.",
    ]
