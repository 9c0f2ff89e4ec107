"""The command `qvi-contact bracket`, its documents and pictures."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from qvi_contact import Contact, InputError, solve
from qvi_contact.bracket import document, lines
from qvi_contact.cli import group
from qvi_contact.gallery import compressed_plate
from qvi_contact.plots import bracket_figure
from qvi_contact.units import Units

EXAMPLES = Path(__file__).parents[3] / "examples"


def command(*words):
    return CliRunner().invoke(group, ["bracket", *map(str, words)], standalone_mode=False)


@pytest.mark.usefixtures("outlined")
def test_guaranteed_example_with_all_files(tmp_path):
    """A stack of blocks that only friction holds along its joints: the bounds, picture and displacements."""
    picture, fields = tmp_path / "apart.svg", tmp_path / "moved.vtu"
    done = command(EXAMPLES / "stacked_blocks.toml", "--plot", picture, "--vtk", fields)
    assert done.return_value == 0
    assert "as friction alone holds a body" in done.stdout
    assert picture.stat().st_size > 1000
    assert b"displacement" in fields.read_bytes()


def test_one_json_document():
    done = command(EXAMPLES / "compressed_plate.toml", "--json", "--degree", 3)
    found = json.loads(done.stdout)
    bounds = found["bracket"]["energies"]
    assert done.return_value == 0
    assert bounds["lower"]["value"] < bounds["upper"]["value"]
    assert found["bracket"]["coulomb"]["kind"] == "guaranteed"
    assert 0.0 < found["bracket"]["coulomb"]["solutions_apart"] < 0.5
    assert found["bracket"]["companion"]["degree"] == 3
    assert found["status"] == "solved"


@pytest.mark.parametrize(
    ("words", "field"),
    [((EXAMPLES / "cyclic_shear.toml",), "history"), ((EXAMPLES / "punch.toml", "--degree", 7), "degree"),
     ((EXAMPLES / "punch.toml", "--tolerance", 0.5), "tolerance")],
)  # fmt: skip
def test_refusals(words, field):
    done = command(*words)
    assert isinstance(done.exception, InputError)
    assert field in str(done.exception)


class TestDocument:
    """What is said about one bracket."""

    def test_forces_and_parts(self):
        found = solve(compressed_plate(0.5, (4, 4))).bracket
        told = document(found, Units(length="mm", stress="MPa"))
        force = found.forces["plate.normal_force"]
        assert told["forces"]["plate.normal_force"] == {"lower": force.lower, "upper": force.upper, "unit": "MPa mm"}
        assert sum(part["value"] for part in told["gap"].values()) == pytest.approx(found.gap, rel=1e-6)
        assert any("plate.normal_force between" in line for line in lines(found))

    def test_bounds_under_slip_and_differences_of_forces(self):
        text = "\n".join(lines(solve(compressed_plate(0.1, (2, 2)), degree=4).bracket))
        for words in ("forces of plate differ by", "plate.normal_force between"):
            assert words in text

    def test_exact_states_are_drawn_and_told_in_one_line(self):
        found = solve(compressed_plate(0.0, (2, 2))).bracket
        texts = bracket_figure(found, title="No gap").findobj(lambda artist: hasattr(artist, "get_text"))
        assert any(text.get_text().startswith("No gap") for text in texts)
        assert "\n" not in repr(found)
        assert len(repr(found)) < 400


def test_tresca_contact_with_a_wavy_bound_says_so():
    plate = compressed_plate(0.0, (3, 3))
    wavy = Contact.tresca("top", lambda x, y: 20.0 * np.abs(np.sin(5.0 * x)) + 0.0 * y, gap=-1e-3, name="plate")
    found = solve(replace(plate, conditions=[*plate.conditions[:3], wavy])).bracket
    assert not found.guaranteed
    assert sum("bound" in reason for reason in found.reasons) == 1
