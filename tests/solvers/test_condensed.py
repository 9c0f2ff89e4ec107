"""The condensed method on algebraic problems, on the contact and in all unknowns: what it solves, how accurately."""

import copy
import pickle
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.linalg.lapack import dgetrf
from scipy.sparse import csc_array, eye_array

from solvers import FrictionQVI, Status, Stiffness, solve_qvi
from solvers.condensed import FRICTION_SHARES
from solvers.factorisation import available_backends, set_default
from solvers.inequality import TractionFactor
from tests.cases import every_pair, thinned
from tests.solvers.conftest import LAWS, Root, chain, one_contact, random_problem
from tests.solvers.test_laws import violations


def difference(qvi, one, other):
    """Largest difference of tractions, relative to the largest traction."""
    first, second = (np.concatenate([qvi.normal(s.z), qvi.tangential(s.z)]) for s in (one, other))
    return np.abs(first - second).max() / np.abs(second).max()


def condensed(qvi, **options):
    solution = solve_qvi(qvi, method="condensed", **options)
    assert solution.status is Status.SOLVED, solution.message
    assert solution.method == solution.form == "condensed"
    return solution


@pytest.mark.parametrize(
    ("law", "seed", "inner"), thinned(every_pair(list(LAWS), range(4), ["direct:clarabel", "qp:daqp"]), 8)
)
def test_lines_of_contact_agree_with_the_fixed_point(law, seed, inner):
    qvi = chain(seed, **LAWS[law])
    found = condensed(qvi)
    reference = solve_qvi(qvi, inner=inner, tolerance=1e-9)
    assert reference.solved
    assert found.iterations <= (50 if law != "bilateral" else 100)  # one of them turns on its path
    assert difference(qvi, found, reference) < 1e-7
    for name, values in violations(qvi, found).items():
        assert values.max(initial=0.0) < 1e-8, name


@pytest.mark.parametrize(
    ("seed", "friction", "equalities"), thinned(product((0, 1, 7, 11, 20), (0.0, 0.05, 0.2), (0, 2)), 6)
)
def test_dense_rows_that_cancel(seed, friction, equalities):
    """More rows than unknowns, all of them dense: nearly every unknown is held by active bounds."""
    qvi = random_problem(seed, friction, equalities)
    reference = solve_qvi(qvi, inner="direct:clarabel", tolerance=1e-9)
    assert reference.solved
    assert difference(qvi, condensed(qvi), reference) < 1e-7


def test_not_unique_returns_one_of_the_three(nonunique):
    solution = condensed(nonunique)
    known = [(0.0, 0.0), (1.8888888888888889, -3.6111111111111111), (5.0 / 3.0, -10.0 / 3.0)]
    assert min(np.abs(solution.z - point).max() for point in known) < 1e-8
    assert "unique" not in solution.message


@pytest.mark.parametrize("load", [(1.0, 2.1), (1.0, 3.0), (0.5, -2.0), (-1.0, -2.0), (-1.0, 0.3)])
@pytest.mark.parametrize("friction", [0.0, 0.5, 1.0, 2.0, 5.0])
def test_one_contact_always_has_a_certified_answer(friction, load):
    """|coupling| < 1 and mu of any size: a solution exists, since a stuck, slipping or open one always does."""
    condensed(one_contact(friction, load))


def rooted(seed, spoilt, **law):
    """A line of contact with a root; K and f wrong by the relative size `spoilt`, root and load exact."""
    qvi = chain(seed, **law)
    random = np.random.default_rng(1000 + seed)
    R = np.linalg.cholesky(qvi.K.toarray()).T
    r0 = 0.1 * random.normal(size=len(R))
    error = np.triu(random.uniform(-spoilt, spoilt, R.shape))
    wrong = qvi.K.toarray() * (1.0 + error + np.triu(error, 1).T)
    f = qvi.f * (1.0 + random.uniform(-spoilt, spoilt, len(qvi.f)))
    root = Root(R, r0)
    loads = replace(qvi.loads, f=f, root=root, load=qvi.f + R.T @ r0)
    return replace(qvi, stiffness=Stiffness(csc_array(wrong), root), loads=loads)


@pytest.mark.parametrize("law", ["coulomb", "opening", "cap", "bilateral", "equations"])
@pytest.mark.parametrize("spoilt", [1e-6, 1e-4])
def test_defect_corrections_remove_errors_of_the_matrix(law, spoilt):
    exact = condensed(chain(3, **LAWS[law]), gap=1e-15)
    found = condensed(rooted(3, spoilt, **LAWS[law]), gap=1e-15)
    assert np.linalg.norm(found.z - exact.z) < 1e-10 * np.linalg.norm(exact.z)
    assert 1e-3 * spoilt < found.corrections[0] < 100.0 * spoilt
    assert all(later < 0.1 * former for former, later in zip(found.corrections, found.corrections[1:], strict=False))
    assert len(found.corrections) >= 2
    assert condensed(rooted(3, 0.0, **LAWS[law])).corrections[0] < 1e-12


@pytest.mark.parametrize("method", ["condensed", "fixed-point", None])
def test_a_matrix_too_wrong_is_no_answer(method):
    """Errors of a third in K: solved with the root's own factors, or a status; never wrong."""
    exact = condensed(chain(3))
    solution = solve_qvi(rooted(3, 0.3), method=method)
    if solution.status is Status.SOLVED:
        assert np.linalg.norm(solution.z - exact.z) < 1e-6 * np.linalg.norm(exact.z)
    else:
        assert solution.status in (Status.ILL_CONDITIONED, Status.STALLED, Status.INACCURATE)


def close_rows(seed, close, groups=4):
    """Three normal tractions each that depend on each other: the third is the difference of two nearly equal ones.

    Coordinates are the first two. In them the third has terms of 1/close that cancel, and a rounding of that size.
    """
    random = np.random.default_rng(seed)
    m, n = 3 * groups, 5 * groups
    N, T = np.zeros((m, n)), np.zeros((m, n))
    for g in range(groups):
        N[3 * g, 5 * g] = N[3 * g + 1, 5 * g] = N[3 * g + 2, 5 * g + 1] = 1.0
        N[3 * g + 1, 5 * g + 1] = close
        T[3 * g + np.arange(3), 5 * g + 2 + np.arange(3)] = 1.0
    root = np.eye(n) + 0.15 * random.normal(size=(n, n))
    f = 2.0 * random.normal(size=n)
    f[0::5] -= 3.0
    f[1::5] = random.choice([-2.0, 2.0], groups)
    return FrictionQVI.from_arrays(
        K=root.T @ root, f=f, N=N, n0=np.zeros(m), T=T, t0=np.zeros(m), mu=np.full(m, 0.3), W=np.full(m, 1.0 / m),
        traces=TractionFactor(csc_array(np.vstack([N, T])), csc_array(np.eye(2 * m))),
    )  # fmt: skip


@pytest.mark.parametrize("seed", [2, 5, 6, 12, 13, 23])
@pytest.mark.parametrize("close", [1e-3, 1e-4])
def test_rounding_of_the_slacks_is_no_residual(close, seed):
    """Up to 1e-11 of the tractions: an error that no iteration can remove, nor has to."""
    assert condensed(close_rows(seed, close)).iterations < 60


def bilateral_pair(load, mu):
    """Two uncoupled bilateral points with the loads (σ_N, σ_T) each."""
    return FrictionQVI.from_arrays(
        K=np.eye(4), f=load, N=-np.eye(4)[[0, 2]], n0=np.zeros(2), T=np.eye(4)[[1, 3]], t0=np.zeros(2),
        mu=np.full(2, mu), W=np.array([0.5, 2.0]), bilateral=np.full(2, True),
    )  # fmt: skip


@pytest.mark.parametrize("mu", [0.3, 3.0])
@pytest.mark.parametrize("normal", [0.0, 1e-9, -1e-5])
@pytest.mark.parametrize("shear", [0.0, 1.0])
def test_bilateral_points_at_the_kink(normal, shear, mu):
    """A point without pressure has no friction, and the other one all the same."""
    found = condensed(bilateral_pair(np.array([2.0, 3.0, normal, shear]), mu))
    expected = [2.0, min(3.0, 2.0 * mu), normal, min(shear, mu * abs(normal))]
    assert found.z == pytest.approx(expected, abs=3e-9)
    assert found.iterations < 60


def test_energies_of_the_history_are_those_of_the_problem():
    """From the first iteration on: S y + c = 0 has its minimum where the energy has it."""
    qvi = chain(3)
    solution = condensed(qvi)
    energies = np.array([entry.energy for entry in solution.history])
    assert energies[-1] == pytest.approx(qvi.energy(solution.z), rel=1e-8)
    near = int(np.argmax([entry.residual < 1e-4 for entry in solution.history]))
    assert near < len(energies) - 3
    assert energies[near] == pytest.approx(energies[-1], rel=1e-2)


UNSYMMETRIC = [name for name in ("pardiso", "superlu") if name in available_backends()]
POSED = [law for law in LAWS if law not in ("frictionless", "equations")]


def solved(qvi, system, **options):
    solution = solve_qvi(qvi, method="condensed", system=system, **options)
    assert solution.solved, solution.message
    return solution


@pytest.mark.parametrize(("law", "seed"), [*((law, 0) for law in POSED), ("coulomb", 1), ("cap", 1)])
def test_both_systems_find_the_same(law, seed):
    qvi = chain(seed, **LAWS[law])
    sparse, dense = (solved(qvi, system) for system in ("sparse", "dense"))
    assert (sparse.form, dense.form) == ("full", "condensed")
    assert difference(qvi, sparse, dense) < 1e-9


@pytest.mark.parametrize(("law", "word"), [("frictionless", "points without friction"), ("equations", "equations")])
def test_what_needs_dense_systems_gets_them_and_says_why(law, word):
    qvi = chain(0, **LAWS[law])
    found = solved(qvi, "sparse")
    assert found.form == "condensed"
    assert word in found.message
    assert word not in solved(qvi, "auto").message


def test_points_may_link_unknowns_that_k_does_not():
    """A diagonal K: its pattern has no place for the blocks of contact points."""
    random = np.random.default_rng(3)
    n, m = 12, 5
    N, T = (random.normal(size=(m, n)) * (random.random((m, n)) < 0.4) for _ in range(2))
    qvi = FrictionQVI.from_arrays(
        K=eye_array(n), f=random.normal(size=n), N=N, n0=np.full(m, -0.5), T=T, t0=0.3 * random.normal(size=m),
        mu=np.full(m, 0.4), W=np.full(m, 0.2),
    )  # fmt: skip
    assert difference(qvi, solved(qvi, "sparse"), solved(qvi, "dense")) < 1e-9


@pytest.mark.parametrize("backend", UNSYMMETRIC)
def test_either_library_serves(backend):
    qvi = chain(0)
    reference = solved(qvi, "dense")
    set_default(backend)
    try:
        found = solved(copy.deepcopy(qvi), "sparse")
    finally:
        set_default(None)
    assert found.factorisation.startswith(backend)
    assert difference(qvi, found, reference) < 1e-10


def test_places_change_the_order_only():
    qvi = chain(0)
    places = np.random.default_rng(0).normal(size=(qvi.n, 2))
    placed = replace(qvi, stiffness=Stiffness(qvi.K, places=places))
    again = pickle.loads(pickle.dumps(placed))
    assert difference(qvi, solved(again, "sparse"), solved(placed, "sparse")) == 0.0
    assert difference(qvi, solved(placed, "sparse"), solved(qvi, "sparse")) < 1e-10


def test_where_newton_matrices_are_singular_other_starts_follow(monkeypatch):
    """The best of all starts is kept: here the first, as all others have singular matrices at once."""
    qvi = chain(0, **LAWS["coulomb"])
    reference, made = condensed(qvi), []

    def singular(matrix, **options):
        made.append(matrix)
        factor, pivots, info = dgetrf(matrix, **options)
        return factor, pivots, 1 if len(made) in calls else info

    monkeypatch.setattr("solvers.condensed.systems.dgetrf", singular)
    accuracies = []
    for calls in (range(2, 100), range(4, 100)):
        made.clear()
        found = solve_qvi(qvi, method="condensed")
        assert len(made) == calls.start + len(FRICTION_SHARES)  # the first of the others is near the bonded state
        assert not found.solved
        accuracies.append(found.certificate.accuracy)
    assert 1e-8 < accuracies[1] < 0.5 * accuracies[0]
    made.clear()
    calls = (3,)
    found = condensed(qvi)
    assert found.iterations > reference.iterations
    assert difference(qvi, found, reference) < 1e-7
