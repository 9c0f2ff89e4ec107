"""Factorisations with a Schur complement, by every back end that loads here, against dense algebra."""

import gc
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.sparse import block_diag, csc_matrix, diags, identity, kron, vstack

from solvers.errors import InputError, SolverUnavailableError
from solvers.factorisation import (
    BACKENDS,
    FactorisationError,
    available_backends,
    factorise,
    registry,
    resolve,
    set_default,
)
from solvers.factorisation import cholmod as cholmod_backend
from solvers.factorisation import pardiso as pardiso_backend
from solvers.factorisation.choice import Request
from solvers.factorisation.levels import LEVELS
from solvers.factorisation.ordering import interface_last
from solvers.factorisation.threads import limited_blas, thread_count

BACKEND = pytest.mark.parametrize("backend", [*available_backends(), LEVELS])
INTERFACES = pytest.mark.parametrize(
    "interface", [[], [7], [0, 1, 2, 30, 59], list(range(59)), list(range(60))], ids=["0", "1", "5", "n-1", "n"]
)


@pytest.fixture(autouse=True)
def _no_choice(monkeypatch):
    monkeypatch.delenv(registry.VARIABLE, raising=False)
    yield
    set_default(None)


def laplace(n, shift):
    """Second differences on a line with free ends, plus a shift: eigenvalues shift … 4 + shift."""
    ends = np.r_[1.0, np.full(n - 2, 2.0), 1.0]
    return csc_matrix(diags([-np.ones(n - 1), ends + shift, -np.ones(n - 1)], [-1, 0, 1]))


def grid():
    """10 × 6 grid, diagonally scaled by up to 1000."""
    K = kron(laplace(10, 0.1), identity(6)) + kron(identity(10), laplace(6, 0.1))
    scale = diags(10.0 ** np.random.default_rng(1).uniform(0.0, 1.5, 60))
    return csc_matrix(scale @ K @ scale)


def parts(K, interface):
    """K_II⁻¹, K_IΓ, S and I, dense."""
    A = K.toarray()
    interior = np.setdiff1d(np.arange(A.shape[0]), interface)
    inverse = np.linalg.inv(A[np.ix_(interior, interior)])
    coupling = A[np.ix_(interior, interface)]
    return inverse, coupling, A[np.ix_(interface, interface)] - coupling.T @ inverse @ coupling, interior


@BACKEND
@INTERFACES
def test_schur_complement_is_the_dense_one(backend, interface):
    K, interface = grid(), np.array(interface, dtype=int)
    factor = factorise(K, interface, backend)
    schur = parts(K, interface)[2]
    assert factor.schur.shape == schur.shape
    np.testing.assert_allclose(factor.schur, schur, rtol=0, atol=1e-12 * abs(K).max())
    np.testing.assert_array_equal(factor.schur, factor.schur.T)
    np.testing.assert_array_equal(factor.interface, interface)
    assert factor.size == 60
    assert factor.seconds["analysis"] >= 0.0
    assert factor.seconds["numeric"] >= 0.0


@BACKEND
@INTERFACES
@pytest.mark.parametrize("columns", [(), (1,), (3,), (0,)], ids=str)
def test_reduce_expand_and_solve(backend, interface, columns):
    K, interface = grid(), np.array(interface, dtype=int)
    random = np.random.default_rng(2)
    right = random.normal(size=(60, *columns))
    values = random.normal(size=(interface.size, *columns))
    kept = right.copy()
    inverse, coupling, _, interior = parts(K, interface)
    factor = factorise(K, interface, backend)
    reduced, state = factor.reduce(right)
    np.testing.assert_allclose(reduced, right[interface] - coupling.T @ inverse @ right[interior], atol=1e-11)
    start = state.copy()
    for scale in (1.0, -2.0):  # a state serves more than once
        x = factor.expand(state, scale * values)
        np.testing.assert_array_equal(x[interface], scale * values)
        np.testing.assert_allclose(x[interior], inverse @ (right[interior] - coupling @ (scale * values)), atol=1e-11)
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(K.toarray(), right), atol=1e-11)
    np.testing.assert_array_equal(right, kept)
    np.testing.assert_array_equal(state, start)


def test_levels_are_taken_by_themselves_where_they_are_cheap():
    full = csc_matrix(np.eye(500) + 1.0)
    assert factorise(grid(), np.arange(3)).backend == LEVELS
    assert factorise(full, np.arange(3)).backend == resolve()
    assert factorise(full, np.arange(400)).backend == LEVELS  # little is left to eliminate
    assert factorise(laplace(2001, 0.1), np.arange(3)).backend == resolve()


def test_levels_of_parts_that_nothing_links_to_the_interface():
    K = csc_matrix(block_diag([laplace(7, 0.1), grid(), laplace(5, 0.2)]))
    interface = np.array([10, 20])
    factor = factorise(K, interface, LEVELS)
    np.testing.assert_allclose(factor.schur, parts(K, interface)[2], rtol=0, atol=1e-12 * abs(K).max())
    right = np.random.default_rng(4).normal(size=72)
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(K.toarray(), right), atol=1e-11)


@BACKEND
def test_memory_layout_of_the_right_hand_side_is_free(backend):
    K = grid()
    factor = factorise(K, np.arange(4), backend)
    right = np.random.default_rng(3).normal(size=(60, 4))
    expected = np.linalg.solve(K.toarray(), right)
    for same in (np.asfortranarray(right), np.repeat(right, 2, axis=1)[:, ::2]):
        np.testing.assert_allclose(factor.solve(same), expected, atol=1e-11)
    np.testing.assert_allclose(factor.solve(right[:, 1]), expected[:, 1], atol=1e-11)


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


def plate():
    from qvi_contact import discretize
    from qvi_contact.gallery import compressed_plate

    qvi = discretize(compressed_plate(0.2, cells=(12, 12))).qvi
    return qvi.K, np.unique(vstack([qvi.N, qvi.T]).tocoo().col)


def test_back_ends_agree_on_the_plate():
    """In the norms that the unknowns' scaling does not touch: S by its diagonal, x by the energy xᵀK x."""
    K, interface = plate()
    right = np.random.default_rng(4).normal(size=K.shape[0]) * np.sqrt(K.diagonal())
    factors = [factorise(K, interface, name) for name in available_backends()]
    first, *others = [(factor.schur, factor.solve(right)) for factor in factors]
    scale = np.sqrt(np.diagonal(first[0]))
    for schur, x in others:
        assert np.max(np.abs(schur - first[0]) / np.outer(scale, scale)) < 1e-10
        error = x - first[1]
        assert error @ (K @ error) < 1e-20 * (first[1] @ (K @ first[1]))


@BACKEND
@pytest.mark.parametrize("interface", [[], [3], [0, 19]], ids=str)
@pytest.mark.parametrize("shift", [0.0, -0.01, -3.0], ids=["singular", "indefinite", "negative diagonal"])
def test_matrix_that_is_not_positive_definite(backend, interface, shift):
    with pytest.raises(FactorisationError, match="positive definite") as caught:
        factorise(laplace(20, shift), np.array(interface, dtype=int), backend).solve(np.ones(20))
    assert caught.value.reason == "singular"
    assert caught.value.backend == backend


@BACKEND
def test_singular_interior_of_a_regular_matrix(backend):
    K = csc_matrix([[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]])  # det K = −1
    with pytest.raises(FactorisationError) as caught:
        factorise(K, np.array([2]), backend)
    assert caught.value.reason == "singular"


@BACKEND
def test_diagonal_entry_that_is_not_stored(backend):
    with pytest.raises(FactorisationError, match="diagonal entry 1 of K is 0"):
        factorise(csc_matrix([[1.0, 0.1, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([2]), backend)


@BACKEND
def test_everything_on_the_interface_and_indefinite(backend):
    with pytest.raises(FactorisationError, match="Schur complement is not positive definite"):
        factorise(laplace(5, -0.5), np.arange(5), backend).solve(np.ones(5))


@BACKEND
def test_badly_scaled_is_not_singular(backend):
    scale = diags(10.0 ** np.linspace(-7, 7, 20))
    factor = factorise(csc_matrix(scale @ laplace(20, 0.5) @ scale), np.array([3, 4]), backend)
    right = scale @ np.ones(20)
    np.testing.assert_allclose(scale @ factor.solve(right), np.full(20, 2.0), rtol=1e-12)


@BACKEND
def test_matrix_without_unknowns(backend):
    factor = factorise(csc_matrix((0, 0)), np.zeros(0, dtype=int), backend)
    assert factor.schur.shape == (0, 0)
    assert factor.solve(np.zeros((0, 2))).shape == (0, 2)


@BACKEND
def test_parts_that_do_not_touch(backend):
    K = csc_matrix(kron(identity(3), laplace(6, 0.2)))  # three blocks, the interface in two of them, one unknown alone
    interface = np.array([0, 5, 8])
    np.testing.assert_allclose(factorise(K, interface, backend).schur, parts(K, interface)[2], atol=1e-13)


@BACKEND
@pytest.mark.parametrize("threads", [1, 2])
def test_threads(backend, threads):
    K, interface = plate()
    np.testing.assert_allclose(
        factorise(K, interface, backend, threads).schur, factorise(K, interface, backend).schur, rtol=1e-8
    )


@BACKEND
def test_release(backend):
    factor = factorise(grid(), np.arange(3), backend)
    schur = factor.schur.copy()
    factor.release()
    factor.release()
    np.testing.assert_array_equal(factor.schur, schur)
    with pytest.raises(FactorisationError, match="released") as caught:
        factor.solve(np.ones(60))
    assert caught.value.reason == "backend"


@BACKEND
def test_many_factorisations_leave_no_memory_behind(backend):
    K, interface = plate()

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


def test_order_of_preference_and_default():
    assert resolve() == next(iter(available_backends()))
    assert list(available_backends()) == [name for name in BACKENDS if name in available_backends()]
    set_default("superlu")
    assert factorise(grid(), np.arange(2)).backend == "superlu"
    assert factorise(grid(), np.arange(60)).version == "dense"
    set_default(None)
    assert resolve() == next(iter(available_backends()))


def test_environment_variable(monkeypatch):
    monkeypatch.setenv(registry.VARIABLE, "SuperLU")
    assert factorise(grid(), np.arange(2)).backend == "superlu"
    monkeypatch.setenv(registry.VARIABLE, "umfpack")
    with pytest.raises(InputError, match=r"QVI_CONTACT_FACTORISATION.*pardiso, cholmod, superlu"):
        factorise(grid(), np.arange(2))
    set_default("superlu")
    assert resolve() == "superlu"


def test_unknown_and_missing_back_ends(monkeypatch):
    with pytest.raises(SolverUnavailableError, match="pardiso, cholmod, superlu"):
        factorise(grid(), np.arange(2), "umfpack")
    with pytest.raises(SolverUnavailableError):
        set_default("umfpack")
    monkeypatch.setattr(cholmod_backend, "version", lambda: None)
    assert "cholmod" not in available_backends()
    with pytest.raises(SolverUnavailableError, match=r"pip install 'qvi-contact\[cvxopt\]'"):
        factorise(grid(), np.arange(2), "cholmod")
    with pytest.raises(SolverUnavailableError, match=r"shared-subdomains, levels.*superlu") as refused:
        Request.checked("cholmod", None)
    assert refused.value.field == "factorisation"
    monkeypatch.setattr(pardiso_backend, "version", lambda: None)
    assert resolve() == "superlu"


@pytest.mark.parametrize("interface", [[3, 1], [2, 2], [-1, 4], [5, 60], [0.0, 1.0], [[1, 2]]], ids=str)
def test_wrong_interface(interface):
    with pytest.raises(InputError, match="interface"):
        factorise(grid(), np.array(interface))


def test_wrong_input():
    with pytest.raises(InputError, match="square"):
        factorise(csc_matrix((3, 4)), np.arange(2))
    with pytest.raises(InputError, match="finite"):
        factorise(csc_matrix([[np.nan, 0.0], [0.0, 1.0]]), np.arange(1))
    with pytest.raises(InputError, match="threads"):
        factorise(grid(), np.arange(2), threads=0)
    factor = factorise(grid(), np.arange(2))
    with pytest.raises(InputError, match="right"):
        factor.solve(np.ones(59))
    state = factor.reduce(np.ones(60))[1]
    with pytest.raises(InputError, match="values"):
        factor.expand(state, np.ones(3))
    with pytest.raises(InputError, match="columns"):
        factor.expand(state, np.ones((2, 1)))


@pytest.mark.parametrize("code", [-2, -4, -99])
def test_errors_of_pardiso(code, monkeypatch):
    reason = {-2: "memory", -4: "singular"}.get(code, "backend")
    if "pardiso" not in available_backends():
        pytest.skip("MKL is not installed")
    monkeypatch.setattr(pardiso_backend._Handle, "_call", lambda *_: code)
    with pytest.raises(FactorisationError, match=f"code {code} in phase analysis") as caught:
        factorise(grid(), np.arange(2), "pardiso")
    assert caught.value.reason == reason


def test_pardiso_with_wide_integers(monkeypatch):
    if "pardiso" not in available_backends():
        pytest.skip("MKL is not installed")
    K, interface = grid(), np.arange(5)
    expected = factorise(K, interface, "pardiso")
    monkeypatch.setattr(pardiso_backend, "_WIDE_FROM", 0)
    wide = factorise(K, interface, "pardiso")
    np.testing.assert_allclose(wide.schur, expected.schur, rtol=1e-12)
    np.testing.assert_allclose(wide.solve(np.ones(60)), expected.solve(np.ones(60)), rtol=1e-10)
    with pytest.raises(FactorisationError):
        factorise(laplace(20, -0.5), np.arange(2), "pardiso")


def test_cholmod_without_reading_its_structure(monkeypatch):
    if "cholmod" not in available_backends():
        pytest.skip("cvxopt is not installed")
    K, interface = plate()
    factor = factorise(K, interface, "cholmod")
    assert cholmod_backend.trailing_block(factor._factor, np.zeros(K.shape[0]), interface.size) is None
    monkeypatch.setattr(cholmod_backend, "trailing_block", lambda *_: None)
    slow = factorise(K, interface, "cholmod")
    np.testing.assert_array_equal(slow.schur, factor.schur)
    right = np.ones(K.shape[0])
    np.testing.assert_array_equal(slow.solve(right), factor.solve(right))


def test_cholmod_reads_the_structure_and_leaves_options_alone(monkeypatch):
    if "cholmod" not in available_backends():
        pytest.skip("cvxopt is not installed")
    from cvxopt import cholmod

    monkeypatch.setitem(cholmod.options, "supernodal", 0)
    K, interface = plate()
    monkeypatch.setattr(cholmod_backend.Cholmod, "_numeric", once(cholmod_backend.Cholmod._numeric))
    factorise(K, interface, "cholmod")
    assert cholmod.options == {"supernodal": 0}


def once(function):
    """The function, which must not be called twice."""
    calls = []

    def wrapped(*arguments):
        calls.append(arguments)
        assert len(calls) == 1
        return function(*arguments)

    return wrapped


def test_order_puts_the_interface_last_and_groups_together():
    K = csc_matrix(kron(laplace(8, 1.0), np.ones((4, 4)) + np.eye(4)))
    interface = np.array([1, 5, 31])
    graphs = []

    def reverse(graph):
        graphs.append(graph)
        return np.arange(graph.shape[0])[::-1]

    order = interface_last(K, interface, reverse)
    np.testing.assert_array_equal(np.sort(order), np.arange(32))
    np.testing.assert_array_equal(order[-3:], interface)
    assert graphs[0].shape == (8, 8)
    nodes = order[:-3] // 4
    assert np.count_nonzero(np.diff(nodes)) == 7


def test_number_of_threads(monkeypatch):
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "3,2")
    assert thread_count(None) == 3
    assert thread_count(5) == 5
    monkeypatch.setenv("MKL_NUM_THREADS", "2")
    assert thread_count(None) == 2
    monkeypatch.delenv("MKL_NUM_THREADS")
    monkeypatch.setenv("OMP_NUM_THREADS", "")
    assert 1 <= thread_count(None) <= (os.cpu_count() or 1)


def test_blas_threads_are_restored():
    threadpoolctl = pytest.importorskip("threadpoolctl")

    def counts():
        return [pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]

    before = counts()
    with limited_blas(1):
        assert set(counts()) <= {1}
    assert counts() == before


def test_blas_libraries_loaded_after_the_first_use_are_limited_too():
    code = """
import numpy
from threadpoolctl import threadpool_info
from solvers.factorisation import mkl
from solvers.factorisation.threads import limited_blas
with limited_blas(1):
    pass
library = mkl.library()
if library is not None:
    library.MKL_Set_Num_Threads(3)
with limited_blas(1):
    print({pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"})
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "{1}"


def test_importing_the_package_imports_no_back_end():
    code = (
        "import sys, solvers.factorisation; print([m for m in ('mkl', 'cvxopt', 'threadpoolctl') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
