"""QR of R in place of a factorisation of K = RᵀR, with the rounding of R instead of K; orders by nested dissection."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import block_array, csc_array, csr_array, eye_array, kron, random_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from solvers import InputError
from solvers.basics import IntVector, Matrix, Vector
from solvers.factorisation import FactorisationError, factorise, factorise_root, nested_dissection


def _strip(cells: int, seed: int = 0) -> tuple[csr_array, Matrix]:
    """Rows of cells in a strip that share three unknowns with each neighbour, and one unknown in all of them."""
    rng = np.random.default_rng(seed)
    rows, columns = 8, 3 * (cells + 1)
    dense = np.zeros((rows * cells, columns + 1))
    for c in range(cells):
        dense[rows * c : rows * (c + 1), 3 * c : 3 * c + 6] = rng.normal(size=(rows, 6))
    dense[:, -1] = rng.normal(size=len(dense))
    return csr_array(dense), np.repeat(np.arange(cells), rows)[:, None].astype(float)


def _cantilever(cells: int, grading: float) -> tuple[csr_array, Matrix, float]:
    """Curvatures √h v″ at two Gauss points of Hermite cells, clamped at the coarse end x = 0, length 1, EI = 1.

    Unknowns are v and s v′ at the nodes, s at the tip the last cell; returned with the places and s.
    """
    sizes = grading ** np.arange(cells)
    sizes /= sizes.sum()
    dense = np.zeros((2 * cells, 2 * cells + 2))
    for c, h in enumerate(sizes):
        scales = (sizes[max(c - 1, 0)], h)
        for g, t in enumerate((0.5 - np.sqrt(1.0 / 12.0), 0.5 + np.sqrt(1.0 / 12.0))):
            row = np.array([12 * t - 6, (6 * t - 4) * h / scales[0], 6 - 12 * t, (6 * t - 2) * h / scales[1]])
            dense[2 * c + g, 2 * c : 2 * c + 4] = np.sqrt(h / 2.0) / h**2 * row
    return csr_array(dense[:, 2:]), np.repeat(np.arange(cells), 2)[:, None].astype(float), float(sizes[-1])


@pytest.mark.parametrize("interface", [[], [0], [5, 30, 61], [93], list(range(94))])
def test_all_that_a_factorisation_does_is_what_the_blocks_of_k_say(interface: list[int]) -> None:
    R, places = _strip(cells=30)
    gamma = np.array(interface, dtype=np.int64)
    inner = np.setdiff1d(np.arange(94), gamma)
    factor = factorise_root(R, gamma, places)
    K = (R.T @ R).toarray()
    inverse = np.linalg.inv(K[np.ix_(inner, inner)])
    coupling = K[np.ix_(gamma, inner)]
    schur = K[np.ix_(gamma, gamma)] - coupling @ inverse @ coupling.T
    np.testing.assert_allclose(factor.schur, schur, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(factor.schur_root.T @ factor.schur_root, factor.schur, rtol=1e-12)
    random = np.random.default_rng(1)
    g, values = random.normal(size=(94, 3)), random.normal(size=(len(gamma), 3))
    np.testing.assert_allclose(K @ factor.solve(g), g, atol=1e-9)
    reduced, state = factor.reduce(g)
    np.testing.assert_allclose(reduced, g[gamma] - coupling @ inverse @ g[inner], rtol=1e-9, atol=1e-10)
    assert factor.square(g[:, 0], state[:, 0]) == pytest.approx(g[inner, 0] @ inverse @ g[inner, 0])
    for _ in range(2):  # a state may be used again
        x = factor.expand(state, values)
        np.testing.assert_array_equal(x[gamma], values)
        np.testing.assert_allclose(K[inner] @ x, g[inner], atol=1e-9)


def test_columns_of_any_size_do_not_matter() -> None:
    R, places = _strip(cells=20)
    sizes = 10.0 ** np.random.default_rng(3).uniform(-9, 9, R.shape[1])
    gamma: IntVector = np.array([7, 33])
    plain, scaled = factorise_root(R, gamma, places), factorise_root(R * sizes, gamma, places)
    np.testing.assert_allclose(scaled.schur, plain.schur * np.outer(sizes[gamma], sizes[gamma]), rtol=1e-9)
    assert scaled.rounding == pytest.approx(plain.rounding, rel=1e-3)


def test_tip_of_a_cantilever_with_cells_down_to_a_millionth() -> None:
    R, places, scale = _cantilever(28, 0.6)
    tip = np.array([54, 55])
    factor = factorise_root(R, tip, places)
    compliance: Matrix = np.array([[1.0 / 3.0, 0.5 * scale], [0.5 * scale, scale**2]])
    lower = np.linalg.cholesky(compliance)

    def error(schur: Matrix) -> float:
        return float(np.linalg.norm(lower.T @ schur @ lower - np.eye(2), 2))

    assert error(factor.schur) < 10.0 * factor.rounding < 1e-2
    try:
        left_in_K = error(factorise(R.T @ R, tip, "multifrontal").schur)
    except FactorisationError:
        left_in_K = np.inf
    assert left_in_K > 0.3


def test_defect_corrections_shrink_the_error_as_predicted() -> None:
    R, places, _ = _cantilever(22, 0.6)
    factor = factorise_root(R, np.array([42, 43]), places)
    r: Vector = np.random.default_rng(4).normal(size=R.shape[0])
    x = np.linalg.solve(R.toarray(), r)
    start = factor.solve(R.T @ r)
    assert np.linalg.norm(R @ (start - x)) < 10.0 * factor.rounding * np.linalg.norm(R @ x)


def test_dependent_columns_are_refused():
    R, places = _strip(cells=12)
    zero = R.toarray()
    zero[:, 4] = 0.0
    for dense in (zero, R.toarray()[:20]):
        with pytest.raises(FactorisationError):
            factorise_root(csr_array(dense), np.array([0]), places[: len(dense)])


@pytest.mark.parametrize("seed", range(10))
def test_a_copied_column_is_refused_and_one_beside_it_is_not(seed: int) -> None:
    """Rounding decides how small the last pivot of a copy is, so that no pivot can tell."""
    R, places = _strip(cells=12, seed=seed)
    dense = R.toarray()
    dense[:, 4] = dense[:, 3]
    with pytest.raises(FactorisationError):
        factorise_root(csr_array(dense), np.array([0]), places)
    dense[:, 4] *= 1.0 + 1e-9 * np.random.default_rng(seed).normal(size=len(dense))
    factor = factorise_root(csr_array(dense), np.array([0]), places)
    least = float(np.linalg.svd(dense / np.linalg.norm(dense, axis=0), compute_uv=False)[-1])
    assert factor.rounding == pytest.approx(2.0 * np.finfo(float).eps / least, rel=1e-3)


def test_rows_in_one_place_and_in_no_order() -> None:
    R, places = _strip(cells=40)
    order = np.random.default_rng(5).permutation(R.shape[0])
    gamma = np.array([60])
    expected = factorise_root(R, gamma, places).schur
    np.testing.assert_allclose(factorise_root(R[order], gamma, places[order]).schur, expected, rtol=1e-10)
    np.testing.assert_allclose(factorise_root(R, gamma, 0.0 * places).schur, expected, rtol=1e-10)
    np.testing.assert_allclose(factorise_root(R, gamma, places[:, :0]).schur, expected, rtol=1e-10)


def test_bad_arguments_are_named() -> None:
    R, places = _strip(cells=4)
    for interface in ([3, 2], [2, 2], [-1], [R.shape[1]]):
        with pytest.raises(InputError, match="interface"):
            factorise_root(R, np.array(interface), places)
    with pytest.raises(InputError, match="places"):
        factorise_root(R, np.array([0]), places[1:])
    with pytest.raises(InputError, match="finite"):
        factorise_root(R * np.inf, np.array([0]), places)


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
