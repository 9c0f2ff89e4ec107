r"""The friction problem at the contacts alone, as rigid-body and contact codes pose it, from a `FrictionQVI` and back.

FCLIB's local problem in the plane, order (N, T) for each of c contacts: find r, u (2c,) and λ (p,) with

    u = W r + V λ + q,    Vᵀ r + s = 0,                                                                (L)
    r_N ≥ 0,  u_N ≥ 0,  r_N u_N = 0;    |r_T| ≤ μ r_N,  u_T = −|u_T| r_T / |r_T| where |r_T| = μ r_N,  else u_T = 0.

r are forces on the body (r_N > 0 compression), u relative displacements (u_N > 0 an open gap). Without equations,
p = 0, it is the plain problem (W, q, μ). FCLIB's equations have a term R λ, which is zero here. Source: FCLIB,
src/fclib.h; Acary, Brémond, Koziara and Pérignon, FCLIB: a collection of discrete 3D frictional contact problems, INRIA
RT-444, 2014.

**From (D2).** With the tractions σ = (σ_N, σ_T) at the points, those of the bonded body σ_b, weights w, and
C = [N; T] K⁻¹ [N; T]ᵀ (K⁻¹ on A z = b), a *stiffness*, (D2) reads σ = σ_b − C m: tractions by displacements m = w λ.
FCLIB wants the inverse, a compliance W, with

    r = D σ,  u = −D⁻¹ m,     D = −w in rows N, +w in rows T:    r_N = −w σ_N,  r_T = w σ_T,  u_N = λ_N,  u_T = −λ_T.

The points' rows depend on each other (four on an edge where the traction has two or three parameters), so that C is
singular: tractions can only be σ_b + range C, and displacements are unique only up to its null space. Let Z be an
orthonormal basis of the null space of C_w = √w C √w and C_w⁺ its pseudo-inverse. Then (D2) is exactly (L) with

    W = D⁻¹ √w C_w⁺ √w D⁻¹,   q = −D⁻¹ √w C_w⁺ √w σ_b,   V = D⁻¹ √w Z,   s = −Zᵀ √w σ_b.

W is positive definite where Vᵀ r = 0, and ½ rᵀ W r + qᵀ r + ½ qᵀ W⁺ q is the energy above that of the bonded body.
Independent rows (Z empty) give the plain problem. No plain problem has the same solutions where rows are dependent:
u = W r + q with a finite W puts no restriction on r. `LocalProblem.penalised` comes as close as one likes.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.checks import real_array
from solvers.basics.types import Matrix, Vector
from solvers.certificate.certificate import Certificate, certify
from solvers.errors import InputError
from solvers.fixed_point import CondensedForm, FullForm
from solvers.inequality.problem import FrictionQVI
from solvers.solution import QVISolution
from solvers.solve import solve_qvi

LARGEST = 6000
"""Rows 2c up to which problems are taken: their matrices are treated as dense."""

_ASYMMETRY = 1e-8  # accepted |W − Wᵀ| relative to |W|
_NEGATIVE = 1e-8  # eigenvalues below minus this share of the largest make W indefinite
_SINGULAR = 1e-12  # eigenvalues below this share of the largest are zero
_ROOTED = 20_000  # unknowns up to which a condensation pays for factorising R instead of K
_INCONSISTENT = 1e-8  # relative part of s that no r and λ can balance
_REGULARISATION = 1e-6  # compliance added, as a share of the diagonal of W, where W is singular
_PROXIMAL_STEPS = 20
_SETTLED = 1e-13  # what is left of the added compliance's displacement, relative to q, that is not worth another step


def finite(field: str, values: np.ndarray, *, infinite: bool = False) -> np.ndarray:
    """The numbers as float64; `InputError` for anything that is no number, NaN, or (unless allowed) infinite."""
    if values.dtype.kind not in "fiu":
        raise InputError(field, f"type {values.dtype}", "give real numbers")
    numbers = np.asarray(values, dtype=np.float64)
    if np.isnan(numbers).any() or not (infinite or np.isfinite(numbers).all()):
        raise InputError(field, "NaN or infinity", "give finite numbers")
    return numbers


class ContactState(NamedTuple):
    """Displacements u (2c,), forces r (2c,) and multipliers λ (p,) of the equations."""

    u: Vector
    r: Vector
    lam: Vector


@dataclass(frozen=True, eq=False)
class LocalProblem:
    """Problem (L) in the plane.

    Attributes
    ----------
    W : (2c, 2c) compliance, symmetric positive semi-definite
    q : (2c,) displacements at r = 0
    mu : (c,) ≥ 0
    V, s : (2c, p) and (p,); p = 0 when not given
    weights : (c,) > 0, lengths that make forces tractions; 1 when not given

    Accepted is every such problem of up to `LARGEST` rows. Where W is singular on Vᵀ r = 0 (more forces than
    displacements, as in hyperstatic stacks), forces are not unique; then `qvi` adds a small compliance, which
    `solve_local` takes away again in proximal steps. Anything else raises `InputError`.

    """

    W: Matrix
    q: Vector
    mu: Vector
    V: Matrix = None  # type: ignore[assignment]  # None is replaced on construction
    s: Vector = None  # type: ignore[assignment]
    weights: Vector = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        size = np.size(self.q)
        if (self.V is None) != (self.s is None):
            raise InputError("V", "one of V and s", "give both, or none")
        none, ones = np.zeros(0), np.ones(np.size(self.mu))
        empty = {"V": none.reshape(size, 0), "s": none, "weights": ones}
        for name in ("W", "q", "mu", "V", "s", "weights"):
            value = getattr(self, name)
            object.__setattr__(self, name, finite(name, np.asarray(empty[name] if value is None else value)))
        if size % 2 or not 0 < size <= LARGEST:
            raise InputError("q", f"{size} entries", f"give two for each contact, at most {LARGEST} in all")
        c, p = size // 2, np.size(self.s)
        expected: dict[str, tuple[int, ...]] = {
            "W": (size, size), "q": (size,), "mu": (c,), "V": (size, p), "s": (p,), "weights": (c,),
        }  # fmt: skip
        for name, shape in expected.items():
            found = getattr(self, name).shape
            if found != shape:
                raise InputError(name, f"shape {found}", f"give shape {shape}, as q and s say")
        if (self.mu < 0).any():
            raise InputError("mu", float(self.mu.min()), "give friction coefficients ≥ 0")
        if not (self.weights > 0).all():
            raise InputError("weights", float(self.weights.min()), "give lengths > 0")
        # symmetric and positive semi-definite, up to rounding
        largest = float(np.abs(self.W).max(initial=0.0))
        asymmetry = float(np.abs(self.W - self.W.T).max(initial=0.0))
        if asymmetry > _ASYMMETRY * largest:
            raise InputError("W", f"asymmetry {asymmetry / largest:.1e}", "give a symmetric matrix")
        values = np.linalg.eigvalsh(self.W)
        if values[0] < -_NEGATIVE * max(values[-1], 0.0) - np.finfo(float).tiny:
            raise InputError("W", f"eigenvalue {values[0]:.1e}", "give a positive semi-definite matrix")

    @property
    def contacts(self) -> int:
        """Number of contacts c."""
        return len(self.mu)

    def displacements(self, r: Vector, lam: Vector) -> Vector:
        """W r + V λ + q (2c,)."""
        return np.asarray(self.W @ r + self.V @ lam + self.q)

    def energy(self, r: Vector) -> float:
        """½ rᵀ W r + qᵀ r."""
        return float(0.5 * r @ (self.W @ r) + self.q @ r)

    def tractions(self, r: Vector) -> tuple[Vector, Vector]:
        """(σ_N, σ_T) = (−r_N, r_T) / weights, (c,) each."""
        return -r[0::2] / self.weights, r[1::2] / self.weights

    @cached_property
    def regularisation(self) -> float:
        """Share ε of its diagonal that `qvi` adds to W; 0 where W is positive definite on Vᵀ r = 0."""
        least = np.linalg.eigvalsh(self._stiffened)[0]
        return 0.0 if least > _SINGULAR else _REGULARISATION

    def qvi(self, centre: Vector | None = None) -> FrictionQVI:
        """(L) as `FrictionQVI`, dimensionless: z = r / (ρ d), tractions at c points by the weights.

            K = d W d/ω + ε + U Uᵀ,  f = ε z₀ − d q/(ω ρ) + U t,  A = Uᵀ,  b = t

        with ω and ρ the units of compliance and force, d = √(ω / W_ii), and A z = b the equations with orthonormal
        rows. U Uᵀ changes nothing where they hold, and makes K positive definite. ε is the `regularisation`: where it
        is not 0, u has an additional part ε W_ii (r − r₀), with r₀ the `centre`, 0 when not given.
        """
        U, target = self._equations
        omega, rho, d, epsilon = self._compliance, self.force_unit, self._scale, self.regularisation
        c, t = self.contacts, target / rho
        N, T = np.zeros((c, 2 * c)), np.zeros((c, 2 * c))
        places = np.arange(c)
        N[places, 2 * places], T[places, 2 * places + 1] = -d[0::2] / self.weights, d[1::2] / self.weights
        K = self._stiffened + epsilon * np.eye(2 * c)
        z0 = np.zeros(2 * c) if centre is None else centre / (rho * d)
        return FrictionQVI.from_arrays(
            K=csc_array((K + K.T) / 2.0), f=U @ t + epsilon * z0 - d * self.q / (omega * rho),
            N=csc_array(N), n0=np.zeros(c), T=csc_array(T), t0=np.zeros(c),
            mu=self.mu, W=self.weights, A=csc_array(U.T), b=t,
        )  # fmt: skip

    @cached_property
    def force_unit(self) -> float:
        """ρ: what a displacement of the size of q costs, or what the equations prescribe."""
        pushed, prescribed = np.abs(self._scale * self.q).max(), np.abs(self._equations[1]).max(initial=0.0)
        sizes = (pushed / self._compliance, prescribed)
        return float(max(sizes)) or 1.0

    def state(self, solution: QVISolution) -> ContactState:
        """r, λ, and u = W r + V λ + q computed from them, of a solution of `qvi` (NaN where it has none)."""
        r = self.force_unit * self._scale * solution.z
        pushed = self._equations[0] @ (self._compliance * self.force_unit * solution.equality_multiplier)  # d V λ
        lam = np.asarray(np.linalg.lstsq(self._scale[:, None] * self.V, pushed, rcond=None)[0], np.float64)
        return ContactState(self.displacements(r, lam), r, lam)

    def certify(self, state: ContactState, tolerance: float = 1e-8) -> Certificate:
        """The certificate of a state (see `solvers.certificate`), on `qvi` about it: from r, λ and u as given.

        Where W is singular displacements are measured by the compliance that `qvi` adds: it is stricter than needed.
        """
        scale = self._compliance * self.force_unit
        m_N, m_T = self.weights * state.u[0::2] / scale, -self.weights * state.u[1::2] / scale
        held = self._equations[0].T @ (self._scale * (self.V @ state.lam))
        return certify(self.qvi(state.r), state.r / (self.force_unit * self._scale), m_N, m_T, held / scale, tolerance)

    def dimensionless(self, state: ContactState) -> "tuple[LocalProblem, ContactState]":
        """Problem and state in the units ω of W and ρ of forces: what measures that mix u and r should be given."""
        omega, rho = self._compliance, self.force_unit
        u, r, lam = state
        q, s = self.q / (omega * rho), self.s / rho
        problem = LocalProblem(self.W / omega, q, self.mu, self.V, s, self.weights)
        return problem, ContactState(u / (omega * rho), r / rho, lam / (omega * rho))

    def penalised(self, factor: float = 1e8) -> "LocalProblem":
        """A plain problem whose solutions tend to those of this one like 1 / factor.

        Equations Uᵀ (r / d) = t become springs of compliance factor × ω (ω, d of `qvi`). For programs that read W, q
        and μ only; the condition number of W grows with the factor.
        """
        U, target = self._equations
        pulled = U / self._scale[:, None]
        stiff = factor * self._compliance
        W, q = self.W + stiff * pulled @ pulled.T, self.q - stiff * pulled @ target
        return LocalProblem(W, q, self.mu, weights=self.weights)

    @property
    def _compliance(self) -> float:
        """ω."""
        return float(self.W.diagonal().max(initial=0.0)) or 1.0

    @property
    def _scale(self) -> Vector:
        """The d (2c,) with which the diagonal of d W d is ω; 1 where W is zero."""
        diagonal = self.W.diagonal()
        return np.sqrt(self._compliance / np.where(diagonal > 0.0, diagonal, self._compliance))

    @cached_property
    def _stiffened(self) -> Matrix:
        """The matrix d W d / ω + U Uᵀ of `qvi`."""
        U, W = self._equations[0], (self.W + self.W.T) / 2.0
        return np.asarray(W * self._scale * self._scale[:, None] / self._compliance + U @ U.T)

    @cached_property
    def _equations(self) -> tuple[Matrix, Vector]:
        """U (2c, k) with orthonormal columns and t (k,): the equations as Uᵀ (r / d) = t."""
        U, sizes, Y = np.linalg.svd(self._scale[:, None] * self.V, full_matrices=False)
        kept = sizes > _SINGULAR * sizes.max(initial=0.0)
        wanted = -Y @ self.s
        missed = float(np.linalg.norm(Y[kept].T @ wanted[kept] + self.s))
        if missed > _INCONSISTENT * float(np.linalg.norm(self.s)):
            raise InputError("s", f"{missed:.1e}", "give equations Vᵀ r + s = 0 that some forces satisfy")
        return U[:, kept], wanted[kept] / sizes[kept]


def solve_local(problem: LocalProblem, **options: Any) -> tuple[ContactState, QVISolution]:
    """Solve (L) by `solve_qvi`, whose options these are.

    Where W is singular, the proximal steps r₀ ← r take the added compliance away, down to ε W_ii (r − r₀) of the last.

    Returns
    -------
    The state, and the solution of `LocalProblem.qvi`, in the last step about its centre; both as they are where the
    solver failed, see its status.

    """
    solution = solve_qvi(problem.qvi(), **options)
    state = problem.state(solution)
    left = np.inf
    for _ in range(_PROXIMAL_STEPS if problem.regularisation else 0):
        if not solution.solved or left <= _SETTLED * float(np.abs(problem.q).max()):
            break
        solution = solve_qvi(problem.qvi(state.r), **options)
        after = problem.state(solution)
        left = problem.regularisation * float(np.abs(problem.W.diagonal() * (after.r - state.r)).max())
        state = after
    return state, solution


def local_problem(qvi: FrictionQVI) -> LocalProblem:
    """Condense (D2) on its contact points; the derivation stands in the module's docstring.

    Where the problem has an energy root, R is factorised instead of K (up to 20 000 unknowns): the compliance is then
    free of the rounding inside K, which on graded meshes is 1e-6.

    Raises
    ------
    InputError
        If the problem has no contact, too many points, or what FCLIB has no place for: cohesion, a limit of the
        friction stress, points where the sign of the normal traction is free.

    """
    remedy = "write it as .npz: a local friction problem can hold μ only"
    if not 0 < 2 * qvi.m <= LARGEST:
        raise InputError("contact points", qvi.m, f"give a problem with 1 to {LARGEST // 2} of them")
    if qvi.bilateral.any():
        raise InputError("bilateral", f"{int(qvi.bilateral.sum())} points", remedy)
    if qvi.cohesion.any():
        raise InputError("cohesion", float(qvi.cohesion.max()), remedy)
    if np.isfinite(qvi.cap).any():
        raise InputError("cap", float(qvi.cap.min()), remedy)
    if qvi.root is not None and qvi.n <= _ROOTED:
        qvi = replace(qvi, stiffness=replace(qvi.stiffness))  # one of its own: the caller's is left as it is
        qvi.stiffness.use_root()
    nothing = FullForm(qvi, np.zeros(qvi.m, dtype=np.bool_), np.zeros((0, 0)))
    condensed = CondensedForm(nothing).problem
    rows = condensed.contact_rows.toarray()
    root = np.sqrt(np.concatenate([qvi.W, qvi.W]))
    U, sizes, _ = np.linalg.svd(root[:, None] * rows, full_matrices=True)
    k = len(sizes)
    bonded = root * np.concatenate([condensed.n0, condensed.t0])
    order = np.arange(2 * qvi.m).reshape(2, qvi.m).T.ravel()  # N, T of each point
    signs = np.tile([-1.0, 1.0], qvi.m) / root[order]  # D⁻¹ √w
    span = signs[:, None] * (U[:, :k] / sizes)[order]
    V = signs[:, None] * U[order, k:]
    W = span @ span.T
    q = -span @ ((U[:, :k].T @ bonded) / sizes)
    return LocalProblem(W, q, qvi.mu, V, -U[:, k:].T @ bonded, qvi.W)


def state_of(problem: LocalProblem, solution: QVISolution) -> ContactState:
    """Forces, displacements and λ of a solution of the `FrictionQVI` that `problem` was condensed from.

    u = −D⁻¹ m is that of the solution's own multipliers, and λ what explains it best: V λ ≈ u − W r − q.
    """
    qvi = solution.problem
    r = np.column_stack([-qvi.W * qvi.normal(solution.z), qvi.W * qvi.tangential(solution.z)]).ravel()
    u = np.column_stack([-solution.normal_displacement, solution.tangential_displacement]).ravel()
    if not np.isfinite(r).all():
        return ContactState(u, r, np.full(len(problem.s), np.nan))
    lam: Vector = np.asarray(np.linalg.lstsq(problem.V, u - problem.W @ r - problem.q, rcond=None)[0], np.float64)
    return ContactState(u, r, lam)


def siconos_error(problem: LocalProblem, r: Vector, lam: Vector | None = None) -> float:
    """How far forces r (2c,) and multipliers λ (p,) of the equations are from a solution, as Siconos measures it; ≥ 0.

    De Saxcé's form of Coulomb's law, K the cone |r_T| ≤ μ r_N and K* its dual:  K* ∋ u + μ |u_T| e_N ⊥ r ∈ K  at each
    contact, is the fixed point r = P_K(r − (u + μ |u_T| e_N)). Its residual is the natural map F, and the error

        |F(r)|₂ / max(|r|₂, |u|₂, |q|₂),    u = W r + V λ + q,

    the denominator being left out where it is below the machine epsilon; infinite for NaN. It compares displacements
    with forces (ρ = 1 in r − ρ u), so that it depends on their units: it means most where both are dimensionless.
    Where the problem has equations, |Vᵀ r + s|₂ / (1 + |s|₂) is added, as FCLIB's own merit function does
    (`fclib_merit_local`, MERIT_1); λ is then needed.

    Source: `fc2d_compute_error` of Siconos/Numerics (numerics/src/FrictionContact/fc2d_compute_error.c, as of 2021);
    Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, p. 528; De Saxcé and Feng, Math.
    Comput. Modelling 28 (1998).

    Raises
    ------
    InputError
        For wrong shapes, or a missing λ.

    """
    given = {"r": (r, len(problem.q)), "lam": (np.zeros(0) if lam is None else lam, len(problem.s))}
    for name, (value, size) in given.items():
        if np.shape(value) != (size,):
            raise InputError(name, f"shape {np.shape(value)}", f"give shape ({size},)")
    r, lam = (real_array(name, value) for name, (value, _) in given.items())
    u = problem.displacements(r, lam)
    if not np.isfinite(u).all():
        return np.inf
    (r_N, r_T), (u_N, u_T) = r.reshape(-1, 2).T, u.reshape(-1, 2).T
    p_N, p_T = project(problem.mu, r_N - u_N - problem.mu * np.abs(u_T), r_T - u_T)
    error = float(np.hypot(np.linalg.norm(r_N - p_N), np.linalg.norm(r_T - p_T)))
    scale = max(float(np.linalg.norm(each)) for each in (r, u, problem.q))
    if scale > np.finfo(float).eps:
        error /= scale
    equations = problem.V.T @ r + problem.s
    return error + float(np.linalg.norm(equations)) / (1.0 + float(np.linalg.norm(problem.s)))


def project(mu: Vector, x_N: Vector, x_T: Vector) -> tuple[Vector, Vector]:
    """Euclidean projection on |x_T| ≤ μ x_N, contact by contact: itself, the apex, or a point on the nearer edge."""
    size = np.abs(x_T)
    inside = size <= mu * x_N
    below = mu * size <= -x_N
    on_edge = (mu * size + x_N) / (1.0 + mu**2)
    p_N = np.where(below, 0.0, np.where(inside, x_N, on_edge))  # in this order: at μ = 0 "inside" is x_N of any sign
    p_T = np.where(below, 0.0, np.where(inside, x_T, mu * on_edge * np.sign(x_T)))
    return p_N, p_T
