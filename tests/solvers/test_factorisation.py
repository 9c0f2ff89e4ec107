"""Factorisations with a Schur complement, by every back end, against dense algebra; which one a solve gets."""

import gc
import os
import subprocess
import sys
from itertools import product

import numpy as np
import pytest
from scipy.sparse import block_array, block_diag, csc_array, csc_matrix, diags, eye_array, kron, random_array, vstack

from qvi_contact import discretize
from qvi_contact.gallery import compressed_plate
from solvers import FrictionQVI, Status, solve_qvi
from solvers.factorisation import (
    BACKENDS,
    DENSE,
    VARIABLE,
    FactorisationError,
    available_backends,
    condensing_pays,
    factorise,
    interface_last,
    refactorisation,
    resolve,
    thread_count,
)
from solvers.inequality import EqualitySystem
from solvers.settings import METHODS
from tests.cases import refused_at

BACKENDS_HERE = list(available_backends())
BACKEND = pytest.mark.parametrize("backend", [*BACKENDS_HERE, DENSE])
INTERFACES = pytest.mark.parametrize(
    "interface", [[], [7], [0, 1, 2, 30, 59], list(range(59)), list(range(60))], ids=["0", "1", "5", "n-1", "n"]
)


@pytest.fixture(autouse=True)
def _no_choice(environ):
    environ(**{VARIABLE: None})


def laplace(n, shift):
    """Second differences on a line with free ends, plus a shift: eigenvalues shift … 4 + shift."""
    ends = np.r_[1.0, np.full(n - 2, 2.0), 1.0]
    return csc_matrix(diags([-np.ones(n - 1), ends + shift, -np.ones(n - 1)], [-1, 0, 1]))


def grid():
    """10 × 6 grid, diagonally scaled by up to 1000."""
    K = kron(laplace(10, 0.1), eye_array(6)) + kron(eye_array(10), laplace(6, 0.1))
    scale = diags(10.0 ** np.random.default_rng(1).uniform(0.0, 1.5, 60))
    return csc_matrix(scale @ K @ scale)


def parts(K, interface):
    """K_II⁻¹, K_IΓ, S and I, dense."""
    A = K.toarray()
    interior = np.setdiff1d(np.arange(A.shape[0]), interface)
    inverse = np.linalg.inv(A[np.ix_(interior, interior)])
    coupling = A[np.ix_(interior, interface)]
    return inverse, coupling, A[np.ix_(interface, interface)] - coupling.T @ inverse @ coupling, interior


def solved(factor, right):
    """The solution of K x = right."""
    return EqualitySystem(np.zeros((0, factor.size)), factor).solve(right)[0]


@BACKEND
@INTERFACES
@pytest.mark.parametrize("columns", [(), (1,), (3,), (0,)], ids=str)
def test_reduce_expand_and_solve(backend, interface, columns):
    K, interface = grid(), np.array(interface, dtype=int)
    random = np.random.default_rng(2)
    right = random.normal(size=(60, *columns))
    values = random.normal(size=(interface.size, *columns))
    kept = right.copy()
    inverse, coupling, schur, interior = parts(K, interface)
    factor = factorise(K, interface, backend)
    assert factor.schur.shape == schur.shape
    np.testing.assert_allclose(factor.schur, schur, rtol=0, atol=1e-12 * abs(K).max())
    np.testing.assert_array_equal(factor.schur, factor.schur.T)
    np.testing.assert_array_equal(factor.interface, interface)
    assert factor.size == 60
    assert min(factor.seconds["analysis"], factor.seconds["numeric"]) >= 0.0
    reduced, state = factor.reduce(right)
    np.testing.assert_allclose(reduced, right[interface] - coupling.T @ inverse @ right[interior], atol=1e-11)
    start = state.copy()
    for scale in (1.0, -2.0):  # a state serves more than once
        x = factor.expand(state, scale * values)
        np.testing.assert_array_equal(x[interface], scale * values)
        np.testing.assert_allclose(x[interior], inverse @ (right[interior] - coupling @ (scale * values)), atol=1e-11)
    expected = np.linalg.solve(K.toarray(), right)
    for same in (right, np.asfortranarray(right), np.repeat(right, 2, axis=0)[::2]):
        np.testing.assert_allclose(solved(factor, same), expected, atol=1e-11)
    np.testing.assert_array_equal(right, kept)
    np.testing.assert_array_equal(state, start)


def test_dense_algebra_is_taken_by_itself_where_it_is_cheap():
    assert factorise(grid(), np.arange(3)).backend == DENSE
    assert factorise(laplace(400, 0.1), np.arange(3)).backend == DENSE
    assert factorise(laplace(401, 0.1), np.arange(3)).backend == resolve()


@pytest.mark.parametrize("interface", [[], [3], list(range(40))], ids=len)
def test_the_fronts_take_places_for_its_order_alone(interface):
    K = csc_matrix(kron(laplace(40, 0.1), eye_array(40)) + kron(eye_array(40), laplace(40, 0.1)))
    interface = np.array(interface, dtype=int)
    places = np.indices((40, 40)).reshape(2, -1).T.astype(float)
    plain, placed = (factorise(K, interface, "multifrontal", places=given) for given in (None, places))
    right = np.random.default_rng(0).normal(size=K.shape[0])
    np.testing.assert_allclose(placed.schur, plain.schur, atol=1e-12)
    np.testing.assert_allclose(solved(placed, right), solved(plain, right), atol=1e-12)


@BACKEND
@pytest.mark.parametrize(
    ("K", "interface"),
    [
        (laplace(20, 0.0), []),
        *product((laplace(20, -0.01), laplace(20, -3.0)), ([], [3], [0, 19])),  # to a negative diagonal
        ([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]], [2]),  # det K = −1, the interior singular
        ([[1.0, 0.1, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 1.0]], [2]),  # a diagonal entry that is not stored
        (laplace(5, -0.5), np.arange(5)),  # nothing but interface
    ],
)
def test_matrix_that_is_not_positive_definite(backend, K, interface):
    K = csc_matrix(K)
    with pytest.raises(FactorisationError, match="positive definite") as caught:
        solved(factorise(K, np.array(interface, dtype=int), backend), np.ones(K.shape[0]))
    assert (caught.value.reason, caught.value.backend in (backend, "lapack")) == ("singular", True)  # the latter has S


@BACKEND
def test_other_formats_of_the_matrix(backend):
    K = grid()
    wide = csc_matrix((K.data, K.indices.astype(np.int64), K.indptr.astype(np.int64)), shape=K.shape)
    upside_down = csc_matrix((K.data.copy(), K.indices.copy(), K.indptr.copy()), shape=K.shape)
    for j in range(60):
        own = slice(K.indptr[j], K.indptr[j + 1])
        upside_down.indices[own], upside_down.data[own] = K.indices[own][::-1], K.data[own][::-1]
    upside_down.has_sorted_indices = False
    expected = factorise(K, np.arange(5), backend).schur
    for same in (wide, upside_down, K.tocsr(), K.toarray()):
        np.testing.assert_allclose(factorise(same, np.arange(5), backend).schur, expected, rtol=1e-12)


def gallery_plate(cells=(4, 4)):
    return discretize(compressed_plate(0.2, cells)).qvi


@BACKEND
def test_badly_scaled_is_not_singular(backend):
    scale = diags(10.0 ** np.linspace(-7, 7, 20))
    factor = factorise(csc_matrix(scale @ laplace(20, 0.5) @ scale), np.array([3, 4]), backend)
    right = scale @ np.ones(20)
    np.testing.assert_allclose(scale @ solved(factor, right), np.full(20, 2.0), rtol=1e-12)


@BACKEND
def test_matrix_without_unknowns(backend):
    factor = factorise(csc_matrix((0, 0)), np.zeros(0, dtype=int), backend)
    assert (factor.schur.shape, solved(factor, np.zeros((0, 2))).shape) == ((0, 0), (0, 2))


@BACKEND
def test_many_factorisations_leave_no_memory_behind(backend):
    qvi = gallery_plate((10, 10))
    K, interface = qvi.K, np.unique(vstack([qvi.N, qvi.T]).tocoo().col)

    def grow(count):
        before = resident()
        for _ in range(count):
            factorise(K, interface, backend, 1)
        gc.collect()
        return resident() - before

    grow(3)
    assert grow(5) < 2.5 * K.data.nbytes  # factors have more entries than K


def resident():
    """Bytes of memory in use, 0 where the system does not tell."""
    if not os.path.exists("/proc/self/statm"):
        return 0
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_order_of_preference_and_default(environ):
    assert resolve() == BACKENDS_HERE[0]
    assert [name for name in BACKENDS if name in BACKENDS_HERE] == BACKENDS_HERE
    environ(**{VARIABLE: "Multifrontal"})
    assert factorise(grid(), np.arange(2)).backend == "multifrontal"
    assert factorise(grid(), np.arange(60)).backend == DENSE
    for name in BACKENDS_HERE:
        environ(**{VARIABLE: name})
        assert solve_qvi(gallery_plate()).factorisation.startswith(name)
        assert solve_qvi(gallery_plate(), factorisation="multifrontal").factorisation.startswith("multifrontal")
    environ(**{VARIABLE: "umfpack"})
    with refused_at(VARIABLE):
        factorise(grid(), np.arange(2))


def printed(code, *words):
    """What Python prints that starts anew."""
    return subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, check=True, cwd=os.getcwd()
    ).stdout.strip()


MISSING = """
import os, sys
import numpy as np
from solvers import InputError
from solvers.factorisation import available_backends, factorise, missing_backends, resolve
os.chdir(sys.argv[1])
os.rmdir(sys.argv[1])  # MKL does not load there
try:
    factorise(np.eye(3), np.arange(1), "pardiso")
except InputError as error:
    print(*available_backends(), *missing_backends(), resolve(), error.field, "pip install mkl" in error.remedy)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="folders in use are not deleted")
def test_back_ends_that_are_missing(tmp_path):
    assert printed(MISSING, str(tmp_path)) == "multifrontal pardiso multifrontal backend True"


def test_wrong_input():
    factor = factorise(grid(), np.arange(2))
    state = factor.reduce(np.ones(60))[1]
    for call, field in (
        (lambda: factor.reduce(np.ones(59)), "right"),
        (lambda: factor.expand(state, np.ones(3)), "values"),
        (lambda: factor.expand(state, np.ones((2, 1))), "values"),
    ):
        with refused_at(field):
            call()


def test_order_puts_the_interface_last_and_groups_together():
    K = csc_matrix(kron(laplace(8, 1.0), np.ones((4, 4)) + np.eye(4)))
    interface = np.array([1, 5, 31])
    order, starts = interface_last(K, interface)
    np.testing.assert_array_equal(np.sort(order), np.arange(32))
    np.testing.assert_array_equal(order[-3:], interface)
    nodes = order[:-3] // 4
    assert np.count_nonzero(np.diff(nodes)) == 7
    assert starts[-1] == 29
    assert np.diff(starts).min() > 0


@pytest.mark.parametrize("kind", ["unknown of all", "no links", "two parts"])
def test_without_places_any_pattern_is_eliminated_in_parts(kind):
    """No front has more than a few hundred unknowns."""
    K = kron(laplace(40, 0.1), eye_array(50)) + kron(eye_array(40), laplace(50, 0.1))
    if kind == "unknown of all":
        known = np.full((2000, 1), 1e-3)
        K = block_array([[K, known], [known.T, np.full((1, 1), 5.0)]])
    elif kind == "no links":
        K = diags(np.linspace(1.0, 2.0, 2000))
    else:
        K = block_diag([K, 2.0 * K])
    shuffled = np.random.default_rng(0).permutation(K.shape[0])
    K, interface = csc_array(csc_array(K)[shuffled][:, shuffled]), np.array([3, 70])
    assert np.diff(interface_last(K, interface)[1]).max() < 150
    factor, right = factorise(K, interface, "multifrontal"), np.sin(np.arange(K.shape[0]))
    np.testing.assert_allclose(K @ solved(factor, right), right, atol=1e-12)


@pytest.mark.parametrize("ordered", [False, True])
@pytest.mark.parametrize("backend", BACKENDS_HERE)
def test_one_pattern_many_matrices(backend, ordered):
    random = np.random.default_rng(4)
    pattern = random_array((300, 300), density=0.01, rng=random)
    pattern = csc_array(abs(pattern) + abs(pattern.T) + eye_array(300)).tocsr()
    places = random.normal(size=(300, 2)) if ordered else None
    factor = refactorisation(pattern.indptr, pattern.indices, backend, 1, places)
    right = random.normal(size=300)
    for _ in range(3):
        matrix = pattern.copy()
        matrix.data = random.normal(size=matrix.nnz) + 8.0 * (matrix.tocoo().row == matrix.tocoo().col)
        factor.factorise(matrix.data)
        assert matrix @ factor.solve(right) == pytest.approx(right, abs=1e-12)


def test_the_larger_share_of_a_body_the_contact_is_the_sooner_it_is_sparse():
    """36 entries a column, as of Bogner-Fox-Schmit elements, and contacts that grow."""

    def pays(unknowns, interface):
        entries = np.arange(36 * unknowns) % unknowns
        K = csc_array((np.ones(36 * unknowns), entries, np.arange(0, 36 * unknowns + 1, 36)), (unknowns, unknowns))
        return condensing_pays(K, interface)

    assert [pays(4000, k) for k in (300, 590, 900, 5000)] == [True, True, False, False]
    assert (pays(4000, 900), pays(12000, 900)) == (False, True)


def test_number_of_threads(environ):
    environ(MKL_NUM_THREADS=None, OMP_NUM_THREADS="3,2")
    assert thread_count() == 3
    environ(MKL_NUM_THREADS=2)
    assert thread_count() == 2
    environ(MKL_NUM_THREADS=None, OMP_NUM_THREADS="")
    assert 1 <= thread_count() <= (os.cpu_count() or 1)


LIMITED = """
import numpy
from threadpoolctl import threadpool_info
from solvers.factorisation import factorise, limited_blas

def counts():
    return sorted({pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"})

with limited_blas(1):
    print(*counts(), end=" ")
factorise(numpy.eye(600) + 1.0, numpy.arange(3))  # loads another BLAS
before = counts()
with limited_blas(1):
    print(*counts(), before == counts() == [1], end=" ")
print(before == counts())
"""


def test_blas_threads_are_limited_and_restored():
    """Libraries that were loaded after the first use, too."""
    pytest.importorskip("threadpoolctl")
    words = printed(LIMITED)
    assert (words[:4], words[-4:]) == ("1 1 ", "True")


TOGETHER = """
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from qvi_contact import solve
from qvi_contact.gallery import compressed_plate

def forces(problem):
    plate = solve(problem, factorisation=sys.argv[1]).contacts["plate"]
    return plate.normal_force, plate.tangential_force

for shared in (True, False):
    problems = [compressed_plate(0.1 + 0.1 * (k % 3), (4, 4)) for k in range(6)]
    alone = [forces(problem) for problem in problems[:3]]
    mesh = problems[0].mesh
    problems = [replace(problem, mesh=mesh) if shared else problem for problem in problems]
    with ThreadPoolExecutor(4) as pool:
        for k, found in enumerate(pool.map(forces, problems)):
            assert max(abs(a - b) for a, b in zip(found, alone[k % 3])) < 1e-8 * abs(alone[0][0])
print("alike")
"""


def test_threads_solve_together():
    """On one mesh, whose factors they share, and on meshes of their own."""
    assert printed(TOGETHER, BACKENDS_HERE[0]) == "alike"


def test_importing_loads_no_back_end():
    code = "import sys, solvers, solvers.factorisation; solvers.available(); print(*{NAMES} & set(sys.modules))"
    names = {"mkl", "cvxopt", "threadpoolctl", "cvxpy", "qpsolvers", "osqp", "clarabel", "matplotlib"}
    assert printed(code.replace("{NAMES}", str(names))) == ""


def test_a_context_ends():
    """Whatever happens inside; what was made in it stays, as "auto" is content with it."""
    plain, other = gallery_plate(), gallery_plate()
    with pytest.raises(ZeroDivisionError), plain.stiffness.using("multifrontal", 1):
        _ = 1 / 0
    assert plain.condensed_contact.system.factor.backend == DENSE
    with other.stiffness.using("multifrontal", 1):
        factor = other.condensed_contact.system.factor
    assert factor.backend == "multifrontal"
    assert other.condensed_contact.system.factor is factor


def singular():
    """K with a null vector that no equation holds; its diagonal is positive."""
    return FrictionQVI.from_arrays(
        K=csc_array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), f=np.ones(3), N=[[0.0, 0.0, -1.0]],
        n0=[0.0], T=[[0.0, 0.0, 1.0]], t0=[0.0], mu=[0.3], W=[1.0],
    )  # fmt: skip


@pytest.mark.parametrize("name", [*BACKENDS_HERE, "auto"])
@pytest.mark.parametrize("method", [None, *METHODS])
def test_a_singular_matrix_is_a_status(method, name):
    solution = solve_qvi(singular(), method=method, factorisation=name)
    assert solution.status is Status.ILL_CONDITIONED
    assert "fix the free modes" in solution.message
    assert np.isnan(solution.z).all()
    assert solution.certificate.accuracy == np.inf


@pytest.mark.parametrize("place", ["solvers.factorisation.base.dtrsm", "solvers.inequality.contact.dpotrf"])
def test_lack_of_memory_is_a_status(monkeypatch, place):
    """In SciPy's factorisation, or in dense algebra on the contact."""

    def full(*_, **__):
        raise MemoryError

    monkeypatch.setattr(place, full)
    for method in METHODS:
        solution = solve_qvi(gallery_plate(), method=method, factorisation="multifrontal")
        assert solution.status is Status.OUT_OF_MEMORY
        assert np.isnan(solution.z).all()


@BACKEND
def test_a_soft_schur_complement_costs_no_digits(backend):
    """A chain of springs that hardly anything holds: κ(S) = 1e11, but what is eliminated is well conditioned."""
    K, right, interface = laplace(20, 1e-11), np.sin(np.arange(20.0)), np.array([4, 15])
    inner, dense = np.setdiff1d(np.arange(20), interface), K.toarray()
    found = factorise(K, interface, backend)
    reduced, state = found.reduce(right)
    eliminated = np.linalg.solve(dense[np.ix_(inner, inner)], right[inner])
    assert reduced == pytest.approx(right[interface] - dense[np.ix_(interface, inner)] @ eliminated, rel=1e-13)
    x = found.expand(state, np.array([2.0, -1.0]))
    assert (dense @ x - right)[inner] == pytest.approx(0.0, abs=1e-12)
