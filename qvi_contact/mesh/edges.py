"""Edges of a mesh of any kind, where contact, loads and supports live."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Edges:
    """Straight edges of cells, as arrays with one entry an edge.

    The first cell of an edge is the body's side: on the boundary the only one, inside the body the one that the normal
    points away from, which is the lower or left one of a pair. σ_N = n·σn and σ_T = t·σn are taken with n and t of the
    edge.

    Attributes
    ----------
    first, second : (n,) int arrays
        Vertices at the two ends, in the direction of the tangent.
    cells : (n, 2) int array
        The cell that the normal points out of, and the one beyond; −1 where there is none.
    normal : (n, 2) array
        Unit normal n, outward on the boundary, inside the body from the first cell to the other.
    tangent : (n, 2) array
        Unit tangent t: t_x > 0, or t_y > 0 where t_x = 0, whichever way the edge faces.
    length : (n,) array
        Lengths [length].

    """

    first: IntArray
    second: IntArray
    cells: IntArray
    normal: FloatArray
    tangent: FloatArray
    length: FloatArray

    def __len__(self) -> int:
        return len(self.first)

    def take(self, index: IntArray | BoolArray) -> Self:
        """The edges selected by an index or mask array."""
        return type(self)(*(getattr(self, field.name)[index] for field in fields(self)))


def points_along(vertices: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
    """Points at the reference coordinates t, 0 to 1 along the tangent, (q,) or (n, q), of n edges; shape (n, q, 2)."""
    first, second = vertices[edges.first], vertices[edges.second]
    return np.asarray(first[:, None, :] + (second - first)[:, None, :] * np.asarray(t)[..., None])


def rounding_along(vertices: FloatArray, edges: Edges) -> FloatArray:
    """What rounding of the coordinates does to a reference coordinate t, shape (n,): large far from the origin."""
    largest = np.abs(vertices[np.stack([edges.first, edges.second])]).max(axis=(0, 2), initial=0.0)
    return np.asarray(np.finfo(float).eps * largest / edges.length)


def edge_ends(edges: Edges) -> IntArray:
    """The vertices of edges, each once."""
    return np.unique(np.concatenate([edges.first, edges.second]))
