"""The frictional contact problem as data: the quasi-variational inequality (D2).

In `docs/theory.md`: (D2).
"""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csc_array, issparse

from solvers.basics.checks import real_array
from solvers.basics.types import BoolVector, IntVector, Matrix, Sparse, Vector
from solvers.errors import InputError
from solvers.inequality.energy import Energy, EnergyRoot
from solvers.inequality.linear import EqualitySystem
from solvers.inequality.rows import absolute_product, by_columns
from solvers.inequality.stiffness import ContactFrame, Equilibrium, Interface, Operator
from solvers.inequality.traces import Traces

__all__ = ["EnergyRoot", "FrictionQVI"]

_ASYMMETRY = 1e-10  # accepted |vᵀKw − wᵀKv| relative to |v|ᵀ|K||w|


class Arrays(NamedTuple):
    """K (n, n), N and T (m, n) and A (p, n) of a problem as products with vectors are taken with them.

    Dense where they are small: the overhead of a sparse product is more than a small product in all.
    """

    K: Any
    N: Any
    T: Any
    A: Any


@dataclass(frozen=True, eq=False)
class FrictionQVI:
    """The algebraic quasi-variational inequality (D2), dimensionless.

        min ½ zᵀKz − fᵀz   s.t.  A z = b,   N z + n0 ≤ 0,   |T z + t0| ≤ thr(s),  s = |N z + n0| at the solution
        thr(s) = min(cohesion + mu s, cap)

    Where a row is bilateral, N z + n0 may have either sign and m_N = 0. Row multipliers are normal m_N ≥ 0, tangential
    m_T (≥ 0 at the upper bound T z + t0 = +thr, ≤ 0 at the lower one) and ν of the equalities:

        K z − f + Nᵀ m_N + Tᵀ m_T + Aᵀ ν = 0.

    Divided by the weights they are displacements: λ = m / W, u_N − g = −λ_N ≤ 0 and u_T − w = −λ_T. Rows of
    N and T may depend linearly on each other; multipliers of single rows are then not unique.

    Attributes
    ----------
    K : (n, n) sparse, symmetric, positive definite on the null space of A
    f : (n,)
    N, T : (m, n) sparse, normal and tangential traction at the contact points
    n0, t0 : (m,), tractions at z = 0
    mu : (m,), friction coefficient at each point, ≥ 0
    W : (m,), quadrature weights, > 0
    A, b : (p, n) sparse and (p,), optional; stored as p = 0 rows when not given
    cohesion, cap : (m,) ≥ 0, optional; 0 and infinity when not given
    bilateral : (m,) bool, optional; nowhere when not given
    traces : `Traces`, optional; coordinates for [N; T], found by dense algebra when not given
    places : (n, 2), optional; where the unknowns are, in any unit: SuperLU then eliminates by nested dissection of
        these places instead of in an order that it finds
    root, load : an `EnergyRoot` and (n,), optional, both or none, with f = load − Rᵀr₀. They give the
        gradient of the energy more accurately than K and f, whose entries may be large and cancel
    shared : the `operator` of another problem with the same K, root and places, optional; see `changed`
    operator : `Operator`, the factorisation of K and what is computed with it, made when it is first needed

    n = 0 is allowed: a statically determinate problem.

    All are converted to float64 (matrices to csc) and checked; what is wrong raises `InputError`.

    """

    K: Sparse
    f: Vector
    N: Sparse
    n0: Vector
    T: Sparse
    t0: Vector
    mu: Vector
    W: Vector
    A: Sparse = None  # type: ignore[assignment]  # None is replaced on construction
    b: Vector = None  # type: ignore[assignment]
    root: EnergyRoot | None = None
    load: Vector | None = None
    cohesion: Vector = None  # type: ignore[assignment]
    cap: Vector = None  # type: ignore[assignment]
    bilateral: BoolVector = None  # type: ignore[assignment]
    traces: Traces | None = None
    places: Matrix | None = None
    shared: InitVar[Operator | None] = None
    operator: Operator = field(init=False, repr=False)

    def __post_init__(self, shared: Operator | None) -> None:
        self._check_kinds()
        for name in ("K", "N", "T", "A"):
            object.__setattr__(self, name, _matrix(name, getattr(self, name), self._columns(name)))
        for name in ("f", "n0", "t0", "mu", "W", "b"):
            object.__setattr__(self, name, _vector(name, getattr(self, name)))
        for name in ("load", "places"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _vector(name, getattr(self, name)))
        for name, missing in (("cohesion", 0.0), ("cap", np.inf)):
            value = np.full(self.m, missing) if getattr(self, name) is None else getattr(self, name)
            object.__setattr__(self, name, _vector(name, value, infinite=name == "cap"))
        object.__setattr__(self, "bilateral", _flags("bilateral", self.bilateral, self.m))
        self._check_shapes()
        object.__setattr__(self, "operator", self._operator(shared))
        self._check_values()
        if shared is None:
            self._check_energy()
        _ = self._frame  # checks the traces

    def _operator(self, shared: Operator | None) -> Operator:
        """The one to share, or a new one."""
        if shared is None:
            return Operator(self.K, self.root, self.places)
        if not shared.serves(self.K):
            raise InputError("shared", None, "share the operator of a problem with the same K")
        return shared

    def _check_kinds(self) -> None:
        for one, other in (("A", "b"), ("root", "load")):
            if (getattr(self, one) is None) != (getattr(self, other) is None):
                missing = one if getattr(self, one) is None else other
                raise InputError(missing, None, f"give {one} and {other} together, or neither")
        if not isinstance(self.traces, Traces | None):
            raise InputError("traces", type(self.traces).__name__, "give Traces, or nothing")

    def _columns(self, name: str) -> int:
        """Columns of the empty matrix that stands for a missing A."""
        return int(self.K.shape[0]) if name == "A" else 0

    def _check_shapes(self) -> None:
        n, m, p = self.K.shape[0], self.N.shape[0], self.A.shape[0]
        expected: dict[str, tuple[int, ...]] = {
            "K": (n, n), "f": (n,), "N": (m, n), "n0": (m,), "T": (m, n), "t0": (m,),
            "mu": (m,), "W": (m,), "A": (p, n), "b": (p,), "cohesion": (m,), "cap": (m,), "bilateral": (m,),
        }  # fmt: skip
        if self.load is not None:
            expected["load"] = (n,)
        if self.places is not None:
            expected["places"] = (n, 2)
        for name, shape in expected.items():
            found = getattr(self, name).shape
            if found != shape:
                raise InputError(name, f"shape {found}", f"give shape {shape}, as K and N say")

    def _check_values(self) -> None:
        if self.m and self.mu.min() < 0:
            raise InputError("mu", float(self.mu.min()), "give friction coefficients ≥ 0")
        for name in ("cohesion", "cap"):
            if self.m and getattr(self, name).min() < 0:
                raise InputError(name, float(getattr(self, name).min()), "give stresses ≥ 0")
        if self.m and self.W.min() <= 0:
            raise InputError("W", float(self.W.min()), "give quadrature weights > 0")

    def _check_energy(self) -> None:
        """What the owner of a shared operator has been asked before."""
        least = float(self.K.diagonal().min(initial=np.inf))
        if least < 0 or (self.p == 0 and least <= 0):
            raise InputError("K", least, "give a positive definite K; its diagonal is > 0")
        asymmetry = _asymmetry(self.K)
        if asymmetry > _ASYMMETRY:
            raise InputError("K", f"asymmetry {asymmetry:.1e}", "give a symmetric K, such as (K + Kᵀ)/2")

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return int(self.K.shape[0])

    @property
    def m(self) -> int:
        """Number of contact points."""
        return int(self.N.shape[0])

    @property
    def p(self) -> int:
        """Number of equality rows."""
        return int(self.A.shape[0])

    def normal(self, z: Vector) -> Vector:
        """Return the normal traction σ_N = N z + n0 (m,), ≤ 0 where admissible."""
        return np.asarray(self.arrays.N @ z + self.n0)

    def tangential(self, z: Vector) -> Vector:
        """Tangential traction σ_T = T z + t0 (m,)."""
        return np.asarray(self.arrays.T @ z + self.t0)

    def pressure(self, z: Vector) -> Vector:
        """Contact pressure s = max(−(N z + n0), 0), where bilateral |N z + n0| (m,)."""
        return self.pressed(self.normal(z))

    def pressed(self, normal: Vector) -> Vector:
        """The pressure s of given normal tractions (m,)."""
        return np.where(self.bilateral, np.abs(normal), np.maximum(-normal, 0.0))

    def threshold(self, pressure: Vector) -> Vector:
        """Bound of |σ_T| for a pressure s: min(cohesion + mu s, cap) (m,)."""
        return np.minimum(self.cohesion + self.mu * pressure, self.cap)

    @property
    def frictionless(self) -> BoolVector:
        """Rows whose bound is zero whatever the pressure (m,)."""
        return np.asarray(((self.mu == 0.0) & (self.cohesion == 0.0)) | (self.cap == 0.0))

    def energy(self, z: Vector) -> float:
        """½ zᵀKz − fᵀz."""
        return self.potential.value(z)

    def strain_energy(self, z: Vector) -> float:
        """½|r(z)|² ≥ 0 where there is a root, else ½ zᵀKz: the size of the energy."""
        return self.potential.strain(z)

    def gradient(self, z: Vector) -> Vector:
        """Gradient of the energy (n,): Rᵀr(z) − load where there is a root, else K z − f."""
        return self.potential.gradient(z)

    def state(self, z: Vector) -> tuple[float, Vector]:
        """`strain_energy` and `gradient` at once."""
        return self.potential.state(z)

    def resultant(self, z: Vector) -> float:
        """Σ W (N z + n0), the resultant normal force (negative in compression)."""
        return float(self.W @ self.normal(z))

    @cached_property
    def potential(self) -> Energy:
        """The energy as an object of its own, the same for problems that differ in friction alone."""
        return self.operator.energy(self)

    @cached_property
    def arrays(self) -> Arrays:
        """K, N, T and A for products."""
        return Arrays(self.operator.array, *self._frame.arrays)

    @property
    def contact_rows(self) -> Sparse:
        """[N; T] (2m, n)."""
        return self._frame.contact_rows

    @property
    def tractions(self) -> tuple[Sparse, Vector]:
        """Rows (r, n) of tractions that do not depend on what N and T make of them, and their weights (r,).

        Trace parameters where there are as many as rows, as where rows are coefficients of the tractions at points;
        else the rows themselves.
        """
        return self._frame.tractions

    @property
    def contacts(self) -> IntVector:
        """(m,) a number for each contact: points hang together through the unknowns that their tractions feel."""
        return self._frame.contacts

    @cached_property
    def _frame(self) -> ContactFrame:
        return self.operator.frame(self)

    @property
    def interface(self) -> Interface:
        """The unknowns that contact and equality rows touch, shared with the problems that have the same rows."""
        return self.operator.equilibrium(self).interface

    def changed(self, **changes: Any) -> FrictionQVI:
        """The same problem with other fields, K, root and places excepted; it shares the operator."""
        return replace(self, **{"shared": self.operator, **changes})

    @property
    def equality_system(self) -> EqualitySystem:
        """The linear system of K and A on the unknowns of the contact, factored on first use and kept by `operator`."""
        return self.condensed_interface.system

    @property
    def linear_system(self) -> EqualitySystem:
        """The same to solve with, whether the unknowns of the contact are eliminated too or not: what costs less."""
        return self.interface.system

    @property
    def condensed_interface(self) -> Interface:
        """What the contact feels, its unknowns kept."""
        return self.operator.equilibrium(self, condensed=True).interface

    @property
    def factorisation(self) -> str:
        """Back end and version of the factorisation made, empty if none was needed."""
        factor = self.operator.factor
        return f"{factor.backend}, {factor.version}" if factor is not None else ""

    @property
    def contact_stiffness(self) -> float:
        """Traction that a unit of displacement λ all along the contact causes, as a scale; 0 where nothing does.

        The spectral radius of Y K⁻¹ Yᵀ W for the rows Y and weights W of `tractions`, by a few steps of power
        iteration, belongs to the finest waves; it is reduced by min W / Σ W to those as long as the contact.
        """
        return self.interface.contact_stiffness if self.m and self.n else 0.0

    @property
    def bonded(self) -> Vector:
        """Minimiser of the energy under A z = b alone (n,): contact that neither opens nor slips.

        Defect corrections with `gradient` remove the rounding of K as long as they shrink.
        """
        return self._bonded.bonded

    @property
    def bonded_error(self) -> float:
        """Error of `bonded` in the energy norm, relative: how far the last defect correction still moved it.

        Where the problem has no root this is not measured, and 0.
        """
        return self._bonded.bonded_error

    @property
    def bonded_energy(self) -> float:
        """Strain energy of `bonded`; 0 if it is rounding, since all loads cancel."""
        return self._bonded.bonded_energy

    def rough_stress(self) -> float:
        """√(2 × strain energy) of the bonded solution by one linear solve, not corrected: its size, not its digits."""
        return self.operator.equilibrium(self).rough_stress()

    @property
    def _bonded(self) -> Equilibrium:
        """With R factorised instead of K if defect corrections shrink too slowly."""
        found = self.operator.equilibrium(self)
        return self.operator.equilibrium(self) if found.is_slow and self.operator.use_root() else found


def _asymmetry(K: Sparse) -> float:
    """|vᵀKw − wᵀKv| / |v|ᵀ|K||w| for two random vectors: an asymmetry does not hide from both."""
    v, w = np.random.default_rng(0).normal(size=(2, K.shape[0]))
    scale = float(np.abs(v) @ absolute_product(K, w))
    return abs(float(v @ (K @ w) - w @ (K @ v))) / scale if scale > 0 else 0.0


def _matrix(name: str, value: Any, columns: int) -> Sparse:
    if value is None:
        if name != "A":
            raise InputError(name, None, "give a matrix")
        return csc_array((0, columns))
    try:
        if np.iscomplexobj(value):
            raise TypeError("complex numbers")
        matrix = by_columns(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(name, type(value).__name__, "give a matrix of real numbers, sparse or dense") from error
    if not issparse(value) and np.ndim(value) != 2:
        raise InputError(name, f"{np.ndim(value)} dimensions", "give a matrix, with two dimensions")
    if not np.isfinite(matrix.data).all():
        raise InputError(name, "NaN or infinity", "give finite numbers")
    return matrix


def _flags(name: str, value: Any, size: int) -> BoolVector:
    flags = np.zeros(size, dtype=np.bool_) if value is None else np.array(value)
    if flags.dtype != np.bool_:
        raise InputError(name, flags.dtype, "give a boolean for each contact point")
    flags.setflags(write=False)
    return flags


def _vector(name: str, value: Any, *, infinite: bool = False) -> Vector:
    vector = real_array(name, [] if value is None and name == "b" else value, "give a vector of real numbers")
    if np.isnan(vector).any() or not (infinite or np.isfinite(vector).all()):
        raise InputError(name, "NaN or infinity", "give finite numbers")
    vector.setflags(write=False)
    return vector
