"""The commands `wild` and `estimates`."""

from pathlib import Path

import click

from comparisons.lab.options import COUNT, ListCommand, json_option, out_option
from comparisons.lab.run_options import RunOptions, study_options

STORE = "results/wild/wild.sqlite"
QUICK_STORE = "results/wild/wild-quick.sqlite"
ESTIMATES = "results/estimates/estimates.sqlite"
QUICK_ESTIMATES = "results/estimates/estimates-quick.sqlite"


@click.command(cls=ListCommand, short_help="Generated problems: what becomes of each.")
@study_options(STORE, timeout=120.0, memory=4096)
@click.option("--quick", is_flag=True, help=f"Five problems of each family, kept in {QUICK_STORE}.")
@click.option("--each", type=COUNT, metavar="NUMBER", help="Problems of each family.  [default: 61]")
@click.option("--only", multiple=True, metavar="FAMILY…", help="Only these families; give another --store too.")
@out_option("results/wild")
@json_option
def wild(options: RunOptions, quick: bool, each: int | None, only: tuple[str, ...], out: Path, as_json: bool) -> int:
    """Solve generated problems as unusual as users may state them, and check what becomes of each.

    They have thin bodies, odd units, large friction, polygons, arcs, holes, joints, several bodies, meshes from files,
    distant gaps, every contact law, plates with moments, no load at all, or contradictory data. Every answer that is
    called solved is checked again from its stresses and the data alone. The exit status is 1 if such an answer is
    wrong, if an exception is not one of the package's own, or if contradictory data are accepted.

    \b
    Examples:
        python -m comparisons wild --quick
        python -m comparisons wild --each 50 --only gaps idle --store results/gaps.sqlite --out results/gaps
    """  # noqa: D301
    from comparisons.lab.reported import run_and_report
    from comparisons.wild.report import counts_of, problems_of, report
    from comparisons.wild.study import EACH, QUICK, declared

    study = declared(only, each or (QUICK if quick else EACH))
    part = "is for all problems: with --only or --each give --store FILE, --out FOLDER"
    options = options.apart(QUICK_STORE if quick else None, part if only or each is not None else "")
    found = run_and_report(options, study, lambda stored: report(stored.rows), out)
    problems = problems_of(found.stored.rows)
    outcomes = found.document(outcomes=counts_of(problems))
    found.tell({"schema": "qvi-contact/wild/1", **outcomes} if as_json else None)
    return 1 if problems.trouble.any() else 0


@click.command(cls=ListCommand, short_help="How often the error that refine estimates is that of its answer.")
@study_options(ESTIMATES, timeout=300.0)
@click.option("--quick", is_flag=True, help=f"Six problems, kept in {QUICK_ESTIMATES}.")
@click.option("--count", type=COUNT, metavar="NUMBER", help="Problems; give another --store too.  [default: 200]")
@out_option("results/estimates")
@json_option
def estimates(options: RunOptions, quick: bool, count: int | None, out: Path, as_json: bool) -> None:
    """Refine generated problems on triangles to a target, and compare each answer with a much finer reference.

    The report says how often the answer is as accurate as its estimated error says, and how far the two are apart.

    \b
    Examples:
        python -m comparisons estimates --quick
        python -m comparisons estimates --count 1000 --store results/many.sqlite --out results/many
    """  # noqa: D301
    from comparisons.lab.reported import run_and_report
    from comparisons.wild.estimates import EACH, QUICK, declared, report, runs_of, values_of

    part = "is for the usual number of problems: with --count give --store FILE, --out FOLDER"
    options = options.apart(QUICK_ESTIMATES if quick else None, part if count is not None else "")
    study = declared(count or (QUICK if quick else EACH))
    found = run_and_report(options, study, lambda stored: report(stored.rows), out)
    values = values_of(runs_of(found.stored.rows))
    found.tell({"schema": "qvi-contact/estimates/1", **found.document(values=values)} if as_json else None)
