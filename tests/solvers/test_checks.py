"""Numbers, arrays and names that callers hand in."""

import numpy as np
import pytest

from solvers import FrictionQVI, InputError, SolverUnavailableError, certify, solve_qvi
from solvers.basics.checks import one_of, real_array, whole_number
from tests.solvers.conftest import random_problem

COMPLEX = [1j, [0.0, 1j], np.array([1.0 + 1j]), np.array([0, np.complex64(1j)], dtype=object)]


@pytest.mark.parametrize("value", [*COMPLEX, "1", ["0", "1"], b"1", [[1.0], [1.0, 2.0]], [10**400], None, [None]])
def test_no_real_numbers(value):
    with pytest.raises(InputError) as caught:
        real_array("field", value)
    assert caught.value.field == "field"


@pytest.mark.parametrize("value", [1, [1, 2.5], (True, False), np.float32(0.5), np.array([[1, 2]], dtype=object), []])
def test_real_numbers(value):
    found = real_array("field", value)
    assert found.dtype == np.float64
    assert np.array_equal(found, np.array(value, dtype=np.float64))


def test_the_array_is_a_copy():
    given = np.zeros(2)
    real_array("field", given)[0] = 1.0
    assert given[0] == 0.0


@pytest.mark.parametrize("value", [np.array(["a", "b"]), np.array(["a"]), ["a"], b"a", None, 1, "", "c"])
def test_no_name(value):
    with pytest.raises(InputError, match="give one of a, b"):
        one_of("field", value, ("a", "b"))


@pytest.mark.parametrize("value", [0, 11, 1.0, True, "1", 10**400, np.nan, None, [1], 1j])
def test_no_whole_number(value):
    with pytest.raises(InputError, match="from 1 to 10"):
        whole_number("field", value, 10)


@pytest.mark.parametrize("name", ["K", "f", "N", "n0", "T", "t0", "mu", "W"])
def test_problems_are_real(name):
    qvi = random_problem(0)
    fields = {part: getattr(qvi, part) for part in ("K", "f", "N", "n0", "T", "t0", "mu", "W")}
    with pytest.raises(InputError) as caught:
        FrictionQVI(**fields | {name: fields[name] * (1.0 + 1e-3j)})
    assert caught.value.field == name


def test_multipliers_are_real():
    qvi = random_problem(0)
    with pytest.raises(InputError):
        certify(qvi, np.zeros(qvi.n), np.zeros(qvi.m), 1j * np.ones(qvi.m), np.zeros(qvi.p))


@pytest.mark.parametrize("name", ["method", "inner", "factorisation"])
@pytest.mark.parametrize("value", ["", np.array(["condensed", "uzawa"]), np.array(["uzawa"]), 1])
def test_no_solver_has_that_name(name, value):
    with pytest.raises(SolverUnavailableError) as caught:
        solve_qvi(random_problem(0), **{name: value})
    assert caught.value.field == name


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("threads", 10**30), ("threads", 1025), ("memory", 10**400), ("max_iterations", True), ("damping", 0.5j),
        ("damping", np.ones(2)), ("inner_tolerance", "1e-9"), ("omega_T", np.ones(2)), ("omega_N", 1j),
        ("variant", np.array(["plain", "damped"])), ("rule", np.array(["printed", "printed"])), ("initial", [1j] * 8),
    ],
)  # fmt: skip
def test_options_of_another_kind(name, value):
    with pytest.raises(InputError) as caught:
        solve_qvi(random_problem(0), **{name: value})
    assert caught.value.field == name


@pytest.mark.parametrize(("name", "value"), [("traces", {}), ("edges", np.zeros(4)), ("K", [[10**400]])])
def test_parts_of_another_kind(name, value):
    qvi = random_problem(0)
    fields = {part: getattr(qvi, part) for part in ("K", "f", "N", "n0", "T", "t0", "mu", "W")}
    with pytest.raises(InputError) as caught:
        FrictionQVI(**fields | {name: value})
    assert caught.value.field == name


@pytest.mark.parametrize("tolerance", [None, "1e-8", 1j, np.ones(2), 0.0, 1.0, np.nan])
def test_tolerances_of_certificates(tolerance):
    qvi = random_problem(0)
    with pytest.raises(InputError):
        certify(qvi, np.zeros(qvi.n), np.zeros(qvi.m), np.zeros(qvi.m), np.zeros(qvi.p), tolerance)
