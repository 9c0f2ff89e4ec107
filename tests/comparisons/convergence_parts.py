"""What the tests of all studies of convergence share: rows made in this process, and the committed ones."""

from pathlib import Path
from pkgutil import resolve_name

import pytest

from comparisons.convergence import command
from comparisons.lab.study import Outcome, pool, read_csv, read_study, run_study
from comparisons.lab.worker.outcome import of_return

COMMITTED = Path(command.__file__).parents[1] / "reports" / "convergence"


class _Here:
    """Does cases as a worker process does, without its imports; processes have tests of their own."""

    def __init__(self, terms):
        self._terms, self._task = terms, resolve_name(terms.task)

    def run(self, values):
        return Outcome(**of_return(self._task(values)), environment=self._terms.environment({}))

    def close(self):
        pass


def rows_of(study, path):
    """The rows of all cases of a study, through its runner and a store at this path."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool, "Crew", _Here)
        assert run_study(study, path, progress=False).complete
    return read_study(path).rows


def committed_rows(name):
    """The rows of the committed report of a study."""
    return read_csv(COMMITTED / f"convergence-{name}.csv.gz")


def committed_text(name):
    """The committed report of a study."""
    return (COMMITTED / f"convergence-{name}.md").read_text(encoding="utf-8")
