"""From a solution that meets the contact conditions to a tolerance to a displacement that meets them to rounding.

Where a coefficient presses or sticks beyond doubt its displacement is set to the obstacle's, an open one is kept at or
below the gap, and one that must not slip, or slips against the sense it is given, is held. The body is then solved once
more for these contact displacements.
"""

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.companion.dual import Contacts, DualProblem, groups

_DEPENDENT = 1e-9  # singular value of rows that share unknowns, relative, that counts as zero
_VIOLATED = 1e-12


def targets(
    contacts: Contacts, c: FloatArray, tractions: FloatArray, bound: FloatArray, stress: float
) -> tuple[FloatArray, BoolArray]:
    """Displacements (2 n,) that coefficients should have, and which of them (2 n,) are to be moved there.

    c are the displacements found, `tractions` τ, `bound` (n,) that of |τ_T|, and `stress` the unit of τ that a unit
    displacement is compared with.
    """
    n = contacts.count
    bilateral, tied = contacts.gathered("bilateral").astype(bool), contacts.gathered("tied").astype(bool)
    gap, offset = contacts.obstacle[:n], contacts.obstacle[n:]
    opening = gap - c[:n]
    pressed = -tractions[:n] / stress > np.maximum(opening, 0.0)
    held = bilateral | pressed | (opening < 0.0)
    rest = bound - np.abs(tractions[n:])
    sticks = tied | ((rest / stress > np.abs(c[n:] - offset)) & (np.abs(c[n:] - offset) < 1e-6))
    slipping = contacts.gathered("slipping")
    sticks |= (slipping == 0.0) | (slipping * (c[n:] - offset) < 0.0)
    held &= bilateral | (np.abs(opening) < 1e-6)
    return np.concatenate([gap, offset]), np.concatenate([held, sticks])


def moved(rows: sparse.csr_array, values: FloatArray, change: FloatArray) -> FloatArray:
    """Values (k,) with rows · values changed by `change` (j,), by the least change of values where rows share some."""
    wanted = rows @ values + change
    square = np.asarray(rows.multiply(rows).sum(axis=1)).ravel()
    shared = groups(rows)
    alone = square > 0.0
    for group in shared:
        alone[group] = False
    result = values.copy()
    for _ in range(2):  # once more for rounding
        error = wanted - rows @ result
        result += rows.T @ np.where(alone, error / np.where(alone, square, 1.0), 0.0)
        for group in shared:
            part = rows[group]
            columns = np.unique(part.indices)
            result[columns] += np.linalg.lstsq(part[:, columns].toarray(), error[group], _DEPENDENT)[0]
    return result


def admissible(
    problem: DualProblem, values: FloatArray, plates: FloatArray, tractions: FloatArray, bound: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """(v (size,), c (2 n,), reasons) that meets the contact conditions to rounding, from w_Γ and motions of plates."""
    contacts, rows = problem.contacts, sparse.csr_array(problem.B)
    beyond = problem.constant + contacts.motions @ (-plates)
    stress = max(1e-300, float(np.abs(tractions).max(initial=0.0)), 1.0)
    wanted, held = targets(contacts, rows @ values + beyond, tractions, bound, stress)
    held &= problem.movable
    held[contacts.count :] &= problem.live[contacts.count :] | contacts.gathered("tied").astype(bool)
    for _ in range(3):  # a correction in a corner may push another contact line over its gap
        c = rows @ values + beyond
        values = moved(_chosen(rows, held), values, (wanted - c)[held])
        over = np.flatnonzero(_excess(problem, rows @ values + beyond) > 0.0)
        over = over[problem.movable[over] & ~held[over]]
        if not len(over):
            break
        held[over] = True
    v = problem.body.expand(values)
    c = contacts.rows @ v - contacts.plates(plates)
    return v, c, _reasons(problem, c)


def _chosen(rows: sparse.csr_array, held: BoolArray) -> sparse.csr_array:
    index: IntArray = np.flatnonzero(held)
    return sparse.csr_array(rows[index])


def _excess(problem: DualProblem, c: FloatArray) -> FloatArray:
    """By how much c_N exceeds the gap (2 n,), or differs where the contact keeps its distance, and c_T its offset."""
    contacts, n = problem.contacts, problem.contacts.count
    difference = c - contacts.obstacle
    bilateral, tied = contacts.gathered("bilateral").astype(bool), contacts.gathered("tied").astype(bool)
    normal = np.where(bilateral, np.abs(difference[:n]), np.maximum(difference[:n], 0.0))
    slipping = contacts.gathered("slipping")
    backwards = np.where(np.isnan(slipping), 0.0, np.maximum(-slipping * difference[n:], 0.0))
    return np.concatenate([normal, np.where(tied | (slipping == 0.0), np.abs(difference[n:]), backwards)])


def _reasons(problem: DualProblem, c: FloatArray) -> tuple[str, ...]:
    excess = _excess(problem, c)
    size = max(1.0, float(np.abs(c).max(initial=0.0)))
    worst = float(excess.max(initial=0.0)) / size
    if worst <= _VIOLATED:
        return ()
    index = int(np.argmax(excess)) % problem.contacts.count
    start = 0
    for trace in problem.contacts.traces:
        if index < start + trace.count:
            break
        start += trace.count
    return (f"Prescribed displacements contradict the obstacle of {trace.name!r}, by {worst:.1e} of their size.",)
