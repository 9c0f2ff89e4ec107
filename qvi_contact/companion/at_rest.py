"""A body without loads, its supports at rest, and what its contacts do: least energies of displacements along them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.companion.condensation import CondensedBody
from qvi_contact.companion.dual import Contacts
from qvi_contact.companion.solver import condensed_at_rest
from qvi_contact.companion.supports import PARALLEL
from qvi_contact.problem.problem import ContactProblem

MOST: Final = 4000
"""Contact coefficients, normal and tangential ones, for which dense matrices of them are made."""

SINGULAR: Final = 1e-11
"""Eigenvalue of a stiffness matrix, relative, that is a rigid motion's."""

_DEPENDENT = 1e-9  # singular value of rows, relative, that counts as zero


@dataclass(frozen=True, eq=False)
class BodyAtRest:
    """Displacements v that vanish where displacements are prescribed, and motions of plates that forces drive.

    Attributes
    ----------
    contacts : Contacts
        The contacts, n coefficients.
    body : CondensedBody
        The body.
    B : (2 n, k + q) array
        c, what the body moves beyond the plates, normal ones first, from w_Γ and the motions.
    S : (k + q, k + q) array
        The energy of both, ½ wᵀS w.
    live : (2 n,) bool array
        Where c can change.

    """

    contacts: Contacts
    body: CondensedBody
    B: FloatArray
    S: FloatArray
    live: BoolArray

    @classmethod
    def of(cls, problem: ContactProblem, degree: int | None = None) -> BodyAtRest:
        """Displacements of a degree on the mesh of a problem.

        Raises
        ------
        InputError
            If the problem or the degree is wrong.
        FactorisationError
            If the stiffness matrix cannot be factorised.

        """
        contacts, body = condensed_at_rest(problem, degree)
        moved, driven = (contacts.rows @ body.supports.axes)[:, body.interface].toarray(), contacts.motions
        B = np.hstack([moved, -driven])
        live = np.abs(moved).sum(axis=1) > PARALLEL
        B[~live] = 0.0
        S = np.zeros((B.shape[1],) * 2)
        S[: moved.shape[1], : moved.shape[1]] = body.S
        return cls(contacts, body, B, S, np.asarray(live))

    def expand(self, w: FloatArray) -> tuple[FloatArray, FloatArray]:
        """V (size,) and the motions (q,) from w_Γ and these."""
        values, motions = np.split(w, [self.body.S.shape[0]])
        return self.body.expand(values), motions

    def least_energy(self, given: BoolArray, zero: BoolArray) -> FloatArray:
        """E with E x·x = min a(v, v) over v whose coefficients are x where `given`, and 0 where `zero`."""
        rows = np.vstack([self.B[given], self.B[zero & self.live]])
        particular, free = solutions(rows)
        count = int(given.sum())
        P, S = particular[:, :count], self.S
        cross = free.T @ S @ P
        found = P.T @ S @ P - cross.T @ pseudo_solve(free.T @ S @ free, cross)
        return np.asarray((found + found.T) / 2.0)


def solutions(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P (k, r) and Z (k, k − rank): all solutions of rows · w = d are P d + Z y, of the least squares if they clash."""
    U, values, V = np.linalg.svd(rows, full_matrices=True)
    rank = int((values > _DEPENDENT * max(float(values.max(initial=0.0)), 1e-300)).sum())
    return (V[:rank].T / values[:rank]) @ U[:, :rank].T, V[rank:].T


def pseudo_solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The least solution of matrix · x = right (k, j) for a symmetric matrix ≥ 0, which rigid motions make singular."""
    if not len(matrix):
        return np.zeros((0, right.shape[1]))
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2.0)
    kept = values > SINGULAR * values[-1]
    return np.asarray((vectors[:, kept] / values[kept]) @ (vectors[:, kept].T @ right))
