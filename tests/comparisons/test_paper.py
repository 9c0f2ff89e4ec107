"""What the paper command must show: Table 1, Figures 2-5, every back end beside the converged solution, findings.

The study runs once in a process; with pytest-xdist, `--dist loadfile` keeps the tests that share it in one.
"""

import contextlib
import csv
import ctypes
import io
import os
import re
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from comparisons.paper import study as room
from solvers import available
from tests.comparisons.conftest import command

TABLE_1 = {0.0: "209.15", 0.05: "210.67", 0.1: "212.05", 0.15: "212.86", 0.2: "213.44", 0.25: "213.81", 0.3: "213.89"}
FIGURES = {2: (0.0, "210.58"), 3: (0.1, "237.19"), 4: (0.2, "254.41"), 5: (0.3, "259.65")}
LIMITED = {"qp:ecos", "socp:ecos", "socp:cvxopt"}
"""Back ends that stop at about 1e-8 in the objective, so that P/2 is good to 1e-5 only."""


@pytest.fixture(scope="module")
def run():
    """The study, the descriptions of its steps, and what anything wrote to the process's standard output meanwhile."""
    steps, printed = [], io.StringIO()
    with tempfile.TemporaryFile() as caught, contextlib.redirect_stdout(printed):
        before = os.dup(1)
        os.dup2(caught.fileno(), 1)
        try:
            result = room.run(lambda description="": steps.append(description))
            ctypes.CDLL(None).fflush(None)  # what compiled solvers have printed
        finally:
            os.dup2(before, 1)
            os.close(before)
        caught.seek(0)
        return result, steps, printed.getvalue() + caught.read().decode()


@pytest.fixture(scope="module")
def paper(run):
    return run[0]


def altered(solution, factor):
    """A solution whose stress is multiplied."""
    return replace(solution, z=factor * solution.z)


def ends(paper):
    """Back end → its row."""
    return {row["solver"]: row for row in room.back_end_rows(paper)}


class TestNumbers:
    """Printed digits and agreement."""

    def test_rules_give_every_digit_of_table_1(self, paper):
        rows = room.table_rows(paper)
        assert {row["friction"]: f"{row['uzawa_30']:.2f}" for row in rows} == TABLE_1
        printed = {row["friction"]: f"{row['uzawa_30_printed_rule']:.2f}" for row in rows}
        assert printed == TABLE_1 | {0.0: "210.23"}
        theory = (Path(__file__).parents[2] / "docs" / "theory.md").read_text(encoding="utf-8")
        assert all(" | ".join(f"{row[each]:.2f}" for row in rows) in theory for each in ("uzawa_30", "condensed"))

    def test_maxima_of_the_figures(self, paper):
        rows = room.figure_rows(paper)
        assert {row["figure"]: (row["friction"], f"{row['uzawa_30']:.2f}") for row in rows} == FIGURES
        converged = {row["friction"]: row["converged"] for row in rows}
        assert converged[0.0] == pytest.approx(209.0, rel=1e-8)  # uniform
        assert converged[0.1] < 237.19 * 0.98  # the paper's state is not converged

    def test_methods_agree(self, paper):
        for row in room.table_rows(paper):
            solution = row["fixed_point_qp"]
            assert row["fixed_point_socp"] == pytest.approx(solution, rel=1e-7)
            assert row["condensed"] == pytest.approx(solution, rel=1e-9)
            assert row["uzawa_converged"] == pytest.approx(solution, rel=1e-7)
        without_friction = room.table_rows(paper)[0]
        for name in ("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed"):
            assert f"{without_friction[name]:.6f}" == "209.000000"

    def test_every_back_end_on_every_problem(self, paper):
        assert [row.friction for row in paper.rows] == list(TABLE_1)
        for row in paper.rows:
            assert tuple(row.back_ends) == available()
            for name, result in row.back_ends.items():
                limit = 1e-5 if name in LIMITED else 1e-7
                assert row.plate.force(result.z) == pytest.approx(row.plate.force(row.reference.z), rel=limit), name
                assert row.traction_difference(result) <= (1e-4 if name in LIMITED else 1e-5), name
        for name, row in ends(paper).items():
            if name not in LIMITED:
                assert (row["verdict"], row["certified"], row["problems"], row["remark"]) == ("≤ 1e-07", 7, 7, "")
                assert row["accuracy"] <= 1e-8

    def test_traction_difference_is_relative_to_the_mean_pressure(self, paper):
        row = paper.row(0.1)
        mean = row.plate.force(row.reference.z) / 1.0
        largest = np.abs(row.plate.tractions(row.reference.z)[1:]).max()
        found = row.traction_difference(altered(row.reference, 1.01))
        assert found == pytest.approx(0.01 * largest / mean, rel=1e-9)

    def test_progress_counts_each_step_and_no_solver_prints(self, run):
        _, steps, printed = run
        assert len(steps) == room.step_count() == 7 * (1 + len(available()))
        assert (steps[0], printed) == ("μ = 0.00", "")
        assert f"μ = 0.30, {available()[-1]}" in steps


class TestVerdict:
    """How far a back end agrees, and what is said of it."""

    @pytest.mark.parametrize(("factor", "verdict"), [(1 - 1e-6, "≤ 1e-05 only"), (1.01, "falls short")])
    def test_the_worst_problem_counts(self, paper, factor, verdict):
        last = paper.rows[-1]
        back_ends = {**last.back_ends, "qp:quadprog": altered(last.back_ends["qp:quadprog"], factor)}
        found = ends(replace(paper, rows=(*paper.rows[:-1], replace(last, back_ends=back_ends))))
        assert found["qp:quadprog"]["verdict"] == verdict
        assert found["qp:quadprog"]["half_force_difference"] == pytest.approx(abs(factor - 1), rel=1e-3, abs=1e-10)
        assert found["qp:clarabel"]["verdict"] == "≤ 1e-07"

    def test_tractions_count_beside_the_force(self):
        assert room.verdict(1e-9, 1e-6) == "≤ 1e-07"
        assert "≤ 1e-07" not in (room.verdict(1e-9, 1e-3), room.verdict(1e-9, np.nan))
        assert room.verdict(np.nan, 1e-9) == "falls short"


def test_principal_stresses_are_drawn_across_each_other(paper):
    """Both lines of a cross, pressed or pulled, where both stresses are large enough to be seen."""
    found = {}
    for number, axes in enumerate(room.principal_stresses(paper).axes):
        for ends in (
            ends for lines in axes.collections if hasattr(lines, "get_segments") for ends in lines.get_segments()
        ):
            found.setdefault((number, *ends.mean(axis=0).round(9)), []).append(ends[1] - ends[0])
    crosses = [np.array(lines) for lines in found.values() if len(lines) == 2]
    assert len(crosses) > 100
    assert max(abs(one @ other) / np.hypot(*one) / np.hypot(*other) for one, other in crosses) < 1e-9


def test_what_the_paper_shows(paper):
    values = room.values_of(paper)
    assert (values["digits"], values["printed"], values["iterations"]) == (7, 7, 30)
    ((friction, ours),) = [(row["friction"], row["uzawa_30_printed_rule"]) for row in values["deviations"]]
    assert (friction, f"{ours:.2f}") == (0.0, "210.23")
    assert (values["off_at"], values["off"]) == (0.1, pytest.approx(0.0033, abs=5e-5))
    assert (f"{values['high']:.3f}", f"{values['low']:.3f}") == ("209.152", "208.981")
    assert (values["shrinking"], values["exact"]) == (pytest.approx(209.0, abs=1e-6), pytest.approx(209.0))
    assert (values["excess_at"], f"{values['excess']:.4f}") == (0.1, "0.0120")


@pytest.mark.usefixtures("in_tmp_path", "outlined")
def test_terminal_and_the_default_folder_whose_tables_hold_the_data(paper, tmp_path, monkeypatch):
    monkeypatch.setattr("comparisons.paper.study.run", lambda _: paper)
    ended = command("paper")
    assert (ended.status, ended.err) == (0, "")
    written = {path.name: path for path in (tmp_path / "results" / "paper").iterdir()}
    report = {"paper.md", "paper.html", "paper-figures-2-to-5.svg"}
    assert set(written) == report | set(room.TABLES)  # no temporary file stays
    for name, rows_of in room.TABLES.items():
        with written[name].open(encoding="utf-8", newline="") as file:
            for found, row in zip(csv.DictReader(file), rows_of(paper), strict=True):
                assert list(found) == list(row)
                for key, value in row.items():
                    assert (found[key] if isinstance(value, str) else float(found[key])) == value
    for mu, force in TABLE_1.items():
        assert re.search(rf"{mu:.2f} +{force} +{force} ", ended.out)
    for number, (mu, stress) in FIGURES.items():
        assert re.search(rf"{number} +{mu:.2f} +{stress} +{stress} ", ended.out)
    for row in room.back_end_rows(paper):
        assert re.search(rf"{row['solver']} +{row['certified']}/7 .*{row['verdict']}", ended.out)
    assert "…" not in ended.out  # nothing is cut off
