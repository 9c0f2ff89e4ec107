"""Loads that jump inside an edge: stresses, displacements, mechanisms and `check` take the same, exact, integrals."""

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Material,
    RectilinearMesh,
    Traction,
    TriangleMesh,
    limit_load_factor,
    solve,
)
from qvi_contact.command.outline import outline
from qvi_contact.companion import solve_companion
from qvi_contact.element.quadrature import adapted, constant
from qvi_contact.files.problem_file import problem_from_toml
from qvi_contact.mechanism import upper_bound
from qvi_contact.verification.claims import missed_tractions

FIRST, LAST = 0.3371, 0.6123
"""Where the load on the top begins and ends: inside cells of the width 1/4, and no multiple of anything."""


def strip(x, y):
    return np.where((x > FIRST) & (x < LAST), -8.0, 0.0) + 0.0 * y


def block(mesh=None, load=strip):
    """A block that rests on the ground with friction."""
    mesh = RectilinearMesh.rectangle((4, 4)) if mesh is None else mesh
    sides = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    conditions = [Contact("bottom", 0.5, name="ground"), Traction("top", 0.0, load), *sides]
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

    def test_polynomials_have_one_part(self):
        assert len(adapted(lambda edge, t: edge[:, None] + t**7, 5).edge) == 5
        assert len(adapted(lambda edge, t: np.where(edge[:, None] + t < 1.2345, 1.0, 0.0), 5).edge) < 70

    @pytest.mark.parametrize(("value", "count"), [(-3.7, 3), (0.0, 2), (1.0, 0)])
    def test_numbers_are_integrated_as_functions_are(self, value, count):
        found, followed = constant(value, count, 5), adapted(lambda _, t: np.full(t.shape, value), count, 5)
        for name in ("count", "edge", "t", "weights", "values", "error"):
            assert np.array_equal(getattr(found, name), getattr(followed, name)), name

    @pytest.mark.parametrize("origin", [1e4, 5e5, 1e7])
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

    def test_a_function_at_the_end_of_an_edge_is_the_edges_own(self):
        found = adapted(lambda edge, t: np.where(edge[:, None] + t < 2.0, 1.0, 0.0), 3)
        assert len(found.edge) == 3
        assert found.coefficients(0)[:, 0].tolist() == pytest.approx([1.0, 1.0, 0.0], abs=1e-15)

    def test_what_nothing_can_follow_is_said(self):
        """Rounding of a large number decides."""
        found = adapted(lambda edge, t: np.sign(np.sin(1e12 * (edge[:, None] + t))), 2)
        assert found.error > 0.1
        one = adapted(lambda edge, t: np.where(t == 0.5, 1.0, 0.0) + 0.0 * edge[:, None], 2)  # a sample, and no length
        assert one.error == pytest.approx(2.0 / 99.0)
        assert one.coefficients(0) == pytest.approx(0.0, abs=1e-12)

    def test_no_edges(self):
        assert adapted(lambda _, t: t[:, :1] * np.nan, 0).coefficients(2).shape == (0, 3)


@pytest.mark.parametrize("element", ["bfs", "hct"])
class TestResultants:
    """Force 8 (LAST − FIRST), in the middle between them."""

    FORCE = 8.0 * (LAST - FIRST)
    MIDDLE = (FIRST + LAST) / 2.0

    def test_stress_and_displacement(self, element):
        result = solve(block(), element=element)
        for edges, sign in (("top", -1.0), ("bottom", 1.0)):
            found = result.resultant(edges)
            assert found.y == pytest.approx(sign * self.FORCE, rel=1e-11)
            assert found.moment == pytest.approx(sign * self.FORCE * self.MIDDLE, rel=1e-11)
        assert result.contacts["ground"].normal_force == pytest.approx(self.FORCE, rel=1e-11)
        companion = solve_companion(result.problem)
        assert companion.contacts["ground"].normal_force == pytest.approx(self.FORCE, rel=1e-9)
        assert companion.reasons == solve_companion(block(load=-1.0)).reasons

    def test_what_is_changed_is_told(self, element):
        """Half the jump and more, as long as it is inside an edge, and nothing where an edge ends there."""
        result = solve(block(), element=element)
        assert 4.0 < result.traction_misfit < 12.0
        assert f"up to {result.traction_misfit:.3g}" in result.remarks[-1]
        assert missed_tractions(result) < 1e-11
        lines = np.array([0.0, 0.2, FIRST, 0.5, LAST, 1.0])
        fitting = solve(block(RectilinearMesh(lines, np.linspace(0.0, 1.0, 5))), element=element)
        assert fitting.traction_misfit < 1e-9
        assert fitting.remarks == ()

    def test_a_load_whose_parts_are_all_small_is_compared_too(self, element):
        """Waves of the amplitude 1 are no constant, though every part of an edge is shorter than 10⁻³ of it."""
        result = solve(block(load=lambda x, y: -2.0 + np.sin(1e4 * x) + 0.0 * y), element=element)
        assert 0.9 < result.traction_misfit < 1.5


def test_loads_of_a_body_far_away():
    """The edges know how far: a smooth load on a body at (5e5, 0) takes few points, and its force is right."""
    counted = []

    def load(x, y):
        counted.append(np.size(x))
        return -np.cos(x - 5e5) + 0.0 * y

    far = RectilinearMesh(5e5 + np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 5))
    result = solve(block(far, load))
    assert result.contacts["ground"].normal_force == pytest.approx(np.sin(1.0), rel=1e-8)
    assert sum(counted) < 20_000


class TestMechanism:
    """A wall 1 × 4 of the weight 25, blown at below a height only: it tips at 12.5 = p height²/2."""

    HEIGHT = 2.7182

    def wall(self, mesh):
        def wind(x, y):
            return np.where(y < self.HEIGHT, 1.0, 0.0) + 0.0 * x

        loads = [Traction("left", wind, 0.0, name="wind"), Traction("top", 0.0, 0.0), Traction("right", 0.0, 0.0)]
        conditions = [Contact("bottom", 5.0, name="base"), *loads]
        return ContactProblem(mesh, Material(1e3, 0.3), conditions, body_potential=lambda x, y: 6.25 * y + 0.0 * x)

    @pytest.mark.parametrize("cells", [(1, 1), (2, 3), (4, 16)])
    def test_the_limit_on_any_mesh(self, cells):
        problem = self.wall(RectilinearMesh.rectangle(cells, 1.0, 4.0))
        assert upper_bound(problem, ["wind"])[0] == pytest.approx(25.0 / self.HEIGHT**2, rel=1e-11)

    def test_what_a_mesh_carries_stays_below(self):
        mesh = TriangleMesh.rectangle((2, 3), 1.0, 4.0).graded([[1.0, 0.0]], 12)
        limit = limit_load_factor(self.wall(mesh), ["wind"])
        assert 0.9999 * limit.upper < limit.lower <= limit.upper * (1.0 + 1e-8)


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

    @pytest.mark.parametrize("cells", [1, 2, 3, 8])
    @pytest.mark.parametrize("element", ["bfs", "hct"])
    def test_no_mesh_carries_more_than_the_body(self, cells, element):
        limit = limit_load_factor(self.block(RectilinearMesh.rectangle((cells, cells))), ["drag"], element=element)
        assert limit.upper == pytest.approx(0.5 * (10.0 - 6.0 * self.PART), rel=1e-11)
        assert limit.lower <= limit.upper * (1.0 + 1e-8)

    @pytest.mark.parametrize("element", ["bfs", "hct"])
    def test_what_is_taken_has_the_same_force_and_moment(self, element):
        result = solve(self.block(RectilinearMesh.rectangle((3, 3))), element=element)
        base = result.contacts["base"]
        assert base.weights @ base.pore_pressure == pytest.approx(6.0 * self.PART, rel=1e-12)
        assert base.weights @ (base.x * base.pore_pressure) == pytest.approx(3.0 * self.PART**2, rel=1e-12)
        (remark,) = (each for each in result.remarks if "pore pressure" in each)
        assert "'base'" in remark


def test_what_check_tells():
    file = problem_from_toml(f"""
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
    (load,) = outline(file, {})[1]["loads"]
    force = 8.0 * (LAST - FIRST)
    assert (load["name"], load["x"]) == ("strip", 0.0)
    assert load["y"] == pytest.approx(-force, rel=1e-12)
    assert load["moment"] == pytest.approx(-force * (FIRST + LAST) / 2.0, rel=1e-12)
