"""What the tests of all studies of convergence share: rows made in this process, and what is committed."""

from importlib import import_module
from pathlib import Path

import pytest

from comparisons.convergence import command, solves
from comparisons.lab.study import pool, read_csv, read_study, run_study
from tests.comparisons.study_here import Here

_COMMITTED = Path(command.__file__).parents[1] / "reports" / "convergence"


def rows_of(study, path):
    """The rows of all cases of a study, through its runner and a store at this path; each solve is timed once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool, "Crew", Here)
        patch.setattr(solves, "REPEATS", 1)
        assert run_study(study, path, progress=False).complete
    return read_study(path).rows


def committed_rows(name):
    """The rows of the committed report of a study."""
    return read_csv(_COMMITTED / f"convergence-{name}.csv.gz")


def committed_text(name):
    """The committed report of a study."""
    return (_COMMITTED / f"convergence-{name}.md").read_text(encoding="utf-8")


def made_again(name):
    """The text of the report of the committed rows, without pictures, and the numbers of its sentences."""
    module, figures = (import_module(f"comparisons.convergence.{name}.{part}") for part in ("report", "figures"))
    values, render = {}, module.render

    def recorded(package, stem, found, *others, **forms):
        values.update(found)
        return render(package, stem, found, *others, **forms)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "drawn", lambda *_: "drawn")
        patch.setattr(module, "render", recorded)
        return module.report(committed_rows(name)).text, values
