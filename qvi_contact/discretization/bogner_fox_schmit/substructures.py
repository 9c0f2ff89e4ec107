"""K of a uniform rectangle as a tree of blocks of cells, most of them alike.

The rectangle is bisected again and again, down to leaves of a few cells. Where leaves are ℓ cells long, a block of s
cells is cut after the largest ℓ 2^k < s: only the last block in each direction then has a shape of its own, and that
one is at the boundary anyway. Blocks are of one class if shape and conditions on their part of the boundary agree, so
that there are about nine classes for a size of block, however many cells there are.

The columns of a block are its nodal degrees of freedom. Those that traction conditions make dependent are replaced by
r ≤ 3 parameters, mostly, for each chain of them:

    u_dependent = X p,     p = u of the first r that are independent,

with X from the rows of the basis (`Elimination`). On a uniform grid X is the same all along a side, while in the basis
itself Φ = Φ₀ + s Φ'₀ grows with the distance s from the root of the chain, which differs from block to block.

In `docs/theory.md`: (D11).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import log2
from time import perf_counter
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.bogner_fox_schmit.stencil import energy_matrix
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.element.bogner_fox_schmit import Grid, Line
from solvers.factorisation.dissection import Part, SubdomainClass, SubdomainTree

if TYPE_CHECKING:
    from qvi_contact.discretization.bogner_fox_schmit.energy import GridEnergy

_LEAF = 8  # cells of a leaf in each direction, about; from 4 to 10 the times hardly differ
_UNEVEN = 1e-10  # accepted relative difference of cell sizes
_DEPENDENT = 1e-8  # a row of this relative size, once those before it are projected out, depends on them
_INTEGER = 1e-9  # coefficients this close to an integer are integers
_MOST_ROOTS = 64

Roles: TypeAlias = NDArray[np.int8]
"""What becomes of each degree of freedom, shape (q + 1, p + 1, 4): one of the three below."""

_FREE, _STAYS, _DEPENDS = range(3)
"""Eliminated as soon as all cells around are there; an unknown of Γ; given by the roots."""


def why_not(energy: "GridEnergy", elimination: Elimination, interface: IntArray) -> str | None:
    """Why `substructures` does not apply, as half a sentence; None if it does."""
    grid = energy.grid
    if not energy.mesh.active.all():
        return "the body is not a rectangle"
    if not (_even(grid.x) and _even(grid.y)):
        return "the cells differ in size"
    if np.ptp(energy.materials):
        return "there are several materials"
    if len(_roots(elimination)) > _MOST_ROOTS:
        return "the conditions change too often along the boundary"
    if (_roles(grid, elimination, interface)[1:-1, 1:-1] != _FREE).any():
        return "there are contacts inside the body"
    return None


def substructures(energy: "GridEnergy", elimination: Elimination, interface: IntArray) -> SubdomainTree | None:
    """K of `discretize` as a tree of subdomains; None where that does not apply, see `why_not`.

    Parameters
    ----------
    energy : GridEnergy
        The energy that K is the matrix of.
    elimination : Elimination
        Its unknowns.
    interface : (k,) int array
        Γ: numbers of the unknowns that stay, increasing; on the boundary, if they are not roots.

    """
    start = perf_counter()
    if why_not(energy, elimination, interface) is not None:
        return None
    grid = energy.grid
    number = np.cumsum(elimination.kept) - 1
    body = _Block((False,) * 4, _roles(grid, elimination, interface), _root_rows(elimination))
    element = _element_matrix(grid, energy.compliances[energy.materials[0]])
    families = _families(body, (_leaf_size(len(grid.x.sizes)), _leaf_size(len(grid.y.sizes))))
    classes = [family.subdomain_class(number, len(grid.x.lines), element) for family in families]
    size = int(elimination.kept.sum())
    top = _top(number[body.staying], size, _roots(elimination), interface, of=len(classes) - 1)
    return SubdomainTree(size, interface, (*classes, top), perf_counter() - start)


def _even(line: Line) -> bool:
    return bool(np.ptp(line.sizes) <= _UNEVEN * line.sizes.max())


def _roots(elimination: Elimination) -> IntArray:
    """Numbers of the unknowns that others depend on."""
    return np.unique(elimination.slave_basis.indices).astype(np.int64)


def _roles(grid: Grid, elimination: Elimination, interface: IntArray) -> Roles:
    """Roles of all degrees of freedom, shape (ny + 1, nx + 1, 4)."""
    kept = np.flatnonzero(elimination.kept)
    roles = np.full(len(elimination.kept), _FREE, dtype=np.int8)
    roles[kept[interface]] = _STAYS
    roles[elimination.slaves] = _DEPENDS
    roles[kept[_roots(elimination)]] = _DEPENDS
    return roles.reshape(len(grid.y.lines), len(grid.x.lines), 4)


def _root_rows(elimination: Elimination) -> FloatArray:
    """Rows of the basis of all dependent degrees of freedom, by their number, over the roots."""
    roots = _roots(elimination)
    own = np.flatnonzero(elimination.kept)[roots]
    rows = np.concatenate([elimination.slave_basis[:, roots].toarray(), np.eye(len(roots))])
    return np.asarray(rows[np.argsort(np.concatenate([elimination.slaves, own]))])


def _leaf_size(cells: int) -> int:
    """ℓ for a side of so many cells: as close to `_LEAF` as halving allows."""
    halvings = max(0, round(log2(cells / _LEAF)))
    return (cells - 1 >> halvings) + 1


@dataclass(frozen=True, eq=False)
class _Block:
    """A rectangle of q rows of p cells, and what happens to its degrees of freedom.

    Degrees of freedom have codes d + 4 (i + j (p + 1)), (i, j) being the node.

    Attributes
    ----------
    shared : (bool, bool, bool, bool)
        Whether other blocks follow below, above, left and right.
    roles : (q + 1, p + 1, 4) array
        See `Roles`.
    rows : (dependent ones, r) array
        X: dependent degrees of freedom by code, as combinations of r parameters.

    """

    shared: tuple[bool, ...]
    roles: Roles
    rows: FloatArray

    @property
    def cells(self) -> tuple[int, int]:
        """(p, q)."""
        return self.roles.shape[1] - 1, self.roles.shape[0] - 1

    @cached_property
    def key(self) -> tuple[object, ...]:
        """Equal for blocks of one class."""
        if all(self.shared):
            return self.cells
        return self.cells, self.shared, self.roles.tobytes(), self.rows.round(9).tobytes()

    @cached_property
    def staying(self) -> IntArray:
        """Codes of the degrees of freedom that stay, side by side: below, above, left, right."""
        code = np.arange(self.roles.size).reshape(self.roles.shape)
        sides = (code[0], code[-1], code[1:-1, 0], code[1:-1, -1])
        around = np.concatenate([side.ravel() for side in sides])
        return np.asarray(around[self._stays.ravel()[around]])

    @cached_property
    def _stays(self) -> NDArray[np.bool_]:
        stays = self.roles == _STAYS
        free = self.roles == _FREE
        for shared, side in zip(self.shared, (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]), strict=True):
            stays[side] |= shared & free[side]
        return np.asarray(stays)

    @cached_property
    def interior(self) -> IntArray:
        """Codes of the free degrees of freedom that do not stay."""
        return np.flatnonzero((self.roles == _FREE) & ~self._stays)

    def shifted(self, codes: IntArray, width: int, row: int = 0, column: int = 0) -> IntArray:
        """The codes in a block `width` cells wide, in which this one begins at the given row and column."""
        node, dof = np.divmod(codes, 4)
        j, i = np.divmod(node, self.roles.shape[1])
        return np.asarray(4 * ((j + row) * (width + 1) + i + column) + dof)

    def cut(self, leaf: tuple[int, int]) -> tuple["_Piece", ...]:
        """The two halves, none of a leaf."""
        (p, q), (most_p, most_q) = self.cells, leaf
        if p <= most_p and q <= most_q:
            return ()
        below, above, left, right = self.shared
        if q <= most_q or (p > most_p and p >= q):
            at = _largest_doubling(most_p, p)
            return (
                self._piece(np.s_[:, : at + 1], (0, 0), (below, above, left, True)),
                self._piece(np.s_[:, at:], (0, at), (below, above, True, right)),
            )
        at = _largest_doubling(most_q, q)
        return (
            self._piece(np.s_[: at + 1, :], (0, 0), (below, True, left, right)),
            self._piece(np.s_[at:, :], (at, 0), (True, above, left, right)),
        )

    def _piece(self, part: tuple[slice, slice], offset: tuple[int, int], shared: tuple[bool, ...]) -> "_Piece":
        roles = self.roles[part]
        depends = self.roles == _DEPENDS
        number = np.cumsum(depends.ravel()).reshape(depends.shape) - 1
        rows = self.rows[number[part][roles == _DEPENDS]]
        mix = rows[_independent(rows)]
        return _Piece(_Block(shared, roles, _combinations(rows, mix)), offset, mix)


@dataclass(frozen=True, eq=False)
class _Piece:
    """A block inside another one.

    Attributes
    ----------
    block : _Block
        The block.
    offset : (int, int)
        Row and column where it begins.
    mix : (r, s) array
        Its parameters as combinations of those of the other one.

    """

    block: _Block
    offset: tuple[int, int]
    mix: FloatArray


class _Family:
    """All blocks of one class."""

    def __init__(self, block: _Block) -> None:
        self.block = block
        self.origins = np.zeros((0, 2), dtype=np.int64)
        self.number = -1
        self.pieces: list[tuple[_Piece, _Family, IntArray]] = []

    def add(self, origins: IntArray) -> IntArray:
        """Add blocks that begin at (row, column), (m, 2); return their places in the family."""
        before = len(self.origins)
        self.origins = np.concatenate([self.origins, origins])
        return np.arange(before, len(self.origins))

    def subdomain_class(self, number: IntArray, stride: int, element: FloatArray) -> SubdomainClass:
        """The algebra of the family: `number` has those of all unknowns, a row of the mesh has `stride` nodes."""
        block = self.block
        interior = self._cut_line() if self.pieces else block.interior
        corner = 4 * (self.origins[:, :1] * stride + self.origins[:, 1:])
        return SubdomainClass(
            eliminated=number[corner + block.shifted(interior, stride - 1)],
            staying=len(block.staying) + block.rows.shape[1],
            matrix=None if self.pieces else _leaf_matrix(block, element),
            parts=tuple(self._parts(interior)),
        )

    def _cut_line(self) -> IntArray:
        """Codes that stay of the first piece, and so of the second, but not of the block."""
        piece = self.pieces[0][0]
        codes = piece.block.shifted(piece.block.staying, self.block.cells[0], *piece.offset)
        return np.asarray(codes[~np.isin(codes, self.block.staying)])

    def _parts(self, interior: IntArray) -> Iterator[Part]:
        """The pieces, for a block that eliminates the codes `interior`."""
        own = np.concatenate([interior, self.block.staying])
        column = np.empty(self.block.roles.size, dtype=np.int64)
        column[own] = np.arange(len(own))
        mixed = len(own) + np.arange(self.block.rows.shape[1])
        for piece, family, instances in self.pieces:
            codes = piece.block.shifted(piece.block.staying, self.block.cells[0], *piece.offset)
            yield Part(family.number, instances, column[codes], mixed, piece.mix)


def _families(body: _Block, leaf: tuple[int, int]) -> list[_Family]:
    """All classes of blocks, pieces before what is made of them; the last one is the body."""
    found: list[_Family] = []
    first = _Family(body)
    first.add(np.zeros((1, 2), dtype=np.int64))
    waiting = {body.key: first}
    while waiting:  # the largest first: then all blocks of its class are known
        family = waiting.pop(max(waiting, key=lambda key: waiting[key].block.roles.size))
        found.append(family)
        for piece in family.block.cut(leaf):
            other = waiting.setdefault(piece.block.key, _Family(piece.block))
            family.pieces.append((piece, other, other.add(family.origins + np.array(piece.offset))))
    found.reverse()
    for number, family in enumerate(found):
        family.number = number
    return found


def _largest_doubling(size: int, below: int) -> int:
    """The largest size 2^k below the given number."""
    while 2 * size < below:
        size *= 2
    return size


def _independent(rows: FloatArray) -> IntArray:
    """The first rows that span all of them."""
    rest = rows.copy()
    size = np.linalg.norm(rows, axis=1)
    chosen = []
    for _ in range(rows.shape[1]):
        candidates = np.flatnonzero(np.linalg.norm(rest, axis=1) > _DEPENDENT * size)
        if not len(candidates):
            break
        chosen.append(int(candidates[0]))
        direction = rest[chosen[-1]] / np.linalg.norm(rest[chosen[-1]])
        rest -= np.outer(rest @ direction, direction)
    return np.array(chosen, dtype=np.int64)


def _combinations(rows: FloatArray, of: FloatArray) -> FloatArray:
    """X with X of = rows."""
    if not len(of):
        return np.zeros((len(rows), 0))
    X = np.linalg.lstsq(of.T, rows.T, rcond=None)[0].T
    whole = np.rint(X)
    return np.where(np.abs(X - whole) < _INTEGER, whole, X) + 0.0  # no negative zeros


def _element_matrix(grid: Grid, compliance: FloatArray) -> FloatArray:
    """Energy matrix of one cell, shape (16, 16), in the order of `Grid.cell_dofs`."""
    cell = Grid(Line(np.array([0.0, grid.x.sizes.mean()])), Line(np.array([0.0, grid.y.sizes.mean()])))
    stencil = energy_matrix(cell, [(np.ones((1, 1), dtype=bool), compliance)])
    return np.asarray(stencil.rows(np.arange(16)).toarray())


def _leaf_matrix(block: _Block, element: FloatArray) -> FloatArray:
    """Matrix of the cells of a block over its columns: interior, staying, parameters."""
    p, q = block.cells
    row, column = np.divmod(np.arange(p * q), p)
    dofs = Grid(Line(np.arange(p + 1.0)), Line(np.arange(q + 1.0))).cell_dofs(column, row)
    size = block.roles.size
    place = dofs[:, :, None] * size + dofs[:, None, :]
    values = np.broadcast_to(element, place.shape)
    K = np.bincount(place.ravel(), weights=values.ravel(), minlength=size**2).reshape(size, size)
    own = np.concatenate([block.interior, block.staying])
    depends = np.flatnonzero(block.roles == _DEPENDS)
    coupling = K[own][:, depends] @ block.rows
    corner = block.rows.T @ K[np.ix_(depends, depends)] @ block.rows
    return np.block([[K[np.ix_(own, own)], coupling], [coupling.T, corner]])


def _top(staying: IntArray, size: int, roots: IntArray, interface: IntArray, of: int) -> SubdomainClass:
    """Γ in its order, with the roots outside it eliminated; `staying` are the unknowns that the body leaves."""
    inner = np.setdiff1d(roots, interface)
    column = np.empty(size, dtype=np.int64)
    column[np.concatenate([inner, interface])] = np.arange(len(inner) + len(interface))
    part = Part(of, np.zeros(1, dtype=np.int64), column[staying], column[roots], np.eye(len(roots)))
    return SubdomainClass(inner[None, :], len(interface), None, (part,))
