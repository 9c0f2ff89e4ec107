"""Bounds of the energy: they hold, they close, and they close at the rates of the two elements."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from qvi_contact import Contact, Displacement, Material, RectilinearMesh, Symmetry, Traction, solve
from qvi_contact.bracket import BracketKind, bracket, refined_where_apart
from qvi_contact.bracket.given import given_problem
from qvi_contact.errors import InputError
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import ContactProblem
from solvers import solve_qvi
from solvers.strict.newton import Newton

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # rates of that element; triangles: test_triangles

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


class TestBadInput:
    """What is refused."""

    @pytest.mark.parametrize("share", [0.0, 1.5, np.nan, "half"])
    def test_share(self, share):
        found = bracket_of("tied", 2, 1.0)
        with pytest.raises(InputError, match="share"):
            refined_where_apart(found.problem, found, share)


def test_bounds_that_come_too_late_are_infinite():
    """The stress of the plate has to be made admissible on whole edges, for which there is no time."""
    found = bracket(solve(compressed_plate(0.2, (4, 4))), time_limit=1e-9)
    assert found.lower == -np.inf
    assert not found.guaranteed
    assert [reason for reason in found.reasons if "time limit" in reason]
