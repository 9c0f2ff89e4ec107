"""What the documentation shows works: its code runs and prints what it says, its commands and links exist."""

import logging
import re
import shlex
import tomllib
from contextlib import redirect_stdout, suppress
from importlib import import_module
from io import StringIO
from pathlib import Path

import click
import pytest

from comparisons.cli import group as comparisons
from comparisons.lab.studies import DONE
from comparisons.verification.known import KNOWN
from qvi_contact import RefinementStatus, TriangleMesh, load_result, solve
from qvi_contact.command.cli import group as qvi_contact
from qvi_contact.export import summary, write_npz
from qvi_contact.files import FORMAT_VERSION, Archive, FileReader, file_keys
from qvi_contact.problem import Contact, ContactProblem, Material, RigidPlate, Traction
from qvi_contact.runs import FAILURES
from solvers import Status
from solvers.certificate import MEASURES

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
FOLDERS = ("qvi_contact", "solvers", "comparisons", "tests", "docs", "examples")
TEXTS = [*sorted(DOCS.rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]

GROUPS = {"qvi-contact": qvi_contact, "python -m comparisons": comparisons}
QUICK = {"qvi-contact": set(qvi_contact.commands), "python -m comparisons": {"export"}}
DRAWN = ("--plot", "--report")  # pictures and pages have tests of their own, and take longest
ELSEWHERE = ("python -m pip", "python -m venv", "python -m pytest", "python -m sphinx", ". .venv", "sqlite3")

ROOMS = "bracket", "companion", "gallery", "mechanism", "paper", "plots", "refinement"
OTHERS = "qvi_contact", "solvers", "solvers.factorisation", "comparisons.exchange"
PACKAGES = (*OTHERS, *(f"qvi_contact.{room}" for room in ROOMS))
INTERNAL = {"CompanionState", "Exhibit"}

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def text(path):
    return path.read_text(encoding="utf-8")


def blocks(page):
    """Language and content of the fenced blocks of a page."""
    return re.findall(r"^```(\w+)\n(.*?)^```$", text(page), re.S | re.M)


def same(printed, shown):
    """Whether a line is as shown: "…" stands for anything, the last digit of a number may differ by one."""
    pattern, digits = [], []
    for part in re.split(r"(…)", shown):
        words = NUMBER.split(part)
        found = NUMBER.findall(part)
        digits += found
        pattern.append(".*" if part == "…" else rf"({NUMBER.pattern})".join(re.escape(word) for word in words))
    match = re.fullmatch("".join(pattern), printed)
    return match is not None and all(near(*pair) for pair in zip(match.groups(), digits, strict=True))


def near(printed, shown):
    mantissa, _, exponent = shown.partition("e")
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(printed) - float(shown)) <= 1.001 * unit


def agree(printed, shown):
    """Whether all lines are as shown; a line "…" stands for any number of them."""
    if not shown:
        return not printed
    if shown[0] == "…":
        return any(agree(printed[skipped:], shown[1:]) for skipped in range(len(printed) + 1))
    return bool(printed) and same(printed[0], shown[0]) and agree(printed[1:], shown[1:])


def lines(output):
    return [line.rstrip() for line in output.rstrip().splitlines()]


def command_of(line):
    """Group and words of a command line of this project, None for other programs; shell comments do not count."""
    for name in GROUPS:
        if line.startswith(name + " "):
            return name, shlex.split(line.removeprefix(name), comments=True)
    assert line.startswith(ELSEWHERE), line
    return None


def parse(name, words):
    """As the command would: a `click.UsageError` for what it does not know."""
    command = GROUPS[name]
    context = click.Context(command)
    while isinstance(command, click.Group) and words:
        name, command, words = command.resolve_command(context, words)
        context = click.Context(command, parent=context, info_name=name)
    if not isinstance(command, click.Group):  # a group alone shows its help
        command.make_context(name, list(words))


def check_console(block):
    """Run or parse each command, and compare what is shown below it."""
    for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
        head, *shown = lines(part)
        for one in head.split(" && "):
            found = command_of(one.partition(" > ")[0])
            if found is None:
                continue
            name, words = found
            parse(name, words)
            if words[0] in QUICK[name]:
                output = StringIO()
                drawn = {at + k for at, word in enumerate(words) if word in DRAWN for k in (0, 1)}
                undrawn = [word for at, word in enumerate(words) if at not in drawn]
                with redirect_stdout(output):
                    GROUPS[name].main(undrawn, prog_name=name, standalone_mode=False)
                printed = lines(output.getvalue())
                assert not shown or agree(printed, shown), "\n".join(printed)


@pytest.mark.usefixtures("in_tmp_path", "outlined")
@pytest.mark.parametrize(
    "page", [page for page in PAGES if blocks(page) and page.stem != "gallery"], ids=lambda page: page.stem
)
def test_code_runs_and_prints_what_is_shown(page, tmp_path, monkeypatch, environ, caplog):
    caplog.set_level(logging.NOTSET, "qvi_contact")  # as it is again afterwards: the page on errors makes it talk
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.syspath_prepend(tmp_path)
    environ(PYTHONPATH=tmp_path)
    names, output = {"__name__": "documentation"}, None
    for language, content in blocks(page):
        if language == "python":
            printed = StringIO()
            with redirect_stdout(printed):
                exec(compile(content, page.name, "exec"), names)
            output = lines(printed.getvalue())
        elif language == "text" and output is not None:
            assert agree(output, lines(content)), "\n".join(output)
            output = None
        elif language == "console":
            check_console(content)


def rows_of(path):
    """The cells of all table rows of a page; a bar inside a cell stands behind a backslash."""
    found = [re.split(r"(?<!\\)\|", line)[1:-1] for line in text(path).splitlines() if line.startswith("| ")]
    return [tuple(cell.strip().replace("\\|", "|") for cell in row) for row in found]


def test_every_status_is_explained():
    explained = {row[0].strip("`") for row in rows_of(DOCS / "choosing.md") if len(row) == 3}
    assert {status.value for status in (*Status, *RefinementStatus)} <= explained
    stored = {row[0].strip("`"): row[1] for row in rows_of(DOCS / "studies.md")}
    assert {status: stored.get(status) for status in FAILURES} == dict(FAILURES)
    assert DONE in stored


def test_measures_of_the_certificate_are_those_of_the_code():
    def limit(measure):
        factor = "" if measure.factor == 1.0 else f"{measure.factor:g} "
        return factor + ("tol" if measure.exponent == 1.0 else "tol^(3/4)")

    assert {measure.exponent for measure in MEASURES} <= {1.0, 0.75}
    expected = [(f"`{measure.name}`", limit(measure), measure.meaning, measure.worry) for measure in MEASURES]
    assert [row for row in rows_of(DOCS / "certificate.md") if row in expected] == expected


@pytest.mark.parametrize("package", PACKAGES)
def test_reference_has_every_public_name(package):
    """Constants aside; a thing that two packages offer needs one place."""
    pages = "".join(text(page) for page in (DOCS / "api").glob("*.md"))
    blocks = re.findall(r"```\{public\} (\S+)\n(.*?)```", pages, re.DOTALL)
    paths = [f"{home}.{name}" for home, names in blocks for name in re.findall(r"[\w.]+", names)]
    listed = [named(path) for path in (*paths, *re.findall(r"auto\w+:: (\S+)", pages))]
    module = import_module(package)
    missing = [name for name in module.__all__ if not any(getattr(module, name) is found for found in listed)]
    assert [name for name in missing if not name.isupper() and name not in INTERNAL] == []


def named(path):
    """The object of a dotted name; a function may have the name of its module."""
    home, _, name = path.rpartition(".")
    with suppress(ModuleNotFoundError):
        module = import_module(home)
        return getattr(module, name, None) or import_module(path)
    return getattr(named(home), name)


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.stem)
def test_links_lead_somewhere(path):
    for target in re.findall(r"\]\((?!\w+://)([^)\s]+)\)", text(path)):
        file, _, anchor = target.partition("#")
        found = path.parent / file if file else path
        assert found.exists(), target
        assert not anchor or anchor in anchors(found), target


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.stem)
def test_commands_exist(path):
    """In indented blocks, which show whole commands, and between backticks, where the arguments may be missing."""
    for line in re.findall(r"^ {4,}((?:qvi-contact|python -m comparisons) .+)$", text(path), re.M):
        for command in line.split(" && "):
            parse(*command_of(command))
    for command in re.findall(r"`((?:qvi-contact|python -m comparisons) [^`…]+)`", text(path)):
        with suppress(click.MissingParameter, click.exceptions.Exit):  # --help ends by itself
            parse(*command_of(" ".join(command.split())))


def anchors(path):
    """Names of a page's headings in links."""
    headings = re.findall(r"^#+ (.+)$", text(path), re.M)
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


def test_what_is_wrong_is_found():
    """A command that does not exist; and numbers that differ in more than their last digit."""
    with pytest.raises(click.UsageError):
        check_console("$ qvi-contact solved examples/punch.toml\n")
    assert agree(["P = 1.235", "x", "y", "end"], ["P = 1.234", "…", "end"])
    assert not any(agree(lines, ["P = 1.234"]) for lines in (["P = 1.236"], ["P = 1.234", "more"]))
    assert agree(["solved after 12 iterations; accuracy 1e-14"], ["solved after 11 iterations; …"])
    assert not agree(["failed after 11 iterations; "], ["solved after 11 iterations; …"])
    assert not agree(["-1.5"], ["1.5"])


def test_formulas_lead_to_the_code_and_back():
    """The index of the theory, and the last line of the docstrings of the modules it names."""
    listed, told = set(), set()
    for line in text(DOCS / "theory.md").splitlines():
        if line.startswith("| (D"):
            formulas, files = line.strip("|").split("|")
            listed |= {
                (formula, file)
                for formula in re.findall(r"\(D\d+\)", formulas)
                for file in re.findall(r"`([\w/.]+)`", files)
            }
    for package in ("qvi_contact", "solvers"):
        for path in (ROOT / package).rglob("*.py"):
            for found in re.findall(r"^In `docs/theory\.md`: (.+)\.$", text(path), re.M):
                told |= {(formula, path.relative_to(ROOT).as_posix()) for formula in re.findall(r"\(D\d+\)", found)}
    defined = re.findall(r"^    .+  (\(D\d+\))$", text(DOCS / "theory.md"), re.M)
    assert listed == told
    assert {formula for formula, _ in listed} == set(defined)


def test_files_and_modules_that_texts_name_exist():
    """Paths on pages, and modules in the tables that docstrings of rooms have."""
    named = {ROOT / path for page in TEXTS for path in re.findall(rf"`((?:{'|'.join(FOLDERS)})/[\w/.]+)`", text(page))}
    for room in (path.parent for folder in FOLDERS for path in (ROOT / folder).rglob("__init__.py")):
        modules = re.findall(r"^\| `(\w+)` +\|", text(room / "__init__.py"), re.M)
        named |= {room / name if (room / name).is_dir() else room / f"{name}.py" for name in modules}
    assert len(named) > 50
    assert not [path for path in named if not path.exists()]


def test_the_tree_of_errors_is_the_one_of_the_page():
    rows = re.findall(r"^((?:[│ ]   )*(?:[├└]── )?)(\w+Error) +(\S.*)$", text(DOCS / "errors.md").split("```")[1], re.M)
    above = []
    for indent, name, homes in rows:
        depth = len(indent) // 4
        for home in homes.split("     ")[0].split(", "):
            error = getattr(import_module(home), name)
            assert depth == 0 or issubclass(error, above[depth - 1])
        above[depth:] = [error]
    assert {name for _, name, _ in rows} == {each.__name__ for each in own_errors(above[0])}


def own_errors(root):
    """A class and all that inherit from it, those of tests left out."""
    inside = {each for child in root.__subclasses__() for each in own_errors(child)}
    return {each for each in {root} | inside if each.__module__.split(".")[0] in ("solvers", "qvi_contact")}


@pytest.fixture(scope="module")
def made_by():
    """The commands that make parts of pages, by name; they import each other from their folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DOCS / "_ext")
        yield import_module


@pytest.fixture(scope="module")
def problem_keys(made_by):
    return made_by("problem_keys")


def test_all_keys_on_the_page_are_those_of_the_schema(made_by, problem_keys):
    """Else: python docs/_ext/problem_keys.py."""
    assert made_by("made").made(problem_keys.PAGE, "problem_keys") == problem_keys.tables()


def test_the_gallery_has_every_problem_file_as_it_is(made_by):
    """Else: python docs/_ext/gallery.py with the names of the files that changed."""
    gallery = made_by("gallery")
    found = gallery.sections(made_by("made").made(gallery.PAGE, "gallery"))
    files = sorted(gallery.EXAMPLES.glob("*.toml"))
    assert list(found) == [path.stem for path in files]
    for path in files:
        (output,) = re.findall(r"```text\n(.*?)\n```", found[path.stem], re.S)
        known = re.findall(r"^\|.*\|$", found[path.stem], re.M)
        status = re.search(r"ends with exit status (\d)", found[path.stem])
        pictures = tuple(gallery.PICTURES / f"{path.stem}{end}.png" for end in ("_problem", ""))
        assert all(picture.exists() for picture in pictures)
        quantities = [line.split(" | ")[0] for line in known[2:]]
        assert quantities == [f"| {line.quantity}".replace("|T|", "\\|T\\|") for line in KNOWN[path.stem].lines]
        shown = gallery.example_of(path, output, status and int(status[1]), pictures, "\n".join(known))
        assert found[path.stem] == gallery.section(shown, gallery.PICTURES.name)


def test_every_table_and_key_of_a_problem_file_is_on_the_page_with_an_example_that_is_taken(problem_keys):
    tables = set(problem_keys.HEADINGS.values())
    for heading, table in problem_keys.HEADINGS.items():
        kinds = [key.kind for key in file_keys(table).values()]
        assert {kind.of for kind in kinds if hasattr(kind, "of")} <= tables, heading
        for key in problem_keys.keys(table):
            assert "|" not in key.meaning + key.example, (heading, key.name)
            ((name, value),) = tomllib.loads(key.example).items()
            assert name == key.name
            file_keys(table)[name].kind.read(value, FileReader({}, {}, 0.0))


def test_code_of_the_readme_runs_and_is_certified(capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    codes = [content for language, content in blocks(ROOT / "README.md") if language == "python"]
    for code, start in zip(codes, ["solved", "reached"], strict=True):
        exec(compile(code, "README.md", "exec"), {})
        assert capsys.readouterr().out.startswith(start)


PAGE = text(DOCS / "formats.md")
NAMES = {"base": "CONTACT", "plate": "CONTACT"}
KINDS = {"measures": "MEASURE", "limits": "MEASURE", "signed": "MEASURE", "seconds": "STAGE", "versions": "PACKAGE",
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
        shown = KINDS.get(path[-1], shown) if path else shown
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
