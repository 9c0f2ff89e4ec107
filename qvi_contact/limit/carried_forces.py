"""Which forces on the contacts the stresses of a mesh can have: those in equilibrium, body by body.

The rows [N; T; A] z of tractions, and of resultants on plates, depend on each other. Those of one body do in its own
equilibrium, those of an edge where it has more rows than its tractions have parameters, and those beside a corner where
stress is continuous. Every other relation follows from these: Airy functions of single bodies whose tractions agree
differ by an affine function along each joint. Around the end of a joint these differences add up to nothing, in value
and in gradient, and so around every block. The functions then join to one after an affine function is added to each.

Relations of single bodies are short. Rows of a wall of many blocks expressed by some that span them all are long: each
follows a chain of blocks to the next one that is free.

In `docs/theory.md`: (D24).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.contact_rows import joined
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.mechanism.bodies import Bodies
from solvers.inequality.rows import spanning_rows

_ROUNDING = 1e-13  # of the rows, scaled to forces


@dataclass(frozen=True, eq=False)
class Relations:
    """C f + D (A z) = 0 for all z, with the forces f = diag(shares) [N; T] z on contacts.

    Attributes
    ----------
    forces : (r, 2 m) sparse array
        C.
    resultants : (r, p) sparse array
        D.

    """

    forces: sparse.csr_array
    resultants: sparse.csr_array

    @classmethod
    def of(cls, discretization: Discretization, shares: FloatArray) -> "Relations":
        """Those of a discretisation; shares (2 m,) turn tractions into forces."""
        qvi = discretization.qvi
        parts = [sparse.diags_array(shares) @ qvi.contact_rows, qvi.A]
        rows = sparse.csr_array(sparse.vstack(parts))
        found = [sparse.csr_array((0, rows.shape[0]))]
        found += [_among(rows, group) for group in _groups(discretization)]
        relations = sparse.csc_array(sparse.vstack(found))
        return cls(sparse.csr_array(relations[:, : 2 * qvi.m]), sparse.csr_array(relations[:, 2 * qvi.m :]))


def _among(rows: sparse.csr_array, group: IntArray) -> sparse.csr_array:
    """The relations among some of the rows, each giving one of them by others that are independent."""
    E, chosen = spanning_rows(sparse.csc_array(rows[group]))
    dependent = np.setdiff1d(np.arange(len(group)), chosen)
    given = np.where(np.abs(E[dependent]) > _ROUNDING, E[dependent], 0.0)
    relations = np.zeros((len(dependent), len(group)))
    relations[:, chosen] = given
    relations[np.arange(len(dependent)), dependent] = -1.0
    local = sparse.coo_array(relations)
    return sparse.csr_array((local.data, (local.row, group[local.col])), shape=(len(dependent), rows.shape[0]))


def _groups(discretization: Discretization) -> Iterator[IntArray]:
    """The rows around each body: tractions on it, and resultants on a plate that is one."""
    problem, m = discretization.problem, discretization.qvi.m
    bodies = Bodies.of(problem)
    first, second, glued = [], [], list[tuple[int, int]]()
    for rows, contact in zip(discretization.contacts, problem.contacts, strict=True):
        edges = rows.points.edges
        own = bodies.of_cells[edges.cells[:, 0]]
        other = bodies.of_cells[edges.cells[:, 1]] if rows.joint else np.full(len(own), bodies.number(contact))
        if contact.law == "tied":  # without rows of its own, and parting nothing
            glued += [(int(a), int(b)) for a, b in zip(own, other, strict=True) if b >= 0]
        else:
            first.append(np.repeat(own, rows.rule.count))
            second.append(np.repeat(other, rows.rule.count))
    label = _glued(len(bodies), glued)
    plates = np.array([bodies.blocks + bodies.plates.index(row.contact) for row in discretization.plates.rows], int)
    around = [joined(part).astype(np.int64) for part in (first, second)]
    ends = [np.where(part >= 0, label[part], -1) for part in around]
    for body in np.unique(label):
        points = np.flatnonzero((ends[0] == body) | (ends[1] == body))
        resultants = np.flatnonzero(label[plates] == body)
        yield np.concatenate([points, m + points, 2 * m + resultants])


def _glued(count: int, pairs: list[tuple[int, int]]) -> IntArray:
    """The body (count,) that each becomes where pairs of them hang together."""
    first, second = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    graph = sparse.csr_array((np.ones(len(first)), (first, second)), shape=(count, count))
    return np.asarray(sparse.csgraph.connected_components(graph, directed=False)[1], dtype=np.int64)
