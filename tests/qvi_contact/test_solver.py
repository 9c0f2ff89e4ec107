"""What `solve` itself adds: kinds of input, starts from earlier results."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    InputError,
    Material,
    RectilinearMesh,
    SolveError,
    Traction,
    limit_load_factor,
    refine,
    solve,
    solve_history,
)
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution import reach
from solvers import Status, solve_qvi


def test_a_start_from_an_earlier_result_is_in_physical_units():
    """Started from the answer, or from that of half the load scaled up, the first residual is that of the answer."""
    first = solve(compressed_plate(0.2, (6, 6)))
    half = solve(compressed_plate(0.2, (6, 6), displacement=0.5e-3))
    pressure = -first.contacts["plate"].normal_stress
    assert first.iterations > 3
    for initial in (first, pressure, -2.0 * half.contacts["plate"].normal_stress):
        again = solve(compressed_plate(0.2, (6, 6)), method="fixed-point", initial=initial)
        assert again.status is Status.SOLVED
        assert again.iterations <= 2
        assert again.history[0].residual < 1e-7


@pytest.mark.parametrize("initial", ["high", np.ones(3), np.nan])
def test_bad_starts_are_refused(initial):
    with pytest.raises(InputError, match="initial"):
        solve(compressed_plate(0.2), initial=initial)


@pytest.mark.parametrize("problem", [None, "plate", RectilinearMesh.rectangle((1, 1))])
def test_what_is_not_a_problem_is_refused(problem):
    with pytest.raises(InputError, match="problem"):
        solve(problem)


@pytest.mark.parametrize(
    ("arguments", "field"),
    [({"cells": 4}, "cells"), ({"cells": (4, 4, 4)}, "cells"), ({"cells": (2, 2), "origin": 0.0}, "origin"),
     ({"cells": (2, 2), "grading": (0.8, 0.8, 0.8)}, "grading")],
)  # fmt: skip
def test_pairs_are_pairs(arguments, field):
    with pytest.raises(InputError) as caught:
        RectilinearMesh.rectangle(**arguments)
    assert caught.value.field == field


def test_no_warning_escapes_from_a_diverging_outer_iteration():
    """An L-bracket at 97 % of what friction holds back: solved or not, quietly."""
    lines = np.linspace(0.0, 3.0, 10)
    active = np.ones((9, 9), dtype=bool)
    active[3:, 3:] = False
    mesh = RectilinearMesh(lines, lines, active).with_edges("roof", "top", at=3.0).with_edges("step", "top", at=1.0)
    conditions = [
        Contact("bottom", friction=0.3), Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0),
        Traction("step", x=0.0, y=0.0), Traction("roof", x=14.5, y=-50.0),
    ]  # fmt: skip
    result = solve(ContactProblem(mesh, Material(2.1e5, 0.3, "strain"), conditions))
    assert result.status is not Status.INFEASIBLE
    if result.status is Status.SOLVED:
        assert result.contacts["bottom"].tangential_force == pytest.approx(-14.5, rel=1e-8)


def sheared_block():
    """Pressure 100 x: friction carries the shear of the sides on the right, not on the left.

    In the corners, which Bogner-Fox-Schmit's element has one shear for.
    """
    mesh = RectilinearMesh.rectangle((8, 2), 2.0, 1.0)
    conditions = [
        Contact("bottom", 0.3, name="base"), Traction("top", x=27.0, y=lambda x, y: -100.0 * x + 0 * y),
        Traction("left", x=0.0, y=-27.0), Traction("right", x=0.0, y=27.0),
    ]  # fmt: skip
    return ContactProblem(mesh, Material(1e3, 0.3), conditions)


def test_a_certified_answer_is_not_given_up(monkeypatch):
    """However little the first solve has missed; the remark names the corner whose shear was given up."""

    def ends_so(qvi, **settings):
        solution = solve_qvi(qvi, **settings)
        return solution if solution.solved else replace(solution, status=Status.INACCURATE)

    monkeypatch.setattr(reach, "solve_qvi", ends_so)
    result = solve(sheared_block(), element="bfs")
    assert result.status is Status.SOLVED
    assert result.certificate.passed
    assert result.discretization.freed.tolist() == [0]
    assert [remark for remark in result.remarks if "(0, 0)" in remark and "cannot carry" in remark]


def test_a_limit_of_the_caller_is_no_reason_to_give_up_a_shear(monkeypatch):
    calls = []

    def counted(qvi, **settings):
        calls.append(settings)
        return solve_qvi(qvi, **settings)

    monkeypatch.setattr(reach, "solve_qvi", counted)
    result = solve(sheared_block(), element="bfs", method="uzawa", iterations=3)
    assert (result.status, len(calls)) == (Status.MAX_ITERATIONS, 1)
    assert not len(result.discretization.freed)
    assert solve(sheared_block(), element="bfs", time_limit=1e-9).status is Status.TIME_LIMIT
    assert len(calls) == 2


def test_time_that_is_over_while_corners_are_given_up(monkeypatch, clock):
    """The first solve ends in time, the one without the shears does not: more time may help."""

    def slow(qvi, **settings):
        solution = solve_qvi(qvi, **settings)
        clock.passes(1.0)
        return replace(solution, status=Status.STALLED)

    monkeypatch.setattr(reach, "solve_qvi", slow)
    result = solve(sheared_block(), element="bfs", time_limit=1.5)
    assert result.status is Status.TIME_LIMIT
    assert result.message.startswith("time limit")
    assert not len(result.discretization.freed)
    assert solve(sheared_block(), element="bfs", time_limit=5.0).status is Status.STALLED


def test_the_state_when_the_time_is_over_is_a_state():
    """Whatever it is worth is what its certificate says."""
    result = solve(compressed_plate(0.2, (6, 6)), time_limit=1e-9)
    assert result.status is Status.TIME_LIMIT
    assert result.has_state
    assert 1e-8 < result.certificate.accuracy < np.inf
    assert result.contacts["plate"].normal_force > 100.0
    with pytest.raises(SolveError, match="time limit"):
        solve(compressed_plate(0.2, (6, 6)), time_limit=1e-9, throw=True)


ENTRIES = {
    "solve": solve,
    "history": lambda problem, **options: solve_history([problem], **options),
    "refine": refine,
    "limit": lambda problem, **options: limit_load_factor(problem, ["body"], **options),
}


@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("limit", [0.0, np.nan, "60"])
def test_bad_time_limits_are_refused(entry, limit):
    with pytest.raises(InputError) as caught:
        ENTRIES[entry](compressed_plate(0.2, (4, 4)), time_limit=limit)
    assert caught.value.field == "time_limit"


def test_options_of_all_methods_keep_the_default():
    """A callback, a limit and a start are no choice of a method."""
    first = solve(compressed_plate(0.2, (6, 6)))
    seen = []
    again = solve(compressed_plate(0.2, (6, 6)), initial=first, callback=seen.append, max_iterations=50, time_limit=60)
    assert again.solution.method == first.solution.method == "condensed"
    assert len(seen) == again.iterations < first.iterations
