"""Orders of elimination by nested dissection."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import block_array, csc_array, csr_array, eye_array, kron, random_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from solvers.factorisation import nested_dissection


def grid(size, each=1):
    """Pattern of size × size nodes that know the eight around them, `each` unknowns a node, and their places."""
    line = csr_array(np.eye(size) + np.eye(size, k=1) + np.eye(size, k=-1))
    places = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1).reshape(-1, 2)
    return csr_array(kron(kron(line, line), np.ones((each, each)))), np.repeat(places.astype(float), each, axis=0)


def entries(pattern, order):
    """Of L, where a matrix of this pattern is eliminated in that order."""
    H = csc_array(pattern[order][:, order])
    H.data = np.random.default_rng(0).uniform(0.1, 0.2, H.nnz) + 10.0 * (H.tocoo().row == H.tocoo().col)
    return splu(H, "NATURAL", 0.0, options={"SymmetricMode": True}).L.nnz


def test_lines_of_a_grid_are_eliminated_last():
    pattern, places = grid(17, 2)
    shuffled = np.random.default_rng(0).permutation(len(places))
    mixed = csr_array(pattern[shuffled][:, shuffled])
    order = shuffled[nested_dissection(places[shuffled], mixed.indptr, mixed.indices)[0]]
    np.testing.assert_array_equal(np.sort(order), np.arange(len(places)))
    last, others = order[-34:], order[:-34]
    assert np.ptp(places[last], axis=0).min() == 0.0
    assert connected_components(pattern[others][:, others])[0] == 2
    plain, places = grid(65)
    order = nested_dissection(places, plain.indptr, plain.indices)[0]
    assert entries(plain, order) < 0.5 * entries(plain, np.arange(65**2))  # line by line


def test_an_unknown_that_knows_all_others_does_not_spoil_the_order():
    pattern, places = grid(17)
    known = np.ones((1, len(places)))
    bordered = csr_array(block_array([[np.ones((1, 1)), known], [known.T, pattern]]))
    order = nested_dissection(np.vstack([[16.0, 16.0], places]), bordered.indptr, bordered.indices)[0]
    without = nested_dissection(places, pattern.indptr, pattern.indices)[0]
    assert 0 in order[-18:]
    assert entries(bordered, order) < 1.1 * entries(pattern, without) + len(order)


@given(st.integers(0, 60), st.integers(0, 3), st.integers(0, 10**6))
def test_any_places_give_an_order(size, distinct, seed):
    random = np.random.default_rng(seed)
    pattern = csr_array(random_array((size, size), density=0.1, rng=random))
    pattern = csr_array(pattern + pattern.T + eye_array(size))
    places = random.integers(0, distinct + 1, (size, 2)).astype(float)
    order = nested_dissection(places, pattern.indptr, pattern.indices)[0]
    np.testing.assert_array_equal(np.sort(order), np.arange(size))
