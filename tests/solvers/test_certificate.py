"""A certificate passes on solutions and on nothing else."""

import numpy as np
import pytest

from solvers import FrictionQVI, InputError, certify, solve_qvi
from solvers.certificate.certificate import EXPONENTS, scales_at
from tests.solvers.conftest import one_contact, random_problem, two_contacts

EXACT = [  # state, load, friction, z, m_N, m_T of one contact, by hand
    ("open", (1.0, 2.1), 2.0, (0.0, 0.0), 1.0, -2.1),
    ("stick", (1.0, 2.1), 2.0, (17 / 9, -32.5 / 9), 0.0, 0.0),
    ("slip", (1.0, 2.1), 2.0, (5 / 3, -10 / 3), 0.0, -0.1),
]


@pytest.mark.parametrize(
    ("load", "friction", "z", "m_N", "m_T"), [case[1:] for case in EXACT], ids=[c[0] for c in EXACT]
)
def test_all_three_solutions_pass(load, friction, z, m_N, m_T):
    qvi = one_contact(friction, load)
    m_T = -float((qvi.K @ np.array(z) - qvi.f)[1])
    certificate = certify(qvi, np.array(z), np.array([m_N]), np.array([m_T]), tolerance=1e-12)
    assert certificate.passed, certificate.summary()
    assert certificate.accuracy <= 1e-12


def test_two_contacts_with_weights_by_hand():
    qvi = two_contacts()
    z, m_N, m_T = np.array([2.0, 0.4, 1.0, -0.3]), np.zeros(2), np.array([0.0, -1.7])
    assert certify(qvi, z, m_N, m_T, tolerance=1e-13).passed


def _solved() -> tuple[FrictionQVI, list[np.ndarray]]:
    qvi = random_problem(0)
    solution = solve_qvi(qvi, inner="direct:clarabel")
    assert solution.solved
    assert np.abs(solution.tangential_multiplier).max() > 1e-2
    assert solution.normal_multiplier.max() > 1e-2
    return qvi, [solution.z, solution.normal_multiplier, solution.tangential_multiplier]


def _wrong(parts: list[np.ndarray], what: str) -> list[np.ndarray | None]:
    z, m_N, m_T = (part.copy() for part in parts)
    if what == "one sign of m_T":
        m_T[np.abs(m_T).argmax()] *= -1
    elif what == "all signs of m_T":
        m_T *= -1
    elif what == "sign of m_N":
        m_N[m_N.argmax()] *= -1
    elif what == "z shifted":
        z[0] += 1e-5 * np.abs(z).max()
    elif what == "m_N dropped":
        m_N[:] = 0
    elif what == "m_T dropped":
        m_T[:] = 0
    elif what == "z zero":
        z[:] = 0
    elif what == "everything zero":
        z[:], m_N[:], m_T[:] = 0, 0, 0
    return [z, m_N, m_T]


@pytest.mark.parametrize(
    "what",
    ["one sign of m_T", "all signs of m_T", "sign of m_N", "z shifted", "m_N dropped", "m_T dropped",
     "z zero",
     "everything zero"],
)  # fmt: skip
def test_wrong_results_fail(what):
    qvi, parts = _solved()
    assert certify(qvi, *parts).passed
    certificate = certify(qvi, *_wrong(parts, what))
    assert not certificate.passed
    assert certificate.accuracy > 1e-7


def test_a_wrong_tangential_sign_shows_in_every_measure_that_knows_it():
    qvi, parts = _solved()
    measures = certify(qvi, *_wrong(parts, "all signs of m_T")).measures
    for name in ("stationarity", "sign", "complementarity_tangential", "energy_gap", "natural_map"):
        assert measures[name] > 1e-2, name


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_missing_or_undefined_parts_are_infinite(missing):
    qvi, parts = _solved()
    for nothing in (None, np.full_like(parts[missing], np.nan)):
        given = [*parts[:missing], nothing, *parts[missing + 1 :]]
        certificate = certify(qvi, *given)
        assert set(certificate.measures.values()) == {np.inf}
        assert not certificate.passed


def test_missing_equality_multiplier_does_not_pass():
    qvi = random_problem(1, equalities=2)
    solution = solve_qvi(qvi, inner="direct:clarabel")
    assert solution.solved
    parts = (solution.z, solution.normal_multiplier, solution.tangential_multiplier)
    assert not certify(qvi, *parts).passed
    assert certify(qvi, *parts, solution.equality_multiplier).passed


def test_a_factorisation_of_another_matrix_hides_no_error():
    """K itself has a say: to a factor that is far too stiff every residual is the force of a tiny error."""
    K, rows, one = np.diag([1.0, 2.0, 1.5, 1.2]), np.eye(4)[:2], np.ones(1)
    data = {"N": rows[:1], "n0": 0.0 * one, "T": rows[1:], "t0": 0.0 * one, "mu": 0.5 * one, "W": one}
    qvi = FrictionQVI(K=K, f=np.array([-1.0, 0.4, 1.5, 1.2]), **data)
    solution = solve_qvi(qvi)
    parts = solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    wrong = solution.z + np.array([0.0, 0.0, 0.0, 1e-3])  # where the contact does not feel it
    assert certify(qvi, solution.z, *parts).passed
    assert not certify(qvi, wrong, *parts).passed
    stiff = FrictionQVI(K=1e20 * K, f=qvi.f, **data)
    qvi.operator._forget()
    qvi.operator._factor = stiff.equality_system.factor
    assert qvi.linear_system.factor is qvi.operator._factor
    found = certify(qvi, wrong, *parts)
    assert not found.passed
    assert found.measures["stationarity"] == pytest.approx(
        1e-3 * np.sqrt(1.2) / np.sqrt(2.0 * qvi.strain_energy(wrong))
    )


def test_friction_bound_of_another_pressure_fails():
    """Solving the inner problem for the first bound is not solving the QVI."""
    qvi = one_contact(0.5, (-1.0, -3.0))
    first = solve_qvi(qvi, inner="direct:clarabel", max_iterations=1, initial=[1.0])
    assert not first.solved
    assert first.certificate.worst in ("friction", "energy_gap", "complementarity_tangential")


@pytest.mark.parametrize(("stress", "length"), [(1e6, 1.0), (1e-6, 1e3), (1.0, 1e-5)])
def test_measures_do_not_depend_on_units(stress, length):
    """N, n0, T, t0 scale with stress, W with length, the energy with both."""
    qvi, (z, m_N, m_T) = _solved()
    z = z * (1 + 1e-6)
    energy = 7.0
    scaled = FrictionQVI(
        K=energy * qvi.K, f=energy * qvi.f, N=stress * qvi.N, n0=stress * qvi.n0, T=stress * qvi.T,
        t0=stress * qvi.t0, mu=qvi.mu, W=length * qvi.W,
    )  # fmt: skip
    plain = certify(qvi, z, m_N, m_T).measures
    other = certify(scaled, z, energy / stress * m_N, energy / stress * m_T).measures
    for name in EXPONENTS:
        assert other[name] == pytest.approx(plain[name], rel=1e-6, abs=1e-14), name


def peaked(share):
    """Two contacts that press with 1 and with a peak, of weights 1 and `share`; σ_N = −z, no coupling."""
    return FrictionQVI(
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
    found = certify(qvi.changed(f=qvi.f - pushed), z, pushed, np.zeros(2)).measures
    assert found["stationarity"] < 1e-12
    assert found["complementarity_normal"] == pytest.approx(1e-3 / unit)
    assert found["energy_gap"] == pytest.approx(1e-3 / body)


def test_zero_problem_passes_at_zero():
    qvi = one_contact(load=(0.0, 0.0))
    assert certify(qvi, np.zeros(2), np.zeros(1), np.zeros(1), tolerance=1e-15).passed
    assert not certify(qvi, np.array([0.0, 1.0]), np.zeros(1), np.zeros(1)).passed


def test_summary_names_the_worst_measure():
    qvi, parts = _solved()
    certificate = certify(qvi, *parts)
    assert certificate.worst in certificate.summary()
    assert certificate.limits["natural_map"] == pytest.approx(1e-5)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, -1e-8])
def test_bad_tolerance(tolerance):
    with pytest.raises(InputError, match="tolerance"):
        certify(one_contact(), np.zeros(2), np.zeros(1), np.zeros(1), tolerance=tolerance)


def test_wrong_shape():
    with pytest.raises(InputError, match="normal_multiplier"):
        certify(one_contact(), np.zeros(2), np.zeros(2), np.zeros(1))
