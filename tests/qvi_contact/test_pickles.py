"""Problems and results go through pickle and deepcopy, as to other processes."""

import copy
import pickle

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Expression,
    InputError,
    Material,
    Polynomial,
    RectilinearMesh,
    Region,
    Traction,
    discretize,
    solve,
    solve_history,
)
from qvi_contact.gallery import compressed_plate
from qvi_contact.verification.verification import verify_result


def half(x, y):
    """A function that has a name."""
    return 0.5 + 0.0 * x * y


def through_pickle(value):
    return pickle.loads(pickle.dumps(value))


def stack(friction=half):
    mesh = RectilinearMesh.rectangle((2, 4), 1.0, 2.0).with_joint("joint", "horizontal", at=1.0)
    mesh = mesh.with_edges("upper", "left", start=1.0)
    conditions = [
        Displacement("bottom", x=0.0, y=0.0),
        Contact("joint", friction),
        Traction("top", x=Expression("0.1 * x * (1 - x)"), y=Polynomial([[-1.0]])),
        *(Traction(side, x=0.0, y=0.0) for side in ("left", "right")),
    ]
    return ContactProblem(mesh, Material(1e3, 0.3), conditions, regions=[Region(Material(2e3, 0.3), y=(1.0, 2.0))])


@pytest.fixture(scope="module")
def result():
    found = solve(stack())
    _ = found.contacts, found.energies, found.solution.uniqueness, found.discretization.remarks  # what is remembered
    return found


@pytest.mark.parametrize("copied", [through_pickle, copy.deepcopy, copy.copy])
def test_a_result_stays_what_it_is(result, copied):
    again = copied(result)
    assert (again.status, again.message) == (result.status, result.message)
    assert np.array_equal(again.solution.z, result.solution.z)
    assert again.certificate.measures == result.certificate.measures
    assert again.energies == result.energies
    for name, line in result.contacts.items():
        assert np.array_equal(again.contacts[name].slip, line.slip)
    assert verify_result(again).passed


@pytest.mark.parametrize("copied", [through_pickle, copy.deepcopy, copy.copy])
def test_a_problem_gives_the_same_inequality(copied):
    problem = copied(stack())
    assert problem.mesh.named == stack().mesh.named
    assert not problem.mesh.x.flags.writeable
    ours, theirs = discretize(problem).qvi, discretize(stack()).qvi
    assert np.array_equal(ours.K.data, theirs.K.data)
    assert np.array_equal(ours.f, theirs.f)
    assert np.array_equal(ours.mu, theirs.mu)
    with pytest.raises(TypeError):
        problem.mesh.named["new"] = problem.mesh.named["joint"]


def test_a_history_and_a_strict_result():
    history = through_pickle(solve_history([compressed_plate(0.3, (2, 2), displacement=u) for u in (1e-3, 2e-3)]))
    assert len(history.steps) == 2
    assert (history.dissipated >= 0.0).all()
    strict = solve(compressed_plate(0.3, (2, 2)), inner="strict-direct:clarabel")
    assert verify_result(through_pickle(strict)).passed


@pytest.mark.parametrize("copied", [copy.deepcopy, copy.copy])
def test_functions_without_a_name_are_told(copied):
    problem = stack(lambda x, y: half(x, y))
    for value in (problem, solve(problem)):
        with pytest.raises(InputError, match="cannot be pickled") as caught:
            pickle.dumps(value)
        assert caught.value.field == "Contact.friction"
    assert discretize(copied(problem)).qvi.m == discretize(problem).qvi.m


def test_triangles():
    result = solve(compressed_plate(0.3, (2, 2)).triangulated())
    again = through_pickle(result)
    assert verify_result(again).passed
    assert again.problem.mesh.edge_sets.keys() == result.problem.mesh.edge_sets.keys()
    assert not again.problem.mesh.vertices.flags.writeable
