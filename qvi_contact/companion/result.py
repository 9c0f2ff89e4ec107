"""The answer of the displacement model: displacements, strains, contact traces and forces, and the energy."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, real_array
from qvi_contact.companion.body import Elasticity
from qvi_contact.companion.contact import Contacts, DisplacementContact
from qvi_contact.companion.space import DisplacementSpace
from qvi_contact.discretization.plates import COMPONENTS, centre_of
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import is_frictionless
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import contact_states, turning_senses
from qvi_contact.solution.result import PlateMotion, plate_motion
from qvi_contact.solution.stress import mean_at
from solvers import Certificate, QVISolution, Status
from solvers.basics.names import Named, known_name
from solvers.basics.types import PicklesFields

_DIGITS = 12  # of coordinates over the body's length: more is rounding
_InCells: TypeAlias = Callable[[IntArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class CompanionParts:
    """Parts of the energy J(v) = strain − load + friction, a unit of thickness [stress × length²].

    Attributes
    ----------
    strain : float
        ½ ∫ (ε − ε⁰):C:(ε − ε⁰), the elastic energy, and that of springs; ε⁰ is an initial strain.
    load : float
        ∫ b·v + ∫_{Γσ} T·v + Σ F·q, q the motions of plates under the forces F.
    friction : float
        Σ ∫ s |v_T − w| ds ≥ 0 for given bounds; under the contacts' own laws Σ W_i s_i |c_i − w_i|, no less than that.

    """

    strain: float
    load: float
    friction: float


@dataclass(frozen=True, eq=False)
class CompanionContact:
    """One contact in the displacement model; arrays over the n Bernstein coefficients of its trace.

    Coefficients come in order along the line: by x, and by y where x is the same. Several lines of one contact mix if
    they overlap in x.

    A quantity at a coefficient is no value at a point: a displacement is the coefficient itself, a traction the mean
    weighted by B_i. Coefficients whose displacement supports prescribe carry no traction here; it is the support's.

    Attributes
    ----------
    name : str
        Name of the contact.
    x, y : (n,) arrays
        The coefficients' own points, i/p along each edge [length].
    weights : (n,) array
        ∫ B_i ds [length].
    normal_stress, tangential_stress : (n,) arrays
        Mean tractions [stress], signs as in `ContactLine`, the pressure of a fluid included.
    friction_bound : (n,) array
        Bound of |tangential_stress| [stress]; infinity if tied.
    gap : (n,) array
        g − v_N ≥ 0 [length].
    slip : (n,) array
        v_T − w [length].
    state : (n,) int array
        `ContactState`.
    senses : (n,) array
        ±1, in which sense a tangential stress counts for the force, see `turning_senses`.

    """

    name: str
    x: FloatArray
    y: FloatArray
    weights: FloatArray
    normal_stress: FloatArray
    tangential_stress: FloatArray
    friction_bound: FloatArray
    gap: FloatArray
    slip: FloatArray
    state: IntArray
    senses: FloatArray

    @property
    def normal_force(self) -> float:
        """−∫ σ_N ds, ≥ 0 if unilateral [stress × length]."""
        return -float(self.weights @ self.normal_stress)

    @property
    def tangential_force(self) -> float:
        """∫ ± σ_T ds, force on the body along the contact, as that of `ContactLine` [stress × length]."""
        return float(self.weights @ (self.senses * self.tangential_stress))


@dataclass(frozen=True, eq=False)
class CompanionState:
    """A displacement that meets all conditions, dimensionless."""

    contacts: Contacts  # the contacts; arrays over their n coefficients
    v: FloatArray  # (size,): degrees of freedom, after those of the body the stretches of springs
    c: FloatArray  # (2 n,): relative displacements, normal ones first
    plates: FloatArray  # (q,): motions of plates
    tractions: FloatArray  # (2 n,): τ
    live: BoolArray  # (2 n,): where there is a force, see `DualProblem`; elsewhere τ is zero
    bound: FloatArray  # (n,): bound of |τ_T|
    load: FloatArray  # (size,): load vector
    contradiction: str  # why it does not meet them after all; empty if it does


@dataclass(frozen=True, eq=False, repr=False)
class CompanionResult(PicklesFields):
    """A displacement model solved, or not: check `status`.

    Without a state (loads that cannot be carried, failed back end) everything but status, certificate, message, problem
    and `unknowns` raises `InputError`.

    Attributes
    ----------
    problem : ContactProblem
        The problem.
    scales : Scales
        Units of the dimensionless model.
    body
        The body, dimensionless.
    status : Status
        How the solve ended; ``status.advice`` says what to do.
    certificate : Certificate
        Residuals of the contact problem in its forces.
    message : str
        One sentence about the outcome.
    state : CompanionState or None
        The displacement.
    reasons : tuple of str
        Why the displacement or its energy is not admissible or exact; empty where J(v) is a guaranteed upper bound, for
        data that are between `bernstein.SAMPLES` of every edge the polynomials that they are there.
    solution : QVISolution or None
        The algebraic answer.

    """

    problem: ContactProblem
    scales: Scales
    body: Elasticity
    status: Status
    certificate: Certificate
    message: str
    state: CompanionState | None
    reasons: tuple[str, ...]
    solution: QVISolution | None

    def __repr__(self) -> str:
        return f"<CompanionResult {self.message}>"

    @property
    def space(self) -> DisplacementSpace:
        """The displacement space, dimensionless."""
        return self.body.space

    @property
    def degree(self) -> int:
        """Degree p of the displacements."""
        return self.space.degree

    @property
    def unknowns(self) -> int:
        """Number of displacement unknowns, prescribed ones included."""
        return self.space.size

    @property
    def has_state(self) -> bool:
        """Whether there is a displacement to evaluate."""
        return self.state is not None

    def displacement(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Displacement (u_x, u_y) at points of the body, (...) to (..., 2) [length]; on joints the mean of all sides.

        Raises
        ------
        InputError
            If a point lies outside the body.

        """
        return np.asarray(self._mean(x, y, self._displacement_in) * self.scales.displacement)

    def stress(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Stress (σ_xx, σ_yy, σ_xy) = C (ε − ε⁰) at points of the body, (...) to (..., 3) [stress].

        On edges the mean of the adjacent cells.
        """
        return self._mean(x, y, self._stress_in) * self.scales.stress

    def cell_strain(self, tx: ArrayLike, ty: ArrayLike) -> FloatArray:
        """Strains (ε_xx, ε_yy, 2ε_xy) at reference points (k,) of every cell, (cells, k, 3).

        The point (t_x, t_y) has these barycentric coordinates of the second and third corner. Cells come in the order
        of the mesh.
        """
        strain = self.body.strain(self._v, slice(None), self.space.own(slice(None), _points(tx, ty)))
        return np.asarray(strain * (self.scales.displacement / self.scales.length))

    def cell_displacement(self, tx: ArrayLike, ty: ArrayLike) -> FloatArray:
        """Displacements at such points of every cell, (cells, k, 2) [length]."""
        return np.asarray(self._displacement_in(slice(None), _points(tx, ty)) * self.scales.displacement)

    def cell_stress(self, tx: ArrayLike, ty: ArrayLike) -> FloatArray:
        """Stresses (σ_xx, σ_yy, σ_xy) at such points of every cell, (cells, k, 3) [stress]."""
        return self._stress_in(slice(None), _points(tx, ty)) * self.scales.stress

    def cell_points(self, tx: ArrayLike, ty: ArrayLike) -> FloatArray:
        """Coordinates x, y of such points of every cell, (cells, k, 2) [length]."""
        place = self.space.points(slice(None), self.space.own(slice(None), _points(tx, ty)))
        return np.asarray(self.problem.mesh.origin + self.scales.length * place)

    def displacement_in(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Displacements at one such point each, (n, 2), of cells given by number (n,), shape (n, 2) [length]."""
        return np.asarray(self._displacement_in(cells, t[:, None])[:, 0] * self.scales.displacement)

    def trace(self, name: str, t: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """v_N and v_T at points t (k,), 0 to 1, of a contact's edges, (edges, k) each [length].

        Edges are in the order of ``problem.mesh.edges(contact.edges)``, t runs along their tangents. On a joint these
        are the jumps, on a rigid plate what the body moves beyond it, with springs what these leave of it.
        """
        return self.along(name, self._state.c, t)

    def stretch(self, name: str, t: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """How far springs along a contact yield, as `trace` gives v_N and v_T; 0 where there are none."""
        return self.along(name, self._state.contacts.stretched(self._state.v), t)

    def along(self, name: str, coefficients: FloatArray, t: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Dimensionless coefficients (2 n,) of all contacts as values on the edges of one, as `trace` gives them."""
        traces = {trace.name: trace for trace in self._state.contacts.traces}
        trace = traces[known_name("name", name, {"contacts": list(traces)})]
        shape = bernstein.basis(self.degree, np.atleast_1d(np.asarray(t, dtype=float))) * self.scales.displacement
        normal, tangential = trace.on_edges(*coefficients.reshape(2, -1)[:, trace.here])
        return normal @ shape.T, tangential @ shape.T

    @cached_property
    def parts(self) -> CompanionParts:
        """The parts of the energy [stress × length²]."""
        state, unit = self._state, self.scales.energy
        load = float(state.load @ state.v + state.contacts.resultants @ state.plates)
        friction = 0.0  # ∫ s |v_T − w| ds; under Coulomb's law the sum over coefficients that was minimised
        for trace in state.contacts.traces:
            slip = self._beyond[1, trace.here]
            if trace.contact.law == "tied":
                continue
            if trace.bound is None:
                friction += float(np.sum(trace.weights * state.bound[trace.here] * np.abs(slip)))
            else:
                along = trace.on_edges(slip, slip)[1]
                friction += float(trace.lengths @ bernstein.absolute_integrals(trace.bound, along))
        return CompanionParts(self.body.energy(state.v) * unit, load * unit, friction * unit)

    @property
    def energy(self) -> float:
        """J(v) for the bound s that was used [stress × length²]: an upper bound if `reasons` is empty."""
        parts = self.parts
        return parts.strain - parts.load + parts.friction

    @cached_property
    def contacts(self) -> Mapping[str, CompanionContact]:
        """Results on each contact by name, arrays in order along its line."""
        return MappingProxyType({trace.name: self._contact(trace) for trace in self._state.contacts.traces})

    @cached_property
    def plates(self) -> Mapping[str, PlateMotion]:
        """How far each rigid plate has moved, by the name of its contact, and the forces that are given."""
        scales, found, moved = self.scales, {}, iter(self._state.plates.tolist())
        for trace in self._state.contacts.traces:
            plate = trace.contact.plate
            if plate is not None:
                own = {
                    part: next(moved) * scales.displacement / (scales.length if part == "moment" else 1.0)
                    for part in COMPONENTS
                    if getattr(plate, part) is not None
                }
                found[trace.name] = plate_motion(plate, centre_of(self.problem.mesh, trace.edges), own)
        return MappingProxyType(Named("plates", "contacts with a plate or pin", found))

    @property
    def _state(self) -> CompanionState:
        if self.state is None:
            raise InputError("companion", self.status.value, f"there is no displacement to evaluate: {self.message}")
        return self.state

    @property
    def _beyond(self) -> FloatArray:
        """C less g and w (2, n)."""
        return (self._state.c - self._state.contacts.obstacle).reshape(2, -1)

    @property
    def _v(self) -> FloatArray:
        return self._state.v[: self.space.size]

    def _contact(self, trace: DisplacementContact) -> CompanionContact:
        state, scales, chosen = self._state, self.scales, trace.here
        n = state.contacts.count
        normal, tangential, bound = state.tractions[:n][chosen], state.tractions[n:][chosen], state.bound[chosen]
        gap, slip = -self._beyond[0, chosen], self._beyond[1, chosen]
        unit = max(self.certificate.scales.get("stress", 1.0), 1e-300)
        may_open = trace.contact.law == "unilateral"
        frictionless = is_frictionless(trace.contact)
        states = contact_states(
            normal, tangential, bound, gap, slip, unit, may_open=may_open, frictionless=frictionless
        )
        order = np.lexsort(np.round(trace.places, _DIGITS).T[::-1])
        x, y = (self.problem.mesh.origin + scales.length * trace.places).T
        fluid = np.where(state.live[:n][chosen], state.contacts.fluid[:n][chosen] / trace.weights, 0.0)
        stresses = (scales.stress * part for part in (normal - fluid, tangential, bound))
        moved = (scales.displacement * part for part in (gap, slip))
        senses = trace.by_coefficient(turning_senses(self.problem.mesh.vertices, trace.edges))
        parts = (x, y, trace.weights * scales.length, *stresses, *moved, states, senses)
        return CompanionContact(trace.name, *(part[order] for part in parts))

    def _displacement_in(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        local = self._v.reshape(-1, 2)[self.space.table[cells]]
        return np.asarray(self.space.cell.values(self.space.own(cells, t)) @ local)

    def _stress_in(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        return self.body.stress(self._v, cells, self.space.own(cells, t))

    def _mean(self, x: ArrayLike, y: ArrayLike, values: _InCells) -> FloatArray:
        """Mean of what the cells that hold a point say."""
        try:
            px, py = np.broadcast_arrays(real_array("x", x), real_array("y", y))
        except ValueError as error:
            raise InputError("x, y", (x, y), "give numbers or arrays whose shapes go together") from error
        _ = self._state
        return mean_at(
            self.problem.mesh, px, py, lambda cell, t: values(cell, np.clip(t[..., 1:], 0.0, 1.0))[:, 0], "x, y"
        )


def _points(tx: ArrayLike, ty: ArrayLike) -> FloatArray:
    """Reference points (k, 2)."""
    return np.stack([np.atleast_1d(np.asarray(part, dtype=float)) for part in (tx, ty)], axis=-1)
