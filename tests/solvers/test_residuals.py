"""Residuals of the contact law: zero where it holds, and as large as computed by hand where it does not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solvers import certify
from solvers.certificate import MEASURES, law_residuals
from tests.effort import examples
from tests.solvers.conftest import one_contact, random_problem

SCALES = {"stress": 2.0, "displacement": 0.5, "energy": 4.0}  # k = 4
STEP = SCALES["stress"] / SCALES["displacement"]
NAMES = ("normal", "friction", "sign", "complementarity_normal", "complementarity_tangential", "natural_map",
         "alart_curnier", "bipotential")  # fmt: skip
finite = st.floats(-3.0, 3.0)


def contact(friction=0.5, bilateral=False):
    """σ_N = −z_0, σ_T = z_1, weight 1."""
    return one_contact(friction).with_law(bilateral=np.array([bilateral]))


def residuals(qvi, p, t, m_N, m_T):
    return law_residuals(qvi, np.array([p, t]), np.array([m_N]), np.array([m_T]), SCALES)


@pytest.mark.parametrize(
    ("p", "t", "m_N", "m_T"),
    [(2.0, 0.9, 0.0, 0.0), (2.0, 1.0, 0.0, 0.7), (2.0, -1.0, 0.0, -0.7), (0.0, 0.0, 1.5, 0.3), (0.0, 0.0, 0.0, 0.0)],
    ids=["stick", "slip", "slip back", "open", "touching"],
)
def test_all_vanish_where_the_law_holds(p, t, m_N, m_T):
    found = residuals(contact(), p, t, m_N, m_T)
    assert found.measures == dict.fromkeys(NAMES, 0.0)
    assert found.work == found.bipotential == 0.0


@settings(max_examples=examples(80), deadline=None)
@given(p=st.floats(0.0, 3.0), share=st.floats(-1.0, 1.0), m_N=st.floats(0.0, 3.0), m_T=finite)
def test_the_bipotential_of_admissible_pairs_is_not_negative(p, share, m_N, m_T):
    """De Saxcé's inequality; with equality exactly where the law holds."""
    friction = 0.5
    t = share * friction * p
    found = residuals(contact(friction), p, t, m_N, m_T)
    assert found.bipotential >= -1e-15
    lawful = p * m_N + friction * p * abs(m_T) - t * m_T
    assert found.bipotential == pytest.approx(lawful, rel=1e-14, abs=1e-14)
    assert found.bipotential == pytest.approx(found.work, rel=1e-14, abs=1e-14)  # sums of products of up to 10


@settings(max_examples=examples(80), deadline=None)
@given(p=finite, t=finite, m_N=finite, m_T=finite)
def test_projections_vanish_only_where_the_law_holds(p, t, m_N, m_T):
    """Natural map and Alart-Curnier against the law written as inequalities and products."""
    friction = 0.5
    found = residuals(contact(friction), p, t, m_N, m_T).measures
    bound = friction * abs(p)
    broken = max(-p, -m_N, min(abs(p), abs(m_N)), abs(t) - bound, min(abs(m_T), abs(bound * np.sign(m_T) - t)))
    for name in ("natural_map", "alart_curnier"):
        if broken > 1e-3:
            assert found[name] > 1e-5, name
        if broken <= 0.0:
            assert found[name] == 0.0


def test_numbers_by_hand():
    """σ_N = −1, σ_T = 0.2, λ_N = 0.1, λ_T = 0.1, μ = 0.5, k = 4: π_N = −0.6, so the augmented bound is 0.3."""
    found = residuals(contact(), 1.0, 0.2, 0.1, 0.1)
    assert found.measures["natural_map"] == pytest.approx(0.4 / 2.0)  # normal 0.4, tangential |0.2 − 0.5| = 0.3
    assert found.measures["alart_curnier"] == pytest.approx(0.4 / (1.5 * 2.0))
    assert found.measures["complementarity_normal"] == pytest.approx(0.1 / 4.0)
    assert found.measures["complementarity_tangential"] == pytest.approx((0.05 - 0.02) / 4.0)
    assert found.measures["bipotential"] == pytest.approx((0.1 + 0.03) / 4.0)
    assert found.bipotential == pytest.approx(0.13)


def test_far_slips_weigh_an_error_of_stress_as_near_ones_do():
    """σ_T = 0.2 below the bound 0.5 of a point that slides by 10 E / (S Σ W), or by a hundred times as much."""
    measures = [residuals(contact(), 1.0, 0.2, 0.0, far * 10.0 * 4.0 / 2.0).measures for far in (1.0, 100.0)]
    for found in measures:
        assert found["complementarity_tangential"] == pytest.approx(10.0 * (0.5 - 0.2) / 2.0)
        assert found["bipotential"] == found["complementarity_tangential"]


@pytest.mark.parametrize("p", [1.0, -1.0])
def test_bilateral_points_may_pull(p):
    found = residuals(contact(bilateral=True), p, 0.5, 0.0, 0.4).measures
    assert set(found.values()) == {0.0}
    assert residuals(contact(bilateral=True), p, 0.5, 0.1, 0.4).measures["sign"] == pytest.approx(0.1 / 0.5)


def test_a_violated_bound_shows_as_a_negative_bipotential():
    """|σ_T| above the bound with slip along it: friction works more than its law allows."""
    qvi = contact()
    assert residuals(qvi, 1.0, 0.8, 0.0, 1.0).bipotential == pytest.approx(-0.3)
    z = np.array([1.0, 0.8])
    balanced = qvi.with_loads(f=qvi.K @ z + qvi.T.T @ np.ones(1))  # so that nothing else is wrong
    certificate = certify(balanced, z, np.zeros(1), np.ones(1))
    assert certificate.measures["stationarity"] < 1e-12
    for name in ("bipotential", "energy_gap"):
        assert certificate.signed[name] == -certificate.measures[name] < -0.1


@pytest.mark.parametrize("seed", range(4))
def test_what_passes_the_natural_map_passes_alart_and_curnier(seed):
    """Which is why its limit loses nothing: |σ_T − clip| differs by mu times the normal residual at most."""
    qvi, random = random_problem(seed), np.random.default_rng(seed)
    for _ in range(50):
        parts = random.normal(size=qvi.n), random.normal(size=qvi.m), random.normal(size=qvi.m)
        found = law_residuals(qvi, *parts, SCALES).measures
        assert found["alart_curnier"] <= found["natural_map"] * (1.0 + 1e-12)
        assert found["bipotential"] <= found["complementarity_normal"] + found["complementarity_tangential"] + 1e-12


@pytest.mark.parametrize("gap", [30.0, 1e6])
def test_a_gap_counts_up_to_ten_times_the_energy_over_stress_and_length(gap):
    """10 E / (S Σ W) = 20: beyond it round-off in σ_N weighs the same however far the obstacle is."""
    assert residuals(contact(), 1e-9, 0.0, gap, 0.0).measures["complementarity_normal"] == pytest.approx(20e-9 / 4.0)


def test_every_measure_has_a_row_with_its_limit():
    """The certificate as a table for people."""
    certificate = certify(contact(), np.array([1.0, 0.8]), np.zeros(1), np.ones(1), tolerance=1e-6)
    rows = certificate.rows()
    assert [row.name for row in rows] == [measure.name for measure in MEASURES]
    for row in rows:
        assert abs(row.value) == certificate.measures[row.name]
        assert row.limit == certificate.limits[row.name]
        assert row.passed == (certificate.measures[row.name] <= certificate.limits[row.name])
        assert min(len(row.meaning), len(row.worry)) > 5
    assert rows[-1].value < 0.0  # the bipotential keeps its sign
    lines = certificate.explain().splitlines()
    failed = {line.split()[0] for line in lines if line.endswith("FAILED")}
    assert failed == {row.name for row in rows if not row.passed}
    assert {"friction", "stationarity", "bipotential"} <= failed
    assert len(lines) == 1 + 3 * len(MEASURES)
    assert not any(row.passed for row in certify(contact(), None, None, None).rows())
