"""A wrong number is never called solved: loads, gaps and cells of very different size in one problem."""

from functools import cache

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Symmetry,
    Traction,
    discretize,
    solve,
)
from qvi_contact.gallery import compressed_plate, sliding_block
from solvers import Status

STEEL = Material(2.09e5, 0.3)


@cache
def beside_an_obstacle(gap):
    """A pressed plate with an obstacle at a distance from its free side."""
    conditions = [
        Symmetry("left"),
        Symmetry("bottom"),
        Contact("right", friction=0.3, gap=gap),
        Contact("top", friction=0.3, gap=-1e-3),
    ]
    return solve(ContactProblem(RectilinearMesh.rectangle((6, 6)), STEEL, conditions))


@pytest.mark.parametrize("gap", [1.0, 100.0, 1000.0])
def test_an_obstacle_far_away_does_not_swamp_the_contact(gap):
    near = solve(compressed_plate(0.3, (6, 6))).contacts["plate"].normal_force
    result = beside_an_obstacle(gap)
    assert result.status is Status.SOLVED
    # The corner node is shared, so its shear is not prescribed here: the same body, a slightly richer space.
    assert result.contacts["top"].normal_force == pytest.approx(near, rel=2e-3)
    assert result.contacts["right"].normal_force == pytest.approx(0.0, abs=1e-5)
    again = beside_an_obstacle(0.1).contacts["top"].normal_force
    assert result.contacts["top"].normal_force == pytest.approx(again, rel=1e-7)


@pytest.mark.parametrize("side", [1e3, 1e5, 1e7])
def test_a_large_stress_elsewhere_does_not_hide_an_error_in_the_contact(side):
    """ν = 0: side pressure and contact pressure, here 1, do not feel each other."""
    mesh = RectilinearMesh.rectangle((6, 4), grading=0.9)
    conditions = [
        Symmetry("left"),
        Symmetry("bottom"),
        Traction("right", x=-side, y=0.0),
        Contact("top", friction=0.0, gap=-1e-3),
    ]
    result = solve(ContactProblem(mesh, Material(1000.0, 0.0), conditions))
    assert result.status in ((Status.SOLVED,) if side <= 1e5 else (Status.SOLVED, Status.INACCURATE))
    assert result.contacts["top"].normal_stress == pytest.approx(-1.0, rel=1e-5)


def drawn_along(pressure, degree=None, rows=None):
    """A block pressed on a floor, and stretched to twice its width: it slides everywhere, by far."""
    conditions = [
        Contact("bottom", 0.3),
        Traction("top", 0.0, -pressure),
        Traction("right", 1.0, 0.0),
        Symmetry("left"),
    ]
    problem = ContactProblem(RectilinearMesh.rectangle((4, 4)), Material(1.0, 0.0), conditions)
    return solve(problem.triangulated(), degree=degree, contact_rows=rows) if degree else solve(problem)


@pytest.mark.parametrize(("degree", "rows"), [(None, None), (4, "gauss"), (4, "bernstein"), (5, "bernstein")])
def test_small_pressures_beside_far_slips_are_certified_on_their_own_scale(degree, rows):
    results = [drawn_along(pressure, degree, rows) for pressure in (1e-3, 1e-5)]
    small, smaller = (result.contacts["bottom"].normal_stress for result in results)
    assert [result.status for result in results] == 2 * [Status.SOLVED]
    assert smaller == pytest.approx(1e-2 * small, rel=1e-6)


def test_the_stiffness_of_a_contact_does_not_depend_on_what_its_rows_are():
    gauss, bernstein = (drawn_along(0.1, 6, rows).solution.problem for rows in ("gauss", "bernstein"))
    assert bernstein.contact_stiffness == pytest.approx(gauss.contact_stiffness, rel=1e-9)


def test_tractions_that_count_as_none_are_remarked_on():
    seen, unseen = drawn_along(1e-5, 4), drawn_along(1e-8, 4)
    assert seen.remarks == ()
    assert unseen.status is Status.SOLVED
    assert len(unseen.remarks) == 1


def test_loads_out_of_balance_show_beside_large_displacements():
    outline = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool)
    mesh = RectilinearMesh([0, 1, 2, 3], [0, 1, 2, 3], outline).with_edges("inside", "top", at=1.0)
    mesh = mesh.with_edges("roof", "top", at=3.0)
    conditions = [
        *(Traction(side, x=0.0, y=0.0) for side in ("left", "right", "bottom")),
        Traction("inside", x=0.0, y=-1e-7),
        Displacement("roof", x=0.0, y=1.0),
    ]
    problem = ContactProblem(mesh, STEEL, conditions)
    with pytest.raises(InputError, match="out of balance"):
        discretize(problem, element="bfs")


@pytest.mark.parametrize("translation", [0.5, 50.0, 5000.0])
def test_large_slip_is_solved(translation):
    problem, _ = sliding_block((3, 2), translation=translation)
    result = solve(problem)
    assert result.status in ((Status.SOLVED,) if translation <= 1e3 else (Status.SOLVED, Status.INACCURATE))
    assert result.contacts["base"].normal_force == pytest.approx(200.0, rel=1e-6)


@pytest.mark.parametrize(("cells", "grading"), [(16, 0.5), (18, 0.5), (20, 0.45), (20, 0.4)])
def test_cells_beyond_double_precision_are_refused(cells, grading):
    """At a smallest cell of 1e-5 of the body and less: right, or not called solved."""
    try:
        result = solve(compressed_plate(0.2, (cells, cells), grading=grading), inner="direct:clarabel")
    except InputError as error:
        if error.field == "ContactProblem.mesh":
            return
        raise
    if result.status is Status.SOLVED:
        assert result.contacts["plate"].normal_force == pytest.approx(214.2, rel=1e-3)
    else:
        assert result.status in (Status.ILL_CONDITIONED, Status.INACCURATE, Status.STALLED, Status.INNER_INFEASIBLE)


def test_claims_of_infeasibility_are_checked(monkeypatch):
    """A back end that says infeasible of a problem with a solution has failed, not proved anything."""
    from solvers.inner.problem import no_result
    from solvers.inner.qp import QPSolver

    def liar(self, *_):
        return no_result(self._inner.qvi, Status.INFEASIBLE, "there is no answer")

    monkeypatch.setattr(QPSolver, "solve", liar)
    result = solve(compressed_plate(0.2), inner="qp:clarabel")
    assert result.status is Status.BACKEND_FAILED
    assert "Clarabel solves this problem" in result.message
