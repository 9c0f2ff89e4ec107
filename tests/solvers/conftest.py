"""Problems with known answers, and back ends that fail, for the tests of `solvers`."""

from dataclasses import replace
from pkgutil import resolve_name

import numpy as np
import pytest
from scipy.sparse import eye_array, random_array

from solvers import FrictionQVI


def one_contact(friction: float = 2.0, load: tuple[float, float] = (1.0, 2.1), coupling: float = 0.8) -> FrictionQVI:
    """Unknowns z = (p, t): σ_N = −p, σ_T = t, displacement u = W r + q with W = [[1, c], [c, 1]]."""
    return FrictionQVI.from_arrays(
        K=np.array([[1.0, coupling], [coupling, 1.0]]), f=-np.array(load),
        N=np.array([[-1.0, 0.0]]), n0=[0.0], T=np.array([[0.0, 1.0]]), t0=[0.0], mu=[friction], W=[1.0],
    )  # fmt: skip


def two_contacts() -> FrictionQVI:
    """Two uncoupled contacts of different weights, one sticking at (2, 0.4), one slipping at (1, −0.3)."""
    return FrictionQVI.from_arrays(
        K=np.eye(4), f=np.array([2.0, 0.4, 1.0, -2.0]), N=-np.eye(4)[[0, 2]], n0=np.zeros(2),
        T=np.eye(4)[[1, 3]], t0=np.zeros(2), mu=np.full(2, 0.3), W=np.array([0.5, 2.0]),
    )  # fmt: skip


def random_problem(seed: int, friction: float = 0.3, equalities: int = 0, n: int = 12, m: int = 8) -> FrictionQVI:
    """Dense random data; every contact point has pressure at z = 0, so that admissible z exist."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(n, n))
    A = random.normal(size=(equalities, n)) if equalities else None
    return FrictionQVI.from_arrays(
        K=root @ root.T + np.eye(n), f=3.0 * random.normal(size=n), N=random.normal(size=(m, n)),
        n0=np.full(m, -0.5),
        T=random.normal(size=(m, n)), t0=0.1 * random.normal(size=m), mu=np.full(m, friction),
        W=random.uniform(0.5, 1.0, m), A=A, b=0.01 * np.ones(equalities) if equalities else None,
    )  # fmt: skip


def dragged_block(shear: float, friction: float = 0.3, normal: float = 1.0, **laws) -> FrictionQVI:
    """Prescribed pressure and shear; for Coulomb's law solvable only if shear ≤ friction × pressure."""
    return FrictionQVI.from_arrays(
        K=np.eye(2), f=np.zeros(2), N=np.array([[-1.0, 0.0]]), n0=[0.0], T=np.array([[0.0, 1.0]]), t0=[0.0],
        mu=[friction], W=[1.0], A=np.eye(2), b=np.array([normal, shear]), **laws,
    )  # fmt: skip


def prescribed_shear() -> FrictionQVI:
    """The shear T z = −1 is prescribed; the pressure 3.8 of the solution holds it, zero pressure does not."""
    return FrictionQVI.from_arrays(
        K=np.array([[1.0, 0.8], [0.8, 1.0]]), f=np.array([3.0, 0.0]), N=np.array([[-1.0, 0.0]]), n0=[0.0],
        T=np.array([[0.0, 1.0]]), t0=[0.0], mu=[0.3], W=[1.0], A=np.array([[0.0, 1.0]]), b=[-1.0],
    )  # fmt: skip


class Root:
    """R z + r₀ with dense R, as an `EnergyRoot`."""

    def __init__(self, R, r0=0.0):
        self.R, self.r0 = R, r0

    def apply(self, z):
        return self.R @ z + self.r0

    def adjoint(self, r):
        return self.R.T @ r

    def rounding(self, z):
        return float(np.finfo(float).eps * (np.abs(self.R) @ np.abs(z)).max())


def with_constant_tractions(qvi: FrictionQVI, more: int = 193) -> FrictionQVI:
    """The problem and `more` points of constant pressure 1; 193 of them are too many for pivoting."""
    nothing, zeros = np.zeros((more, qvi.n)), np.zeros(more)
    return FrictionQVI.from_arrays(
        K=qvi.K, f=qvi.f, N=np.vstack([qvi.N.toarray(), nothing]), n0=np.r_[qvi.n0, zeros - 1.0],
        T=np.vstack([qvi.T.toarray(), nothing]), t0=np.r_[qvi.t0, zeros], mu=np.r_[qvi.mu, zeros + 0.3],
        W=np.r_[qvi.W, zeros + 0.5],
    )  # fmt: skip


LIBRARIES = {
    "qp:clarabel": ("qpsolvers", "solve_problem"),
    "direct:clarabel": ("clarabel", "DefaultSolver"),
    "socp:clarabel": ("cvxpy:Problem", "solve"),
}
"""Inner solver → the place where it calls its library; direct Clarabel keeps an object."""


@pytest.fixture
def back_end(monkeypatch):
    """Replace a library's answer by `function(solve)`, where calling `solve` computes the library's own answer."""

    def replaced(name, function):
        place, word = LIBRARIES[name]
        owner = resolve_name(place)
        original = getattr(owner, word)

        def call(*words, **settings):
            return function(lambda: original(*words, **settings))

        class Kept:
            def __init__(self, *words):
                self.solver = original(*words)

            def __getattr__(self, name):
                return getattr(self.solver, name)

            def solve(self):
                return function(self.solver.solve)

        monkeypatch.setattr(owner, word, Kept if name == "direct:clarabel" else call)

    return replaced


def mixed_problem(seed, equalities=2, friction=0.2):
    """All kinds of rows: cohesive, capped, without friction, bilateral; under pressure, under tension, open."""
    qvi = random_problem(seed, friction, equalities, n=14, m=10)
    random = np.random.default_rng(100 + seed)
    mu = qvi.mu.copy()
    mu[[0, 5]] = 0.0
    cap = np.full(10, np.inf)
    cap[[1, 6, 7]] = 0.3, 0.2, 0.0
    points, cohesion = np.arange(10), random.uniform(0.0, 0.5, 10)
    cohesion[points % 3 == 0] = 0.0
    return qvi.with_law(mu=mu, cohesion=cohesion, cap=cap, bilateral=points >= 6)


EDGES = 5
GAUSS = (1.0 + np.polynomial.legendre.leggauss(4)[0]) / 2.0
LAWS = {
    "coulomb": {"mu": 0.3}, "opening": {"mu": 0.4, "tension": 1.5}, "frictionless": {"mu": 0.0, "tension": 0.5},
    "tresca": {"mu": 0.0, "cohesion": 0.2}, "cohesion": {"mu": 0.2, "cohesion": 0.15, "tension": 0.8},
    "cap": {"mu": 0.5, "cohesion": 0.02, "cap": 0.25}, "bilateral": {"mu": 0.25, "bilateral": True, "tension": 1.0},
    "equations": {"mu": 0.3, "equalities": 3},
}  # fmt: skip


def chain(seed, mu=0.3, cohesion=0.0, cap=np.inf, bilateral=False, tension=0.0, equalities=0):
    """A contact line: σ_N linear on each edge, σ_T continuous and quadratic, four points an edge, dependent rows.

    n₀ rises from −1 at one end to `tension` − 1 at the other, where the contact may open.
    """
    random = np.random.default_rng(seed)
    t, points = GAUSS, 4 * EDGES
    E = np.zeros((2 * points, 4 * EDGES + 1))
    for e in range(EDGES):
        rows = slice(4 * e, 4 * e + 4)
        E[rows, [2 * e, 2 * e + 1]] = np.column_stack([1 - t, t])
        quadratic = np.column_stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
        E[points + 4 * e : points + 4 * e + 4, 2 * EDGES + 2 * e : 2 * EDGES + 2 * e + 3] = quadratic
    r = E.shape[1]
    n = 3 * r
    Y = (random_array((r, n), density=0.05, rng=random) + eye_array(n).tocsr()[:r]).toarray()
    root = random_array((n, n), density=0.1, rng=random).toarray() + 2.0 * np.eye(n)
    start = np.concatenate([np.linspace(-1.0, tension - 1.0, 2 * EDGES), 0.1 * random.normal(size=2 * EDGES + 1)])
    rows, shift = E @ Y, E @ start
    A = random.normal(size=(equalities, n)) if equalities else None
    return FrictionQVI.from_arrays(
        K=root.T @ root, f=0.6 * random.normal(size=n), N=rows[:points], n0=shift[:points], T=rows[points:],
        t0=shift[points:], mu=np.full(points, mu), W=np.full(points, 1.0 / points), A=A,
        b=0.1 * random.normal(size=equalities) if equalities else None, cohesion=np.full(points, cohesion),
        cap=np.full(points, cap), bilateral=np.full(points, bilateral),
    )  # fmt: skip


def changed(qvi, **fields):
    """The problem with these fields of its parts (stiffness, contact, loads, law) replaced."""
    parts = {name: getattr(qvi, name) for name in ("stiffness", "contact", "loads", "law")}
    for name, value in fields.items():
        part = next(key for key, part in parts.items() if hasattr(part, name))
        parts[part] = replace(parts[part], **{name: value})
    return FrictionQVI(**parts)
