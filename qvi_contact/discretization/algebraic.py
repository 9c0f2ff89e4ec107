"""The algebraic problem of a discretised one; what an earlier problem has in common with it is shared.

In `docs/theory.md`: (D1), (D2).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.contact_rows import ContactRows, joined
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.discretization.energy import TriangleEnergy
from qvi_contact.discretization.loads import cell_potential, displacement_load, potential_at
from qvi_contact.discretization.plates import PlateRows
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.space import StressSpace
from qvi_contact.errors import InputError
from qvi_contact.problem.problem import ContactProblem
from solvers import EnergyRoot, FrictionQVI, Traces


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


def energy_of(problem: ContactProblem, space: StressSpace, scales: Scales, before: Posed | None) -> TriangleEnergy:
    """The energy of the body, the very one of an earlier problem if material and body force are the same."""
    potential = cell_potential(problem, space, scales)
    if before is not None and _same_stiffness(problem, scales, before):
        known = cell_potential(before.problem, before.space, before.scales)
        if (potential is None and known is None) or np.array_equal(potential, known):  # type: ignore[arg-type]  # None
            return before.energy
    return TriangleEnergy.of(space, problem.cell_materials, _compliances(problem, scales), potential)


def algebraic(posed: Posed, before: Posed | None = None, known: FrictionQVI | None = None) -> FrictionQVI:
    """Assemble, and substitute u = B z + u₀; matrices that are those of a `known` problem are not made again."""
    rows = _Rows(posed)
    if before is None or known is None or not _same_matrices(posed, before):
        return _assembled(posed, rows)
    A = known.A if _equal(posed.plates.A, before.plates.A) else sparse.csc_array(posed.plates.A)
    root, at_rest = _root_and_rest(posed, before, known)
    load = rows.load
    return known.changed(**rows.data, f=load - at_rest, root=root, load=load, A=A, b=posed.plates.b)


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
    return FrictionQVI(
        K=K.T,  # the same matrix, compressed by columns
        f=rows.load - elimination.basis.T @ (of_particular - energy.load),
        N=sparse.csc_array(N),
        T=sparse.csc_array(T),
        root=energy.root(elimination),
        load=rows.load,
        A=sparse.csc_array(posed.plates.A),
        b=posed.plates.b,
        traces=Traces(sparse.csc_array(Y), sparse.csc_array(interpolation)),
        places=energy.places(elimination),
        **rows.data,
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
    def data(self) -> dict[str, Any]:
        """Vectors of (D2) by row."""
        problem, scales, limited = self._posed.problem, self._posed.scales, self._limited
        parameters, interpolation = self.traces
        n0, t0 = np.split(interpolation @ (parameters @ self._posed.elimination.particular), 2)
        fixed = [
            rows.rule.at_rows(potential_at(problem, scales, rows.points.coordinates) + rows.pore_pressure)
            for rows in limited
        ]
        return {
            "n0": n0 + joined(fixed),
            "t0": t0,
            "mu": joined([rows.row_limits.friction for rows in limited]),
            "W": joined([rows.row_weights for rows in limited]),
            "cohesion": joined([rows.row_limits.cohesion for rows in limited]),
            "cap": joined([rows.row_limits.cap for rows in limited]),
            "bilateral": joined([rows.bilateral for rows in limited]).astype(bool),
        }


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
