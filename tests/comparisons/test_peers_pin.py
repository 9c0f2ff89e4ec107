"""The loaded pin by displacement codes: the same data for every code, and the same displacement."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from comparisons.lab.study import read_csv
from comparisons.peers.codes import own_pin
from comparisons.peers.pin import report as reports
from comparisons.peers.pin.study import MODELS, OWN, plain_pin, run

COMMITTED = Path(reports.__file__).parents[2] / "reports" / "peers"
MOVED = {0.0: 0.758518, 0.1: 0.738677}
"""u_x [mm] of the sheet on the axis, by NGSolve with degree 4 on twice as many edges."""


def test_plain_data_are_the_gallerys_pin():
    """Areas and sides of half an eye with its pin; the load's traction times its length is the force."""
    plain = plain_pin(0.1, 4)
    places = {name: np.array(plain["vertices"])[pairs] for name, pairs in plain["sides"].items()}
    assert np.hypot(*places["hole"].T) == pytest.approx(50.0)
    assert np.hypot(*places["eye"].T) == pytest.approx(100.0)
    assert np.abs(places["axis"][..., 1]).max() < 1e-12
    load = np.linalg.norm(np.diff(places["load"], axis=1), axis=-1).sum()
    assert plain["traction"] * load == pytest.approx(plain["force"])
    a, b, c = np.array(plain["vertices"])[np.array(plain["cells"]).T]
    assert np.all(np.linalg.det(np.stack([b - a, c - a], axis=-1)) > 0.0)


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_triangles_move_as_far_as_ngsolve_says(friction):
    """Half a thousandth on four edges in a quarter; the force is carried to rounding."""
    found = own_pin.build(plain_pin(friction, 4), degree=4)()
    assert found["moved"] == pytest.approx(MOVED[friction], rel=5e-4)
    assert found["carried"] == pytest.approx(1e4, rel=1e-9)


@pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
def test_ngsolve_moves_as_far_on_the_same_triangles():
    """In a process of its own, as the study runs it."""
    name = next(name for name, (code, *_) in MODELS.items() if code == "ngsolve")
    found = run({"friction": 0.1, "sectors": 4, "model": name})
    assert found["moved"] == pytest.approx(MOVED[0.1], rel=2e-3)
    assert found["carried"] == pytest.approx(1e4, rel=1e-6)


@pytest.fixture(scope="module")
def rows():
    return read_csv(COMMITTED / "peers-pin.csv.gz")


def test_a_run_that_ends_without_numbers_is_shown_and_not_compared(rows):
    """The one of this package: without it there is nothing to compare with."""
    late = {"status": "timeout", "reason": "more than 1 s", "result": {}}
    ended = [replace(row, **late) if row.case["model"] == OWN and row.case["friction"] == 0.1 else row for row in rows]
    made = reports.report(ended)
    assert made.text.count("more than 1 s") == 2
    assert ("At μ = 0 the sheet" in made.text, "At μ = 0.1 the sheet" in made.text) == (True, False)
    (first, _) = [row for row in reports.document_of(ended, made)["rows"] if row["status"] == "timeout"]
    assert (first["moved"], first["unknowns"], first["message"]) == (None, None, "more than 1 s")


def test_the_committed_rows_agree_and_make_the_committed_report(rows):
    """On twelve edges in a quarter this package and NGSolve of degree 4 differ by a hundred-thousandth."""
    found = {
        (row.case["model"], row.case["friction"]): row.result["moved"] for row in rows if row.case["sectors"] == 12
    }
    for friction, moved in MOVED.items():
        assert found["NGSolve, p = 4", friction] == pytest.approx(moved, rel=3e-6)
        assert found["triangles, p = 4", friction] == pytest.approx(found["NGSolve, p = 4", friction], rel=1.1e-5)
    assert reports.report(rows).text == (COMMITTED / "peers-pin.md").read_text(encoding="utf-8")
