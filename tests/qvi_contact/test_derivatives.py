"""Derivatives of forces and motions: known answers, differences of solves, one-sided values at changes of state."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    Polynomial,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    TriangleMesh,
    solve,
)

E, NU, ALPHA = 1000.0, 0.3, 1e-3


def test_a_sliding_block():
    """∂T/∂μ = N, ∂T/∂F = μ per unit of the normal force, and nothing else matters."""
    mesh = TriangleMesh.rectangle((3, 2), 2.0, 1.0)
    sides = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    wall = Contact("bottom", 0.3, name="wall", offset=-0.5)
    top = Contact("top", 0.0, law="tied", plate=RigidPlate(force_y=-5.0, x=0.0, rotation=0.0))
    result = solve(ContactProblem(mesh, Material(E, NU), [*sides, wall, top]))
    force = np.sign(result.contacts["wall"].tangential_force)
    assert result.contacts["wall"].shares["slip"] == 1.0
    assert force * result.derivative("wall.tangential_force", "wall.friction") == pytest.approx(5.0, rel=1e-9)
    assert force * result.derivative("wall.tangential_force", "top.force_y") == pytest.approx(-0.3, rel=1e-9)
    assert force * result.derivative("wall.tangential_force", "load.top") == pytest.approx(1.5, rel=1e-9)
    assert result.derivative("wall.tangential_force", "material.young") == pytest.approx(0.0, abs=1e-9)
    assert result.derivative("top.y", "top.force_y") > 0.0


def test_a_shrink_fit_is_linear():
    """N is proportional to the temperature, and to an interference of α ΔT R; both contacts being closed."""
    mesh = TriangleMesh.rectangle((2, 2), 1.0, 1.0)
    wall = Contact("top", 0.0, name="wall")
    sides = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0), Symmetry("bottom"), wall]
    result = solve(ContactProblem(mesh, Material(E, NU, expansion=ALPHA), sides, temperature=10.0))
    normal = E * ALPHA * 10.0
    assert result.contacts["wall"].normal_force == pytest.approx(normal)
    assert result.derivative("wall.normal_force", "temperature") == pytest.approx(normal / 10.0, rel=1e-8)
    assert result.derivative("wall.normal_force", "wall.gap") == pytest.approx(-normal / (ALPHA * 10.0), rel=1e-8)
    assert result.derivative("wall.normal_force", "material.young") == pytest.approx(normal / E, rel=1e-8)


def two_blocks(rng, **changed):
    """A joint and a base with stick, slip and gaps, a plate driven by forces on top, heated unevenly."""
    data = {"mu": rng.uniform(0.1, 0.5), "joint": rng.uniform(0.1, 0.5), "gap": -0.004 * rng.random(), "young": E}
    data |= {"offset": 0.004 * rng.normal(), "force": 2.0 * rng.normal(), "load": 1.0, "x": 0.005 * rng.normal()}
    data |= {"T": 0.0, "own": 2.0 * E}
    data |= {name: data[name] + more for name, more in changed.items()}
    hot, press = 3.0 * rng.normal(size=(2, 2)), rng.normal(size=2)
    hot[0, 0] += data["T"]
    mesh = TriangleMesh.grid(np.linspace(0, 2, 5), [0.0, 0.5, 1.0], regions={"upper": ((0.0, 2.0), (0.5, 1.0))})
    mesh = mesh.with_joint("joint", lambda _, y: np.abs(y - 0.5) < 1e-9)
    base = Contact("bottom", data["mu"], gap=data["gap"], offset=data["offset"])
    top = Contact("top", 0.0, law="tied", plate=RigidPlate(force_x=data["force"], force_y=-12.0, rotation=0.0))
    conditions = [
        base,
        Contact("joint", data["joint"]),
        top,
        Displacement("left", x=data["x"]),
        Traction("left", y=0.0),
    ]
    conditions.append(Traction("right", *(press * data["load"])))
    upper = Region(Material(data["own"], NU, expansion=ALPHA / 2.0), name="upper")
    steel = Material(data["young"], NU, expansion=ALPHA)
    return ContactProblem(mesh, steel, conditions, regions=[upper], temperature=Polynomial(hot))


PARAMETERS = {
    "mu": ("bottom.friction", 1.0), "joint": ("joint.friction", 1.0), "gap": ("bottom.gap", 0.01),
    "offset": ("bottom.offset", 0.01), "young": ("material.young", E), "own": ("upper.young", E),
    "force": ("top.force_x", 5.0), "load": ("load.right", 1.0), "x": ("left.x", 0.01), "T": ("temperature", 10.0),
}  # fmt: skip


@pytest.mark.parametrize(("number", "short"), list(enumerate(PARAMETERS)))
def test_differences_of_solves(number, short):
    parameter, size = PARAMETERS[short]
    quantities = {"bottom.tangential_force": 1.0, "joint.tangential_force": 1.0, "top.x": 1e3}  # and their sizes
    quantities["xx(0.8, 0.3)"] = 1.0

    def values(**changed):
        result = solve(two_blocks(np.random.default_rng(number), **changed), tolerance=1e-14)
        forces = [result.contacts[name].tangential_force for name in ("bottom", "joint")]
        return result, np.array([*forces, result.plates["top"].x, result.stress(0.8, 0.3)[0]])

    result, here = values()
    above, below = (values(**{short: sign * 1e-5 * size})[1] for sign in (1.0, -1.0))
    expected = (above - below) / (2e-5 * size)
    found = np.array([result.derivative(quantity, parameter) for quantity in quantities])
    scale = np.array(list(quantities.values()))
    least = 1e-6 * max(float(np.abs(expected * scale).max()), 1e-2 * float(np.abs(here).max()) / size)
    assert found * scale == pytest.approx(expected * scale, rel=1e-6, abs=least)


def test_a_contact_that_just_touches():
    """The block has a side: closer it is pressed, farther it is not."""
    sides = [Symmetry("bottom"), Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0), Contact("top", 0.0)]
    result = solve(ContactProblem(TriangleMesh.rectangle((2, 2)), Material(E, 0.0), sides))
    assert result.derivative("top.normal_force", "top.gap", "below") == pytest.approx(-E, rel=1e-9)
    assert result.derivative("top.normal_force", "top.gap", "above") == pytest.approx(0.0, abs=1e-6)
    with pytest.raises(InputError, match="from below and"):
        result.derivative("top.normal_force", "top.gap")


def test_a_contact_that_just_slips():
    """Simple shear up to the bond c, all along the contact: G below, nothing above."""
    bond, shear = 3.0, E / 2.0 / 1.25
    sides = [Displacement("bottom", 0.0, 0.0), *(Displacement(name, y=0.0) for name in ("left", "right"))]
    sides += [Traction(name, x=0.0) for name in ("left", "right")]
    top = Contact("top", 0.0, cohesion=bond, law="bilateral", offset=bond / shear)
    problem = ContactProblem(TriangleMesh.rectangle((2, 2)), Material(E, 0.25), [*sides, top])
    result = solve(problem)
    assert result.derivative("top.tangential_force", "top.offset", "below") == pytest.approx(shear, rel=1e-8)
    assert result.derivative("top.tangential_force", "top.offset", "above") == pytest.approx(0.0, abs=1e-6)
    assert result.derivative("top.tangential_force", "top.cohesion", "below") == pytest.approx(1.0, rel=1e-8)
    assert result.derivative("top.tangential_force", "top.cohesion", "above") == pytest.approx(0.0, abs=1e-8)
    held = solve(replace(problem, conditions=[*sides, replace(top, offset=0.5 * bond / shear)]))
    assert held.derivative("top.tangential_force", "top.offset") == pytest.approx(shear, rel=1e-8)


def test_what_has_no_derivative_is_refused():
    sides = [
        Symmetry("bottom"),
        Traction("left", 0.0, 0.0),
        Traction("right", 0.0, 0.0),
        Contact("top", 0.0, gap=-1e-3),
    ]
    result = solve(ContactProblem(TriangleMesh.rectangle((2, 2)), Material(E, 0.0), sides))
    for quantity, parameter, side in (
        ("top.normal_forces", "top.gap", None),
        ("energy", "top.gap", None),
        ("top.normal_force", "top.gab", None),
        ("top.normal_force", "top.gap", "left"),
    ):
        with pytest.raises(InputError):
            result.derivative(quantity, parameter, side)
