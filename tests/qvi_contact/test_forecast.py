"""Large factorisations: how much work one is, what it will take, what is told before, and what is refused."""

import os

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array, kron
from scipy.sparse.linalg import splu

from qvi_contact import discretize
from qvi_contact.command import progress_line
from qvi_contact.gallery import compressed_plate
from solvers.basics import Progress, deadline, listening, report
from solvers.factorisation import FactorisationError, Forecast, Work, check_limits, factorise

NOTHING = np.zeros(0, dtype=np.int64)


def grid(across, along, nodal=1):
    """Five-point differences on a grid with so many unknowns at each point."""
    first, second = (diags_array([-1.0, 2.1, -1.0], offsets=[-1, 0, 1], shape=(n, n)) for n in (across, along))
    points = kron(first, eye_array(along)) + kron(eye_array(across), second)
    block = np.full((nodal, nodal), 0.1) + np.eye(nodal)
    return csc_array(kron(points, block))


class TestWork:
    """Entries and operations of the factor."""

    def test_counted_entries_are_those_of_the_factor(self):
        K = grid(40, 40)
        found = splu(K, "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True})
        columns = np.diff(found.L.indptr).astype(float)
        assert Work.counted(K, NOTHING) == pytest.approx((columns.sum(), (columns**2).sum()), rel=0.3)

    def test_unknowns_of_a_point_go_together(self):
        one, three = (Work.counted(grid(30, 30, nodal), NOTHING) for nodal in (1, 3))
        assert three.operations == pytest.approx(27.0 * one.operations, rel=0.2)
        assert three.entries == pytest.approx(9.0 * one.entries, rel=0.15)

    def test_the_interface_is_left_out(self):
        K = grid(30, 30)
        assert Work.counted(K, np.arange(450)).entries < 0.5 * Work.counted(K, NOTHING).entries

    def test_the_law_is_near_what_is_counted(self):
        K = csc_array(discretize(compressed_plate(0.2, (50, 50)), degree=4).qvi.K)
        law, counted = Work.by_law(K.shape[0], K.nnz), Work.counted(K, NOTHING)
        assert law.entries == pytest.approx(counted.entries, rel=0.35)
        assert 0.4 < law.operations / counted.operations < 2.5

    def test_a_long_body_takes_less_than_the_law(self):
        K = grid(6, 4000)
        assert Work.counted(K, NOTHING).operations < 0.2 * Work.by_law(K.shape[0], K.nnz).operations


class TestForecast:
    """Seconds and bytes."""

    def test_faster_back_ends_are_forecast_so(self):
        work = Work.by_law(10**6, 3 * 10**7)
        pardiso, superlu = (Forecast.of(work, name) for name in ("pardiso", "superlu"))
        assert pardiso.seconds < 0.3 * superlu.seconds
        assert pardiso.bytes < 0.3 * superlu.bytes

    def test_threads_share_operations_and_the_interface_is_dense(self):
        work = Work.by_law(10**6, 3 * 10**7)
        one, two = (Forecast.of(work, "pardiso", threads=threads) for threads in (1, 2))
        assert 0.5 * one.seconds < two.seconds < one.seconds
        assert Forecast.of(work, "pardiso", 10**4).bytes - one.bytes == pytest.approx(1.6e9)


def refused(K, backend="superlu", faster="pip install something"):
    with pytest.raises(FactorisationError) as caught:
        check_limits(K, NOTHING, backend, 1, faster)
    return caught.value


@pytest.mark.usefixtures("clock")
class TestLimits:
    """What is begun, told, refused."""

    BIG = grid(160, 160, 3)  # a few seconds by SuperLU

    def test_too_long_is_refused_with_the_faster_library(self):
        with deadline(0.2):
            error = refused(self.BIG)
        assert error.reason == "time"
        assert "pip install something" in str(error)
        assert "time_limit" in str(error)

    def test_nothing_long_is_begun_when_the_time_is_over(self, clock):
        band = [np.ones(200_000)] * 21
        long = csc_array(diags_array(band, offsets=np.arange(-10, 11), shape=(200_000, 200_000)))
        with deadline(1.0):
            clock.passes(2.0)
            assert refused(long).reason == "time"
            check_limits(grid(150, 150), NOTHING, "pardiso", 1, "")

    def test_too_much_is_refused(self, monkeypatch):
        monkeypatch.setattr(os, "sysconf", lambda _: 1000)
        assert refused(self.BIG).reason == "memory"

    def test_what_might_fit_is_begun(self):
        expected = Forecast.of(Work.counted(self.BIG, NOTHING), "superlu")
        with deadline(0.6 * expected.seconds):
            check_limits(self.BIG, NOTHING, "superlu", 1, "")
        check_limits(self.BIG, NOTHING, "superlu", 1, "")

    def test_a_long_body_is_not_refused_by_the_law(self):
        K = grid(6, 4000, 3)
        law = Forecast.of(Work.by_law(K.shape[0], K.nnz), "superlu")
        with deadline(0.4 * law.seconds):
            check_limits(K, NOTHING, "superlu", 1, "")

    def test_twice_the_work_where_it_is_not_symmetric(self):
        expected = Forecast.of(Work.counted(self.BIG, NOTHING), "superlu")
        with deadline(0.6 * expected.seconds), pytest.raises(FactorisationError):
            check_limits(self.BIG, NOTHING, "superlu", 1, "", symmetric=False)

    def test_long_ones_are_told_before(self):
        heard = []
        band = [np.ones(200_000)] * 21
        long = csc_array(diags_array(band, offsets=np.arange(-10, 11), shape=(200_000, 200_000)))
        with listening(heard.append):
            check_limits(grid(20, 20), NOTHING, "superlu", 1, "")
            check_limits(long, NOTHING, "superlu", 1, "")
        assert [each.method for each in heard] == ["superlu"]
        assert "200000 unknowns" in heard[0].stage

    def test_factorise_refuses_before_it_begins(self):
        with deadline(1e-2), pytest.raises(FactorisationError) as caught:
            factorise(self.BIG, NOTHING, "superlu")
        assert caught.value.reason == "time"
        assert "PARDISO" in str(caught.value)


class TestProgress:
    """Off a terminal: plain lines, once work is large or long."""

    def test_long_work_has_a_line_now_and_then(self, capfd):
        with progress_line.solving("plate", silence=0.01):
            report(Progress("condensed"))
            err = ""
            while err.count("\n") < 2:
                err += capfd.readouterr().err
        assert all(line.startswith("plate: ") for line in err.splitlines())
