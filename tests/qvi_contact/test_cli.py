"""The command `qvi-contact`: what is wrong is one line and status 2, files are written beside the report."""

import json
import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest
from click.shell_completion import BashComplete
from hypothesis import HealthCheck, example, given, settings

from qvi_contact import load_problem, save_problem, solve
from qvi_contact.command.cli import group
from qvi_contact.gallery import compressed_plate
from qvi_contact.units import Units
from solvers import available
from solvers.factorisation import DENSE, available_backends
from solvers.settings import METHODS
from tests.cases import examples
from tests.qvi_contact.builders import TRIANGLES, mutated, refused, told

ROOT = Path(__file__).parents[2]
OWN = {"comparisons", "qvi_contact", "solvers"}


def ran(*words, **options):
    """A process of Python's own that has ended."""
    line = [sys.executable, *map(str, words)]
    return subprocess.run(line, capture_output=True, text=True, timeout=60, check=False, **options)


@pytest.fixture
def plate(tmp_path):
    path = tmp_path / "plate.toml"
    problem = compressed_plate(0.2, cells=(3, 3))
    save_problem(path, problem, title="The plate", units=Units("mm", "MPa"))
    path.write_text(f"{path.read_text(encoding='utf-8')}[solve]\ndamping = 0.6\n", encoding="utf-8")
    return path


def test_help_and_what_is_unknown(shell):
    out = told(shell("--help"))
    assert "..." not in out.partition("Commands:")[2]  # no summary is cut off on 80 columns
    status, out, err = shell()
    assert (status, out) == (2, "")
    assert {"methods", "solve"} < set(err.split())
    for words in (("solv",), ("--jsn",), ("methods", "--jsn"), ("methods", "extra")):
        refused(shell(*words), words[-1])


def loaded_by(module, *words):
    """Names of what a command loads in a process of its own, beyond Python."""
    code = f"""
import sys
before = set(sys.modules)
from {module} import group
try:
    group.main({list(map(str, words))})
except SystemExit:
    print(*set(sys.modules) - before, file=sys.stderr)
"""
    return set(ran("-c", code).stderr.split())


@pytest.mark.parametrize("module", ["qvi_contact.command.cli", "comparisons.cli"])
def test_help_imports_nothing_but_click(module):
    """So that it comes at once; numpy alone would take as long again, and solvers several times that."""
    loaded = {name.partition(".")[0] for name in loaded_by(module, "--help")} - sys.stdlib_module_names
    assert "click" in loaded
    assert loaded - {"colorama"} <= {"click", *OWN}  # colorama: on Windows


def test_an_interrupt_while_the_command_is_loaded_leaves_no_traceback():
    stop = "type('', (), {'__getattr__': lambda *_: exec('raise KeyboardInterrupt')})()"
    code = f"import sys; sys.modules['qvi_contact.command.cli'] = {stop}; import qvi_contact.__main__ as m; m.main()"
    done = ran("-c", code)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


def test_a_solve_imports_of_scipy_what_it_needs():
    """Arrays and their factorisations: other parts would take a third of the time of a small solve."""
    loaded = loaded_by("qvi_contact.command.cli", "solve", ROOT / "examples" / "wedge.toml")
    assert {"scipy.sparse", "scipy.linalg"} <= loaded
    assert not loaded & {"scipy.optimize", "scipy.spatial"}


def test_methods(shell):
    known = json.loads(told(shell("methods", "--json")))
    others = {DENSE: "up to 400 unknowns"}
    assert known["factorisation"] == {**others, **available_backends()}
    assert (known["methods"], known["inner"]) == (list(METHODS), list(available()))
    assert set(METHODS) | set(available()) | set(available_backends()) <= set(shell("methods")[1].split())


def test_keys(shell):
    status, out, _ = shell("keys")
    assert (status, len(out.splitlines()) > 20) == (0, True)
    _, out, _ = shell("keys", "contacts.friction")
    assert out.splitlines()[0] == "[[contacts]]"
    assert out.splitlines()[-1].split() == ["friction", "=", "0.3"]
    assert "largest: number; needed" in shell("keys", "mesh.refine")[1]
    refused(shell("keys", "frictoin"), "did you mean friction?")


def test_solve_reports_what_python_computes(shell, plate):
    out = told(shell("solve", plate))
    line = solve(load_problem(plate).problem).contacts["plate"]
    assert out.splitlines()[0] == "The plate"
    assert "certificate passed" in out
    row = next(row.split() for row in out.splitlines() if row.startswith("plate "))
    numbers = line.normal_force, line.tangential_force, -line.normal_stress.min()
    assert [float(word) for word in row[1:4]] == pytest.approx(numbers, rel=1e-5)
    assert sum(float(word) for word in row[4::2]) == pytest.approx(100.0, abs=0.2)
    assert "peak [MPa]" in out
    document = json.loads(shell("solve", plate, "--json")[1])
    assert (document["solved"], document["title"]) == (True, "The plate")
    assert document["contacts"]["plate"]["normal_force"]["value"] == pytest.approx(line.normal_force, rel=1e-9)


def test_what_cannot_be_carried_is_said_once(shell, sliding):
    """Status, reason and advice, whatever the command has tried."""
    for command in ("solve", "refine", "bracket"):
        status, out, err = shell(command, sliding)
        assert (status, err) == (1, "")
        assert [out.count(words) for words in ("infeasible", "friction on 'base'", "reduce the tension")] == [1, 1, 1]
    status, out, _ = shell("solve", sliding, "--json")
    assert (status, json.loads(out)["solved"]) == (1, False)


def test_files_are_written_beside_the_report(shell, plate, sliding, tmp_path):
    """Fields have the displacement of the second model."""
    meshio = pytest.importorskip("meshio")
    files = {"--vtk": "a.vtu", "--npz": "a.npz", "--save-json": "a.json"}
    targets = [part for option, file in files.items() for part in (option, tmp_path / file)]
    out = told(shell("solve", plate, *targets))
    assert out.startswith("The plate")
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["solved"] is True
    assert all((tmp_path / name).stat().st_size > 100 for name in (*files.values(), "a_contacts.vtu"))
    result, grid = solve(load_problem(plate).problem), meshio.read(tmp_path / "a.vtu")
    (moved,) = (values for name, values in grid.point_data.items() if name.startswith("displacement"))
    assert moved[:, :2] == pytest.approx(result.displacement(*grid.points[:, :2].T), abs=1e-9)
    status, _, err = shell("solve", sliding, "--vtk", tmp_path / "b.vtu")
    assert (status, "no stress state" in err, (tmp_path / "b.vtu").exists()) == (1, True, False)


@pytest.mark.usefixtures("outlined")
def test_charts_are_those_of_panels(shell, plate, tmp_path):
    told(shell("solve", plate, "--plot", tmp_path / "a.svg", "--panels", "none"))
    assert "traction [MPa]" not in (tmp_path / "a.svg").read_text(encoding="utf-8")
    refused(shell("solve", plate, "--panels", "plate"), "--panels: ", "give --plot or --report")
    refused(shell("solve", plate, "--plot", tmp_path / "a.svg", "--panels", "plat"), "--panels: ", "'plate'")


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [("--method", "", "method"), ("--method", "nonsense", "uzawa"), ("--inner", "qp:nonsense", "qp:clarabel"),
     ("--threads", str(10**30), "threads"), ("--tolerance", "2", "between 0 and 1"), ("--time-limit", "nan", "nan")],
)  # fmt: skip
def test_options_that_mean_nothing_list_what_there_is(shell, plate, option, value, words):
    ending = shell("solve", plate, option, value)
    refused(ending, option, words)
    assert "None" not in ending[2]


@pytest.mark.usefixtures("in_tmp_path")
@pytest.mark.parametrize(
    ("options", "words"),
    [(["--plot", "a.jpeg"], ".png"),
     (["--plot", "missing/a.png"], "cannot be written"), (["--vtk", ""], "name of a file"), (["--npz", "-"], "name of"),
     (["--vtk", "a.vtk"], "ends in .vtu"), (["--npz", "."], "name of a file"),
     (["--save-json", "plate.toml"], "the problem file"),
     (["--save-json", "soft.json"], "the problem file"),
     (["--save-json", "hard.json"], "the problem file"),
     (["--save-json", "a.npz", "--npz", "a.npz"], "the file of --npz"),
     (["--save-json", "a_contacts.vtu", "--vtk", "a.vtu"], "the file of --vtk")],
)  # fmt: skip
def test_targets_are_checked_before_the_problem_is_read(shell, plate, options, words):
    """It is none, which would be said otherwise; and it stays as it is, whatever other name of it is given."""
    plate.write_text("no problem", encoding="utf-8")
    plate.with_name("soft.json").symlink_to(plate)
    plate.with_name("hard.json").hardlink_to(plate)
    refused(shell("solve", "plate.toml", *options), f"{options[0]}: ", words)
    assert plate.read_text(encoding="utf-8") == "no problem"


def test_files_that_the_problem_reads_are_kept(shell, tmp_path):
    mesh = tmp_path / "trapezoid.msh"
    mesh.write_bytes((ROOT / "examples" / "meshes" / mesh.name).read_bytes())
    text = (ROOT / "examples" / "trapezoid.toml").read_text(encoding="utf-8").replace("meshes/", "")
    (tmp_path / "a.toml").write_text(text, encoding="utf-8")
    assert load_problem(tmp_path / "a.toml").files == {mesh.name: mesh}
    refused(shell("solve", tmp_path / "a.toml", "--save-json", mesh), "--save-json: ", "that the problem reads")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_what_cannot_be_written_costs_nothing_else(shell, plate, tmp_path, monkeypatch):
    """The disk is full for one file, a library fails: the report and the others come, with a line and status 2."""
    npz, fields = tmp_path / "a.npz", tmp_path / "a.vtu"
    status, out, err = shell("solve", plate, "--save-json", "/dev/full", "--npz", npz, "--vtk", fields)
    assert (status, len(err.splitlines()), npz.exists(), fields.exists()) == (2, 1, True, True)
    assert err.startswith("qvi-contact: --save-json: '/dev/full': ")
    assert "certificate passed" in out
    page = tmp_path / "\udcff.html"  # a name that is no UTF-8; the page repeats the command
    monkeypatch.setattr("qvi_contact.plots.save_figure", Mock(side_effect=OSError(24, "no fonts")))
    status, out, err = shell("solve", plate, "--plot", tmp_path / "a.png", "--report", page)
    assert (status, len(err.splitlines()), "passed" in out, page.exists()) == (2, 1, True, True)
    assert err.startswith(f"qvi-contact: --plot: '{tmp_path}/a.png': cannot be written (no fonts)")
    swept = "--set", "friction=0.1,0.2", "--store", tmp_path / "a.sqlite"
    status, out, err = shell("solve", plate, *swept, "--save-json", "/dev/full")
    assert (status, len(err.splitlines()), "2 solved" in out) == (2, 1, True)


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="no /dev/stdout")
def test_standard_output_by_its_name(shell, plate):
    """The document and then the report, in the file that the shell has opened."""
    text = told(shell("solve", plate, "--save-json", "/dev/stdout"))
    document, end = json.JSONDecoder().raw_decode(text)
    assert document["solved"] is True
    assert text[end:].strip().startswith("The plate")


NOISY = """
import atexit, ctypes, os, sys
os.rmdir(os.getcwd())
import qpsolvers, scipy.optimize
from qvi_contact.command.cli import main

def noisy(plain):
    def call(*words, **settings):
        os.write(1, b"noise")
        ctypes.CDLL(None).printf(b"noise")
        print("noise")
        atexit.register(os.write, 1, b"noise")
        return plain(*words, **settings)
    return call

qpsolvers.solve_problem = noisy(qpsolvers.solve_problem)
scipy.optimize.linprog = noisy(scipy.optimize.linprog)
main()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="the C library is found by another name")
def test_json_is_json_whatever_a_back_end_prints_and_where_it_runs(sliding, tmp_path):
    """While it runs, or when the process ends; a mechanism is looked for too. The working folder is deleted."""
    folder = tmp_path / "gone"
    folder.mkdir()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    words = ("-P", "-c", NOISY, "solve", sliding, "--inner", "qp:clarabel", "--json")
    done = ran(*words, cwd=folder, env=environment)
    assert json.loads(done.stdout)
    assert done.stderr == ""


def test_options_override_the_file(shell, plate):
    status, out, _ = shell("solve", plate, "--method", "uzawa", "--tolerance", "1e-3")  # without the file's damping
    assert status in (0, 1)
    assert "damping" not in out
    text = plate.read_text(encoding="utf-8")
    plate.write_text(text.replace("[solve]", '[solve]\ninner = "qp:nonsense"'), encoding="utf-8")
    assert shell("solve", plate, "--inner", "qp:clarabel")[0] == 0
    refused(shell("solve", plate), "solve.inner: 'qp:nonsense'", "qp:clarabel")


@pytest.mark.parametrize(
    ("command", "option", "begun", "expected"),
    [("solve", "--method", "", {"condensed", "fixed-point", "pivoting", "uzawa"}),
     ("solve", "--factorisation", "m", {"multifrontal"}), ("refine", "--inner", "direct:cl", {"direct:clarabel"})],
)  # fmt: skip
def test_the_shell_completes_what_can_be_used(command, option, begun, expected):
    complete = BashComplete(group, {}, "qvi-contact", "_QVI_CONTACT_COMPLETE")
    assert {found.value for found in complete.get_completions([command, option], begun)} == expected


def test_too_little_time_is_status_1_with_the_state_so_far(shell, plate, tmp_path):
    """By option, and by the file."""
    for words in (["solve", plate, "--method", "condensed", "--vtk", tmp_path / "a.vtu"], ["bracket", plate]):
        status, out, err = shell(*words, "--time-limit", "1e-9", "--json")
        assert (status, json.loads(out)["status"], err) == (1, "time_limit", "")
    assert (tmp_path / "a.vtu").exists()
    text = plate.read_text(encoding="utf-8")
    plate.write_text(text.replace("[solve]", "[solve]\ntime_limit = 1e-9"), encoding="utf-8")
    assert "time limit after" in shell("solve", plate)[1]
    assert shell("solve", plate, "--time-limit", "60")[0] == 0
    plate.write_text(text.replace("[solve]", "[solve]\ntime_limit = -1.0"), encoding="utf-8")
    refused(shell("solve", plate), "solve.time_limit: -1.0")


def test_broken_files_end_in_one_helpful_line(shell, tmp_path):
    """Most of the generated files are broken; those that are not are solved, or not, and checked."""
    path, endings = tmp_path / "broken.toml", []

    @settings(max_examples=examples(40), derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
    @given(mutated() | mutated(TRIANGLES))
    @example(TRIANGLES.encode())
    def one_file(content):
        path.write_bytes(content)
        status, out, err = shell("solve", path)
        endings.append(status)
        if status == 2:
            refused((status, out, err))
            assert len(err) > 30
        else:
            assert (status in (0, 1), err) == (True, "")
            told(shell("check", path))

    one_file()
    assert examples(28) <= endings.count(2) < len(endings)
