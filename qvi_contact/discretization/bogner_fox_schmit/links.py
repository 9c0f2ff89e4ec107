"""What prescribed tractions demand of the nodal values of Φ, see `chains`.

With m the sign of the outward normal and p = Φ'' along the edge (Φ_xx on horizontal, Φ_yy on vertical edges):

    normal component t:   p = m t − φ,   shear component t:   Φ_xy = −m t

Resultants ∫p and moments ∫(h − s)p of each edge are taken by quadrature, so loads outside the trace space are projected
without a change of resultant force or moment.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.basis import Basis, PrescribedTraction
from qvi_contact.discretization.bogner_fox_schmit.chains import Links
from qvi_contact.discretization.bogner_fox_schmit.traces import horizontal
from qvi_contact.discretization.edge_points import EdgePoints
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.edges import Edges

LOAD_POINTS = 8
"""Gauss points an edge for data given as functions: exact up to degree 15."""


@dataclass(frozen=True, eq=False)
class _Load:
    """A Cartesian component t of the traction on edges parallel to the axes."""

    basis: Basis
    given: PrescribedTraction
    edges: Edges
    factor: float  # from the component that is given to t

    @property
    def sign(self) -> FloatArray:
        return np.asarray(self.edges.normal.sum(axis=1))

    def at_points(self) -> tuple[FloatArray, FloatArray, EdgePoints]:
        """T and φ at the Gauss points, edge by edge."""
        points = EdgePoints(self.basis, self.edges, LOAD_POINTS)
        mesh = self.basis.mesh
        x, y = (mesh.origin + mesh.length * points.coordinates).T
        potential = np.zeros(len(x)) if self.given.potential is None else self.given.potential(x, y)
        return self.factor * self.given.value(x, y), potential, points

    def normal_integrals(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """∫p ds, ∫(h − s) p ds and h for each edge."""
        stress, potential, points = self.at_points()
        curvature = stress * np.repeat(self.sign, LOAD_POINTS) - potential
        weighted = (curvature * points.weights).reshape(-1, LOAD_POINTS)
        rest = 1.0 - gauss_legendre(LOAD_POINTS)[0]
        return weighted.sum(axis=1), points.lengths * (weighted @ rest), points.lengths

    def shear_force(self) -> FloatArray:
        """−m ∫t ds for each edge."""
        stress, _, points = self.at_points()
        force = (stress * points.weights).reshape(-1, LOAD_POINTS).sum(axis=1)
        return np.asarray(-self.sign * force)

    def twists(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """Prescribed Φ_xy at both ends of the edges."""
        for nodes in (self.edges.first, self.edges.second):
            yield nodes, -self.sign * (self.factor * self.given.value(*self.basis.mesh.vertices[nodes].T))


def traction_links(basis: Basis, tractions: Sequence[PrescribedTraction], frictionless: IntArray) -> Links:
    """The equations of all tractions, and Φ_xy = 0 at the given nodes."""
    slopes, values, twists = [], [], []
    for component, along_normal, load in _by_component(basis, tractions):
        first, second = load.edges.first, load.edges.second
        slope = 4 * first + 2 - component  # t_x acts on Φ_y (2), t_y on Φ_x (1)
        if along_normal:
            force, moment, length = load.normal_integrals()
            slopes.append((slope, 4 * second + 2 - component, force))
            values.append((first, second, slope, length, moment))
        else:
            slopes.append((slope, 4 * second + 2 - component, load.shear_force()))
            twists += list(load.twists())
    twists += [(np.array([node]), np.zeros(1)) for node in frictionless]
    return Links(*_stack(slopes, 2, 1), *_stack(values, 3, 2), *_stack(twists, 1, 1))


def _by_component(basis: Basis, tractions: Sequence[PrescribedTraction]) -> Iterator[tuple[int, bool, _Load]]:
    """(component, whether it is the normal one, load) of all tractions, edges taken apart as far as needed."""
    for given in tractions:
        for component in (0, 1):
            for factor in (1.0, -1.0):
                chosen = given.direction[:, component] == factor
                normal = horizontal(given.edges) == (component == 1)
                for along_normal, part in ((True, chosen & normal), (False, chosen & ~normal)):
                    if part.any():
                        yield component, along_normal, _Load(basis, given, given.edges.take(part), factor)


def _stack(rows: Sequence[tuple[Any, ...]], integers: int, floats: int) -> list[Any]:
    """Concatenate tuples of arrays, first integer then float ones, column by column; no tuples give empty arrays."""
    empty = (*[np.empty(0, dtype=np.int64)] * integers, *[np.empty(0)] * floats)
    return [np.concatenate(column) for column in zip(empty, *rows, strict=True)]
