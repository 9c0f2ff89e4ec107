"""Problems and results go through pickle and deepcopy, as to other processes."""

import copy
import pickle
from dataclasses import fields

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
    SolveError,
    SolverUnavailableError,
    Traction,
    discretize,
    limit_load_factor,
    load_problem,
    solve,
    solve_companion,
    solve_history,
)
from qvi_contact.bracket import bracket
from qvi_contact.discretization.elimination import UnbalancedLoadError
from qvi_contact.gallery import compressed_plate
from qvi_contact.verification.verification import verify_result
from solvers.factorisation import FactorisationError


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
    for energy in fields(result.energies):  # sums depend on where arrays lie in memory, to their last digit
        value = getattr(result.energies, energy.name)
        assert getattr(again.energies, energy.name) == pytest.approx(value, rel=0.0, abs=1e-12 * result.energies.strain)
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


COPIES = [through_pickle, copy.deepcopy, copy.copy]


@pytest.mark.parametrize("copied", COPIES)
def test_limit_loads_and_their_mechanisms(copied, pytestconfig):
    block = load_problem(pytestconfig.rootpath / "examples" / "dragged_block_slides.toml").problem
    limit = limit_load_factor(block, ["drag"])
    again = copied(limit)
    assert (again.lower, again.upper, again.bound) == (limit.lower, limit.upper, limit.bound)
    assert again.mechanism.works == limit.mechanism.works
    assert again.mechanism.contacts["base"] == limit.mechanism.contacts["base"]
    with pytest.raises(TypeError):
        again.mechanism.works["drag"] = 0.0


@pytest.mark.parametrize("copied", COPIES)
def test_displacements_and_bounds(copied):
    plate = compressed_plate(0.2, (2, 2))
    companion, between = solve_companion(plate), bracket(solve(plate))
    force = companion.contacts["plate"].normal_force  # remembered
    assert copied(companion).contacts["plate"].normal_force == pytest.approx(force, rel=1e-12)
    assert copied(between).lower == between.lower


@pytest.mark.parametrize("copied", COPIES)
@pytest.mark.parametrize(
    "error",
    [
        InputError("mesh", 3, "give a mesh"),
        InputError("mesh", lambda x: x, "give a mesh"),
        SolverUnavailableError("inner", "qp:none", "there is none"),
        SolveError("stalled"),
        FactorisationError("singular", "superlu", "a pivot is zero"),
        UnbalancedLoadError(0.25),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_come_back_from_other_processes(error, copied):
    again = copied(error)
    assert type(again) is type(error)
    assert str(again) == str(error)
    for name in ("field", "remedy", "reason", "backend", "imbalance"):
        assert getattr(again, name, None) == getattr(error, name, None)
