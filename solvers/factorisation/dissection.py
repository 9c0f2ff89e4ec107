"""Identical subdomains eliminated once: nested dissection with dense fronts, one front for a class of subdomains.

A symmetric positive definite K is split by a tree of subdomains. On a subdomain some unknowns x_e are eliminated, the
others x_b stay for those who contain it, so that with its matrix, the *front*,

    [F_ee  F_beᵀ]        L₁₁ = chol(F_ee),   L₂₁ = F_be L₁₁⁻ᵀ,   S = F_bb − L₂₁ L₂₁ᵀ,
    [F_be  F_bb ],

S is what it adds to the front of the subdomain that contains it. Subdomains with equal fronts form a *class*: factors
are computed once for a class, and solves treat all its instances as the columns of one matrix.

Source: A. George, Nested dissection of a regular finite element mesh, SIAM J. Numer. Anal. 10 (1973).

In `docs/theory.md`: (D11).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from time import perf_counter
from typing import Final

import numpy as np
import scipy
from scipy.linalg import blas, lapack

from solvers.basics.types import IntVector, Matrix, Vector
from solvers.factorisation.base import Factorisation, State, check_pivots
from solvers.factorisation.errors import FactorisationError
from solvers.factorisation.threads import limited_blas

_LARGE: Final = 2e8  # operations from which several threads pay for themselves


@dataclass(frozen=True, eq=False)
class Part:
    """One of the subdomains that another is made of, for all instances of the whole at once.

    The columns that stay of the part are `places` of the whole, then combinations of columns of the whole:

        x_part = (x[places], mix x[mixed]).

    Attributes
    ----------
    of : int
        The part's class.
    instances : (m,) int array
        Which instance of that class belongs to each instance of the whole.
    places : (b − r,) int array
        Columns of the whole, all different.
    mixed : (s,) int array
        More columns of the whole, all different, none of `places`.
    mix : (r, s) array
        Coefficients of the part's last r columns.

    """

    of: int
    instances: IntVector
    places: IntVector
    mixed: IntVector
    mix: Matrix


@dataclass(frozen=True, eq=False)
class SubdomainClass:
    """Subdomains that have the same matrix: a leaf with a matrix of its own, or a whole made of parts.

    Columns of the front are the e eliminated ones, then the b that stay.

    Attributes
    ----------
    eliminated : (m, e) int array
        Numbers of the unknowns that each of the m instances eliminates.
    staying : int
        b.
    matrix : (e + b, e + b) array, optional
        A matrix to start from, symmetric; zero when not given.
    parts : tuple of Part
        Whose Schur complements are added.

    """

    eliminated: IntVector
    staying: int
    matrix: Matrix | None = None
    parts: tuple[Part, ...] = ()

    @property
    def interior(self) -> int:
        """Number e of the eliminated columns."""
        return int(self.eliminated.shape[1])

    @property
    def flops(self) -> float:
        """Multiplications and additions of the elimination: e³/3 + e²b + eb²."""
        e, b = float(self.interior), float(self.staying)
        return e**3 / 3.0 + e**2 * b + e * b**2


@dataclass(frozen=True, eq=False)
class SubdomainTree:
    """A symmetric matrix K (n, n) as a tree of classes of subdomains.

    Attributes
    ----------
    size : int
        n.
    interface : (k,) int array
        Γ, increasing: the unknowns that no class eliminates.
    classes : tuple of SubdomainClass
        Parts before wholes. The last one has a single instance, and what stays of it is Γ.
    seconds : float
        Wall time it took to find them.

    """

    size: int
    interface: IntVector
    classes: tuple[SubdomainClass, ...]
    seconds: float = 0.0


class SharedSubdomains(Factorisation):
    """Factorisation of the K that a tree describes, each class of subdomains factorised once.

    The state of a right-hand side holds L₁₁⁻¹ of it in the place of the unknowns that a subdomain eliminates.

    Parameters
    ----------
    tree : SubdomainTree
        The matrix.
    threads : int
        Threads for large fronts; small fronts and solves have one. More than one is for machines without other work:
        OpenBLAS can be ten times slower where cores are busy. Needs threadpoolctl, without it BLAS is left alone.

    Raises
    ------
    FactorisationError
        If K_II is not positive definite.

    """

    backend = "shared-subdomains"

    def __init__(self, tree: SubdomainTree, threads: int = 1) -> None:
        start = perf_counter()
        self.version = f"scipy {scipy.__version__}"
        self.interface = tree.interface
        self._size = tree.size
        self._classes = tree.classes
        self._factors, complement = _factorised(tree, threads)
        lower = np.tril(complement.matrix)
        self.schur = lower + np.tril(lower, -1).T
        self._scale = complement.diagonal
        self.seconds = {"analysis": tree.seconds, "numeric": perf_counter() - start}

    @property
    def size(self) -> int:
        """Number of unknowns n."""
        return self._size

    def release(self) -> None:
        """Drop the factors; may be called again."""
        self._classes, self._factors = (), []

    def _forward(self, right: Matrix) -> State:
        with limited_blas(1):
            return self._upwards(right)

    def _backward(self, state: State, values: Matrix) -> Matrix:
        with limited_blas(1):
            return self._downwards(self._with_values(state, values))

    def _upwards(self, right: Matrix) -> State:
        """From the leaves to Γ."""
        self._check_factors()
        rows = np.array(right.T, order="C")
        carried: list[Matrix] = []
        for subdomain, factor in zip(self._classes, self._factors, strict=True):
            local = _gathered(subdomain, rows, carried)
            head = factor.forward(local[..., : subdomain.interior])
            rows[:, subdomain.eliminated] = head
            carried.append(local[..., subdomain.interior :] - factor.coupled(head))
        rows[:, self.interface] += carried[-1][:, 0]
        return rows.T

    def _downwards(self, state: State) -> Matrix:
        """From Γ to the leaves."""
        self._check_factors()
        rows = np.ascontiguousarray(state.T)
        staying = [np.empty((len(rows), len(c.eliminated), c.staying)) for c in self._classes]
        staying[-1][:, 0] = rows[:, self.interface]
        for subdomain, factor in zip(reversed(self._classes), reversed(self._factors), strict=True):
            outer = staying.pop()
            head = factor.backward(rows[:, subdomain.eliminated], outer)
            rows[:, subdomain.eliminated] = head
            _distribute(subdomain, np.concatenate([head, outer], axis=-1), staying)
        return rows.T

    def _schur_scale(self) -> Vector:
        return self._scale

    def _check_factors(self) -> None:
        if not self._factors:
            raise FactorisationError("backend", self.backend, "the factors have been released")


def _gathered(subdomain: SubdomainClass, rows: Matrix, carried: Sequence[Matrix]) -> Matrix:
    """Right-hand sides of all instances, shape (j, m, e + b), from the global ones and those that parts leave."""
    m, e = subdomain.eliminated.shape
    local = np.zeros((len(rows), m, e + subdomain.staying))
    local[..., :e] = rows[:, subdomain.eliminated]
    for part in subdomain.parts:
        given = carried[part.of][:, part.instances]
        plain = len(part.places)
        local[..., part.places] += given[..., :plain]
        local[..., part.mixed] += given[..., plain:] @ part.mix
    return local


def _distribute(subdomain: SubdomainClass, local: Matrix, staying: Sequence[Matrix]) -> None:
    """Give the values (j, m, e + b) on all columns of a class to those that stay of its parts."""
    for part in subdomain.parts:
        plain = len(part.places)
        given = staying[part.of]
        given[:, part.instances, :plain] = local[..., part.places]
        given[:, part.instances, plain:] = local[..., part.mixed] @ part.mix.T


@dataclass(frozen=True, eq=False)
class _Factor:
    """L₁₁ (e, e), of which the lower triangle counts, and L₂₁ (b, e), both in Fortran order."""

    diagonal: Matrix
    below: Matrix

    def forward(self, right: Matrix) -> Matrix:
        """L₁₁⁻¹ of vectors along the last axis, shape (..., e)."""
        return self._solved(np.array(right, order="C"), transposed=0)

    def coupled(self, head: Matrix) -> Matrix:
        """L₂₁ of vectors (..., e), shape (..., b)."""
        return head @ self.below.T

    def backward(self, head: Matrix, staying: Matrix) -> Matrix:
        """L₁₁⁻ᵀ (y − L₂₁ᵀ x_b) for vectors y (..., e) and x_b (..., b)."""
        return self._solved(head - staying @ self.below, transposed=1)

    def _solved(self, work: Matrix, transposed: int) -> Matrix:
        """Overwrite contiguous vectors by L₁₁⁻¹ or L₁₁⁻ᵀ of them."""
        if not work.size:
            return work
        columns = work.reshape(-1, len(self.diagonal)).T
        blas.dtrsm(1.0, self.diagonal, columns, lower=1, trans_a=transposed, overwrite_b=1)
        return work


def _factorised(tree: SubdomainTree, threads: int) -> tuple[list[_Factor], "_Complement"]:
    """Factors of all classes, and the Schur complement of the last."""
    last_use = {part.of: number for number, whole in enumerate(tree.classes) for part in whole.parts}
    complements: dict[int, _Complement] = {}
    factors: list[_Factor] = []
    for number, subdomain in enumerate(tree.classes):
        with limited_blas(threads if subdomain.flops > _LARGE else 1):
            front = _Front(subdomain)
            for part in subdomain.parts:
                front.add_part(part, complements[part.of])
            factor, complements[number] = front.eliminated(tree.size)
        factors.append(factor)
        for of in {part.of for part in subdomain.parts}:
            if last_use[of] == number:
                del complements[of]
    return factors, complements[len(tree.classes) - 1]


@dataclass(frozen=True, eq=False)
class _Complement:
    """What a class adds to the fronts that contain it.

    Attributes
    ----------
    matrix : (b, b) array
        The Schur complement, of which the lower triangle counts.
    diagonal : (b,) array
        The diagonal that K has there, to compare pivots with; less for columns that were combined on the way.

    """

    matrix: Matrix
    diagonal: Vector


class _Front:
    """The front of a class while it is assembled and eliminated; only lower triangles of square blocks count.

    Attributes
    ----------
    head, below, corner : (e, e), (b, e), (b, b) arrays
        F_ee, F_be, F_bb in Fortran order.
    diagonal : (e + b,) array
        What K has on the diagonal, see `_Complement`.

    """

    def __init__(self, subdomain: SubdomainClass) -> None:
        self._e = e = subdomain.interior
        b = subdomain.staying
        self.head = np.zeros((e, e), order="F")
        self.below = np.zeros((b, e), order="F")
        self.corner = np.zeros((b, b), order="F")
        self.diagonal = np.zeros(e + b)
        if subdomain.matrix is not None:
            self.head += subdomain.matrix[:e, :e]
            self.below += subdomain.matrix[e:, :e]
            self.corner += subdomain.matrix[e:, e:]
            self.diagonal += subdomain.matrix.diagonal()

    def add_part(self, part: Part, complement: _Complement) -> None:
        """Add the Schur complement S of a part: Σᵀ S Σ with x_part = Σ x."""
        plain, matrix = len(part.places), complement.matrix
        self.diagonal[part.places] += complement.diagonal[:plain]
        runs = _runs(part.places, self._e)
        for i, (row, stop) in enumerate(runs):
            for column, end in runs[: i + 1]:
                block = matrix[row:stop, column:end]
                self._add(int(part.places[row]), int(part.places[column]), block)
        if part.mix.size:
            self._add_mixed(part, matrix[plain:, :plain], matrix[plain:, plain:])

    def _add_mixed(self, part: Part, coupling: Matrix, corner: Matrix) -> None:
        """Add the rows of the combined columns."""
        rows = part.mix.T @ coupling
        square = part.mix.T @ (np.tril(corner) + np.tril(corner, -1).T) @ part.mix
        self.diagonal[part.mixed] += square.diagonal()
        runs = _runs(part.places, self._e)
        for i, place in enumerate(part.mixed.tolist()):
            for start, stop in runs:
                self._add(place, int(part.places[start]), rows[i : i + 1, start:stop])
            for j, other in enumerate(part.mixed[: i + 1].tolist()):
                self._add(place, other, square[i : i + 1, j : j + 1])

    def _add(self, row: int, column: int, block: Matrix) -> None:
        """Add a block whose first entry is (row, column) of the front, or its transpose if it is above the diagonal."""
        if row < column:
            row, column, block = column, row, block.T
        if column >= self._e:
            target, row, column = self.corner, row - self._e, column - self._e
        elif row >= self._e:
            target, row = self.below, row - self._e
        else:
            target = self.head
        target[row : row + block.shape[0], column : column + block.shape[1]] += block

    def eliminated(self, size: int) -> tuple[_Factor, _Complement]:
        """Factor and Schur complement, in the memory of the front, for a K of the given size."""
        if self._e:
            _, info = lapack.dpotrf(self.head, lower=1, clean=0, overwrite_a=1)
            if info:
                raise FactorisationError("singular", SharedSubdomains.backend, "a pivot is zero or negative")
            check_pivots(self.head.diagonal() ** 2, self.diagonal[: self._e], SharedSubdomains.backend, size)
            if len(self.corner):
                blas.dtrsm(1.0, self.head, self.below, side=1, lower=1, trans_a=1, overwrite_b=1)
                blas.dsyrk(-1.0, self.below, 1.0, self.corner, lower=1, overwrite_c=1)
        return _Factor(self.head, self.below), _Complement(self.corner, self.diagonal[self._e :])


def _runs(places: IntVector, split: int) -> list[tuple[int, int]]:
    """Maximal ranges [start, stop) in which places increase by one without crossing `split`."""
    if not len(places):
        return []
    breaks = np.flatnonzero((np.diff(places) != 1) | (places[1:] == split)) + 1
    return list(pairwise([0, *breaks.tolist(), len(places)]))
