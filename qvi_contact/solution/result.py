"""The answer to a contact problem: status, certificate, stresses, contact tractions, forces and energies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import LOAD_POINTS, EdgePoints, physical, scaled_stress_at_rest
from qvi_contact.discretization.space import POTENTIAL, split_points
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import centre_of
from qvi_contact.problem.conditions import DRIVES, RigidMotion
from qvi_contact.problem.material import is_strained, varies
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import SUMMARY, ContactLine, contact_line, enclosed_beyond
from qvi_contact.solution.stress import (
    cell_stresses,
    given_points,
    misfit_of_tractions,
    stress_at,
    stress_rounding,
    traction,
)
from qvi_contact.units import SHARE, Rounding, Units
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

_LEAST_SHOWN: Final = 1e-6  # of the units of a result: what is larger is shown however bad the certificate is

PLATE_COLUMNS: Final = {
    "moved_x": "displacement", "moved_y": "displacement", "rotation": "rotation", "force_x": "force",
    "force_y": "force", "moment": "moment",
}  # fmt: skip
"""Which of the `Units` the columns of plates are in."""
RESULTANT: Final = {"x": "force", "y": "force", "moment": "moment"}
"""The same of a `Resultant`."""

_WITH_PLATE: Final = "contacts with a plate or pin"
_SHARE = 1e-3
"""Share of the multipliers of a proof of infeasibility that makes a contact part of the reason."""


_ABOVE: Final = {
    "bracket": "qvi_contact.bracket",
    **dict.fromkeys(("remarks", "undetermined_motions"), "qvi_contact.solution.remarks"),
}
"""Functions of a result that are its attributes too, and their modules, loaded on first use."""


@dataclass(frozen=True)
class Resultant:
    """Resultant of the tractions on an edge set, a unit of thickness."""

    x: float
    y: float
    """Force on the body [stress × length]."""
    moment: float
    """Moment about the origin of coordinates, or what is named, counterclockwise [stress × length²]."""


@dataclass(frozen=True)
class Energies:
    """Energies a unit of thickness [stress × length²]."""

    strain: float
    """½∫ cσ:σ dx, strain energy of the body, and that of springs along contacts."""
    load: float
    """∫_{Γ_u} U·σn ds + ∫_{Γ_μ} (g σ_N' + w σ_T) ds − ∫ ε⁰:σ dx, work of the prescribed displacements and initial
    strains; g and w with the given motions of plates."""
    complementary: float
    """strain − load: what the stress minimises over the admissible stresses with the friction bound held fixed."""
    dissipation: float
    """−∫ σ_T (u_T − w) ds = Σ m_T σ_T over the contact points, work lost in friction. From the row multipliers m_T,
    which obey the friction law at every point: ≥ 0 to the accuracy of the certificate, which the projected `slip` need
    not give. Beside a prescribed shear other than zero the tractions of the mesh leave the slip of the corner open, and
    this number with it, by a part of what the last edge loses."""


def plate_motions(problem: ContactProblem, found: Mapping[str, Mapping[str, float]]) -> Mapping[str, RigidMotion]:
    """Motions of plates about their pivots: what forces and moments drive, by contact and name, and what is given.

    What they drive was found at the place that arms count from, see `RigidPlate.reference`.
    """
    moved = {}
    for contact in problem.contacts:
        if (plate := contact.plate) is not None:
            x, y, turn = (found.get(contact.name, {}).get(name, 0.0) for name in DRIVES)
            reference = plate.reference(*centre_of(problem.mesh.vertices, problem.mesh.edges(contact.edges)))
            x, y = RigidMotion(x, y, turn, reference).at(np.array(plate.pivot)).tolist()
            given = plate.x or 0.0, plate.y or 0.0, plate.rotation or 0.0
            moved[contact.name] = RigidMotion(x + given[0], y + given[1], turn + given[2], plate.pivot)
    return MappingProxyType(Named("plates", _WITH_PLATE, moved))


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult(PicklesFields):
    """A solved (or failed) contact problem.

    Check `status` before using the rest: only `Status.SOLVED` means that the certificate passed on the original data.
    Without a stress state (infeasible problem, failed back end) fields and contacts raise `InputError`; an infeasible
    problem has none even if an iteration left one behind, but the `mechanism` that proves it.

    `remarks`, `undetermined_motions` and `bracket` are what the functions of these names in `solution.remarks` and
    `bracket` find, on first use.
    """

    discretization: Discretization
    """The problem, its mesh and its algebraic form."""
    solution: QVISolution
    """The algebraic answer, dimensionless."""

    if TYPE_CHECKING:  # functions of `_ABOVE`; for types they are no fields
        remarks: ClassVar[tuple[str, ...]]
        undetermined_motions: ClassVar[tuple[UndeterminedMotion, ...]]
        bracket: ClassVar[Bracket]

    def __getattr__(self, name: str) -> Any:
        if name not in _ABOVE:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        found = self.__dict__[name] = getattr(load(_ABOVE[name]), name)(self)
        return found

    def __repr__(self) -> str:
        if not self.has_state:
            return f"<ContactResult {self.message}>"
        forces = ("{} N = {}, T = {}".format(line.name, *line.shown_forces) for line in self.contacts.values())
        certificate = "passed" if self.certificate.passed else "failed"
        accuracy = f"certificate {certificate} with {self.certificate.accuracy:.1e}"
        return f"<ContactResult {'; '.join([f'{self.status}, {accuracy}', *forces])}>"

    def to_frame(self, units: Units | None = None) -> DataFrame:
        """All points of all contacts: "contact", then the columns of `ContactLine.to_frame`, whose errors it raises."""
        tables = {name: line.to_frame(units) for name, line in self.contacts.items()} or {"": pandas().DataFrame()}
        joined: DataFrame = pandas().concat(tables, names=["contact"]).reset_index("contact").reset_index(drop=True)
        return joined

    def forces_frame(self, units: Units | None = None) -> DataFrame:
        """One row a contact as a pandas table: forces, shares of its length in each state, extremes.

        Columns are "contact", "normal_force", "tangential_force" [stress × length], "share_open", "share_stick",
        "share_slip", "largest_pressure", "largest_shear" [stress], "largest_gap", "largest_slip" [length]. Where any
        contact has a rigid plate or pin there are "moved_x", "moved_y" [length], "rotation" [rad], "force_x", "force_y"
        [stress × length] and "moment" [stress × length²] as well, see `plates` and `plate_force`; NaN for contacts
        without. Units and errors are those of `to_frame`.
        """
        rows = [{"contact": name, **numbers} for name, numbers in contact_numbers(self).items()]
        return frame(pandas().DataFrame(rows), forces_units(units))

    def _repr_html_(self) -> str:
        """Outcome, and what contacts, edges and plates carry as tables, for notebooks."""
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
        """The motion of the blocks that proves that the load cannot be carried, on any mesh; None if not infeasible."""
        if self.status is not Status.INFEASIBLE:
            return None
        from qvi_contact.mechanism import find_mechanism  # what few results need is loaded when they do

        return find_mechanism(self.problem)

    @cached_property
    def stress_rounding(self) -> float:
        """What rounding alone does to stresses in the smallest cells [stress]; see `stress.stress_rounding`."""
        return stress_rounding(self.discretization, self.dofs) * self.discretization.scales.stress

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
        """Stress (..., 3) at points x, y of the body [length], broadcast against each other; `InputError` outside.

        σ_xx, σ_yy, σ_xy [stress], tension positive; on edges inside the body the mean of the adjacent cells.
        """
        return stress_at(self.discretization, self.dofs, *given_points("stress(x, y)", x, y))

    def displacement(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Displacement u_x, u_y (..., 2) [length] at such points, on joints the mean of all sides.

        The stress itself has none: it is that of the displacement model of `bracket`, under the friction bound of this
        result. `InputError` also where there is no such displacement, or in a step of a history after slip along arcs.
        """
        return self.bracket.companion.displacement(x, y)

    @property
    def uniqueness(self) -> Uniqueness:
        """How far another solution of the exact problem can be, as far as `bracket` tells."""
        return self.bracket.uniqueness

    def gauss_stress(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates x, y [length] of the g Gauss points of each cell, shape (cells, g), and the stress there.

        The stress has shape (cells, g, 3) [stress].
        """
        points, stress = cell_stresses(self.discretization, self.dofs)
        x, y = physical(self.problem, self.discretization.scales, points)
        return x, y, stress * self.discretization.scales.stress

    @cached_property
    def contacts(self) -> Mapping[str, ContactLine]:
        """Results on each contact by name."""
        unit = self.certificate.scales.get("stress", 1.0)
        lines = {
            rows.name: contact_line(self.discretization, number, self.solution, self.dofs, unit, self.rounding)
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
    def plates(self) -> Mapping[str, RigidMotion]:
        """Motion of each rigid plate or pin beyond its gap and offset, about its pivot, by the name of its contact."""
        motion: dict[str, dict[str, float]] = {}
        _ = self.dofs  # says what is wrong if there is no state
        for row, multiplier in zip(self.discretization.plates.rows, self.solution.equality_multiplier, strict=True):
            motion.setdefault(row.contact, {})[row.component] = -float(multiplier) * row.motion
        return plate_motions(self.problem, motion)

    def plate_force(self, name: str) -> Resultant:
        """Force of a rigid plate or pin on the body, by the name of its contact; the moment is about its pivot."""
        plates = {each.name: (each.edges, each.plate.pivot) for each in self.problem.contacts if each.plate is not None}
        edges, (x, y) = plates[known_name("name", name, {_WITH_PLATE: plates})]
        found = self.resultant(edges)
        return Resultant(found.x, found.y, found.moment - (x * found.y - y * found.x))

    def resultant(self, edges: str) -> Resultant:
        """Resultant of the computed tractions σn on a named edge set, joint or contact.

        That of a joint acts on the lower or left block; of a joint around a block, such as a circle, on that block.
        """
        mesh, scales = self.problem.mesh, self.discretization.scales
        named = {contact.name: contact.edges for contact in self.problem.contacts}
        own = known_name("edges", edges, {"edge sets": mesh.edge_names, "joints": mesh.joint_names, "contacts": named})
        edges = own if own in mesh.edge_sets else named[own]
        chosen = mesh.edges(edges)
        points = EdgePoints(self.discretization.space, chosen, LOAD_POINTS).for_resultants()
        x, y = physical(self.problem, scales, points.coordinates)
        forces = scales.length * points.weights * traction(self.discretization, self.dofs, points)
        if edges in mesh.joint_names:
            forces *= np.repeat(np.where(enclosed_beyond(mesh.vertices, chosen), -1.0, 1.0), points.count)
        force_x, force_y = forces
        return Resultant(float(force_x.sum()), float(force_y.sum()), float((x * force_y - y * force_x).sum()))

    @cached_property
    def energies(self) -> Energies:
        """Energies of the computed state."""
        scales, problem, space = self.discretization.scales, self.problem, self.discretization.space
        t, w = space.cell_quadrature
        if callable(problem.body_potential) or varies(problem):  # of a higher degree than stresses, perhaps
            t, w = max((t, w), split_points(2 * POTENTIAL + 1), key=lambda rule: len(rule[1]))
        points, stress = cell_stresses(self.discretization, self.dofs, t)
        strained = stress @ (problem.compliances / scales.compliance) * space.cell_measures(t, w)[..., None]
        strain = 0.5 * float(np.vdot(strained, stress)) * scales.energy
        root = self.discretization.root
        if root.stiffness.springs is not None:
            stretched = root.stiffness.springs.rows @ self.dofs + root.springs
            strain += 0.5 * float(np.square(stretched).sum()) * scales.energy
        load = self.discretization.work(self.dofs)
        if is_strained(problem):
            at_rest = scaled_stress_at_rest(problem, scales, np.arange(problem.mesh.cell_count), points)
            load += float(np.vdot(strained, at_rest)) * scales.energy
        shear = self.solution.problem.tangential(self.solution.z)
        dissipation = float(self.solution.tangential_multiplier @ shear) * scales.energy
        return Energies(strain, load, strain - load, dissipation)

    def derivative(self, quantity: str, parameter: str, side: Side | None = None) -> float:
        """By how much a force or motion grows with a datum of the problem, by one linear solve.

            result.derivative("wall.tangential_force", "wall.friction")

        Parameters
        ----------
        quantity : str
            "NAME.normal_force" or "NAME.tangential_force" of a contact; "NAME.force_x", "NAME.force_y", "NAME.moment",
            "NAME.x", "NAME.y" or "NAME.rotation" of a plate; at a point "NAME.slip(x, y)" of a contact, and stresses
            "xx(x, y)", "yy(x, y)", "xy(x, y)".
        parameter : str
            "NAME.friction" and the like of a contact, all data but a pore pressure, and what is given of its plate;
            "EDGES.x" and the like of a prescribed displacement; "load.NAME", a factor of a load as in
            `limit_load_factor`; "temperature", "material.young", or those of a region, "NAME.young". A function counts
            as larger by the same number everywhere. Of a load step earlier slip is held as it is.
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
    """The columns of `ContactResult.forces_frame` by the name of the contact; those of plates where it has one."""
    found = {name: line.summary() for name, line in result.contacts.items()}
    for name, moved in result.plates.items():
        numbers = moved.x, moved.y, moved.rotation, *astuple(result.plate_force(name))
        found[name] |= dict(zip(PLATE_COLUMNS, numbers, strict=True))
    return found


def forces_units(units: Units | None) -> dict[str, str]:
    """Column of `contact_numbers` → its unit, of those that have one; none without `units`."""
    return Units.labels(units, SUMMARY | PLATE_COLUMNS)


def overall_status(statuses: Sequence[Status], planned: int) -> Status:
    """Solved if so many results are; else the status of the first that is not, "time_limit" if some are missing."""
    end = Status.SOLVED if len(statuses) == planned else Status.TIME_LIMIT
    return next((status for status in statuses if status is not Status.SOLVED), end)
