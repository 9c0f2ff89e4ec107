"""Every inner back end on the same problems, and each one's quirks."""

import asyncio
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from solvers import Status, available, certify, solve_qvi
from solvers.inner.problem import Centre, InnerProblem, InnerSolution
from solvers.inner.qp import QPSolver
from solvers.inner.registry import make_inner
from solvers.inner.root import square_root
from solvers.inner.socp import SOCPSolver
from tests.solvers.conftest import dragged_block, one_contact, random_problem


def origin(qvi):
    """The problem in its own unknowns."""
    return Centre(qvi, np.zeros(qvi.n))


ACCURACY = {  # |z − reference| each reaches here, where it is not 1e-7
    "qp:ecos": 1e-4, "socp:ecos": 1e-4, "socp:cvxopt": 1e-4, "socp:scs": 1e-6,
}  # fmt: skip


@pytest.mark.parametrize("name", available())
@pytest.mark.parametrize(("seed", "equalities"), [(1, 0), (4, 2)])
def test_inner_solution(name, seed, equalities):
    """Against the certificate's own conditions: stationarity with signs, and an independent solver's z."""
    qvi = random_problem(seed, equalities=equalities)
    threshold = qvi.threshold(np.full(qvi.m, 0.4))
    reference = make_inner("direct:clarabel", qvi, 1e-12).solve(threshold, origin(qvi), None)
    assert reference.status is Status.SOLVED
    result = make_inner(name, qvi, 1e-11).solve(threshold, origin(qvi), None)
    assert result.status.usable, result.message
    limit = ACCURACY.get(name, 1e-7)
    assert result.z == pytest.approx(reference.z, abs=limit)
    residual = qvi.K @ result.z - qvi.f + qvi.N.T @ result.m_N + qvi.T.T @ result.m_T + qvi.A.T @ result.nu
    assert np.abs(residual).max() < 100 * limit
    assert result.m_N.min() > -limit
    assert (result.m_T * qvi.tangential(result.z)).min() > -limit


@pytest.mark.parametrize("name", available())
def test_fixed_point_with_every_back_end(name):
    qvi = one_contact(0.5, (-1.0, -3.0))
    solution = solve_qvi(qvi, inner=name)
    assert solution.status in ((Status.SOLVED, Status.INACCURATE) if name in ACCURACY else (Status.SOLVED,))
    p = 1 / 1.4
    assert solution.z == pytest.approx([p, 0.5 * p], abs=ACCURACY.get(name, 1e-7))


@pytest.mark.parametrize("name", [name for name in available() if name not in ("qp:highs", "qp:daqp", "qp:proxqp")])
def test_infeasible_bound_is_said_to_be_infeasible(name):
    qvi = dragged_block(1.0)
    result = make_inner(name, qvi, 1e-10).solve(np.array([0.1]), origin(qvi), None)
    assert result.status in (Status.INFEASIBLE, Status.STALLED, Status.BACKEND_FAILED, Status.MAX_ITERATIONS)


@pytest.mark.parametrize("name", ["direct:clarabel", "direct:osqp", "socp:clarabel"])
def test_kept_alive_solvers_forget_the_last_bound(name):
    qvi = random_problem(5)
    solver = make_inner(name, qvi, 1e-11)
    first, second = np.full(qvi.m, 0.05), np.full(qvi.m, 0.3)
    fresh = make_inner(name, qvi, 1e-11).solve(second, origin(qvi), None)
    start = solver.solve(first, origin(qvi), None)
    again = solver.solve(second, Centre(qvi, start.z), start)
    assert np.abs(start.z - again.z).max() > 1e-3
    assert again.z == pytest.approx(fresh.z, abs=1e-8)


@pytest.mark.parametrize("name", [name for name in available() if name not in ACCURACY])
def test_increments_about_any_centre(name):
    """The answer does not depend on the point about which the problem is posed."""
    qvi = random_problem(3, equalities=1)
    threshold = qvi.threshold(np.full(qvi.m, 0.4))
    solver = make_inner(name, qvi, 1e-11)
    plain = solver.solve(threshold, origin(qvi), None)
    shifted = solver.solve(threshold, Centre(qvi, np.linspace(-1.0, 1.0, qvi.n)), None)
    assert shifted.z == pytest.approx(plain.z, abs=1e-7)


def test_socp_is_canonicalised_once():
    qvi = random_problem(6)
    solver = SOCPSolver(qvi, "clarabel", 1e-10)
    assert solver.problem.is_dpp()
    solver.solve(np.full(qvi.m, 0.1), origin(qvi), None)
    cache = solver.problem._cache.param_prog
    solver.solve(np.full(qvi.m, 0.2), origin(qvi), None)
    assert cache is not None
    assert solver.problem._cache.param_prog is cache


def test_square_root():
    K = random_problem(7).K
    R = square_root(K)
    assert np.abs((R.T @ R - K).toarray()).max() < 1e-12 * np.abs(K.toarray()).max()


def test_multipliers_of_the_two_bounds():
    inner = InnerProblem(random_problem(0))
    y = np.arange(24.0)
    m_N, m_T = inner.multipliers(y)
    assert m_N == pytest.approx(y[:8])
    assert m_T == pytest.approx(np.full(8, -8.0))


def test_nothing_is_believed():
    """A back end that says solved with multipliers of the wrong sign does not get a certificate."""
    qvi = random_problem(0)
    result = make_inner("direct:clarabel", qvi, 1e-12).solve(qvi.threshold(np.full(qvi.m, 0.4)), origin(qvi), None)
    assert result.status is Status.SOLVED
    assert not certify(qvi, result.z, -result.m_N, result.m_T).passed


def test_exceptions_become_a_status(monkeypatch):
    def broken(*_: object, **__: object) -> None:
        raise ValueError("matrix of straw")

    monkeypatch.setattr("qpsolvers.solve_problem", broken)
    qvi = random_problem(0)
    result = make_inner("qp:clarabel", qvi, 1e-8).solve(np.ones(8), origin(qvi), None)
    assert result.status is Status.BACKEND_FAILED
    assert "matrix of straw" in result.message
    solution = solve_qvi(random_problem(0), inner="qp:clarabel")
    assert solution.status is Status.BACKEND_FAILED
    assert np.isnan(solution.z).all()
    assert solution.certificate.accuracy == np.inf


NOISY = """
import ctypes, logging, os, sys, threading
import qpsolvers
from solvers import solve_qvi
from tests.solvers.conftest import one_contact

libc, plain = ctypes.CDLL(None), qpsolvers.solve_problem

def noisy(*words, **settings):
    os.write(1, b"noise\\n")
    libc.printf(b"noise")
    print("noise")
    other = threading.Thread(target=print, args=("from another thread",))
    other.start()
    other.join()
    return plain(*words, **settings)

qpsolvers.solve_problem = noisy
logging.getLogger("qvi_contact").setLevel(sys.argv[1])
print("before")
libc.printf(b"from C before\\n")
print(solve_qvi(one_contact(0.5, (-1.0, -3.0)), inner="qp:clarabel").status.value)
libc.printf(b"from C behind\\n")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the C library is found by another name")
@pytest.mark.parametrize("level", ["INFO", "DEBUG"])
def test_what_a_back_end_prints_does_not_reach_standard_output(level):
    """At once, from C's buffer, or by Python; what others print does."""
    done = subprocess.run([sys.executable, "-c", NOISY, level], capture_output=True, text=True, check=True)
    first, second, *others, status, last = done.stdout.splitlines()
    assert (first, second, status, last) == ("before", "from C before", "solved", "from C behind")
    assert set(others) == {"from another thread"}
    assert done.stderr.count("noise") == (3 * len(others) if level == "DEBUG" else 0)


@pytest.mark.skipif(sys.platform == "win32", reason="streams are closed by the shell")
def test_back_ends_run_without_standard_output():
    words = ["sh", "-c", '"$0" -c "$1" INFO >&-', sys.executable, NOISY]
    assert subprocess.run(words, capture_output=True, check=False).returncode == 0


class Panic(BaseException):
    """As Rust's, which is no Exception."""


Panic.__name__ = "PanicException"


@pytest.mark.parametrize("error", [ValueError("one\ntwo\r\n  three"), Panic("one\ntwo\nthree")])
@pytest.mark.parametrize("name", ["qp:clarabel", "direct:clarabel", "direct:osqp", "socp:clarabel"])
def test_whatever_is_raised_becomes_a_status_and_one_line(monkeypatch, name, error):
    def broken(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(LIBRARIES[name], broken)
    solution = solve_qvi(random_problem(0), inner=name)
    assert solution.status is Status.BACKEND_FAILED
    assert "one two three" in solution.message
    assert len(solution.message.splitlines()) == 1


LIBRARIES = {
    "qp:clarabel": "qpsolvers.solve_problem",
    "direct:clarabel": "solvers.inner.direct_clarabel.updated_solve",
    "direct:osqp": "osqp.OSQP.solve",
    "socp:clarabel": "cvxpy.Problem.solve",
}


@pytest.mark.parametrize("name", LIBRARIES)
@pytest.mark.parametrize("error", [TimeoutError("time is over"), asyncio.CancelledError(), GeneratorExit()])
def test_cancellation_and_time_outs_go_on(monkeypatch, name, error):
    def interrupted(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(LIBRARIES[name], interrupted)
    with pytest.raises(type(error)) as caught:
        solve_qvi(random_problem(0), inner=name)
    assert caught.value is error


@pytest.mark.parametrize("name", ["qp:clarabel", "direct:clarabel", "direct:osqp"])
def test_a_back_end_that_returns_nothing(monkeypatch, name):
    monkeypatch.setattr(LIBRARIES[name], lambda *_, **__: None)
    solution = solve_qvi(random_problem(0), inner=name)
    assert solution.status is Status.BACKEND_FAILED
    assert "NoneType" in solution.message


@pytest.mark.parametrize(
    "change",
    [{"z": np.zeros(1)}, {"m_N": 0.0}, {"m_T": None}, {"nu": np.zeros(3)}, {"z": 1j * np.zeros(12)}, None],
    ids=["short", "number", "none", "long", "complex", "nothing"],
)  # fmt: skip
def test_answers_of_another_form(monkeypatch, change):
    qvi = random_problem(0)

    def lie(solver, threshold, centre, start):  # noqa: ARG001
        sound = InnerSolution(np.zeros(qvi.n), np.zeros(qvi.m), np.zeros(qvi.m), np.zeros(0), Status.SOLVED)
        return sound if change is None else replace(sound, **change)

    if change is None:
        monkeypatch.setattr(QPSolver, "solve", lambda *_: None)
    else:
        monkeypatch.setattr(QPSolver, "solve", lie)
    result = make_inner("qp:clarabel", qvi, 1e-8).solve(np.ones(qvi.m), origin(qvi), None)
    assert result.status is Status.BACKEND_FAILED
    assert result.z.shape == (qvi.n,)
    assert "qp:clarabel: " in result.message


def test_imaginary_parts_are_not_dropped(monkeypatch):
    from qpsolvers import solve_problem

    def rotated(problem, *_, **__):
        solution = solve_problem(problem, "clarabel")
        solution.x = solution.x * (1.0 + 1e-3j)
        return solution

    monkeypatch.setattr("qpsolvers.solve_problem", rotated)
    solution = solve_qvi(random_problem(0), inner="qp:clarabel")
    assert solution.status is Status.BACKEND_FAILED
    assert "ComplexWarning" in solution.message


def test_nothing_is_written_on_standard_output(capfd):
    for load in ((1.0, -0.5), (-1.0, 0.1), (-1.0, -3.0)):
        for name in available("direct"):
            solve_qvi(one_contact(1.0, load), inner=name)
    assert capfd.readouterr().out == ""


def test_names():
    assert {"direct:clarabel", "direct:osqp", "qp:clarabel", "socp:clarabel"} <= set(available())
    assert set(available("qp")) | set(available("direct")) | set(available("socp")) == set(available())
    assert all(name.startswith("socp:") for name in available("socp"))


def test_importing_loads_no_back_end():
    code = (
        "import sys, solvers; solvers.available(); "
        "print(*[m for m in ('cvxpy', 'qpsolvers', 'osqp', 'clarabel', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
