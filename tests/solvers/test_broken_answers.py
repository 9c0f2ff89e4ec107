"""What Clarabel answers is looked at before it is used: no answer, however broken, ends in a traceback."""

from types import SimpleNamespace

import numpy as np
import pytest

from solvers import Status, check_feasibility, solve_qvi
from tests.solvers.conftest import random_problem

clarabel = pytest.importorskip("clarabel")

BROKEN = {
    "none": lambda _: None,
    "short": lambda vector: list(vector)[:-1],
    "long": lambda vector: [*vector, 0.0],
    "nan": lambda vector: np.full(len(vector), np.nan),
    "inf": lambda vector: np.full(len(vector), np.inf),
    "text": lambda _: "text",
    "complex": lambda vector: 1j * np.ones(len(vector)),
}


@pytest.fixture(params=[(part, how) for part in ("x", "z") for how in BROKEN], ids="-".join)
def broken_clarabel(request, monkeypatch):
    """Clarabel, which answers "Solved" with one vector broken."""
    part, how = request.param
    sound = clarabel.DefaultSolver

    class Solver:
        def __init__(self, *arguments):
            self._sound = sound(*arguments)

        def __getattr__(self, name):
            return getattr(self._sound, name)

        def solve(self):
            found = self._sound.solve()
            answer = {name: getattr(found, name) for name in ("x", "z", "s", "iterations", "obj_val", "obj_val_dual")}
            answer |= {"status": "Solved", "solve_time": 0.0, "r_prim": 0.0, "r_dual": 0.0}
            return SimpleNamespace(**{**answer, part: BROKEN[how](answer[part])})

    monkeypatch.setattr(clarabel, "DefaultSolver", Solver)


@pytest.mark.usefixtures("broken_clarabel")
@pytest.mark.parametrize("inner", ["qp:clarabel", "direct:clarabel"])
def test_a_broken_answer_is_no_solution(inner):
    solution = solve_qvi(random_problem(0), inner=inner)
    assert solution.status in (Status.BACKEND_FAILED, Status.STALLED)
    assert not solution.certificate.passed


@pytest.mark.usefixtures("broken_clarabel")
def test_a_broken_answer_decides_nothing_wrongly():
    """Multipliers do not enter where a solution is claimed; without a finite point there is none."""
    found = check_feasibility(random_problem(0))
    assert found.feasible in (True, None)
    assert found.feasible is None or np.isfinite(found.z).all()
