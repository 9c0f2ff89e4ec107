"""Attempts to refute the bounds: other meshes, wrong stresses, odd data, every side, units, and places."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Symmetry,
    Traction,
    solve,
)
from qvi_contact.bracket import bracket
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # grids turned and mirrored have the same cells, unlike triangles

SIDES = {"bottom": "top", "top": "bottom", "left": "right", "right": "left"}
SOFT = Material(1e3, 0.3)
U = 1e-3


def free(*sides):
    return [Traction(side, 0.0, 0.0) for side in sides]


def square(*conditions, cells=(4, 4), material=SOFT, potential=0.0):
    """A unit square; sides without a condition are free."""
    ruled = {condition.edges for condition in conditions}
    rest = [side for side in SIDES if side not in ruled]
    return ContactProblem(RectilinearMesh.rectangle(cells), material, [*conditions, *free(*rest)], potential)


def pressed(bound, cells=(4, 4)):
    """The quarter plate of the gallery under a plate with a given friction bound."""
    plate = compressed_plate(0.0, cells)
    return replace(plate, conditions=[*plate.conditions[:3], Contact.tresca("top", bound, gap=-U, name="plate")])


def legendre(x, y):
    """The polynomial of degree 4 that is zero at four Gauss points of [0, 1]."""
    t = 2.0 * x - 1.0
    return (35.0 * t**4 - 30.0 * t**2 + 3.0) / 8.0 + 0.0 * y


class TestPotentials:
    """Potentials that are not affine along a contact: τ_N is not, either."""

    def boxed(self, cells, contact, potential, push=0.0):
        walls = Symmetry("left"), Symmetry("right"), Displacement("top", 0.0, -push)
        return square(contact, *walls, cells=cells, material=Material(1e3, 0.4999, "strain"), potential=potential)

    def test_tension_between_gauss_points(self):
        """The potential pulls at both ends of the edge and is nothing at its Gauss points."""
        contact = Contact.frictionless("bottom")
        found = solve(self.boxed((1, 1), contact, legendre)).bracket
        companion = solve_companion(self.boxed((6, 6), contact, legendre))
        assert not companion.reasons
        assert found.lower > companion.energy  # what may not be claimed to be a bound
        assert not found.guaranteed

    @pytest.mark.parametrize(
        "contact", [Contact.tresca("bottom", 0.1), Contact("bottom", 0.1)], ids=["tresca", "coulomb"]
    )
    def test_is_no_error(self, contact):
        """No bound from below is claimed, and no exception speaks of an algorithm's inside."""
        sides = Symmetry("left"), Displacement("top", 0.0, -U)
        found = bracket(solve(square(contact, *sides, cells=(3, 3), potential=lambda x, y: x**2 + 0.0 * y)))
        assert not found.guaranteed
        assert found.lower == -np.inf
        assert np.isfinite(found.upper)


def walled_block(lines=(0.0, 0.1, 0.4, 1.0), unit=1.0, stress=1.0, start=0.0, mirrored=False):
    """A block on a frictionless ground, a wall with a bound at its left (or right) side."""
    x = 1.0 - np.asarray(lines)[::-1] if mirrored else np.asarray(lines)
    wall, other = ("right", "left") if mirrored else ("left", "right")
    mesh = RectilinearMesh(start + unit * x, start + unit * np.array([0.0, 0.4, 1.0]))
    conditions = [
        Contact.frictionless("bottom"),
        Contact.tresca(wall, 5.0 * stress, gap=-1e-4 * unit, offset=2e-4 * unit),
        *free(other),
        Displacement("top", y=-U * unit),
        Traction("top", x=0.0),
    ]
    return ContactProblem(mesh, Material(1e5 * stress, 0.3), conditions)


@cache
def walled_bracket():
    return solve(walled_block()).bracket


class TestInvariance:
    """The same problem said in another way."""

    def test_mirrored(self):
        first, other = walled_bracket(), solve(walled_block(mirrored=True)).bracket
        assert other.lower == pytest.approx(first.lower, rel=1e-9)
        assert other.upper == pytest.approx(first.upper, rel=1e-9)
        np.testing.assert_allclose(other.cells[:, ::-1], first.cells, rtol=1e-4, atol=1e-6 * first.gap)

    def test_transposed(self):
        """The axes change places: a force on the right instead of the top."""
        gap, bound = -U, 0.1
        upright = square(Displacement("bottom", 0.0, 0.0), Contact.tresca("top", bound, gap=gap), cells=(3, 2))
        lying = square(Displacement("left", 0.0, 0.0), Contact.tresca("right", bound, gap=gap), cells=(2, 3))
        first, other = solve(upright).bracket, solve(lying).bracket
        assert other.lower == pytest.approx(first.lower, rel=1e-9)
        assert other.upper == pytest.approx(first.upper, rel=1e-9)
        np.testing.assert_allclose(other.cells.T, first.cells, rtol=1e-4, atol=1e-6 * first.gap)


@cache
def solved_plate():
    return solve(pressed(10.0, (2, 2)))


class TestBadInput:
    """What is refused, in the project's own words."""

    @pytest.mark.parametrize(
        "options",
        [
            {"tolerance": "a"},
            {"tolerance": None},
            {"tolerance": 0.0},
            {"tolerance": 0.4},
            {"tolerance": np.nan},
            {"degree": 2.5},
            {"degree": 1},
        ],
        ids=str,
    )
    def test_options(self, options):
        with pytest.raises(InputError, match=next(iter(options))):
            bracket(solved_plate(), **options)
