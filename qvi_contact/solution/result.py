"""The answer to a contact problem: status, certificate, stresses, contact tractions, forces and energies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.schema import WithFields
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import LOAD_POINTS, EdgePoints, physical, scaled_stress_at_rest
from qvi_contact.discretization.space import POTENTIAL, split_points
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import centre_of
from qvi_contact.problem.conditions import DRIVES, Displacement, RigidMotion
from qvi_contact.problem.material import is_strained, varies
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import SUMMARY, ContactLine, contact_line, enclosed_beyond
from qvi_contact.solution.stress import misfit_of_tractions, stress_at, stress_in_cells, stress_rounding, traction
from qvi_contact.units import LEAST_SHOWN, SHARE, Rounding, Units
from solvers import Certificate, Iteration, QVISolution, Status
from solvers.basics.types import PicklesFields, frame, load, pandas
from solvers.certificate.feasibility import AdmissibleRows
from solvers.errors import Named, known_name

if TYPE_CHECKING:
    from pandas import DataFrame

    from qvi_contact.bracket import Bracket, Uniqueness
    from qvi_contact.mechanism import Mechanism
    from qvi_contact.refinement.measure import Side
    from qvi_contact.solution.remarks import UndeterminedMotion


PLATE_COLUMNS: Final = {
    "moved_x": "displacement", "moved_y": "displacement", "rotation": "rotation", "force_x": "force",
    "force_y": "force", "moment": "moment",
}  # fmt: skip
"""Columns of plates and their `Units`."""
RESULTANT: Final = {"x": "force", "y": "force", "moment": "moment"}
"""Fields of a `Resultant` and their `Units`."""

_WITH_PLATE: Final = "contacts with a plate or pin"
_SHARE = 1e-3
"""Share of all multipliers of a proof of infeasibility above which a contact is named in the reason."""


@dataclass(frozen=True)
class Resultant(WithFields):
    """Resultant of the tractions on an edge set, per unit of thickness."""

    x: float
    y: float
    """Force on the body [stress × length]."""
    moment: float
    """Moment about the origin of coordinates, or another named point, counterclockwise [stress × length²]."""


@dataclass(frozen=True)
class Energies(WithFields):
    """Energies per unit of thickness [stress × length²]."""

    strain: float
    """½∫ cσ:σ dx, the strain energy of the body, plus the energy of springs along contacts."""
    load: float
    """∫_{Γ_u} U·σn ds + ∫_{Γ_μ} (g σ_N' + w σ_T) ds − ∫ ε⁰:σ dx, work of the prescribed displacements and initial
    strains; g and w with the given motions of plates."""
    complementary: float
    """strain − load, which the stress minimises over all admissible stresses with the friction bound held fixed."""
    dissipation: float
    """−∫ σ_T (u_T − w) ds = Σ m_T σ_T over the contact rows, the work lost in friction. The multipliers m_T of the rows
    obey the friction law exactly, so that this is ≥ 0 to the accuracy of the certificate; with the projected `slip` it
    might not be. Beside a side with a prescribed nonzero shear the tractions of the mesh do not determine the slip in
    the corner: this number is uncertain by a part of the loss on the last edge."""


def plate_motions(problem: ContactProblem, computed: Mapping[str, Mapping[str, float]]) -> Mapping[str, RigidMotion]:
    """Motions of plates about their pivots: the given components plus the `computed` ones, by contact and component.

    Components driven by force were computed about the point that arms count from, see `RigidPlate.reference`.
    """
    motions = {}
    for contact in problem.contacts:
        if (plate := contact.plate) is not None:
            x, y, turn = (computed.get(contact.name, {}).get(name, 0.0) for name in DRIVES)
            reference = plate.reference(*centre_of(problem.mesh.vertices, problem.mesh.edges(contact.edges)))
            x, y = RigidMotion(x, y, turn, reference).at(np.array(plate.pivot)).tolist()
            given = plate.x or 0.0, plate.y or 0.0, plate.rotation or 0.0
            motions[contact.name] = RigidMotion(x + given[0], y + given[1], turn + given[2], plate.pivot)
    return Named("plates", _WITH_PLATE, motions)


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult(WithFields, PicklesFields):
    """A solved (or failed) contact problem.

    Check `status` before using the rest: only `Status.SOLVED` means that the certificate passed on the original data.
    Without a stress state (infeasible problem, failed back end) fields and contacts raise `InputError`. An infeasible
    problem has no state, even if an iteration left one; it has a `mechanism` as its proof.
    """

    discretization: Discretization
    """The problem, its mesh and its algebraic form."""
    solution: QVISolution
    """The algebraic answer, dimensionless."""

    def __repr__(self) -> str:
        if not self.has_state:
            return f"<ContactResult {self.message}>"
        forces = ("{} N = {:.6g}, T = {:.6g}".format(line.name, *line.forces) for line in self.contacts.values())
        certificate = "passed" if self.certificate.passed else "failed"
        accuracy = f"certificate {certificate} with {self.certificate.accuracy:.1e}"
        return f"<ContactResult {'; '.join([f'{self.status}, {accuracy}', *forces])}>"

    def to_frame(self, units: Units | None = None) -> DataFrame:
        """All points of all contacts: "contact", then the columns of `ContactLine.to_frame`; raises the same errors."""
        tables = {name: line.to_frame(units) for name, line in self.contacts.items()} or {"": pandas().DataFrame()}
        joined: DataFrame = pandas().concat(tables, names=["contact"]).reset_index("contact").reset_index(drop=True)
        return joined

    def forces_frame(self, units: Units | None = None) -> DataFrame:
        """One row per contact as a pandas table: forces, shares of its length in each state, extremes.

        Columns are "contact", "normal_force", "tangential_force" [stress × length], "share_open", "share_stick",
        "share_slip", "largest_pressure", "largest_shear" [stress], "largest_gap", "largest_slip" [length]. Where any
        contact has a rigid plate or pin there are "moved_x", "moved_y" [length], "rotation" [rad], "force_x", "force_y"
        [stress × length] and "moment" [stress × length²] as well, see `plates` and `plate_force`; NaN for contacts
        without. Units and errors are those of `to_frame`.
        """
        rows = [{"contact": name, **numbers} for name, numbers in contact_numbers(self).items()]
        return frame(pandas().DataFrame(rows), forces_units(units))

    def _repr_html_(self) -> str:
        """The outcome, and tables of the forces on contacts, edges and plates, for notebooks."""
        return str(load("qvi_contact.command.page").result_html(self))

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
        if self.solution.farkas is None:
            return self.solution.message
        qvi, y = self.solution.problem, self.solution.farkas[0]
        normal, tangential = AdmissibleRows.of(qvi).shares(y, qvi.m)
        reason = "the forces on the plates contradict the contact laws"
        for multipliers, sentence in (
            (normal, "the load pulls or tips the body off {}, where tension is not carried"),
            (tangential, "the load exceeds what friction on {} can carry"),
        ):
            least = _SHARE * (normal.sum() + tangential.sum())
            names = [repr(c.name) for c in self.discretization.contacts if multipliers[c.rows].sum() > least]
            reason = sentence.format(" and ".join(names)) if names else reason
        return f"On this mesh {reason}: {self.solution.message}"

    @cached_property
    def mechanism(self) -> Mechanism | None:
        """Motion of rigid blocks that proves that no stress, on any mesh, carries the load; None unless infeasible."""
        if self.status is not Status.INFEASIBLE:
            return None
        from qvi_contact.mechanism import find_mechanism  # few results need it

        return find_mechanism(self.problem)

    @cached_property
    def stress_rounding(self) -> float:
        """Change of stresses in the smallest cells by rounding alone [stress]; see `stress.stress_rounding`."""
        return stress_rounding(self.discretization, self.dofs) * self.discretization.scales.stress

    @cached_property
    def traction_misfit(self) -> float:
        """Largest difference between prescribed and computed tractions on Γ_σ [stress].

        Zero up to rounding for data that are polynomials of degree p − 2 along each edge. Other data are met in the
        resultant force and moment of every edge, but not at every point.
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
        """Whether there is a stress state, certified or not."""
        return not self.status.impossible and bool(np.isfinite(self.solution.z).all())

    @cached_property
    def dofs(self) -> FloatArray:
        """Dimensionless degrees of freedom of Φ, shape (N,); see `Discretization.values`."""
        if not self.has_state:
            raise InputError("result", self.status.value, f"there is no stress state to evaluate: {self.message}")
        return self.discretization.values(self.solution.z)

    def stress(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Stress (..., 3) at points x, y of the body [length], broadcast against each other; `InputError` outside.

        The components are σ_xx, σ_yy, σ_xy [stress], tension positive. On edges inside the body, also between materials
        and on joints, this is the mean of both sides: for one side give a point a little inside it.
        """
        return stress_at(self.discretization, self.dofs, x, y)[..., :3]

    def displacement(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Displacement u_x, u_y (..., 2) [length] at points x, y of the body, on joints the mean of all sides.

        The stress model has no displacements inside the body. These are from the displacement model of `bracket`, with
        the friction bound of this result. `InputError` outside the body, if that model has no solution, or in a step of
        a history after slip along arcs.
        """
        return self.bracket.companion.displacement(x, y)

    # functions of rooms above, loaded on first use

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Sentences about approximated data, the solution's attempts, and the computed state, if there is one."""
        return tuple(load("qvi_contact.solution.remarks").remarks(self))

    @cached_property
    def undetermined_motions(self) -> tuple[UndeterminedMotion, ...]:
        """The rigid motions of bodies and driven plates that neither supports nor contacts determine."""
        return tuple(load("qvi_contact.solution.remarks").undetermined_motions(self))

    @cached_property
    def bracket(self) -> Bracket:
        """Bounds of energy and forces from both sides, and of the error of the stresses."""
        bounds: Bracket = load("qvi_contact.bracket").bracket(self)
        return bounds

    @property
    def uniqueness(self) -> Uniqueness:
        """How far another solution of the exact problem can be from this one, as far as `bracket` bounds that."""
        return self.bracket.uniqueness

    def gauss_stress(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates x, y [length] of the g Gauss points of each cell, shape (cells, g), and the stress there.

        The stress has shape (cells, g, 3) [stress].
        """
        points, stress = stress_in_cells(self.discretization, self.dofs)
        x, y = physical(self.problem, self.discretization.scales, points)
        return x, y, stress * self.discretization.scales.stress

    @cached_property
    def contacts(self) -> Mapping[str, ContactLine]:
        """Results on each contact by name."""
        lines = {rows.name: contact_line(self, number) for number, rows in enumerate(self.discretization.contacts)}
        return Named("contacts", "contacts", lines)

    @cached_property
    def rounding(self) -> Rounding:
        """Sizes up to which numbers of this result are shown as 0.

        They are a share of the units of stress and displacement, those of the problem or of the certificate, whichever
        are larger: the problem's alone may be far too small where only an overlap of bodies loads them. The share is
        1e-9, or the accuracy of the certificate if that is worse, but at most 1e-6.
        """
        scales, certified, accuracy = self.discretization.scales, self.certificate.scales, self.certificate.accuracy
        stress, displacement = (max(1.0, certified.get(name, 0.0)) for name in ("stress", "displacement"))
        share = min(max(SHARE, accuracy), LEAST_SHOWN) if np.isfinite(accuracy) else LEAST_SHOWN
        return Rounding.of(stress * scales.stress, displacement * scales.displacement, scales.length, share)

    @cached_property
    def plates(self) -> Mapping[str, RigidMotion]:
        """Motion of each rigid plate or pin beyond its gap and offset, about its pivot, by the name of its contact."""
        motion: dict[str, dict[str, float]] = {}
        _ = self.dofs  # raises InputError if there is no state
        for row, multiplier in zip(self.discretization.plates.rows, self.solution.equality_multiplier, strict=True):
            motion.setdefault(row.contact, {})[row.component] = -float(multiplier) * row.motion
        return plate_motions(self.problem, motion)

    def plate_force(self, name: str) -> Resultant:
        """Force of a rigid plate or pin on the body, by the name of its contact; the moment is about its pivot."""
        plates = {each.name: (each.edges, each.plate.pivot) for each in self.problem.contacts if each.plate is not None}
        edges, (x, y) = plates[known_name("name", name, {_WITH_PLATE: plates})]
        force = self.resultant(edges)
        return Resultant(force.x, force.y, force.moment - (x * force.y - y * force.x))

    def resultant(self, edges: str) -> Resultant:
        """Resultant of the computed tractions σn on a named edge set, joint or contact.

        On a joint it is the force on the lower or left block; if a joint encloses a block, on this block.
        """
        mesh = self.problem.mesh
        named = {contact.name: contact.edges for contact in self.problem.contacts}
        name = known_name("edges", edges, {"edge sets": mesh.edge_names, "joints": mesh.joint_names, "contacts": named})
        edges = name if name in mesh.edge_sets else named[name]
        chosen = mesh.edges(edges)
        points = EdgePoints(self.discretization.space, chosen, LOAD_POINTS).for_resultants()
        tractions = traction(self.discretization, self.dofs, points)
        if edges in mesh.joint_names:
            tractions *= np.repeat(np.where(enclosed_beyond(mesh.vertices, chosen), -1.0, 1.0), points.count)
        return _sum_of(self, points, tractions)

    @cached_property
    def energies(self) -> Energies:
        """Energies of the computed state."""
        scales, problem, space = self.discretization.scales, self.problem, self.discretization.space
        t, w = space.cell_quadrature
        if callable(problem.body_potential) or varies(problem):  # they may need more points than stresses do
            t, w = max((t, w), split_points(2 * POTENTIAL + 1), key=lambda rule: len(rule[1]))
        points, stress = stress_in_cells(self.discretization, self.dofs, t=t)
        strains = stress @ (problem.compliances / scales.compliance) * space.cell_measures(t, w)[..., None]  # weighted
        strain = 0.5 * float(np.vdot(strains, stress)) * scales.energy
        root = self.discretization.root
        if root.stiffness.springs is not None:
            of_springs = root.stiffness.springs.rows @ self.dofs + root.springs
            strain += 0.5 * float(np.square(of_springs).sum()) * scales.energy
        load = self.discretization.work(self.dofs)
        if is_strained(problem):
            at_rest = scaled_stress_at_rest(problem, scales, np.arange(problem.mesh.cell_count), points)
            load += float(np.vdot(strains, at_rest)) * scales.energy
        shear = self.solution.problem.tangential(self.solution.z)
        dissipation = float(self.solution.tangential_multiplier @ shear) * scales.energy
        return Energies(strain, load, strain - load, dissipation)

    def derivative(self, quantity: str, parameter: str, side: Side | None = None) -> float:
        """Derivative of a force or motion with respect to a datum of the problem, by one linear solve.

            result.derivative("wall.tangential_force", "wall.friction")

        Parameters
        ----------
        quantity : str
            "NAME.normal_force" or "NAME.tangential_force" of a contact; "NAME.force_x", "NAME.force_y", "NAME.moment",
            "NAME.x", "NAME.y" or "NAME.rotation" of a plate; at a point "NAME.slip(x, y)" of a contact, and stresses
            "xx(x, y)", "yy(x, y)", "xy(x, y)".
        parameter : str
            "NAME.friction" and the like of a contact: all data but a pore pressure, and the given data of its plate;
            "EDGES.x" and the like of a prescribed displacement; "load.NAME", a factor of a load as in
            `limit_load_factor`; "temperature", "material.young", or data of a region, "NAME.young". A function changes
            by the same number everywhere. In a load step the earlier slip does not change.
        side : "above" or "below", optional
            Needed where a point of a contact changes its state at this value of the parameter, so that the derivatives
            from both sides differ.

        Returns
        -------
        float
            The derivative of the discrete problem [unit of the quantity/unit of the parameter].

        Raises
        ------
        InputError
            If there is no such name, the result is not solved, the derivatives from both sides differ, or the contacts
            have more than 2000 points.

        """
        return float(load("qvi_contact.refinement.measure").derivative(self, quantity, parameter, side))


def contact_numbers(result: ContactResult) -> dict[str, dict[str, float]]:
    """The columns of `ContactResult.forces_frame` by contact; columns of plates only for contacts that have one."""
    columns = {name: line.summary() for name, line in result.contacts.items()}
    for name, motion in result.plates.items():
        numbers = motion.x, motion.y, motion.rotation, *astuple(result.plate_force(name))
        columns[name] |= dict(zip(PLATE_COLUMNS, numbers, strict=True))
    return columns


def reactions(result: ContactResult) -> dict[str, Resultant]:
    """Forces of supports on the body by edge set: of the components of σn that they hold, not of those given there."""
    sums = dict[str, FloatArray]()
    for held in result.problem.prescribed(Displacement):
        points = EdgePoints(result.discretization.space, held.edges, LOAD_POINTS).for_resultants()
        along, name = points.vectors(held.direction, held.turns).T, held.condition.edges
        tractions = (along * traction(result.discretization, result.dofs, points)).sum(axis=0) * along
        sums[name] = sums.get(name, 0.0) + np.array(astuple(_sum_of(result, points, tractions)))
    return {name: Resultant(*each.tolist()) for name, each in sums.items()}


def _sum_of(result: ContactResult, points: EdgePoints, tractions: FloatArray) -> Resultant:
    """Force and moment of tractions (2, n q) [stress] at points of edges."""
    scales = result.discretization.scales
    x, y = physical(result.problem, scales, points.coordinates)
    force_x, force_y = scales.length * points.weights * tractions
    return Resultant(float(force_x.sum()), float(force_y.sum()), float((x * force_y - y * force_x).sum()))


def forces_units(units: Units | None) -> dict[str, str]:
    """Column of `contact_numbers` → label of its unit, without columns that have no unit; empty without `units`."""
    return Units.labels(units, SUMMARY | PLATE_COLUMNS)


def overall_status(statuses: Sequence[Status], planned: int) -> Status:
    """Solved if all `planned` results are; else the first other status, or "time_limit" if results are missing."""
    end = Status.SOLVED if len(statuses) == planned else Status.TIME_LIMIT
    return next((status for status in statuses if status is not Status.SOLVED), end)
