"""Walls of many blocks: what the command measures, and the report of it."""

import json

import pytest
from click.testing import CliRunner

from comparisons.benchmark.wall import WallPlan, wall
from comparisons.benchmark.wall_report import report
from comparisons.cli import group
from qvi_contact import InputError, solve


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walls")
    words = ["benchmark", "--problem", "wall", "--blocks", "2", "--load", "0.3", "--json", "--out", str(folder)]
    done = CliRunner().invoke(group, words, catch_exceptions=False)
    assert done.exit_code == 0
    found = json.loads(done.stdout)
    assert json.loads((folder / "benchmark-wall.json").read_text(encoding="utf-8")) == found
    assert report(found).text == (folder / "benchmark-wall.md").read_text(encoding="utf-8")
    return found


def test_every_wall_is_a_certified_row(document):
    assert [(row["blocks"], row["load"], row["state"]) for row in document["walls"]] == [(2, 0.3, "opens and slips")]
    assert document["command"].startswith("python -m comparisons benchmark --problem wall --blocks 2 --load 0.3")
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


def test_growth_and_targets_are_those_of_the_rows(document):
    rows = [
        {**row, "blocks": size, "solve": 0.1 * size**3, "ratio": 30.0} for size in (2, 4) for row in document["walls"]
    ]
    text = report({**document, "walls": rows, "growth": [{"load": 0.3, "from": 2, "to": 4, "exponent": 1.5}]}).text
    assert "30.0 times one factorisation of K (target ≤ 45: met)" in text
    assert "1.50 at most (target ≤ 1.3: missed)" in text


def test_a_wall_that_was_not_finished_stands_beside_others(document):
    """Its numbers are missing, and what others have as a text is no number."""
    (row,) = document["walls"]
    lost = {
        **row,
        **dict.fromkeys(("form", "solve", "ratio", "iterations")),
        "status": "not finished",
        "message": "late",
    }
    text = report({**document, "walls": [{**row, "message": None}, lost]}).text
    assert "not finished" in text
    assert "late" in text
    assert "nan" not in text


@pytest.mark.parametrize("wrong", [{"blocks": (0,)}, {"threads": 0}, {"element": "q2"}, {"loads": (-0.1,)}])
def test_bad_plans_are_refused(wrong):
    with pytest.raises(InputError):
        WallPlan(**wrong)
