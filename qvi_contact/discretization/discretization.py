"""From the contact problem to the algebraic quasi-variational inequality; problems on one mesh share matrices.

In `docs/theory.md`: (D1), (D2).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, get_args

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, acts, instance_of, whole_number
from qvi_contact.basics.schema import WithFields
from qvi_contact.discretization.displacements import (
    ALIKE,
    DisplacementSpace,
    PrescribedDisplacements,
    spread,
    supports,
    triangle,
)
from qvi_contact.discretization.energy import BodyStiffness, Root, Springs
from qvi_contact.discretization.loads import (
    ContactRows,
    cell_stress,
    contact_rows,
    joined,
    laws_vary,
    limits_of,
    traction_data,
    works_of,
)
from qvi_contact.discretization.plates import PlateRows, pins, plate_rows
from qvi_contact.discretization.scaling import Scales, bounds
from qvi_contact.discretization.space import EdgeRule, LawOn, StressSpace, edge_rule
from qvi_contact.discretization.supports import Supports
from qvi_contact.element.hsieh_clough_tocher import HIGHEST, LOWEST
from qvi_contact.errors import InputError, place_of, refuse_arguments
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Displacement, Traction
from qvi_contact.problem.problem import ContactProblem
from solvers import ContactMatrices, FrictionQVI, Law, Loads, TractionFactor
from solvers.basics.types import Kept, PicklesFields, read_only

_DEGREE: Final = 4  # default degree of the Airy function
_MISFIT = 1e-6  # dimensionless difference of given data from their approximation, above which a remark is made


@dataclass(frozen=True, eq=False)
class Discretization(WithFields, PicklesFields):
    """A contact problem on the elements of its mesh; traction conditions and the gauge of Φ are eliminated."""

    problem: ContactProblem
    """The problem."""
    scales: Scales
    """The units of length, stress and displacement."""
    rule: EdgeRule
    """The rows of a contact edge: Bernstein coefficients, or values at Gauss points."""
    root: Root
    """The energy of the body in the unknowns z; other problems may share its `stiffness` and `supports`."""
    contacts: tuple[ContactRows, ...]
    """The rows of the algebraic problem that belong to each contact, and the contact's data at its points."""
    plates: PlateRows
    """Equality rows of plates driven by force."""
    qvi: FrictionQVI
    """The algebraic problem, dimensionless."""
    works: tuple[FloatArray, float]
    """Work ∫_{Γ_u} U·τn ds + ∫_{Γ_μ} (g τ_N' + w τ_T) ds of the prescribed displacements and obstacles, dimensionless:
    a vector over the degrees of freedom (N,) of Φ, and the constant part of the body potential and of fluids."""
    later: bool = False
    """Whether this is a later load step: its earlier slip, also where zero, is a computed value, not an exact one."""

    @property
    def supports(self) -> Supports:
        """All u = B z + u₀ that meet the prescribed tractions; B is the `basis`."""
        return self.root.stiffness.supports

    @property
    def space(self) -> StressSpace:
        """Mesh and element, dimensionless."""
        return self.supports.space

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Sentences for the user about data that were approximated, have no effect, or look wrong."""
        remarks = [
            f"On {rows.name!r} the pore pressure that is taken differs from the given one by up to "
            f"{rows.pore_misfit * self.scales.stress:.3g} [stress] at single points. Its force and moment on every "
            "edge are right. To reduce the difference, let an edge end where the pressure jumps, or refine there."
            for rows in self.contacts
            if rows.pore_misfit > _MISFIT
        ]
        remarks += [
            f"Equilibrium with the other loads already determines {row.component} of the plate at {row.contact!r}. "
            "The plate's motion in that component is not determined, and is given as zero."
            for row in self.plates.determined
        ]
        temperatures = self.problem.temperature, *(region.temperature or 0.0 for region in self.problem.regions)
        if any(map(acts, temperatures)) and not any(material.expansion for material in self.problem.materials):
            remarks.append("The temperature has no effect: no material has an expansion. Give one, or no temperature.")
        remarks += [
            f"The potential of the body force {name!r} is a constant, {field:g} [stress]: it has no force. The "
            "potential of a weight is ρ g y."
            for name, field in self.problem.body_forces.items()
            if not callable(field) and field
        ]
        for pin in pins(self.problem):
            if pin.misplaced:
                remarks.append(
                    "The centre ({:.6g}, {:.6g}) of the pin at ".format(*pin.centre)
                    + f"{pin.name!r} is not in its hole: the edge nearest to the centre faces away from it. There the "
                    "distance from the pin is no gap. Correct the centre of the pin, or the edges of its contact."
                )
            if pin.interference:
                remarks.append(
                    f"The radius of the pin at {pin.name!r} is {pin.interference:.6g} [length] larger than that of its "
                    "bore. This is a press fit: the pin presses all around before it is loaded. If it should have a "
                    "clearance, give it a smaller radius."
                )
        return *remarks, *self.contradictions

    @cached_property
    def contradictions(self) -> tuple[str, ...]:
        """Sentences about corners where supports and obstacles demand several displacements, by more than `_MISFIT`."""
        if not self.problem.prescribed(Displacement):
            return ()
        obstacles = (
            f"At {place} a support and the obstacle of {name!r} demand displacements that differ by {excess:.3g} "
            "[length]. There stresses and forces grow without limit on finer meshes. Make the displacements agree, or "
            "leave a free side between them."
            for place, name, excess in self.corners_that_jump(self.problem, _MISFIT)
        )
        return *self._supported_corners[1].jumps, *obstacles

    @cached_property
    def _supported_corners(self) -> tuple[DisplacementSpace, PrescribedDisplacements]:
        """Displacements of degree 1, and what supports prescribe of them."""
        space = DisplacementSpace.of(self.problem, triangle(1))
        return space, supports(self.problem, space, self.scales, _MISFIT)

    def corners_that_jump(self, problem: ContactProblem, least: float) -> Iterator[tuple[str, str, float]]:
        """Contacts with vertices that supports move beyond the obstacle: place of the worst one, contact, and how far.

        The distance [length] is more than a share `least` of displacements. The problem has the same supports. Joints,
        springs, and plates driven by force are left out, as they give way.
        """
        (space, prescribed), ends, unit = self._supported_corners, np.array([0.0, 1.0]), self.scales.displacement
        for direction, values, is_equation, edges, contact in bounds(problem):
            if contact is None:
                continue
            (x, y), dofs = problem.mesh.points_along(edges, ends), 2 * space.along(edges)[..., None] + np.arange(2)
            d, limit = vectors_along(edges, direction, ends), values[:, [0, -1]].ravel()
            rows = spread(np.arange(x.size)[:, None], dofs.reshape(-1, 2), d.reshape(-1, 1, 2), space.size)[: x.size]
            excess = unit * (rows @ prescribed.particular) - limit
            excess = np.abs(excess) if is_equation else np.maximum(excess, 0.0)
            excess[abs(rows @ prescribed.basis.matrix).sum(axis=1) > ALIKE] = 0.0  # where supports leave d·v free
            worst = int(np.argmax(excess))
            if excess[worst] > least * max(unit, float(np.abs(limit).max())):
                yield place_of((x.flat[worst], y.flat[worst])), contact.name, float(excess[worst])

    def with_law(self, problem: ContactProblem) -> Discretization:
        """The discretisation of a problem that differs in friction, cohesion and caps only, in the same units."""
        pairs = zip(self.contacts, problem.contacts, strict=True)
        limits = [limits_of(problem, contact, self.scales, self.rule, rows.points) for rows, contact in pairs]
        contacts = tuple(
            replace(rows, row_limits=for_rows, limits=at_points)
            for rows, (for_rows, at_points) in zip(self.contacts, limits, strict=True)
        )
        return replace(self, problem=problem, contacts=contacts, qvi=replace(self.qvi, law=law_of(contacts)))

    def with_far_obstacles(self) -> Discretization:
        """The same problem, with the same earlier slip, and every obstacle at its true distance, however far."""
        slip = [rows.slip for rows in self.contacts] if self.later else None
        return _discretized(self.problem, self.space, self.rule, replace(self.scales, reach=np.inf), slip)

    def with_data(
        self, problem: ContactProblem, scales: Scales | None = None, slip: Sequence[FloatArray] | None = None
    ) -> Discretization:
        """The discretisation of another problem on the same mesh, with the same element and rows of contacts.

        Its units are `scales`, by default its own. `slip` holds the earlier slip (m,) at the points of each contact,
        dimensionless, which is added to the offset w; None is no slip. If only loads and data of contacts differ, the
        two share matrices and factorisation. `InputError` if the meshes differ in more than names of edge sets.
        """
        instance_of(ContactProblem, "problem", problem)
        if not problem.mesh.same_as(self.problem.mesh):
            remedy = "it is on another mesh than the problem discretised before: give both the same mesh"
            raise InputError("ContactProblem.mesh", type(problem.mesh).__name__, remedy)
        vars(problem.mesh)["kept"] = self.problem.mesh.kept  # equal meshes share one cache of matrices
        return _discretized(problem, self.space, self.rule, scales or Scales.of(problem), slip)

    def values(self, z: FloatArray) -> FloatArray:
        """Dimensionless degrees of freedom u of the Airy function, shape (N,)."""
        return np.asarray(self.supports.basis.expanded(z) + self.root.particular)

    def work(self, u: FloatArray) -> float:
        """Work of the prescribed displacements and obstacles on degrees of freedom u (N,) [stress × length²]."""
        return float(self.works[0] @ u + self.works[1]) * self.scales.energy

    def coefficients(self, u: FloatArray) -> FloatArray:
        """Φ of each triangle from degrees of freedom u (N,), see `BodyStiffness.coefficients`."""
        return self.root.stiffness.coefficients(u, self.root.body)


def discretize(
    problem: ContactProblem,
    *,
    degree: int | None = None,
    law_on: LawOn | None = None,
    scales: Scales | None = None,
    **unknown: Any,
) -> Discretization:
    """Discretise a contact problem.

    `degree` is that of the Airy function, 3 to 12, by default 4. With `law_on` "edges" the contact law bounds the
    Bernstein coefficients of the tractions on each edge, and so holds on whole edges; with "points" it bounds their
    values at Gauss points. The default is "edges", but "points" if friction varies along an edge, or another bound does
    so nonlinearly, see `laws_vary`. Unknown arguments are refused with a remedy.

    The units are `scales`, by default those of the problem: lengths are divided by L, stresses by S, displacements by
    C S L. The unknowns z are the degrees of freedom of Φ that traction conditions and gauge leave free,

        K = Bᵀ [∫ cσ:τ] B,    f = Bᵀ (loads − [∫ cσ:τ] u₀),    u = B z + u₀.

    The rows of N and T are σ_N' = σ_N + p_w and σ_T on contact edges, W their weights. The obstacle enters the loads by
    ∫ g τ_N + w τ_T. The pore pressure p_w enters n₀, as does the potential of the body force.

    `InputError` if a field of the problem gives bad values, if the tractions on a closed part of the boundary are out
    of balance, or if `degree` or `law_on` is not one of those above.
    """
    if unknown:
        refuse_arguments(unknown, ("degree", "law_on", "scales"))
    instance_of(ContactProblem, "problem", problem)
    if scales is not None and not isinstance(scales, Scales):
        raise InputError("scales", scales, "give Scales, or leave them out")
    if law_on is not None and (not isinstance(law_on, str) or law_on not in get_args(LawOn)):
        raise InputError("law_on", law_on, "give 'edges' or 'points'")
    chosen = _DEGREE if degree is None else whole_number("degree", degree, HIGHEST, LOWEST)
    by_default: LawOn = "points" if laws_vary(problem) else "edges"
    mesh, rule = problem.mesh, edge_rule(law_on or by_default, chosen)
    space = mesh.kept(StressSpace, chosen, lambda: StressSpace(mesh.bare, chosen))
    return _discretized(problem, space, rule, scales or Scales.of(problem))


def _discretized(
    problem: ContactProblem,
    space: StressSpace,
    rule: EdgeRule,
    scales: Scales,
    slip: Sequence[FloatArray] | None = None,
) -> Discretization:
    """The discretisation: matrices that the mesh keeps for all problems, and the vectors of this one."""
    prescribed, kept = problem.prescribed(Traction), problem.mesh.kept
    supports = Supports.on(space, prescribed, kept)  # u = B z + u₀
    is_loaded = acts(problem.body_potential) or any(acts(part.value) for part in prescribed)
    given = [traction_data(problem, scales, part, supports.points) for part in prescribed] if is_loaded else []
    particular, imbalance = supports.particular(given)
    if imbalance > 0.0:
        remedy = (
            "tractions and body forces on a closed part of the boundary are out of balance by this force "
            "(or moment over the body's length): correct the loads, or support the body by a displacement or a contact"
        )
        raise InputError("ContactProblem.conditions", imbalance * scales.stress * scales.length, remedy)
    compliances = np.stack([material.compliance / scales.compliance for material in problem.materials])
    contacts = contact_rows(problem, space, rule, scales, slip)
    springs = Springs.of(problem, space, scales, contacts)
    stiffness = BodyStiffness.on(supports, problem.cell_materials, compliances, springs, kept)
    stress = cell_stress(problem, space, scales)
    body = None if stress is None else stiffness.loaded(stress)
    plates = plate_rows(problem, scales, contacts, supports, particular)
    root = Root(stiffness, particular, body, 0.0 if springs is None else springs.constant)
    limited = [rows for rows in contacts if rows.law != "tied"]
    matrices = _contact_matrices(supports, rule, limited, plates, kept)
    works, constant = works_of(problem, space, scales, contacts)
    # f, and the tractions n₀, t₀ of u₀ and of φ + p_w in the rows
    load = supports.basis.reduced(works)
    f, (n0, t0) = load, np.zeros((2, matrices.N.shape[0]))
    if root.body is not None or root.particular.any() or np.any(root.springs):
        f = load - root.adjoint(root.apply(np.zeros(len(load))))
        tractions = [rows.points.tractions(root.particular) for rows in limited]
        n0, t0 = (rule.at_rows(joined([both[half] for both in tractions])) for half in (0, 1))
    if acts(problem.body_potential) or any(contact.has_fluid for contact in problem.contacts):
        n0 = n0 + rule.at_rows(joined([rows.pressure(problem, scales) for rows in limited]))
    loads = Loads(f, n0, t0, plates.b, root, load)
    qvi = FrictionQVI(stiffness.matrix(kept), matrices, loads, law_of(contacts))
    return Discretization(problem, scales, rule, root, contacts, plates, qvi, (works, constant), slip is not None)


def _contact_matrices(
    supports: Supports, rule: EdgeRule, contacts: Sequence[ContactRows], plates: PlateRows, kept: Kept
) -> ContactMatrices:
    """N, T, W of the contacts, one after the other, and A of the plates, on the unknowns; kept for these edge sets."""
    edges = [rows.points.edges for rows in contacts]

    def made() -> ContactMatrices:
        # rows of σ_N at the Gauss points of all contacts, then of σ_T; E Y are the rows of `rule`
        Y = supports.basis.rows(supports.space.trace_rows(edges, rule.points))
        r = Y.shape[0]
        if isinstance(Y, np.ndarray):  # E is block diagonal, with the same block V⁻¹ for every edge
            E: Any = np.zeros((r // rule.count, rule.count) * 2)
            E[np.arange(len(E)), :, np.arange(len(E))] = rule.from_points
            E = E.reshape(r, r)
        else:
            E = sparse.kron(sparse.eye_array(r // rule.count), rule.from_points, format="csr")
        rows, weights = E @ Y, joined([rows.row_weights for rows in contacts])
        A = plates.resultants.A
        matrices = ContactMatrices(rows[: r // 2], rows[r // 2 :], weights, A, TractionFactor(Y, E))
        read_only(matrices.N, matrices.T, matrices.A, matrices.W)
        return matrices

    key = supports, rule, plates.resultants, *(part.number.tobytes() for part in edges)
    return kept(ContactMatrices, key, made)


def law_of(contacts: Sequence[ContactRows]) -> Law:
    """The law of contacts one after the other, tied ones left out."""
    parts = [(*rows.row_limits, rows.bilateral) for rows in contacts if rows.law != "tied"]
    return Law(*map(np.concatenate, zip(*parts, strict=True))) if parts else Law(np.empty(0))
