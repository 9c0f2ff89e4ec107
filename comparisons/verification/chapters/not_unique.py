"""Chapter on a problem with three solutions: one contact point, in algebra."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from scipy.sparse import csc_array

from comparisons.verification.elements import Chapter
from comparisons.verification.proof import by_hand, certified_algebra
from comparisons.verification.row import Row, absolute, word
from qvi_contact.basics.checks import FloatArray
from solvers import Certificate, FrictionQVI, certify, solve_qvi

PROBLEMS: Final = Chapter()

_W: Final = np.array([[1.0, 0.8], [0.8, 1.0]])
_Q: Final = np.array([1.0, 2.1])
_MU: Final = 2.0

STATES: Final = {"open": (0.0, 0.0), "stick": (17 / 9, -32.5 / 9), "slip": (5 / 3, -10 / 3)}
"""r = (pressure, shear) of the three solutions of u = W r + q: by hand, 17/9 = 1.8889, −32.5/9 = −3.6111."""

_METHODS: Final[dict[str, dict[str, Any]]] = {
    "condensed": {"method": "condensed"},
    "fixed point from 0": {"method": "fixed-point", "initial": np.zeros(1)},
    "fixed point from 1.7": {"method": "fixed-point", "initial": np.array([1.7])},
    "fixed point from 10": {"method": "fixed-point", "initial": np.array([10.0])},
    "Uzawa": {"method": "uzawa"},
}


@PROBLEMS.named("three-states")
def all_three(_: bool) -> Iterator[Row]:
    """The certificate passes for each of the three states by hand."""
    for name, r in STATES.items():
        certificate = _certificate(np.array(r))
        source = f"{name}: u = W r + q, W = [[1, .8], [.8, 1]], q = (1, 2.1), μ = 2"
        proof = by_hand(certificate.passed, "certificate")
        yield absolute(f"accuracy of the certificate, {name}", certificate.accuracy, 0.0, 1e-12, source, proof)


@PROBLEMS.named("nothing-else")
def nothing_else(quick: bool) -> Iterator[Row]:
    """Points between and beside them obey no contact law, and the certificate fails."""
    states = {name: np.array(r) for name, r in STATES.items()}
    wrong = {
        "half-way from stick to slip": (states["stick"] + states["slip"]) / 2,
        "half-way from open to slip": (states["open"] + states["slip"]) / 2,
        "slip moved by 1e-5": states["slip"] * (1 + 1e-5),
        "stick with the shear turned round": states["stick"] * [1, -1],
    }
    for name, r in list(wrong.items())[: 2 if quick else None]:
        violation = law_violation(r)
        proof = by_hand(violation > 1e-6, f"law violated by {violation:.0e}")
        outcome = "passes" if _certificate(r).passed else "fails"
        yield word(f"certificate, {name}", outcome, "fails", "contact law by hand", proof)


@PROBLEMS.named("three-methods")
def methods(quick: bool) -> Iterator[Row]:
    """Every method returns one of the three and certifies it; none claims that it is the only one."""
    names = list(_METHODS)[:2] if quick else list(_METHODS)
    for name in names:
        solution = solve_qvi(_problem(), tolerance=1e-9, **_METHODS[name])
        distances = {state: float(np.abs(solution.z - np.array(r)).max()) for state, r in STATES.items()}
        nearest = min(distances, key=distances.__getitem__)
        proof = certified_algebra(solution)
        quantity = "distance to the nearest of the three"
        yield absolute(quantity, distances[nearest], 0.0, 1e-7, f"{name}: the nearest is {nearest}", proof)


def _problem() -> FrictionQVI:
    """Unknowns r = (p, t), σ_N = −p, σ_T = t: K = W, f = −q."""
    normal, tangential = csc_array([[-1.0, 0.0]]), csc_array([[0.0, 1.0]])
    zero, one = np.zeros(1), np.ones(1)
    return FrictionQVI.from_arrays(csc_array(_W), -_Q, N=normal, n0=zero, T=tangential, t0=zero, mu=_MU * one, W=one)


def _certificate(r: FloatArray) -> Certificate:
    """With the multipliers that make r stationary: m_N = u_N, m_T = −u_T of u = W r + q."""
    u = _W @ r + _Q
    return certify(_problem(), r, np.array([u[0]]), np.array([-u[1]]), tolerance=1e-9)


def law_violation(r: FloatArray) -> float:
    """Largest violation of the contact law at r: of p ≥ 0, gap ≥ 0, p gap = 0, |t| ≤ μp, and of t against the slip."""
    (gap, slip), (p, t) = _W @ r + _Q, r
    free = max(_MU * p - abs(t), 0.0)
    return float(max(-p, -gap, abs(p * gap), abs(t) - _MU * p, min(free, abs(slip)), t * slip))
