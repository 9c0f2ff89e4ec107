r"""The friction problem at the contacts alone, as rigid-body and contact codes pose it, from a `FrictionQVI`.

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

**FCLIB's files.** HDF5, in the layout of the Frictional Contact Library:

    /fclib_local/spacedim             2
    /fclib_local/W, V, R              a matrix each; V and R only with equations
        m, n, nzmax, nz               rows, columns, entries; −1: compressed columns
        p, i, x                       pointers, indices, values
    /fclib_local/vectors/q, mu, s     s only with equations
    /fclib_local/info/title, description, math_info
    /solution/u, r, l                 l only with equations
    /qvi_contact/weights              this project's: lengths that make forces tractions; other programs pass over it

Integers are 32 bit, numbers 64 bit, all with one dimension. Source: src/fclib.h of FrictionalContactLibrary/fclib, as
of 2018 (functions write_matrix, write_local_vectors, write_solution). The meaning of the arrays is that of
`local_problem`.

Siconos (`frictionContact_fclib_read`) reads W, q and mu and passes over V, R and s: for it write
`LocalProblem.penalised`.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csc_array

from qvi_contact.basics.writing import replacing
from solvers.basics.checks import real_array
from solvers.basics.types import Matrix, Module, Vector, load
from solvers.errors import InputError
from solvers.fixed_point import CondensedForm, FullForm
from solvers.inequality.problem import FrictionQVI
from solvers.solution import QVISolution

LARGEST = 6000
"""Rows 2c up to which problems are taken: their matrices are treated as dense."""


class ContactState(NamedTuple):
    """Displacements u (2c,), forces r (2c,) and multipliers λ (p,) of the equations."""

    u: Vector
    r: Vector
    lam: Vector


@dataclass(frozen=True, eq=False)
class LocalProblem:
    """Problem (L) in the plane, as `local_problem` makes it.

    Attributes
    ----------
    W : (2c, 2c) compliance, symmetric positive semi-definite
    q : (2c,) displacements at r = 0
    mu : (c,) ≥ 0
    V, s : (2c, p) and (p,); V has independent columns, p = 0 without equations
    weights : (c,) > 0, lengths that make forces tractions

    """

    W: Matrix
    q: Vector
    mu: Vector
    V: Matrix
    s: Vector
    weights: Vector

    def displacements(self, r: Vector, lam: Vector) -> Vector:
        """W r + V λ + q (2c,)."""
        return np.asarray(self.W @ r + self.V @ lam + self.q)

    def penalised(self, factor: float = 1e8) -> "LocalProblem":
        """A plain problem whose solutions tend to those of this one like 1 / factor.

        With ω the largest W_ii and d = √(ω / W_ii), equations Uᵀ (r / d) = t with orthonormal columns U become springs
        of compliance factor × ω. For programs that read W, q and μ only; W's condition number grows with the factor.
        """
        diagonal = self.W.diagonal()
        omega = float(diagonal.max())
        d = np.sqrt(omega / np.where(diagonal > 0.0, diagonal, omega))
        U, sizes, Y = np.linalg.svd(d[:, None] * self.V, full_matrices=False)
        pulled, target = U / d[:, None], -(Y @ self.s) / sizes
        W, q = self.W + factor * omega * pulled @ pulled.T, self.q - factor * omega * pulled @ target
        return replace(self, W=W, q=q, V=np.zeros((len(q), 0)), s=np.zeros(0))


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
    nothing = FullForm(qvi, np.zeros(qvi.m, dtype=np.bool_), np.zeros(0, dtype=np.int64), np.zeros(0))
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

    u = −D⁻¹ m has the solution's own multipliers m; λ is the least-squares solution of V λ = u − W r − q.
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


_MATH = (
    "Plane Coulomb friction u = W r + V l + q, V' r + R l + s = 0, R = 0 (V, R only if present; without them "
    "u = W r + q), order (N, T) per contact, r_N >= 0 compression, u_N >= 0 gap. Solutions need not be unique."
)


def write_fclib(
    path: str | Path,
    problem: LocalProblem,
    solution: ContactState | None = None,
    title: str = "",
    description: str = "",
) -> None:
    """Write a local problem, with a solution if there is one.

    Raises
    ------
    InputError
        If the file cannot be written, a state has a wrong shape or is not finite, or h5py is not installed.

    """
    try:
        h5py = load("h5py")
    except ImportError as error:
        raise InputError("h5py", "not installed", "python -m pip install h5py") from error
    sizes = {"u": len(problem.q), "r": len(problem.q), "l": len(problem.s)}
    states = {} if solution is None else dict(zip(sizes, solution, strict=True))
    for name, values in states.items():
        if np.shape(values) != (sizes[name],) or not np.isfinite(values).all():
            raise InputError(f"state/{name}", f"shape {np.shape(values)}", f"give {sizes[name]} finite numbers")
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        local = file.create_group("fclib_local")
        _integers(local, "spacedim", [2])
        _write_matrix(local.create_group("W"), problem.W)
        vectors = local.create_group("vectors")
        vectors["q"], vectors["mu"] = problem.q, problem.mu
        if len(problem.s):
            _write_matrix(local.create_group("V"), problem.V)
            _write_matrix(local.create_group("R"), np.zeros((len(problem.s), len(problem.s))))
            vectors["s"] = problem.s
        info = local.create_group("info")
        for name, text in (("title", title), ("description", description), ("math_info", _MATH)):
            _write_text(h5py, info, name, text)
        if solution is not None:
            group = file.create_group("solution")
            for name, values in states.items():
                if len(values):
                    group[name] = values
        file.create_group("qvi_contact")["weights"] = problem.weights


def _integers(group: Any, name: str, values: Any) -> None:
    group.create_dataset(name, data=np.asarray(values, dtype=np.int32))


def _write_matrix(group: Any, matrix: Matrix) -> None:
    """By compressed columns; the stored entries are those that are not zero, and the diagonal of a zero matrix."""
    sparse = csc_array(matrix)
    if sparse.nnz == 0:  # some readers cannot take an empty array
        places = np.arange(min(matrix.shape))
        sparse = csc_array((np.zeros(len(places)), (places, places)), matrix.shape)
    sparse.sort_indices()
    header = {"nzmax": sparse.nnz, "m": matrix.shape[0], "n": matrix.shape[1], "nz": -1}
    for name, value in header.items():
        _integers(group, name, [value])
    _integers(group, "p", sparse.indptr)
    _integers(group, "i", sparse.indices)
    group["x"] = sparse.data


def _write_text(h5py: Module, group: Any, name: str, text: str) -> None:
    """A scalar string with a terminating zero, as C programs expect."""
    content = text.encode("utf-8")
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(content) + 1)
    kind.set_strpad(h5py.h5t.STR_NULLTERM)
    kind.set_cset(h5py.h5t.CSET_UTF8)
    place = h5py.h5d.create(group.id, name.encode(), kind, h5py.h5s.create(h5py.h5s.SCALAR))
    buffer = np.array(content, dtype=f"S{len(content) + 1}")
    place.write(h5py.h5s.ALL, h5py.h5s.ALL, buffer, mtype=kind)
