"""The page of formats has each key and each entry that files have, and no other."""

import re
from pathlib import Path

import pytest

from qvi_contact import Contact, ContactProblem, Material, RigidPlate, Traction, TriangleMesh, load_result, solve
from qvi_contact.files import FORMAT_VERSION, Archive, summary, write_npz

PAGE = (Path(__file__).parent.parent / "docs" / "formats.md").read_text(encoding="utf-8")
NAMES = {"base": "CONTACT", "plate": "CONTACT"}
GROUPS = {"measures": "MEASURE", "limits": "MEASURE", "signed": "MEASURE", "seconds": "STAGE", "versions": "PACKAGE",
          "resultants": "EDGES"}  # fmt: skip


def on_page(heading):
    """Names in the first column of the table below a heading → its second column."""
    table = PAGE.split(f"## {heading}")[1].split("\n\n|")[1].split("\n\n")[0]
    rows = [row.strip("| ").split(" | ") for row in table.splitlines() if row.strip("| ").startswith("`")]
    return {name: row[1] for row in rows for name in re.findall(r"`([^`]+)`", row[0])}


@pytest.fixture(scope="module")
def result():
    """With a fluid, a plate, and an iteration that has inner problems."""
    contacts = [
        Contact("bottom", 0.5, pore_pressure=0.5, name="base"),
        Contact("top", 0.8, plate=RigidPlate(force_x=0.5, force_y=-10.0), name="plate"),
    ]
    free = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    problem = ContactProblem(TriangleMesh.rectangle((2, 2)), Material(1e4, 0.2), [*contacts, *free])
    return solve(problem, inner="qp:clarabel")


def kind(value):
    if isinstance(value, dict):
        return "quantity"
    kinds = {bool: "true or false", int: "whole number", float: "number", str: "text", list: "list of texts",
             type(None): "null"}  # fmt: skip
    return kinds[type(value)]


def flat(document, path=()):
    """Keys of a document with dots between them, names of the problem as on the page → kind of value."""
    for key, value in document.items():
        shown = NAMES.get(key, key) if path and path[0] in ("contacts", "plates") else key
        shown = GROUPS.get(path[-1], shown) if path else shown
        if isinstance(value, dict) and value.keys() != {"value", "unit"}:
            yield from flat(value, (*path, shown))
        else:
            yield ".".join((*path, shown)), kind(value)


def test_json_has_the_keys_of_the_page(result):
    found, page = dict(flat(summary(result))), on_page("JSON")
    assert found.keys() == page.keys()
    assert [key for key, value in found.items() if value not in page[key].split(" or ") and value != page[key]] == []


def test_archives_have_the_entries_of_the_page_in_its_shapes(result, tmp_path):
    write_npz(tmp_path / "a.npz", result)
    arrays, page = Archive(tmp_path / "a.npz").arrays, on_page("NumPy archive")
    found = {re.sub(r"^(base|plate)\.", "CONTACT.", name) for name in arrays}
    assert found == page.keys()
    assert f"`format_version` {FORMAT_VERSION}." in PAGE
    assert int(arrays["format_version"]) == FORMAT_VERSION
    assert load_result(tmp_path / "a.npz").status == result.status

    shapes = {}
    table = PAGE.split("## NumPy archive")[1].split("\n\n|")[1].split("\n\n")[0]
    for row in table.splitlines()[2:]:
        names, shown = row.strip("| ").split(" | ")[:2]
        names = re.findall(r"`([^`]+)`", names)
        given = re.findall(r"\([^)]*\)(?: texts| or \([^)]*\))?|text", shown)
        shapes |= dict(zip(names, given * (len(names) if len(given) == 1 else 1), strict=True))
    for name, array in arrays.items():
        shown = shapes[re.sub(r"^(base|plate)\.", "CONTACT.", name)]
        wanted = {0 if one in ("text", "()") else len(re.findall(r"[^(),]+", one.split(")")[0]))
                  for one in shown.split(" or ")}  # fmt: skip
        assert array.ndim in wanted, name
        assert (array.dtype.kind == "U") == ("text" in shown), name
