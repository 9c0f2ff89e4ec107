"""From the contact problem to the algebraic quasi-variational inequality (D2).

In `docs/theory.md`: (D1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray, real_array
from qvi_contact.discretization.algebraic import Posed, algebraic, energy_of
from qvi_contact.discretization.basis import Basis, RowKind, SharedCorners
from qvi_contact.discretization.bogner_fox_schmit import BognerFoxSchmit
from qvi_contact.discretization.contact_rows import contact_rows, joined, laws_vary
from qvi_contact.discretization.elimination import Elimination, UnbalancedLoadError
from qvi_contact.discretization.families import FORCES_ON_HOLES, ElementName, basis_for, element_on, with_element
from qvi_contact.discretization.loads import (
    frictionless_corners,
    prescribed_tractions,
    shear_beside_contacts,
)
from qvi_contact.discretization.pins import misplaced_pins, pressed_pins
from qvi_contact.discretization.plates import plate_rows
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element.bogner_fox_schmit import Grid
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import Traction
from qvi_contact.problem.problem import ContactProblem
from solvers import FrictionQVI
from solvers.basics.pickles import Stated

_TOO_SMALL = 1e-2  # mean stress in units of the problem below which the units are changed
_NOISE = 1e-12  # mean stress in units of the problem below which there is none
_MISFIT = 1e-6  # difference of data from what is taken for them, in units of the problem, that needs no word
_UNRELIABLE = 1e-4  # relative error of the linear solve above which they are left


@dataclass(frozen=True, eq=False)
class Discretization(Posed, Stated):
    """A contact problem on the elements of its mesh, traction conditions and gauge eliminated.

    Attributes
    ----------
    problem : ContactProblem
        The problem.
    space : Basis
        Mesh and element, dimensionless.
    energy : Energy
        The energy of the body.
    scales : Scales
        The units.
    elimination : Elimination
        All degrees of freedom as an affine function of the unknowns z.
    contacts : tuple of ContactRows
        Which rows of the algebraic problem belong to which contact.
    plates : PlateRows
        Equality rows of plates driven by force.
    qvi : FrictionQVI
        The algebraic problem, dimensionless.
    freed : int array
        Vertices beside contacts whose prescribed shear is given up, see `discretize`.

    """

    qvi: FrictionQVI
    freed: IntArray

    @property
    def basis(self) -> sparse.csr_array:
        """U = basis z + particular, shape (N, n)."""
        return self.elimination.basis

    @property
    def grid(self) -> Grid:
        """Dimensionless grid lines of a rectilinear mesh."""
        _ = self.problem.grid  # says what is wrong if there are none
        assert isinstance(self.space, BognerFoxSchmit)
        return self.space.grid

    @property
    def shared_corners(self) -> list[tuple[int, str]]:
        """Vertices where a prescribed shear and a contact share a degree of freedom, with the contact's name."""
        return shear_beside_contacts(self.problem) if self.space.shear_at_vertices else []

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What a user should know about how the data were taken, one sentence each."""
        mesh = self.problem.mesh
        found = []
        for vertex in self.elimination.conflicts:
            x, y = mesh.vertices[vertex]
            found.append(
                f"The shear stresses prescribed on the two sides of the corner ({x:.6g}, {y:.6g}) differ. The forces "
                "on the edges there are right, the values in the corner are not."
            )
        for vertex, contact in self.shared_corners:
            x, y = mesh.vertices[vertex]
            place = f"({x:.6g}, {y:.6g})"
            given_up = (
                f"At the corner {place} friction on {contact!r} cannot carry the shear stress of the other side. Only "
                "the forces on the edges there are right. Let the prescribed shear fall to zero towards that corner."
            )
            taken = f"At the corner {place} the other side prescribes the shear stress of contact {contact!r} as well."
            found.append(given_up if vertex in self.freed else taken)
        found += [
            f"On {rows.name!r} the pore pressure that is taken differs from the given one by up to "
            f"{rows.pore_misfit * self.scales.stress:.3g} [stress] at single points. Its force and moment on every "
            "edge are right. To reduce the difference, let an edge end where the pressure jumps, or refine there."
            for rows in self.contacts
            if rows.pore_misfit > _MISFIT
        ]
        found += [
            f"Equilibrium with the other loads already determines {row.component} of the plate at {row.contact!r}. "
            "The plate's motion in that component is not determined, and is given as zero."
            for row in self.plates.determined
        ]
        found += [
            f"The centre ({x:.6g}, {y:.6g}) of the pin at {name!r} is not in its hole: the edge nearest to the centre "
            "faces away from it. There the distance from the pin is no gap. Correct the centre of the pin, or the "
            "edges of its contact."
            for name, (x, y) in misplaced_pins(self.problem).items()
        ]
        found += [
            f"The radius of the pin at {name!r} is {interference:.6g} [length] larger than that of its bore. This is a "
            "press fit: the pin presses all around before it is loaded. If it should have a clearance, give it a "
            "smaller radius."
            for name, interference in pressed_pins(self.problem).items()
        ]
        return tuple(found)

    def slipped(self, slip: Sequence[FloatArray]) -> Discretization:
        """The same problem after earlier slip: the tangential offset w of each contact grows by `slip`, dimensionless.

        Parameters
        ----------
        slip : sequence of (m,) arrays
            One array for each of `contacts`, at its points.

        """
        contacts = tuple(rows.with_offset(rows.offset + more) for rows, more in zip(self.contacts, slip, strict=True))
        change = [
            rows.rule.multipliers_of_rows(rows.points.weights * more)
            for rows, more in zip(contacts, slip, strict=True)
            if rows.law != "tied"
        ]
        load = self.qvi.T.T @ joined(change)
        assert self.qvi.load is not None
        qvi = self.qvi.changed(f=self.qvi.f + load, load=self.qvi.load + load)
        return replace(self, contacts=contacts, qvi=qvi)

    def freeing(self, vertices: IntArray) -> Discretization:
        """The same problem, in the same units and after the same slip, with the shear at the vertices given up."""
        return self._again(self.scales, vertices)

    def everywhere(self) -> Discretization:
        """The same problem, after the same slip, with all obstacles where they stand, however far."""
        return self._again(replace(self.scales, reach=np.inf), self.freed)

    def following(self, problem: ContactProblem, scales: Scales | None = None) -> Discretization:
        """Another problem on the same mesh, by the same element, with the same shears given up.

        Where it differs in loads and in data of contacts only, it shares all matrices, and the factorisation.

        Parameters
        ----------
        problem : ContactProblem
            The problem; its mesh is the same, up to the names of edge sets.
        scales : Scales, optional
            Units of the dimensionless problem; those of the problem by default.

        Raises
        ------
        InputError
            If the problem is on another mesh.

        """
        if not isinstance(problem, ContactProblem):
            raise InputError("problem", problem, "give a ContactProblem")
        if not problem.mesh.same_as(self.problem.mesh):
            remedy = "it is on another mesh than the problem discretised before: give both the same mesh and element"
            raise InputError("ContactProblem.mesh", type(problem.mesh).__name__, remedy)
        return _discretized(problem, self.space, scales or Scales.of(problem), self.freed, self)

    def _again(self, scales: Scales, freed: IntArray) -> Discretization:
        fresh = _discretized(self.problem, self.space, scales, freed, self)
        return fresh.slipped([old.offset - new.offset for old, new in zip(self.contacts, fresh.contacts, strict=True)])

    def fitted(self) -> Discretization:
        """The same problem in units of the stress it would have without contact laws, if its own are far too large.

        `Scales` cannot foresee every load, such as an obstacle that drags the body along by friction. Stresses far
        below the unit would be lost in the tolerances of solvers and certificate.
        """
        if not 0.0 < self.qvi.rough_stress() < _TOO_SMALL or self.qvi.bonded_error > _UNRELIABLE:
            return self
        size = float(np.sqrt(2.0 * self.qvi.bonded_energy))
        if not _NOISE < size < _TOO_SMALL:
            return self
        scales = replace(self.scales, stress=self.scales.stress * size)
        return _discretized(self.problem, self.space, scales, self.freed, self)

    def offsets(self) -> list[FloatArray]:
        """The tangential offset w that the problem prescribes at the points of each contact, without earlier slip."""
        return [rows.offset for rows in contact_rows(self.problem, self.space, self.scales)]

    def values(self, z: FloatArray) -> FloatArray:
        """Dimensionless degrees of freedom u of the Airy function, shape (N,)."""
        return np.asarray(self.basis @ z + self.elimination.particular)

    def nodal_values(self, z: FloatArray) -> FloatArray:
        """The same at the nodes of a rectilinear mesh, scaled (see `Grid.dof_scales`), shape (ny + 1, nx + 1, 4)."""
        ny, nx = self.problem.grid.shape
        return self.values(z).reshape(ny + 1, nx + 1, 4)


def discretize(
    problem: ContactProblem,
    *,
    element: ElementName | None = None,
    degree: int | None = None,
    contact_rows: RowKind | None = None,
    scales: Scales | None = None,
    freed: IntArray | None = None,
) -> Discretization:
    """Discretise a contact problem.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    element : "bfs" or "hct", optional
        "hct" is the Hsieh-Clough-Tocher element: rectangles are cut into triangles before, and the discretisation's
        problem is the one on triangles. "bfs" is the Bogner-Fox-Schmit element, on rectangles only. By default "hct",
        but "bfs" where a rectangle is more than 500 times as long as wide, as triangles would be too thin. On one mesh
        degree 4 is far closer; it takes 2 to 8 times the time of "bfs" and, from 128² cells on, 5 to 7 times its
        memory: give fewer cells, or name "bfs" where a large grid has to stay.
    degree : int, optional
        Degree of the Airy function on triangles, from 3 to 12, 4 by default; Bogner-Fox-Schmit's is 3.
    contact_rows : "bernstein" or "gauss", optional
        What bounds the tractions on a triangle mesh: their Bernstein coefficients on each edge, so that the contact law
        holds on whole edges, or their values at Gauss points. By default coefficients; Gauss points where friction
        varies along an edge, or another bound does so but linearly, as coefficients do not hold such laws. On
        rectangles they are four Gauss points.
    scales : Scales, optional
        Units of the dimensionless problem; those of the problem by default.
    freed : int array, optional
        Vertices where a shear prescribed beside a contact is given up in favour of the edges' resultants.

    Notes
    -----
    Lengths are divided by L, stresses by S, displacements by C S L (see `Scales`). The unknowns z are those degrees of
    freedom of Φ that traction conditions and gauge leave free. In (D2) then

        K = Bᵀ [∫ cσ:τ] B,    f = Bᵀ (loads − [∫ cσ:τ] u₀),    u = B z + u₀,

    rows of N and T are σ_N' and σ_T at Gauss points of the contact edges, or their Bernstein coefficients there, W the
    weights, and the obstacle enters the loads by ∫ g τ_N + w τ_T. The effective σ_N' = σ_N + p_w is σ_N where no fluid
    presses in the contact; the pore pressure p_w is part of n₀ as the potential of the body force is.

    Raises
    ------
    InputError
        If a field of the problem gives bad values, the tractions on a closed part of the boundary are out of balance,
        or the mesh has no such element, or none of that degree.

    """
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem")
    problem = with_element(problem, element)
    if scales is not None and not isinstance(scales, Scales):
        raise InputError("scales", scales, "give Scales, or leave them out")
    given_up = np.empty(0, dtype=np.int64) if freed is None else _vertices("freed", freed, problem)
    rows = "gauss" if contact_rows is None and laws_vary(problem) else contact_rows
    space = basis_for(problem.mesh, degree, rows)
    return _discretized(problem, space, scales or Scales.of(problem), given_up)


def _vertices(field: str, given: object, problem: ContactProblem) -> IntArray:
    """Numbers of vertices of the problem's mesh."""
    numbers, count = real_array(field, given, "give numbers of vertices"), len(problem.mesh.vertices)
    found = numbers.astype(np.int64) if np.isfinite(numbers).all() and np.abs(numbers).max(initial=0) < count else None
    if found is None or found.ndim != 1 or (found != numbers).any() or found.min(initial=0) < 0:
        raise InputError(field, given, f"give numbers of vertices, 0 to {count - 1}, as an array (k,)")
    return found


def _discretized(
    problem: ContactProblem, space: Basis, scales: Scales, freed: IntArray, before: Discretization | None = None
) -> Discretization:
    """Discretise, and share what a problem `before` in the same space has in common with this one."""
    elimination = _eliminated(problem, space, scales, freed, before)
    contacts = contact_rows(problem, space, scales)
    plates = plate_rows(problem, scales, contacts, elimination.basis, elimination.particular)
    energy = energy_of(problem, space, scales, before)
    posed = Posed(problem, space, energy, scales, elimination, contacts, plates)
    qvi = algebraic(posed, before, None if before is None else before.qvi)
    return Discretization(problem, space, energy, scales, elimination, contacts, plates, qvi, freed)


def _eliminated(
    problem: ContactProblem, space: Basis, scales: Scales, freed: IntArray, before: Discretization | None
) -> Elimination:
    """All degrees of freedom that meet the tractions, by the basis of a problem `before` if that is the same."""
    disagree = _disagreeing(problem, space)
    if (
        before is not None
        and np.array_equal(freed, before.freed)
        and np.array_equal(disagree, _disagreeing(before.problem, space))
        and _same_tractions(problem, scales, before)
    ):
        return before.elimination
    corners = SharedCorners(disagree, freed)
    try:
        elimination = space.eliminate(prescribed_tractions(problem, scales), corners)
    except UnbalancedLoadError as error:
        imbalance = error.imbalance * scales.stress * scales.length
        remedy = (
            "tractions and body forces on a closed part of the boundary are out of balance by this force "
            "(or moment over the body's length): correct the loads, or support the body by a Displacement or Contact"
        )
        if problem.mesh.hole_edges.any() and element_on(problem.mesh) == "bfs":
            remedy += "; on rectangles the loads on a hole, with the weight of what would fill it, must balance by "
            remedy += f"themselves: {FORCES_ON_HOLES}"
        raise InputError("ContactProblem.conditions", imbalance, remedy) from error
    return elimination if before is None else elimination.sharing(before.elimination)


def _disagreeing(problem: ContactProblem, space: Basis) -> IntArray:
    """Vertices of contacts without friction that a prescribed shear reaches, where spaces share one."""
    return np.array(frictionless_corners(problem) if space.shear_at_vertices else [], dtype=np.int64)


def _same_tractions(problem: ContactProblem, scales: Scales, before: Discretization) -> bool:
    """Whether the prescribed tractions are those of a problem before, in the same units."""
    mine, its = problem.prescribed(Traction), before.problem.prescribed(Traction)
    return (
        scales == before.scales
        and problem.body_potential == before.problem.body_potential
        and len(mine) == len(its)
        and all(
            one.name == other.name
            and one.value == other.value
            and np.array_equal(one.index, other.index)
            and np.array_equal(one.direction, other.direction)
            for one, other in zip(mine, its, strict=True)
        )
    )
