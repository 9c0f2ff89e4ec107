"""From the contact problem to the algebraic quasi-variational inequality (D2), and what problems of one space share.

In `docs/theory.md`: (D1), (D2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, get_args

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, whole_number
from qvi_contact.basics.retired import refuse_arguments
from qvi_contact.discretization.contact_rows import ContactRows, contact_rows, joined, laws_vary
from qvi_contact.discretization.elimination import Elimination, UnbalancedLoadError
from qvi_contact.discretization.energy import TriangleEnergy
from qvi_contact.discretization.loads import cell_potential, displacement_load, potential_at, prescribed_tractions
from qvi_contact.discretization.plates import PlateRows, misplaced_pins, plate_rows, pressed_pins
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.space import RowKind, StressSpace
from qvi_contact.discretization.tractions import eliminate_tractions
from qvi_contact.element.hsieh_clough_tocher import hsieh_clough_tocher
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import Traction
from qvi_contact.problem.problem import ContactProblem
from solvers import ContactMatrices, EnergyRoot, FrictionQVI, Law, Loads, Stiffness, Traces
from solvers.basics.types import Stated

DEFAULT_DEGREE: Final = 4
"""Degree of the Airy function where none is given."""

_TOO_SMALL = 1e-2  # mean stress in units of the problem below which the units are changed
_NOISE = 1e-12  # mean stress in units of the problem below which there is none
_MISFIT = 1e-6  # difference of data from what is taken for them, in units of the problem, that needs no word
_UNRELIABLE = 1e-4  # relative error of the linear solve above which they are left


@dataclass(frozen=True, eq=False)
class Posed:
    """A contact problem on the elements of its mesh, but for the algebraic problem itself; see `Discretization`."""

    problem: ContactProblem
    space: StressSpace
    energy: TriangleEnergy
    scales: Scales
    elimination: Elimination
    contacts: tuple[ContactRows, ...]
    plates: PlateRows


def _energy_of(problem: ContactProblem, space: StressSpace, scales: Scales, before: Posed | None) -> TriangleEnergy:
    """The energy of the body, the very one of an earlier problem if material and body force are the same."""
    potential = cell_potential(problem, space, scales)
    if before is not None and _same_stiffness(problem, scales, before):
        known = cell_potential(before.problem, before.space, before.scales)
        if (potential is None and known is None) or np.array_equal(potential, known):  # type: ignore[arg-type]  # None
            return before.energy
    return TriangleEnergy.of(space, problem.cell_materials, _compliances(problem, scales), potential)


def _algebraic(posed: Posed, before: Posed | None = None, known: FrictionQVI | None = None) -> FrictionQVI:
    """Assemble, and substitute u = B z + u₀; matrices that are those of a `known` problem are not made again."""
    rows = _Rows(posed)
    if before is None or known is None or not _same_matrices(posed, before):
        return _assembled(posed, rows)
    contact = known.contact
    if not _equal(posed.plates.A, before.plates.A):
        contact = replace(contact, A=sparse.csc_array(posed.plates.A))
    root, at_rest = _root_and_rest(posed, before, known)
    load = rows.load
    loads = Loads(load - at_rest, *rows.at_rest, posed.plates.b, root, load)
    return FrictionQVI(known.stiffness, contact, loads, rows.law)


def _root_and_rest(posed: Posed, before: Posed, known: FrictionQVI) -> tuple[EnergyRoot, FloatArray]:
    """The root of the energy, and Rᵀr₀ = load − f (n,), which K u₀ would give too, by 𝒦."""
    if posed.energy is before.energy and posed.elimination is before.elimination:
        assert known.root is not None
        assert known.load is not None
        return known.root, known.load - known.f
    root = posed.energy.root(posed.elimination)
    return root, root.adjoint(root.apply(np.zeros(known.n)))


def _assembled(posed: Posed, rows: _Rows) -> FrictionQVI:
    """With all matrices."""
    energy, elimination = posed.energy, posed.elimination
    parameters, interpolation = rows.traces
    Y = sparse.csr_array(parameters @ elimination.basis)
    N, T = _halves(sparse.csr_array(interpolation @ Y))
    K, of_particular = energy.reduced(elimination)
    least = float(K.diagonal().min(initial=np.inf))
    if least <= 0.0:
        remedy = "cells this thin, as a share of the body's length, are beyond double precision: use less grading"
        raise InputError("ContactProblem.mesh", posed.space.smallest, remedy)
    f, root = rows.load - elimination.basis.T @ (of_particular - energy.load), energy.root(elimination)
    return FrictionQVI(
        Stiffness(K.T, root, energy.places(elimination)),  # Kᵀ is the same matrix, compressed by columns
        ContactMatrices(
            sparse.csc_array(N),
            sparse.csc_array(T),
            rows.weights,
            sparse.csc_array(posed.plates.A),
            Traces(sparse.csc_array(Y), sparse.csc_array(interpolation)),
        ),
        Loads(f, *rows.at_rest, posed.plates.b, root, rows.load),
        rows.law,
    )


class _Rows:
    """What the contacts that limit tractions put into (D2)."""

    def __init__(self, posed: Posed) -> None:
        self._posed = posed
        self._limited = _limited(posed)

    @cached_property
    def traces(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows (r, N) of the parameters of traces, and their interpolation (2m, r)."""
        return self._posed.space.trace_parameters([rows.points.edges for rows in self._limited])

    @cached_property
    def load(self) -> FloatArray:
        """Of prescribed displacements and obstacles (n,)."""
        load = displacement_load(self._posed.problem, self._posed.space, self._posed.scales)
        for rows in self._posed.contacts:
            load = load + rows.work()
        return np.asarray(self._posed.elimination.basis.T @ load)

    @property
    def at_rest(self) -> tuple[FloatArray, FloatArray]:
        """n0 and t0 (m,)."""
        problem, scales, limited = self._posed.problem, self._posed.scales, self._limited
        parameters, interpolation = self.traces
        n0, t0 = np.split(interpolation @ (parameters @ self._posed.elimination.particular), 2)
        fixed = [
            rows.rule.at_rows(potential_at(problem, scales, rows.points.coordinates) + rows.pore_pressure)
            for rows in limited
        ]
        return n0 + joined(fixed), t0

    @property
    def weights(self) -> FloatArray:
        """W (m,)."""
        return joined([rows.row_weights for rows in self._limited])

    @property
    def law(self) -> Law:
        """What bounds the tractions."""
        return law_of(self._limited)


def law_of(contacts: Sequence[ContactRows]) -> Law:
    """The law of contacts one after the other, tied ones left out."""
    limited = [rows for rows in contacts if rows.law != "tied"]
    limits = [rows.row_limits for rows in limited]
    return Law(
        joined([each.friction for each in limits]),
        joined([each.cohesion for each in limits]),
        joined([each.cap for each in limits]),
        joined([rows.bilateral for rows in limited]).astype(bool),
    )


def _same_matrices(posed: Posed, before: Posed) -> bool:
    """Whether K and the rows of contacts are those of an earlier problem."""
    return (
        posed.elimination.basis is before.elimination.basis
        and _same_stiffness(posed.problem, posed.scales, before)
        and _same_edges(_limited(posed), _limited(before))
    )


def _same_stiffness(problem: ContactProblem, scales: Scales, before: Posed) -> bool:
    return np.array_equal(problem.cell_materials, before.problem.cell_materials) and np.array_equal(
        _compliances(problem, scales), _compliances(before.problem, before.scales)
    )


def _same_edges(rows: list[ContactRows], others: list[ContactRows]) -> bool:
    return len(rows) == len(others) and all(
        np.array_equal(mine.points.edges.first, its.points.edges.first)
        and np.array_equal(mine.points.edges.second, its.points.edges.second)
        for mine, its in zip(rows, others, strict=True)
    )


def _limited(posed: Posed) -> list[ContactRows]:
    """The contacts that limit tractions."""
    return [rows for rows in posed.contacts if rows.law != "tied"]


def _compliances(problem: ContactProblem, scales: Scales) -> FloatArray:
    return np.stack([material.compliance / scales.compliance for material in problem.materials])


def _equal(A: sparse.csr_array, B: sparse.csr_array) -> bool:
    """Whether two small matrices have the same entries."""
    return A.shape == B.shape and np.array_equal(A.toarray(), B.toarray())


def _halves(rows: sparse.csr_array) -> tuple[sparse.csr_array, sparse.csr_array]:
    """N and T of [N; T]."""
    m = rows.shape[0] // 2
    return rows[:m], rows[m:]


@dataclass(frozen=True, eq=False)
class Discretization(Posed, Stated):
    """A contact problem on the elements of its mesh, traction conditions and gauge eliminated.

    Attributes
    ----------
    problem : ContactProblem
        The problem.
    space : StressSpace
        Mesh and element, dimensionless.
    energy : TriangleEnergy
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

    """

    qvi: FrictionQVI

    @property
    def basis(self) -> sparse.csr_array:
        """U = basis z + particular, shape (N, n)."""
        return self.elimination.basis

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What a user should know about how the data were taken, one sentence each."""
        found = [
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
        qvi = self.qvi.with_loads(f=self.qvi.f + load, load=self.qvi.load + load)
        return replace(self, contacts=contacts, qvi=qvi)

    def with_law(self, problem: ContactProblem) -> Discretization:
        """Another problem, in these units, that differs in friction, cohesion and caps of contacts only."""
        contacts = contact_rows(problem, self.space, self.scales)
        return replace(self, problem=problem, contacts=contacts, qvi=replace(self.qvi, law=law_of(contacts)))

    def everywhere(self) -> Discretization:
        """The same problem, after the same slip, with all obstacles where they stand, however far."""
        scales = replace(self.scales, reach=np.inf)
        fresh = _discretized(self.problem, self.space, scales, self)
        return fresh.slipped([old.offset - new.offset for old, new in zip(self.contacts, fresh.contacts, strict=True)])

    def following(self, problem: ContactProblem, scales: Scales | None = None) -> Discretization:
        """Another problem on the same mesh, by the same element.

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
            remedy = "it is on another mesh than the problem discretised before: give both the same mesh"
            raise InputError("ContactProblem.mesh", type(problem.mesh).__name__, remedy)
        return _discretized(problem, self.space, scales or Scales.of(problem), self)

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
        return _discretized(self.problem, self.space, scales, self)

    def offsets(self) -> list[FloatArray]:
        """The tangential offset w that the problem prescribes at the points of each contact, without earlier slip."""
        return [rows.offset for rows in contact_rows(self.problem, self.space, self.scales)]

    def values(self, z: FloatArray) -> FloatArray:
        """Dimensionless degrees of freedom u of the Airy function, shape (N,)."""
        return np.asarray(self.basis @ z + self.elimination.particular)


def discretize(
    problem: ContactProblem,
    *,
    degree: int | None = None,
    contact_rows: RowKind | None = None,
    scales: Scales | None = None,
    **retired: Any,
) -> Discretization:
    """Discretise a contact problem.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    degree : int, optional
        Degree of the Airy function, from 3 to 12, 4 by default.
    contact_rows : "bernstein" or "gauss", optional
        What bounds the tractions: their Bernstein coefficients on each edge, so that the contact law holds on whole
        edges, or their values at Gauss points. By default coefficients; Gauss points where friction varies along an
        edge, or another bound does so but linearly, as coefficients do not hold such laws.
    scales : Scales, optional
        Units of the dimensionless problem; those of the problem by default.
    **retired
        Nothing: arguments of version 0.1 are refused with what to do instead.

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
        or there is no element of that degree, or no such rows.

    """
    refuse_arguments(retired)
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem")
    if scales is not None and not isinstance(scales, Scales):
        raise InputError("scales", scales, "give Scales, or leave them out")
    if contact_rows is not None and (not isinstance(contact_rows, str) or contact_rows not in get_args(RowKind)):
        raise InputError("contact_rows", contact_rows, "give 'bernstein' or 'gauss'")
    chosen = DEFAULT_DEGREE if degree is None else whole_number("degree", degree)
    _ = hsieh_clough_tocher(chosen)  # refuses degrees that are not offered
    by_default: RowKind = "gauss" if laws_vary(problem) else "bernstein"
    space = StressSpace(problem.mesh, int(chosen), contact_rows or by_default)
    return _discretized(problem, space, scales or Scales.of(problem))


def _discretized(
    problem: ContactProblem, space: StressSpace, scales: Scales, before: Discretization | None = None
) -> Discretization:
    """Discretise, and share what a problem `before` in the same space has in common with this one."""
    elimination = _eliminated(problem, space, scales, before)
    contacts = contact_rows(problem, space, scales)
    plates = plate_rows(problem, scales, contacts, elimination.basis, elimination.particular)
    energy = _energy_of(problem, space, scales, before)
    posed = Posed(problem, space, energy, scales, elimination, contacts, plates)
    qvi = _algebraic(posed, before, None if before is None else before.qvi)
    return Discretization(problem, space, energy, scales, elimination, contacts, plates, qvi)


def _eliminated(
    problem: ContactProblem, space: StressSpace, scales: Scales, before: Discretization | None
) -> Elimination:
    """All degrees of freedom that meet the tractions, by the basis of a problem `before` if that is the same."""
    if before is not None and _same_tractions(problem, scales, before):
        return before.elimination
    try:
        elimination = eliminate_tractions(space, prescribed_tractions(problem, scales))
    except UnbalancedLoadError as error:
        imbalance = error.imbalance * scales.stress * scales.length
        remedy = (
            "tractions and body forces on a closed part of the boundary are out of balance by this force "
            "(or moment over the body's length): correct the loads, or support the body by a Displacement or Contact"
        )
        raise InputError("ContactProblem.conditions", imbalance, remedy) from error
    return elimination if before is None else elimination.sharing(before.elimination)


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
