"""Rows that depend on each other and what spans them; trace coordinates, in which E Y is [N; T]."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csc_array, csr_array, random_array

from qvi_contact import discretize
from qvi_contact.gallery import compressed_plate, masonry_wall
from solvers import InputError
from solvers.factorisation import factorise, factorise_root
from solvers.inequality import TractionFactor, echelon, independent_rows, interface_of, spanning_rows, trace_coordinates
from tests.cases import examples


@st.composite
def planted(draw):
    """Sparse rows of which some are combinations of others, in any order, of any lengths; and their rank."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    columns, rank = draw(st.integers(1, 30)), draw(st.integers(0, 12))
    rank = min(rank, columns)
    independent = random_array((rank, columns), density=draw(st.floats(0.05, 0.6)), rng=random).toarray()
    independent[np.arange(rank), random.permutation(columns)[:rank]] += 2.0 + random.uniform(size=rank)
    more = draw(st.integers(0, 8))
    mixing = random.integers(-2, 3, size=(more, rank)).astype(float)
    rows = np.vstack([independent, mixing @ independent])[random.permutation(rank + more)]
    return csr_array(rows * 10.0 ** random.uniform(-3, 3, len(rows))[:, None])


@settings(max_examples=examples(30), deadline=None)
@given(planted())
def test_echelon_finds_the_rank_and_a_basis(Y):
    dense = Y.toarray()
    scale = np.linalg.norm(dense, axis=1)
    unit = dense / np.where(scale > 0.0, scale, 1.0)[:, None]
    rank = np.linalg.matrix_rank(unit, tol=1e-9) if unit.size else 0
    found = echelon(Y)
    assert len(found.rows) == rank
    assert len(found.free) == Y.shape[1] - rank
    basis = np.vstack([unit[found.rows], np.eye(Y.shape[1])[found.free]])
    assert np.linalg.matrix_rank(basis, tol=1e-9) == Y.shape[1]
    if rank:
        left = unit - unit @ np.linalg.pinv(unit[found.rows]) @ unit[found.rows]
        assert np.abs(left).max(initial=0.0) < 1e-8
    assert list(found.rows) == sorted(set(found.rows.tolist()))


def test_echelon_takes_the_first_of_equal_rows_and_ignores_stored_zeros():
    Y = csr_array((np.array([0.0, 1.0, 2.0, 1.0]), np.array([0, 1, 1, 2]), np.array([0, 2, 3, 4])), shape=(3, 3))
    found = echelon(Y)
    assert found.rows.tolist() == [0, 2]
    assert found.free.tolist() == [0]


def closed_rim(count):
    """Tractions on the edges of a regular polygon by Φ, Φ_x, Φ_y at its corners: all σ_N, then all σ_T.

    They do not change if an affine function is added to Φ, and fix everything else.
    """
    first, second = np.arange(count), (np.arange(count) + 1) % count
    angle = 2.0 * np.pi * first / count
    along = np.column_stack([np.cos(angle[second]) - np.cos(angle), np.sin(angle[second]) - np.sin(angle)])
    rows = np.zeros((3 * count, count, 3))
    for edge, (a, b) in enumerate(zip(first, second, strict=True)):
        t = along[edge]
        rows[2 * edge, [a, b], 1:] = -t, t
        rows[2 * edge + 1, [a, b]] = [-1.0, *(-t / 2.0)], [1.0, *(-t / 2.0)]
        rows[2 * count + edge, [a, b], 1:] = (-t[1], t[0]), (t[1], -t[0])
    return csr_array(rows.reshape(3 * count, 3 * count))


def test_echelon_on_a_closed_rim():
    """Milliseconds, but ten seconds where pivots are replaced in any other order than their own."""
    rows = closed_rim(128)
    found = echelon(rows)
    assert (len(found.rows), len(found.free)) == (381, 3)
    basis = np.vstack([rows.toarray()[found.rows], np.eye(384)[found.free]])
    assert np.linalg.cond(basis) < 1e6


def random_traces(seed, dependent=0, zero=0):
    """Rows [N; T] = E Y of m = 9 points in n = 30 unknowns."""
    random = np.random.default_rng(seed)
    Y = random_array((7, 30), density=0.15, rng=random).toarray() + np.eye(7, 30)
    Y = np.vstack([Y, random.normal(size=(dependent, 7)) @ Y, np.zeros((zero, 30))])
    E = random_array((18, len(Y)), density=0.5, rng=random).toarray()
    return TractionFactor(csc_array(Y), csc_array(E)), csc_array(E @ Y)


COORDINATES = pytest.mark.parametrize(
    ("dependent", "zero", "given"), [(0, 0, True), (2, 0, True), (0, 1, True), (3, 2, True), (2, 0, False)]
)


@COORDINATES
@pytest.mark.parametrize("seed", range(3))
def test_coordinates_reproduce_the_tractions(seed, dependent, zero, given):
    traces, rows = random_traces(seed, dependent, zero)
    interface = np.union1d(interface_of(rows, csc_array((0, 30))), [29])
    coordinates = trace_coordinates(rows, traces if given else None, interface)
    k = len(interface)
    assert coordinates.interpolation.shape == (18, k)
    x = np.random.default_rng(9).normal(size=k)
    y = coordinates.from_values(x)
    assert coordinates.interpolation @ y == pytest.approx(rows[:, interface] @ x, abs=1e-10)
    assert coordinates.to_unknowns(y) == pytest.approx(x, abs=1e-10)
    g = np.random.default_rng(8).normal(size=k)
    assert coordinates.from_unknowns(g) @ y == pytest.approx(g @ x, rel=1e-9)  # gradients are dual to values
    both = coordinates.from_unknowns(np.asfortranarray(np.column_stack([g, 2.0 * g])))
    assert both[:, 1] == pytest.approx(2.0 * coordinates.from_unknowns(g), abs=1e-10)


def test_energy_in_trace_coordinates_by_both_factorisations():
    """P⁻ᵀ S P⁻¹ by S and by its root, and xᵀ S x = yᵀ (P⁻ᵀ S P⁻¹) y."""
    traces, rows = random_traces(4, dependent=1)
    random = np.random.default_rng(5)
    R = random.normal(size=(45, 30))
    interface = interface_of(rows, csc_array((0, 30)))
    coordinates = trace_coordinates(rows, traces, interface)
    plain = factorise(csc_array(R.T @ R), interface)
    rooted = factorise_root(csc_array(R), interface, np.zeros((45, 1)))
    found = coordinates.quadratic(plain)
    assert np.array_equal(found, found.T)
    assert coordinates.quadratic(rooted) == pytest.approx(found, abs=1e-9 * np.abs(found).max())
    x = random.normal(size=len(interface))
    y = coordinates.from_values(x)
    assert y @ (found @ y) == pytest.approx(x @ (plain.schur @ x), rel=1e-10)


def test_nothing_touches_the_contact():
    coordinates = trace_coordinates(csc_array((4, 6)), None, np.zeros(0, dtype=np.int64))
    assert coordinates.interpolation.shape == (4, 0)
    assert coordinates.to_unknowns(np.zeros(0)).shape == (0,)


def test_wrong_traces_are_refused():
    traces, rows = random_traces(0)
    traces.check(rows)
    wrong = rows.toarray()
    wrong[3, 5] += 1e-5
    with pytest.raises(InputError, match="E Y"):
        traces.check(csc_array(wrong))
    with pytest.raises(InputError, match="shapes"):
        traces.check(csc_array(wrong[:-2]))
    with pytest.raises(InputError, match="sparse"):
        TractionFactor(np.eye(3), csc_array(np.eye(3)))


@pytest.mark.parametrize("cells", [(1, 1), (3, 2), (8, 8)])
def test_traces_of_the_plate_are_well_scaled(cells):
    """The condition of S on the traces, scaled to a diagonal of one, is that of a first-order operator."""
    from solvers.condensed import DenseCoordinates

    stiffness = DenseCoordinates(discretize(compressed_plate(0.2, cells)).qvi).stiffness
    assert stiffness.diagonal() == pytest.approx(1.0)
    assert np.linalg.cond(stiffness) < 60.0 * max(cells)


def test_rows_of_many_bodies_stay_sparse():
    """Relations of blocks join few rows each; solving for them leaves rounding everywhere, which is no entry."""
    qvi = discretize(masonry_wall(4, 6, ())).qvi
    coordinates = trace_coordinates(qvi.contact_rows, qvi.traces, qvi.contact.touched)
    rows = abs(coordinates.interpolation)
    largest = rows.max(axis=1).toarray().ravel()
    assert (rows.data <= 1e-12 * np.repeat(largest, np.diff(rows.indptr))).mean() <= 0.01  # what cancels
    z = np.random.default_rng(0).normal(size=qvi.n)
    y = coordinates.from_values(z[qvi.contact.touched])
    assert coordinates.interpolation @ y == pytest.approx(qvi.contact_rows @ z, abs=1e-11 * np.abs(y).max())


SHAPES = {"tall": (20, 6, 4), "wide": (5, 30, 3), "full": (4, 4, 4), "nothing": (3, 5, 0)}


def rows_of_rank(rank, count, columns, spread, seed=0):
    """Random rows of lengths between 1/spread and spread, some columns untouched."""
    random = np.random.default_rng(seed)
    B = random.normal(size=(count, rank)) @ random.normal(size=(rank, columns))
    if columns > rank + 2:
        B[:, ::9] = 0.0
    return csc_array(B * np.geomspace(1.0 / spread, spread, count)[:, None])


def row_error(B, product):
    lengths = np.linalg.norm(B.toarray(), axis=1)
    return (np.linalg.norm(B.toarray() - product, axis=1) / np.where(lengths > 0.0, lengths, 1.0)).max()


@pytest.mark.parametrize("spread", [1.0, 1e8])
@pytest.mark.parametrize(("count", "columns", "rank"), SHAPES.values(), ids=SHAPES)
class TestRank:
    """Long and short rows alike: their lengths decide nothing."""

    def test_orthonormal_rows_span_all(self, count, columns, rank, spread):
        B = rows_of_rank(rank, count, columns, spread)
        E, Y = independent_rows(B)
        assert Y.shape == (rank, columns)
        assert (Y @ Y.T).toarray() == pytest.approx(np.eye(rank), abs=1e-12)
        assert row_error(B, E @ Y) < 1e-12

    def test_chosen_rows_span_all(self, count, columns, rank, spread):
        B = rows_of_rank(rank, count, columns, spread)
        E, chosen = spanning_rows(B)
        assert len(set(chosen.tolist())) == len(chosen) == rank
        assert E[chosen] == pytest.approx(np.eye(rank), abs=0.0)
        assert row_error(B, E @ B[chosen]) < 1e-11
        lengths = np.linalg.norm(B.toarray(), axis=1)
        relative = E * lengths[chosen] / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        assert np.abs(relative).max(initial=0.0) < 2.0**rank  # rows as long as one: pivoting keeps entries moderate


@pytest.mark.parametrize("function", [independent_rows, spanning_rows])
@pytest.mark.parametrize("shape", [(0, 3), (2, 3)])
def test_nothing_spans_nothing(function, shape):
    E, _ = function(csc_array(shape))
    assert E.shape == (shape[0], 0)
