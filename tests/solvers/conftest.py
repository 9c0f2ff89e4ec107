"""Problems with known answers, shared by the tests of `solvers`."""

import numpy as np
import pytest

from solvers import FrictionQVI


def one_contact(friction: float = 2.0, load: tuple[float, float] = (1.0, 2.1), coupling: float = 0.8) -> FrictionQVI:
    """Unknowns z = (p, t): σ_N = −p, σ_T = t, displacement u = W r + q with W = [[1, c], [c, 1]]."""
    return FrictionQVI(
        K=np.array([[1.0, coupling], [coupling, 1.0]]), f=-np.array(load),
        N=np.array([[-1.0, 0.0]]), n0=[0.0], T=np.array([[0.0, 1.0]]), t0=[0.0], mu=[friction], W=[1.0],
    )  # fmt: skip


def two_contacts() -> FrictionQVI:
    """Two uncoupled contacts of different weights, one sticking at (2, 0.4), one slipping at (1, −0.3)."""
    return FrictionQVI(
        K=np.eye(4), f=np.array([2.0, 0.4, 1.0, -2.0]), N=-np.eye(4)[[0, 2]], n0=np.zeros(2),
        T=np.eye(4)[[1, 3]], t0=np.zeros(2), mu=np.full(2, 0.3), W=np.array([0.5, 2.0]),
    )  # fmt: skip


def random_problem(seed: int, friction: float = 0.3, equalities: int = 0, n: int = 12, m: int = 8) -> FrictionQVI:
    """Dense random data; every point has pressure at z = 0, so that admissible points exist."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(n, n))
    A = random.normal(size=(equalities, n)) if equalities else None
    return FrictionQVI(
        K=root @ root.T + np.eye(n), f=3.0 * random.normal(size=n), N=random.normal(size=(m, n)),
        n0=np.full(m, -0.5),
        T=random.normal(size=(m, n)), t0=0.1 * random.normal(size=m), mu=np.full(m, friction),
        W=random.uniform(0.5, 1.0, m), A=A, b=0.01 * np.ones(equalities) if equalities else None,
    )  # fmt: skip


def dragged_block(shear: float, friction: float = 0.3) -> FrictionQVI:
    """Pressure 1 and a shear, both prescribed: carried for shear ≤ friction only."""
    return FrictionQVI(
        K=np.eye(2), f=np.zeros(2), N=np.array([[-1.0, 0.0]]), n0=[0.0], T=np.array([[0.0, 1.0]]), t0=[0.0],
        mu=[friction], W=[1.0], A=np.eye(2), b=np.array([1.0, shear]),
    )  # fmt: skip


@pytest.fixture
def nonunique() -> FrictionQVI:
    """Return the problem of the design note 5.6, which has three solutions."""
    return one_contact()
