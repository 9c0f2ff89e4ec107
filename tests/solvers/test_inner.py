"""Every inner back end on the same problems, and each one's quirks."""

import asyncio
import io
import subprocess
import sys
from contextlib import redirect_stdout
from contextvars import copy_context
from types import SimpleNamespace

import numpy as np
import pytest

from solvers import Status, available, check_feasibility, solve_qvi
from solvers.basics import foreign_code
from solvers.inner import Centre, make_inner
from tests.solvers.conftest import LIBRARIES, random_problem


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


@pytest.mark.parametrize("name", ["direct:clarabel", "socp:clarabel"])
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


NOISY = """
import ctypes, logging, os, threading
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
print("before")
libc.printf(b"from C before\\n")
for level in ("INFO", "DEBUG"):
    logging.getLogger("qvi_contact").setLevel(level)
    print(solve_qvi(one_contact(0.5, (-1.0, -3.0)), inner="qp:clarabel").status.value)
libc.printf(b"from C behind\\n")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the C library is found by another name")
def test_what_a_back_end_prints_does_not_reach_standard_output():
    """At once, from C's buffer, or by Python; what others print does. It is told to those who want everything."""
    done = subprocess.run([sys.executable, "-c", NOISY], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    others = lines.count("from another thread")
    assert [line for line in lines if line != "from another thread"] == [
        "before", "from C before", "solved", "solved", "from C behind"
    ]  # fmt: skip
    assert done.stderr.count("noise") == 3 * others // 2 > 0


def test_foreign_code_sets_no_context_variable():
    """The collector may run inside numpy's setting of one, before Python 3.12, and then the process would end."""
    before = dict(copy_context())
    with foreign_code():
        assert dict(copy_context()) == before


def test_what_the_garbage_collector_frees_may_enter_foreign_code():
    """While standard output is hidden or shown: factors of a library are released there."""

    class Collected(io.StringIO):
        entered = 0

        def fileno(self):
            self.entered += 1
            with foreign_code():
                return super().fileno()

    with redirect_stdout(Collected()) as stream, foreign_code():
        print("noise")
    assert stream.entered
    assert stream.getvalue() == ""


class Panic(BaseException):
    """As Rust's, which is no Exception."""


Panic.__name__ = "PanicException"


def raising(error):
    def raised(_):
        raise error

    return raised


@pytest.mark.parametrize("error", [ValueError("one\ntwo\r\n  three"), Panic("one\ntwo\nthree")])
@pytest.mark.parametrize("name", LIBRARIES)
def test_whatever_is_raised_becomes_a_status_and_one_line(back_end, name, error):
    back_end(name, raising(error))
    solution = solve_qvi(random_problem(0), inner=name)
    assert solution.status is Status.BACKEND_FAILED
    assert "one two three" in solution.message
    assert len(solution.message.splitlines()) == 1
    assert np.isnan(solution.z).all()
    assert solution.certificate.accuracy == np.inf


@pytest.mark.parametrize("name", LIBRARIES)
@pytest.mark.parametrize("error", [TimeoutError("time is over"), asyncio.CancelledError(), GeneratorExit()])
def test_cancellation_and_time_outs_go_on(back_end, name, error):
    back_end(name, raising(error))
    with pytest.raises(type(error)) as caught:
        solve_qvi(random_problem(0), inner=name)
    assert caught.value is error


@pytest.mark.parametrize("name", ["qp:clarabel", "direct:clarabel"])
@pytest.mark.parametrize(
    "change",
    [None, {"x": np.zeros(5)}, {"x": None}, {"x": np.full(12, np.nan)}, {"x": 1j * np.ones(12)}, {"z": None},
     {"z": np.zeros(27)}, {"z": np.zeros(3)}],
    ids=["nothing", "short", "none", "not finite", "complex", "no multipliers", "long", "few"],
)  # fmt: skip
def test_answers_of_another_form(back_end, name, change):
    qvi = random_problem(0)

    def lie(answer):
        true = answer()
        told = {part: getattr(true, part, None) for part in ("x", "y", "z", "status", "iterations", "extras", "found")}
        return change and SimpleNamespace(**told | change)

    back_end(name, lie)
    result = make_inner(name, qvi, 1e-8).solve(np.ones(qvi.m), origin(qvi), None)
    assert not result.finite
    if "nan" not in str(change):
        assert result.status is Status.BACKEND_FAILED
        assert "clarabel" in result.message


BROKEN = {
    "none": lambda _: None,
    "short": lambda vector: list(vector)[:-1],
    "nan": lambda vector: np.full(len(vector), np.nan),
    "complex": lambda vector: 1j * np.ones(len(vector)),
}


@pytest.mark.parametrize("part", ["x", "z"])
@pytest.mark.parametrize("how", BROKEN)
def test_a_broken_answer_decides_nothing_wrongly(back_end, part, how):
    """Multipliers do not enter where a solution is claimed; without a finite point there is none."""

    def lie(answer):
        true = answer()
        told = {"x": true.x, "z": true.z, "status": "Solved"}
        return SimpleNamespace(**told | {part: BROKEN[how](told[part])})

    back_end("direct:clarabel", lie)
    found = check_feasibility(random_problem(0))
    assert found.feasible in (True, None)
    assert found.feasible is None or np.isfinite(found.z).all()
