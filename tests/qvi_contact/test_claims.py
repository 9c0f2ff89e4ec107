"""How claimed and computed numbers are compared, and tractions with those prescribed."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Traction, solve
from qvi_contact.gallery import compressed_plate
from qvi_contact.result import ContactResult
from qvi_contact.verification.claims import (
    compared,
    difference,
    missed_tractions,
    problem_difference,
    recompute,
    rediscretized,
    scales_difference,
    worse_than_claimed,
)
from solvers import Certificate
from solvers.certificate.certificate import EXPONENTS

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # claims about grid lines


def test_each_entry_by_its_own_size():
    values = np.array([1.0, 1e-3, 1e-8])
    assert difference(values, values) == 0.0
    assert difference(values * [1.0, 1.0 + 1e-6, 1.0], values) == pytest.approx(1e-9 / 1.1e-3)
    assert difference(values + np.array([0.0, 0.0, 1e-9]), values) == pytest.approx(1e-5, rel=1e-3)


def test_what_is_not_a_number_is_the_largest_of_all():
    """Python's max would pass over it."""
    measures = dict.fromkeys(EXPONENTS, 1e-12)
    computed = Certificate(measures, 1e-8, {"stress": 1.0}, {"bipotential": 1e-12})
    for wrong in (
        replace(computed, measures=measures | {"friction": np.nan}),
        replace(computed, signed={"bipotential": np.nan}),
        replace(computed, signed={}),
    ):
        assert worse_than_claimed(wrong, computed) == np.inf
    assert worse_than_claimed(computed, computed) == 0.0
    other = replace(computed, signed={"bipotential": -1e-8})
    assert worse_than_claimed(other, computed) == pytest.approx(0.5, rel=1e-3)  # of 2 tolerance
    for scales in ({"stress": np.nan}, {}, {"stress": 1.0, "rounding": np.nan}, {"stress": 1.0, "rounding": 1e-3}):
        assert scales_difference(replace(computed, scales=scales), computed) == np.inf
    assert scales_difference(replace(computed, scales={"stress": 1.0, "rounding": 1e-8}), computed) == 0.0
    qvi = solve(compressed_plate(0.2, (2, 2))).solution.problem
    assert problem_difference(qvi, qvi) == 0.0
    broken = replace(qvi)
    object.__setattr__(broken, "f", np.full(qvi.n, np.nan))  # the constructor refuses it
    assert problem_difference(broken, qvi) == np.inf


def test_coordinates_count_from_the_corner_of_the_body():
    mesh = RectilinearMesh.rectangle((3, 2))
    free = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=-1.0)]
    for origin in (0.0, -1e6):
        body = RectilinearMesh(mesh.x + origin, mesh.y)
        result = solve(ContactProblem(body, Material(1e3, 0.3), [Contact("bottom", 0.5), *free]))
        found = recompute(result, rediscretized(result), 1e-8)
        for name in ("x_lines", "gauss_x", "bottom.x"):
            right = found.fields[name]
            assert dict(compared(found.fields | {name: np.nextafter(right, np.inf)}, found))[name] < 1e-8
            assert dict(compared(found.fields | {name: right + 1e-6}, found))[name] > 1e-7


def test_units_and_rounding():
    assert difference([1e-12], [0.0], unit=1.0) == pytest.approx(1e-8)
    assert difference([1.0 + 1e-12], [1.0], rounding=1e-11) == 0.0


def test_what_is_not_finite_has_to_be_so_in_both():
    assert difference([np.nan, np.inf, 1.0], [np.nan, np.inf, 1.0]) == 0.0
    for wrong in ([1.0, np.inf, 1.0], [np.nan, 1.0, 1.0], [np.nan, -np.inf, 1.0], [np.nan, np.inf, np.nan]):
        assert difference(wrong, [np.nan, np.inf, 1.0]) == np.inf


def test_words_flags_and_shapes():
    assert difference([True, False], [True, True]) == 1.0
    assert difference(np.array("a"), np.array("b")) == 1.0
    assert difference([1.0, 2.0], [1.0]) == np.inf
    assert difference([1], [1.0]) == np.inf


def test_resultants_of_prescribed_tractions():
    """Met though the load is no polynomial; missed by 1 % where the particular stress is 1 % too large."""
    top = Traction("top", x=lambda x, y: np.sin(3.0 * x) + 0.0 * y, y=lambda x, y: -10.0 * np.exp(x) + 0.0 * y)
    sides = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    problem = ContactProblem(
        RectilinearMesh.rectangle((3, 2)), Material(1e3, 0.3), [Contact("bottom", 0.5), top, *sides]
    )
    result = solve(problem)
    assert result.traction_misfit > 1e-3
    assert missed_tractions(result) < 1e-12
    known = result.discretization
    larger = replace(known.elimination, particular=1.01 * known.elimination.particular)
    wrong = ContactResult(replace(known, elimination=larger), result.solution)
    assert 1e-3 < missed_tractions(wrong) < 1e-2
