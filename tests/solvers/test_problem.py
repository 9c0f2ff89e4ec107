"""What is refused of problems, options, numbers and names; problems with the same K share its factorisation."""

import copy
import gc
import pickle
from dataclasses import replace
from typing import Any
from weakref import ref

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csc_array, csc_matrix, csr_array

from solvers import FrictionQVI, InputError, SolverUnavailableError, Status, certify, solve_qvi
from solvers.basics import real_array
from tests.cases import examples, refusal, refused_at
from tests.solvers.conftest import changed, one_contact, random_problem


def data(**changes: Any) -> dict[str, Any]:
    good: dict[str, Any] = {
        "K": np.eye(3), "f": np.ones(3), "N": np.ones((2, 3)), "n0": np.zeros(2), "T": np.ones((2, 3)),
        "t0": np.zeros(2), "mu": np.full(2, 0.3), "W": np.ones(2), "A": np.ones((1, 3)), "b": np.ones(1),
    }  # fmt: skip
    return {**good, **changes}


def wrong(name, value):
    """The field that the error of a problem with this value names."""
    return refusal(lambda: FrictionQVI.from_arrays(**data(**{name: value}))).field


@pytest.mark.parametrize("name", data())
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1j])
def test_numbers_are_real_and_finite(name, value):
    given = np.array(data()[name], dtype=complex if value == 1j else float)
    given.flat[0] = value
    assert wrong(name, given) == name


@pytest.mark.parametrize("name", ["f", "n0", "t0", "mu", "W", "b"])
def test_wrong_length(name):
    for length in set(range(5)) - {len(data()[name])}:
        assert wrong(name, np.full(length, 0.5)) == name


@pytest.mark.parametrize(
    ("name", "value"),
    [("K", np.triu(np.ones((3, 3)))), ("K", -np.eye(3)), ("K", "stiff"), ("K", None), ("K", [[10**400]]),
     ("N", np.ones(3)), ("N", np.ones((2, 4))), ("N", [[1.0], [1.0, 0.0]]), ("N", np.ma.masked_less(np.eye(3), 1.0)),
     ("f", "load"), ("mu", [0.3, -1e-300]), ("W", [1.0, 0.0]), ("W", [1.0, -1.0]), ("traces", 0), ("cohesion", [-1, 0]),
     ("cohesion", [np.inf, 0.0]), ("cap", [-1.0, 1.0]), ("cap", [np.nan, 1.0]), ("cap", [1.0] * 3),
     ("bilateral", [1, 0]), ("bilateral", [True]), ("places", np.zeros((1, 2))), ("places", np.zeros(6)),
     ("places", np.full((3, 2), np.nan)), ("places", "here")],
)  # fmt: skip
def test_other_mistakes(name, value):
    assert wrong(name, value) == name


def test_equations_come_with_their_right_sides():
    qvi = FrictionQVI.from_arrays(**data())
    assert (qvi.n, qvi.m, qvi.p) == (3, 2, 1)
    assert FrictionQVI.from_arrays(**data(A=None, b=None)).p == 0
    assert {wrong("A", None), wrong("b", None)} <= {"A", "b"}
    assert wrong("K", np.zeros((0, 0))) == "f"


@pytest.mark.parametrize("kind", [csc_array, csr_array, csc_matrix])
def test_sparse_data_of_any_kind_become_columns_with_narrow_indices(kind):
    """Wide indices would go on into every product and back end; what was given stays as it is."""
    given = data(traces=None)
    wide = {name: kind(given[name]) for name in "KNTA"}
    for matrix in wide.values():
        for part in ("indices", "indptr"):
            setattr(matrix, part, getattr(matrix, part).astype(np.int64))
    qvi = FrictionQVI.from_arrays(**{**given, **wide})
    for matrix in (qvi.K, qvi.N, qvi.T, qvi.A, qvi.contact_rows):
        assert isinstance(matrix, csc_array)
        assert matrix.indices.dtype == matrix.indptr.dtype == np.int32
    for name, matrix in wide.items():
        assert (getattr(qvi, name).toarray() == given[name]).all()
        assert matrix.indices.dtype == np.int64


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
    qvi = FrictionQVI.from_arrays(csc_array(np.eye(5)), np.zeros(5), N, zeros, T, zeros, zeros, np.ones(4))
    assert qvi.contact.contacts.tolist() == [0, 1, 0, 3]


@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_equations_may_have_any_unit_repeat_each_other_and_say_nothing(size):
    qvi = random_problem(3, equalities=2)
    factors = np.array([[1.0, 0.0], [0.0, size], [size, 0.0], [0.0, 0.0]])
    assert changed(qvi, A=factors @ qvi.A, b=factors @ qvi.b).bonded == pytest.approx(qvi.bonded, rel=1e-9)
    free, nothing = random_problem(3), {"A": np.zeros((2, qvi.n)), "b": np.zeros(2)}
    assert changed(free, **nothing).bonded == pytest.approx(free.bonded, rel=1e-12)
    units = np.where(np.arange(qvi.n) == 4, size, 1.0)  # those of the unknowns
    scaled = {name: getattr(qvi, name).toarray() * units for name in ("N", "T", "A")}
    other = changed(qvi, K=units[:, None] * qvi.K.toarray() * units, f=qvi.f * units, **scaled)
    assert units * other.bonded == pytest.approx(qvi.bonded, rel=1e-9)


@pytest.mark.parametrize("method", ["condensed", "pivoting", "fixed-point"])
@pytest.mark.parametrize("seed", [1, 2])
def test_equations_may_nearly_repeat_each_other(seed, method):
    """a₁ z = b₁ and (a₁ + ε a₂) z = b₁ + ε b₂ say the same as a₁ z = b₁ and a₂ z = b₂."""
    plain, mixing = random_problem(seed, equalities=2), np.array([[1.0, 0.0], [1.0, 1e-6]])
    nearly = plain.with_contact(A=mixing @ plain.A.toarray()).with_loads(b=mixing @ plain.b)
    expected, found = (solve_qvi(qvi, method) for qvi in (plain, nearly))
    assert found.status is expected.status is Status.SOLVED
    assert found.z == pytest.approx(expected.z, abs=1e-7 * np.abs(expected.z).max())
    motions = mixing.T @ found.equality_multiplier
    assert motions == pytest.approx(expected.equality_multiplier, abs=1e-7 * np.abs(expected.equality_multiplier).max())


@pytest.mark.parametrize(
    ("name", "value"),
    [("threads", 10**30), ("threads", 1025), ("threads", 0), ("threads", 1.5), ("threads", "2"), ("memory", 10**400),
     ("max_iterations", True), ("damping", 0.5j), ("damping", np.ones(2)), ("damping", 0.0), ("variant", "fancy"),
     ("variant", np.array(["plain", "damped"])), ("memory", 0), ("max_iterations", 2.5), ("inner_tolerance", "1e-9"),
     ("inner_tolerance", 2.0), ("omega_T", None), ("omega_T", 0.0), ("omega_N", 1j), ("omega_N", -1.0),
     ("rule", np.array(["printed", "printed"])), ("rule", "guessed"), ("iterations", 0), ("initial", [1j] * 8),
     ("initial", [-1.0]), ("initial", [1.0, 2.0]), ("initial", "high"), ("initial", [np.nan] * 8), ("gap", 0.0),
     ("gap", 1.0), ("gap", "small"), ("system", "wide"), ("tolerance", 0.0), ("tolerance", 1.0), ("tolerance", None),
     ("method", ""), ("method", np.array("condensed")), ("method", ["condensed"]), ("method", 1), ("inner", b"uzawa"),
     ("inner", "qp:abacus"), ("inner", np.array(["uzawa"])), ("factorisation", "mumps"), ("factorisation", 3),
     ("throw", "yes"), ("callback", 1), ("time_limit", 0), ("time_limit", -1.0), ("time_limit", np.nan),
     ("time_limit", np.inf), ("time_limit", "60"), ("time_limit", True), ("time_limit", 1j), ("time_limit", 10**400),
     ("time_limit", [1.0])],
)  # fmt: skip
def test_wrong_options(name, value):
    with refused_at(name):
        solve_qvi(random_problem(0), **{name: value})


def test_options_of_other_methods_are_refused_and_names_listed():
    for options, field in (
        ({"method": "fixed-point", "omega_T": 0.1}, "omega_T"), ({"method": "uzawa", "memory": 3}, "memory"),
        ({"speed": 3}, "speed"),
    ):  # fmt: skip
        with refused_at(field):
            solve_qvi(random_problem(0), **options)
    for options, listed in (
        ({"inner": "qp:abacus"}, "qp:clarabel"), ({"inner": "qp:qpswift"}, "qpSWIFT"),
        ({"method": "newton"}, "uzawa"), ({"factorisation": "mumps"}, "multifrontal"),
    ):  # fmt: skip
        with pytest.raises(SolverUnavailableError, match=listed):
            solve_qvi(random_problem(0), **options)
    assert all(status.advice.endswith(".") for status in Status)


@pytest.mark.parametrize(
    ("name", "value"),
    [*(("tolerance", wrong) for wrong in (None, "1e-8", 1j, np.ones(2), 0.0, 1.0, np.nan)),
     ("normal_multiplier", np.zeros(9)), ("tangential_multiplier", 1j * np.ones(8))],
)  # fmt: skip
def test_certificates_take_numbers_of_their_shapes(name, value):
    qvi = random_problem(0)
    given = dict.fromkeys(("normal_multiplier", "tangential_multiplier"), np.zeros(8)) | {name: value}
    with refused_at(name):
        certify(qvi, np.zeros(qvi.n), **given)


class TestParts:
    """One factorisation for all problems that hold one stiffness, and none kept longer than it serves."""

    def test_are_shared_by_problems_with_other_loads_or_laws(self):
        qvi = random_problem(3, equalities=2)
        other = qvi.with_loads(f=2.0 * qvi.f, b=2.0 * qvi.b)
        assert other.condensed_contact is qvi.condensed_contact
        assert qvi.with_law(mu=0.5 * qvi.mu).bonded_state is qvi.bonded_state
        assert other.condensed_contact.system.factor is qvi.condensed_contact.system.factor
        assert other.bonded == pytest.approx(2.0 * qvi.bonded, rel=1e-9)

    def test_factorise_anew_for_unknowns_that_were_eliminated(self):
        qvi = random_problem(3)
        few = qvi.with_contact(N=csc_array(qvi.N.shape), T=csc_array(qvi.T.shape), traces=None)
        eliminated = few.condensed_contact.system
        assert len(eliminated.interface) < len(qvi.condensed_contact.system.interface)
        assert few.condensed_contact.system.factor is qvi.condensed_contact.system.factor
        with pytest.raises(InputError, match="from_arrays"):
            replace(qvi, stiffness=qvi.K)

    def test_go_with_their_problems_and_do_not_keep_them(self):
        """Memory of a large factorisation is freed at once, not when the garbage is collected next."""
        qvi = random_problem(3)
        other = qvi.with_loads(f=2.0 * qvi.f)
        stiffness, factor, kept = ref(qvi.stiffness), ref(qvi.condensed_contact.system.factor), ref(other)
        _ = qvi.bonded, qvi.contact_stiffness, other.bonded
        gc.disable()
        try:
            del other
            assert kept() is None
            del qvi
            assert stiffness() is None
            assert factor() is None
        finally:
            gc.enable()

    @pytest.mark.parametrize("copied", [copy.deepcopy, lambda qvi: pickle.loads(pickle.dumps(qvi))])
    def test_of_a_copy_factorise_anew(self, copied):
        qvi = random_problem(3)
        solution = solve_qvi(qvi)
        again = solve_qvi(copied(qvi))
        assert again.problem.stiffness is not qvi.stiffness
        assert np.array_equal(again.z, solution.z)


def test_real_numbers_are_copied_and_other_objects_refused():
    for entry in (None, "1.5", b"1", 1j):
        with refused_at("field"):
            real_array("field", np.array([1.0, entry], dtype=object))
    for value in (1, [1, 2.5], (True, False), np.float32(0.5), np.array([[1, 2]], dtype=object), [], np.zeros(2)):
        found = real_array("field", value)
        assert found.dtype == np.float64
        assert np.array_equal(found, np.array(value, dtype=np.float64))
        assert not np.shares_memory(found, value)
    path = str(InputError("output", "/data" + "/very/deep" * 40 + "/result.npz", "give another place"))
    assert path.startswith("output: '/data/very")
    assert path.endswith("/result.npz': give another place")
    assert str(InputError("mu", -1.0, "give a number ≥ 0")) == "mu: -1.0: give a number ≥ 0"


@settings(max_examples=examples(8), deadline=None)
@given(st.text(max_size=400), st.integers(0, 300))
def test_one_line_of_limited_length(text, count):
    for value in (text, list(range(count)), "/folder" * count):
        message = str(InputError("field", value, "remedy"))
        assert len(message.splitlines()) == 1
        assert len(message) <= len("field: : remedy") + 120
