"""`FrictionQVI` refuses what is not a problem and says what to do; problems with the same K share its factorisation."""

import copy
import gc
import pickle
from dataclasses import replace
from typing import Any
from weakref import ref

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csc_array, csc_matrix, csr_array

from solvers import FrictionQVI, InputError, Status, solve_qvi
from solvers.factorisation import FactorisationError
from solvers.solve import METHODS
from tests.solvers.conftest import one_contact, random_problem


def data(**changes: Any) -> dict[str, Any]:
    good: dict[str, Any] = {
        "K": np.eye(3), "f": np.ones(3), "N": np.ones((2, 3)), "n0": np.zeros(2), "T": np.ones((2, 3)),
        "t0": np.zeros(2), "mu": np.full(2, 0.3), "W": np.ones(2), "A": np.ones((1, 3)), "b": np.ones(1),
    }  # fmt: skip
    return {**good, **changes}


def test_good_data_is_accepted():
    qvi = FrictionQVI(**data())
    assert (qvi.n, qvi.m, qvi.p) == (3, 2, 1)
    assert FrictionQVI(**data(A=None, b=None)).p == 0


@pytest.mark.parametrize("kind", [csc_array, csr_array, csc_matrix])
def test_sparse_data_of_any_kind_become_columns_with_narrow_indices(kind):
    """Wide indices would go on into every product and back end; what was given stays as it is."""
    given = data(traces=None)
    wide = {name: kind(given[name]) for name in "KNTA"}
    for matrix in wide.values():
        for part in ("indices", "indptr"):
            setattr(matrix, part, getattr(matrix, part).astype(np.int64))
    qvi = FrictionQVI(**{**given, **wide})
    for matrix in (qvi.K, qvi.N, qvi.T, qvi.A, qvi.contact_rows):
        assert isinstance(matrix, csc_array)
        assert matrix.indices.dtype == matrix.indptr.dtype == np.int32
    for name, matrix in wide.items():
        assert (getattr(qvi, name).toarray() == given[name]).all()
        assert matrix.indices.dtype == np.int64


@given(st.sampled_from(sorted(data())), st.sampled_from([np.nan, np.inf, -np.inf]))
def test_not_finite(name, value):
    wrong = np.array(data()[name], dtype=float)
    wrong.flat[0] = value
    with pytest.raises(InputError) as error:
        FrictionQVI(**data(**{name: wrong}))
    assert error.value.field == name
    assert "finite" in error.value.remedy


@given(st.sampled_from(["f", "n0", "t0", "mu", "W", "b"]), st.integers(0, 6))
def test_wrong_length(name, length):
    if length == len(data()[name]):
        return
    with pytest.raises(InputError) as error:
        FrictionQVI(**data(**{name: np.full(length, 0.5)}))
    assert error.value.field == name


@given(st.floats(max_value=-1e-300, allow_nan=False, allow_infinity=False))
def test_negative_friction(value):
    with pytest.raises(InputError, match="mu"):
        FrictionQVI(**data(mu=np.array([0.3, value])))


@given(st.floats(max_value=0.0, allow_nan=False, allow_infinity=False))
def test_weights_are_positive(value):
    with pytest.raises(InputError, match="W"):
        FrictionQVI(**data(W=np.array([1.0, value])))


@pytest.mark.parametrize(
    ("name", "value"),
    [("K", np.triu(np.ones((3, 3)))), ("K", -np.eye(3)), ("K", "stiff"), ("K", None), ("N", np.ones(3)),
     ("N", np.ones((2, 4))), ("f", "load"), ("A", None), ("b", None), ("K", np.zeros((0, 0)))],
)  # fmt: skip
def test_other_mistakes(name, value):
    with pytest.raises(InputError):
        FrictionQVI(**data(**{name: value}))


def test_values():
    qvi = one_contact(0.5)
    z = np.array([2.0, 3.0])
    assert qvi.pressure(z) == pytest.approx([2.0])
    assert qvi.threshold(qvi.pressure(z)) == pytest.approx([1.0])
    assert qvi.energy(z) == pytest.approx(0.5 * (4 + 9 + 2 * 0.8 * 6) + 2.0 + 6.3)
    assert qvi.resultant(z) == pytest.approx(-2.0)


def test_contacts_hang_together_through_unknowns():
    """The first point and the third share an unknown; an entry that is zero joins the others to nothing."""
    N = csc_array(([1.0, 2.0, 0.0, 3.0, 4.0], ([0, 1, 1, 3, 2], [0, 1, 2, 2, 3])), shape=(4, 5))
    T = csc_array(([1.0], ([2], [0])), shape=(4, 5))
    zeros = np.zeros(4)
    qvi = FrictionQVI(csc_array(np.eye(5)), np.zeros(5), N, zeros, T, zeros, zeros, np.ones(4))
    assert qvi.N.nnz == 5
    assert qvi.contacts.tolist() == [0, 1, 0, 2]


def test_bonded_solution_with_dependent_equalities():
    qvi = random_problem(3, equalities=2)
    doubled = FrictionQVI(
        K=qvi.K, f=qvi.f, N=qvi.N, n0=qvi.n0, T=qvi.T, t0=qvi.t0, mu=qvi.mu, W=qvi.W,
        A=np.vstack([qvi.A.toarray(), qvi.A.toarray()]), b=np.concatenate([qvi.b, qvi.b]),
    )  # fmt: skip
    assert doubled.bonded == pytest.approx(qvi.bonded, rel=1e-9)


def test_singular_stiffness_is_an_error_and_as_a_result_a_status():
    qvi = FrictionQVI(**data(K=np.ones((3, 3)), A=None, b=None))
    with pytest.raises(FactorisationError, match="positive definite"):
        _ = qvi.bonded
    for method in METHODS:
        solution = solve_qvi(FrictionQVI(**data(K=np.ones((3, 3)), A=None, b=None)), method=method)
        assert solution.status is Status.ILL_CONDITIONED
        assert "positive definite" in solution.message


class TestOperator:
    """One factorisation for all problems with the same K, and none kept longer than it serves."""

    def test_is_shared_by_changed_problems(self):
        qvi = random_problem(3, equalities=2)
        other = qvi.changed(f=2.0 * qvi.f, b=2.0 * qvi.b)
        assert other.operator is qvi.operator
        assert other.equality_system.factor is qvi.equality_system.factor
        assert other.bonded == pytest.approx(2.0 * qvi.bonded, rel=1e-9)

    def test_is_made_anew_for_unknowns_that_were_eliminated(self):
        qvi = random_problem(3)
        few = qvi.changed(N=csc_array(qvi.N.shape), T=csc_array(qvi.T.shape), traces=None)
        eliminated = few.equality_system
        assert len(eliminated.interface) < len(qvi.equality_system.interface)
        assert few.equality_system is eliminated
        assert few.changed().equality_system.factor is qvi.equality_system.factor

    def test_of_another_matrix_is_refused(self):
        qvi = random_problem(3)
        with pytest.raises(InputError, match="the same K"):
            qvi.changed(K=2.0 * qvi.K)
        assert replace(qvi, K=2.0 * qvi.K).operator is not qvi.operator

    def test_goes_with_its_problems(self):
        """Memory of a large factorisation is freed at once, not when the garbage is collected next."""
        qvi = random_problem(3)
        operator, factor = ref(qvi.operator), ref(qvi.equality_system.factor)
        _ = qvi.bonded, qvi.contact_stiffness
        gc.disable()
        try:
            del qvi
            assert operator() is None
            assert factor() is None
        finally:
            gc.enable()

    def test_does_not_keep_problems(self):
        qvi = random_problem(3)
        other = qvi.changed(f=2.0 * qvi.f)
        _ = other.bonded
        kept = ref(other)
        gc.disable()
        try:
            del other
            assert kept() is None
        finally:
            gc.enable()

    @pytest.mark.parametrize("copied", [copy.deepcopy, lambda qvi: pickle.loads(pickle.dumps(qvi))])
    def test_of_a_copy_factorises_anew(self, copied):
        qvi = random_problem(3)
        solution = solve_qvi(qvi)
        again = solve_qvi(copied(qvi))
        assert again.problem.operator is not qvi.operator
        assert np.array_equal(again.z, solution.z)
