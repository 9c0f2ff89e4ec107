"""Springs along contacts: beds and compliant joints."""

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Expression,
    InputError,
    Material,
    RigidPlate,
    Traction,
    TriangleMesh,
    solve,
)
from qvi_contact.files import problem_from_toml, problem_to_toml

E, NU = 1000.0, 0.0
FREE = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]


def column(base, joint, top):
    mesh = TriangleMesh.grid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0, 1.5, 2.0]).with_joint(
        "joint", lambda _, y: np.abs(y - 1.0) < 0.1
    )
    return ContactProblem(mesh, Material(E, NU), [*FREE, base, joint, top])


@pytest.mark.parametrize("law", ["tied", "bilateral", "unilateral"])
def test_a_column_on_a_bed(law):
    """Springs and columns in series: h/E + 1/k of the bed + 1/k of the joint, whatever the law."""
    plate = RigidPlate(force_y=-5.0, x=0.0, rotation=0.0)
    base = Contact("bottom", 0.0, law=law, normal_stiffness=50.0)
    joint = Contact("joint", 0.0, law="tied", normal_stiffness=Expression("20 + 0 * x"))
    result = solve(column(base, joint, Contact("top", 0.0, law="tied", plate=plate)))
    compliance = 2.0 / E + 1.0 / 50.0 + 1.0 / 20.0
    assert result.plates["top"].y == pytest.approx(-5.0 * compliance, rel=1e-9)
    assert result.energies.strain == pytest.approx(0.5 * 25.0 * compliance, rel=1e-9)
    assert np.abs(result.contacts["bottom"].gap).max() < 1e-12
    assert result.derivative("top.y", "bottom.normal_stiffness") == pytest.approx(5.0 / 50.0**2, rel=1e-9)
    with pytest.raises(InputError, match="springs"):
        _ = result.bracket


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


def test_a_beam_on_an_elastic_bed():
    """Winkler: a long beam under a force P has the pressure P β/2 below it, β⁴ = k/(4 E I)."""
    length, k, force = 240.0, 1e-3, 1.0
    x = np.unique(np.concatenate([np.linspace(-length / 2.0, length / 2.0, 61), [-0.5, 0.5]]))
    mesh = TriangleMesh.grid(x, [0.0, 1.0])
    sides = [*FREE, Traction("top", 0.0, Expression("-where(abs(x) < 0.5, 1, 0)"))]
    bed = Contact("bottom", 0.0, law="bilateral", normal_stiffness=k)
    result = solve(ContactProblem(mesh, Material(E, NU), [*sides, bed]), degree=5)
    line, beta = result.contacts["bottom"], (k / (4.0 * E / 12.0)) ** 0.25
    middle = np.argmin(np.abs(line.x))
    assert -line.normal_stress[middle] == pytest.approx(force * beta / 2.0, rel=5e-3)
    assert -line.normal_stress.min() == pytest.approx(force * beta / 2.0, rel=5e-3)


def test_files_hold_them():
    base = Contact("bottom", 0.3, normal_stiffness=50.0, tangential_stiffness=Expression("10 + x"))
    problem = column(base, Contact("joint", 0.0, law="tied"), Contact("top", 0.3, gap=-0.01))
    again = problem_from_toml(problem_to_toml(problem)).problem.contacts[0]
    assert again.normal_stiffness == 50.0
    assert again.tangential_stiffness == base.tangential_stiffness
    with pytest.raises(InputError, match="rigid"):
        Contact("bottom", 0.3, normal_stiffness=0.0)
