"""What `solve` itself adds: kinds of input, starts from earlier results, limits of time, what it tells of an end."""

import numpy as np
import pytest
import qpsolvers

from comparisons.benchmark import calls
from qvi_contact import InputError, SolveError, TriangleMesh, limit_load_factor, refine, solve, solve_history
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import Contact, ContactProblem, Material, Traction
from solvers import Status


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


@pytest.mark.parametrize("problem", [None, "plate", TriangleMesh.rectangle((1, 1))])
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
        TriangleMesh.rectangle(**arguments)
    assert caught.value.field == field


def test_no_warning_escapes_from_a_diverging_outer_iteration():
    """An L-bracket at 97 % of what friction holds back: solved or not, quietly."""
    lines = np.linspace(0.0, 3.0, 10)
    active = np.ones((9, 9), dtype=bool)
    active[3:, 3:] = False
    mesh = (
        TriangleMesh.grid(lines, lines, active)
        .with_edges("roof", lambda _, y: np.isclose(y, 3.0))
        .with_edges("step", lambda _, y: np.isclose(y, 1.0))
    )
    conditions = [
        Contact("bottom", friction=0.3), Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0),
        Traction("step", x=0.0, y=0.0), Traction("roof", x=14.5, y=-50.0),
    ]  # fmt: skip
    result = solve(ContactProblem(mesh, Material(2.1e5, 0.3, "strain"), conditions))
    assert result.status is not Status.INFEASIBLE
    if result.status is Status.SOLVED:
        assert result.contacts["bottom"].tangential_force == pytest.approx(-14.5, rel=1e-8)


def test_claims_of_infeasibility_are_checked(monkeypatch):
    """A back end that says infeasible of a problem with a solution has failed, not proved anything."""

    def liar(problem, *_, **__):
        return qpsolvers.Solution(problem, found=False, extras={"status": "PrimalInfeasible"})

    monkeypatch.setattr(qpsolvers, "solve_problem", liar)
    result = solve(compressed_plate(0.2), inner="qp:clarabel")
    assert result.status is Status.BACKEND_FAILED
    assert "Clarabel solves this problem" in result.message


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


def block(drag):
    """A block on a contact that cannot open, and whose friction carries 0.3, dragged."""
    loads = [Traction("top", x=drag, y=-1.0), Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    ground = Contact("bottom", 0.3, law="bilateral", name="ground")
    return ContactProblem(TriangleMesh.rectangle((4, 2), 2.0, 1.0), Material(1e3, 0.2), [ground, *loads])


@pytest.mark.parametrize(
    ("drag", "options", "status"),
    [
        (1.0, {}, Status.INNER_INFEASIBLE),
        (1.0, {"method": "condensed"}, Status.INNER_INFEASIBLE),
        (0.31, {"method": "condensed", "max_iterations": 5}, Status.MAX_ITERATIONS),
    ],
)
def test_the_message_beyond_what_friction_carries_names_the_limit_analysis(drag, options, status):
    result = solve(block(drag), **options)
    assert result.status is status
    for word in ("beyond", "limit_load_factor", "qvi-contact limit"):
        assert word in result.message


def test_a_small_solve_stays_short():
    """Calls of Python and built-in functions, 10 % above what they were last; fewer are welcome, and then the limit."""
    assert calls.counted().calls <= 10_900
    assert calls.counted(same_mesh=True).calls <= 5_750
