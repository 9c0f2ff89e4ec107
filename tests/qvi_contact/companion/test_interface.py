"""What the companion refuses, what it says of data it cannot meet, and its files and pictures."""

import re

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Displacement, InputError, Material, Traction, TriangleMesh
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate, ssnv128
from solvers import Status
from tests.cases import every_pair

STEEL = Material(1000.0, 0.3)
PLATE = compressed_plate(0.1, (3, 2))
FREE = [Traction(side, 0.0, 0.0) for side in ("left", "right")]


def block(contact, top=None):
    mesh = TriangleMesh.grid([0.0, 0.5, 1.0], [0.0, 0.4, 1.0])
    return ContactProblem(mesh, STEEL, [contact, top or Traction("top", 0.0, -1.0), *FREE])


class TestBadInput:
    """Every mistake is an InputError that names the field."""

    @pytest.mark.parametrize(
        ("name", "values"),
        [("degree", [0, 6, 2.5, "2", True, np.array([2, 3])]), ("tolerance", [0.0, 1.0, -1e-8, "small", None, True])],
    )
    def test_options(self, name, values):
        for value in values:
            with pytest.raises(InputError) as caught:
                solve_companion(PLATE, **{name: value})
            assert caught.value.field == name
        with pytest.raises(InputError) as caught:
            solve_companion("plate")
        assert caught.value.field == "problem"
        with pytest.raises(InputError, match="plate"):
            solve_companion(PLATE).trace("roof", [0.5])

    @pytest.mark.parametrize(
        ("bounds", "message"),
        [({"roof": np.zeros((3, 3))}, "contacts (plate)"), ({}, "every contact"), ([1.0], "mapping"),
         ({"plate": np.zeros((2, 3))}, "shape"), ({"plate": np.zeros(3)}, "shape"), ({"plate": "rough"}, "numbers"),
         ({"plate": np.full((3, 3), np.nan)}, "finite"), ({"plate": np.full((3, 3), np.inf)}, "finite"),
         ({"plate": np.array([[1.0, 1.0, 1.0], [1.0, -1.01, 1.0], [1.0, 1.0, 1.0]])}, "≥ 0"),
         ({"plate": np.array([[1.0, 1.0, 1.0], [-1e-3, 1.0, 1.0], [1.0, 1.0, 1.0]])}, "≥ 0")],
    )  # fmt: skip
    def test_bounds(self, bounds, message):
        with pytest.raises(InputError, match=re.escape(message)):
            solve_companion(PLATE, bounds=bounds)

    def test_a_bound_that_touches_zero_is_one(self):
        """Coefficients (1, −1, 1) are (1 − 2t)² ≥ 0."""
        companion = solve_companion(PLATE, bounds={"plate": np.tile([1.0, -1.0, 1.0], (3, 1))})
        assert companion.status is Status.SOLVED

    def test_loads_out_of_balance(self):
        mesh = TriangleMesh.rectangle((2, 2))
        conditions = [Traction("top", 0.0, -1.0), Traction("bottom", 0.0, 0.9), *FREE]
        with pytest.raises(InputError, match="balance"):
            solve_companion(ContactProblem(mesh, STEEL, conditions))


PEAK = 0.2548  # on an edge from 0 to 0.5: away from all points of quadrature, 4e-4 from a sample


def peak(x, middle, width):
    return np.exp(-(((x - middle) / width) ** 2))


class TestReasons:
    """Data that polynomials do not meet are named; what they meet is not."""

    def test_coulomb_has_a_moving_bound(self):
        assert len(solve_companion(PLATE).reasons) == 1
        assert solve_companion(PLATE, bounds={"plate": np.ones((3, 3))}).reasons == ()

    @pytest.mark.parametrize(("kind", "power", "degree"), every_pair(["gap", "offset", "support"], [2, 3, 5], [2, 3]))
    def test_degree_of_the_data(self, kind, degree, power):
        def field(x, y):
            return 1e-3 * (x**power + 0 * y)

        if kind == "support":
            problem = block(Contact.frictionless("bottom"), Displacement("top", 0.0, lambda x, y: -0.1 + field(x, y)))
        else:
            problem = block(Contact("bottom", 0.0, cohesion=0.1, **{kind: field}))
        reasons = solve_companion(problem, degree=degree).reasons
        assert bool(reasons) == (power > degree)
        assert all("interpolated" in reason for reason in reasons)

    @pytest.mark.parametrize(
        ("load", "force"),
        [(lambda x: 1.0 + x**19, 1.05), (np.sqrt, 2.0 / 3.0), (lambda x: np.where(x < 0.123, 2.0, 0.0), 0.246),
         (lambda x: peak(x, PEAK, 5e-4), 5e-4 * np.sqrt(np.pi))], ids=["polynomial", "root", "step", "peak"],
    )  # fmt: skip
    def test_loads_are_integrated(self, load, force):
        problem = block(Contact.frictionless("bottom"), Traction("top", 0.0, lambda x, y: -load(x) + 0 * y))
        companion = solve_companion(problem)
        assert companion.reasons == ()
        assert companion.contacts["bottom"].normal_force == pytest.approx(force, rel=1e-9)

    def test_loads_that_no_quadrature_integrates(self):
        rough = block(Contact.frictionless("bottom"), Traction("top", 0.0, lambda x, y: -1.0 - np.sin(1e6 * x) + 0 * y))
        (reason,) = solve_companion(rough).reasons
        assert reason.startswith("Traction.y")

    @pytest.mark.parametrize("kind", ["gap", "offset", "support"])
    def test_peaks_between_nodes_and_quadrature(self, kind):
        """Half a percent of an edge wide, away from all points of the rules; none on the edge beside it."""

        def field(x, y):
            return -0.1 - 1e-3 * peak(x, PEAK, 5e-4) + 0 * y

        base = Contact("bottom", 0.0, cohesion=0.1, **({kind: field} if kind in ("gap", "offset") else {}))
        top = Displacement("top", 0.0, field) if kind == "support" else None
        what = "Displacement.y" if kind == "support" else f"The {kind} of 'bottom'"
        (reason,) = solve_companion(block(base, top)).reasons
        assert reason.startswith(what)

    def test_friction_between_coefficients(self):
        """μ > 0 somewhere is Coulomb's law, even where no coefficient has it."""
        problem = block(Contact("bottom", lambda x, y: 0.3 * ((x > 0.3) & (x < 0.45)) + 0 * y, cohesion=0.1))
        assert any("own contact forces" in reason for reason in solve_companion(problem).reasons)
        problem = block(Contact("bottom", lambda x, y: 0 * x * y, cohesion=0.1))
        assert solve_companion(problem).reasons == ()

    def test_supports_that_disagree_in_a_corner(self):
        conditions = [Displacement("left", 0.0, 0.0), Displacement("top", 0.01, 0.0)]
        conditions += [Traction(side, 0.0, 0.0) for side in ("right", "bottom")]
        reasons = solve_companion(ContactProblem(TriangleMesh.rectangle((2, 2)), STEEL, conditions)).reasons
        assert any("disagree" in reason for reason in reasons)


@pytest.fixture(scope="module")
def base():
    return solve_companion(ssnv128((6, 5)))


@pytest.fixture(scope="module")
def lifted():
    companion = solve_companion(block(Contact("bottom", 0.3), Traction("top", 0.0, 1.0)))
    assert companion.status is Status.INFEASIBLE
    return companion


class TestOutput:
    """Files and pictures hold the numbers of the result."""

    def test_nothing_to_show(self, lifted):
        for use in (
            lambda: lifted.energy,
            lambda: lifted.contacts,
            lambda: lifted.plates,
            lambda: lifted.stress(0.5, 0.5),
            lambda: lifted.cell_strain([0.5], [0.5]),
            lambda: lifted.nodal_displacements,
        ):
            with pytest.raises(InputError, match="infeasible"):
                use()
        assert lifted.unknowns == 98
