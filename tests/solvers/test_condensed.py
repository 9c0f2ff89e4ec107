"""The condensed method on algebraic problems, on the contact and in all unknowns: what it solves, how accurately."""

import pickle
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg.lapack import dgetrf
from scipy.sparse import csc_array, csr_array, eye_array, random_array

from qvi_contact import discretize
from qvi_contact.gallery import compressed_plate, masonry_wall
from solvers import FrictionQVI, InputError, Status, Stiffness, solve_qvi
from solvers.condensed import USUAL_PATHS
from solvers.inequality import TractionFactor, basis, echelon, trace_coordinates
from tests.cases import every_pair, examples, thinned
from tests.solvers.conftest import LAWS, Root, chain, mixed_problem, one_contact, random_problem, two_contacts
from tests.solvers.test_laws import violations


def difference(qvi, one, other):
    """Largest difference of tractions, relative to the largest traction."""
    first, second = (qvi.tractions(s.z) for s in (one, other))
    return np.abs(first - second).max() / np.abs(second).max()


def condensed(qvi, **options):
    solution = solve_qvi(qvi, method="condensed", **options)
    assert solution.status is Status.SOLVED, solution.message
    assert solution.method == solution.form == "condensed"
    return solution


@pytest.mark.parametrize(
    ("law", "seed", "inner"), thinned(every_pair(list(LAWS), range(4), ["direct:clarabel", "qp:daqp"]), 8)
)
def test_lines_of_contact_agree_with_the_fixed_point(law, seed, inner):
    qvi = chain(seed, **LAWS[law])
    found = condensed(qvi)
    reference = solve_qvi(qvi, inner=inner, tolerance=1e-9)
    assert reference.solved
    assert found.iterations <= (50 if law != "bilateral" else 100)  # one of them turns on its path
    assert difference(qvi, found, reference) < 1e-7
    for name, values in violations(qvi, found).items():
        assert values.max(initial=0.0) < 1e-8, name


@pytest.mark.parametrize(
    ("seed", "friction", "equalities"), thinned(product((0, 1, 7, 11, 20), (0.0, 0.05, 0.2), (0, 2)), 6)
)
def test_dense_rows_that_cancel(seed, friction, equalities):
    """More rows than unknowns, all dense: active bounds, whose λ/s swamp the stiffness, hold nearly every unknown."""
    qvi = random_problem(seed, friction, equalities)
    reference = solve_qvi(qvi, "pivoting", tolerance=1e-10)
    assert reference.solved
    assert difference(qvi, condensed(qvi), reference) < 1e-9


@pytest.mark.parametrize(("seed", "friction"), [(3, 1.0), (18, 2.0)])
def test_where_the_path_turned_there_may_be_several_solutions(seed, friction):
    assert "may have several solutions" in condensed(random_problem(seed, friction)).remarks[0]
    assert not condensed(random_problem(seed, 0.0)).remarks


@pytest.mark.parametrize("load", [(1.0, 2.1), (1.0, 3.0), (0.5, -2.0), (-1.0, -2.0), (-1.0, 0.3)])
@pytest.mark.parametrize("friction", [0.0, 0.5, 1.0, 2.0, 5.0])
def test_one_contact_always_has_a_certified_answer(friction, load):
    """|coupling| < 1 and mu of any size: a solution exists, since a stuck, slipping or open one always does."""
    condensed(one_contact(friction, load))


def rooted(seed, spoilt, **law):
    """A line of contact with a root; K and f wrong by the relative size `spoilt`, root and load exact."""
    qvi = chain(seed, **law)
    random = np.random.default_rng(1000 + seed)
    R = np.linalg.cholesky(qvi.K.toarray()).T
    r0 = 0.1 * random.normal(size=len(R))
    error = np.triu(random.uniform(-spoilt, spoilt, R.shape))
    wrong = qvi.K.toarray() * (1.0 + error + np.triu(error, 1).T)
    f = qvi.f * (1.0 + random.uniform(-spoilt, spoilt, len(qvi.f)))
    loads = replace(qvi.loads, f=f, root=Root(R, r0), load=qvi.f + R.T @ r0)
    return replace(qvi, stiffness=Stiffness(csc_array(wrong)), loads=loads)


@pytest.mark.parametrize("law", ["coulomb", "opening", "cap", "bilateral", "equations"])
@pytest.mark.parametrize("spoilt", [1e-6, 1e-4])
def test_defect_corrections_remove_errors_of_the_matrix(law, spoilt):
    exact = condensed(chain(3, **LAWS[law]), gap=1e-15)
    found = condensed(rooted(3, spoilt, **LAWS[law]), gap=1e-15)
    assert np.linalg.norm(found.z - exact.z) < 1e-10 * np.linalg.norm(exact.z)
    assert 1e-3 * spoilt < found.corrections[0] < 100.0 * spoilt
    assert all(later < 0.1 * former for former, later in zip(found.corrections, found.corrections[1:], strict=False))
    assert len(found.corrections) >= 2
    assert condensed(rooted(3, 0.0, **LAWS[law])).corrections[0] < 1e-12


def test_how_accurate_a_linear_solve_is_depends_on_the_load():
    """The load acts on the first contact alone, where K is exact; the other one opens."""
    f = np.array([2.0, 0.4, 0.0, 0.0])
    loads = replace(two_contacts().loads, f=f, n0=np.array([0.0, 0.5]), root=Root(np.eye(4)), load=f)
    qvi = replace(two_contacts(), stiffness=Stiffness(np.diag([1.0, 1.0, 1.0001, 1.0001])), loads=loads)
    assert solve_qvi(qvi, "pivoting").certificate.accuracy < 1e-12


@pytest.mark.parametrize("method", ["condensed", "fixed-point", None])
@pytest.mark.parametrize("spoilt", [0.03, 0.3])
def test_a_matrix_too_wrong_is_no_answer(method, spoilt):
    """Errors of 3 % or a third in K: solved by many corrections, or a status; never wrong."""
    exact = condensed(chain(3))
    solution = solve_qvi(rooted(3, spoilt), method=method)
    if solution.status is Status.SOLVED:
        assert np.linalg.norm(solution.z - exact.z) < 1e-6 * np.linalg.norm(exact.z)
    else:
        assert solution.status in (Status.ILL_CONDITIONED, Status.STALLED, Status.INACCURATE)


def test_corrections_go_on_as_long_as_they_shrink():
    assert rooted(0, 0.03).bonded == pytest.approx(chain(0).bonded, rel=1e-9, abs=1e-10)
    assert "defect corrections end at" in solve_qvi(rooted(2, 0.03), "condensed").message


def close_rows(seed, close, groups=4):
    """Three normal tractions each that depend on each other: the third is the difference of two nearly equal ones.

    Coordinates are the first two. In them the third has terms of 1/close that cancel, and a rounding of that size.
    """
    random = np.random.default_rng(seed)
    m, n = 3 * groups, 5 * groups
    N, T = np.zeros((m, n)), np.zeros((m, n))
    for g in range(groups):
        N[3 * g, 5 * g] = N[3 * g + 1, 5 * g] = N[3 * g + 2, 5 * g + 1] = 1.0
        N[3 * g + 1, 5 * g + 1] = close
        T[3 * g + np.arange(3), 5 * g + 2 + np.arange(3)] = 1.0
    root = np.eye(n) + 0.15 * random.normal(size=(n, n))
    f = 2.0 * random.normal(size=n)
    f[0::5] -= 3.0
    f[1::5] = random.choice([-2.0, 2.0], groups)
    return FrictionQVI.from_arrays(
        K=root.T @ root, f=f, N=N, n0=np.zeros(m), T=T, t0=np.zeros(m), mu=np.full(m, 0.3), W=np.full(m, 1.0 / m),
        traces=TractionFactor(csc_array(np.vstack([N, T])), csc_array(np.eye(2 * m))),
    )  # fmt: skip


@pytest.mark.parametrize("seed", [2, 5, 6, 12, 13, 23])
@pytest.mark.parametrize("close", [1e-3, 1e-4])
def test_rounding_of_the_slacks_is_no_residual(close, seed):
    """Up to 1e-11 of the tractions: an error that no iteration can remove, nor has to."""
    assert condensed(close_rows(seed, close)).iterations < 60


@pytest.mark.parametrize("mu", [0.3, 3.0])
@pytest.mark.parametrize("normal", [0.0, 1e-9, -1e-5])
@pytest.mark.parametrize("shear", [0.0, 1.0])
def test_bilateral_points_at_the_kink(normal, shear, mu):
    """A point without pressure has no friction, and the other one all the same."""
    law = {"mu": np.full(2, mu), "bilateral": np.full(2, True)}
    found = condensed(two_contacts().with_loads(f=np.array([2.0, 3.0, normal, shear])).with_law(**law))
    expected = [2.0, min(3.0, 2.0 * mu), normal, min(shear, mu * abs(normal))]
    assert found.z == pytest.approx(expected, abs=3e-9)
    assert found.iterations < 60


def solved(qvi, system, **options):
    solution = solve_qvi(qvi, method="condensed", system=system, **options)
    assert solution.solved, solution.message
    return solution


@pytest.mark.parametrize(("law", "seed"), [*((law, 0) for law in LAWS), ("coulomb", 1), ("cap", 1)])
def test_both_systems_find_the_same(law, seed):
    qvi = chain(seed, **LAWS[law])
    sparse, dense = (solved(qvi, system) for system in ("sparse", "dense"))
    assert (sparse.form, dense.form) == ("full", "condensed")
    assert difference(qvi, sparse, dense) < 1e-9


@pytest.mark.parametrize("seed", range(2))
def test_equations_and_points_without_friction_beside_all_other_laws(seed):
    """Sparse systems hold them by springs; their multipliers balance the stress to the last digits all the same."""
    qvi = mixed_problem(seed)
    sparse, dense = (solved(qvi, system) for system in ("sparse", "dense"))
    assert difference(qvi, sparse, dense) < 1e-10
    assert np.abs(qvi.tangential(sparse.z)[qvi.frictionless]).max() < 1e-13
    assert sparse.equality_multiplier == pytest.approx(dense.equality_multiplier, rel=1e-9)


def test_points_may_link_unknowns_that_k_does_not():
    """A diagonal K: its pattern has no place for the blocks of contact points."""
    random = np.random.default_rng(3)
    n, m = 12, 5
    N, T = (random.normal(size=(m, n)) * (random.random((m, n)) < 0.4) for _ in range(2))
    qvi = FrictionQVI.from_arrays(
        K=eye_array(n), f=random.normal(size=n), N=N, n0=np.full(m, -0.5), T=T, t0=0.3 * random.normal(size=m),
        mu=np.full(m, 0.4), W=np.full(m, 0.2),
    )  # fmt: skip
    assert difference(qvi, solved(qvi, "sparse"), solved(qvi, "dense")) < 1e-9


def test_places_change_the_order_only():
    qvi = chain(0)
    places = np.random.default_rng(0).normal(size=(qvi.n, 2))
    placed = replace(qvi, stiffness=Stiffness(qvi.K, places=places))
    again = pickle.loads(pickle.dumps(placed))
    assert difference(qvi, solved(again, "sparse"), solved(placed, "sparse")) == 0.0
    assert difference(qvi, solved(placed, "sparse"), solved(qvi, "sparse")) < 1e-10


def test_where_newton_matrices_are_singular_other_starts_follow(monkeypatch):
    """The best of all starts is kept: here the first, as all others have singular matrices at once."""
    qvi = chain(0, **LAWS["coulomb"])
    reference, made = condensed(qvi), []

    def singular(matrix, **options):
        made.append(matrix)
        factor, pivots, info = dgetrf(matrix, **options)
        return factor, pivots, 1 if len(made) in calls else info

    monkeypatch.setattr("solvers.condensed.systems.dgetrf", singular)
    accuracies = []
    for calls in (range(2, 100), range(4, 100)):
        made.clear()
        found = solve_qvi(qvi, method="condensed")
        assert len(made) == calls.start + len(USUAL_PATHS) - 1
        assert not found.solved
        accuracies.append(found.certificate.accuracy)
    assert 1e-8 < accuracies[1] < 0.5 * accuracies[0]
    made.clear()
    calls = (3,)
    found = condensed(qvi)
    assert found.iterations > reference.iterations
    assert difference(qvi, found, reference) < 1e-7


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
    assert (len(found.rows), len(found.free)) == (rank, Y.shape[1] - rank)
    for rows, free in (found, basis(Y)):  # by elimination, and by QR
        assert np.linalg.matrix_rank(np.vstack([unit[rows], np.eye(Y.shape[1])[free]]), tol=1e-9) == Y.shape[1]
    if rank:
        left = unit - unit @ np.linalg.pinv(unit[found.rows]) @ unit[found.rows]
        assert np.abs(left).max(initial=0.0) < 1e-8
    assert list(found.rows) == sorted(set(found.rows.tolist()))
    shaken = Y * (1.0 + 4e-16 * np.random.default_rng(0).normal(size=Y.shape))  # rounding does not choose the basis
    assert [part.tolist() for part in basis(shaken)] == [part.tolist() for part in basis(Y)]


def test_echelon_takes_the_first_of_equal_rows_and_ignores_stored_zeros():
    Y = csr_array((np.array([0.0, 1.0, 2.0, 1.0]), np.array([0, 1, 1, 2]), np.array([0, 2, 3, 4])), shape=(3, 3))
    found = echelon(Y)
    assert (found.rows.tolist(), found.free.tolist()) == ([0, 2], [0])


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
    assert np.linalg.cond(np.vstack([rows.toarray()[found.rows], np.eye(384)[found.free]])) < 1e6


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
    interface = np.union1d(np.diff(csc_array(rows).indptr).nonzero()[0], [29])
    coordinates = trace_coordinates(traces if given else TractionFactor(rows, np.eye(18)), interface)
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


def test_nothing_touches_the_contact():
    coordinates = trace_coordinates(TractionFactor(csc_array((4, 6)), np.eye(4)), np.zeros(0, dtype=np.int64))
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
    with pytest.raises(InputError, match="rows"):
        TractionFactor(np.eye(3) * 1j, csc_array(np.eye(3)))


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
    coordinates = trace_coordinates(qvi.traces, qvi.contact.touched)
    rows = abs(coordinates.interpolation)
    largest = rows.max(axis=1).toarray().ravel()
    assert (rows.data <= 1e-12 * np.repeat(largest, np.diff(rows.indptr))).mean() <= 0.01  # what cancels
    z = np.random.default_rng(0).normal(size=qvi.n)
    y = coordinates.from_values(z[qvi.contact.touched])
    assert coordinates.interpolation @ y == pytest.approx(qvi.contact_rows @ z, abs=1e-11 * np.abs(y).max())
