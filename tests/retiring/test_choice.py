"""Which factorisation a solve gets, and what becomes of one that fails."""

import numpy as np
import pytest

from qvi_contact import (
    discretize,
    solve,
)
from qvi_contact.gallery import compressed_plate, ssnv128
from solvers import Status
from solvers.factorisation import available_backends, choice, registry, set_default
from solvers.factorisation.choice import SHARED
from solvers.factorisation.levels import LEVELS
from solvers.solve import METHODS

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


def test_large_uniform_plates_share_their_subdomains_unless_told_otherwise(monkeypatch):
    monkeypatch.setattr(choice, "_WORTH_SHARING", 100)
    assert solve(compressed_plate(0.2, (8, 8))).solution.factorisation.startswith(SHARED)
    assert not solve(compressed_plate(0.2, (4, 4))).solution.factorisation.startswith(SHARED)
    set_default("superlu")
    assert solve(compressed_plate(0.2, (8, 8))).solution.factorisation.startswith("superlu")
