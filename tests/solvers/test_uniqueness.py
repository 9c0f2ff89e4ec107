"""The sufficient bound of friction: exact values, and never exceeded by the map it bounds."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import eye_array, vstack

from qvi_contact import discretize
from qvi_contact.gallery import compressed_plate
from solvers import FrictionQVI, solve_qvi
from solvers.certificate import LARGEST, uniqueness_bound
from tests.solvers.conftest import changed, one_contact, random_problem, two_contacts


def independent_problem(seed, m=4, friction=0.3):
    """2m unknowns, the tractions themselves, with random compliance, weights and loads."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(2 * m, 2 * m))
    return FrictionQVI.from_arrays(
        K=root @ root.T + np.eye(2 * m), f=4.0 * random.normal(size=2 * m), N=np.eye(2 * m)[:m], n0=np.full(m, -0.5),
        T=np.eye(2 * m)[m:], t0=np.zeros(m), mu=np.full(m, friction), W=random.uniform(0.2, 2.0, m),
    )  # fmt: skip


def normal_traction(qvi, pressure):
    """σ_N of the problem for a given bound mu s."""
    given_bound = qvi.with_bound(qvi.mu * pressure)
    solution = solve_qvi(given_bound, tolerance=1e-9)
    assert solution.solved
    return qvi.normal(solution.z)


def test_one_contact_by_hand():
    """W = [[1, c], [c, 1]]: κ = (1 + c)/(1 − c); λ_max(Ĉ_NN) = 1/(1 − c²), λ_max(𝒲_TT) = 1."""
    found = uniqueness_bound(one_contact(2.0, coupling=0.8))
    assert found.friction == 2.0
    assert found.bound == pytest.approx(1.0 / 3.0, rel=1e-12)
    assert found.sharper == pytest.approx(0.6, rel=1e-12)
    assert found.independent
    assert not found.satisfied
    below = uniqueness_bound(one_contact(0.55, coupling=0.8))
    assert below.proves
    assert below.sentence() != found.sentence()
    soft = changed(one_contact(), K=np.array([[1.0, 0.8], [0.8, 4.0]]))  # det 3.36: 4 / 3.36 and 4 in place of these
    assert uniqueness_bound(soft).sharper == pytest.approx(np.sqrt(3.36) / 4.0, rel=1e-12)
    apart = uniqueness_bound(two_contacts())  # K = 1, weights 0.5 and 2: Ĉ = W, κ = 4
    assert (apart.bound, apart.sharper) == pytest.approx((0.5, 0.5), rel=1e-12)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), other=st.integers(0, 10**6), friction=st.floats(0.01, 2.0))
def test_the_map_is_lipschitz_with_the_constant_claimed(seed, other, friction):
    qvi, random = independent_problem(seed % 50, friction=friction), np.random.default_rng([seed, other])
    found = uniqueness_bound(qvi)
    assert found.bound <= found.sharper * (1.0 + 1e-12)
    first, second = random.uniform(0.0, 3.0, (2, qvi.m))
    moved = normal_traction(qvi, first) - normal_traction(qvi, second)
    length = np.sqrt(qvi.W @ moved**2)
    assert length <= friction / found.sharper * np.sqrt(qvi.W @ (first - second) ** 2) + 1e-5


def test_invariant_to_units_and_unknowns():
    qvi = independent_problem(3)
    plain, random = uniqueness_bound(qvi), np.random.default_rng(0)
    mixed = random.normal(size=(qvi.n, qvi.n))
    other = FrictionQVI.from_arrays(
        K=7.0 * mixed.T @ (qvi.K @ mixed), f=mixed.T @ qvi.f, N=1e3 * qvi.N @ mixed, n0=qvi.n0, T=1e3 * qvi.T @ mixed,
        t0=qvi.t0, mu=qvi.mu, W=1e-4 * qvi.W,
    )  # fmt: skip
    found = uniqueness_bound(other)
    assert found.bound == pytest.approx(plain.bound, rel=1e-8)
    assert found.sharper == pytest.approx(plain.sharper, rel=1e-8)


def test_equalities_restrict_the_compliance():
    """A z = 0 on one unknown is the problem without it, and its trace is none."""
    qvi = independent_problem(5, m=2)
    row = np.zeros((1, qvi.n))
    row[0, 0] = 1.0
    found = uniqueness_bound(replace(qvi, contact=replace(qvi.contact, A=row), loads=replace(qvi.loads, b=np.zeros(1))))
    weights = np.sqrt(np.concatenate([qvi.W, qvi.W]))[1:]
    inner = np.linalg.inv(qvi.K.toarray()[1:, 1:]) * weights * weights[:, None]
    values = np.linalg.eigvalsh(inner)
    assert found.bound == pytest.approx(np.sqrt(values[0] / values[-1]), rel=1e-9)
    assert not found.independent


def test_dependent_rows_prove_nothing_at_points():
    qvi = independent_problem(0, friction=1e-3)
    twice = {name: np.concatenate([getattr(qvi, name)] * 2) for name in ("n0", "t0", "mu", "W")}
    found = uniqueness_bound(FrictionQVI.from_arrays(qvi.K, qvi.f, vstack([qvi.N] * 2), T=vstack([qvi.T] * 2), **twice))
    assert found.satisfied
    assert not found.proves
    assert not found.independent


@pytest.mark.parametrize("cells", [4, 8])
def test_the_bound_falls_like_the_root_of_the_mesh_width(cells):
    coarse, fine = (uniqueness_bound(discretize(compressed_plate(0.2, (n, n))).qvi) for n in (cells, 2 * cells))
    assert coarse.bound / fine.bound == pytest.approx(np.sqrt(2.0), rel=0.06)


def test_without_a_moving_bound_the_stress_is_unique():
    for changes in ({"mu": np.zeros(8)}, {"cap": np.zeros(8)}):
        found = uniqueness_bound(changed(random_problem(0), **changes))
        assert found.proves
        assert found.bound == np.inf


def test_large_contacts_say_why_there_is_none():
    m = LARGEST // 2 + 1
    rows, zeros = eye_array(2 * m).tocsr(), np.zeros(m)
    qvi = FrictionQVI.from_arrays(
        K=eye_array(2 * m), f=np.ones(2 * m), N=rows[:m], n0=zeros, T=rows[m:], t0=zeros, mu=zeros + 0.3, W=zeros + 1.0
    )
    found = uniqueness_bound(qvi)
    assert found.bound is found.sharper is None
    assert not found.satisfied
    assert f"{2 * m} contact rows" in found.sentence()
