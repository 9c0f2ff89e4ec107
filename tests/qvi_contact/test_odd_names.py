"""Contacts and units may be called anything: pictures, pages, files and messages show the name as it is."""

import re
from dataclasses import dataclass, replace
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.text import Text

from qvi_contact import Contact, InputError, Material, save_problem, solve
from qvi_contact.cli import main
from qvi_contact.export import write_contacts_vtu, write_vtu
from qvi_contact.gallery import compressed_plate
from qvi_contact.plots import (
    history_figure,
    problem_figure,
    result_figure,
    save_figure,
)
from qvi_contact.units import Units
from solvers.errors import plain

FORMULA = r"$\foo$"
UNITS = Units(r"$\bar$", '<b & "c">\'')


@pytest.fixture(scope="module")
def result():
    plate = compressed_plate(0.2, (2, 2))
    named = [replace(each, name=FORMULA) if isinstance(each, Contact) else each for each in plate.conditions]
    return solve(replace(plate, conditions=named), degree=3)


def shown(figure, path):
    """The texts of a picture as it is written."""
    save_figure(path, figure)
    return [text.get_text() for text in figure.findobj(Text)]


@pytest.mark.parametrize(
    "drawn",
    [
        lambda result: result_figure(result, UNITS),
        lambda result: problem_figure(result.problem, UNITS),
        lambda _: history_figure({FORMULA: ([0.0, 1.0], [0.0, 2.0])}, UNITS),
    ],
    ids=["result", "problem", "history"],
)
def test_pictures_show_dollar_signs(result, drawn, tmp_path):
    texts = shown(drawn(result), tmp_path / "picture.svg")
    assert any(r"\$\bar\$" in text for text in texts)
    assert not any(re.search(r"(?<!\\)\$\\(foo|bar)", text) for text in texts)


def test_a_page_is_written_with_a_name_that_looks_like_a_formula(result, tmp_path, monkeypatch):
    save_problem(tmp_path / "odd.toml", result.problem, title=FORMULA, units=UNITS)
    page = tmp_path / "page.html"
    command = ["qvi-contact", "solve", str(tmp_path / "odd.toml"), "--report", str(page), "--plot", str(page) + ".png"]
    monkeypatch.setattr("sys.argv", command)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    assert FORMULA in page.read_text(encoding="utf-8")


def test_names_of_fields_in_vtu_files_are_those_given(result, tmp_path):
    meshio = pytest.importorskip("meshio")
    for write in (write_vtu, write_contacts_vtu):
        path = tmp_path / "fields.vtu"
        write(path, result, UNITS)
        names = {array.get("Name") for array in ElementTree.parse(path).iter("DataArray")}
        assert any(UNITS.stress in name for name in names)
        assert any(UNITS.length in name for name in names)
        assert set(meshio.read(path).point_data) <= names


@dataclass
class _Pair:
    first: object
    second: object


@pytest.mark.parametrize("number", [np.float64(0.25), np.float32(0.25), np.int64(3), np.bool_(True)])
def test_numbers_in_messages_are_plain(number):
    own = repr(number.item())
    assert plain(number) == own
    assert plain([number, (number,)]) == f"[{own}, ({own},)]"
    assert plain({"a": number}) == f"{{'a': {own}}}"
    assert plain(_Pair(number, 1)).endswith(f"first={own}, second=1)")
    assert str(InputError("field", (number, number), "remedy")) == f"field: ({own}, {own}): remedy"


def test_texts_and_paths_in_messages_are_as_they_were():
    assert plain("np.float64(3)") == "'np.float64(3)'"
    assert plain(None) == "None"


def test_a_computed_number_is_refused_with_its_value():
    with pytest.raises(InputError, match=r"Material\.young: -1\.0: "):
        Material(np.float64(-1.0), 0.3)
