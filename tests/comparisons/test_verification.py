"""The verification manual: its rows pass, wrong ones fail everywhere, and its files and pictures say the same.

Each problem of the quick run is run once in a process; with pytest-xdist, `--dist loadfile` keeps all tests in one.
"""

import math
import re
from dataclasses import replace
from functools import cache
from html import unescape

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from comparisons.verification import measures
from comparisons.verification import report as room
from comparisons.verification import rows as making
from qvi_contact import InputError, LimitLoad, TriangleMesh, solve
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import Contact, ContactProblem, Material, Symmetry, Traction
from solvers import Status
from tests.comparisons.conftest import REPORTS, command, outlines

SHOWN = {"rings": "[m]", "corner-rates": "[length]", "sliding-corner": "[length]"}
"""Problems whose bodies are drawn, and the unit of their axes: two files in other units, two without."""
PROOF = making.Proof(passed=True, text="by hand")
NO_PROOF = making.Proof(passed=False, text="none")
CHECK = making.Check(PROOF, "source")
PASSING = CHECK.absolute("a number", 1.0, 1.0, "by hand", tolerance=1e-3)
REASON = "ZeroDivisionError: the mesh has no <cells> | none"
STEEL = Material(1000.0, 0.3)
finite = st.floats(-1e6, 1e6, allow_subnormal=False)


def sound(quick):
    """A sound problem."""
    del quick
    yield PASSING


def breaks_off(quick):
    """A problem that ends <early>."""
    del quick
    yield PASSING
    raise ZeroDivisionError("the mesh has\n no <cells> | none")


def wrong(quick):
    """A problem whose reference is off by a thousandth, and one without a certificate."""
    del quick
    yield CHECK.absolute("moved", 1.0, 1.001, tolerance=1e-4)
    yield replace(PASSING, proof=NO_PROOF)


def empty(quick):
    """An empty problem."""
    del quick
    yield from ()


def ran(problems):
    """The document of a run of these problems."""
    return room.run({"paper": problems}, quick=True, advance=lambda _="": None)


DOCUMENT = ran({"number": sound})
LONG = {
    "bounds-slip", "bounds-refined", "loaded-pin", "peaks",
    "slip-torque", "examples/lug", "examples/cyclic_shear", "examples/dam_on_seam", "examples/masonry_wall",
    "examples/shrink_fit", "examples/ssnv128", "examples/strip_footing", "figures-2-to-5",
}  # fmt: skip
"""Problems that take most of the time of a quick run, which the command has, or that other tests have whole."""


SHORT = [(chapter, name) for chapter, problems in room.CHAPTERS.items() for name in problems if name not in LONG]


@cache
def quickly(chapter, name):
    """A problem of the quick run."""
    (found,) = room.run({chapter: {name: room.CHAPTERS[chapter][name]}}, quick=True, advance=lambda _="": None)[chapter]
    return found


@pytest.fixture(scope="module")
def quick():
    return {chapter: [quickly(*each) for each in SHORT if each[0] == chapter] for chapter in room.CHAPTERS}


@pytest.fixture(scope="module")
def manual(quick):
    """The report of the quick run; what its pictures show is seen in outlines."""
    with outlines():
        return room.report(quick, room.drawings(list(SHOWN)))


def rows(document):
    return [row for problems in document.values() for problem in problems for row in problem.rows]


def markdown_rows(text):
    """Cells of all rows of the problems, as a reader of the Markdown takes them."""
    html = MarkdownIt("commonmark").enable("table").render(text)
    tables = [re.findall(r"<tr>(.*?)</tr>", each, re.S) for each in re.findall(r"<table>(.*?)</table>", html, re.S)]
    cells = [[tuple(map(unescape, re.findall(r"<t[hd].*?>(.*?)</t", row))) for row in table] for table in tables]
    return [row for head, *rows in cells if head == room.HEADINGS for row in rows]


class TestManual:
    """The quick run, and what is written of it."""

    @pytest.mark.parametrize(("chapter", "name"), SHORT)
    def test_every_row_passes(self, chapter, name):
        found = quickly(chapter, name).rows
        assert [row for row in found if not row.passed] == []
        assert all(row.proof.passed and row.source for row in found)

    def test_rows_of_all_kinds(self, quick):
        assert {row.kind for row in rows(quick)} == set(making.Kind)

    def test_every_problem_has_rows_and_a_name_of_its_own_and_says_what_it_is(self, quick):
        problems = [problem for problems in quick.values() for problem in problems]
        assert all(problem.rows and problem.about.endswith(".") for problem in problems)
        names = [name for chapter, problems in room.CHAPTERS.items() for name in (chapter, *problems)]
        assert len(set(names)) == len(names)

    def test_the_report_holds_the_rows_and_what_each_chapter_shows(self, manual, quick):
        """A chapter that the template does not know is an error, not left out."""
        assert markdown_rows(manual.text) == [room.cells(row) for row in rows(quick)]
        assert len(re.findall(r"^- \*Shows\*: .*$", manual.text, flags=re.MULTILINE)) == len(room.CHAPTERS)
        with pytest.raises(ValueError, match="number"):
            room.report({"new": DOCUMENT["paper"]}, {})

    def test_the_committed_one_has_all_problems_and_passed(self):
        text = (REPORTS / "verification" / "verification.md").read_text(encoding="utf-8")
        names = re.findall(r"^### `(.*)`$", text, flags=re.MULTILINE)
        assert names == [name for problems in room.CHAPTERS.values() for name in problems]
        assert {cells[-1] for cells in markdown_rows(text)} == {"passed"}
        assert "--quick" not in text

    @pytest.mark.usefixtures("outlined")
    @pytest.mark.parametrize(("problem", "failed"), [(wrong, 2), (breaks_off, 1), (empty, 1)])
    def test_what_is_wrong_fails_its_row_the_status_and_both_files(self, problem, failed, monkeypatch, tmp_path):
        document = ran({"first": problem, "second": sound})
        count = len(rows(document))
        assert sum(not row.passed for row in rows(document)) == failed
        monkeypatch.setitem(room.CHAPTERS, "paper", {"first": problem, "second": sound})
        ended = command("verify", "--quick", "--only", "paper", "--out", tmp_path)
        assert (ended.status, ended.err) == (1, "")
        pages = [(tmp_path / f"verification.{form}").read_text(encoding="utf-8") for form in ("md", "html")]
        assert all(f"{failed} of {count} rows FAILED" in text for text in (ended.out, *pages))
        assert all("python -m comparisons verify --only paper --quick" in page for page in pages)
        table = markdown_rows(pages[0])
        assert [cells[-1] for cells in table] == ["passed" if row.passed else "FAILED" for row in rows(document)]
        if problem is breaks_off:
            assert (table[1][5], "<cells" in pages[1]) == (REASON, False)

    def test_names_choose_chapters_and_problems(self):
        chosen = room.choose(["ssnv128", "descriptions"])
        assert {chapter: len(problems) for chapter, problems in chosen.items()} == {"ssnv128": 3, "invariance": 1}
        assert room.choose([]) == room.CHAPTERS
        for name in ("ssnv129", "", "Descriptions"):
            with pytest.raises(InputError, match="ssnv128") as caught:
                room.choose(["descriptions", name])
            assert caught.value.field == "--only"

    @pytest.mark.usefixtures("outlined")
    def test_equal_data_make_equal_reports(self):
        row = replace(DOCUMENT["paper"][0].rows[0], ours=1.25)
        changed = {"paper": [DOCUMENT["paper"][0]._replace(rows=[row])]}
        texts = [room.report(each, {}).text for each in (DOCUMENT, DOCUMENT, changed)]
        assert texts[0] == texts[1] != texts[2]


def test_every_benchmark_has_a_picture_of_its_body(manual):
    """But for the conservation of forces, which is about the others. Few cells keep a body's picture small."""
    own = {*room.CHAPTERS["benchmarks"], "oblique-block"} - {"conservation"}
    assert own == set(room.PICTURED)
    assert max(make().mesh.cell_count for make, _ in room.PICTURED.values()) <= 140
    assert all(unit in body for unit, body in zip(SHOWN.values(), manual.pictures.values(), strict=True))


class TestRows:
    """Errors as their definitions say; a NaN never passes; a row names its element."""

    @given(finite, finite, finite, st.floats(1e-9, 1e3))
    def test_absolute_and_inequalities(self, ours, reference, upper, tolerance):
        check = replace(CHECK, tolerance=tolerance)
        equal, below, above = (
            make("q", ours, reference) for make in (check.absolute, check.at_most, check.at_least)
        )  # fmt: skip
        assert equal.passed == (abs(ours - reference) <= tolerance)
        assert below.passed == (ours - reference <= tolerance)
        assert above.passed == (reference - ours <= tolerance)
        assert max(below.error, above.error) == equal.error
        assert below.error == (0.0 if ours <= reference else equal.error)
        bounds = list(check.enclosed("{} of P", (ours, upper), reference))
        assert [row.quantity for row in bounds] == ["lower bound of P", "upper bound of P"]
        assert [row.passed for row in bounds] == [ours - reference <= tolerance, reference - upper <= tolerance]

    @given(finite.filter(lambda x: abs(x) > 1e-6), st.floats(-0.1, 0.1), st.floats(1e-9, 1e-1))
    def test_relative(self, reference, error, tolerance):
        row = CHECK.relative("q", reference * (1.0 + error), reference, tolerance=tolerance)
        assert row.error == pytest.approx(abs(error), abs=1e-12)
        assert row.passed == (row.ratio <= 1.0)

    @pytest.mark.parametrize("make", [CHECK.relative, CHECK.absolute, CHECK.at_most, CHECK.at_least])
    @pytest.mark.parametrize("ours", [math.nan, math.inf, -math.inf])
    def test_what_is_not_a_number_fails(self, make, ours):
        row = make("q", ours, 1.0, tolerance=1e9)
        if np.isfinite(row.error):  # of an inequality that holds
            assert row.passed
            return
        assert not row.passed
        assert row.ratio == math.inf
        assert room.cells(row)[5:7] == ("none", "none")

    def test_zero_tolerance_words_and_sources(self):
        assert [CHECK.at_most("q", 1.0 + more, 1.0).ratio for more in (0.0, 1e-9)] == [0.0, math.inf]
        assert [CHECK.word("q", "slip", each).passed for each in ("slip", "stick")] == [True, False]
        assert not replace(CHECK, proof=NO_PROOF).word("q", "slip", "slip").passed
        assert [CHECK.word("q", "a", "a", source).source for source in ("", "own")] == ["source", "own; source"]

    @given(finite.filter(lambda x: abs(x) > 1e-9), st.floats(1e-9, 1e-1))
    def test_digits_below_the_tolerance_are_not_shown(self, value, tolerance):
        resolution = tolerance * abs(value) / 100.0
        assert float(room.number(value, resolution)) == pytest.approx(value, abs=resolution, rel=1e-9)


class TestProofs:
    """What certifies a result is looked at, not its numbers nor its status alone."""

    def test_of_results(self):
        good, early = solve(compressed_plate(0.1)), solve(compressed_plate(0.1), method="uzawa", iterations=30)
        lying = replace(early, solution=replace(early.solution, status=Status.SOLVED))
        assert making.certified(good).passed
        assert not any(making.certified(*each).passed for each in ((early,), (good, early), (), (lying,)))
        assert "failed" in making.certified(good, early).text

    def test_of_infeasibility(self):
        """Tension on a block: its multipliers prove it, their negatives do not."""
        contact, sides = Contact("bottom", 0.0), [Symmetry("left"), Traction("right", 0.0, 0.0)]
        mesh = TriangleMesh.rectangle((2, 2), 1.0, 1.0)
        result = solve(ContactProblem(mesh, STEEL, [contact, *sides, Traction("top", 0.0, 1.0)]))
        assert making.infeasible(result).passed
        y, nu = result.solution.farkas
        for farkas in ((-y, nu), (0.0 * y, nu), None):
            assert not making.infeasible(replace(result, solution=replace(result.solution, farkas=farkas))).passed
        assert not making.infeasible(solve(compressed_plate(0.1))).passed

    @pytest.mark.parametrize(
        ("limit", "passed"),
        [(LimitLoad(1.5, 1.6, None, 1.5 + 1e-9, 1e-10), True), (LimitLoad(1.5, 1.4, None, 1.5, 0.0), False),
         (LimitLoad(1.5, 1.6, None, 1.5001, 1e-10), False), (LimitLoad(1.5, 1.6, None, 1.5, 1e-5), False),
         (LimitLoad(np.inf, np.inf, None, np.inf, 0.0), False)],
    )  # fmt: skip
    def test_of_limit_loads(self, limit, passed):
        assert making.bounded(limit).passed == passed

    def test_of_the_displacement_model_and_of_several(self):
        companion = solve_companion(compressed_plate(0.1))
        assert making.certified_companion(companion).passed
        assert not making.certified_companion(companion, guaranteed=True).passed  # the bound moves with the pressure
        assert not making.certified_companion(replace(companion, status=Status.STALLED)).passed
        assert making.both(PROOF, PROOF) == PROOF
        assert not making.both(PROOF, making.by_hand(passed=False, text="no")).passed
        assert not making.both().passed


def backwards(problem):
    """On triangles whose vertices, and so whose edges, are numbered from the right."""
    mesh = problem.mesh
    last = len(mesh.vertices) - 1
    sets = {name: last - pairs for name, pairs in mesh.edge_sets.items()}
    return replace(problem, mesh=TriangleMesh(mesh.vertices[::-1], last - mesh.cells, sets))


class TestMeasures:
    """Polynomials on edges are evaluated exactly, in any order of edges; zones follow the contact."""

    TURNED = solve(backwards(compressed_plate(0.1, (4, 2))), degree=4).contacts["plate"]

    @given(st.lists(st.floats(-5, 5), min_size=3, max_size=3), st.floats(0, 1))
    def test_values(self, coefficients, x):
        polynomial = np.polynomial.Polynomial(coefficients)
        assert measures.value_at(self.TURNED, polynomial(self.TURNED.x), x) == pytest.approx(polynomial(x), abs=1e-11)

    def test_zones(self):
        points = np.array([0, 2, 2, 2, 2, 2, 1, 1, 2, 1, 1, 1])
        line = replace(solve(compressed_plate(0.1, (3, 1), grading=0.5)).contacts["plate"], state=points)
        assert measures.edge_states(line).tolist() == [2, 2, 1]
        assert measures.runs(measures.edge_states(line)) == "slip, stick"
        assert measures.runs(points) == "open, slip, stick, slip, stick"
        assert measures.zone_ends(line).tolist() == pytest.approx([6.0 / 7.0])
        turned = replace(self.TURNED, state=np.where(self.TURNED.x < 0.5, 0, 1))
        assert (
            measures.runs(measures.edge_states(turned)) == measures.runs(measures.point_states(turned)) == "open, stick"
        )
        assert measures.zone_ends(turned).tolist() == pytest.approx([0.5])
