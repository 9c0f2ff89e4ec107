"""Several certified solutions of one discrete problem, and the one that displacements confirm."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh, other_solutions, solve, solve_history
from qvi_contact.bracket import CellFields
from qvi_contact.gallery import compressed_plate, masonry_wall, ssnv128
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Traction
from solvers import Status


def leaning():
    """A single triangle that leans over its contact, pushed along by its other side, has two solutions for μ = 3."""
    sides = {"base": [(0, 1)], "arm": [(1, 2)], "free": [(0, 2)]}
    mesh = TriangleMesh([(0.0, 0.0), (1.0, 0.0), (-2.3, 2.0)], [(0, 1, 2)], sides)
    conditions = [Contact("base", 3.0), Displacement("arm", x=2.0, y=0.6), Traction("free", 0.0, 0.0)]
    return ContactProblem(mesh, Material(1.0, 0.3), conditions)


@pytest.fixture(scope="module")
def several():
    return other_solutions(solve(leaning(), degree=3))


def force(result):
    return next(iter(result.contacts.values())).tangential_force


def test_several_solutions_are_certified_and_differ_whichever_is_given(several):
    forces = [force(result) for result in several.results]
    assert len(forces) >= 2
    assert all(result.status is Status.SOLVED and result.certificate.passed for result in several.results)
    assert max(forces) - min(forces) > 0.02 * abs(min(forces))
    assert f"{min(forces):.5g} to {max(forces):.5g} [stress × length]" in several.message
    again = other_solutions(several.results[-1])  # whichever is given, the same one is preferred
    assert force(again.preferred) == pytest.approx(force(several.preferred), rel=1e-4)


@pytest.mark.parametrize("friction", [0.3, 0.6, 1.5])
def test_a_jammed_wedge_may_also_rest_higher_without_stress(friction):
    """A slope of 1 : 10 and an interference of 1e-3: moved up by 0.01 it touches neither wall, at any friction."""
    mesh = TriangleMesh.grid(np.linspace(-0.5, 0.5, 4), np.linspace(0.0, 1.0, 4))
    x, y = mesh.vertices.T
    mesh = replace(mesh, vertices=np.column_stack([x * (1.0 + 0.2 * y), y]))
    free = [Traction(side, 0.0, 0.0) for side in ("top", "bottom")]
    walls = [Contact(side, friction, gap=-1e-3) for side in ("left", "right")]
    jammed = solve(ContactProblem(mesh, Material(1e3, 0.3), [*walls, *free]), degree=3)
    assert min(abs(each.energies.strain) for each in other_solutions(jammed).results) < 1e-12 < jammed.energies.strain


def test_distances_are_those_of_strains(several):
    """½ ∫ (cσ − ε) : C : (cσ − ε) over the largest strain energy, by Gauss points; the nearest comes first.

    The displacements of one triangle move away rigidly, so each distance is the share of its own energy.
    """
    companion, largest = several.companion, max(result.energies.strain for result in several.results)
    shares = [np.sqrt(result.energies.strain / largest) for result in several.results]
    assert several.distances == pytest.approx(shares, rel=1e-9)
    assert all(one < other for one, other in pairwise((0.0, *several.distances)))
    for result, distance in zip(several.results, several.distances, strict=True):
        fields = CellFields.of(result.discretization, result.dofs, companion.degree + 2)
        assert distance == pytest.approx(np.sqrt(fields.bulk(companion).sum() / largest), rel=1e-9)


def test_where_no_other_is_found_the_result_is_alone():
    """Large friction alone, no time, no friction."""
    rough, smooth = (compressed_plate(friction, (2, 2)) for friction in (0.2, 0.0))
    for problem, limit in ((ssnv128((3, 3), 5.0), None), (rough, 1e-9), (smooth, None)):
        result = solve(problem)
        found = other_solutions(result, time_limit=limit)
        assert found.results == (result,)
        assert found.companion is None
        assert np.isnan(found.distances).all()


def test_results_without_an_answer_or_with_a_past_are_refused():
    unsolved = solve(compressed_plate(0.2, (2, 2)), method="condensed", max_iterations=1)
    steps = [compressed_plate(0.05, (2, 2), displacement=d) for d in (1e-3, 2e-3)]
    for result in (unsolved, solve_history(steps).steps[-1]):
        with pytest.raises(InputError) as caught:
            other_solutions(result)
        assert caught.value.field == "result"


ORDINARY = [
    partial(compressed_plate, 0.2, (2, 2)), partial(masonry_wall, 3, 3, ()), partial(ssnv128, (4, 4), 0.9),
    partial(compressed_plate, 0.0, (2, 2)),
]  # fmt: skip
LARGE = [partial(ssnv128, (4, 4), friction) for friction in (1.0, 3.0, 5.0)]


@pytest.mark.parametrize("problem", [*ORDINARY, *LARGE])
def test_large_friction_leads_to_the_search_for_others(problem):
    result = solve(problem())
    suspects = [remark for remark in result.remarks if "several solutions" in remark]
    assert ["other_solutions" in remark for remark in suspects] == [True] * (problem in LARGE)
    assert result.status is Status.SOLVED or problem in LARGE
