"""Several certified solutions of one discrete problem, and the one that displacements confirm."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from qvi_contact import InputError, other_solutions, solve, solve_history
from qvi_contact.bracket import branches
from qvi_contact.bracket.parts import CellFields, bulk
from qvi_contact.gallery import compressed_plate, ssnv128
from solvers import Status, following


@pytest.fixture(scope="module")
def rectangles():
    """On 8 × 8 rectangles SSNV128 has at least three solutions for μ = 5."""
    return other_solutions(solve(ssnv128((8, 8), 5.0), element="bfs"))


def force(result):
    return next(iter(result.contacts.values())).tangential_force


def test_several_solutions_are_certified_and_differ(rectangles):
    forces = [force(result) for result in rectangles.results]
    assert len(forces) >= 2
    assert all(result.status is Status.SOLVED and result.certificate.passed for result in rectangles.results)
    assert max(forces) - min(forces) > 0.02 * abs(min(forces))


def test_the_one_nearest_to_displacements_comes_first(rectangles):
    """By the energy of the difference, and here by the force too."""
    known = force(rectangles.companion)
    assert all(one < other for one, other in pairwise(rectangles.distances))
    assert 0.0 < rectangles.distances[0] < 0.5 * rectangles.distances[-1] < 0.1
    errors = [abs(force(result) - known) for result in rectangles.results]
    assert errors.index(min(errors)) == 0
    assert errors[0] < 0.01 * abs(known)


def test_distances_are_those_of_strains(rectangles):
    """∫ (cσ − ε) : C : (cσ − ε) over ∫ ε : C : ε, by Gauss points of the stress in all cells."""
    companion = rectangles.companion
    for result, distance in zip(rectangles.results, rectangles.distances, strict=True):
        fields = CellFields.of(result.discretization, result.dofs, companion.degree + 2)
        strain = companion.cell_strain(*fields.t[:, -2:].T)
        compliances = result.problem.compliances
        nothing = replace(fields, stress=np.zeros_like(fields.stress))
        apart, own = (bulk(each, compliances, strain).sum() for each in (fields, nothing))
        assert distance == pytest.approx(np.sqrt(apart / own), rel=1e-9)


def test_ways_that_begin_at_the_same_friction_begin_at_the_same_state(monkeypatch):
    result = solve(compressed_plate(0.2, (2, 2)))
    posed = []
    solve_one = following.solve_qvi

    def noted(qvi, *given, **options):
        posed.append(options["initial"])
        return solve_one(qvi, *given, **options)

    monkeypatch.setattr(following, "solve_qvi", noted)
    monkeypatch.setattr(following, "WAYS", ((0.4, 1), (0.4, 2), (1.3, 1)))
    assert following.followed_solutions(result.solution) == (result.solution,)
    assert [start is None for start in posed] == [True, False, False, False, True, False]
    assert posed[1] is posed[2]


def test_remarks_name_the_difference_and_the_choice(rectangles):
    first, last = rectangles.results[0].remarks, rectangles.results[-1].remarks
    assert f"{min(map(force, rectangles.results)):.5g}" in first[0]
    assert "is the nearest" in first[0]
    assert "is not the nearest" in last[0]


def test_the_confirmed_one_is_preferred_whichever_is_given(rectangles, monkeypatch):
    found = [result.solution for result in reversed(rectangles.results)]
    monkeypatch.setattr(branches, "followed_solutions", lambda *_args, **_options: tuple(found))
    again = other_solutions(rectangles.results[-1])
    assert force(again.preferred) == force(rectangles.preferred)


def test_without_displacements_the_result_given_comes_first(rectangles, monkeypatch):
    def refuse(problem):
        raise InputError("problem", problem.mesh, "no displacement model")

    given = rectangles.results[-1]
    found = (given.solution, rectangles.preferred.solution)
    monkeypatch.setattr(branches, "followed_solutions", lambda *_args, **_options: found)
    monkeypatch.setattr(branches, "solve_companion", refuse)
    again = other_solutions(given)
    assert again.companion is None
    assert np.isnan(again.distances).all()
    assert force(again.preferred) == force(given)
    assert "no displacement model" in again.preferred.remarks[0]


def test_triangles_have_one():
    result = solve(ssnv128((4, 4), 5.0), element="hct")
    found = other_solutions(result)
    assert found.results == (result,)
    assert found.companion is None


def test_without_friction_or_time_there_is_nothing_to_follow(monkeypatch):
    result = solve(compressed_plate(0.2, (2, 2)))
    assert following.followed_solutions(result.solution, time_limit=1e-9) == (result.solution,)
    monkeypatch.setattr(following, "solve_qvi", None)
    smooth = solve(compressed_plate(0.0, (2, 2)))
    assert following.followed_solutions(smooth.solution) == (smooth.solution,)


def test_results_without_an_answer_or_with_a_past_are_refused():
    unsolved = solve(compressed_plate(0.2, (2, 2)), method="condensed", max_iterations=1)
    with pytest.raises(InputError, match="result"):
        other_solutions(unsolved)
    with pytest.raises(InputError, match="solution"):
        following.followed_solutions(unsolved.solution)
    steps = [compressed_plate(0.05, (2, 2), displacement=d) for d in (1e-3, 2e-3)]
    with pytest.raises(InputError, match="history"):
        other_solutions(solve_history(steps).steps[-1])
