"""What the tests of all studies of convergence share: rows made in this process, and what is committed."""

from importlib import import_module
from pathlib import Path
from pkgutil import resolve_name

import pytest

from comparisons.convergence import command, solves
from comparisons.lab.study import Outcome, pool, read_csv, read_study, run_study
from comparisons.lab.worker.outcome import of_return

_COMMITTED = Path(command.__file__).parents[1] / "reports" / "convergence"


class _Here:
    """Does cases as a worker process does, without its imports; processes have tests of their own."""

    def __init__(self, terms):
        self._terms, self._task = terms, resolve_name(terms.task)

    def run(self, values):
        return Outcome(**of_return(self._task(values)), environment=self._terms.environment({}))

    def close(self):
        pass


def rows_of(study, path):
    """The rows of all cases of a study, through its runner and a store at this path; each solve is timed once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool, "Crew", _Here)
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
