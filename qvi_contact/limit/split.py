"""Polynomials on the three parts of triangles, split at their barycentres, in Bernstein coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.element.triangle import EDGES, bernstein, exponents
from qvi_contact.mechanism.bodies import whole_edges
from qvi_contact.mesh.edges import Edges, linked
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem

SAMPLES = 6
"""Degree of the lattice at which fields are looked at."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """Coefficients of continuous functions of a degree on a split triangle."""

    keys: IntArray  # (m, 4) weights of the three corners and of the barycentre, times the degree
    of_parts: IntArray  # (3, count) the coefficients of each part: of an edge, then the barycentre
    of_sides: IntArray  # (3, degree + 1) those along each side, from its lower corner to the higher one

    @property
    def places(self) -> FloatArray:
        """Barycentric places (m, 3)."""
        return np.asarray((self.keys[:, :3] + self.keys[:, 3:] / 3.0) / self.keys[0].sum())

    @classmethod
    def of(cls, degree: int) -> Nodes:
        """Those of a degree."""
        parts = np.zeros((3, len(exponents(degree)), 4), dtype=np.int64)
        for part, edge in zip(parts, EDGES, strict=True):
            part[:, [*edge, 3]] = exponents(degree)
        rows = parts.reshape(-1, 4)
        first = np.sort(np.unique(rows, axis=0, return_index=True)[1])
        keys = rows[first]
        number = {tuple(key): n for n, key in enumerate(keys.tolist())}
        of_parts = np.array([number[tuple(key)] for key in rows.tolist()]).reshape(3, -1)
        return cls(keys, of_parts, of_parts[:, exponents(degree)[:, 2] == 0])


def part_corners(corners: FloatArray) -> FloatArray:
    """Corners (n, 3, 3, 2) of the three parts of triangles with corners (n, 3, 2): an edge, then the barycentre."""
    centre = corners.mean(axis=1)
    return np.stack([np.stack([corners[:, a], corners[:, b], centre], axis=1) for a, b in EDGES], axis=1)


def lattice(degree: int) -> FloatArray:
    """Barycentric places (count, 3) of Bernstein coefficients."""
    return exponents(degree) / max(degree, 1) if degree else np.full((1, 3), 1.0 / 3.0)


def sampled(problem: ContactProblem, cells: IntArray, degree: int = SAMPLES) -> tuple[FloatArray, FloatArray]:
    """Places x and y (n, 3, g) of a lattice on the parts of triangles."""
    x, y = np.moveaxis(lattice(degree) @ part_corners(problem.mesh.corners[cells]), -1, 0)
    return x, y


def coefficients_of(
    problem: ContactProblem, cells: IntArray, degree: int, name: str, field: object
) -> tuple[FloatArray, float]:
    """Coefficients (n, 3, count) of the polynomials that agree with a field at their places, and the largest misfit.

    The misfit is relative to the field's size.
    """
    at_places, seen = (
        evaluate(name, field, *sampled(problem, cells, each))  # type: ignore[arg-type]
        for each in (degree, SAMPLES)
    )
    found = at_places @ np.linalg.inv(bernstein(degree, lattice(degree))).T
    misfit = np.abs(found @ bernstein(degree, lattice(SAMPLES)).T - seen).max(initial=0.0)
    return np.asarray(found), float(misfit / max(np.abs(seen).max(initial=0.0), 1e-300))


def nodes_along(mesh: TriangleMesh, nodes: Nodes, edges: Edges, side: int = 0) -> IntArray:
    """Numbers cell · m + node of the coefficients (e, degree + 1) along edges from their first end to the second.

    They are those of the first cell (side 0), or of the one beyond (side 1).
    """
    cells = edges.cells[:, side]
    ends = np.stack([edges.first, edges.second], axis=1)
    opposite = np.argmax((mesh.cells[cells][:, :, None] != ends[:, None, :]).all(axis=2), axis=1)
    found = cells[:, None] * len(nodes.keys) + nodes.of_sides[opposite]
    flipped = edges.first > edges.second
    found[flipped] = found[flipped, ::-1]
    return np.asarray(found)


def numbered(problem: ContactProblem, nodes: Nodes) -> IntArray:
    """Numbers (cells, m) of coefficients, which triangles share on edges that are no open joint."""
    edges, shape = whole_edges(problem), (problem.mesh.cell_count, len(nodes.keys))
    first, second = (nodes_along(problem.mesh, nodes, edges, side) for side in (0, 1))
    return linked(first, second, shape[0] * shape[1]).reshape(shape)
