"""What the paper command must show: Table 1, Figures 2-5, every back end beside the converged solution, findings.

The study runs once in a process; with pytest-xdist, `--dist loadfile` keeps the tests that share it in one.
"""

import contextlib
import csv
import ctypes
import dataclasses
import io
import json
import os
import re
import sys
import tempfile
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from comparisons.cli import group
from comparisons.lab.report import drawing, show
from comparisons.paper import figures, measures, report, study
from comparisons.paper.reference import load
from qvi_contact import ContactResult, InputError
from qvi_contact.basics import terminal
from qvi_contact.plots.style import new_figure
from solvers import Status, available

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
            result = study.run(lambda description="": steps.append(description))
            ctypes.CDLL(None).fflush(None)  # what compiled solvers have printed
        finally:
            os.dup2(before, 1)
            os.close(before)
        caught.seek(0)
        return result, steps, printed.getvalue() + caught.read().decode()


@pytest.fixture(scope="module")
def paper(run):
    return run[0]


@pytest.fixture(scope="module")
def written(paper, tmp_path_factory):
    """The report's files by name."""
    folder = tmp_path_factory.mktemp("report")
    _, paths = report.write(paper, folder)
    assert sorted(paths) == sorted(folder.iterdir())  # no temporary file stays
    return {path.name: path for path in paths}


@pytest.fixture
def stored(monkeypatch, paper):
    """The command line with the computation replaced by its stored result, and all pictures by empty ones."""
    monkeypatch.setattr(study, "run", lambda _: paper)
    monkeypatch.setattr(report, "PICTURES", dict.fromkeys(report.PICTURES, empty_picture))


def empty_picture(_):
    """A figure that is quick to write."""
    return new_figure(1.0, 1.0)


def command(capfd, *arguments):
    """Exit status, standard output and standard error of `python -m comparisons …` in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    return caught.value.code, *capfd.readouterr()


def silent(description=""):
    """Take no notice of progress."""


def altered(result, factor=1.0, **changes):
    """A result whose stress is multiplied, or whose solution has other attributes."""
    solution = dataclasses.replace(result.solution, **{"z": factor * result.solution.z, **changes})
    return ContactResult(result.discretization, solution)


def doctored(paper, friction, **changes):
    """The study with other results in one row."""
    rows = [dataclasses.replace(row, **changes) if row.friction == friction else row for row in paper.rows]
    return dataclasses.replace(paper, rows=tuple(rows))


def with_back_end(paper, name, friction, factor, **changes):
    """The study with one run of one back end altered."""
    row = paper.row(friction)
    return doctored(paper, friction, back_ends={**row.back_ends, name: altered(row.back_ends[name], factor, **changes)})


class TestNumbers:
    """Printed digits and agreement."""

    def test_data_are_those_of_the_paper(self):
        reference = load()
        assert {mu: f"{value:.2f}" for mu, value in reference.table.items()} == TABLE_1
        assert {n: (mu, f"{value:.2f}") for mu, (n, value) in reference.figures.items()} == FIGURES
        assert (reference.young, reference.poisson, reference.cells) == (2.09e5, 0.3, 2)
        assert (reference.displacement, reference.iterations, reference.omega_T) == (1e-3, 30, 1e-5)
        assert reference.exact_without_friction == pytest.approx(reference.young * reference.displacement)

    def test_accumulating_rule_gives_every_digit_of_table_1(self, paper):
        assert {row["friction"]: f"{row['uzawa_30']:.2f}" for row in measures.table_rows(paper)} == TABLE_1
        assert {row.uzawa.iterations for row in paper.rows} == {30}

    def test_printed_rule_differs_without_friction_only(self, paper):
        found = {row["friction"]: f"{row['uzawa_30_printed_rule']:.2f}" for row in measures.table_rows(paper)}
        assert found == {**TABLE_1, 0.0: "210.23"}

    def test_maxima_of_the_figures(self, paper):
        found = {row["figure"]: (row["friction"], f"{row['uzawa_30']:.2f}") for row in measures.figure_rows(paper)}
        assert found == FIGURES

    def test_converged_maxima(self, paper):
        converged = {row["friction"]: row["converged"] for row in measures.figure_rows(paper)}
        assert converged[0.0] == pytest.approx(209.0, rel=1e-8)  # uniform
        assert converged[0.1] < 237.19 * 0.98  # the paper's state is not converged

    def test_methods_agree(self, paper):
        for row in measures.table_rows(paper):
            solution = row["fixed_point_qp"]
            assert row["fixed_point_socp"] == pytest.approx(solution, rel=1e-7)
            assert row["condensed"] == pytest.approx(solution, rel=1e-9)
            assert row["uzawa_converged"] == pytest.approx(solution, rel=1e-7)

    def test_without_friction_the_force_is_exact(self, paper):
        row = measures.table_rows(paper)[0]
        for name in ("uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed"):
            assert f"{row[name]:.6f}" == "209.000000"

    def test_strict_bounds_change_little_and_nothing_without_slip(self, paper):
        """Within a tenth of a percent; equal where nothing slips or nothing rubs; and kept between the points."""
        rows = measures.table_rows(paper)
        for row, found in zip(rows, paper.rows, strict=True):
            assert found.strict.status is Status.SOLVED
            assert row["strict"] == pytest.approx(row["condensed"], rel=1e-3)
            assert found.strict.contacts["plate"].excess_between_points <= 1e-8 * 209.0
            assert found.strict.solution.problem.strict
        assert rows[0]["strict"] == pytest.approx(209.0, rel=1e-9)
        assert rows[-1]["strict"] == pytest.approx(rows[-1]["condensed"], rel=1e-9)
        assert abs(rows[2]["strict"] - rows[2]["condensed"]) > 1e-5

    def test_constant_step_without_friction_cycles(self, paper):
        assert sorted(f"{force:.3f}" for force in paper.cycle) == ["208.981", "209.152"]

    def test_every_back_end_on_every_problem(self, paper):
        assert [row.friction for row in paper.rows] == list(TABLE_1)
        for row in paper.rows:
            assert tuple(row.back_ends) == available()
            for name, result in row.back_ends.items():
                limit = 1e-5 if name in LIMITED else 1e-7
                assert study.half_force(result) == pytest.approx(study.half_force(row.reference), rel=limit), name
                assert study.traction_difference(result, row.reference) <= (1e-4 if name in LIMITED else 1e-5), name

    def test_all_but_the_limited_are_certified(self, paper):
        for row in measures.back_end_rows(paper):
            if row["solver"] not in LIMITED:
                assert row["verdict"] == "≤ 1e-07"
                assert row["certified"] == row["problems"] == 7
                assert row["accuracy"] <= 1e-8
                assert row["remark"] == ""

    def test_traction_difference_is_relative_to_the_mean_pressure(self, paper):
        row = paper.row(0.1)
        line = row.reference.contacts["plate"]
        mean = line.normal_force / 1.0
        largest = max(np.abs(line.normal_stress).max(), np.abs(line.tangential_stress).max())
        found = study.traction_difference(altered(row.reference, 1.01), row.reference)
        assert found == pytest.approx(0.01 * largest / mean, rel=1e-9)

    def test_progress_counts_each_step(self, run):
        assert len(run[1]) == study.step_count() == 7 * (1 + len(available()))
        assert run[1][0] == "μ = 0.00"
        assert f"μ = 0.30, {available()[-1]}" in run[1]

    def test_no_solver_prints(self, run):
        assert run[2] == ""


class TestDocument:
    """The JSON document."""

    def test_keys(self, paper):
        document = report.as_document(paper)
        required = {"friction", "paper", "uzawa_30"}
        methods = {"uzawa_converged", "fixed_point_qp", "fixed_point_socp", "condensed", "strict"}
        assert all(required | methods <= row.keys() for row in document["rows"])
        assert all(required | {"converged"} <= row.keys() for row in document["figures"])
        assert [row["friction"] for row in document["rows"]] == list(TABLE_1)
        assert [f"{row['paper']:.2f}" for row in document["rows"]] == list(TABLE_1.values())
        assert [(row["friction"], f"{row['paper']:.2f}") for row in document["figures"]] == list(FIGURES.values())
        assert len(document["findings"]) == 5

    def test_it_survives_json(self, paper):
        document = report.as_document(paper)
        assert json.loads(json.dumps(document, allow_nan=False)) == document

    def test_a_back_end_without_a_result_becomes_null(self, paper):
        broken = with_back_end(paper, "qp:osqp", 0.1, np.nan, status=Status.BACKEND_FAILED)
        document = json.loads(json.dumps(report.as_document(broken), allow_nan=False))
        (row,) = [row for row in document["back_ends"] if row["solver"] == "qp:osqp"]
        assert row["half_force_difference"] is None
        assert row["traction_difference"] is None
        assert row["verdict"] == "falls short"
        assert row["certified"] == 6

    @pytest.mark.usefixtures("stored")
    def test_command_prints_one_document_and_nothing_else(self, capfd, paper, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        status, out, err = command(capfd, "paper", "--json")
        assert (status, err) == (0, "")
        assert json.loads(out) == report.as_document(paper)
        assert list(tmp_path.iterdir()) == []  # without --out nothing is written

    @pytest.mark.usefixtures("stored")
    def test_command_writes_files_too_if_asked(self, capfd, paper, tmp_path):
        status, out, err = command(capfd, "paper", "--json", "--out", tmp_path / "new" / "folder")
        assert (status, err) == (0, "")
        assert json.loads(out) == report.as_document(paper)
        assert len(list((tmp_path / "new" / "folder").iterdir())) == 9


class TestVerdict:
    """How far a back end agrees, and what is said of it."""

    @pytest.mark.parametrize(
        ("factor", "verdict"),
        [(1.0, "≤ 1e-07"), (1 + 1e-6, "≤ 1e-05 only"), (1 - 1e-6, "≤ 1e-05 only"), (1.01, "falls short")],
    )
    @pytest.mark.parametrize("friction", [0.0, 0.3])
    def test_the_worst_problem_counts(self, paper, factor, verdict, friction):
        rows = measures.back_end_rows(with_back_end(paper, "qp:quadprog", friction, factor))
        found = {row["solver"]: row for row in rows}
        assert found["qp:quadprog"]["verdict"] == verdict
        assert found["qp:quadprog"]["half_force_difference"] == pytest.approx(abs(factor - 1), rel=1e-3, abs=1e-10)
        assert found["qp:clarabel"]["verdict"] == "≤ 1e-07"

    def test_tractions_count_beside_the_force(self):
        assert measures._verdict(1e-9, 1e-6) == "≤ 1e-07"
        assert measures._verdict(1e-9, 1e-3) != "≤ 1e-07"
        assert measures._verdict(1e-9, np.nan) != "≤ 1e-07"
        assert measures._verdict(np.nan, 1e-9) == "falls short"

    def test_uzawa_is_judged_like_the_back_ends(self, paper):
        row = paper.row(0.2)
        wrong = doctored(paper, 0.2, uzawa_converged=altered(row.uzawa_converged, 1.001))
        assert measures.back_end_rows(wrong)[-1]["solver"] == "uzawa"
        assert measures.back_end_rows(wrong)[-1]["verdict"] == "falls short"


class TestFindings:
    """The numbers of the sentences are computed."""

    def test_what_the_paper_shows(self, paper):
        values = measures.values_of(paper)
        assert (values["digits"], values["printed"], values["iterations"]) == (7, 7, 30)
        ((friction, ours),) = [(row["friction"], row["uzawa_30_printed_rule"]) for row in values["deviations"]]
        assert (friction, f"{ours:.2f}") == (0.0, "210.23")
        assert (values["off_at"], values["off"]) == (0.1, pytest.approx(0.0033, abs=5e-5))
        assert (f"{values['high']:.3f}", f"{values['low']:.3f}") == ("209.152", "208.981")
        assert (values["shrinking"], values["exact"]) == (pytest.approx(209.0, abs=1e-6), pytest.approx(209.0))

    def test_what_strict_bounds_change(self, paper):
        values = measures.values_of(paper)
        assert values["left"] <= 1e-8 < 1e-4 < values["excess"] < 0.1
        row = paper.row(values["change_at"])
        change = study.half_force(row.strict) / study.half_force(row.reference) - 1.0
        assert values["change"] == pytest.approx(change, rel=1e-6)
        assert 1e-6 < abs(change) < 1e-3

    def test_a_digit_that_is_missed(self, paper):
        wrong = doctored(paper, 0.05, uzawa=altered(paper.row(0.05).uzawa, 1.0001))
        assert measures.values_of(wrong)["digits"] == 6

    def test_other_deviations_of_the_printed_rule(self, paper):
        right = doctored(paper, 0.0, uzawa_printed_rule=paper.row(0.0).uzawa)
        assert measures.values_of(right)["deviations"] == []
        wrong = doctored(paper, 0.3, uzawa_printed_rule=paper.row(0.2).uzawa)
        assert [row["friction"] for row in measures.values_of(wrong)["deviations"]] == [0.0, 0.3]

    def test_another_worst_row(self, paper):
        values = measures.values_of(doctored(paper, 0.25, printed=100.0))
        off = 1.0 - 100.0 / study.half_force(paper.row(0.25).reference)
        assert (values["off_at"], values["off"]) == (0.25, pytest.approx(off))

    def test_another_limit(self, paper):
        wrong = doctored(paper, 0.0, uzawa_converged=altered(paper.row(0.0).uzawa_converged, 1.001))
        assert measures.values_of(wrong)["shrinking"] == pytest.approx(209.209)

    def test_back_ends_that_fall_short_are_named(self, paper):
        values = measures.values_of(paper)
        assert values["solvers"] == len(available()) + 1
        assert {name.split(" ")[0] for name in values["short"]} <= LIMITED
        wrong = measures.values_of(with_back_end(paper, "qp:osqp", 0.15, 1.01))
        assert set(wrong["short"]) == {*values["short"], "qp:osqp (falls short)"}

    def test_back_ends_without_certificate_are_named(self, paper):
        doubtful = with_back_end(paper, "qp:osqp", 0.15, 1.0, status=Status.INACCURATE, message="only nearly.")
        names = [set(measures.values_of(each)["doubtful"]) for each in (paper, doubtful)]
        assert names[1] - names[0] == {"qp:osqp (6/7)"}
        (row,) = [row for row in measures.back_end_rows(doubtful) if row["solver"] == "qp:osqp"]
        assert row["remark"] == "only nearly."


class TestFiles:
    """The report's files and its tables in the terminal."""

    def test_names(self, written):
        pictures = {f"paper-{name}.svg" for name in report.PICTURES}
        assert set(written) == pictures | set(report.TABLES) | {"paper.md", "paper.html"}

    def test_pictures(self, written):
        for name, path in written.items():
            if name.endswith(".svg"):
                root = ET.parse(path).getroot()
                assert root.tag == "{http://www.w3.org/2000/svg}svg"
                assert len(list(root.iter("{http://www.w3.org/2000/svg}path"))) > 10

    def test_tables_hold_the_data(self, written, paper):
        expected = {
            "table_1.csv": measures.table_rows(paper),
            "figures_2_to_5.csv": measures.figure_rows(paper),
            "back_ends.csv": measures.back_end_rows(paper),
        }
        for name, rows in expected.items():
            with written[name].open(encoding="utf-8", newline="") as file:
                read = list(csv.DictReader(file))
            assert len(read) == len(rows)
            for found, row in zip(read, rows, strict=True):
                assert list(found) == list(row)
                for key, value in row.items():
                    assert (found[key] if isinstance(value, str) else float(found[key])) == value

    @pytest.mark.usefixtures("outlined")
    def test_the_report_does_not_change_from_run_to_run(self, written, paper):
        assert report.report(paper).text == written["paper.md"].read_text(encoding="utf-8")

    def test_a_file_that_cannot_be_written(self, paper, tmp_path):
        (tmp_path / "file").write_text("", encoding="utf-8")
        with pytest.raises(InputError, match=r"table_1|cannot be written"):
            report.write(paper, tmp_path / "file")

    @pytest.mark.usefixtures("stored")
    def test_terminal(self, capfd, paper, tmp_path):
        status, out, err = command(capfd, "paper", "--out", tmp_path)
        assert (status, err) == (0, "")
        for mu, force in TABLE_1.items():
            assert re.search(rf"{mu:.2f} +{force} +{force} ", out)
        for number, (mu, stress) in FIGURES.items():
            assert re.search(rf"{number} +{mu:.2f} +{stress} +{stress} ", out)
        for row in measures.back_end_rows(paper):
            assert re.search(rf"{row['solver']} +{row['certified']}/7 .*{row['verdict']}", out)
        assert str(tmp_path) in out
        assert "…" not in out  # nothing is cut off

    @pytest.mark.usefixtures("stored")
    def test_report_goes_to_its_default_folder(self, capfd, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(report, "write", lambda made, folder: (report.report(made), [folder / "nothing"]))
        status, _, _ = command(capfd, "paper")
        assert status == 0
        assert (tmp_path / "results" / "paper").is_dir()


class TestPictures:
    """What the pictures show is computed."""

    def test_titles_of_the_stress_maps(self, paper):
        figure = figures.principal_stresses(paper)
        titles = [axes.get_title() for axes in figure.axes]
        for title, (number, (mu, stress)) in zip(titles[:4], FIGURES.items(), strict=True):
            assert title == f"Fig. {number}, μ = {mu:g}, Uzawa 30\nmax {stress}, printed {stress} MPa"
        for title, row in zip(titles[4:], measures.figure_rows(paper), strict=True):
            assert title == f"converged, μ = {row['friction']:g}\nmax {row['converged']:.2f} MPa"

    def test_wrong_states_change_the_titles(self, paper):
        wrong = doctored(paper, 0.1, uzawa=altered(paper.row(0.1).uzawa, 2.0))
        assert "max 474.3" in figures.principal_stresses(wrong).axes[1].get_title()

    def test_tractions_stay_below_the_bound(self, paper):
        axes = figures.contact_tractions(paper).axes
        for upper, lower in zip(axes[:4], axes[4:], strict=True):
            curves = [line for line in upper.lines if len(line.get_ydata()) > 8]  # others mark single points
            at = curves[0].get_markevery()  # the points of the contact
            pressure, bound, tangential = (line.get_ydata()[at] for line in curves)
            (used,) = (line.get_ydata() for line in lower.lines if len(line.get_ydata()) == 8)
            assert len(bound) == 8
            assert (tangential <= bound * (1 + 1e-6)).all()
            assert used == pytest.approx(tangential / bound)
            assert upper.get_ylim()[0] == 0.0
            assert max(pressure) < upper.get_ylim()[1]  # nothing is cut off

    def test_errors_fall_to_the_tolerance(self, paper):
        uzawa, fixed_point = figures.convergence(paper).axes
        for panel, most in ((uzawa, 3000), (fixed_point, 60)):
            curves = [line for line in panel.lines if str(line.get_label()).startswith("μ")]
            assert len(curves) == 3
            for curve in curves:
                number, error = curve.get_data()
                assert number[0] == 1
                assert number[-1] < most
                assert error[-1] < 1e-7 < 1e-5 < error[0]

    def test_table_1(self, paper):
        solution, uzawa, printed = figures.table_1(paper).axes[0].lines
        assert printed.get_ydata() == pytest.approx([float(force) for force in TABLE_1.values()])
        assert np.abs(uzawa.get_ydata() - printed.get_ydata()).max() < 0.0051
        assert solution.get_ydata() == pytest.approx([study.half_force(row.reference) for row in paper.rows])
        assert (np.array(solution.get_xdata()) == list(TABLE_1)).all()


def test_tables_come_without_matplotlib_too(paper, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(drawing, "has_matplotlib", lambda: False)
    made, written = report.write(paper, tmp_path)
    show(made, written)
    assert {path.name for path in written} == {*report.TABLES, "paper.md", "paper.html"}
    assert "pip install 'qvi-contact[plot]'" in capsys.readouterr().out
