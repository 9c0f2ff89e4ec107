"""The condensed method in all unknowns: the same answers, the same Newton matrices, and where it is taken."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csc_array, eye_array, random_array

from solvers import FrictionQVI, solve_qvi
from solvers.condensed import whole as whole_module
from solvers.condensed.complementarity import Complementarity
from solvers.condensed.interior_point import InteriorPoint, Step
from solvers.condensed.systems import Shares
from solvers.condensed.whole import Whole
from solvers.errors import InputError
from solvers.factorisation import FactorisationError, available_backends, set_default
from solvers.factorisation.choice import condensing_pays
from solvers.factorisation.unsymmetric import refactorisation
from tests.solvers.conftest import random_problem, two_contacts
from tests.solvers.test_condensed import LAWS, chain, difference

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


def test_an_unknown_system_is_refused():
    with pytest.raises(InputError) as error:
        solve_qvi(chain(0), system="wide")
    assert error.value.field == "system"


def posed(qvi):
    whole = Whole(qvi)
    return whole, Complementarity(qvi, whole, whole.base(np.zeros(qvi.n)), 1.0)


@pytest.mark.parametrize("law", POSED)
def test_newton_matrices_are_those_of_the_bounds(law):
    """H x for a force on x by itself, and the traces of the solution beside it."""
    qvi = chain(1, **LAWS[law])
    _, problem = posed(qvi)
    random = np.random.default_rng(2)
    ratio = 10.0 ** random.uniform(-3.0, 3.0, len(problem.weights))
    slope = random.uniform(-1.0, 1.0, len(problem.split))
    n, unit = qvi.n, 1.0 / np.sqrt(qvi.K.diagonal())
    C = problem.slack_rows(slope).toarray()[:, n:]
    B, Y = problem.B.toarray()[:, n:], qvi.contact_rows.toarray() * unit
    H = qvi.K.toarray() * unit * unit[:, None] + (B @ Y).T @ ((problem.weights * ratio)[:, None] * (C @ Y))
    force = np.concatenate([random.normal(size=n), np.zeros(2 * qvi.m)])
    found = problem.system.factorised(problem, ratio, slope)(force)
    assert H @ found[:n] == pytest.approx(force[:n], abs=1e-9 * np.abs(H).max())
    assert found[n:] == pytest.approx(Y @ found[:n], abs=1e-12 * np.abs(found).max())


@pytest.mark.parametrize(("share", "length", "kept"), [(0.05, 0.99, 0.3), (0.0, 0.0495, 1.0 - 20.0 * 0.0495)])
def test_few_bounds_do_not_hold_up_the_others(share, length, kept, monkeypatch):
    """Every bound falls by its size in a step of one; one of them by twenty times that."""
    _, problem = posed(chain(1))
    interior = InteriorPoint(problem, 1.0)
    monkeypatch.setattr(problem.system, "stragglers", share, raising=False)
    interior.settle()
    before = interior.point
    fall = before.s.copy()
    fall[0] *= 20.0
    step = Step(np.ones_like(before.y), -fall, 0.0 * before.lam, 0.0 * before.pull, 0.0 * before.push)
    found = interior._past_few(step, 0.0495)
    assert found == pytest.approx(length)
    assert interior.point.s[0] == pytest.approx(kept * before.s[0])
    assert interior.point.y == pytest.approx(before.y + length)


@pytest.mark.parametrize(("growth", "expected"), [(1.0, 0.99), (1e4, 0.99 / 16.0)])
def test_passing_few_bounds_does_not_open_the_gap(growth, expected, monkeypatch):
    """One slack falls below zero, and its multiplier grows; the step is halved until τ has not doubled."""
    _, problem = posed(chain(1))
    interior = InteriorPoint(problem, 1.0)
    interior.settle()
    monkeypatch.setattr(problem.system, "stragglers", 0.05, raising=False)
    point, before = interior.point, interior.parameter()
    s, lam = -point.s, 0.0 * point.lam
    s[0] *= 200.0
    lam[0] = growth * point.lam[0]
    found = interior._past_few(Step(0.0 * point.y, s, lam, 0.0 * point.pull, 0.0 * point.push), 0.00495)
    assert found == pytest.approx(expected)
    assert interior.parameter() <= 2.0 * before


@pytest.mark.parametrize(("share", "misfit", "expected"), [(0.05, 1e-6, 30.0), (0.05, 1e-12, 1.0), (0.0, 1e-6, 1.0)])
def test_the_parameter_waits_for_bounds_that_were_passed(share, misfit, expected, monkeypatch):
    """Nothing is passed any more where it is least; times that value, or what it is if that is less."""
    _, problem = posed(chain(1))
    interior = InteriorPoint(problem, 1.0)
    monkeypatch.setattr(problem.system, "stragglers", share, raising=False)
    interior.settle()
    residuals = interior.residuals()
    residuals = residuals._replace(slack=0.0 * residuals.slack + misfit * problem.stress_at(interior.point.y))
    interior.measures(residuals)
    for tau, lowest in ((1e3, expected), (1.0, 1.0)):
        assert interior._lowest(residuals, tau * interior.least) / interior.least == pytest.approx(lowest)


@pytest.mark.parametrize("law", ["coulomb", "cap", "bilateral"])
def test_friction_has_another_share_once_slacks_fit(law):
    """Products start on the path of the early one; what kinks aim at stays."""
    qvi = chain(1, **LAWS[law])
    whole = Whole(qvi)
    problem = Complementarity(qvi, whole, whole.base(np.zeros(qvi.n)), 1.0, Shares(2.0, 50.0))
    interior = InteriorPoint(problem, 1.0)
    count, early, before = len(problem.shares), interior.shares.copy(), interior.parameter()
    assert set(early[:count]) == ({1.0, 2.0} if law != "bilateral" else {2.0})
    assert problem.weights @ (interior.point.s * interior.point.lam - before * early[:count]) == pytest.approx(0.0)
    for _ in range(2):
        interior.settle()
        after = interior.parameter()
        assert interior.shares[:count] == pytest.approx(np.where(early[:count] == 2.0, 50.0, 1.0))
        assert after * interior.shares[count:] == pytest.approx(before * early[count:])


@pytest.mark.parametrize("seed", [0, 3, 4, 7, 10])
def test_large_friction_on_dense_rows_takes_no_more_iterations_than_small(seed):
    """With one share from start to end of 1000 these took 76 to 497 iterations, or found nothing."""
    qvi = random_problem(seed, 1.8)
    for system in ("dense", "sparse"):
        assert solved(qvi, system).iterations <= 30


def test_points_may_link_unknowns_that_k_does_not():
    """A diagonal K: its pattern has no place for the blocks of contact points."""
    random = np.random.default_rng(3)
    n, m = 12, 5
    N, T = (random.normal(size=(m, n)) * (random.random((m, n)) < 0.4) for _ in range(2))
    qvi = FrictionQVI(
        K=eye_array(n), f=random.normal(size=n), N=N, n0=np.full(m, -0.5), T=T, t0=0.3 * random.normal(size=m),
        mu=np.full(m, 0.4), W=np.full(m, 0.2),
    )  # fmt: skip
    assert difference(qvi, solved(qvi, "sparse"), solved(qvi, "dense")) < 1e-9


def test_each_contact_is_a_whole_of_its_own():
    """One point each of two bodies, with three bounds; a chain of equal points."""
    line = chain(1)
    for qvi, share in ((two_contacts(), 1.0 / 3.0), (line, 1.0 / (3.0 * line.m))):
        assert posed(qvi)[1].least_share == pytest.approx(share)


@pytest.mark.parametrize("law", ["coulomb", "cap"])
def test_large_problems_start_near_the_bonded_solution(law, monkeypatch):
    """Multipliers are a fiftieth, and the end is the same; the other start comes next."""
    qvi = chain(0, **LAWS[law])
    usual, lam = solved(qvi, "sparse"), first_multipliers(qvi)
    monkeypatch.setattr(whole_module, "_NEAR_FROM", 0)
    assert first_multipliers(qvi) == pytest.approx(0.02 * lam)
    assert first_multipliers(qvi, 1) == pytest.approx(lam)
    assert difference(qvi, solved(qvi, "sparse"), usual) < 1e-9


def first_multipliers(qvi, start=0):
    """λ at the start of that number."""
    space = Whole(qvi)
    problem = Complementarity(qvi, space, space.base(np.zeros(qvi.n)), 1.0, space.shares[start])
    return InteriorPoint(problem, 1.0).point.lam


def test_norms_and_stiffness_are_those_of_the_dense_way():
    qvi = chain(2)
    whole, problem = posed(qvi)
    random = np.random.default_rng(0)
    force = problem.force(random.normal(size=len(problem.weights)))
    unit = 1.0 / np.sqrt(qvi.K.diagonal())
    f = force[: qvi.n] / unit
    assert whole.norm(force) == pytest.approx(np.sqrt(f @ np.linalg.solve(qvi.K.toarray(), f)), rel=1e-10)
    rows = qvi.contact_rows
    m = random.normal(size=2 * qvi.m)
    expected = rows @ np.linalg.solve(qvi.K.toarray(), rows.T @ m)
    plain = qvi.changed(shared=None)
    plain.operator._factor = plain.operator._made(np.zeros(0, dtype=np.int64))  # as where the contact is large
    for each, width in ((qvi, qvi.equality_system.interface.size), (plain, 0)):
        assert each.linear_system.interface.size == width
        assert each.linear_system.relief(rows)(m) == pytest.approx(expected, rel=1e-9)
    assert plain.contact_stiffness == pytest.approx(qvi.contact_stiffness, rel=1e-9)
    assert plain.equality_system.interface.size > 0  # made anew where what the contact feels is asked for


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("backend", UNSYMMETRIC)
def test_one_pattern_many_matrices(backend, ordered):
    random = np.random.default_rng(4)
    pattern = random_array((30, 30), density=0.1, rng=random)
    pattern = csc_array(abs(pattern) + abs(pattern.T) + eye_array(30)).tocsr()
    order = random.permutation(30) if ordered else None
    factor = refactorisation(pattern.indptr, pattern.indices, backend, 1, order)
    right = random.normal(size=30)
    for _ in range(3):
        matrix = pattern.copy()
        matrix.data = random.normal(size=matrix.nnz) + 8.0 * (matrix.tocoo().row == matrix.tocoo().col)
        factor.factorise(matrix.data)
        assert matrix @ factor.solve(right) == pytest.approx(right, abs=1e-12)
    factor.release()
    factor.release()
    with pytest.raises(FactorisationError):
        factor.solve(right)


@pytest.mark.parametrize("backend", UNSYMMETRIC)
def test_either_library_serves(backend):
    qvi = chain(0)
    reference = solved(qvi, "dense")
    set_default(backend)
    try:
        found = solved(qvi.changed(shared=None), "sparse")
    finally:
        set_default(None)
    assert found.factorisation.startswith(backend)
    assert difference(qvi, found, reference) < 1e-10


def test_places_change_the_order_only():
    qvi = chain(0)
    places = np.random.default_rng(0).normal(size=(qvi.n, 2))
    placed = replace(qvi, places=places, shared=None)
    assert placed.changed(mu=0.5 * qvi.mu).operator is placed.operator
    assert pickle.loads(pickle.dumps(placed.operator))._places is not None
    assert difference(qvi, solved(placed, "sparse"), solved(qvi, "sparse")) < 1e-10


@pytest.mark.parametrize("wrong", [np.zeros((1, 2)), np.zeros(4), np.nan, "here"])
def test_wrong_places_are_refused(wrong):
    qvi = chain(0)
    places = np.full((qvi.n, 2), np.nan) if wrong is np.nan else wrong
    with pytest.raises(InputError) as error:
        replace(qvi, places=places, shared=None)
    assert error.value.field == "places"


def test_the_larger_share_of_a_body_the_contact_is_the_sooner_it_is_sparse():
    """36 entries a column, as of Bogner-Fox-Schmit elements, and contacts that grow."""

    def pays(unknowns, interface):
        entries = np.arange(36 * unknowns) % unknowns
        K = csc_array((np.ones(36 * unknowns), entries, np.arange(0, 36 * unknowns + 1, 36)), (unknowns, unknowns))
        return condensing_pays(K, interface)

    assert [pays(4000, k) for k in (300, 590, 900, 5000)] == [True, True, False, False]
    assert (pays(4000, 900), pays(12000, 900)) == (False, True)
