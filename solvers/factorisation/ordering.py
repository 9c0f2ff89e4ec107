"""Orders of elimination, found on groups of unknowns that have the same neighbours."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.sparse import csc_array

from solvers.basics.types import IntVector, Sparse

MinimumDegree: TypeAlias = Callable[[Sparse], IntVector]
"""A symmetric pattern (m, m) with full diagonal → its elimination order, a permutation of 0 … m − 1."""


def interface_last(K: Sparse, interface: IntVector, minimum_degree: MinimumDegree) -> IntVector:
    """A permutation of 0 … n − 1: the interior of K (n, n) in the order of minimum degree, then Γ.

    Unknowns of a mesh node share their columns' pattern and are eliminated together in any good order, so the order is
    sought for the graph of such groups, which has a fraction of the entries.
    """
    interior = np.setdiff1d(np.arange(K.shape[0]), interface)
    graph, group = _graph_of_groups(_pattern(K)[interior][:, interior] if interface.size else _pattern(K))
    position = np.empty(graph.shape[0], dtype=np.int64)
    position[minimum_degree(graph)] = np.arange(graph.shape[0])
    return np.concatenate([interior[np.argsort(position[group], kind="stable")], interface])


def _pattern(K: Sparse) -> Sparse:
    return csc_array((np.ones(K.nnz, dtype=np.int8), K.indices, K.indptr), shape=K.shape)


def _graph_of_groups(pattern: Sparse) -> tuple[Sparse, IntVector]:
    """(pattern (m, m) of the groups, group (n,) of each unknown): a group has equal columns in the pattern (n, n)."""
    mark = np.random.default_rng(0).integers(1, 2**62, pattern.shape[0])  # equal sums: equal columns (modulo 2⁶⁴)
    sums = pattern.T @ mark
    first, group = np.unique(sums, return_index=True, return_inverse=True)[1:]
    return pattern[first][:, first], np.asarray(group, dtype=np.int64)
