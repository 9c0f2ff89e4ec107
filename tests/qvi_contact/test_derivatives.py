"""Derivatives of forces, motions, limit loads: known answers, differences of solves, both sides of changes of state."""

from dataclasses import replace

import pytest

from qvi_contact import InputError, LimitFactor, SolveError, Traction, TriangleMesh, limit_load_factor, solve
from qvi_contact.limit.conic import Answer, ConicProgram
from qvi_contact.problem import Contact, ContactProblem, Displacement, Expression, Material, MohrCoulomb, RigidPlate

E, NU = 1000.0, 0.3


def dragged(friction=0.3, cohesion=0.5, phi=None):
    """A block 2 × 1 of weight 8 on the ground, dragged by 2 at its top: it slides at 4 μ + c."""
    strength = None if phi is None else MohrCoulomb(2.0, phi)
    ground = Contact("bottom", friction, cohesion=cohesion, name="ground")
    drag = Traction("top", x=1.0, y=0.0, name="drag")
    sides = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    mesh = TriangleMesh.rectangle((2, 1), 2.0, 1.0)
    return ContactProblem(mesh, Material(E, NU, "strain", strength), [ground, drag, *sides], Expression("4*y"))


class TestLimitLoads:
    """Derivatives of limit load factors, from the multipliers of the program."""

    @pytest.mark.parametrize(
        ("cohesion", "parameter", "expected"),
        [(0.5, "ground.friction", 4.0), (0.5, "ground.cohesion", 1.0), (0.5, "load.body", 1.2),
         (0.5, "load.drag", -1.7), (0.0, "ground.cohesion", 1.0)],
    )  # fmt: skip
    def test_a_dragged_block(self, cohesion, parameter, expected):
        """What is zero grows only."""
        found = LimitFactor(["drag"]).derivative(dragged(cohesion=cohesion), parameter)
        assert found == pytest.approx(expected, rel=1e-6)

    def test_sliding_becomes_tipping(self):
        """The stresses of the mesh tip at the factor 3, which is reached at μ = 5/8."""
        factor, problem = LimitFactor(["drag"]), dragged(0.625)
        assert factor.derivative(problem, "ground.friction", "below") == pytest.approx(4.0, rel=1e-5)
        assert factor.derivative(problem, "ground.friction", "above") == pytest.approx(0.0, abs=1e-5)
        with pytest.raises(InputError, match="from below and"):
            factor.derivative(problem, "ground.friction")

    def test_a_body_that_yields(self, monkeypatch):
        """The angle of friction against differences of lower bounds, which are off by 1e-8; homogeneous in the rest."""
        factor, problem, step = LimitFactor(["drag"]), dragged(2.0, 0.0, 0.3), 1e-3
        whole = 2.0 * factor.derivative(problem, "material.c") + factor.derivative(problem, "load.body")
        assert whole == pytest.approx(float(limit_load_factor(problem, ["drag"])), rel=1e-6)
        above, below = (float(limit_load_factor(dragged(2.0, 0.0, 0.3 + way), ["drag"])) for way in (step, -step))
        assert factor.derivative(problem, "material.phi") == pytest.approx((above - below) / (2.0 * step), rel=1e-4)
        monkeypatch.setattr(ConicProgram, "solve", lambda program: Answer(-program.q, 0.0 * program.b, 0.0))
        with pytest.raises(SolveError, match="multipliers"):  # an answer far below its bound keeps no rows
            factor.derivative(problem, "material.c")

    def test_rows_without_room(self):
        """A lid holds a block that is lifted along a wall: by differences, as the factor is linear."""
        ground, lid = Contact("bottom", 1.0), RigidPlate(force_y=-1.5)
        walls = [Contact("right", 0.6), Contact("top", 0.05, plate=lid), Traction("left", 0.0, 1.0)]
        jammed = ContactProblem(TriangleMesh.rectangle((2, 1), 0.53), Material(E, NU), [ground, *walls])
        glued = replace(jammed, conditions=[replace(ground, cohesion=0.01), *walls])
        gain = float(limit_load_factor(glued, ["left"])) - float(limit_load_factor(jammed, ["left"]))
        assert LimitFactor(["left"]).derivative(jammed, "bottom.cohesion") == pytest.approx(100.0 * gain, rel=1e-6)

    def test_bad_input(self):
        bilateral = Contact("bottom", 0.3, law="bilateral", name="ground")
        fixed = replace(dragged(), conditions=[bilateral, *dragged().conditions[1:]])
        cases = (dragged(), "ground.gap", None), (dragged(), "load.drag", "up"), (fixed, "load.drag", None)
        for problem, name, side in cases:
            with pytest.raises(InputError) as caught:
                LimitFactor(["drag"]).derivative(problem, name, side)
            assert caught.value.field in ("parameter", "side", "problem")


def test_a_contact_that_just_slips():
    """Simple shear up to the bond c, all along the contact; G below, nothing above is in the manual."""
    bond, shear = 3.0, E / 2.0 / 1.25
    sides = [Displacement("bottom", 0.0, 0.0), *(Displacement(name, y=0.0) for name in ("left", "right"))]
    sides += [Traction(name, x=0.0) for name in ("left", "right")]
    top = Contact("top", 0.0, cohesion=bond, law="bilateral", offset=bond / shear)
    problem = ContactProblem(TriangleMesh.rectangle((2, 2)), Material(E, 0.25), [*sides, top])
    result = solve(problem)
    with pytest.raises(InputError, match="from below and"):
        result.derivative("top.tangential_force", "top.offset")
    assert result.derivative("top.tangential_force", "top.cohesion", "below") == pytest.approx(1.0, rel=1e-8)
    assert result.derivative("top.tangential_force", "top.cohesion", "above") == pytest.approx(0.0, abs=1e-8)
    held = solve(replace(problem, conditions=[*sides, replace(top, offset=0.5 * bond / shear)]))
    assert held.derivative("top.tangential_force", "top.offset") == pytest.approx(shear, rel=1e-8)


@pytest.mark.parametrize(
    ("law", "friction", "cohesion", "weight"),
    [({"cohesion": 0.5}, 6.0, 2.0, -0.3), ({"cohesion": 0.1, "shear_limit": 0.4}, 0.0, 0.0, 0.0)],
)
def test_what_drags_a_sliding_block(law, friction, cohesion, weight):
    """Under 6 on a length of 2: by 6 μ + 2 c, or by twice the cap, which then alone counts."""
    lid = Contact("top", 0.0, law="tied", plate=RigidPlate(force_y=-6.0, x=0.5, rotation=0.0))
    ground = Contact("bottom", 0.3, name="ground", **law)
    sides = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    result = solve(ContactProblem(TriangleMesh.rectangle((2, 1), 2.0), Material(E, NU), [ground, lid, *sides]))
    assert result.contacts["ground"].shares["slip"] == pytest.approx(1.0)
    known = {"ground.friction": friction, "ground.cohesion": cohesion, "top.force_y": weight, "top.x": 0.0}
    for name, value in {**known, **({"ground.shear_limit": 2.0} if "shear_limit" in law else {})}.items():
        assert -result.derivative("ground.tangential_force", name) == pytest.approx(value, rel=1e-8, abs=1e-9)


def test_what_has_no_derivative_is_refused():
    free = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    contacts = [Contact("bottom", 0.0), Contact("top", 0.0, gap=-1e-3, offset=1e-3)]
    result = solve(ContactProblem(TriangleMesh.rectangle((2, 2)), Material(E, 0.0), [*free, *contacts]))
    cases = [
        ("top.normal_forces", "top.gap", None), ("energy", "top.gap", None), ("top.normal_force", "top.gab", None),
        ("top.normal_force", "top.gap", "left"), ("top.tangential_force", "top.friction", None),  # slides along
    ]  # fmt: skip
    for quantity, parameter, side in cases:
        with pytest.raises(InputError):
            result.derivative(quantity, parameter, side)
