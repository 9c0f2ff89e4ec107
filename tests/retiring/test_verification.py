"""A right result passes; one with anything wrong in it does not, and the verification names what."""

from dataclasses import fields, replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    RectilinearMesh,
    RigidPlate,
    Traction,
    solve,
)
from qvi_contact.gallery import compressed_plate
from qvi_contact.result import ContactResult
from qvi_contact.solution.contact_line import ContactLine, ContactState
from qvi_contact.verification import verify_result
from solvers import Status

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # states and numbers of grids; triangles: test_triangle_results

FREE = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]


def lifted_block():
    """Pressed at its left end, pulled at its right: open, stick and slip."""
    top = Traction("top", x=2.0, y=lambda x, y: -30.0 + 25.0 * x + 0.0 * y)
    mesh = RectilinearMesh.rectangle((4, 2), width=2.0)
    ground = Contact("bottom", friction=0.3, cohesion=0.2, shear_limit=30.0, name="ground")
    return ContactProblem(mesh, Material(1e3, 0.3), [ground, top, Traction("left", y=0.0), Displacement("left", x=0.0),
                                                     Traction("right", x=0.0, y=0.0)])  # fmt: skip


def driven_plate():
    """A plate driven by force, whose motion is a multiplier of its balance."""
    contact = Contact("top", friction=0.4, plate=RigidPlate(force_x=2.0, force_y=-10.0), name="plate")
    conditions = [Contact("bottom", friction=0.5, name="ground"), contact, *FREE]
    return ContactProblem(RectilinearMesh.rectangle((3, 2)), Material(1e3, 0.2), conditions)


@pytest.fixture(scope="module")
def plate():
    result = solve(compressed_plate(0.2, (4, 3), width=1.5, grading=0.8))
    assert set(result.contacts["plate"].state) == {ContactState.STICK, ContactState.SLIP}
    return result


@pytest.fixture(scope="module")
def lifted():
    result = solve(lifted_block())
    assert result.status is Status.SOLVED, result.message
    assert set(result.contacts["ground"].state) == {0, 1, 2}
    return result


@pytest.fixture(scope="module")
def driven():
    result = solve(driven_plate())
    assert result.status is Status.SOLVED, result.message
    return result


def failed(result, tolerance=None):
    """Names of the checks that fail."""
    return {row.name for row in verify_result(result, tolerance).failures}


def changed(result, **changes):
    """The same result with another solution."""
    return ContactResult(result.discretization, replace(result.solution, **changes))


def claiming(result, **claims):
    """The same result with other things to say of itself."""
    other = changed(result)
    other.__dict__.update(claims)
    return other


def with_line(result, name, **changes):
    return claiming(result, contacts={**result.contacts, name: replace(result.contacts[name], **changes)})


class TestRightResults:
    """They pass, whatever the method and the problem."""

    def test_condensed(self, plate, lifted, driven):
        for result in (plate, lifted, driven):
            assert failed(result) == set()


class TestWrongNumbers:
    """Each fails by itself."""

    @pytest.mark.parametrize("kind", ["normal", "tangential"])
    def test_one_multiplier_with_its_sign_flipped(self, lifted, kind):
        name = f"{kind}_multiplier"
        values = getattr(lifted.solution, name)
        loaded = np.flatnonzero(np.abs(values) > 1e-6 * np.abs(values).max())
        assert len(loaded) > 2
        for point in loaded[::6]:
            flipped = values.copy()
            flipped[point] *= -1.0
            assert {"stationarity", "sign"} <= failed(changed(lifted, **{name: flipped})), point

    @pytest.mark.parametrize(
        ("field", "check"),
        [("normal_stress", "tractions"), ("tangential_stress", "tractions"), ("friction_bound", "tractions"),
         ("gap", "gap and slip"), ("slip", "gap and slip"), ("x", "points"), ("weights", "points")],
    )  # fmt: skip
    def test_one_value_of_a_contact_shifted_by_a_hundred_thousandth_of_itself(self, lifted, field, check):
        values = getattr(lifted.contacts["ground"], field)
        for point in np.flatnonzero(np.abs(values) > 1e-3 * np.abs(values).max())[::12]:
            shifted = values.copy()
            shifted[point] *= 1.0 + 1e-5
            wrong = with_line(lifted, "ground", **{field: shifted})
            forces = {"ground: forces"} if field in ("normal_stress", "tangential_stress", "weights") else set()
            assert f"ground: {check}" in failed(wrong) <= {f"ground: {check}", "energies", *forces}

    @pytest.mark.parametrize("rows", ["N", "T"])
    def test_unknowns_with_which_one_traction_is_shifted_so(self, plate, rows):
        """By the least change in energy that does it."""
        qvi, z = plate.solution.problem, plate.solution.z
        tractions = {"N": qvi.normal(z), "T": qvi.tangential(z)}[rows]
        for point in range(0, qvi.m, 6):
            row = getattr(qvi, rows)[point].toarray().ravel()
            softness = qvi.equality_system.solve(row)[0]
            shifted = z + 1e-5 * tractions[point] / (row @ softness) * softness
            assert "stationarity" in failed(changed(plate, z=shifted)), point

    def test_one_state_mislabelled(self, lifted):
        state = lifted.contacts["ground"].state
        for point in range(0, len(state), 8):
            wrong = state.copy()
            wrong[point] = (wrong[point] + 1) % 3
            assert failed(with_line(lifted, "ground", state=wrong)) == {"ground: states"}

    def test_a_contact_of_another_length(self, plate):
        line = plate.contacts["plate"]
        shorter = {f.name: getattr(line, f.name)[:-1] for f in fields(ContactLine) if np.ndim(getattr(line, f.name))}
        wrong = claiming(plate, contacts={"plate": replace(line, **shorter)}, energies=plate.energies)
        assert {"plate: tractions", "plate: states", "plate: points"} <= failed(wrong)

    def test_a_load_that_was_left_out(self, lifted):
        """The algebraic problem of a body without its load: the forces of prescribed tractions are not its own."""
        lighter = replace(lifted.discretization, problem=lifted_block())
        conditions = [c if c.edges != "top" else Traction("top", x=2.0, y=-30.0) for c in lifted.problem.conditions]
        lighter = replace(lighter, problem=replace(lifted.problem, conditions=conditions))
        assert "problem" in failed(ContactResult(lighter, lifted.solution))
