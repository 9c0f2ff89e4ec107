"""What prescribed tractions demand of the nodal values of Φ, see `chains`.

With m the sign of the outward normal and p = Φ'' along the edge (Φ_xx on horizontal, Φ_yy on vertical edges):

    normal component t:   p = m t − φ,   shear component t:   Φ_xy = −m t

Resultants ∫p and moments ∫(h − s)p of each edge are taken by quadrature, so loads outside the trace space are projected
without a change of resultant force or moment.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.basis import Basis, PrescribedTraction
from qvi_contact.discretization.bogner_fox_schmit.chains import Links
from qvi_contact.discretization.bogner_fox_schmit.traces import horizontal
from qvi_contact.discretization.edge_points import EdgePoints
from qvi_contact.mesh.edges import Edges

LOAD_POINTS = 8
"""Gauss points of edges and their parts for data given as functions."""


@dataclass(frozen=True, eq=False)
class _Load:
    """A Cartesian component t of the traction on edges parallel to the axes."""

    basis: Basis
    given: PrescribedTraction
    factor: float  # from the component that is given to t

    @property
    def edges(self) -> Edges:
        return self.given.edges

    @property
    def sign(self) -> FloatArray:
        return np.asarray(self.edges.normal.sum(axis=1))

    @cached_property
    def lengths(self) -> FloatArray:
        """Dimensionless lengths of the edges."""
        return EdgePoints(self.basis, self.edges, LOAD_POINTS).lengths

    @cached_property
    def integrals(self) -> FloatArray:
        """∫ m p dt and ∫ m p (1 − t) dt of normal, ∫ t dt and ∫ t (1 − t) dt of shear components, (n, 2)."""
        found = self.given.quadrature(self.basis.mesh.vertices, LOAD_POINTS)
        return self.factor * found.integrals(np.stack([np.ones_like(found.t), 1.0 - found.t], axis=-1))

    def normal_integrals(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """∫p ds, ∫(h − s) p ds and h for each edge."""
        force, moment = (self.sign * part for part in self.integrals.T)
        return self.lengths * force, self.lengths**2 * moment, self.lengths

    def shear_force(self) -> FloatArray:
        """−m ∫t ds for each edge."""
        return np.asarray(-self.sign * self.lengths * self.integrals[:, 0])

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
                        yield component, along_normal, _Load(basis, given.take(part), factor)


def _stack(rows: Sequence[tuple[Any, ...]], integers: int, floats: int) -> list[Any]:
    """Concatenate tuples of arrays, first integer then float ones, column by column; no tuples give empty arrays."""
    empty = (*[np.empty(0, dtype=np.int64)] * integers, *[np.empty(0)] * floats)
    return [np.concatenate(column) for column in zip(empty, *rows, strict=True)]
