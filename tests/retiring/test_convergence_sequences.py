"""Sequences on one factorisation: the task, the numbers of the findings, the committed report."""

from dataclasses import replace

import numpy as np
import pytest

from comparisons.convergence.sequences.report import report, runs_of, values_of
from comparisons.convergence.sequences.study import CHAINS, EVERY, WAYS, run
from tests.comparisons.convergence_parts import committed_rows, committed_text


@pytest.fixture(scope="module", name="rows")
def _rows():
    return committed_rows("sequences")


@pytest.mark.parametrize("sequence", ["cycle", "friction"])
def test_the_task_solves_in_all_ways(sequence):
    found = run({"sequence": sequence, "element": "bfs", "quick": True})
    problems = CHAINS[sequence].problems(quick=True)
    for way in WAYS:
        assert found[way]["status"] == ["solved"] * len(problems[:: EVERY if way == "single" else 1])
        assert all(second > 0.0 for second in found[way]["seconds"])
        assert max(found[way]["accuracy"]) < 1e-8
    assert found["warm"]["normal"] == pytest.approx(found["cold"]["normal"], rel=1e-9)


def test_ratios_are_over_single_solves(rows):
    row = next(row for row in rows if (row.case["sequence"], row.case["element"]) == ("friction", "hct"))
    count, few = len(row.result["warm"]["status"]), len(row.result["single"]["status"])
    times = {"single": [2.0] * few, "cold": [2.0] + [1.0] * (count - 1), "warm": [2.0] + [0.5] * (count - 1)}
    made = replace(row, result={way: {**row.result[way], "seconds": times[way]} for way in WAYS})
    runs = runs_of([made]).set_index("way")
    assert runs.later.to_dict() == {"single": 1.0, "cold": 0.5, "warm": 0.25}
    assert runs.whole["warm"] == pytest.approx(1.0 + 0.25 * (count - 1))


def test_numbers_of_the_findings(rows):
    values = values_of(runs_of(rows))
    assert (values["solved"], values["planned"]) == (286, 286)
    assert (values["cycle"], values["cycle_cold"]) == pytest.approx((0.22, 0.33), abs=0.005)
    assert (values["friction"], values["friction_cold"]) == pytest.approx((3.8, 4.3), abs=0.05)
    assert (values["least"], values["most"], values["depth"]) == pytest.approx((0.30, 0.42, 0.02), abs=0.005)
    assert values["accuracy"] == pytest.approx(1.7e-9, rel=0.03)
    assert values["force"] == pytest.approx(2.6e-10, rel=0.02)


def test_the_committed_report_is_that_of_the_committed_rows(rows):
    assert report(rows).text == committed_text("sequences")


def test_values_of_a_sequence_end_where_it_is_said():
    assert CHAINS["friction"].values[-1] == 1.0
    assert np.ptp(CHAINS["cycle"].values) == pytest.approx(0.02)
