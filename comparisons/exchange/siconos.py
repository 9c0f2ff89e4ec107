"""How far forces are from solving a local friction problem, as Siconos measures it.

De Saxcé's form of Coulomb's law, K the cone |r_T| ≤ μ r_N and K* its dual:  K* ∋ u + μ |u_T| e_N ⊥ r ∈ K  at each
contact, is the fixed point r = P_K(r − (u + μ |u_T| e_N)). Its residual is the natural map F, and the error

    |F(r)|₂ / max(|r|₂, |u|₂, |q|₂),    u = W r + V λ + q,

the denominator being left out where it is below the machine epsilon. It compares displacements with forces (ρ = 1 in
r − ρ u), so that it depends on their units: it means most where both are dimensionless. Source: `fc2d_compute_error` of
Siconos/Numerics (numerics/src/FrictionContact/fc2d_compute_error.c, as of 2021); Acary and Brogliato, Numerical Methods
for Nonsmooth Dynamical Systems, 2008, p. 528; De Saxcé and Feng, Math. Comput. Modelling 28 (1998). Its version of 2018
divided by |q|₂ alone: ``relative_to="q"``.

Where the problem has the equations Vᵀ r + R λ + s = 0 of FCLIB's mixed form, |Vᵀ r + R λ + s|₂ / (1 + |s|₂) is added,
as FCLIB's own merit function does (`fclib_merit_local`, MERIT_1).
"""

from typing import Literal

import numpy as np

from comparisons.exchange.local import LocalProblem
from solvers.basics.checks import real_array
from solvers.basics.types import Vector
from solvers.errors import InputError


def siconos_error(
    problem: LocalProblem, r: Vector, lam: Vector | None = None, relative_to: Literal["largest", "q"] = "largest"
) -> float:
    """Siconos' error of forces r (2c,) and multipliers λ (p,) of the equations, ≥ 0; infinite for NaN.

    The formulas stand in the module's docstring. λ is needed where there are equations. u is computed from r.

    Raises
    ------
    InputError
        For wrong shapes, a missing λ, or an unknown `relative_to`.

    """
    if relative_to not in ("largest", "q"):
        raise InputError("relative_to", relative_to, 'give "largest" or "q"')
    r = _vector("r", r, len(problem.q))
    lam = _vector("lam", np.zeros(0) if lam is None else lam, len(problem.s))
    u = problem.displacements(r, lam)
    if not np.isfinite(u).all():
        return np.inf
    norm_q = float(np.linalg.norm(problem.q))
    scale = norm_q if relative_to == "q" else max(float(np.linalg.norm(r)), float(np.linalg.norm(u)), norm_q)
    error = float(np.linalg.norm(natural_map(problem.mu, r, u)))
    if scale > np.finfo(float).eps:
        error /= scale
    equations = problem.V.T @ r + problem.R @ lam + problem.s
    return error + float(np.linalg.norm(equations)) / (1.0 + float(np.linalg.norm(problem.s)))


def natural_map(mu: Vector, r: Vector, u: Vector) -> Vector:
    """F(r) = r − P_K(r − u − μ |u_T| e_N), (2c,), order (N, T) per contact."""
    r_N, r_T = r[0::2], r[1::2]
    u_N, u_T = u[0::2], u[1::2]
    p_N, p_T = project(mu, r_N - u_N - mu * np.abs(u_T), r_T - u_T)
    return np.column_stack([r_N - p_N, r_T - p_T]).ravel()


def project(mu: Vector, x_N: Vector, x_T: Vector) -> tuple[Vector, Vector]:
    """Euclidean projection on |x_T| ≤ μ x_N, contact by contact: itself, the apex, or a point on the nearer edge."""
    size = np.abs(x_T)
    inside = size <= mu * x_N
    below = mu * size <= -x_N
    on_edge = (mu * size + x_N) / (1.0 + mu**2)
    p_N = np.where(below, 0.0, np.where(inside, x_N, on_edge))  # in this order: at μ = 0 "inside" is x_N of any sign
    p_T = np.where(below, 0.0, np.where(inside, x_T, mu * on_edge * np.sign(x_T)))
    return p_N, p_T


def _vector(name: str, value: Vector, size: int) -> Vector:
    vector = real_array(name, value)
    if vector.shape != (size,):
        raise InputError(name, f"shape {vector.shape}", f"give shape ({size},)")
    return vector
