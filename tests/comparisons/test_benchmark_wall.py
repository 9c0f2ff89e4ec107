"""Walls of many blocks: what the command measures, and the report of it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from comparisons.benchmark.measures import wall_values, walls_of
from comparisons.benchmark.report import wall_report
from comparisons.benchmark.wall import wall
from comparisons.cli import group
from comparisons.lab.study import StoredStudy, read_csv
from qvi_contact import solve

COMMITTED = Path(__file__).parents[2] / "comparisons" / "reports" / "benchmark"


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The document of a tiny run, and its rows."""
    folder = tmp_path_factory.mktemp("walls")
    words = ["benchmark", "--problem", "wall", "--blocks", "2", "--load", "0.3", "--json", "--out", str(folder)]
    done = CliRunner().invoke(group, [*words, "--store", str(folder / "store")], catch_exceptions=False)
    assert done.exit_code == 0
    rows = StoredStudy({}, read_csv(folder / "benchmark-wall.csv.gz"))
    assert wall_report(rows).text == (folder / "benchmark-wall.md").read_text(encoding="utf-8")
    return json.loads(done.stdout), rows


def test_every_wall_is_a_certified_row(ran):
    document, rows = ran
    assert [(row["blocks"], row["load"]) for row in document["walls"]] == [(2, 0.3)]
    assert "`python -m comparisons benchmark --problem wall --blocks 2 --load 0.3" in wall_report(rows).text
    for row in document["walls"]:
        assert row["status"] == "solved"
        assert row["contact_points"] == 4 * 4 * 2 * 2  # four an edge, four edges a block
        assert row["ratio"] == pytest.approx(row["solve"] / row["factorisation"])
        assert row["peak"] > 2**24


@pytest.mark.parametrize("element", ["bfs", "hct"])
def test_the_wall_carries_its_weight_and_the_load(element):
    blocks, load = 3, 0.3
    results = [
        solve(wall(blocks, load), element=element, method="condensed", system=system) for system in ("sparse", "dense")
    ]
    weight = 24.0 * blocks**2
    for result in results:
        assert result.contacts["bottom"].normal_force == pytest.approx(weight, rel=1e-9)
        assert abs(result.contacts["bottom"].tangential_force) == pytest.approx(load * weight, rel=1e-9)
    forms = [result.solution.form for result in results]
    assert forms == ["full", "condensed"]


def test_growth_and_targets_are_those_of_the_rows(ran):
    (row,) = ran[1].rows
    rows = [
        replace(row, case=row.case | {"blocks": size}, result=row.result | {"solve": each, "factorisation": each / 30})
        for size, each in ((2, 0.1), (4, 0.1 * 4**1.5))
    ]
    text = wall_report(StoredStudy({}, tuple(rows))).text
    assert "30.0 times one factorisation of K (target ≤ 45: met)" in text
    assert "1.50 (target ≤ 1.3: missed; 1.50 at most between neighbours" in text


def test_elements_and_sizes_have_numbers_of_their_own(ran):
    """From 2 to 8 blocks a side the exponent is the mean of those of the two pairs; triangles are not rectangles."""
    (row,) = ran[1].rows
    rows = [
        replace(
            row,
            case=row.case | {"blocks": size, "element": element},
            result=row.result | {"solve": each, "factorisation": 0.01 if element == "bfs" else 0.1},
        )
        for element in ("hct", "bfs")
        for size, each in ((2, 0.1), (4, 0.1 * 4**1.5), (8, 0.1 * 4**2.5))
    ]
    rows[2] = replace(rows[2], status="timeout", reason="late", result={})
    values = wall_values(walls_of(rows))
    rectangles, triangles = values["targets"]
    assert (rectangles["element"], triangles["element"]) == ("bfs", "hct")
    assert (rectangles["exponent"], rectangles["steepest"]) == pytest.approx((1.25, 1.5))
    assert np.isnan(triangles["exponent"])
    assert (rectangles["ratio"], triangles["ratio"]) == pytest.approx((10 * 4**2.5, 4**1.5))
    assert [(each["walls"], each["solved"]) for each in values["solved"]] == [(3, 3), (3, 2)]


def test_a_wall_that_was_not_finished_stands_beside_others(ran):
    """Its numbers are missing, and what others have as a text is no number."""
    (row,) = ran[1].rows
    lost = replace(row, status="timeout", reason="late", result={})
    text = wall_report(StoredStudy({}, (row, lost))).text
    assert "timeout" in text
    assert "late" in text
    assert "nan" not in text


def test_the_committed_report_is_that_of_the_committed_rows():
    rows = StoredStudy({}, read_csv(COMMITTED / "benchmark-wall.csv.gz"))
    assert wall_report(rows).text == (COMMITTED / "benchmark-wall.md").read_text(encoding="utf-8")
    values = wall_values(walls_of(rows.rows))
    assert [(each["load"], round(each["ratio"], 1), round(each["exponent"], 2)) for each in values["targets"]] == [
        (0.02, 12.1, 1.20), (0.3, 33.7, 1.34), (0.02, 10.1, 1.24), (0.3, 16.1, 1.27)
    ]  # fmt: skip
    assert [(each["element"], each["walls"], each["solved"]) for each in values["solved"]] == [
        ("bfs", 12, 11), ("hct", 12, 12)
    ]  # fmt: skip


@pytest.mark.parametrize("wrong", [("--blocks", "0"), ("--element", "q2"), ("--load", "-0.1")])
def test_bad_settings_are_refused(wrong):
    done = CliRunner().invoke(group, ["benchmark", "--problem", "wall", *wrong])
    assert done.exit_code == 2
    assert f"Invalid value for '{wrong[0]}'" in done.stderr
