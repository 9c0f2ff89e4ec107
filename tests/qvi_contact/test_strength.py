"""What materials can carry: their cones against principal stresses, and problem files that state them."""

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Expression,
    InputError,
    Material,
    Mises,
    MohrCoulomb,
    NoTension,
    Region,
    Symmetry,
    Traction,
    Tresca,
    TriangleMesh,
)
from qvi_contact.files import problem_from_toml, problem_to_toml

STRESSES = np.random.default_rng(1).normal(size=(400, 3)) * [2.0, 2.0, 1.0]


def principal(stress):
    mean, radius = (stress[:, 0] + stress[:, 1]) / 2, np.hypot((stress[:, 0] - stress[:, 1]) / 2, stress[:, 2])
    return mean + radius, mean - radius


def within(strength, plane, stress):
    """Whether the cones hold."""
    S, D = stress[:, 0] + stress[:, 1], np.column_stack([stress[:, 0] - stress[:, 1], 2 * stress[:, 2]])
    found = np.ones(len(stress), dtype=bool)
    for cone in strength.cones(plane):
        norm = np.sqrt((cone.mean * S) ** 2 + (D**2).sum(axis=1))
        found &= norm <= cone.factor * cone.field - cone.pressure * S
    return found


def in_space(plane, stress):
    """The three principal stresses; the one out of the plane is zero, or between the others."""
    high, low = principal(stress)
    third = np.zeros(len(high)) if plane == "stress" else (high + low) / 2
    return np.sort(np.stack([high, low, third]), axis=0)


@pytest.mark.parametrize("plane", ["strain", "stress"])
class TestCones:
    """Each criterion as textbooks write it in principal stresses."""

    def test_tresca(self, plane):
        low, _, high = in_space(plane, STRESSES)
        assert (within(Tresca(1.3), plane, STRESSES) == (high - low <= 2.6)).all()

    def test_mises(self, plane):
        a, b, c = in_space(plane, STRESSES)
        equivalent = np.sqrt(((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) / 2)
        assert (within(Mises(2.0), plane, STRESSES) == (equivalent <= 2.0)).all()

    def test_mohr_coulomb(self, plane):
        low, _, high = in_space(plane, STRESSES)
        c, phi = 0.9, 0.5
        holds = high * (1 + np.sin(phi)) - low * (1 - np.sin(phi)) <= 2 * c * np.cos(phi)
        assert (within(MohrCoulomb(c, phi), plane, STRESSES) == holds).all()
        cut_off = holds & (principal(STRESSES)[0] <= 0.2)
        assert (within(MohrCoulomb(c, phi, 0.2), plane, STRESSES) == cut_off).all()

    def test_no_tension(self, plane):
        high, low = principal(STRESSES)
        assert (within(NoTension(), plane, STRESSES) == (high <= 0)).all()
        assert (within(NoTension(3.0), plane, STRESSES) == ((high <= 0) & (low >= -3.0))).all()


@pytest.mark.parametrize(
    ("make", "field"),
    [(lambda: Tresca(0.0), "Tresca.c"), (lambda: Tresca(-1.0), "Tresca.c"),
     (lambda: Mises(float("nan")), "Mises.yield_stress"),
     (lambda: MohrCoulomb(1.0, 30.0), "MohrCoulomb.phi"), (lambda: MohrCoulomb(0.0, 0.0), "MohrCoulomb.c"),
     (lambda: MohrCoulomb(1.0, 0.5, -0.1), "MohrCoulomb.tension"), (lambda: NoTension(0.0), "NoTension.crushing"),
     (lambda: Material(1.0, 0.3, "strain", 2.0), "Material.strength")],
)  # fmt: skip
def test_bad_strengths_are_refused(make, field):
    with pytest.raises(InputError) as caught:
        make()
    assert caught.value.field == field


def body(strength, other=None):
    mesh = TriangleMesh.rectangle((2, 2)).with_region("part", lambda x, _: x > 0.5)
    conditions = [Symmetry("left"), Contact("bottom", 0.3), Traction("right", x=0, y=0), Traction("top", x=0, y=-1.0)]
    regions = [Region(Material(2.0, 0.2, "strain", other), name="part")]
    return ContactProblem(mesh, Material(1.0, 0.3, "strain", strength), conditions, regions=regions)


@pytest.mark.parametrize(
    "strength",
    [Tresca(1.5), Mises(Expression("1 + x")), MohrCoulomb(2.0, 0.5), MohrCoulomb(2.0, 0.5, 0.1), NoTension(),
     NoTension(4.0)],
)  # fmt: skip
def test_files_hold_strengths(strength):
    for problem in (body(strength), body(None, strength), body(strength, strength)):
        again = problem_from_toml(problem_to_toml(problem)).problem
        assert again.material == problem.material
        assert [region.material for region in again.regions] == [region.material for region in problem.regions]
        assert again.yields
    assert not body(None).yields


def test_an_angle_may_be_written_in_degrees():
    text = problem_to_toml(body(None)).replace(
        "[material]\n", '[material]\nstrength = { law = "mohr-coulomb", c = 1.0, phi = "30 * pi / 180" }\n'
    )
    assert problem_from_toml(text).problem.material.strength == MohrCoulomb(1.0, np.pi / 6)
