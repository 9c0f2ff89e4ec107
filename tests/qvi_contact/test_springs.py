"""Springs along contacts: beds and compliant joints."""

import numpy as np
import pytest

from qvi_contact import Expression, TriangleMesh, discretize, solve
from qvi_contact.bracket import computed_norm
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction

E, NU = 1000.0, 0.0
FREE = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
STACK = TriangleMesh.grid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0, 1.5, 2.0]).with_joint("joint", lambda _, y: y == 1.0)


@pytest.mark.parametrize("law", ["tied", "bilateral", "unilateral"])
def test_a_column_on_a_bed(law):
    """Springs and columns in series: h/E + 1/k of the bed + 1/k of the joint, whatever the law."""
    plate = RigidPlate(force_y=-5.0, x=0.0, rotation=0.0)
    base = Contact("bottom", 0.0, law=law, normal_stiffness=50.0)
    joint = Contact("joint", 0.0, law="tied", normal_stiffness=Expression("20 + 0 * x"))
    top = Contact("top", 0.0, law="tied", plate=plate)
    result = solve(ContactProblem(STACK, Material(E, NU), [*FREE, base, joint, top]))
    compliance = 2.0 / E + 1.0 / 50.0 + 1.0 / 20.0
    assert result.plates["top"].y == pytest.approx(-5.0 * compliance, rel=1e-9)
    assert result.energies.strain == pytest.approx(0.5 * 25.0 * compliance, rel=1e-9)
    shifted = solve(ContactProblem(STACK, Material(E, NU), result.problem.conditions, 7.0))  # a potential without force
    assert shifted.energies.strain == pytest.approx(result.energies.strain, rel=1e-9)
    assert np.abs(result.contacts["bottom"].gap).max() < 1e-12
    assert result.derivative("top.y", "bottom.normal_stiffness") == pytest.approx(5.0 / 50.0**2, rel=1e-9)
    bracket = result.bracket
    assert bracket.guaranteed
    assert (bracket.lower, bracket.upper) == pytest.approx((-0.5 * 25.0 * compliance,) * 2, rel=1e-9)
    assert bracket.companion.plates["top"].y == pytest.approx(-5.0 * compliance, rel=1e-9)
    assert bracket.companion.stretch("bottom", [0.0, 1.0])[0] == pytest.approx(5.0 / 50.0, rel=1e-9)


def test_springs_yield_before_they_slip():
    """Sheared by w: T = w/(h/G + 1/k_T) up to the bond, then the bond; the slip is what springs and block leave."""
    bond, stiffness, shear = 3.0, 40.0, E / 2.0
    sides = [Displacement("bottom", 0.0, 0.0), *(Displacement(name, y=0.0) for name in ("left", "right"))]
    sides += [Traction(name, x=0.0) for name in ("left", "right")]
    limit = bond * (1.0 / shear + 1.0 / stiffness)
    for offset in (0.4 * limit, 3.0 * limit):
        top = Contact("top", 0.0, cohesion=bond, law="bilateral", offset=offset, tangential_stiffness=stiffness)
        result = solve(ContactProblem(TriangleMesh.rectangle((2, 2)), Material(E, NU), [*sides, top]))
        line = result.contacts["top"]
        assert line.tangential_force == pytest.approx(bond * min(offset / limit, 1.0), rel=1e-8)
        assert line.slip == pytest.approx(-max(offset - limit, 0.0), abs=1e-8)


def test_the_root_of_the_energy_has_springs_too():
    """RᵀR = K."""
    bed = Contact("bottom", 0.3, normal_stiffness=50.0, tangential_stiffness=20.0)
    problem = ContactProblem(TriangleMesh.rectangle((2, 2)), Material(E, 0.3),
                             [*FREE, bed, Traction("top", 0.3, Expression("-1 - x"))])  # fmt: skip
    known = discretize(problem)
    root, K, zero = known.root, known.qvi.K, np.zeros(known.qvi.n)
    for z in np.eye(known.qvi.n)[::7]:
        assert root.adjoint(root.apply(z) - root.apply(zero)) == pytest.approx(K @ z, abs=1e-13 * np.abs(K).max())


def test_a_tied_bed_has_no_share_in_the_gap_but_that_of_its_springs():
    bed = Contact("bottom", 0.0, law="tied", normal_stiffness=50.0)
    sides = [*FREE, bed, Traction("top", 0.0, Expression("-x ** 2"))]
    bracket = solve(ContactProblem(TriangleMesh.rectangle((1, 1)), Material(E, 0.3), sides)).bracket
    assert bracket.parts["springs"] > 0.0 == bracket.parts["contact"] == bracket.parts["friction"]
    for shares in (np.array(list(bracket.parts.values())), bracket.cell_gaps):
        assert shares.sum() == pytest.approx(bracket.gap, rel=1e-6)


def test_a_block_that_only_a_bed_holds_leans():
    """Under the pressure a + b x: σ_yy = −a − b x all over, u_y = −(a + b x)(y/E + 1/k), the bed turns by b/k."""
    k, (a, b) = 30.0, (1.0, 2.0)
    top = Traction("top", 0.0, Expression("-1 - 2 * x"))
    bed = Contact("bottom", 0.0, normal_stiffness=k)
    result = solve(ContactProblem(TriangleMesh.rectangle((3, 2)), Material(E, 0.3), [*FREE, top, bed]))
    square = a * a + a * b + b * b / 3.0
    assert result.bracket.guaranteed
    energy = -0.5 * (1.0 / E + 1.0 / k) * square
    assert (result.bracket.lower, result.bracket.upper) == pytest.approx((energy, energy), rel=1e-9)
    stretch = np.sort(result.bracket.companion.stretch("bottom", [0.0, 1.0])[0].ravel())
    assert stretch[[0, -1]] == pytest.approx([a / k, (a + b) / k], rel=1e-9)


def energy_of_a_wave(k):
    """Φ = f(y) cos πx on the unit square under cos πx, without shear on all sides: u_y = f'''(y) cos πx/(π²E)."""

    def at(y):  # f to f''' of cosh πy, y cosh πy, sinh πy, y sinh πy
        p, c, s = np.pi, np.cosh(np.pi * y), np.sinh(np.pi * y)
        along = [[c, s], [p * s, p * c], [p * p * c, p * p * s], [p**3 * s, p**3 * c], [0.0, 0.0]]
        return np.array([[along[i][0], y * along[i][0] + i * along[i - 1][0], along[i][1],
                          y * along[i][1] + i * along[i - 1][1]] for i in range(4)])  # fmt: skip

    base, top = at(0.0), at(1.0)
    rows = [base[1], top[1], top[0], base[3] + np.pi**4 * E / k * base[0]]
    return -0.25 * float(top[3] @ np.linalg.solve(rows, [0.0, 0.0, -1.0 / np.pi**2, 0.0])) / (np.pi**2 * E)


@pytest.mark.parametrize("k", [50.0, 5000.0])
def test_bounds_on_a_bed_close_as_fast_as_the_elements_allow(k):
    energy, gaps = energy_of_a_wave(k), []
    for n in (2, 4):
        sides = [Symmetry("left"), Symmetry("right"), Traction("top", 0.0, Expression("cos(pi * x)"))]
        bed = Contact("bottom", 0.0, law="bilateral", normal_stiffness=k)
        bracket = solve(ContactProblem(TriangleMesh.rectangle((n, n)), Material(E, 0.3), [*sides, bed])).bracket
        assert bracket.lower < energy < bracket.upper
        assert bracket.parts["springs"] > 0.0
        gaps.append(bracket.gap)
    assert gaps[0] > 0.5 * 2.0**6 * gaps[1]


def pressed(n, friction, base):
    """A block 2 × 1 that is pressed down and dragged along, on springs."""
    mesh = TriangleMesh.grid(np.linspace(0.0, 2.0, 2 * n + 1), np.linspace(0.0, 1.0, n + 1))
    contact = Contact("bottom", friction, **base)
    return ContactProblem(mesh, Material(E, 0.3), [*FREE, contact, Displacement("top", 1e-3, -1e-2)])


@pytest.mark.parametrize(
    ("friction", "base"),
    [(0.1, {"normal_stiffness": 2000.0, "tangential_stiffness": 1000.0}), (0.3, {"normal_stiffness": 500.0}),
     (0.1, {"normal_stiffness": 500.0, "cohesion": 0.1, "tangential_stiffness": 2000.0})],
)  # fmt: skip
def test_forces_under_friction_on_springs(friction, base):
    fine = solve(pressed(8, friction, base), degree=5).contacts["bottom"]
    coulomb = solve(pressed(3, friction, base)).bracket.coulomb
    for name, (lower, upper) in coulomb.forces.items():
        force = getattr(fine, name.removeprefix("bottom."))
        assert lower < force < upper
        assert upper - lower < 0.1 * fine.normal_force
    assert len(coulomb.forces) == 2
    assert coulomb.relative_error < 0.03


def test_springs_make_the_norm_of_friction_less():
    """Across the contact they take the normal part upon themselves; of rigid ones little is left to do."""
    shares = solve(pressed(3, 0.3, {})).bracket.coulomb.shares
    rigid, *soft = (
        computed_norm(pressed(3, 0.3, {"normal_stiffness": k}), shares) for k in (None, 1e16, 1e7, 1e4, 100.0)
    )
    assert soft == sorted(soft, reverse=True)
    assert soft[0] == pytest.approx(rigid, rel=1e-6)
    assert soft[-1] < 0.5 * rigid


def test_friction_on_springs_along_a_contact_only_is_not_bounded():
    bracket = solve(pressed(2, 0.3, {"tangential_stiffness": 100.0})).bracket
    assert bracket.coulomb is None
    assert "'bottom'" in bracket.coulomb_reason
