"""Loads that jump inside an edge, whose integrals are exact everywhere, and fluids in contacts."""

import copy
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import legendre

from qvi_contact import BodyForces, InputError, TriangleMesh, limit_load_factor, solve, solve_history, solve_sweep
from qvi_contact.companion import solve_companion
from qvi_contact.element import adapted, constant
from qvi_contact.export import summary, write_npz
from qvi_contact.files import problem_from_toml, problem_to_toml
from qvi_contact.mechanism import upper_bound
from qvi_contact.problem import Contact, ContactProblem, Displacement, Expression, Material, Traction, problem_digest
from qvi_contact.problem.problem import run_digest
from qvi_contact.verification import missed_tractions, verify_file
from solvers import Status
from tests.qvi_contact.builders import solved

FIRST, LAST = 0.3371, 0.6123
"""Where the load on the top begins and ends: inside cells of the width 1/4, and no multiple of anything."""


def strip(x, y):
    return np.where((x > FIRST) & (x < LAST), -8.0, 0.0) + 0.0 * y


def block(mesh=None, load=strip, top=None):
    """A block that rests on the ground with friction."""
    mesh = TriangleMesh.rectangle((4, 4)) if mesh is None else mesh
    sides = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    conditions = [Contact("bottom", 0.5, name="ground"), top or Traction("top", 0.0, load), *sides]
    return ContactProblem(mesh, Material(1e3, 0.3), conditions)


class TestQuadrature:
    """∫ f and ∫ f t over the edges 0 … 1, 1 … 2, 2 … 3."""

    @pytest.mark.parametrize(
        ("function", "integral"),
        [
            (lambda x: x**7, lambda x: x**8 / 8.0),
            (lambda x: np.where(x < np.sqrt(2.0), 1.0, -1.0), lambda x: np.minimum(x, 2.0 * np.sqrt(2.0) - x)),
            (lambda x: np.maximum(x - np.sqrt(2.0), 0.0), lambda x: np.maximum(x - np.sqrt(2.0), 0.0) ** 2 / 2.0),
            (lambda x: np.sqrt(np.abs(x - 1.3)), lambda x: np.abs(x - 1.3) ** 1.5 * np.sign(x - 1.3) / 1.5),
            (lambda x: np.where(np.abs(x - 1.2056) < 0.0056, 1.0, 0.0), lambda x: np.clip(x, 1.2, 1.2112)),
            (lambda x: np.sin(200.0 * x), lambda x: -np.cos(200.0 * x) / 200.0),
        ],
        ids=["polynomial", "jump", "kink", "root", "narrow", "waves"],
    )
    def test_exact(self, function, integral):
        found = adapted(lambda edge, t: function(edge[:, None] + t), 3)
        size = np.abs(found.values).max()
        assert found.error == 0.0
        assert found.coefficients(0)[:, 0] == pytest.approx(np.diff(integral(np.arange(4.0))), abs=1e-13 * size)
        assert np.bincount(found.edge, found.weights.sum(axis=1)) == pytest.approx(np.ones(3), abs=1e-14)

    def test_polynomials_have_one_part_and_edges_their_own_values_at_their_ends(self):
        assert len(adapted(lambda edge, t: edge[:, None] + t**7, 5).edge) == 5
        assert len(adapted(lambda edge, t: np.where(edge[:, None] + t < 1.2345, 1.0, 0.0), 5).edge) < 70
        found = adapted(lambda edge, t: np.where(edge[:, None] + t < 2.0, 1.0, 0.0), 3)
        assert len(found.edge) == 3
        assert found.coefficients(0)[:, 0].tolist() == pytest.approx([1.0, 1.0, 0.0], abs=1e-15)

    @pytest.mark.parametrize(("value", "count"), [(-3.7, 3), (0.0, 2), (1.0, 0)])
    def test_numbers_are_integrated_as_functions_are(self, value, count):
        found, followed = constant(value, count, 5), adapted(lambda _, t: np.full(t.shape, value), count, 5)
        for name in ("count", "edge", "t", "weights", "values", "error"):
            assert np.array_equal(getattr(found, name), getattr(followed, name)), name

    @pytest.mark.parametrize("origin", [1e4, 1e7])
    def test_far_from_the_origin(self, origin):
        """Coordinates lose digits there: what that explains in smooth functions is not divided, a jump still is."""
        rounding = np.full(5, np.finfo(float).eps * origin)

        def far(function):
            return adapted(lambda edge, t: function((origin + edge[:, None] + t) - origin), 5, rounding=rounding)

        smooth, waves = far(lambda x: x * (5.0 - x)), far(lambda x: np.sin(3.0 * x))
        assert len(smooth.edge) == 5
        assert len(waves.edge) < 50
        assert waves.error == 0.0
        assert waves.coefficients(0).sum() == pytest.approx((1.0 - np.cos(15.0)) / 3.0, abs=50.0 * rounding[0] + 1e-11)
        jump = far(lambda x: np.where(x < 1.2345, 1.0, 0.0))
        assert len(jump.edge) < 70
        assert jump.coefficients(0).sum() == pytest.approx(1.2345, abs=50.0 * rounding[0])

    def test_what_nothing_can_follow_is_said(self):
        """Rounding of a large number decides."""
        assert adapted(lambda edge, t: np.sign(np.sin(1e12 * (edge[:, None] + t))), 2).error > 0.1
        peak = adapted(lambda edge, t: np.where(np.abs(t - 31 / 96) < 1e-5, 1.0, 0.0) + 0.0 * edge[:, None], 2)
        assert peak.coefficients(0) == pytest.approx(2e-5, abs=1e-12)  # finer samples keep it in view


class TestResultants:
    """Force 8 (LAST − FIRST), in the middle between them."""

    FORCE = 8.0 * (LAST - FIRST)
    MIDDLE = (FIRST + LAST) / 2.0

    def test_stress_and_displacement(self):
        result = solve(block())
        for edges, sign in (("top", -1.0), ("bottom", 1.0)):
            found = result.resultant(edges)
            assert found.y == pytest.approx(sign * self.FORCE, rel=1e-11)
            assert found.moment == pytest.approx(sign * self.FORCE * self.MIDDLE, rel=1e-11)
        assert result.contacts["ground"].normal_force == pytest.approx(self.FORCE, rel=1e-11)
        companion = solve_companion(result.problem)
        assert companion.contacts["ground"].normal_force == pytest.approx(self.FORCE, rel=1e-9)
        assert companion.reasons == solve_companion(block(load=-1.0)).reasons

    @pytest.mark.parametrize("name", ["top", "gap"])
    def test_of_displacements_and_gaps_every_edge_keeps_what_tractions_feel(self, name):
        """A dent between Gauss points, and polynomials of degree 2 with the same moments on edges from 0.5 on."""
        t, weights = legendre.leggauss(900)
        dent, found = Expression("-exp(-((x - 0.53) / 0.005) ** 2)"), []
        moments = [(k + 0.5) * (weights * dent(0.75 + t / 4.0, t)) @ legendre.Legendre.basis(k)(t) for k in range(3)]
        same = legendre.Legendre(moments, domain=[0.5, 1.0])
        for field in (dent, lambda x, _: np.where(x > 0.5, same(x), 0.0)):
            given = {"top": -0.1, "gap": 0.0, name: field}
            whole = block(TriangleMesh.rectangle((2, 1)), top=Displacement("top", 0.0, given.pop("top")))
            ground = replace(whole.conditions[0], **given)
            found.append(solve(replace(whole, conditions=[ground, *whole.conditions[1:]])))
        one, other = (result.contacts["ground"].normal_stress for result in found)
        assert one == pytest.approx(other, rel=1e-8)
        assert found[0].energies.load == pytest.approx(found[1].energies.load, rel=1e-8)

    def test_gaps_that_open_inside_an_edge_where_friction_varies(self):
        """The law holds at points there, and obstacles are where they are: no polynomial presses between them."""
        gap = Expression("where(x > 0.4, x - 0.4, 0)")
        whole = block(TriangleMesh.rectangle((3, 2)), top=Displacement("top", 0.0, -1e-3))
        ground, *others = whole.conditions
        grounds = [replace(ground, gap=gap, friction=friction) for friction in (0.3, Expression("0.3 + 0.1 * x"))]
        one, other = (solve(replace(whole, conditions=[each, *others])) for each in grounds)
        force = one.contacts["ground"].normal_force
        assert other.contacts["ground"].normal_force == pytest.approx(force, rel=0.2)

    def test_what_is_changed_is_told(self):
        """Half the jump and more, as long as it is inside an edge, and nothing where an edge ends there."""
        result = solve(block())
        assert 4.0 < result.traction_misfit < 12.0
        assert f"up to {result.traction_misfit:.3g}" in result.remarks[-1]
        assert missed_tractions(result) < 1e-11
        mesh = TriangleMesh.grid([0.0, 0.2, FIRST, 0.5, LAST, 1.0], np.linspace(0.0, 1.0, 5))
        for unit in (1.0, 1e9):
            scaled = block(mesh, lambda x, y, unit=unit: unit * strip(x, y))
            fitting = solve(replace(scaled, material=Material(1e3 * unit, 0.3)))
            assert fitting.traction_misfit < 1e-9 * unit
            assert fitting.remarks == ()
        waves = solve(block(load=lambda x, y: -2.0 + 1e-7 * np.sin(1e4 * x) + 0.0 * y))  # all parts of edges are short
        assert 0.9e-7 < waves.traction_misfit < 1.5e-7
        assert any(f"by up to {waves.traction_misfit:.3g} [stress]" in reason for reason in waves.bracket.reasons)


@pytest.mark.parametrize("cells", [(1, 1), (2, 3), (4, 16)])
def test_a_wall_blown_at_below_a_height_tips_at_the_same_wind_on_any_mesh(cells):
    """1 × 4, of the weight 25: its moment is 12.5 = p height²/2."""
    height, mesh = 2.7182, TriangleMesh.rectangle(cells, 1.0, 4.0)
    wind = Traction("left", lambda x, y: np.where(y < height, 1.0, 0.0) + 0.0 * x, 0.0, name="wind")
    conditions = [Contact("bottom", 5.0, name="base"), wind, Traction("top", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    wall = ContactProblem(mesh, Material(1e3, 0.3), conditions, body_potential=lambda x, y: 6.25 * y + 0.0 * x)
    assert upper_bound(wall, ["wind"])[0] == pytest.approx(25.0 / height**2, rel=1e-11)


class TestUplift:
    """A block pressed by 10 and lifted by 6 on a part of its base: it slides at μ (10 − 6 part)."""

    PART = 0.6180339

    def block(self, mesh):
        def fluid(x, y):
            return np.where(x < self.PART, 6.0, 0.0) + 0.0 * y

        drag = [Traction("top", x=1.0, name="drag")]
        drag += [Traction(side, 0.0, y, name="drag") for side, y in (("left", -1.0), ("right", 1.0))]
        base = Contact("bottom", 0.5, name="base", pore_pressure=fluid)
        return ContactProblem(mesh, Material(1e3, 0.2), [base, Traction("top", y=-10.0), *drag])

    @pytest.mark.parametrize("cells", [1, 3, 8])
    def test_no_mesh_carries_more_than_the_body(self, cells):
        limit = limit_load_factor(self.block(TriangleMesh.rectangle((cells, cells))), ["drag"])
        assert limit.upper == pytest.approx(0.5 * (10.0 - 6.0 * self.PART), rel=1e-11)
        assert limit.lower <= limit.upper * (1.0 + 1e-8)

    def test_what_is_taken_has_the_same_force_and_moment(self):
        result = solve(self.block(TriangleMesh.rectangle((3, 3))))
        base = result.contacts["base"]
        assert base.weights @ base.pore_pressure == pytest.approx(6.0 * self.PART, rel=1e-12)
        assert base.weights @ (base.x * base.pore_pressure) == pytest.approx(3.0 * self.PART**2, rel=1e-12)
        (remark,) = (each for each in result.remarks if "pore pressure" in each)
        assert "'base'" in remark


def test_what_check_tells(shell, tmp_path):
    (tmp_path / "strip.toml").write_text(f"""
        version = 1
        mesh = {{ x = [0, 0.5, 1], y = [0, 1] }}
        material = {{ young = 1000, poisson = 0.3 }}
        contacts = [{{ edges = "bottom", friction = 0.5 }}]
        tractions = [
            {{ edges = "top", x = 0, y = "where(x < {FIRST}, 0, where(x < {LAST}, -8, 0))", name = "strip" }},
            {{ edges = "left", x = 0, y = 0 }},
            {{ edges = "right", x = 0, y = 0 }},
        ]
    """)
    (load,) = json.loads(shell("check", tmp_path / "strip.toml", "--json")[1])["loads"]
    force = 8.0 * (LAST - FIRST)
    assert (load["name"], load["x"]) == ("strip", 0.0)
    assert load["y"] == pytest.approx(-force, rel=1e-12)
    assert load["moment"] == pytest.approx(-force * (FIRST + LAST) / 2.0, rel=1e-12)


WIDTH, HEIGHT = 3.0, 1.0
WEIGHT, PUSH, UPLIFT, FRICTION = 12.0, 1.5, 4.5, 0.4  # forces; the uplift that of a pressure which falls to zero
STEEL = Material(1000.0, 0.25, "strain")


def dam(pore_pressure=0.0, push=PUSH, friction=FRICTION, weight=WEIGHT):
    """A dam of given weight on a rough base, pushed from the left by a pressure; a fluid presses under it."""
    mesh = TriangleMesh.rectangle((6, 2), WIDTH, HEIGHT)
    conditions = [Traction("left", x=push / HEIGHT, y=0.0, name="water")]
    conditions += [Traction(side, 0.0, 0.0) for side in ("right", "top")]
    conditions.append(Contact("bottom", friction, pore_pressure=pore_pressure, name="base"))
    return ContactProblem(mesh, STEEL, conditions, body_potential=Expression(f"{weight / WIDTH / HEIGHT!r} * y"))


def falling(uplift=UPLIFT):
    """The pressure that falls from the left to nothing on the right and has a given resultant."""
    return Expression(f"{2.0 * uplift / WIDTH!r} * (1 - x / {WIDTH!r})")


def test_constant_pressure_is_another_problem_without_it():
    """σ = σ' − p I: without the fluid, tractions p n more, and obstacles moved by the strain of −p I."""
    p, mesh = 0.7, TriangleMesh.rectangle((6, 3), 2.0, 1.0)
    shrinks = p * float(STEEL.compliance[0, :2].sum())
    base = Contact("bottom", 0.1, gap=lambda x, _: 2e-3 * (x - 0.6) ** 2, name="base")
    free = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    wet = ContactProblem(mesh, STEEL, [Displacement("top", 2e-4, -1e-3), *free, replace(base, pore_pressure=p)])
    top = Displacement("top", lambda x, _: 2e-4 + shrinks * x, -1e-3 + shrinks)
    base = replace(base, offset=lambda x, _: shrinks * x)
    dry = replace(wet, conditions=[top, Traction("left", -p, 0.0), Traction("right", p, 0.0), base])
    found, other = (solved(problem, degree=4).contacts["base"] for problem in (wet, dry))
    assert set(other.state.tolist()) == {0, 1, 2}
    size = np.abs(other.normal_stress).max()
    for name in ("effective_normal_stress", "tangential_stress", "friction_bound"):
        assert getattr(found, name) == pytest.approx(getattr(other, name), abs=1e-7 * size), name
    assert found.gap == pytest.approx(other.gap, abs=1e-9)
    assert found.state.tolist() == other.state.tolist()
    assert found.excess_between_points == pytest.approx(other.excess_between_points, abs=1e-6 * size)


def test_a_rising_fluid_by_steps():
    """It holds until the uplift has taken so much that friction no longer carries the push; lighter, it floats."""
    uplifts = [0.0, 2.0, 6.0, 6.9, 7.005, 0.0]
    steps = [dam(falling(uplift), friction=0.3) for uplift in uplifts]
    history = solve_history(steps, degree=4)
    assert [str(step.status) for step in history.steps] == ["solved"] * 4 + ["infeasible"]
    assert (history.planned, history.status, len(history.dissipated)) == (6, Status.INFEASIBLE, 4)
    assert "step 5 of 6" in history.message
    forces = [step.contacts["base"].effective_normal_force for step in history.steps[:4]]
    assert forces == pytest.approx([WEIGHT - uplift for uplift in uplifts[:4]], rel=1e-9)
    assert solve(dam(1.001 * WEIGHT / WIDTH, push=0.0)).status is Status.INFEASIBLE


def test_archive_and_summary(tmp_path):
    result = solved(dam(falling()))
    write_npz(tmp_path / "wet.npz", result)
    checked = verify_file(tmp_path / "wet.npz")
    assert checked.passed, checked.table()
    with np.load(tmp_path / "wet.npz") as fields:
        effective = fields["base.normal_stress"] + fields["base.pore_pressure"]
        assert fields["base.effective_normal_stress"] == pytest.approx(effective, rel=1e-12)
    force = json.loads(json.dumps(summary(result)))["contacts"]["base"]["effective_normal_force"]
    assert force["value"] == pytest.approx(WEIGHT - UPLIFT)
    assert "effective_normal_force" not in summary(solved(dam()))["contacts"]["base"]


@pytest.mark.parametrize("value", [-1.0, float("nan"), "much", lambda x, _: -1.0 - x])
def test_bad_pressures_are_refused(value):
    with pytest.raises(InputError, match=r"Contact\.pore_pressure"):
        solve(dam(value))


FORCES = {"weight": Expression("2 * y"), "quake": Expression("-2 * x")}


def shaken(potential, mu=0.3):
    """A shaken on a rough base: an acceleration along x of μ times gravity drags it off."""
    conditions = [Contact("bottom", mu), *(Traction(name, x=0, y=0) for name in ("left", "right", "top"))]
    return ContactProblem(TriangleMesh.rectangle((4, 2), 4.0, 1.0), Material(10.0, 0.3), conditions, potential)


def test_each_force_is_a_load_of_its_own():
    problem = shaken(BodyForces(FORCES))
    limit = limit_load_factor(problem, ["quake"])
    assert limit.upper == pytest.approx(0.3, rel=1e-9)
    assert limit.lower == pytest.approx(0.3, rel=1e-6)
    assert {"weight", "quake"} < set(limit.mechanism.works)
    assert limit_load_factor(problem, ["body"]).upper == limit_load_factor(problem, ["weight", "quake"]).upper
    with pytest.raises(InputError, match="weight"):
        limit_load_factor(problem, ["wieght"])


def test_together_they_are_one_potential():
    forces = BodyForces({"weight": Expression("2 * y"), "quake": Expression("-0.2 * x"), "constant": 1.0})
    one, several = (solve(shaken(potential)) for potential in (Expression("2 * y - 0.2 * x + 1"), forces))
    assert several.status == "solved"
    assert "force 'constant' is a constant, 1 [" in several.remarks[0]
    assert several.stress([1.0, 2.5], [0.2, 0.7]) == pytest.approx(one.stress([1.0, 2.5], [0.2, 0.7]), abs=1e-9)


def test_a_sweep_scales_one_of_them():
    sweep = solve_sweep(shaken(BodyForces(FORCES)), "load", [0.1, 0.2], of=["quake"])
    shear = [result.contacts["bottom"].tangential_force for result in sweep.steps]
    assert np.abs(shear) == pytest.approx([0.8, 1.6], rel=1e-6)  # of the weight 2 · 4
    assert len({problem_digest(shaken(BodyForces({"a": each, "b": 1.0 - each}))) for each in (0.25, 0.75)}) == 2
    mesh = TriangleMesh.rectangle((1, 1))  # a spot beside the middles of triangles, a patch that ends 0.01 further

    def posed(hot=1.0, heavy=1.0, reach=0.1):
        weight, heat = (lambda x, y, f=f: f * (np.hypot(x - 0.5, y - 0.5) < 0.1) for f in (heavy, hot))
        sides = [Traction(side, y=lambda x, _: -1.0 * (np.abs(x - 0.575) < reach)) for side in mesh.edge_names]
        sides += [Displacement(side, x=0.0) for side in mesh.edge_names]
        material = Material(1.0, 0.3, expansion=1.0)
        return ContactProblem(mesh, material, sides, weight, (), heat)

    others = posed(), posed(hot=2.0), posed(heavy=2.0), posed(reach=0.11), posed()
    assert len(set(map(problem_digest, others))) == 4
    halves = (lambda x, y, f=f: {True: f * x}[bool((y < x).all())] for f in (1.0, 2.0))  # no numbers above
    assert len({problem_digest(replace(others[0], temperature=each)) for each in halves}) == 2
    alike = ({"a": 1.0, "b": 2.0}, {"b": 2.0, "a": 1.0})
    alike = (replace(others[0], temperature=Expression("a * x", a), body_potential=BodyForces(a)) for a in alike)
    assert len(set(map(problem_digest, alike))) == 1
    assert len({run_digest(others[:1], {"inner_options": {"n": kind(3)}}) for kind in (int, np.int64)}) == 1


def test_files_and_copies_hold_them_and_they_are_checked():
    problem = shaken(BodyForces({**FORCES, "more": 0.5}))
    text = problem_to_toml(problem)
    assert problem_from_toml(text).problem.body_potential == problem.body_potential
    both = "version = 1\nbody_potential = 1.0"
    for right, wrong, field in (("version = 1", both, "body_potential"), ("weight =", '"body" =', "body_forces")):
        with pytest.raises(InputError) as caught:
            problem_from_toml(text.replace(right, wrong))
        assert caught.value.field == field
    forces = BodyForces(FORCES)
    assert pickle.loads(pickle.dumps(forces)) == forces == copy.deepcopy(forces)
    for wrong in ({}, [1.0], {"body": 1.0}, {"": 1.0}, {"weight": "y"}):
        with pytest.raises(InputError):
            BodyForces(wrong)
