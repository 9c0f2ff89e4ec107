"""The frictional contact problem as data: the quasi-variational inequality (D2), in its four parts.

In `docs/theory.md`: (D2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import Any, cast

import numpy as np

from solvers.basics.types import BoolVector, Matrix, PicklesFields, Sparse, Vector
from solvers.errors import InputError
from solvers.inequality.body import BondedState, EnergyRoot, Loads, Stiffness
from solvers.inequality.contact import CondensedContact, ContactMatrices, EqualitySystem
from solvers.inequality.rows import checked_vector, dense, generic_vector
from solvers.inequality.traces import TractionFactor

__all__ = ["ContactMatrices", "EnergyRoot", "FrictionQVI", "Law", "Loads", "Stiffness"]

_FIXED = 1e-11  # change of a traction, over its terms, that is rounding


@dataclass(frozen=True, eq=False)
class Law(PicklesFields):
    """The contact law at m points: σ_N ≤ 0 unless bilateral, |σ_T| ≤ min(cohesion + mu s, cap) for the pressure s."""

    mu: Vector
    """(m,), friction coefficient at each point, ≥ 0."""
    cohesion: Vector = None  # type: ignore[assignment]  # None is replaced on construction
    cap: Vector = None  # type: ignore[assignment]
    """(m,) ≥ 0, optional; 0 and infinity when not given."""
    bilateral: BoolVector = None  # type: ignore[assignment]
    """(m,) bool, optional; nowhere when not given."""

    def __post_init__(self) -> None:
        for name, quantity in (("mu", "friction coefficients"), ("cohesion", "stresses"), ("cap", "stresses")):
            value = getattr(self, name)
            if value is None and name != "mu":
                value = np.full_like(self.mu, 0.0 if name == "cohesion" else np.inf)
            vector = checked_vector(name, value, infinite=name == "cap")
            if (least := float(vector.min(initial=0.0))) < 0:
                raise InputError(name, least, f"give {quantity} ≥ 0")
            object.__setattr__(self, name, vector)
        flags = np.zeros(self.mu.shape, dtype=np.bool_) if self.bilateral is None else np.array(self.bilateral)
        if flags.dtype != np.bool_:
            raise InputError("bilateral", flags.dtype, "give a boolean for each contact point")
        flags.setflags(write=False)
        object.__setattr__(self, "bilateral", flags)

    def pressed(self, normal: Vector) -> Vector:
        """Pressure s (m,) of normal tractions (m,): max(−σ_N, 0), at bilateral points |σ_N|."""
        return np.where(self.bilateral, np.abs(normal), np.maximum(-normal, 0.0))

    def threshold(self, pressure: Vector) -> Vector:
        """Bound of |σ_T| for a pressure s: min(cohesion + mu s, cap) (m,)."""
        return np.minimum(self.cohesion + self.mu * pressure, self.cap)

    @property
    def frictionless(self) -> BoolVector:
        """Points (m,) bool whose friction bound is zero whatever the pressure."""
        return np.asarray(((self.mu == 0.0) & (self.cohesion == 0.0)) | (self.cap == 0.0))

    @property
    def moving(self) -> BoolVector:
        """Points (m,) bool whose friction bound depends on the pressure."""
        return np.asarray((self.mu > 0.0) & (self.cap > self.cohesion))


@dataclass(frozen=True, eq=False)
class FrictionQVI(PicklesFields):
    """The algebraic quasi-variational inequality (D2), dimensionless.

        min ½ zᵀKz − fᵀz   s.t.  A z = b,   N z + n0 ≤ 0,   |T z + t0| ≤ thr(s),  s = |N z + n0| at the solution
        thr(s) = min(cohesion + mu s, cap)

    At a bilateral point N z + n0 may have either sign, and m_N = 0. The row multipliers are the normal m_N ≥ 0, the
    tangential m_T (≥ 0 at the upper bound T z + t0 = +thr, ≤ 0 at the lower one) and ν of the equations:

        K z − f + Nᵀ m_N + Tᵀ m_T + Aᵀ ν = 0.

    Divided by the weights they are displacements: λ = m / W, u_N − g = −λ_N ≤ 0 and u_T − w = −λ_T. If rows of N and
    T are linearly dependent, the multipliers of single rows are not unique.

    Each part keeps the quantities that were computed from it, and problems may share parts. A load step is
    `with_loads`, a value of a sweep over friction `with_law`: both use the factorisation of the first problem. n = 0 is
    allowed, for a statically determinate problem.

    The data of the parts are attributes of the problem too, as in `qvi.f`; there `qvi.K`, `N`, `T`, `A` and
    `contact_rows` [N; T] are in compressed columns. Raises `InputError` if shapes disagree.
    """

    stiffness: Stiffness
    """K and its factorisation."""
    contact: ContactMatrices
    """N, T, W, A, traces."""
    loads: Loads
    """f, n0, t0, b, and the bonded state."""
    law: Law
    """mu, cohesion, cap, bilateral."""

    K = cast("Sparse", property(attrgetter("stiffness.by_columns")))
    N = cast("Sparse", property(lambda self: self.contact.by_columns["N"]))
    T = cast("Sparse", property(lambda self: self.contact.by_columns["T"]))
    W = cast("Vector", property(attrgetter("contact.W")))
    A = cast("Sparse", property(lambda self: self.contact.by_columns["A"]))
    contact_rows = cast("Sparse", property(lambda self: self.contact.by_columns["rows"]))
    traces = cast("TractionFactor | None", property(attrgetter("contact.traces")))
    f = cast("Vector", property(attrgetter("loads.f")))
    n0 = cast("Vector", property(attrgetter("loads.n0")))
    t0 = cast("Vector", property(attrgetter("loads.t0")))
    b = cast("Vector", property(attrgetter("loads.b")))
    root = cast("EnergyRoot | None", property(attrgetter("loads.root")))
    load = cast("Vector | None", property(attrgetter("loads.load")))
    mu = cast("Vector", property(attrgetter("law.mu")))
    cohesion = cast("Vector", property(attrgetter("law.cohesion")))
    cap = cast("Vector", property(attrgetter("law.cap")))
    bilateral = cast("BoolVector", property(attrgetter("law.bilateral")))
    frictionless = cast("BoolVector", property(attrgetter("law.frictionless")))

    def __post_init__(self) -> None:
        kinds = {"stiffness": Stiffness, "contact": ContactMatrices, "loads": Loads, "law": Law}
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                remedy = f"give {kind.__name__}, or the arrays of a problem to FrictionQVI.from_arrays"
                raise InputError(name, type(getattr(self, name)).__name__, remedy)
        n, m, p = self.n, self.m, self.p
        loads, contact, law = self.loads, self.contact, self.law
        for name, array, shape in (
            ("f", loads.f, (n,)), ("n0", loads.n0, (m,)), ("t0", loads.t0, (m,)), ("b", loads.b, (p,)),
            ("load", loads.f if loads.load is None else loads.load, (n,)),
            ("N", contact.N, (m, n)), ("T", contact.T, (m, n)), ("W", contact.W, (m,)), ("A", contact.A, (p, n)),
            ("mu", law.mu, (m,)), ("cohesion", law.cohesion, (m,)), ("cap", law.cap, (m,)),
            ("bilateral", law.bilateral, (m,)),
        ):  # fmt: skip
            if array.shape != shape:
                raise InputError(name, f"shape {array.shape}", f"give shape {shape}, as K and N say")
        if p == 0:
            self.stiffness.check_diagonal(least=np.finfo(np.float64).tiny)
        _ = self.contact.rows  # checks the traces

    @classmethod
    def from_arrays(
        cls,
        K: Any,
        f: Any,
        N: Any,
        n0: Any,
        T: Any,
        t0: Any,
        mu: Any,
        W: Any,
        A: Any = None,
        b: Any = None,
        root: EnergyRoot | None = None,
        load: Any = None,
        cohesion: Any = None,
        cap: Any = None,
        bilateral: Any = None,
        traces: TractionFactor | None = None,
        places: Matrix | None = None,
    ) -> FrictionQVI:
        """The problem with these arrays and matrices, dense or sparse, which the classes of the parts describe.

        They are checked, with `InputError`, and converted to float64 (sparse matrices to csc).
        """
        stiffness, contact = Stiffness(K, places), ContactMatrices(N, T, W, A, traces)
        return cls(stiffness, contact, Loads(f, n0, t0, b, root, load), Law(mu, cohesion, cap, bilateral))

    def with_contact(self, **changes: Any) -> FrictionQVI:
        """The problem with other fields of its `ContactMatrices`; the factorisation is used again if it fits."""
        return replace(self, contact=replace(self.contact, **changes))

    def with_loads(self, **changes: Any) -> FrictionQVI:
        """The problem with other fields of its `Loads`."""
        return replace(self, loads=replace(self.loads, **changes))

    def with_law(self, **changes: Any) -> FrictionQVI:
        """The problem with other fields of its `Law`."""
        return replace(self, law=replace(self.law, **changes))

    def with_bound(self, bound: Vector) -> FrictionQVI:
        """The problem with |σ_T| ≤ bound (m,), whatever the pressure."""
        return self.with_law(mu=np.zeros(self.m), cohesion=bound, cap=None)

    @cached_property
    def n(self) -> int:
        """Number of unknowns."""
        return int(self.stiffness.K.shape[0])

    @cached_property
    def m(self) -> int:
        """Number of contact points."""
        return int(self.contact.N.shape[0])

    @cached_property
    def p(self) -> int:
        """Number of equality rows."""
        return int(self.contact.A.shape[0])

    def normal(self, z: Vector) -> Vector:
        """Normal traction σ_N = N z + n0 (m,), tension positive."""
        return np.asarray(self.contact.N @ z + self.loads.n0)

    def tangential(self, z: Vector) -> Vector:
        """Tangential traction σ_T = T z + t0 (m,)."""
        return np.asarray(self.contact.T @ z + self.loads.t0)

    def tractions(self, z: Vector) -> Vector:
        """Tractions (σ_N, σ_T) (2m,)."""
        return np.asarray(self.contact.rows @ z + self.loads.tractions)

    def pressure(self, z: Vector) -> Vector:
        """Contact pressure s = max(−(N z + n0), 0), at bilateral points |N z + n0| (m,)."""
        return self.law.pressed(self.normal(z))

    def threshold(self, pressure: Vector) -> Vector:
        """Bound of |σ_T| for a pressure s: min(cohesion + mu s, cap) (m,)."""
        return self.law.threshold(pressure)

    def energy(self, z: Vector) -> float:
        """½ zᵀKz − fᵀz."""
        return float(0.5 * z @ (self.stiffness.K @ z) - self.loads.f @ z)

    def gradient(self, z: Vector) -> Vector:
        """Gradient of the energy (n,): Rᵀr(z) − load with an `EnergyRoot`, else K z − f."""
        return self.state(z)[1]

    def state(self, z: Vector) -> tuple[float, Vector]:
        """The strain energy, ½|r(z)|² ≥ 0 with an `EnergyRoot`, else ½ zᵀKz, and the `gradient`."""
        return self.loads.state(self.stiffness.K, z)

    def resultant(self, z: Vector) -> float:
        """Σ W (N z + n0), the resultant normal force (negative in compression)."""
        return float(self.W @ self.normal(z))

    @property
    def linear_system(self) -> EqualitySystem:
        """The linear system of K and A; the unknowns of the contact may be eliminated or kept."""
        return self.stiffness.condensed(self.contact).system

    @property
    def condensed_contact(self) -> CondensedContact:
        """The contact with a factorisation of K that keeps the unknowns of the contact; made on first use."""
        return self.stiffness.condensed(self.contact, wide=True)

    @property
    def factorisation(self) -> str:
        """Back end and version of the factorisation of K, empty if none was made."""
        factor = self.stiffness.factor
        return f"{factor.backend}, {factor.version}" if factor is not None else ""

    @cached_property
    def is_fixed(self) -> bool:
        """Whether the equations alone determine all tractions; without rows or unknowns of the contact nothing varies.

        A generic vector, less its projection on the rows of A, must not change any traction by more than rounding. The
        entries z_i √K_ii of vectors have one unit.
        """
        columns, touched = self.contact.equated, self.contact.touched
        if not self.p or len(touched) > len(columns):
            return not len(touched)
        units, v = 1.0 / np.sqrt(self.stiffness.positive_diagonal[columns]), generic_vector(len(columns))
        A, rows = dense(self.contact.A[:, columns]) * units, cast("Any", self.contact.rows[:, columns])
        lengths = np.linalg.norm(A, axis=1)
        A = A / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        moved = rows @ (units * (v - np.linalg.lstsq(A, A @ v, rcond=None)[0]))
        return bool((np.abs(moved) <= _FIXED * (abs(rows) @ (units * np.abs(v)))).all())

    @cached_property
    def contact_stiffness(self) -> float:
        """Scale of the traction that a unit of displacement λ along the whole contact causes; 0 if it causes none.

        A few steps of power iteration give the spectral radius of Y K⁻¹ Yᵀ W, for the rows Y and weights W of
        `ContactMatrices.tractions`. That is the stiffness for the shortest waves; times 2 min W / Σ W it is the
        stiffness for waves as long as the contact.
        """
        return 0.0 if self.is_fixed else self.stiffness.condensed(self.contact).contact_stiffness

    @property
    def bonded_state(self) -> BondedState:
        """The minimiser of the energy under A z = b alone, with its energy and error."""
        return self.loads.bonded(self.stiffness.K, self.stiffness.condensed(self.contact))

    @property
    def bonded(self) -> Vector:
        """Minimiser of the energy under A z = b alone (n,): the contact neither opens nor slips.

        Defect corrections with `gradient` remove the rounding error of K.
        """
        return self.bonded_state.corrected[0]


# The compliance of the body at the contact points: σ = σ_bonded − C m with C = B K⁻¹ Bᵀ, B = [N; T].


class Compliance:
    """The affine map from row multipliers m = (m_N, m_T) to tractions σ = (σ_N, σ_T), K factored once.

    With equality rows K⁻¹ is that of the constrained system.

    Attributes
    ----------
    bonded : σ_bonded (2m,)
    dense : C (2m, 2m)

    """

    def __init__(self, qvi: FrictionQVI) -> None:
        self.qvi, self._condensed = qvi, qvi.condensed_contact  # whose factorisation serves the bonded state too
        self.bonded = qvi.tractions(qvi.bonded)
        self.dense = self._condensed.compliance

    def state(self, m: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """The state (z, m_N, m_T, ν) that minimises the energy under the multipliers m (2m,)."""
        qvi, forces = self.qvi, self.qvi.contact.rows.T @ m
        z, nu = self._condensed.minimiser(qvi.f - forces, qvi.b, lambda z: qvi.state(z)[1] + forces)
        return z, m[: qvi.m], m[qvi.m :], nu
