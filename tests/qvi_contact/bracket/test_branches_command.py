"""The command `qvi-contact branches`."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from qvi_contact import InputError, load_result, save_problem
from qvi_contact.cli import group
from qvi_contact.gallery import compressed_plate, ssnv128
from qvi_contact.units import Units
from qvi_contact.verification.verification import verify_file

EXAMPLES = Path(__file__).parents[3] / "examples"


def run(*arguments):
    """Its answer; `return_value` is the exit status."""
    return CliRunner().invoke(group, ["branches", *map(str, arguments)], standalone_mode=False)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """SSNV128 with μ = 5 on 8 × 8 rectangles, where it has three solutions, and what the command writes of it."""
    folder = tmp_path_factory.mktemp("branches")
    save_problem(folder / "problem.toml", ssnv128((8, 8), 5.0), units=Units("m", "Pa"))
    files = "--npz", folder / "nearest.npz", "--save-json", folder / "all.json"
    answer = run(folder / "problem.toml", "--element", "bfs", *files)
    assert answer.return_value == 0
    return folder, answer.output


def test_a_row_for_each_solution_with_units(files):
    folder, output = files
    solutions = json.loads((folder / "all.json").read_text("utf-8"))["solutions"]
    rows = [line.split() for line in output.splitlines() if line[:1].isdigit()]
    assert [row[0] for row in rows] == ["1", "2", "3"]
    shears = [solution["contacts"]["base"]["tangential_force"]["value"] for solution in solutions]
    assert [float(row[4]) for row in rows] == pytest.approx(shears, rel=1e-5)
    distances = [solution["distance"] for solution in solutions]
    assert distances == sorted(distances)
    assert [float(row[1]) for row in rows] == pytest.approx([100.0 * each for each in distances], rel=0.05)
    assert "N/m" in output
    assert "[stress" not in output


def test_the_nearest_is_written(files):
    folder, _ = files
    written = load_result(folder / "nearest.npz")
    nearest = json.loads((folder / "all.json").read_text("utf-8"))["solutions"][0]
    assert written.contacts["base"].tangential_force == nearest["contacts"]["base"]["tangential_force"]["value"]
    assert verify_file(folder / "nearest.npz").passed


def test_one_solution_alone(tmp_path):
    save_problem(tmp_path / "plate.toml", compressed_plate(2))
    answer = run(tmp_path / "plate.toml", "--json")
    document = json.loads(answer.output)
    assert answer.return_value == 0
    assert [solution["distance"] for solution in document["solutions"]] == [None]
    assert document["solutions"][0]["status"] == "solved"


def test_a_load_that_is_not_carried_ends_with_1():
    answer = run(EXAMPLES / "dragged_block_slides.toml", "--json")
    assert answer.return_value == 1
    assert json.loads(answer.output)["solutions"][0]["status"] == "infeasible"


def test_a_history_is_refused():
    with pytest.raises(InputError, match="history"):
        CliRunner().invoke(group, ["branches", str(EXAMPLES / "cyclic_shear.toml")], catch_exceptions=False)
