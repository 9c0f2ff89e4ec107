"""(D2) on the unknowns that contact rows touch, in trace coordinates y.

About a point z with the gradient γ of the energy there, eliminating the interior I leaves, for dz_Γ = P⁻¹ D y,

    S_y y + c + Eᵀ m + A_yᵀ ν = 0,    A_y y = b − A z,    (σ_N, σ_T)(z + dz) = (σ_N, σ_T)(z) + E y,
    S_y = D P⁻ᵀ S P⁻¹ D,   c = D P⁻ᵀ (γ_Γ − K_ΓI K_II⁻¹ γ_I),   D with which the diagonal of S_y is 1.

γ is computed without the rounding inside K where the problem has an `EnergyRoot`, so that moving z repairs what S
lacks.

In `docs/theory.md`: (D4).
"""

import numpy as np

from solvers.basics.types import Matrix, SparseRows, Vector
from solvers.condensed.systems import FRICTION_SHARES, MANY_POINTS_SHARES, Base, DenseSystem, Space
from solvers.factorisation.base import State
from solvers.inequality.blocks import Rows, transposed
from solvers.inequality.problem import FrictionQVI


class Reduction(Space):
    """The maps between z and trace coordinates, and S_y.

    Attributes
    ----------
    stiffness : S_y (k, k)
    E : (2m, k) rows, tractions by trace coordinates
    A : A_y (p, k)

    """

    name = "dense"
    stiffness: Matrix

    def __init__(self, qvi: FrictionQVI) -> None:
        interface = qvi.condensed_interface
        self._qvi, self._system, self._interface = qvi, interface.system, interface
        self._coordinates, self._scale = interface.coordinates, interface.scale
        self.stiffness = interface.stiffness
        self.E = interface.rows
        self.A = interface.A
        self._many = not qvi.operator.condensing_pays(qvi)
        self.shares = MANY_POINTS_SHARES if self._many else FRICTION_SHARES

    @property
    def size(self) -> int:
        """Number of trace coordinates k."""
        return len(self._scale)

    def forces(self, rows: Rows) -> Rows:
        """Rowsᵀ (k, q), which turns multipliers of rows (q, k) into forces."""
        return transposed(rows)

    def system(self, S: Matrix | SparseRows) -> DenseSystem:
        """Newton's matrices for S (u, u), that of the coordinates that equations leave free."""
        return DenseSystem(np.asarray(S), many=self._many)

    def base(self, z: Vector) -> Base:
        """The reduced problem about z: one gradient and one forward elimination, at z = 0 those of a problem before."""
        qvi = self._qvi
        strain, gradient = qvi.state(z)
        if z.any():
            reduced, state = self._system.factor.reduce(-gradient)
            energy = qvi.energy(z)  # the interior is in equilibrium there
        else:
            reduced, state, energy = self._at_rest(gradient)
        c = -self._scale * self._coordinates.from_unknowns(reduced)
        return Base(z, c, qvi.b - qvi.arrays.A @ z, qvi.normal(z), qvi.tangential(z), -reduced, strain, energy, state)

    def _at_rest(self, gradient: Vector) -> tuple[Vector, State, float]:
        """The interior eliminated at z = 0, and the energy with y = 0; friction, cohesion and caps change neither."""
        qvi, factor, known = self._qvi, self._system.factor, self._interface.at_rest
        if known is None or known[0] is not qvi.potential:
            reduced, state = factor.reduce(-gradient)
            energy = qvi.energy(factor.expand(state, np.zeros_like(reduced)))
            known = self._interface.at_rest = (qvi.potential, reduced, state, energy)
        return known[1:]

    def move(self, base: Base, y: Vector) -> Vector:
        """The point z + dz whose trace coordinates are y, its interior in equilibrium."""
        return np.asarray(base.z + self._system.factor.expand(base.state, self._unknowns(y)))

    def bonded(self, base: Base) -> Vector:
        """Trace coordinates (k,) of the bonded solution, on which no contact law acts."""
        values, _ = self._system.solve_interface(-base.reduced, base.equality)
        return self._coordinates.from_values(values) / self._scale

    def coordinates(self, z: Vector) -> Vector:
        """Trace coordinates (k,) of a point z (n,), counted from z = 0."""
        return np.asarray(self._coordinates.from_values(z[self._system.interface]) / self._scale)

    def defect(self, before: Base, y: Vector, after: Base) -> float:
        """Energy norm of what the reduced problem missed on the way from one base to the next, y its step."""
        predicted = before.reduced + self._system.schur @ self._unknowns(y)
        missed = after.reduced - predicted
        return float(np.sqrt(abs(missed @ self._system.solve_interface(missed)[0])))

    def _unknowns(self, y: Vector) -> Vector:
        return np.asarray(self._coordinates.to_unknowns(self._scale * y))
