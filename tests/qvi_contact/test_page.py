"""What people see of a result: its page, also in a browser; tables, one line, what notebooks show; rounding as 0."""

import re
from dataclasses import replace
from functools import cache
from html import unescape
from operator import methodcaller
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pytest

from qvi_contact import ContactState, InputError, TriangleMesh, solve
from qvi_contact.command import middle, number, outline, outline_lines, result_lines, result_page, result_tables
from qvi_contact.files import problem_from_toml
from qvi_contact.plots import mesh_figure, result_figure
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Symmetry, Traction
from qvi_contact.solution import ContactPath
from qvi_contact.units import Rounding, Units
from tests.qvi_contact.builders import PROBLEMS, told
from tests.qvi_contact.test_plots import slanted_result

TEXT = (PROBLEMS / "pressed.toml").read_text(encoding="utf-8")


@cache
def answer():
    return solve(problem_from_toml(TEXT).problem)


@cache
def page():
    return result_page(problem_from_toml(TEXT), answer(), lambda: (answer().bracket, ""))


def words(text):
    """The visible text."""
    body = re.sub(r"<(script|style)\b.*?</\1>", " ", text, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]*>", " ", body)).split())


def pictures(text):
    """The SVG files inside a page."""
    return [unquote(address) for address in re.findall(r'src="data:image/svg\+xml,([^"]*)"', text)]


def numbers(text):
    return [float(n.replace("−", "-")) for n in re.findall(r"−?\d+(?:\.\d+)?(?:e[−+]?\d+)?", text)]


@pytest.fixture(scope="module")
def opened(browser, tmp_path_factory):
    """The page in a window, and its complaints."""
    path, said = tmp_path_factory.mktemp("page") / "page.html", []
    path.write_text(page(), encoding="utf-8")
    with browser.new_context(viewport={"width": 1000, "height": 900}, offline=True) as context:
        tab = context.new_page()
        tab.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        tab.on("pageerror", lambda error: said.append(str(error)))
        tab.goto(path.as_uri())
        yield tab
    assert said == []


class TestText:
    """What the page says."""

    def test_five_sentences_with_the_numbers_of_certificate_and_bracket(self):
        result, text = answer(), page()
        sentences = re.findall(r"<li>(.*?)</li>", text[: text.index("</ol>")], flags=re.DOTALL)
        assert len(sentences) == 5
        bracket = result.bracket
        assert f"{result.certificate.accuracy:.2g}".replace("-", "−") in sentences[0]
        for bound in (bracket.lower, bracket.upper):
            assert f"{bound:.9g}".replace("-", "−") in sentences[2]
        assert f"{100 * bracket.relative_error:.2g}" in sentences[3]

    def test_values_are_shown_over_the_axes_of_their_picture(self):
        text = page()
        (picture,) = pictures(text[text.index('id="contact-1-figure"') :].partition("</figure>")[0])
        width = float(re.search(r'viewBox="0 0 (\S+)', picture)[1])
        outline = re.search(r'id="patch_2">.*?d="M (\S+) \S+\s*L (\S+)', picture, flags=re.DOTALL)
        sides = [float(re.search(f'"{side}": ([0-9.]+)', text)[1]) for side in ("left", "right")]
        assert sides == pytest.approx([float(x) / width for x in outline.groups()], abs=1e-6)

    def test_it_is_one_file_of_moderate_size_by_which_it_can_be_repeated(self):
        text = page()
        assert all(part in unescape(text) for part in (TEXT.strip(), "<pre>qvi-contact"))
        assert len(text) < 900_000
        assert not re.search(r'(src|href)="(?!#|data:)', text)
        assert "<pressed>" not in text


class TestBrowser:
    """The page in Chromium."""

    def test_values_under_the_pointer_are_those_of_the_result(self, opened):
        opened.select_option("#quantity", "σ_yy")
        canvas = opened.locator("#drawing")
        canvas.scroll_into_view_if_needed()
        places = []
        for clicks in (0, 2):
            for _ in range(clicks):
                opened.click("#closer")
            opened.wait_for_timeout(100)
            canvas.hover(position={"x": 420, "y": 190})
            x, y, *rest = numbers(opened.locator("#value").text_content())
            stress = answer().stress(x, y)
            assert rest[:4] == pytest.approx([stress[1], *stress], abs=0.01 * np.abs(stress).max())
            assert rest[-2:] == pytest.approx(answer().displacement(x, y), abs=1e-4)
            places.append(np.hypot(x - 4500001.0, y - 0.5))
        assert places[1] == pytest.approx(places[0] / 1.5**2, rel=0.02)  # nearer to the middle

    def test_values_of_the_nearest_contact_point(self, opened):
        line = answer().contacts["base & <bed>"]
        picture = opened.locator("[data-contact='0']")
        box = picture.bounding_box()
        picture.hover(position={"x": 0.4 * box["width"], "y": 0.5 * box["height"]})
        said = opened.locator("#contact-1-value").text_content()
        x, _, pressure, shear, bound, *_ = numbers(said.replace("σ_T", ""))
        nearest = int(np.argmin(np.abs(line.x - x)))
        assert 0.3 < x - 4500000.0 < 1.4
        known = [line.x, -line.normal_stress, line.tangential_stress, line.friction_bound]
        assert [x, pressure, shear, bound] == pytest.approx([values[nearest] for values in known], rel=1e-3)

    def test_the_field_answers_mouse_and_keyboard(self, opened):
        """What changes the picture, and what brings it back."""

        def drag():
            box = canvas.bounding_box()
            opened.mouse.move(box["x"] + 300, box["y"] + 100)
            opened.mouse.down()
            opened.mouse.move(box["x"] + 360, box["y"] + 120)
            opened.mouse.up()

        def drawn():
            opened.wait_for_timeout(60)  # until what was asked for is drawn
            return opened.evaluate("document.getElementById('drawing').toDataURL()")

        press, whole = opened.keyboard.press, lambda: opened.click("#whole")
        ways = [
            (lambda: press("+"), lambda: press("-")),
            (lambda: press("ArrowLeft"), lambda: press("ArrowRight")),
            (lambda: press("ArrowUp"), lambda: press("0")),
            (lambda: opened.mouse.wheel(0, -300), whole),
            (drag, whole),
            (lambda: opened.check("#lines"), lambda: opened.uncheck("#lines")),
            (lambda: opened.fill("#factor", "50"), lambda: opened.fill("#factor", "0")),
        ]
        canvas = opened.locator("#drawing")
        whole()
        canvas.hover()
        canvas.focus()
        for change, back in ways:
            before = drawn()
            change()
            assert drawn() != before
            back()
            canvas.focus()
            assert drawn() == before


class TestCommand:
    """solve --report."""

    @pytest.mark.usefixtures("outlined")
    def test_what_cannot_be_solved_has_a_page_with_the_reason(self, shell, tmp_path):
        text = TEXT.replace("y = -0.01", "y = 0.01", 1).replace("[[displacements]]", "[[tractions]]")
        (tmp_path / "a.toml").write_text(text, encoding="utf-8")
        code, _, err = shell("solve", tmp_path / "a.toml", "--report", tmp_path / "a.html")
        assert (code, err) == (1, "")
        said = words((tmp_path / "a.html").read_text(encoding="utf-8"))
        assert "x from 4500000 to 4500002" in told(shell("check", tmp_path / "a.toml"))
        assert said.count("infeasible") == 1
        assert "The problem" in said
        assert "The answer" not in said

    @pytest.mark.usefixtures("outlined")
    def test_load_steps_have_a_table_and_pictures_to_slide_through(self, shell, browser, tmp_path):
        (tmp_path / "a.toml").write_text(TEXT.replace("x = 0.004", 'x = "0.004*t"') + "[history]\ntimes = [0.0, 2.0]\n")
        told(shell("solve", tmp_path / "a.toml", "--report", tmp_path / "a.html"))
        text = (tmp_path / "a.html").read_text(encoding="utf-8")
        assert all(each in words(text) for each in ("Load steps", "Energy lost in friction: 0.0029", "All 2 steps"))
        assert "bounds are those of this step alone" in words(text)
        assert text.count("<td>solved</td>") == 2
        with browser.new_page(offline=True) as tab:
            tab.goto((tmp_path / "a.html").as_uri())
            pictures = tab.locator("#result-figure img")
            assert [picture.is_visible() for picture in pictures.all()] == [False, True]
            tab.locator("#step").fill("0")
            assert [picture.is_visible() for picture in pictures.all()] == [True, False]
            assert tab.locator("#step-value").inner_text() == "0"

    def test_a_limit_load_has_a_page_with_the_mechanism(self, shell, tmp_path):
        example = Path(__file__).parents[2] / "examples/dragged_block_holds.toml"
        out = told(shell("limit", example, "--load", "drag", "--report", tmp_path / "a.html"))
        text = (tmp_path / "a.html").read_text(encoding="utf-8")
        assert " ".join(out.split()) in words(text)
        assert re.search(r"contact opens \[m\] slides \[m\] base 0\.\d+ ", words(text))
        assert len(pictures(text)) == 2
        told(shell("limit", example, "--load", "pressure", "--report", tmp_path / "a.html"))
        text = words((tmp_path / "a.html").read_text(encoding="utf-8"))
        assert "pressure: no upper limit. If other" in text
        assert ".." not in text.partition("The problem")[0]


@pytest.mark.parametrize(
    ("stress", "length", "force", "moment"),
    [("MPa", "mm", "N/mm", "N mm/mm"), ("Pa", "m", "N/m", "N m/m"), ("bar", "mm", "bar mm", "bar mm²")],
)
def test_units_that_engineers_use(stress, length, force, moment):
    units = Units(length, stress)
    assert (units.force, units.moment, units.energy, units.displacement) == (force, moment, moment, length)
    assert units.airy == f"{stress} {length}²"
    for name in ("", "  ", None, 3, "m\nm"):
        for field in ("length", "stress"):
            with pytest.raises(InputError) as caught:
                Units(**{field: name})
            assert caught.value.field == f"Units.{field}"


html = methodcaller("_repr_html_")  # the name under which notebooks ask for it


def test_edges_around_a_ring_in_any_order():
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False) + 0.1
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    ends = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
    rightward = (ends[:, 1, 0] > ends[:, 0, 0])[:, None, None]
    ends = np.where(rightward, ends, ends[:, ::-1])[np.random.default_rng(3).permutation(12)]
    path = ContactPath.of(ends, np.hypot(*(ends[:, 1] - ends[:, 0]).T))
    walked = np.where(path.forward[:, None, None], ends[path.edges], ends[path.edges, ::-1])
    assert np.array_equal(walked[1:, 0], walked[:-1, 1])
    assert np.array_equal(walked[-1, 1], walked[0, 0])
    assert walked[0, 0] == pytest.approx(ring[np.argmin(ring[:, 0])])
    assert 0 < path.forward.sum() < 12
    assert path.starts[-1] + path.lengths[-1] == pytest.approx(24.0 * np.sin(np.pi / 12))


def test_rows_of_a_table_follow_the_contact():
    line = slanted_result("plane <a>").contacts["plane <a>"]
    assert {"s [mm]", "slip [mm]", "friction", "state"} < set(line.to_frame(Units("mm", "MPa")).columns)
    frame = line.to_frame()
    assert frame["s"].to_numpy() == pytest.approx(np.hypot(frame["x"], frame["y"]))  # from the corner at the origin
    assert (np.diff(frame["s"]) > 0).all()
    assert frame["weight"] @ frame["normal_stress"] == pytest.approx(-line.normal_force)
    assert (frame["state"] == "slip").sum() == (line.state == 2).sum() > 0


def test_what_notebooks_show():
    """Tables of results and contacts, pictures of problems and meshes."""
    slanted = slanted_result("plane <a>")
    line = slanted.contacts["plane <a>"]
    for found in (slanted, line):
        tree = ElementTree.fromstring(html(found))
        assert line.name in {cell.text for cell in tree.iter("th")}
        cells = {cell.text for cell in tree.iter("td")}
        assert {number(line.normal_force), f"{100.0 * line.shares['slip']:.1f} %"} <= cells
    for found in (slanted.problem, slanted.problem.mesh):
        assert found._repr_png_().startswith(b"\x89PNG")
    labels = {text.get_text() for text in mesh_figure(slanted.problem.mesh).legends[0].get_texts()}
    assert labels == set(slanted.problem.mesh.edge_names)


UNITS = Units(length="mm", stress="MPa")


@pytest.fixture(scope="module")
def squeezed():
    """A symmetric block on rough ground: T, the forces along x and the moments are rounding; another ground is far."""
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0)
    conditions = [Contact("bottom", 0.0, name="ground"), Contact("right", 0.5, gap=1.0, name="wall")]
    conditions += [Traction("left", x=0.0, y=0.0), Displacement("top", x=0.0, y=-1e-3)]
    return solve(ContactProblem(mesh, Material(2.1e5, 0.3), conditions))


def tiny(text):
    """Numbers in a text that are smaller than 1e-9, other than zero; those of certificates left out."""
    numbers = re.findall(r"-?\d+\.?\d*e-\d+", text.replace("−", "-"))
    return [number for number in numbers if abs(float(number)) < 1e-9]


def test_sizes_of_rounding_follow_the_units_of_the_problem(squeezed):
    """S, D, S L, S L², D/L and S D L, times 1e-9; without a problem there is none."""
    sizes = [2e-9, 3e-9, 1e-8, 5e-8, 0.6e-9, 3e-8]
    found = Rounding.of(2.0, 3.0, 5.0)
    assert list(vars(found).values()) == pytest.approx(sizes, rel=1e-12, abs=0.0)
    assert Rounding.largest([found, Rounding.of(1.0, 4.0, 5.0)]).displacement == pytest.approx(4e-9, rel=1e-12, abs=0.0)
    assert set(vars(Rounding()).values()) == {0.0}
    kinds = ("force", "force", "moment", "displacement")
    for row, cleaned in (((100.0, 9e-5, 4e-4, 5e-5), (100.0, 0.0, 0.0, 5e-5)), ((1.0, 1e-5, 1e-4, 0.0),) * 2):
        assert found.cleaned(row, kinds) == list(cleaned)  # 1e-6 of the largest force; 5 is the length
        assert Rounding().cleaned(row, kinds)[:2] == list(cleaned[:2])
    line, force = squeezed.contacts["ground"], squeezed.contacts["ground"].normal_force
    assert [replace(line, rounding=Rounding(force=least)).forces[0] for least in (force, 0.999 * force)] == [0.0, force]


def test_tables_of_a_result(squeezed):
    """Contact rows and resultants, on the terminal, on the page and in notebooks."""
    assert abs(squeezed.contacts["ground"].tangential_force) < 1e-8
    assert squeezed.contacts["wall"].forces == (0.0, 0.0)
    assert result_figure(squeezed).axes[-1].get_ylim()[1] > 100.0  # of the stress in the body, not of rounding
    report = "\n".join(line for line in result_lines(squeezed, UNITS) if "certificate" not in line)
    (found,) = re.findall(r"\nsupport top acts with (.*) N/mm, moment (.*) N mm/mm about \(1, 0.5\)", report)
    assert found == (f"(0, {-squeezed.contacts['ground'].normal_force:.6g})", "0")
    tables = result_tables(squeezed, UNITS)
    assert tables[0][1][:3] == ["contact", "N [N/mm]", "T [N/mm]"]
    rows = [cell for *_, found in tables for row in found for cell in row[1:]]
    for text in (report, " ".join(rows), html(squeezed.contacts["wall"]), repr(squeezed.contacts["ground"])):
        assert not tiny(text)
    (ground,) = (row for row in tables[0][2] if row[0] == "ground")
    assert (float(ground[1]), ground[2]) == (pytest.approx(squeezed.contacts["ground"].normal_force, rel=1e-4), "0")


def test_a_material_that_is_nearly_incompressible_is_not_shown_as_incompressible():
    nearly = problem_from_toml(re.sub(r"poisson = [\d.]+", "poisson = 0.4999999999", TEXT))
    assert any("ν = 0.4999999999, " in line for line in outline_lines(outline(nearly, {})[1], UNITS))


def test_forces_and_moments_of_bodies_in_coordinates_of_a_map():
    """Moments are about the middle of the body, and no force is rounding beside a moment about a distant point."""
    rows = []
    for origin in ((0.0, 0.0), (5e5, 5.8e6)):
        mesh = TriangleMesh.rectangle((2, 2), 10.0, 10.0, origin=origin)
        held = [Contact("bottom", friction=0.3), Displacement("right", x=0.0), Traction("right", y=0.1)]
        loads = [Traction("top", x=0.3, y=-4.0), Traction("left", x=0.0, y=0.0)]
        result = solve(ContactProblem(mesh, Material(1e4, 0.2), [*held, *loads]))
        rows.append([float(cell.replace("−", "-")) for row in result_tables(result, UNITS)[1][2] for cell in row[1:]])
        (found,) = (line for line in result_lines(result, UNITS) if line.startswith("support right "))
        force, _, moment = rows[-1][3:6]  # with the given traction, 1.0 along y with the arm 5
        numbers = [float(text) for text in re.findall(r"[-\d.]+(?=[,) ])", found)][:3]
        assert numbers == pytest.approx([force, 0.0, moment - 5.0], rel=1e-3)
    assert rows[1] == pytest.approx(rows[0], rel=1e-3)
    assert rows[0][6:9] == [3.0, -40.0, -15.0]  # of the load on top: its arm is 5
    assert (middle(-0.3, 0.1 + 0.2), middle(5e5, 5e5 + 10.0)) == (0.0, 5e5 + 5.0)
    assert Rounding.of(1.0, 1.0, 10.0).cleaned((3.0, -40.0, -4e8), ("force", "force", "moment")) == [3.0, -40.0, -4e8]


def test_what_an_overlap_alone_loads_has_the_pressure_as_its_unit():
    """Two blocks that overlap by 0.05 in a joint without friction, as in a shrink fit: σ = E δ/h.

    The problem's own unit of stress, that of a strain of 1e-6, is far below it. The joint is closed, without stick.
    """
    mesh = TriangleMesh.rectangle((3, 4), 1.5, 2.0).with_joint("fit", lambda x, y: (y == 1.0) & (x > -1.0))
    held = [Symmetry("bottom"), Symmetry("left"), Symmetry("top"), Traction("right", x=0.0, y=0.0)]
    conditions = [Contact("fit", friction=0.0, gap=-0.05), *held]
    overlapping = solve(ContactProblem(mesh, Material(2.1e5, 0.3, "stress"), conditions), degree=4)
    line = overlapping.contacts["fit"]
    assert -line.normal_stress == pytest.approx(2.1e5 * 0.05 / 2.0)
    assert overlapping.discretization.scales.stress < 1e-3 * np.abs(line.normal_stress).max()
    assert overlapping.rounding.stress >= 1e-10 * np.abs(line.normal_stress).max()
    assert overlapping.rounding.force < 1e-6 * line.normal_force
    report = [line for line in result_lines(overlapping, UNITS) if "certificate" not in line]
    _, (_, _, rows) = result_tables(overlapping, UNITS)
    zero = [overlapping.rounding.force] * 2 + [overlapping.rounding.moment]
    for name, *cells in rows:
        force = overlapping.resultant(name)
        moment = force.moment + 1.0 * force.x - 0.75 * force.y  # about the middle (0.75, 1)
        for cell, value, least in zip(cells, (force.x, force.y, moment), zero, strict=True):
            assert (cell == "0") == (abs(value) <= least)
    assert line.forces[1] == 0.0
    assert not tiny(" ".join(report))
    assert line.shares == {"open": pytest.approx(0.0), "closed": pytest.approx(1.0)}
    assert not np.isin(line.state, [ContactState.STICK, ContactState.SLIP]).any()
    assert "stick" not in "\n".join(report)


def test_a_bad_certificate_leaves_large_numbers(squeezed):
    """An accuracy of 1e-7 hides what is below 1e-7 of the units, one of 1 no more than a millionth."""
    assert squeezed.certificate.accuracy < 1e-9
    least = []
    for accuracy in (1e-7, 1.0):
        worse = replace(squeezed.certificate, measures={**squeezed.certificate.measures, "stationarity": accuracy})
        result = replace(squeezed, solution=replace(squeezed.solution, certificate=worse))
        least.append(result.rounding.force / squeezed.rounding.force)
    assert least == pytest.approx([100.0, 1000.0])
