"""Cohesion, caps, Tresca, bilateral and tied contacts: what equals what, and states known in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import Expression, InputError, Polynomial, discretize, solve, verify_result
from qvi_contact.gallery import exact
from qvi_contact.mesh import TriangleMesh, graded_lines
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from solvers import Status
from tests.cases import every_pair, refused_at, thinned
from tests.qvi_contact.builders import difference, solved

MATERIALS = {
    "stress": Material(1000.0, 0.3),
    "strain": Material(2.1e5, 0.4, "strain"),
    "auxetic": Material(1.0, -0.4, "strain"),
}

L_SHAPE = np.array([[1, 1, 1], [1, 1, 0], [1, 1, 0]], dtype=bool)
MESHES = {
    "uniform": TriangleMesh.rectangle((4, 3), 2.0, 1.0),
    "graded": TriangleMesh.grid(graded_lines(-1.0, 2.0, 6, 0.5, both_ends=True), graded_lines(0.0, 1.0, 3, 1.6)),
    "L": TriangleMesh.grid([0.0, 0.5, 1.1, 2.0], [0.0, 0.4, 0.7, 1.0], L_SHAPE).with_edges(
        "roof", lambda _, y: np.isclose(y, 1.0)
    ),
}


def punched(mesh, material, *base, shift=2e-4, push=-1e-3):
    """A body whose roof is pushed down and along; its base, y = 0, is given."""
    roof = "roof" if "roof" in mesh.edge_names else "top"
    conditions = [Displacement(roof, x=shift, y=push), Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0), *base]
    if roof == "roof":
        mesh = mesh.with_edges("step", lambda _, y: np.isclose(y, 0.4))
        conditions.append(Traction("step", 0.0, 0.0))
    return ContactProblem(mesh, material, conditions)


@pytest.mark.parametrize(("mesh", "material"), list(zip(MESHES.values(), MATERIALS.values(), strict=True)), ids=MESHES)
class TestSameInOtherWords:
    """Two ways to state one law give one state."""

    def test_no_friction(self, mesh, material):
        smooth = solved(punched(mesh, material, Contact.frictionless("bottom")))
        others = [Contact.tresca("bottom", 0.0), Contact("bottom", 1.0, shear_limit=0.0),
                  Contact("bottom", lambda x, _: 0.0 * x, offset=3.0),
                  Contact("bottom", 0.0, cohesion=5.0, shear_limit=lambda x, _: 0.0 * x)]  # fmt: skip
        for other in others:
            assert difference(smooth, solved(punched(mesh, material, other))) < 1e-9

    def test_bilateral_without_friction_is_a_symmetry(self, mesh, material):
        for push in (-1e-3, 1e-3):  # the body is pulled up as well
            expected = solved(punched(mesh, material, Symmetry("bottom"), push=push))
            result = solved(punched(mesh, material, Contact("bottom", 0.0, law="bilateral", name="b"), push=push))
            assert difference(expected, result) < 1e-9
            assert result.contacts["b"].gap == pytest.approx(0.0, abs=1e-12)

    def test_tied_is_a_displacement(self, mesh, material):
        """With an obstacle that is curved and moves along."""
        gap = Polynomial([[1e-4], [0.0], [1e-4]])
        offset = Polynomial([[0.0], [0.0], [0.0], [3e-4]])  # of a degree that four Gauss points integrate
        held = Displacement("bottom", x=offset, y=lambda x, y: -gap(x, y))
        expected = solved(punched(mesh, material, held))
        result = solved(punched(mesh, material, Contact.tied("bottom", gap, offset, name="b")))
        assert difference(expected, result) < 1e-9
        line, force = result.contacts["b"], expected.resultant("bottom")
        assert line.tangential_force == pytest.approx(force.x, rel=1e-8)
        assert line.normal_force == pytest.approx(force.y, rel=1e-8)
        assert np.isinf(line.friction_bound).all()
        assert (line.state == 1).all()
        assert result.energies.load == pytest.approx(expected.energies.load, rel=1e-8, abs=0.0)

    def test_bound_is_kept_and_reached_where_it_slips(self, mesh, material):
        stress = 1e-3 * material.young
        cap, cohesion = 0.12 * stress, 0.02 * stress
        base = Contact("bottom", 0.2, cohesion=cohesion, shear_limit=cap, name="b")
        result = solved(punched(mesh, material, base, shift=6e-4), law_on="points")  # each point slips or not
        line, multiplier = result.contacts["b"], result.solution.tangential_displacement
        bound = np.minimum(cohesion + 0.2 * np.abs(line.normal_stress), cap)
        assert line.friction_bound == pytest.approx(bound, rel=1e-9, abs=0.0)
        assert (np.abs(line.tangential_stress) - bound).max() < 1e-7 * stress
        slips = np.abs(multiplier) > 1e-3 * np.abs(multiplier).max()
        assert slips.sum() >= 4
        assert np.abs(line.tangential_stress[slips]) == pytest.approx(bound[slips], abs=1e-5 * stress)
        assert (line.tangential_stress[slips] * multiplier[slips] < 0.0).all()
        assert (bound[slips] == cap).any()


def test_cohesion_acts_where_the_contact_is_open():
    """As documented: |σ_T| ≤ c there, against an obstacle that is far away; nothing else loads the body."""
    base = Contact("bottom", 0.3, gap=0.01, cohesion=0.01, name="b")
    line = solved(punched(MESHES["uniform"], MATERIALS["stress"], base), tolerance=1e-8).contacts["b"]
    assert (line.state == 0).all()
    assert line.gap == pytest.approx(0.01 - 1e-3, rel=0.01)  # the body hangs from its roof
    assert np.abs(line.tangential_stress).max() == pytest.approx(0.01, rel=1e-5)
    assert (line.tangential_stress * line.slip < 0.0).all()


P, Q, TAU = 100.0, -20.0, 30.0
SLIDING = {  # law, σ_N: each bound is TAU
    "tresca": ({"friction": 0.0, "cohesion": TAU}, -P),
    "tresca where nothing presses": ({"friction": 0.0, "cohesion": TAU, "law": "bilateral"}, 0.0),
    "coulomb": ({"friction": 0.3}, -P),
    "coulomb with cohesion": ({"friction": 0.2, "cohesion": 10.0}, -P),
    "coulomb under a cap": ({"friction": 0.8, "cohesion": 5.0, "shear_limit": TAU}, -P),
    "varying friction and cohesion": (
        {"friction": lambda x, y: 0.1 + 0.05 * x * y, "cohesion": lambda x, y: 20.0 - 5.0 * x * y},
        -P,
    ),
    "bilateral, pulled": ({"friction": 0.3, "law": "bilateral"}, P),
    "bilateral, pressed": ({"friction": 0.3, "law": "bilateral"}, -P),
    "bilateral, pulled, cohesion": ({"friction": 0.2, "cohesion": 10.0, "law": "bilateral"}, P),
    "bilateral, pulled, capped": ({"friction": 2.0, "shear_limit": TAU, "law": "bilateral"}, P),
}  # fmt: skip


def sliding(law, normal, material, side, mesh):
    """A block that slips all along one side in a uniform stress state, and that state."""
    across = 1 if side in ("bottom", "top") else 0
    stress = {"xx": Q, "yy": normal, "xy": TAU} if across else {"xx": normal, "yy": Q, "xy": TAU}
    strain = material.compliance @ np.array([stress["xx"], stress["yy"], TAU])
    outward = {"bottom": -1.0, "left": -1.0, "top": 1.0, "right": 1.0}[side]
    base = mesh.vertices[:, across].min() if outward < 0 else mesh.vertices[:, across].max()
    slip = 0.5 * -outward  # against σ_T = outward τ

    def displacement(x, y):
        if across:
            return np.stack([strain[0] * x + strain[2] * (y - base) + slip, strain[1] * (y - base) + 0 * x])
        return np.stack([strain[0] * (x - base) + 0 * y, strain[1] * y + strain[2] * (x - base) + slip])

    state = exact.ExactState(exact.uniform(material, **stress).stress, displacement)
    opposite = {"bottom": "top", "top": "bottom", "left": "right", "right": "left"}[side]
    sides = dict.fromkeys(("bottom", "right", "top", "left"), "uu") | {side: "cc", opposite: "tt"}
    contact = Contact(side, name="base", **law)
    return exact.problem_from_state(state, mesh, material, sides, (contact,)), state


@pytest.mark.parametrize(
    ("law", "side", "plane"),
    thinned(every_pair(list(SLIDING), ["bottom", "right", "top", "left"], ["stress", "strain"]), 10),
)
def test_full_slip_in_a_uniform_state(law, side, plane):
    """Under every law, on each of the four sides; work is τ times the slip in the middle."""
    given, pressure = SLIDING[law]
    mesh = TriangleMesh.grid([1.0, 1.2, 2.0], [1.0, 1.7, 2.0])
    problem, state = sliding(given, pressure, Material(1000.0, 0.3, plane), side, mesh)
    result = solved(problem)
    x, y, stress = result.gauss_stress()
    assert stress == pytest.approx(np.moveaxis(state.stress(x, y), 0, -1), abs=1e-6)
    line = result.contacts["base"]
    tangent, outward = int(side in ("left", "right")), -1.0 if side in ("bottom", "left") else 1.0
    assert line.slip == pytest.approx(state.displacement(line.x, line.y)[tangent], rel=1e-6)
    assert line.gap == pytest.approx(0.0, abs=1e-8)
    assert line.normal_stress == pytest.approx(pressure, abs=1e-6)
    assert line.tangential_stress == pytest.approx(outward * TAU, abs=1e-6)
    assert (line.state == 2).all()
    middle = {"bottom": (1.5, 1.0), "top": (1.5, 2.0), "left": (1.0, 1.5), "right": (2.0, 1.5)}[side]
    work = TAU * np.abs(state.displacement(*map(np.asarray, middle))[tangent])
    assert result.energies.dissipation == pytest.approx(work, rel=1e-6)


def test_uzawa_finds_the_same_state():
    conditions = [
        Symmetry("left"),
        Traction("right", 0.0, 0.0),
        Contact("bottom", 0.1, cohesion=0.5, law="bilateral", name="rail"),
        Contact("top", 0.1, cohesion=1.0, shear_limit=3.0, plate=RigidPlate(force_y=-60.0), name="plate"),
    ]
    problem = ContactProblem(TriangleMesh.rectangle((3, 2), 1.5), MATERIALS["stress"], conditions)
    reference = solved(problem, law_on="points")  # those that Uzawa takes
    result = solved(problem, method="uzawa", tolerance=1e-6)
    assert difference(reference, result) < 1e-5
    assert result.plates["plate"].y == pytest.approx(reference.plates["plate"].y, rel=1e-5)
    assert {1, 2} == set(reference.contacts["plate"].state.tolist())


@pytest.mark.parametrize(
    ("arguments", "field"),
    [({"friction": -0.1}, "Contact.friction"), ({"friction": 0.1, "cohesion": -1.0}, "Contact.cohesion"),
     ({"friction": 0.1, "shear_limit": -1.0}, "Contact.shear_limit"),
     ({"friction": 0.1, "shear_limit": float("inf")}, "Contact.shear_limit"),
     ({"friction": 0.1, "law": "glued"}, "Contact.law"), ({"friction": 0.1, "law": "tied"}, "Contact.friction"),
     ({"friction": 0.0, "law": "tied", "cohesion": 1.0}, "Contact.cohesion"),
     ({"friction": 0.0, "law": "tied", "shear_limit": 1.0}, "Contact.shear_limit"),
     ({"friction": lambda x, _: x, "law": "tied"}, "Contact.friction"),
     ({"friction": 0.1, "plate": "steel"}, "Contact.plate"),
     ({"friction": 0.1, "normal_stiffness": 0.0}, "Contact.normal_stiffness"),
     ({"friction": 0.0, "law": "tied", "pore_pressure": 1.0}, "Contact.pore_pressure")],
)  # fmt: skip
def test_wrong_laws_are_refused(arguments, field):
    with refused_at(field):
        Contact("bottom", **arguments)


@pytest.mark.parametrize("name", ["friction", "cohesion", "shear_limit"])
def test_fields_that_turn_negative_are_refused(name):
    contact = replace(Contact("bottom", 0.1), **{name: lambda x, _: 0.5 - x})
    with pytest.raises(InputError, match=f"Contact.{name}"):
        solve(punched(MESHES["uniform"], MATERIALS["stress"], contact))


class TestBilateralFriction:
    """|σ_N| where σ_N changes sign inside an edge: coefficients do not imply the law there, points keep it."""

    @staticmethod
    def turned():
        """A block held by a plate that presses at one end and pulls at the other."""
        rail = Contact("bottom", 0.3, law="bilateral", offset=1e-3)
        turned = Displacement("top", x=Expression("1e-3*y"), y=Expression("1e-3*(x-1.13)"))
        free = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
        return ContactProblem(TriangleMesh.rectangle((4, 2), 2.0, 1.0), Material(1e4, 0.2), [rail, turned, *free])

    @pytest.mark.parametrize("degree", [3, 6])
    def test_law_holds_at_the_points_and_the_rest_is_said(self, degree):
        result = solve(self.turned(), degree=degree)
        line = result.contacts["bottom"]
        largest = np.abs(line.normal_stress).max()
        assert result.status is Status.SOLVED
        assert (np.abs(line.tangential_stress) - 0.3 * np.abs(line.normal_stress)).max() < 1e-8 * largest
        assert verify_result(result).passed
        assert not result.bracket.guaranteed
        assert any("'bottom'" in remark for remark in result.remarks) == (line.excess_between_points > 0.01 * largest)

    def test_coefficients_that_break_the_law_are_not_verified(self):
        result = solve(self.turned(), degree=4, law_on="edges")
        line = result.contacts["bottom"]
        assert line.excess_between_points > 0.02 * np.abs(line.normal_stress).max()
        checks = {check.name: check.passed for check in verify_result(result).rows}
        assert checks.pop("between points") is False
        assert all(checks.values())
        assert any("'bottom'" in remark for remark in result.remarks)


@pytest.mark.parametrize(
    ("law", "kind"),
    [
        ({"friction": 0.3}, "edges"),
        ({"friction": lambda x, _: 0.3 + 0.0 * x}, "edges"),
        ({"friction": lambda x, _: 0.3 + 0.1 * x}, "points"),
        ({"friction": lambda x, _: np.where(x < 1.0, 0.3, 0.2)}, "points"),  # at a node
        ({"friction": lambda x, _: np.abs(x + 0.1 - 0.1 - x)}, "edges"),  # zero up to rounding
        ({"friction": 0.3, "cohesion": lambda x, _: np.abs(x + 0.1 - 0.1 - x)}, "edges"),
        ({"friction": 0.3, "cohesion": lambda x, _: 1.0 + x}, "edges"),
        ({"friction": 0.3, "cohesion": lambda x, _: 1.0 + x**2}, "points"),
        ({"friction": 0.3, "shear_limit": lambda x, _: 1.0 + x**2}, "points"),
    ],
)
def test_rows_of_laws_that_vary_along_an_edge_are_gauss_points(law, kind):
    """Coefficients of the traction cannot hold a law whose friction varies there."""
    problem = punched(MESHES["uniform"], MATERIALS["stress"], Contact("bottom", **law))
    assert discretize(problem, degree=4).rule.law_on == kind


def test_the_law_of_tresca_by_its_name():
    assert Contact.tresca("top", 20.0) == Contact("top", 0.0, cohesion=20.0)
    assert Contact.tresca("top", 20.0, 0.1, 0.2, "name") == Contact("top", 0.0, 0.1, 0.2, "name", cohesion=20.0)
