"""Traction conditions hold exactly, whatever the body's outline; what cannot hold keeps its resultants."""

from functools import partial

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

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
    exact,
    solve,
)
from qvi_contact.gallery import compressed_plate
from solvers import Status
from tests.steps import steps

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # that element's corners

MATERIAL = Material(1000.0, 0.3)
LINES = np.array([-0.5, -0.2, 0.1, 0.5]), np.array([-0.5, 0.0, 0.2, 0.5])
OUTLINES = {
    "L": np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool),
    "T": np.array([[0, 1, 0], [0, 1, 0], [1, 1, 1]], dtype=bool),
    "ring": np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool),
    "U": np.array([[1, 1, 1], [1, 0, 1], [1, 0, 1]], dtype=bool),
}
SIDES = {
    "tractions": ("tt", "tt", "tt", "tt"),
    "displacements": ("uu", "uu", "uu", "uu"),
    "mixed": ("tu", "ut", "tu", "ut"),
    "held below": ("uu", "tt", "tt", "tt"),
}


@pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)
@pytest.mark.parametrize("kinds", SIDES.values(), ids=SIDES)
def test_exact_states_on_other_outlines(outline, kinds):
    """Holes included, as long as tractions are all that acts on them."""
    mesh = RectilinearMesh(*LINES, outline)
    if mesh.hole_edges.any() and kinds != SIDES["tractions"]:
        sides = dict(zip(("bottom", "right", "top", "left"), kinds, strict=True))
        problem = exact.problem_from_state(exact.pure_bending(MATERIAL, 7.0), mesh, MATERIAL, sides)
        with pytest.raises(InputError, match="bounds a hole"):
            solve(problem)
        return
    for state in (exact.pure_bending(MATERIAL, 7.0), exact.gravity_column(MATERIAL, 3.0, 0.5)):
        sides = dict(zip(("bottom", "right", "top", "left"), kinds, strict=True))
        result = solve(exact.problem_from_state(state, mesh, MATERIAL, sides))
        assert result.status is Status.SOLVED
        x, y, stress = result.gauss_stress()
        expected = np.moveaxis(state.stress(x, y), 0, -1)
        assert stress == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())


def test_gauge_and_energy_leave_a_definite_matrix():
    for friction_mesh in ((1, 1), (3, 2)):
        K = discretize(compressed_plate(0.3, friction_mesh)).qvi.K.toarray()
        assert np.linalg.eigvalsh(K).min() > 0.0
    assert discretize(compressed_plate(0.3, (2, 2))).qvi.n == 16


def box(top_x, top_y, left_y):
    """A square held below, with tractions on the other sides."""
    return ContactProblem(
        RectilinearMesh.rectangle((3, 3)),
        MATERIAL,
        [
            Displacement("bottom", x=0.0, y=0.0),
            Traction("right", x=0.0, y=0.0),
            Traction("top", x=top_x, y=top_y),
            Traction("left", x=0.0, y=left_y),
        ],
    )


def test_conflicting_shear_in_a_corner_keeps_the_resultants():
    """σ_xy = 2 from the top, 0 from the right, −1 from the left: no stress can have both at the corners."""
    result = solve(box(2.0, 0.0, 1.0))
    assert len(result.discretization.elimination.conflicts) == 2
    assert result.status is Status.SOLVED
    assert result.resultant("top").x == pytest.approx(2.0, rel=1e-12)
    assert result.resultant("left").y == pytest.approx(1.0, rel=1e-12)
    assert result.resultant("right").y == pytest.approx(0.0, abs=1e-12)
    bottom = result.resultant("bottom")
    assert [bottom.x, bottom.y] == pytest.approx([-2.0, -1.0], rel=1e-10)
    assert ["(0, 1)" in text for text in result.remarks] == [True, False, False]
    assert ["(1, 1)" in text for text in result.remarks] == [False, True, False]
    assert f"up to {result.traction_misfit:.3g}" in result.remarks[-1]
    assert result.traction_misfit > 0.1
    agreeing = solve(box(2.0, 0.0, -2.0))
    assert len(agreeing.remarks) == 2  # top left agrees
    assert solve(box(0.0, -5.0, 0.0)).traction_misfit < 1e-9


def test_loads_on_a_hole_must_balance_by_themselves():
    """Pressure on one side of the hole, held by the outside: well posed, but not by a single-valued Airy function."""
    mesh = RectilinearMesh(*LINES, OUTLINES["ring"]).with_edges("floor of the hole", "top", at=0.0)
    conditions = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    conditions += [Traction("floor of the hole", x=0.0, y=-1.0), Traction("bottom", x=0.0, y=0.0)]
    rest = mesh.with_edges("roof", "top", at=0.5)
    problem = ContactProblem(rest, MATERIAL, [*conditions, Displacement("roof", x=0.0, y=0.0)])
    with pytest.raises(InputError, match="the loads on a hole") as caught:
        discretize(problem)
    assert caught.value.value == pytest.approx(0.3, rel=1e-12)


@pytest.mark.parametrize("cells", [1, 4, 8])
def test_prescribed_shear_beside_a_contact_without_friction(cells):
    """σ_T = 0 on the contact and 0.2 beside it: the corner has neither, the resultants hold."""
    mesh = RectilinearMesh.rectangle((cells, cells))
    conditions = [
        Traction("top", x=0.0, y=-1.0), Traction("left", x=0.0, y=0.2), Displacement("right", x=0.0),
        Traction("right", y=-0.2), Contact("bottom", friction=0.0),
    ]  # fmt: skip
    result = solve(ContactProblem(mesh, MATERIAL, conditions))
    smooth = solve(ContactProblem(mesh, MATERIAL, [*conditions[:-1], Symmetry("bottom")]))
    assert result.status is Status.SOLVED
    assert result.contacts["bottom"].normal_force == pytest.approx(1.0, rel=1e-9)
    assert np.abs(result.contacts["bottom"].tangential_stress).max() < 1e-9
    assert result.energies.strain == pytest.approx(smooth.energies.strain, rel=0.1 if cells == 1 else 0.02)
    assert len(result.remarks) >= 2


def test_defect_correction_removes_the_rounding_of_the_assembled_matrix():
    """On cells of aspect 1:40 a direct solve of K is off by 1e-10 and more, the corrected one by round-off."""
    mesh = RectilinearMesh([0, 0.01, 0.02, 0.5, 1.99, 2], [-0.5, -0.1, -0.09, 0.5])
    state = exact.pure_bending(MATERIAL, 7.0)
    problem = exact.problem_from_state(state, mesh, MATERIAL, dict.fromkeys(("bottom", "right", "top", "left"), "uu"))
    discretization = discretize(problem)
    qvi = discretization.qvi
    result = solve(discretization)
    x, y, _ = result.gauss_stress()
    expected = np.moveaxis(state.stress(x, y), 0, -1)
    errors = []
    for z in (spsolve(qvi.K, qvi.f), result.solution.z):
        result.__dict__["dofs"] = discretization.values(z)
        errors.append(np.abs(result.gauss_stress()[2] - expected).max() / np.abs(expected).max())
    assert errors[1] < 1e-11
    assert errors[0] > 10 * errors[1]


def test_discretisation_has_no_loop_over_cells():
    """65 536 cells take 0.4 s on an idle core, with a loop minutes. Loops over the lines of the mesh are allowed."""
    few, many = (steps(partial(discretize, compressed_plate(0.2, (cells, cells)))) for cells in (8, 128))
    assert many - few < (128**2 - 8**2) / 2
