"""Studies in this process, for tests of what is computed and told, not of the processes of the runner."""

from pkgutil import resolve_name

from comparisons.lab.machine import machine, versions
from comparisons.lab.study import Outcome
from comparisons.lab.worker.outcome import of_return


class Here:
    """Does cases as a worker process does, without its imports; processes have tests of their own."""

    def __init__(self, terms):
        self._task = resolve_name(terms.task)
        self._environment = terms.environment({"machine": machine(), "versions": versions(terms.packages)})

    def run(self, values):
        return Outcome(**of_return(self._task(values)), environment=self._environment)

    def close(self):
        pass
