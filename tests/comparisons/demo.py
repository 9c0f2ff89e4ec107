"""A study with successes and failures and its command, apart from tests of it, as processes that run it load it."""

import click

from comparisons.lab.commands import Plan, experiment
from comparisons.lab.studies import Study

PLACES = [(mesh, mu, 7) for mesh in (8, 16) for mu in (0.1, 0.2, 0.5)]
DEMO = Study(
    "demo", 1, "tests.run_tasks:measured",
    [{"mesh": mesh, "friction": mu, "method": method, "seed": seed}
     for mesh, mu, seed in PLACES for method in ("plain", "raise", *(["crash"] if (mesh, mu) == (8, 0.2) else []))],
    packages=("click", "no-such-package"),
)  # fmt: skip


def ways(*names):
    """The study of some ways to fail."""
    return Study("ways", 1, "tests.run_tasks:failing", [{"way": name} for name in names], packages=())


@experiment(short_help="The demo study.")
@click.option("--way", "names", multiple=True)
def demo(names):
    """The demo study, or some ways to fail."""
    return Plan([ways(*names) if names else DEMO], reported)


def reported(rows):
    from comparisons.lab.reports import render  # which takes longer to load than the study itself

    return render("", "demo", {}, {}, {}, rows, template="# A\n")
