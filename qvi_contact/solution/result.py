"""The answer to a contact problem: status, certificate, stresses, contact tractions, forces and energies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray, real_array
from qvi_contact.basics.shown import SHARE, Rounding
from qvi_contact.basics.units import Units
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import LOAD_POINTS, ContactRows, EdgePoints, physical
from qvi_contact.discretization.plates import centre_of
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import edge_ends
from qvi_contact.problem.conditions import DRIVES, RigidPlate, Symmetry, has_coulomb
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import ContactLine, ContactState, contact_line, summary_units
from qvi_contact.solution.stress import cell_stresses, cell_weights, stress_at, stress_rounding
from qvi_contact.solution.work import misfit_of_tractions, normal_and_shear, support_work, traction
from solvers import Certificate, Iteration, QVISolution, Status
from solvers.basics.frames import columns_of, frame, pandas
from solvers.basics.names import Named, known_name
from solvers.basics.types import Stated, load
from solvers.certificate.feasibility import AdmissibleRows
from solvers.factorisation import FactorisationError

if TYPE_CHECKING:
    from pandas import DataFrame

    from qvi_contact.bracket import Bracket, Uniqueness
    from qvi_contact.mechanism import Mechanism
    from qvi_contact.solution.loose import LooseBody

_LEAST_SHOWN: Final = 1e-6  # of the units of a result: what is larger is shown however bad the certificate is
_ROUNDED = 1e-6
_FAR = 1e4  # gaps over displacements above which rounding of gaps is what an inaccurate result lacks
_COUNTED = 1e-6  # share of the certificate's unit of stress that tractions reach where it is theirs
_NOTHING = 1e-9  # share of it below which they are none
"""Share of the stress in which rounding of single stresses is worth a remark."""

_LARGE_FRICTION = 1.0
"""Friction up to which nothing is said of other solutions: those that are known are of 2 and more."""

_EXCESS = 1e-2
"""Share of a contact's largest traction by which friction may leave its bound between points without a remark."""

_EDGES_IN_CONTACT = 4
"""Edges of an arc below which a contact zone is too short for them."""

PLATE_COLUMNS: Final = {
    "moved_x": "displacement", "moved_y": "displacement", "rotation": "", "force_x": "engineering_force",
    "force_y": "engineering_force", "moment": "engineering_moment",
}  # fmt: skip
"""Which of the `Units` the columns of plates are in; the rotation in rad."""

_WITH_PLATE: Final = "contacts with a plate or pin"
_YIELDS = 1e-6  # of the unit of stress: excess of the strength that counts
_SHARE = 1e-3
"""Share of the multipliers of a proof of infeasibility that makes a contact part of the reason."""


@dataclass(frozen=True)
class Resultant:
    """Resultant of the tractions on an edge set, a unit of thickness.

    Attributes
    ----------
    x, y : float
        Force on the body [stress × length].
    moment : float
        Moment about the origin of coordinates, or what is named, counterclockwise [stress × length²].

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
        −∫ σ_T (u_T − w) ds = Σ m_T σ_T over the contact points, work lost in friction. From the row multipliers m_T,
        which obey the friction law at every point: ≥ 0 to the accuracy of the certificate, which the projected `slip`
        need not give. Beside a prescribed shear other than zero the tractions of the mesh leave the slip of the corner
        open, and this number with it, by a part of what the last edge loses.

    """

    strain: float
    load: float
    complementary: float
    dissipation: float


@dataclass(frozen=True)
class PlateMotion:
    """Motion of a rigid plate beyond its gap and offset, given or found; zero where it is neither driven nor moved.

    Attributes
    ----------
    x, y : float
        Translation of the pivot [length].
    rotation : float
        Rotation about the pivot, counterclockwise [rad].

    """

    x: float = 0.0
    y: float = 0.0
    rotation: float = 0.0


def plate_motion(plate: RigidPlate, x: float, y: float, rotation: float) -> PlateMotion:
    """The motion of a plate's pivot: what was found of it, zero where it is not driven, with what is given."""
    return PlateMotion(x + (plate.x or 0.0), y + (plate.y or 0.0), rotation + (plate.rotation or 0.0))


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult(Stated):
    """A solved (or failed) contact problem.

    Check `status` before using the rest: only `Status.SOLVED` means that the certificate passed on the original data.
    Without a stress state (infeasible problem, failed back end) fields and contacts raise `InputError`; an infeasible
    problem has none even if an iteration left one behind, but the `mechanism` that proves it.

    Attributes
    ----------
    discretization : Discretization
        The problem, its mesh and its algebraic form.
    solution : QVISolution
        The algebraic answer, dimensionless.

    """

    discretization: Discretization
    solution: QVISolution

    def __repr__(self) -> str:
        if not self.has_state:
            return f"<ContactResult {self.message}>"
        forces = ("{} N = {}, T = {}".format(line.name, *line.shown_forces) for line in self.contacts.values())
        certificate = "passed" if self.certificate.passed else "failed"
        accuracy = f"certificate {certificate} with {self.certificate.accuracy:.1e}"
        return f"<ContactResult {'; '.join([f'{self.status}, {accuracy}', *forces])}>"

    def to_frame(self, units: Units | None = None) -> DataFrame:
        """All points of all contacts as a pandas table: "contact", then the columns of `ContactLine.to_frame`.

        Parameters
        ----------
        units : Units, optional
            If given, names of columns end in their unit, as in "slip [mm]".

        Raises
        ------
        InputError
            If pandas is missing (extra ``frame``), or there is no stress state.

        """
        tables = {name: line.to_frame(units) for name, line in self.contacts.items()}
        joined: DataFrame = pandas().concat(tables, names=["contact"]).reset_index("contact").reset_index(drop=True)
        return joined

    def forces_frame(self, units: Units | None = None) -> DataFrame:
        """One row a contact as a pandas table: forces, shares of its length in each state, extremes.

        Columns are "contact", "normal_force", "tangential_force" [stress × length], "share_open", "share_stick",
        "share_slip", "largest_pressure", "largest_shear" [stress], "largest_gap", "largest_slip" [length]. Where any
        contact has a rigid plate or pin there are "moved_x", "moved_y" [length], "rotation" [rad], "force_x", "force_y"
        [stress × length] and "moment" [stress × length²] as well, see `plates` and `plate_force`; NaN for contacts
        without. Parameters and errors are those of `to_frame`.
        """
        rows = [{"contact": name, **numbers} for name, numbers in contact_numbers(self).items()]
        return frame(columns_of(completed(rows)), forces_units(units))

    def _repr_html_(self) -> str:
        """Outcome, contacts and certificate as a table, for notebooks."""
        return str(load("qvi_contact.files.notebook").result_html(self))

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
        """One sentence about the outcome; if the load cannot be carried, also at which contact, and why."""
        if self.mechanism is not None:
            return f"{self.mechanism.reason}: {self.solution.message}"
        if self.solution.farkas is not None:
            return f"{self._overload()}: {self.solution.message}"
        return self.solution.message

    @cached_property
    def mechanism(self) -> Mechanism | None:
        """The motion of the blocks that proves that the load cannot be carried, on any mesh; None if not infeasible."""
        if self.status is not Status.INFEASIBLE:
            return None
        from qvi_contact.mechanism import find_mechanism  # what few results need is loaded when they do

        return find_mechanism(self.problem)

    def _overload(self) -> str:
        """What the proof that the mesh cannot carry the load rests on, as a sentence."""
        assert self.solution.farkas is not None
        qvi, y = self.solution.problem, self.solution.farkas[0]
        normal, tangential = AdmissibleRows.of(qvi).shares(y, qvi.m)
        names: dict[str, list[str]] = {"slides": [], "pulls": []}
        for rows in self.discretization.contacts:
            for reason, multipliers in (("slides", tangential), ("pulls", normal)):
                if multipliers[rows.rows].sum() > _SHARE * (normal.sum() + tangential.sum()):
                    names[reason].append(repr(rows.name))
        if names["slides"]:
            return f"On this mesh the load exceeds what friction on {' and '.join(names['slides'])} can carry"
        if names["pulls"]:
            pulled = " and ".join(names["pulls"])
            return f"On this mesh the load pulls or tips the body off {pulled}, where tension is not carried"
        return "On this mesh the forces on the plates contradict the contact laws"

    @property
    def remarks(self) -> tuple[str, ...]:
        """What to know about how the data were taken, such as shears that disagree in a corner; one sentence each."""
        remarks = self.discretization.remarks + self.solution.remarks + tuple(self._turning_plates())
        if self.has_state and self.traction_misfit > 1e-6 * self.discretization.scales.stress:
            remarks += (
                f"Computed tractions differ from the prescribed ones by up to {self.traction_misfit:.3g} [stress] at "
                "single points. Force and moment on every edge are right. To reduce the difference, let an edge end "
                "where the tractions jump, or refine there.",
            )
        if not self.has_state:
            return remarks
        loose = tuple(body.remark for body in self.loose_bodies)
        found = self._rounded_stresses() + self._next_to_nothing() + self._rounded_gaps() + self._beyond_strength()
        several = () if self.solution.remarks else self._one_of_several()
        return remarks + several + loose + found + tuple(self._coarse_arcs()) + tuple(self._excess_between_points())

    def _beyond_strength(self) -> tuple[str, ...]:
        """Where the elastic stress is beyond the strength of the material, and by how much."""
        if not self.problem.yields:
            return ()
        from qvi_contact.limit.stresses import excess

        scales = self.discretization.scales
        points, stress = cell_stresses(self.discretization, self.dofs)
        x, y = physical(self.problem, scales, points)
        beyond = excess(self.problem, x, y, scales.stress * stress)
        largest = float(beyond.max())
        if not largest > _YIELDS * scales.stress:
            return ()
        at = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        share = float((beyond.max(axis=1) > _YIELDS * scales.stress).mean())
        return (
            f"The elastic stress exceeds the strength of the material by up to {largest:.3g} [stress], most around "
            f"({x[at]:.6g}, {y[at]:.6g}), and in {100.0 * share:.0f} % of the triangles. There the body yields, which "
            "is not computed. What it carries at most is found by limit_load_factor, or by 'qvi-contact limit'.",
        )

    def _one_of_several(self) -> tuple[str, ...]:
        """That large friction allows several solutions, unless it is below its bound for one only.

        The bound alone says nothing: on usual meshes it is 0.01 to 0.1. It is computed where friction is large.
        """
        qvi = self.solution.problem
        moving = (qvi.mu > 0.0) & (qvi.cap > qvi.cohesion)
        friction = float(qvi.mu[moving].max(initial=0.0))
        if self.status is not Status.SOLVED or friction <= _LARGE_FRICTION or self._is_unique():
            return ()
        return (
            f"Friction is {friction:.3g}. Above {_LARGE_FRICTION:g} the discrete problem may have several solutions. "
            "This is one of them. To look for others, call other_solutions(result), or run 'qvi-contact branches' with "
            "the problem file.",
        )

    def _is_unique(self) -> bool:
        """Whether the solution is proved to be the only one; not where that cannot be computed."""
        try:
            return self.solution.uniqueness.satisfied
        except (FactorisationError, ValueError):  # dense algebra refuses what has overflowed by ValueError
            return False

    @cached_property
    def loose_bodies(self) -> tuple[LooseBody, ...]:
        """Bodies that contacts alone hold, and whose place beside others nothing determines; see `loose`.

        Gaps and slips on their contacts are those of one of the possible places. Without a certified state, or where
        contact tractions are too small to say what is closed, there is no answer, and none is listed.
        """
        if self.status is not Status.SOLVED or self._next_to_nothing():
            return ()
        from qvi_contact.solution.loose import loose_bodies

        return loose_bodies(self)

    def _next_to_nothing(self) -> tuple[str, ...]:
        """That contact tractions are too small beside the stress in the body to be certified on their own scale."""
        qvi, z, stress = self.solution.problem, self.solution.z, self.certificate.scales.get("stress", 0.0)
        largest = max(float(np.abs(part).max(initial=0.0)) for part in (qvi.normal(z), qvi.tangential(z)))
        if not _NOTHING * stress < largest < _COUNTED * stress:
            return ()
        return (
            f"The contacts carry at most {self.discretization.scales.stress * largest:.2g} [stress], very little "
            "compared with the stress in the body. No digit of these tractions is reliable. To compute them, leave "
            "out the loads that strain the body elsewhere.",
        )

    def _rounded_stresses(self) -> tuple[str, ...]:
        """That single stresses have lost digits, where they have lost more than the certificate's square root."""
        unit = self.certificate.scales.get("stress", 1.0) * self.discretization.scales.stress
        if not self.stress_rounding > _ROUNDED * unit:
            return ()
        return (
            f"Rounding makes stresses in the smallest cells uncertain by up to {self.stress_rounding:.2g} [stress]. "
            "Forces and energies are not affected. Use larger cells there, or less grading.",
        )

    def _rounded_gaps(self) -> tuple[str, ...]:
        """That gaps far larger than the displacements have cost digits, where the certificate does not pass."""
        unit = self.certificate.scales.get("displacement", 0.0)
        gaps = {rows.name: float(np.abs(rows.gap).max(initial=0.0)) for rows in self.discretization.contacts}
        name = max(gaps, key=gaps.__getitem__, default="")
        if self.status is not Status.INACCURATE or not unit or not gaps[name] > _FAR * unit:
            return ()
        accuracy = self.certificate.accuracy
        tolerance = 10.0 ** np.ceil(np.log10(2.0 * accuracy))
        return (
            f"On {name!r} gaps are up to {gaps[name] / unit:.0e} times the displacements of the body. Rounding of the "
            f"gaps limits the accuracy, here to {accuracy:.1e}. Ask for a tolerance of {tolerance:.0e}, or state the "
            "problem with a smaller clearance or gap.",
        )

    @cached_property
    def stress_rounding(self) -> float:
        """What rounding alone does to stresses in the smallest cells [stress]; see `stress.stress_rounding`."""
        return stress_rounding(self.discretization, self.dofs) * self.discretization.scales.stress

    def _turning_plates(self) -> Iterator[str]:
        """Plates and pins that may slip round under their moment, which nothing proves."""
        if self.status is Status.SOLVED or self.status.impossible:
            return
        for contact in self.problem.contacts:
            if contact.plate is not None and contact.plate.moment is not None and has_coulomb(contact):
                yield (
                    f"The plate or pin at {contact.name!r} may slip round under its moment. Nothing proves it, as "
                    "equilibrium alone would allow a larger pressure, and more friction with it. Give the rotation "
                    "instead of the moment: the moment of the result is then what friction carries."
                )

    def _coarse_arcs(self) -> Iterator[str]:
        """Contacts on arcs that touch along a part which is only a few edges long, both halves of it if symmetric."""
        mesh = self.problem.mesh
        mirrors = [mesh.edges(each.edges) for each in self.problem.conditions if isinstance(each, Symmetry)]
        mirrored = np.concatenate([np.empty(0, dtype=np.int64), *map(edge_ends, mirrors)])
        for rows in self.discretization.contacts:
            line, edges = self.contacts[rows.name], rows.points.edges
            touching = (line.state != ContactState.OPEN).reshape(len(edges), -1)
            held = edges.take(touching.any(axis=1) & edges.bent)
            count = len(held) * (2 if np.isin(edge_ends(held), mirrored).any() else 1)
            if touching.all() or not 0 < count < _EDGES_IN_CONTACT:
                continue
            x, y = (float(part[touching.ravel()].mean()) for part in (line.x, line.y))
            yield (
                f"Contact {rows.name!r} touches around ({x:.6g}, {y:.6g}) on fewer than {_EDGES_IN_CONTACT} edges of "
                f"its arc ({count}). The pressure there is not resolved. Refine the mesh there until "
                f"{_EDGES_IN_CONTACT} edges or more touch, as by graded([(x, y)], 2)."
            )

    def _excess_between_points(self) -> Iterator[str]:
        """Contacts where friction leaves its bound between the points by a share of the traction that counts."""
        for name, line in self.contacts.items():
            largest = float(np.hypot(line.normal_stress, line.tangential_stress).max(initial=0.0))
            if line.excess_between_points > max(_EXCESS * largest, line.rounding.stress):
                share = 100.0 * line.excess_between_points / largest
                yield (
                    f"On {name!r} friction exceeds its bound between the points of an edge, by up to "
                    f"{line.excess_between_points:.3g} [stress]: {share:.1f} % of the largest traction. "
                    "Refine the mesh there."
                )

    @cached_property
    def traction_misfit(self) -> float:
        """Largest difference between prescribed and computed tractions on Γ_σ [stress].

        Zero (to round-off) for data in the trace space: polynomials of degree p − 2 along each edge. Other data are met
        in resultant force and moment of every edge; this is what is left pointwise.
        """
        return misfit_of_tractions(self.discretization, self.dofs)

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

    @property
    def has_state(self) -> bool:
        """Whether there is a stress state, certified or not, to evaluate."""
        return not self.status.impossible and bool(np.isfinite(self.solution.z).all())

    @cached_property
    def dofs(self) -> FloatArray:
        """Dimensionless degrees of freedom of Φ, shape (N,); see `Discretization.values`."""
        if not self.has_state:
            raise InputError("result", self.status.value, f"there is no stress state to evaluate: {self.message}")
        return self.discretization.values(self.solution.z)

    def stress(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Stress at points of the body.

        Parameters
        ----------
        x, y : array_like
            Coordinates [length], broadcast against each other.

        Returns
        -------
        (..., 3) array
            σ_xx, σ_yy, σ_xy [stress], tension positive; on edges inside the body the mean of the adjacent cells.

        Raises
        ------
        InputError
            If a point lies outside the body.

        """
        remedy = "give real numbers, or arrays of them whose shapes go together"
        try:
            points_x, points_y = np.broadcast_arrays(*(real_array("stress(x, y)", value, remedy) for value in (x, y)))
        except ValueError as error:
            raise InputError("stress(x, y)", (x, y), remedy) from error
        return stress_at(self.discretization, self.dofs, points_x, points_y)

    def gauss_stress(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates x, y [length] of the g Gauss points of each cell, shape (cells, g), and the stress there.

        The stress has shape (cells, g, 3) [stress].
        """
        points, stress = self._gauss()
        x, y = physical(self.problem, self.discretization.scales, points)
        return x, y, stress * self.discretization.scales.stress

    @cached_property
    def contacts(self) -> Mapping[str, ContactLine]:
        """Results on each contact by name."""
        unit = self.certificate.scales.get("stress", 1.0)
        lines = {
            rows.name: contact_line(
                self.discretization, number, *self._contact_values(rows), unit=unit, rounding=self.rounding
            )
            for number, rows in enumerate(self.discretization.contacts)
        }
        return MappingProxyType(Named("contacts", "contacts", lines))

    @cached_property
    def rounding(self) -> Rounding:
        """Sizes up to which numbers of this result are shown as 0.

        A share of the stress and displacement that the problem or the certificate has as units, whichever is larger:
        where only an overlap of bodies loads them, the problem's own say nothing. The share is 1e-9, or the accuracy of
        the certificate if that is worse, at most 1e-6.
        """
        scales, known, accuracy = self.discretization.scales, self.certificate.scales, self.certificate.accuracy
        stress, moved = (max(1.0, known.get(name, 0.0)) for name in ("stress", "displacement"))
        share = min(max(SHARE, accuracy), _LEAST_SHOWN) if np.isfinite(accuracy) else _LEAST_SHOWN
        return Rounding.of(stress * scales.stress, moved * scales.displacement, scales.length, share)

    @cached_property
    def plates(self) -> Mapping[str, PlateMotion]:
        """How far each rigid plate or pin has moved, by the name of its contact."""
        motion: dict[str, dict[str, float]] = {}
        for row, multiplier in zip(self.discretization.plates.rows, self._multipliers("equality"), strict=True):
            motion.setdefault(row.contact, {})[DRIVES[row.component]] = -float(multiplier) * row.motion
        moved = {
            contact.name: self._about_pivot(contact.plate, rows, **motion.get(contact.name, {}))
            for contact, rows in zip(self.problem.contacts, self.discretization.contacts, strict=True)
            if contact.plate is not None
        }
        return MappingProxyType(Named("plates", _WITH_PLATE, moved))

    def _about_pivot(
        self, plate: RigidPlate, rows: ContactRows, x: float = 0.0, y: float = 0.0, rotation: float = 0.0
    ) -> PlateMotion:
        """The motion of the pivot from that of the point the equations refer to."""
        place = plate.reference(*centre_of(self.problem, self.discretization.scales, rows))
        arm_x, arm_y = plate.pivot[0] - place[0], plate.pivot[1] - place[1]
        return plate_motion(plate, x - rotation * arm_y, y + rotation * arm_x, rotation)

    def plate_force(self, name: str) -> Resultant:
        """Force of a rigid plate or pin on the body, by the name of its contact; the moment is about its pivot."""
        plates = {contact.name: contact for contact in self.problem.contacts if contact.plate is not None}
        contact = plates[known_name("name", name, {_WITH_PLATE: plates})]
        assert contact.plate is not None  # as chosen
        found, (x, y) = self.resultant(contact.edges), contact.plate.pivot
        return Resultant(found.x, found.y, found.moment - (x * found.y - y * found.x))

    def resultant(self, edges: str) -> Resultant:
        """Resultant of the computed tractions σn on a named edge set, joint or contact.

        That of a joint acts on the lower or left block; of a joint around a block, such as a circle, on that block.
        """
        mesh, scales = self.problem.mesh, self.discretization.scales
        named = {contact.name: contact.edges for contact in self.problem.contacts}
        known = {"edge sets": mesh.edge_names, "joints": mesh.joint_names}
        found = known_name("edges", edges, {**known, "contacts": named})
        chosen = mesh.edges(found if any(found in names for names in known.values()) else named[found])
        points = EdgePoints(self.discretization.space, chosen, LOAD_POINTS).for_resultants()
        x, y = physical(self.problem, scales, points.coordinates)
        forces = scales.length * points.weights * traction(self.discretization, self.dofs, points)
        if named.get(edges, edges) in mesh.joint_names:
            from qvi_contact.mechanism.bodies import enclosed_beyond

            forces *= np.repeat(np.where(enclosed_beyond(self.problem, chosen), -1.0, 1.0), points.count)
        force_x, force_y = forces
        return Resultant(float(force_x.sum()), float(force_y.sum()), float((x * force_y - y * force_x).sum()))

    @cached_property
    def energies(self) -> Energies:
        """Energies of the computed state."""
        weights, stress = cell_weights(self.discretization), self._gauss()[1]
        scales, problem = self.discretization.scales, self.problem
        strain_work = np.einsum("cgk,ckl,cgl->cg", stress, problem.compliances / scales.compliance, stress)
        strain = 0.5 * float((weights * strain_work).sum()) * scales.energy
        load = support_work(self.discretization, self.dofs)
        for rows in self.discretization.contacts:
            line = self.contacts[rows.name]
            gap, offset = rows.gap * scales.displacement, rows.offset * scales.displacement
            load += float(line.weights @ (gap * line.normal_stress + offset * line.tangential_stress))
        qvi, multiplier = self.solution.problem, self._multipliers("tangential")
        dissipation = float(multiplier @ qvi.tangential(self.solution.z)) * scales.energy
        return Energies(strain, load, strain - load, dissipation)

    @cached_property
    def bracket(self) -> Bracket:
        """Bounds of the energy and an error indicator for each cell, computed on first use; see `bracket.bracket`.

        Displacement elements on the same mesh are solved for it. Raises `InputError` without a stress state, and for a
        step of a history.
        """
        found: Bracket = load("qvi_contact.bracket").bracket(self)  # that room builds on this one
        return found

    @property
    def uniqueness(self) -> Uniqueness:
        """How far another solution of the exact problem can be, as far as `bracket` tells."""
        return self.bracket.uniqueness

    def displacement(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Displacement at points of the body, of displacement elements on the same mesh.

        The stress itself has no displacement: it comes from the second model of `bracket`, which is solved on first
        use, under the friction bound of this result. ``bracket.companion`` has more of it.

        Parameters
        ----------
        x, y : array_like
            Coordinates [length], broadcast against each other.

        Returns
        -------
        (..., 2) array
            u_x, u_y [length]; on joints the mean of all sides.

        Raises
        ------
        InputError
            If a point lies outside the body, there is no stress state, no displacement was found, or this is a step
            of a history.

        """
        companion = self.bracket.companion
        if companion is None:
            raise InputError("displacement(x, y)", self.status.value, f"no displacement was found: {self.message}")
        return companion.displacement(x, y)

    def _multipliers(self, kind: str) -> FloatArray:
        """Row multipliers "normal", "tangential" or "equality"; says what is wrong if there are none."""
        _ = self.dofs
        return np.asarray(getattr(self.solution, f"{kind}_multiplier"))

    def _contact_values(self, rows: ContactRows) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """σ_N', σ_T and their multipliers m_N, m_T at the Gauss points of a contact, dimensionless."""
        if rows.law == "tied":
            zero = np.zeros(len(rows.gap))
            return *normal_and_shear(self.discretization, self.dofs, rows.points), zero, zero
        qvi, z = self.solution.problem, self.solution.z
        normal, tangential = self._multipliers("normal"), self._multipliers("tangential")
        chosen, rule = rows.rows, rows.rule
        tractions = rule.at_points(qvi.normal(z)[chosen]), rule.at_points(qvi.tangential(z)[chosen])
        return *tractions, rule.multipliers_at_points(normal[chosen]), rule.multipliers_at_points(tangential[chosen])

    def _gauss(self) -> tuple[FloatArray, FloatArray]:
        """Dimensionless coordinates and stresses of the Gauss points of all cells."""
        return cell_stresses(self.discretization, self.dofs)


def contact_numbers(result: ContactResult) -> dict[str, dict[str, float]]:
    """The columns of `ContactResult.forces_frame` by the name of the contact; those of plates where it has one."""
    return {name: line.summary() | _plate_columns(result, name) for name, line in result.contacts.items()}


def completed(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows with all keys that any of them has, NaN where there was none."""
    keys = dict.fromkeys(key for row in rows for key in row)
    return [{key: row.get(key, np.nan) for key in keys} for row in rows]


def forces_units(units: Units | None) -> dict[str, str]:
    """Column of `contact_numbers` → its unit, of those that have one; none without `units`."""
    if units is None:
        return {}
    of_plates = Units.labels(units, {name: kind for name, kind in PLATE_COLUMNS.items() if kind})
    return {**summary_units(units), **of_plates, "rotation": "rad"}


def plate_numbers(result: ContactResult, name: str) -> tuple[float, ...]:
    """Motion, force and moment of a plate or pin by the name of its contact, as in `PLATE_COLUMNS`."""
    return (*astuple(result.plates[name]), *astuple(result.plate_force(name)))


def _plate_columns(result: ContactResult, name: str) -> dict[str, float]:
    return dict(zip(PLATE_COLUMNS, plate_numbers(result, name), strict=True)) if name in result.plates else {}


def overall_status(statuses: Sequence[Status], planned: int) -> Status:
    """Solved if so many results are; else the status of the first that is not, "time_limit" if some are missing."""
    end = Status.SOLVED if len(statuses) == planned else Status.TIME_LIMIT
    return next((status for status in statuses if status is not Status.SOLVED), end)
