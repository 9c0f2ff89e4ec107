"""A certificate passes on solutions and on nothing else.

Each of three solutions passes: of one contact with u = W r + q, W = [[1, 4/5], [4/5, 1]], q = (1, 21/10), μ = 2,
z = r = (p, t).
"""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import diags_array, eye_array, vstack

from solvers import Certificate, FrictionQVI, Stiffness, certify, solve_qvi
from solvers.certificate import EXPONENTS, law_residuals, scales_at, uniqueness, uniqueness_bound
from solvers.factorisation import factorise
from tests.cases import examples
from tests.solvers.conftest import Root, changed, dragged_block, one_contact, random_problem, two_contacts


@cache
def solved():
    qvi = random_problem(0)
    solution = solve_qvi(qvi, inner="direct:clarabel")
    assert solution.solved
    assert np.abs(solution.tangential_multiplier).max() > 1e-2
    assert solution.normal_multiplier.max() > 1e-2
    return qvi, [solution.z, solution.normal_multiplier, solution.tangential_multiplier]


def largest(values):
    """1 at the largest entry, 0 elsewhere."""
    return np.arange(len(values)) == np.abs(values).argmax()


WRONG = {
    "one sign of m_T": lambda z, m_N, m_T: (z, m_N, m_T * (1 - 2 * largest(m_T))),
    "all signs of m_T": lambda z, m_N, m_T: (z, m_N, -m_T),
    "sign of m_N": lambda z, m_N, m_T: (z, m_N * (1 - 2 * largest(m_N)), m_T),
    "z shifted": lambda z, m_N, m_T: (z * (1 + 1e-5 * largest(z)), m_N, m_T),
    "m_N dropped": lambda z, m_N, m_T: (z, 0 * m_N, m_T),
    "m_T dropped": lambda z, m_N, m_T: (z, m_N, 0 * m_T),
    "z zero": lambda z, m_N, m_T: (0 * z, m_N, m_T),
    "everything zero": lambda z, m_N, m_T: (0 * z, 0 * m_N, 0 * m_T),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_results_fail(what):
    qvi, parts = solved()
    assert certify(qvi, *parts).passed
    certificate = certify(qvi, *WRONG[what](*parts))
    assert not certificate.passed
    assert certificate.accuracy > 1e-7
    assert certificate.worst in certificate.summary()
    assert certificate.limits["natural_map"] == pytest.approx(1e-5)
    known = ("stationarity", "sign", "complementarity_tangential", "energy_gap", "natural_map")
    assert what != "all signs of m_T" or min(certificate.measures[name] for name in known) > 1e-2


@pytest.mark.parametrize("name", EXPONENTS)
def test_the_accuracy_is_the_smallest_tolerance_that_passes(name):
    found = Certificate({**dict.fromkeys(EXPONENTS, 0.0), name: 3e-4}, 1e-8)
    assert found.worst == name
    passed = [replace(found, tolerance=found.accuracy * share).passed for share in (1.0 - 1e-9, 1.0 + 1e-9)]
    assert passed == [False, True]


@pytest.mark.parametrize("missing", range(4))
def test_missing_or_undefined_parts_are_infinite(missing):
    qvi = random_problem(1, equalities=2)
    it = solve_qvi(qvi, inner="direct:clarabel")
    parts = [it.z, it.normal_multiplier, it.tangential_multiplier, it.equality_multiplier]
    assert certify(qvi, *parts).passed
    for nothing in (None, np.full_like(parts[missing], np.nan)):
        certificate = certify(qvi, *parts[:missing], nothing, *parts[missing + 1 :])
        assert set(certificate.measures.values()) == {np.inf}
        assert not certificate.passed


def test_a_factorisation_of_another_matrix_hides_no_error(monkeypatch):
    """K itself has a say: to a factor that is far too stiff every residual is the force of a tiny error."""
    K, rows, one = np.diag([1.0, 2.0, 1.5, 1.2]), np.eye(4)[:2], np.ones(1)
    f = np.array([-1.0, 0.4, 1.5, 1.2])
    qvi = FrictionQVI.from_arrays(
        K=K, f=f, N=rows[:1], n0=0.0 * one, T=rows[1:], t0=0.0 * one, mu=0.5 * one, W=one,
        root=Root(np.sqrt(K)), load=f,
    )  # fmt: skip
    solution = solve_qvi(qvi)
    parts = solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    wrong = solution.z + np.array([0.0, 0.0, 0.0, 1e-3])  # where the contact does not feel it
    assert certify(qvi, solution.z, *parts).passed
    monkeypatch.setattr("solvers.inequality.body.factorise", lambda K, *others: factorise(1e20 * K, *others))
    qvi = replace(qvi, stiffness=Stiffness(K))
    assert qvi.linear_system.solve(np.ones(4))[0] == pytest.approx(1e-20 / np.diag(K), rel=1e-12, abs=0.0)
    found = certify(qvi, wrong, *parts)
    assert not found.passed
    assert found.measures["stationarity"] == pytest.approx(1e-3 * np.sqrt(1.2) / np.sqrt(2.0 * qvi.state(wrong)[0]))


@pytest.mark.parametrize(("stress", "length"), [(1e6, 1.0), (1e-6, 1e3), (1.0, 1e-5)])
def test_measures_do_not_depend_on_units(stress, length):
    """N, n0, T, t0 scale with stress, W with length, the energy with both."""
    qvi, (z, m_N, m_T) = solved()
    z = z * (1 + 1e-6)
    energy = 7.0
    scaled = FrictionQVI.from_arrays(
        K=energy * qvi.K, f=energy * qvi.f, N=stress * qvi.N, n0=stress * qvi.n0, T=stress * qvi.T,
        t0=stress * qvi.t0, mu=qvi.mu, W=length * qvi.W,
    )  # fmt: skip
    plain = certify(qvi, z, m_N, m_T).measures
    other = certify(scaled, z, energy / stress * m_N, energy / stress * m_T).measures
    for name in EXPONENTS:
        assert other[name] == pytest.approx(plain[name], rel=1e-6, abs=1e-14), name


def test_a_wrong_multiplier_of_an_equation_counts_by_its_work_on_any_mesh():
    """The mean of z at the 1000 nodes of a string is 1; ν is the opposite of the load that it takes."""
    K = diags_array([-np.ones(999), 2.0 * np.ones(1000), -np.ones(999)], offsets=[-1, 0, 1])
    rows, zero = eye_array(1000).tocsr()[:1], np.zeros(1)
    qvi = FrictionQVI.from_arrays(
        K, np.zeros(1000), -rows, zero, rows, zero, mu=[2.0], W=[1.0], A=np.full((1, 1000), 1e-3), b=[1.0]
    )
    z, nu = qvi.bonded_state.corrected
    exact, wrong = (certify(qvi, z, zero, zero, each) for each in (nu, 1.001 * nu))
    assert exact.passed
    assert wrong.measures["stationarity"] == pytest.approx(1e-3 * abs(nu[0]) / wrong.scales["energy"], rel=1e-2)


@pytest.mark.parametrize("size", [1e-14, 1e14])
def test_a_missed_equation_counts_in_any_unit(size):
    """Of the equation, and of an unknown."""
    qvi, rows, columns = dragged_block(0.2), np.diag([1.0, size]), np.array([1.0, 10.0])
    z, nothing = np.array([1.0, 0.2 + 1e-6]), (np.zeros(1), np.zeros(1), np.zeros(2))
    scaled = {name: getattr(qvi, name).toarray() * columns for name in ("N", "T", "A")}
    K, A = np.diag(columns) @ qvi.K.toarray() * columns, rows @ scaled.pop("A")
    found = certify(changed(qvi, K=K, A=A, b=rows @ qvi.b, **scaled), z / columns, *nothing).measures["equality"]
    assert found == pytest.approx(certify(qvi, z, *nothing).measures["equality"], rel=1e-9)


def peaked(share):
    """Two contacts that press with 1 and with a peak, of weights 1 and `share`; σ_N = −z, no coupling."""
    return FrictionQVI.from_arrays(
        K=np.diag([1.0, share]), f=np.array([1.0, 100.0 * share]), N=-np.eye(2), n0=np.zeros(2), T=np.zeros((2, 2)),
        t0=np.zeros(2), mu=np.zeros(2), W=np.array([1.0, share]),
    )  # fmt: skip


@pytest.mark.parametrize("share", [1.0, 1e-5])
def test_a_peak_of_stress_in_a_small_place_does_not_hide_work_on_gaps(share):
    """The unit of work is S D Σ W, but not more than the energy of the body: here ½ (1 + 100² share)."""
    qvi, z = peaked(share), np.array([1.0, 100.0])
    scales, body = scales_at(qvi, z), 0.5 * (1.0 + 1e4 * share)
    unit = min(1e4 / qvi.contact_stiffness * (1.0 + share), body)
    assert scales["body_energy"] == pytest.approx(body)
    assert scales["energy"] == pytest.approx(unit)
    pushed = np.array([1e-3, 0.0])  # on a point that is pressed: the load has to grow by as much
    found = certify(qvi.with_loads(f=qvi.f - pushed), z, pushed, np.zeros(2)).measures
    assert found["stationarity"] < 1e-12
    assert found["complementarity_normal"] == pytest.approx(1e-3 / unit)
    assert found["energy_gap"] == pytest.approx(1e-3 / body)


QVI = one_contact()


def with_displacement(p, t):
    """(p, t, m_N, m_T) for U = W r + q: the multipliers are m_N = u_N, as N = [−1, 0], and m_T = −u_T."""
    u = QVI.K @ np.array([p, t]) - QVI.f
    return np.array([p, t, u[0], -u[1]])


REACTIONS = {"open": (0.0, 0.0), "stick": (17 / 9, -65 / 18), "slip": (5 / 3, -10 / 3)}
STATES = {name: with_displacement(*reaction) for name, reaction in REACTIONS.items()}


def passes(values, tolerance=1e-8):
    return certify(QVI, values[:2], values[2:3], values[3:], tolerance=tolerance).passed


def distance(values):
    """To the nearest of the three, largest of the four differences."""
    return min(np.abs(values - known).max() for known in STATES.values())


def test_it_passes_at_no_other_reaction_with_its_own_multipliers():
    """The displacements that belong to a reaction satisfy all equations; only the law can fail."""
    found = 0
    for p, t in product([*np.linspace(-1.0, 4.0, 21), 17 / 9, 5 / 3], [*np.linspace(-6.0, 3.0, 19), -65 / 18, -10 / 3]):
        values = with_displacement(p, t)
        assert passes(values, 1e-12) == passes(values) == (distance(values) < 1e-12)
        found += distance(values) < 1e-12
    assert found == 3


@pytest.mark.parametrize("size", [1e-6, 1e-4, 1e-2, 1.0])
@pytest.mark.parametrize("name", REACTIONS)
def test_it_fails_all_around_each(name, size):
    for direction in product((-1.0, 0.0, 1.0), repeat=4):
        values = STATES[name] + size * np.array(direction)
        assert passes(values) == (not any(direction))


# Residuals of the contact law: zero where it holds, and as large as computed by hand where it does not.


SCALES = {"stress": 2.0, "displacement": 0.5, "energy": 4.0}  # k = 4
NAMES = ("normal", "friction", "sign", "complementarity_normal", "complementarity_tangential", "natural_map")
finite = st.floats(-3.0, 3.0)


def contact(friction=0.5, bilateral=False):
    """σ_N = −z_0, σ_T = z_1, weight 1."""
    return one_contact(friction).with_law(bilateral=np.array([bilateral]))


def residuals(qvi, p, t, m_N, m_T):
    return law_residuals(qvi, qvi.tractions(np.array([p, t])), np.array([m_N]), np.array([m_T]), SCALES)


@pytest.mark.parametrize(
    ("p", "t", "m_N", "m_T"),
    [(2.0, 0.9, 0.0, 0.0), (2.0, 1.0, 0.0, 0.7), (2.0, -1.0, 0.0, -0.7), (0.0, 0.0, 1.5, 0.3), (0.0, 0.0, 0.0, 0.0)],
    ids=["stick", "slip", "slip back", "open", "touching"],
)
def test_all_vanish_where_the_law_holds(p, t, m_N, m_T):
    assert residuals(contact(), p, t, m_N, m_T) == (dict.fromkeys(NAMES, 0.0), 0.0)


@settings(max_examples=examples(40), deadline=None)
@given(p=st.floats(0.0, 3.0), share=st.floats(-1.0, 1.0), m_N=st.floats(0.0, 3.0), m_T=finite)
def test_the_work_of_admissible_pairs_is_de_saxces_bipotential_and_not_negative(p, share, m_N, m_T):
    """De Saxcé's inequality; with equality exactly where the law holds."""
    friction = 0.5
    t = share * friction * p
    _, work = residuals(contact(friction), p, t, m_N, m_T)
    assert work >= -1e-15
    lawful = p * m_N + friction * p * abs(m_T) - t * m_T
    assert work == pytest.approx(lawful, rel=1e-14, abs=1e-14)  # sums of products of up to 10


@settings(max_examples=examples(40), deadline=None)
@given(p=finite, t=finite, m_N=finite, m_T=finite)
def test_projections_vanish_only_where_the_law_holds(p, t, m_N, m_T):
    """The natural map against the law written as inequalities and products."""
    friction = 0.5
    found, _ = residuals(contact(friction), p, t, m_N, m_T)
    bound = friction * abs(p)
    broken = max(-p, -m_N, min(abs(p), abs(m_N)), abs(t) - bound, min(abs(m_T), abs(bound * np.sign(m_T) - t)))
    if broken > 1e-3:
        assert found["natural_map"] > 1e-5
    if broken <= 0.0:
        assert found["natural_map"] == 0.0


def test_numbers_by_hand():
    """σ_N = −1, σ_T = 0.2, λ_N = 0.1, λ_T = 0.1, μ = 0.5, k = 4: π_N = −0.6."""
    found, work = residuals(contact(), 1.0, 0.2, 0.1, 0.1)
    assert found["natural_map"] == pytest.approx(0.4 / 2.0)  # normal 0.4, tangential |0.2 − 0.5| = 0.3
    assert found["complementarity_normal"] == pytest.approx(0.1 / 4.0)
    assert found["complementarity_tangential"] == pytest.approx((0.05 - 0.02) / 4.0)
    assert work == pytest.approx(0.13)


def test_far_slips_weigh_an_error_of_stress_as_near_ones_do():
    """σ_T = 0.2 below the bound 0.5 of a point that slides by 10 E / (S Σ W), or by a hundred times as much."""
    measures = [residuals(contact(), 1.0, 0.2, 0.0, far * 10.0 * 4.0 / 2.0)[0] for far in (1.0, 100.0)]
    for found in measures:
        assert found["complementarity_tangential"] == pytest.approx(10.0 * (0.5 - 0.2) / 2.0)


@pytest.mark.parametrize("p", [1.0, -1.0])
def test_bilateral_points_may_pull(p):
    found, _ = residuals(contact(bilateral=True), p, 0.5, 0.0, 0.4)
    assert set(found.values()) == {0.0}
    found, _ = residuals(contact(bilateral=True), p, 0.5, 0.1, 0.4)
    assert (found["sign"], found["natural_map"]) == pytest.approx((0.1 / 0.5, 0.1 / 0.5))


def test_a_violated_bound_shows_as_a_negative_gap():
    """|σ_T| above the bound with slip along it: friction works more than its law allows."""
    qvi = contact()
    assert residuals(qvi, 1.0, 0.8, 0.0, 1.0)[1] == pytest.approx(-0.3)
    z = np.array([1.0, 0.8])
    balanced = qvi.with_loads(f=qvi.K @ z + qvi.T.T @ np.ones(1))  # so that nothing else is wrong
    certificate = certify(balanced, z, np.zeros(1), np.ones(1))
    assert certificate.measures["stationarity"] < 1e-12
    assert certificate.signed["energy_gap"] == -certificate.measures["energy_gap"] < -0.1


@pytest.mark.parametrize("gap", [30.0, 1e6])
def test_a_gap_counts_up_to_ten_times_the_energy_over_stress_and_length(gap):
    """10 E / (S Σ W) = 20: beyond it round-off in σ_N weighs the same however far the obstacle is."""
    assert residuals(contact(), 1e-9, 0.0, gap, 0.0)[0]["complementarity_normal"] == pytest.approx(20e-9 / 4.0)


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
    """W = [[1, c], [c, 1]]: λ_max(Ĉ_NN) = 1/(1 − c²), λ_max(𝒲_TT) = 1."""
    found = uniqueness_bound(one_contact(2.0, coupling=0.8))
    assert found.friction == 2.0
    assert found.bound == pytest.approx(0.6, rel=1e-12)
    assert found.independent
    assert found.sentence().endswith("there may be one solution or several.")
    below = uniqueness_bound(one_contact(0.55, coupling=0.8))
    assert below.proves
    assert below.sentence().endswith("there is no other solution.")
    soft = changed(one_contact(), K=np.array([[1.0, 0.8], [0.8, 4.0]]))  # det 3.36: 4 / 3.36 and 4 in place of these
    assert uniqueness_bound(soft).bound == pytest.approx(np.sqrt(3.36) / 4.0, rel=1e-12)
    assert uniqueness_bound(two_contacts()).bound == pytest.approx(0.5, rel=1e-12)  # K = 1, weights 0.5 and 2: Ĉ = W


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), other=st.integers(0, 10**6), friction=st.floats(0.01, 2.0))
def test_the_map_is_lipschitz_with_the_constant_claimed(seed, other, friction):
    qvi, random = independent_problem(seed % 50, friction=friction), np.random.default_rng([seed, other])
    found = uniqueness_bound(qvi)
    first, second = random.uniform(0.0, 3.0, (2, qvi.m))
    moved = normal_traction(qvi, first) - normal_traction(qvi, second)
    length = np.sqrt(qvi.W @ moved**2)
    assert length <= friction / found.bound * np.sqrt(qvi.W @ (first - second) ** 2) + 1e-5


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


def test_equalities_restrict_the_compliance():
    """A z = 0 on one unknown is the problem without it, and its trace is none."""
    qvi = independent_problem(5, m=2)
    row = np.zeros((1, qvi.n))
    row[0, 0] = 1.0
    found = uniqueness_bound(replace(qvi, contact=replace(qvi.contact, A=row), loads=replace(qvi.loads, b=np.zeros(1))))
    weights = np.sqrt(np.concatenate([qvi.W, qvi.W]))[1:]
    inner = np.linalg.inv(qvi.K.toarray()[1:, 1:]) * weights * weights[:, None]  # the first is σ_N
    square = inner[0, 0] * np.linalg.eigvalsh(np.linalg.inv(inner)[1:, 1:])[-1]
    assert found.bound == pytest.approx(1.0 / np.sqrt(square), rel=1e-9)
    assert not found.independent


def test_dependent_rows_prove_nothing_at_points():
    qvi = independent_problem(0, friction=1e-3)
    twice = {name: np.concatenate([getattr(qvi, name)] * 2) for name in ("n0", "t0", "mu", "W")}
    found = uniqueness_bound(FrictionQVI.from_arrays(qvi.K, qvi.f, vstack([qvi.N] * 2), T=vstack([qvi.T] * 2), **twice))
    assert found.satisfied
    assert not found.proves
    assert found.sentence().endswith("It holds at points only: an estimate.")


def test_without_a_moving_bound_the_stress_is_unique():
    for changes in ({"mu": np.zeros(8)}, {"cap": np.zeros(8)}):
        found = uniqueness_bound(changed(random_problem(0), **changes))
        assert found.proves
        assert found.sentence().startswith("No friction bound")


def test_large_contacts_say_why_there_is_none():
    m = uniqueness.LARGEST // 2 + 1
    rows, zeros = eye_array(2 * m).tocsr(), np.zeros(m)
    qvi = FrictionQVI.from_arrays(
        K=eye_array(2 * m), f=np.ones(2 * m), N=rows[:m], n0=zeros, T=rows[m:], t0=zeros, mu=zeros + 0.3, W=zeros + 1.0
    )
    found = uniqueness_bound(qvi)
    assert found.bound is None
    assert not found.satisfied
    assert f"{2 * m} contact rows" in found.sentence()
