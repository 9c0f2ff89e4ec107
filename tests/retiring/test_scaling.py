"""Sweeps shared by processes: the task, the numbers of the report."""

from pathlib import Path

import pytest

from comparisons.lab.study import Row, read_csv
from comparisons.scaling import report as reports
from comparisons.scaling.report import report, scaling_of, values_of
from comparisons.scaling.study import VALUES, declared, run

COMMITTED = Path(reports.__file__).parents[1] / "reports" / "scaling"


def rows_of(times):
    """Rows of a run that took so many seconds and so many of processor time with each number of processes."""
    for position, (processes, whole, used) in enumerate(times):
        case = {"processes": processes, "quick": False, "repeat": position}
        result = {"first": 1.0, "whole": whole, "used": used, "values": 100, "solved": 100 - position, "cores": 4}
        yield Row(position, str(position), case, "done", "", result, {}, whole, "2026-11-22", 0.5, {})


def test_the_task_counts_what_was_solved():
    found = run({"processes": 1, "quick": True})
    assert found["values"] == found["solved"] == VALUES[True]
    assert 0.0 < found["first"] < found["whole"]
    assert found["used"] > 0.0


def test_speed_and_efficiency():
    rows = list(rows_of([(1, 8.0, 8.0), (1, 12.0, 8.0), (4, 4.0, 12.0)]))
    found = scaling_of(rows).set_index("processes")
    assert found.whole.to_dict() == {1: 10.0, 4: 4.0}
    assert found.speed.to_dict() == {1: 1.0, 4: 2.5}
    assert found.efficiency.to_dict() == {1: 1.0, 4: 0.625}
    assert found.work.to_dict() == {1: 1.0, 4: 1.5}
    assert found.rate.to_dict() == {1: 10.0, 4: 25.0}
    values = values_of(scaling_of(rows))
    assert (values["few"], values["many"], values["cores"], values["solved"]) == (1, 4, 4, 98)
    assert values["each"] == pytest.approx(0.08)


def test_the_report_says_them():
    text = report(list(rows_of([(1, 10.0, 8.0), (2, 6.25, 12.0)]))).text
    assert "2 processes on 4 cores are 1.6 times as fast as 1: an efficiency of 80 %, with up to 0.5 programs" in text


def test_numbers_of_processes_are_those_asked_for():
    assert [case.values["processes"] for case in declared((4, 1, 4), quick=True).cases] == [4, 1]


@pytest.fixture(scope="module", name="committed")
def _committed():
    return read_csv(COMMITTED / "scaling.csv.gz")


def test_every_process_makes_its_own_factorisation_and_little_else(committed):
    """Processor time, which other programs on the machine change little."""
    values = values_of(scaling_of(committed))
    assert (values["few"], values["many"], values["solved"]) == (1, 2, values["values"])
    assert 1.0 < values["work"] < 1.3


def test_the_committed_report_is_that_of_the_committed_rows(committed):
    assert report(committed).text == (COMMITTED / "scaling.md").read_text(encoding="utf-8")
