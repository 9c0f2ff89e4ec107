"""Which factorisation a solve gets, and what becomes of one that fails."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    RectilinearMesh,
    Symmetry,
    Traction,
    discretize,
    solve,
)
from qvi_contact.gallery import compressed_plate, ssnv128
from solvers import FrictionQVI, InputError, Status, solve_qvi
from solvers.errors import SolverUnavailableError
from solvers.factorisation import available_backends, choice, registry, set_default
from solvers.factorisation.choice import SHARED, Request
from solvers.factorisation.levels import LEVELS
from solvers.solve import METHODS
from tests.solvers.conftest import random_problem

BACKENDS = list(available_backends())
pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # "shared-subdomains" belongs to rectangles

PROBLEMS = {"plate": lambda: compressed_plate(0.2, (12, 12)), "ssnv128": lambda: ssnv128((8, 8))}


@pytest.fixture(autouse=True)
def _no_choice(monkeypatch):
    monkeypatch.delenv(registry.VARIABLE, raising=False)
    set_default(None)
    yield
    set_default(None)


def tractions(result):
    return np.concatenate([np.r_[line.normal_stress, line.tangential_stress] for line in result.contacts.values()])


@pytest.mark.parametrize("name", [*BACKENDS, LEVELS, SHARED])
@pytest.mark.parametrize("problem", PROBLEMS)
def test_every_factorisation_gives_the_same_certified_answer(problem, name):
    reference = tractions(solve(PROBLEMS[problem](), factorisation="superlu"))
    result = solve(PROBLEMS[problem](), factorisation=name.upper())
    assert result.status is Status.SOLVED
    assert result.solution.factorisation.startswith(f"{name}, ")
    assert tractions(result) == pytest.approx(reference, abs=1e-8 * np.abs(reference).max())


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", [*BACKENDS, LEVELS, SHARED])
def test_every_method_takes_it(method, name):
    problem = compressed_plate(0.2, (2, 2))
    result = solve(problem, method=method, factorisation=name, tolerance=1e-6)
    assert result.status is Status.SOLVED
    assert result.solution.factorisation.startswith(f"{name}, ")


def test_one_discretisation_is_factorised_again_when_asked():
    discretization = discretize(compressed_plate(0.2, (3, 3)))
    for name in [*BACKENDS, SHARED, *BACKENDS]:
        assert solve(discretization, factorisation=name).solution.factorisation.startswith(name)
    kept = discretization.qvi.equality_system
    solve(discretization)
    assert discretization.qvi.equality_system is kept  # "auto" is content with what there is


@pytest.mark.parametrize("name", ["mumps", "", "qr", "none", 3])
def test_unknown_names_list_what_there_is(name):
    with pytest.raises(SolverUnavailableError, match=r"factorisation.*auto, shared-subdomains, levels") as caught:
        solve(compressed_plate(0.2), factorisation=name)
    assert caught.value.field == "factorisation"


def test_a_back_end_that_is_not_installed_is_named(monkeypatch):
    from solvers.factorisation import cholmod

    monkeypatch.setattr(cholmod, "version", lambda: None)
    with pytest.raises(SolverUnavailableError, match=r"pip install 'qvi-contact\[cvxopt\]'"):
        solve(compressed_plate(0.2), factorisation="cholmod")


@pytest.mark.parametrize("option", ["method", "inner"])
@pytest.mark.parametrize("name", ["", 3, b"uzawa", ["condensed"], np.array([1.0, 2.0]), np.array("qp:clarabel")])
def test_what_is_no_name_of_a_method_or_inner_solver_is_refused(option, name):
    for given in (compressed_plate(0.2), discretize(compressed_plate(0.2)).qvi):
        with pytest.raises(SolverUnavailableError) as caught:
            (solve_qvi if isinstance(given, FrictionQVI) else solve)(given, **{option: name})
        assert caught.value.field == option


def l_shape():
    mesh = RectilinearMesh([0, 1, 2, 3], [0, 1, 2, 3], np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool))
    mesh = mesh.with_edges("roof", "top", at=3.0).with_edges("ledge", "top", at=1.0)
    free = [Traction(side, 0.0, 0.0) for side in ("right", "ledge")]
    return ContactProblem(
        mesh, Material(1000.0, 0.3), [Symmetry("left"), *free, Contact("bottom", 0.3), Displacement("roof", 0.0, -1e-3)]
    )


@pytest.mark.parametrize(
    "problem", [l_shape, lambda: compressed_plate(0.2, (4, 4), grading=0.9)], ids=["L-shape", "graded"]
)
def test_subdomains_that_cannot_be_shared(problem):
    with pytest.raises(InputError, match="equal cells and one material") as caught:
        solve(problem(), factorisation=SHARED)
    assert caught.value.field == "factorisation"
    assert solve(problem()).status is Status.SOLVED


def test_environment_variable_and_default(monkeypatch):
    monkeypatch.setenv(registry.VARIABLE, "SuperLU")
    assert solve(compressed_plate(0.2)).solution.factorisation.startswith("superlu, scipy")
    for name in BACKENDS:
        set_default(name)  # goes before the environment
        assert solve(compressed_plate(0.2)).solution.factorisation.startswith(name)
        assert solve(compressed_plate(0.2), factorisation="superlu").solution.factorisation.startswith("superlu")
    set_default(None)
    monkeypatch.setenv(registry.VARIABLE, "mumps")
    with pytest.raises(InputError, match=r"QVI_CONTACT_FACTORISATION.*choose one of"):
        solve(compressed_plate(0.2))


def test_large_uniform_plates_share_their_subdomains_unless_told_otherwise(monkeypatch):
    monkeypatch.setattr(choice, "_WORTH_SHARING", 100)
    assert solve(compressed_plate(0.2, (8, 8))).solution.factorisation.startswith(SHARED)
    assert not solve(compressed_plate(0.2, (4, 4))).solution.factorisation.startswith(SHARED)
    set_default("superlu")
    assert solve(compressed_plate(0.2, (8, 8))).solution.factorisation.startswith("superlu")


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2", np.nan])
def test_threads_are_a_number(threads):
    with pytest.raises(InputError, match="threads") as caught:
        solve(compressed_plate(0.2), threads=threads)
    assert caught.value.field == "threads"


@pytest.mark.parametrize("threads", [1, 2, None])
def test_threads_change_nothing(threads):
    one = tractions(solve(compressed_plate(0.2, (8, 8)), threads=1))
    found = solve(compressed_plate(0.2, (8, 8)), threads=threads)
    assert tractions(found) == pytest.approx(one, abs=1e-8 * np.abs(one).max())


def test_a_context_ends():
    """Whatever happens inside; what was made in it stays, as "auto" is content with it."""
    operator = random_problem(0, n=40).operator
    with operator.using("superlu", 1):
        assert operator._request == Request("superlu", 1)
    assert operator._request == Request()
    with pytest.raises(ZeroDivisionError), operator.using("superlu", 1):
        _ = 1 / 0
    assert operator._request == Request()


def test_problems_do_not_ask_for_each_other():
    """A solve inside the context of another one takes what it asks for itself."""
    first, second = (discretize(compressed_plate(0.2)).qvi for _ in range(2))
    with first.operator.using("superlu", 1), second.operator.using("auto", 2):
        assert first.equality_system.factor.backend == "superlu"
        assert second.equality_system.factor.backend == LEVELS


def singular():
    """K with a null vector that no equation holds; its diagonal is positive."""
    return FrictionQVI(
        K=csc_array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), f=np.ones(3), N=[[0.0, 0.0, -1.0]],
        n0=[0.0], T=[[0.0, 0.0, 1.0]], t0=[0.0], mu=[0.3], W=[1.0],
    )  # fmt: skip


@pytest.mark.parametrize("name", [*BACKENDS, "auto"])
@pytest.mark.parametrize("method", [None, *METHODS])
def test_a_singular_matrix_is_a_status(method, name):
    solution = solve_qvi(singular(), method=method, factorisation=name)
    assert solution.status is Status.ILL_CONDITIONED
    assert "fix the free modes" in solution.message
    assert np.isnan(solution.z).all()
    assert solution.certificate.accuracy == np.inf


@pytest.mark.parametrize("name", BACKENDS)
@pytest.mark.parametrize("method", [None, *METHODS])
def test_lack_of_memory_is_a_status(monkeypatch, method, name):
    def full(*_):
        raise MemoryError

    monkeypatch.setattr(registry._module(name), "factorise", full)
    solution = solve_qvi(discretize(compressed_plate(0.2)).qvi, method=method, factorisation=name)
    assert solution.status is Status.OUT_OF_MEMORY
    assert name in solution.message
    assert "fewer cells" in solution.message


@pytest.mark.parametrize("name", BACKENDS)
def test_lack_of_memory_in_mechanics(monkeypatch, name):
    def full(*_):
        raise MemoryError

    monkeypatch.setattr(registry._module(name), "factorise", full)
    result = solve(compressed_plate(0.2), factorisation=name)
    assert result.status is Status.OUT_OF_MEMORY
    assert "fewer cells" in result.message


@pytest.mark.parametrize(
    "place", ["solvers.inequality.interface.trace_coordinates", "solvers.inequality.linear.cho_factor"]
)
def test_lack_of_memory_outside_the_factorisation(monkeypatch, place):
    """The dense algebra on the contact needs memory as well."""

    def full(*_, **__):
        raise MemoryError

    monkeypatch.setattr(place, full)
    assert solve_qvi(random_problem(0, n=40), method="condensed").status is Status.OUT_OF_MEMORY
