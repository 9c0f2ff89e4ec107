"""Small studies for the tests of the study runner, one of them as a command."""

import click
from tests.retiring.study_tasks import WAYS

from comparisons.lab.study import Study, study_options
from qvi_contact.basics import run

DEMO = Study(
    "demo",
    1,
    "tests.retiring.study_tasks:measured",
    {"mesh": (8, 16), "friction": (0.1, 0.2, 0.5), "method": ("plain", "crash", "raise")},
    repeats=2,
    seed=7,
    keep=lambda case: case["method"] != "crash" or (case["mesh"], case["friction"]) == (8, 0.2),
    packages=("click", "no-such-package"),
)

SMALL = Study("small", 1, "package.module:function", {"mesh": (4, 8), "friction": (0.1,)}, repeats=2, seed=5)
ENVIRONMENT = {"machine": None, "versions": {"numpy": "2"}, "threads": 1, "timeout_seconds": 2.0, "memory_mib": None}


def ways(*names, **more):
    """The study of some of these."""
    return Study("ways", 1, "tests.retiring.study_tasks:failing", {"way": names or tuple(WAYS)}, packages=(), **more)


@click.command()
@study_options("demo.sqlite")
@click.option("--way", "names", multiple=True, help="Ways to fail, instead of the demo.")
def main(options, names):
    """The demo study."""
    study = ways(*names) if names else DEMO
    done = options.run(study)
    click.echo(f"{done.finished} of {len(study.cases)}")


if __name__ == "__main__":
    run(main, "study_demo")
