"""The answer to a contact problem: status, certificate, stresses, contact tractions, forces and energies."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.checks import FloatArray
from qvi_contact.conditions import Displacement, Traction
from qvi_contact.contact import ContactLine, contact_line
from qvi_contact.discretization import Discretization
from qvi_contact.element import GAUSS_COUNT
from qvi_contact.errors import InputError
from qvi_contact.loads import LOAD_POINTS, cell_points, physical, potential_at, prescribed_at_points
from qvi_contact.mesh import HORIZONTAL, VERTICAL
from qvi_contact.problem import ContactProblem
from qvi_contact.stress import cell_stress, stress_at
from qvi_contact.traces import EdgePoints
from solvers import Certificate, Iteration, QVISolution, Status


@dataclass(frozen=True)
class Resultant:
    """Resultant of the tractions on an edge set, a unit of thickness.

    Attributes
    ----------
    x, y : float
        Force on the body [stress × length].
    moment : float
        Moment about the origin of coordinates, counterclockwise [stress × length²].

    """

    x: float
    y: float
    moment: float


@dataclass(frozen=True)
class Energies:
    """Energies a unit of thickness [stress × length²].

    Attributes
    ----------
    strain : float
        ½∫ cσ:σ dx, strain energy of the body.
    load : float
        ∫_{Γ_u} U·σn ds + ∫_{Γ_μ} (g σ_N + w σ_T) ds, work of the prescribed displacements.
    complementary : float
        strain − load: what the stress minimises over the admissible stresses with the friction bound held fixed.
    dissipation : float
        −∫ σ_T (u_T − w) ds ≥ 0, work lost in friction.

    """

    strain: float
    load: float
    complementary: float
    dissipation: float


@dataclass(frozen=True, eq=False)
class ContactResult:
    """A solved (or failed) contact problem.

    Check `status` before using the rest: only `Status.SOLVED` means that the certificate passed on the original data.
    Without a stress state (infeasible problem, failed back end) fields and contacts raise `InputError`; an infeasible
    problem has none even if an iteration left one behind.

    Attributes
    ----------
    discretization : Discretization
        The problem, its mesh and its algebraic form.
    solution : QVISolution
        The algebraic answer, dimensionless.

    """

    discretization: Discretization
    solution: QVISolution

    @property
    def problem(self) -> ContactProblem:
        """The problem that was solved."""
        return self.discretization.problem

    @property
    def status(self) -> Status:
        """How the solve ended; ``status.advice`` says what to do."""
        return self.solution.status

    @property
    def message(self) -> str:
        """One sentence about the outcome."""
        return self.solution.message

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know about how the data were taken, such as shears that disagree in a corner; one sentence each."""
        remarks = self.discretization.remarks
        if self.traction_misfit > 1e-6 * self.discretization.scales.stress:
            remarks += (
                f"Computed tractions differ from the prescribed ones by up to {self.traction_misfit:.3g} [stress] at "
                "single points; every edge keeps their resultant force and moment. Refine there for less.",
            )
        return remarks

    @cached_property
    def traction_misfit(self) -> float:
        """Largest difference between prescribed and computed tractions on Γ_σ [stress].

        Zero (to round-off) for data in the trace space: normal tractions linear along each edge, shear continuous and
        quadratic. Other data are met in resultant force and moment of every edge; this is what is left pointwise.
        """
        data = prescribed_at_points(self.problem, self.discretization.grid, self.discretization.scales, Traction)
        differences = [np.abs(self._tractions(points)[component] - wanted).max() for component, points, wanted in data]
        return float(max(differences, default=0.0))

    @property
    def certificate(self) -> Certificate:
        """Residuals of the quasi-variational inequality, computed on the original data."""
        return self.solution.certificate

    @property
    def history(self) -> tuple[Iteration, ...]:
        """One record for each outer iteration."""
        return tuple(self.solution.history)

    @property
    def iterations(self) -> int:
        """Number of outer iterations."""
        return self.solution.iterations

    @cached_property
    def nodal(self) -> FloatArray:
        """Scaled dimensionless nodal values of Φ, shape (ny + 1, nx + 1, 4); see `Discretization.nodal_values`."""
        z = self.solution.z
        if self.status is Status.INFEASIBLE or not np.isfinite(z).all():
            raise InputError("result", self.status.value, f"there is no stress state to evaluate: {self.message}")
        return self.discretization.nodal_values(z)

    def stress(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Stress at points of the body.

        Parameters
        ----------
        x, y : array_like
            Coordinates [length], broadcast against each other.

        Returns
        -------
        (..., 3) array
            σ_xx, σ_yy, σ_xy [stress], tension positive; on interior grid lines the mean of the adjacent cells.

        Raises
        ------
        InputError
            If a point lies outside the body.

        """
        try:
            points_x, points_y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        except (TypeError, ValueError) as error:
            raise InputError("stress(x, y)", (x, y), "give numbers or arrays whose shapes go together") from error
        return stress_at(self.discretization, self.nodal, points_x, points_y)

    def gauss_stress(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates x, y [length] of the 4×4 Gauss points of each cell, shape (cells, 16), and the stress there.

        The stress has shape (cells, 16, 3) [stress]. Cells are counted row by row from the bottom left.
        """
        points, _, stress = self._gauss()
        x, y = physical(self.problem, self.discretization.scales, points)
        return x, y, stress * self.discretization.scales.stress

    @cached_property
    def contacts(self) -> Mapping[str, ContactLine]:
        """Results on each contact by name."""
        normal = self.solution.problem.N @ self._z + self.solution.problem.n0
        tangential = self.solution.problem.T @ self._z + self.solution.problem.t0
        unit = self.certificate.scales.get("stress", 1.0)
        multipliers = self.solution.normal_multiplier, self.solution.tangential_multiplier
        return MappingProxyType(
            {
                rows.name: contact_line(self.discretization, rows, normal, tangential, *multipliers, unit=unit)
                for rows in self.discretization.contacts
            }
        )

    def resultant(self, edges: str) -> Resultant:
        """Resultant of the computed tractions σn on the named edge set."""
        mesh, scales = self.problem.mesh, self.discretization.scales
        points = EdgePoints(self.discretization.grid, mesh.boundary.take(mesh.edge_set(edges)), LOAD_POINTS)
        x, y = physical(self.problem, scales, points.coordinates)
        force_x, force_y = scales.length * points.weights * self._tractions(points)
        return Resultant(float(force_x.sum()), float(force_y.sum()), float((x * force_y - y * force_x).sum()))

    @cached_property
    def energies(self) -> Energies:
        """Energies of the computed state."""
        _, weights, stress = self._gauss()
        scales, problem = self.discretization.scales, self.problem
        strain_work = np.einsum("cgk,ckl,cgl->cg", stress, problem.compliances / scales.compliance, stress)
        strain = 0.5 * float((weights * strain_work).sum()) * scales.energy
        load, dissipation = self._prescribed_work(), 0.0
        for rows in self.discretization.contacts:
            line = self.contacts[rows.name]
            gap, offset = rows.gap * scales.displacement, rows.offset * scales.displacement
            load += float(line.weights @ (gap * line.normal_stress + offset * line.tangential_stress))
            dissipation -= float(line.weights @ (line.tangential_stress * line.slip))
        return Energies(strain, load, strain - load, dissipation)

    @property
    def _z(self) -> FloatArray:
        _ = self.nodal  # says what is wrong if there is none
        return np.asarray(self.solution.z)

    def _gauss(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Dimensionless Gauss points, weights and stresses of all cells."""
        row, column = np.nonzero(self.problem.mesh.active)
        points, weights, (tx, ty) = cell_points(self.discretization.grid, column, row, GAUSS_COUNT)
        stress = cell_stress(self.discretization, self.nodal, column[:, None], row[:, None], tx, ty)
        stress[..., :2] += potential_at(self.problem, self.discretization.scales, points)[..., None]
        return points, weights, stress

    def _tractions(self, points: EdgePoints) -> FloatArray:
        """Traction σn [stress] at points of the boundary, shape (2, points)."""
        problem, scales = self.problem, self.discretization.scales
        potential = points.point_sign * potential_at(problem, scales, points.coordinates)
        is_normal = [points.point_axis == VERTICAL, points.point_axis == HORIZONTAL]
        values = [points.traction(c) @ self.nodal.ravel() + is_normal[c] * potential for c in (0, 1)]
        return scales.stress * np.stack(values)

    def _prescribed_work(self) -> float:
        """∫_{Γ_u} U·σn ds."""
        scales, work = self.discretization.scales, 0.0
        for component, points, values in prescribed_at_points(
            self.problem, self.discretization.grid, scales, Displacement
        ):
            work += scales.length * float(points.weights @ (values * self._tractions(points)[component]))
        return work
