"""One case: a sequence solved problem by problem, on a shared factorisation from cold starts, and from warm ones."""

import time
from collections.abc import Mapping
from typing import Any, Final

from comparisons.convergence.sequences.study import CHAINS, Chain
from qvi_contact import ContactResult, solve, solve_history, solve_sweep
from qvi_contact.discretization.families import ElementName

WAYS: Final = ("single", "cold", "warm")
"""Each problem by itself; one factorisation for all; the same, each started from the one before."""

EVERY: Final = 4
"""Every fourth problem is solved by itself."""


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a case of `study` in all ways, one after the other in this process.

    The problems of a history are solved by themselves without the slip before them, for their time alone.

    Returns
    -------
    dict
        for each way: seconds of processor time, iterations, status, accuracy, and normal and tangential force on the
        contact, a list of one number for each problem, of single solves for every fourth

    """
    chain = CHAINS[case["sequence"]]
    return {way: _solved(way, chain, case["quick"], case["element"]) for way in WAYS}


def _solved(way: str, chain: Chain, quick: bool, element: ElementName) -> dict[str, Any]:
    clock, problems = _Clock(), chain.problems(quick)
    if way == "single":
        for problem in problems[::EVERY]:
            clock(0, solve(problem, element=element))
    elif chain.history:
        solve_history(problems, clock, element=element, warm_start=way == "warm")
    else:
        base, values = chain.base(quick), chain.chosen(quick)
        solve_sweep(base, chain.parameter, values, callback=clock, element=element, warm_start=way == "warm")
    return clock.found


class _Clock:
    """Hears of each result, and takes down its time and its numbers."""

    def __init__(self) -> None:
        self._last = time.process_time()
        names = ("seconds", "iterations", "status", "accuracy", "normal", "tangential")
        self.found: dict[str, list[Any]] = {name: [] for name in names}

    def __call__(self, number: int, result: ContactResult) -> None:  # noqa: ARG002  # as callbacks are called
        seconds = time.process_time() - self._last
        line = next(iter(result.contacts.values()))
        values = (
            seconds, result.iterations, str(result.status), result.certificate.accuracy,
            line.normal_force, line.tangential_force,
        )  # fmt: skip
        for name, value in zip(self.found, values, strict=True):
            self.found[name].append(value)
        self._last = time.process_time()
