"""What `solve` itself adds: kinds of input, starts from earlier results."""

import numpy as np
import pytest

from qvi_contact import InputError, RectilinearMesh, solve
from qvi_contact.gallery import compressed_plate
from solvers import Status


def test_a_start_from_an_earlier_result_is_in_physical_units():
    """Started from the answer, or from that of half the load scaled up, the first residual is that of the answer."""
    first = solve(compressed_plate(0.2, (6, 6)))
    half = solve(compressed_plate(0.2, (6, 6), displacement=0.5e-3))
    pressure = -first.contacts["plate"].normal_stress
    assert first.iterations > 3
    for initial in (first, pressure, -2.0 * half.contacts["plate"].normal_stress):
        again = solve(compressed_plate(0.2, (6, 6)), initial=initial)
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
    from qvi_contact import Contact, ContactProblem, Material, Traction

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
