"""Bounds of the energy: they hold, they close, and they close at the rates of the two elements."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from qvi_contact import Contact, Displacement, Material, RectilinearMesh, Symmetry, Traction, solve, solve_history
from qvi_contact.bracket import BracketKind, Certainty, bracket, refined_where_apart
from qvi_contact.bracket.given import given_problem
from qvi_contact.errors import InputError
from qvi_contact.exact import cantilever, gravity_column, problem_from_state, pure_bending, uniform
from qvi_contact.gallery import compressed_plate, sliding_block, ssnv128
from qvi_contact.problem import ContactProblem
from solvers import solve_qvi
from solvers.strict.newton import Newton

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # rates of that element; triangles: test_triangles

STICKING_FORCE = 214.36766  # ± 2e-5: displacement codes and this package, settled
U = 1e-3


def tresca_plate(cells, bound=40.0, grading=1.0):
    plate = compressed_plate(0.0, cells, grading=grading)
    return replace(plate, conditions=[*plate.conditions[:3], Contact.tresca("top", bound, gap=-U, name="plate")])


def tied_plate(cells, grading=1.0):
    plate = compressed_plate(0.0, cells, grading=grading)
    return replace(plate, conditions=[*plate.conditions[:3], Contact.tied("top", gap=-U, name="plate")])


def cylinder(cells, grading=1.0):
    """A block on a curved obstacle without friction, pushed down: contact in the middle, a gap outside."""
    mesh = RectilinearMesh.rectangle(cells, 1.0, 1.0, grading=grading)
    conditions = [
        Contact.frictionless("bottom", gap=lambda x, y: 2e-3 * x**2 + 0 * y, name="ground"),
        Symmetry("left"),
        Traction("right", x=0.0, y=0.0),
        Displacement("top", x=0.0, y=-U),
    ]
    return ContactProblem(mesh, Material(2.09e5, 0.3), conditions)


CONVEX = {"tresca": tresca_plate, "tied": tied_plate, "frictionless": cylinder}


@cache
def bracket_of(name, cells, grading):
    """Bracket of a convex problem on cells² cells."""
    return solve(CONVEX[name]((cells, cells), grading=grading)).bracket


@cache
def under_coulomb(cells):
    """The plate with friction that slips, on cells² cells."""
    return solve(compressed_plate(0.1, (cells, cells)))


@pytest.mark.parametrize("name", CONVEX)
@pytest.mark.parametrize(("cells", "grading"), [(2, 1.0), (4, 1.0), (8, 1.0), (16, 1.0), (4, 0.6), (16, 0.8)])
def test_lower_is_never_above_upper(name, cells, grading):
    found = bracket_of(name, cells, grading)
    assert found.guaranteed, found.reasons
    assert found.kind is BracketKind.PROBLEM
    assert found.lower <= found.upper
    assert found.slack <= 1e-6 * found.gap
    assert sum(found.parts.values()) == pytest.approx(found.gap, rel=1e-6)
    assert found.cells.sum() == pytest.approx(sum(found.parts.values()), rel=1e-12)
    assert min(found.parts.values()) >= -1e-9 * found.gap


@pytest.mark.parametrize("name", CONVEX)
def test_bounds_of_different_meshes_agree(name):
    """Every lower bound is below every upper one: the energy of the solution lies between them."""
    brackets = [bracket_of(name, n, q) for n, q in ((2, 1.0), (5, 0.7), (8, 1.0), (16, 0.8))]
    assert max(b.lower for b in brackets) <= min(b.upper for b in brackets)
    assert brackets[-1].gap < 0.1 * brackets[0].gap


@pytest.mark.parametrize(("name", "low", "high"), [("tied", 1.4, 1.6), ("tresca", 0.9, 1.2), ("frictionless", 1.5, 4)])
def test_gap_shrinks_at_the_expected_rate(name, low, high):
    """Those of the corner at the end of the contact.

    Tied: its singularity, 2λ = 1.517 (Williams). Tresca: σ_xy is 0 on the free side and the bound beside it on the
    contact, a jump that a continuous stress cannot follow: the last edge misses h s |slip|.
    """
    gaps = [bracket_of(name, n, 1.0).gap for n in (4, 8, 16)]
    rates = np.log2(np.array(gaps[:-1]) / gaps[1:])
    assert rates.min() > low
    assert rates.max() < high


def test_grading_overcomes_the_corner():
    """Cells that shrink towards the corner: the jump of Tresca's shear costs next to nothing."""
    graded, uniformly = (bracket_of("tresca", 16, q) for q in (0.7, 1.0))
    assert graded.gap < 0.05 * uniformly.gap


def test_hypercircle_bounds_the_true_error():
    """½ ‖σ − τ‖² ≤ gap, with σ from a much finer mesh, and the gap is not far above it."""
    coarse, fine = bracket_of("tied", 4, 1.0), solve(tied_plate((32, 32), grading=0.85))
    error = coarse.result.energies.complementary - fine.energies.complementary  # = ½ ‖σ − τ‖² for tied contacts
    assert 0.0 < error <= coarse.gap < 20.0 * error


def exact_states():
    steel, strained = Material(1000.0, 0.3), Material(1000.0, 0.2, "strain")
    unit = RectilinearMesh.rectangle((3, 2), 2.0, 1.0, grading=0.7)
    beam = RectilinearMesh([0.0, 1.0, 2.5, 4.0], [-0.5, 0.1, 0.5])
    k = 8.0
    yield (
        "uniform",
        problem_from_state(
            uniform(steel, 3.0, -7.0, 2.0), unit, steel, {"bottom": "uu", "right": "tt", "top": "tu", "left": "ut"}
        ),
        2,
    )
    yield (
        "bending",
        problem_from_state(
            pure_bending(strained, 5.0), beam, strained, {"bottom": "tt", "right": "tt", "top": "tt", "left": "uu"}
        ),
        2,
    )
    yield (
        "cantilever",
        problem_from_state(
            cantilever(steel, k, -k / 8), beam, steel, {"bottom": "tt", "right": "uu", "top": "tt", "left": "tt"}
        ),
        3,
    )
    yield (
        "gravity",
        problem_from_state(
            gravity_column(strained, 2.0, 1.0),
            unit,
            strained,
            {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"},
        ),
        2,
    )
    yield "compression", compressed_plate(0.0, (3, 2), grading=0.8), 2
    yield "signorini", ssnv128((4, 3), friction=0.0), 2


@pytest.mark.parametrize(("name", "problem", "degree"), list(exact_states()), ids=lambda value: str(value)[:12])
def test_exact_states_close_the_gap(name, problem, degree):
    found = bracket(solve(problem), degree=degree)
    assert found.guaranteed, (name, found.reasons)
    size = max(abs(found.lower), found.strain)
    assert abs(found.gap) <= 1e-10 * size
    assert sum(found.parts.values()) <= 1e-10 * size


class TestForces:
    """Bounds of the force of one displacement."""

    def test_sticking_plate(self):
        """The force of full stick lies between bounds that close; the Coulomb problem sticks for this μ."""
        before = np.inf
        for cells, grading in ((4, 1.0), (8, 0.8), (16, 0.75)):
            found = solve(compressed_plate(0.5, (cells, cells), grading=grading)).bracket
            assert found.kind is BracketKind.STICKING
            assert found.certainty is Certainty.IF_STICKING
            force = found.forces["plate.normal_force"]
            assert force.lower <= STICKING_FORCE + 4e-5
            assert force.upper >= STICKING_FORCE - 4e-5
            assert force.upper - force.lower < 0.5 * before
            before = force.upper - force.lower
        assert before < 1e-3 * STICKING_FORCE

    def test_frictionless_plate(self):
        found = solve(compressed_plate(0.0, (2, 3))).bracket
        assert found.forces["plate.normal_force"] == pytest.approx((209.0, 209.0), rel=1e-9)

    def test_support(self):
        """The same plate pushed by a support: the force on the body along y."""
        plate = compressed_plate(0.0, (3, 3))
        pushed = replace(plate, conditions=[*plate.conditions[:3], Displacement("top", y=-U), Traction("top", x=0.0)])
        assert solve(pushed).bracket.forces["top.y"] == pytest.approx((-209.0, -209.0), rel=1e-9)

    @pytest.mark.parametrize("problem", [tresca_plate((3, 3)), cylinder((3, 3)), ssnv128((3, 3), friction=0.0)])
    def test_none_where_the_problem_is_not_homogeneous(self, problem):
        assert solve(problem).bracket.forces == {}


class TestCoulomb:
    """The friction bound held fixed."""

    def test_is_an_indicator(self):
        found = under_coulomb(8).bracket
        assert found.kind is BracketKind.GIVEN_BOUND
        assert not found.guaranteed
        assert "friction bound on 'plate'" in found.reasons[0]
        assert found.lower <= found.upper
        assert found.outer > 0.0
        assert "Estimate, not a bound" in found.message

    def test_outer_part_vanishes_for_a_strict_fixed_point(self):
        strict = solve(compressed_plate(0.1, (8, 8)), inner="strict-direct:clarabel")
        assert strict.bracket.outer <= 1e-5 * under_coulomb(8).bracket.outer
        assert strict.bracket.result is strict  # admissible as it is: no second solve

    def test_gap_shrinks(self):
        gaps = [under_coulomb(n).bracket.gap for n in (8, 16)]
        assert gaps[1] < 0.6 * gaps[0]

    def test_manufactured_slip(self):
        """A uniform state that slips everywhere: both energies are exact for the bound of the exact pressure."""
        problem, _ = sliding_block()
        found = solve(problem).bracket
        assert abs(found.gap) <= 1e-9 * found.strain
        assert found.outer <= 1e-7 * found.strain


def test_open_edges_leave_multipliers_that_are_slips(monkeypatch):
    """A punch that opens over half of the top, on cells that bisection made: the law on whole edges is σ_T = 0 there.

    Neighbouring edges say it twice at the node that they share, and only the sum of the two multipliers is a slip. If
    they are driven apart until they are thousands of slips, digits are lost, and with them the bound.
    """
    x = [*np.arange(0.0, 0.625, 0.125), *np.arange(0.625, 0.875, 0.0625), *np.arange(0.875, 0.9375, 1 / 64),
         *np.arange(0.9375, 1.125, 0.0625), *np.arange(1.125, 1.75, 0.125), *np.arange(1.75, 2.5, 0.25),
         2.5, 3.0, 3.5, 3.75, 4.0]  # fmt: skip
    y = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.375, 1.5, 1.625, 1.75, 1.875, 1.9375, 1.96875, 1.984375, 2.0]
    contact = Contact("top", friction=0.3, gap=lambda x, y: x**2 / 1600.0 - U + 0.0 * y, name="punch")
    sides = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0)]
    result = solve(
        ContactProblem(RectilinearMesh(np.array(x), np.array(y)), Material(2.1e5, 0.3, "strain"), [*sides, contact])
    )
    given = given_problem(result).qvi
    monkeypatch.setattr(Newton, "affordable", False)
    strict = solve_qvi(given, tolerance=1e-9)
    assert strict.solved
    slips = np.abs(strict.tangential_multiplier / given.W)
    assert slips.max() < 3.0 * strict.certificate.scales["displacement"]
    found = bracket(result)
    assert found.lower <= found.upper < found.lower + 2e-5 * found.strain


def test_indicator_is_largest_at_the_singular_corner():
    cells = bracket_of("tied", 8, 1.0).cells
    assert np.unravel_index(np.argmax(cells), cells.shape) == (7, 7)


def test_marking_beats_uniform_refinement():
    """Half the gap for the unknowns of the uniform mesh, and no more lines than asked for."""
    adaptive = bracket_of("tied", 4, 1.0)
    while (finer := refined_where_apart(adaptive.problem, adaptive)).mesh.active.size <= 256:
        adaptive = solve(finer).bracket
    assert adaptive.gap < 0.3 * bracket_of("tied", 16, 1.0).gap


def test_does_not_depend_on_units_or_place():
    plate = tresca_plate((5, 4), grading=0.8)
    moved = RectilinearMesh(plate.mesh.x * 1e3 + 7e5, plate.mesh.y * 1e3 - 3e5)
    contact = Contact.tresca("top", 40.0, gap=-U * 1e3, name="plate")
    other = replace(plate, mesh=moved, conditions=[*plate.conditions[:3], contact])
    first, second = solve(plate).bracket, solve(other).bracket
    assert second.lower / 1e6 == pytest.approx(first.lower, rel=1e-9)
    assert second.upper / 1e6 == pytest.approx(first.upper, rel=1e-9)
    np.testing.assert_allclose(second.cells / 1e6, first.cells, rtol=1e-4, atol=1e-9 * first.gap)


class TestBadInput:
    """What is refused."""

    def test_history_step(self):
        def step(push):
            return compressed_plate(0.2, (3, 3), displacement=push)

        history = solve_history([step(1e-3), step(2e-3), step(1.5e-3)])
        with pytest.raises(InputError, match="history"):
            bracket(history.steps[-1])

    def test_no_result(self):
        with pytest.raises(InputError, match="ContactResult"):
            bracket(compressed_plate(0.2))  # type: ignore[arg-type]

    @pytest.mark.parametrize("share", [0.0, 1.5, np.nan, "half"])
    def test_share(self, share):
        found = bracket_of("tied", 2, 1.0)
        with pytest.raises(InputError, match="share"):
            refined_where_apart(found.problem, found, share)

    def test_other_mesh(self):
        found = bracket_of("tied", 2, 1.0)
        with pytest.raises(InputError, match="mesh"):
            refined_where_apart(tied_plate((3, 2)), found)


def test_loads_met_in_resultants_only_are_not_guaranteed():
    mesh = RectilinearMesh.rectangle((4, 4))
    load = Traction("top", x=0.0, y=lambda x, y: np.where(x < 0.3, -1.0, 0.0 * y))
    problem = ContactProblem(
        mesh, Material(1e3, 0.2), [Displacement("bottom", x=0.0, y=0.0), load, Traction("left", x=0.0, y=0.0),
                                   Traction("right", x=0.0, y=0.0)],
    )  # fmt: skip
    found = solve(problem).bracket
    assert not found.guaranteed
    assert "differ from the prescribed ones" in " ".join(found.reasons)


def test_bounds_that_come_too_late_are_infinite():
    """The stress of the plate has to be made admissible on whole edges, for which there is no time."""
    found = bracket(solve(compressed_plate(0.2, (4, 4))), time_limit=1e-9)
    assert found.lower == -np.inf
    assert not found.guaranteed
    assert [reason for reason in found.reasons if "time limit" in reason]
