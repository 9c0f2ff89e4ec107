"""The page of a result: what it says, that it needs nothing else, and what a real browser makes of it."""

import re
import sys
from functools import cache
from hashlib import sha256
from html import unescape

import numpy as np
import pytest

from comparisons.lab.report import browser as looking
from qvi_contact.basics import terminal
from qvi_contact.command.cli import group
from qvi_contact.command.page.page import Request, result_page
from qvi_contact.files.problem_file import problem_from_toml
from qvi_contact.solution.solver import solve
from qvi_contact.units import Units

TEXT = """version = 1
title = "A plate <pressed>"
description = "First.\\n\\nSecond & last."

[units]
length = "mm"
stress = "MPa"

[mesh]
x = {start = 0.0, stop = 2.0, cells = 4}
y = {start = 0.0, stop = 1.0, cells = 2}

[material]
young = 1000.0
poisson = 0.3
plane = "strain"

[[contacts]]
edges = "bottom"
name = "base & <bed>"
friction = 0.3

[[displacements]]
edges = "top"
x = 0.004
y = -0.01

[[tractions]]
edges = "left"
x = 0.0
y = 0.0

[[tractions]]
edges = "right"
x = 0.0
y = 0.0
"""


@cache
def answer():
    file = problem_from_toml(TEXT)
    return solve(file.problem.triangulated())


@cache
def page():
    return result_page(Request(problem_from_toml(TEXT), TEXT, "qvi-contact solve a.toml"), [answer()])


def words(text):
    """The visible text."""
    body = re.sub(r"<(script|style|svg)\b.*?</\1>", " ", text, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", body)).split())


class TestText:
    """What the page says."""

    def test_forces_are_in_engineering_units(self):
        line, said = answer().contacts["base & <bed>"], words(page())
        assert "N [N/mm]" in said
        row = said[said.index("base & <bed>") :]
        numbers = [float(n.replace("−", "-")) for n in re.findall(r"−?\d[\d.e−-]*", row)[:2]]
        assert numbers == pytest.approx([line.normal_force, line.tangential_force], rel=1e-4)

    def test_five_sentences_with_the_numbers_of_certificate_and_bracket(self):
        result, text = answer(), page()
        sentences = re.findall(r"<li>(.*?)</li>", text[: text.index("</ol>")], flags=re.DOTALL)
        assert len(sentences) == 5
        bracket = result.bracket
        assert f"{result.certificate.accuracy:.2g}".replace("-", "−") in sentences[0]
        for bound in (bracket.lower, bracket.upper):
            assert f"{bound:.9g}".replace("-", "−") in sentences[2]
        assert f"{100 * bracket.relative_error:.2g}" in sentences[3]

    def test_it_can_be_repeated(self):
        said = unescape(page())
        assert TEXT.strip() in said
        assert "qvi-contact solve a.toml" in said
        assert answer().discretization.space.family in said

    def test_values_are_shown_over_the_axes_of_their_picture(self):
        text = page()
        width = float(re.search(r'id="contact-1--svg".*?viewBox="0 0 (\S+)', text, flags=re.DOTALL)[1])
        outline = re.search(r'id="contact-1--patch_2">.*?d="M (\S+) \S+\s*L (\S+)', text, flags=re.DOTALL)
        sides = [float(re.search(f'"{side}": ([0-9.]+)', text)[1]) for side in ("left", "right")]
        assert sides == pytest.approx([float(x) / width for x in outline.groups()], abs=1e-6)

    def test_it_is_one_file_of_moderate_size(self):
        text = page()
        assert len(text) < 900_000
        assert not re.search(r'(src|href)="(?!#|data:)', re.sub(r"<svg.*?</svg>", "", text, flags=re.DOTALL))
        assert "<pressed>" not in text


class TestBrowser:
    """The page in Chromium."""

    @pytest.fixture
    def file(self, tmp_path):
        path = tmp_path / "page.html"
        path.write_text(page(), encoding="utf-8")
        return path

    def test_nothing_is_wrong_with_it(self, browser, file):
        assert looking.problems_on(browser, file) == []

    def test_settings_fit_a_phone(self, browser, tmp_path):
        """Digests of mesh files have no place to break of their own; the names before them are not broken."""
        path = tmp_path / "page.html"
        files = (("meshes/a_mesh_with_a_long_name.msh", sha256(b"").hexdigest()),)
        request = Request(problem_from_toml(TEXT), TEXT, "qvi-contact solve a.toml", files)
        path.write_text(result_page(request, [answer()]), encoding="utf-8")
        with browser.new_context(viewport={"width": 390, "height": 900}) as context:
            opened = context.new_page()
            opened.goto(path.as_uri())
            table = opened.locator("section[aria-labelledby='repeat'] table")
            box, name = table.bounding_box(), table.get_by_text("factorisation").bounding_box()
            assert box["x"] + box["width"] <= 390.0
            assert name["height"] < table.get_by_text("meshes/").bounding_box()["height"]

    def test_values_under_the_pointer_are_those_of_the_result(self, browser, file):
        with browser.new_context(viewport={"width": 1000, "height": 900}) as context:
            opened = context.new_page()
            opened.goto(file.as_uri())
            opened.select_option("#quantity", "σ_yy")
            canvas = opened.locator("#drawing")
            canvas.scroll_into_view_if_needed()
            places = []
            for zoom in (False, True):
                if zoom:
                    opened.click("#closer")
                    opened.click("#closer")
                opened.wait_for_timeout(100)
                canvas.hover(position={"x": 420, "y": 190})
                said = opened.locator("#value").text_content()
                x, y, *rest = found = self.numbers(said)
                stress = answer().stress(x, y)
                size = np.abs(stress).max()
                assert rest[0] == pytest.approx(stress[1], abs=0.01 * size), said
                assert rest[1:4] == pytest.approx(stress, abs=0.01 * size), said
                moved = answer().displacement(x, y)
                assert found[-2:] == pytest.approx(moved, abs=1e-4)
                places.append(np.hypot(x - 1.0, y - 0.5))
            assert places[1] == pytest.approx(places[0] / 1.5**2, rel=0.02)  # nearer to the middle

    def test_values_of_the_nearest_contact_point(self, browser, file):
        line = answer().contacts["base & <bed>"]
        with browser.new_context(viewport={"width": 1000, "height": 900}) as context:
            opened = context.new_page()
            opened.goto(file.as_uri())
            picture = opened.locator("[data-contact='0']")
            box = picture.bounding_box()
            picture.hover(position={"x": 0.4 * box["width"], "y": 0.5 * box["height"]})
            said = opened.locator("#contact-1-value").text_content()
        x, _, pressure, shear, bound, *_ = self.numbers(said.replace("σ_T", ""))
        nearest = int(np.argmin(np.abs(line.x - x)))
        assert x == pytest.approx(line.x[nearest], rel=1e-3)
        assert 0.3 < x < 1.4
        assert pressure == pytest.approx(-line.normal_stress[nearest], rel=1e-3)
        assert bound == pytest.approx(line.friction_bound[nearest], rel=1e-3)
        assert shear == pytest.approx(line.tangential_stress[nearest], rel=1e-3)

    def test_the_field_answers_mouse_and_keyboard(self, browser, file):
        """What changes the picture, and what brings it back."""
        ways = [
            (lambda opened: opened.keyboard.press("+"), lambda opened: opened.keyboard.press("-")),
            (lambda opened: opened.keyboard.press("ArrowLeft"), lambda opened: opened.keyboard.press("ArrowRight")),
            (lambda opened: opened.keyboard.press("ArrowUp"), lambda opened: opened.keyboard.press("0")),
            (lambda opened: opened.mouse.wheel(0, -300), lambda opened: opened.click("#whole")),
            (self.drag, lambda opened: opened.click("#whole")),
            (lambda opened: opened.check("#lines"), lambda opened: opened.uncheck("#lines")),
            (lambda opened: opened.fill("#factor", "50"), lambda opened: opened.fill("#factor", "0")),
        ]
        with browser.new_context(viewport={"width": 1000, "height": 900}) as context:
            opened = context.new_page()
            opened.goto(file.as_uri())
            canvas = opened.locator("#drawing")
            canvas.hover()
            canvas.focus()
            for change, back in ways:
                before = self.drawn(opened)
                change(opened)
                assert self.drawn(opened) != before
                back(opened)
                canvas.focus()
                assert self.drawn(opened) == before

    @staticmethod
    def drawn(opened):
        """The picture, once what was asked for is drawn."""
        opened.wait_for_timeout(60)
        return opened.evaluate("document.getElementById('drawing').toDataURL()")

    @staticmethod
    def drag(opened):
        box = opened.locator("#drawing").bounding_box()
        opened.mouse.move(box["x"] + 300, box["y"] + 100)
        opened.mouse.down()
        opened.mouse.move(box["x"] + 360, box["y"] + 120)
        opened.mouse.up()

    def test_print_has_no_controls_and_fits_the_paper(self, browser, file):
        with browser.new_context(viewport={"width": 720, "height": 1000}) as context:  # A4 less its margins
            opened = context.new_page()
            opened.goto(file.as_uri())
            opened.emulate_media(media="print")
            assert opened.locator(".controls").first.is_hidden()
            assert opened.locator("output").first.is_hidden()
            assert opened.evaluate("document.documentElement.scrollWidth") <= 720
            assert opened.locator("#drawing").is_visible()
            assert opened.pdf(format="A4").startswith(b"%PDF")

    @staticmethod
    def numbers(text):
        return [float(n.replace("−", "-")) for n in re.findall(r"−?\d+(?:\.\d+)?(?:e[−+]?\d+)?", text)]


def run(monkeypatch, capfd, *arguments):
    monkeypatch.setattr(sys, "argv", ["qvi-contact", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        terminal.run(group, "qvi-contact")
    return caught.value.code, *capfd.readouterr()


class TestCommand:
    """solve --report."""

    def test_what_cannot_be_solved_has_a_page_with_the_reason(self, monkeypatch, capfd, tmp_path):
        (tmp_path / "a.toml").write_text(TEXT.replace("y = -0.01", "y = 0.01", 1), encoding="utf-8")
        text = (tmp_path / "a.toml").read_text(encoding="utf-8").replace("[[displacements]]", "[[tractions]]")
        (tmp_path / "a.toml").write_text(text, encoding="utf-8")
        code, _, err = run(monkeypatch, capfd, "solve", tmp_path / "a.toml", "--report", tmp_path / "a.html")
        assert (code, err) == (1, "")
        said = words((tmp_path / "a.html").read_text(encoding="utf-8"))
        assert said.count("infeasible") == 1
        assert "The problem" in said
        assert "The answer" not in said

    def test_load_steps_have_a_table(self, monkeypatch, capfd, tmp_path):
        (tmp_path / "a.toml").write_text(TEXT.replace("x = 0.004", 'x = "0.004*t"') + "[history]\ntimes = [0.0, 2.0]\n")
        words_of_it = ("solve", tmp_path / "a.toml", "--element", "bfs", "--report", tmp_path / "a.html")
        code, _, err = run(monkeypatch, capfd, *words_of_it)  # cells that are symmetric
        assert (code, err) == (0, "")
        text = (tmp_path / "a.html").read_text(encoding="utf-8")
        assert "Load steps" in words(text)
        assert text.count("<td>solved</td>") == 2
        assert "<td>0</td>" in text[text.index("Load steps") :]  # the shear without a pull is 0, not its rounding

    def test_a_mesh_file_is_named_with_its_digest(self, monkeypatch, capfd, tmp_path):
        meshio = pytest.importorskip("meshio")
        mesh = answer().problem.mesh
        blocks = [("triangle", mesh.cells), *(("line", pairs) for pairs in mesh.edge_sets.values())]
        names = {name: np.array([k, 1]) for k, name in enumerate(mesh.edge_sets, 2)}
        tags = [np.full(len(cells), k) for k, (_, cells) in enumerate(blocks, 1)]
        points = np.column_stack([mesh.vertices, np.zeros(len(mesh.vertices))])
        made = meshio.Mesh(
            points, blocks, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags}, field_data=names
        )
        made.write(tmp_path / "part.msh", file_format="gmsh22", binary=False)
        text = re.sub(r"x = \{.*\ny = \{.*\n", 'file = "part.msh"\n', TEXT)
        (tmp_path / "a.toml").write_text(text, encoding="utf-8")
        code, _, err = run(monkeypatch, capfd, "solve", tmp_path / "a.toml", "--report", tmp_path / "a.html")
        assert (code, err) == (0, "")
        digest = sha256((tmp_path / "part.msh").read_bytes()).hexdigest()
        assert f"SHA-256 {digest}" in words((tmp_path / "a.html").read_text(encoding="utf-8"))

    def test_another_suffix_is_refused(self, monkeypatch, capfd, tmp_path):
        (tmp_path / "a.toml").write_text(TEXT, encoding="utf-8")
        code, _, err = run(monkeypatch, capfd, "solve", tmp_path / "a.toml", "--report", tmp_path / "a.pdf")
        assert code == 2
        assert "ends in .html" in err


@pytest.mark.parametrize(
    ("stress", "length", "force", "moment"),
    [("MPa", "mm", "N/mm", "N mm/mm"), ("Pa", "m", "N/m", "N m/m"), ("bar", "mm", "bar mm", "bar mm²")],
)
def test_units_that_engineers_use(stress, length, force, moment):
    units = Units(length, stress)
    assert (units.engineering_force, units.engineering_moment, units.engineering_energy) == (force, moment, moment)
