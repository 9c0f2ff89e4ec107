"""The command `qvi-contact`, and what all command lines of the project share."""

import errno
import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.shell_completion import BashComplete
from hypothesis import HealthCheck, given, settings
from rich.console import Console

from qvi_contact import ContactProblem, Material, RectilinearMesh, Traction, load_problem, save_problem, solve
from qvi_contact.basics import terminal
from qvi_contact.cli import group
from qvi_contact.command import solve_line
from qvi_contact.errors import InputError, SolveError
from qvi_contact.gallery import compressed_plate
from qvi_contact.units import Units
from solvers import available
from solvers.basics.files import _put as put
from solvers.basics.watch import Progress, tell
from solvers.factorisation import available_backends
from solvers.factorisation.choice import SHARED
from solvers.factorisation.levels import LEVELS
from solvers.solve import METHODS
from tests.effort import examples
from tests.qvi_contact.broken_files import RICH, mutated

EXAMPLES = Path(__file__).parent.parent.parent / "examples"
OWN = {"comparisons", "qvi_contact", "solvers"}


def command(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "qvi_contact", *arguments], capture_output=True, text=True, timeout=60, check=False
    )


def test_help():
    done = command("--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert "methods" in done.stdout
    assert "..." not in done.stdout.partition("Commands:")[2]  # no summary is cut off on 80 columns


@pytest.mark.parametrize("module", ["qvi_contact.cli", "comparisons.cli"])
def test_help_imports_nothing_but_click(module):
    """So that it comes at once; numpy alone would take as long again, and solvers several times that."""
    code = f"""
import sys
before = set(sys.modules)
from {module} import group
try:
    group.main(["--help"])
except SystemExit:
    loaded = {{name.partition(".")[0] for name in set(sys.modules) - before}}
    print(*loaded - set(sys.stdlib_module_names), file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert set(done.stderr.split()) - {"colorama"} <= {"click", *OWN}  # colorama: on Windows
    assert "click" in done.stderr.split()


@pytest.mark.parametrize("arguments", [("solv",), ("--jsn",), ("methods", "--jsn"), ("methods", "extra")])
def test_what_is_unknown_is_one_line_and_status_2(arguments):
    done = command(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("qvi-contact: ")
    assert arguments[-1] in done.stderr


def test_no_command_shows_the_commands_and_fails():
    done = command()
    assert done.returncode == 2
    assert done.stdout == ""
    assert "methods" in done.stderr
    assert "Traceback" not in done.stderr


def test_methods_as_one_json_document(shell):
    status, out, err = shell("methods", "--json")
    assert (status, err) == (0, "")
    factorisations = {
        SHARED: "uniform rectangles of one material", LEVELS: "a few hundred unknowns", **available_backends(),
    }  # fmt: skip
    strict = [*available("strict"), *available("strict-direct")]
    expected = {
        "methods": list(METHODS), "inner": list(available()), "strict": strict, "factorisation": factorisations,
    }  # fmt: skip
    assert "strict-direct:clarabel" in strict
    assert json.loads(out) == expected


def test_methods_as_a_list(shell):
    status, out, err = shell("methods")
    assert (status, err) == (0, "")
    assert set(METHODS) | set(available()) | set(available_backends()) <= set(out.split())


def ending(capsys, raised):
    """Exit status and standard error of a command that raises."""

    @click.command()
    def failing():
        raise raised

    arguments = sys.argv
    sys.argv = ["tool"]
    try:
        with pytest.raises(SystemExit) as caught:
            terminal.run(failing, "tool")
    finally:
        sys.argv = arguments
    out, err = capsys.readouterr()
    assert out == ""
    return caught.value.code, err


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (InputError("Material.young", -1.0, "give a number greater than 0"), "Material.young: -1.0: give a number"),
        (SolveError("stalled\n  after 3\titerations"), "stalled after 3 iterations"),
        (click.UsageError("two\nlines"), "two lines"),
        (click.BadParameter("not a number"), "not a number"),
    ],
)
def test_wrong_input_is_one_line_and_status_2(capsys, error, words):
    status, err = ending(capsys, error)
    assert status == 2
    assert err.startswith("tool: ")
    assert words in err
    assert err.count("\n") == 1
    assert err.endswith("\n")


@pytest.mark.parametrize("error", [KeyboardInterrupt(), click.Abort()])
def test_an_interrupted_command_says_so(capsys, error):
    status, err = ending(capsys, error)
    assert status == 130
    assert err.split() == ["tool:", "interrupted"]


def test_a_fault_of_the_program_is_not_blamed_on_the_input(monkeypatch):
    @click.command()
    def failing():
        raise ZeroDivisionError

    monkeypatch.setattr(sys, "argv", ["tool"])
    with pytest.raises(ZeroDivisionError):
        terminal.run(failing, "tool")


def test_a_solve_under_way_is_shown_on_a_terminal(monkeypatch):
    """Method, iteration and residual; that one method takes the place of another one stays on the screen."""
    screen = io.StringIO()
    monkeypatch.setattr(terminal, "error_console", lambda: Console(file=screen, force_terminal=True, width=100))
    monkeypatch.setattr(solve_line, "Timer", AtOnce)
    with solve_line.solving("[plate]", 3) as advance:
        advance()
        tell(Progress("fixed-point", remark="the condensed method ended stalled"))
        solve(compressed_plate(0.2, (3, 3)))
    shown = screen.getvalue()
    assert "[plate]" in shown
    assert "1/3" in shown
    assert re.search(r"condensed: iteration \d+, residual \d\.\de-", shown)
    assert "the condensed method ended stalled; next method: fixed-point\n" in shown


@pytest.mark.parametrize("at_once", [False, True])
def test_a_short_solve_and_one_off_a_terminal_are_silent(monkeypatch, capfd, at_once):
    if at_once:
        monkeypatch.setattr(solve_line, "Timer", AtOnce)
    with solve_line.solving("plate") as advance:
        solve(compressed_plate(0.2, (3, 3)))
        tell(Progress("fixed-point", remark="the condensed method ended stalled"))
        advance()
    assert capfd.readouterr() == ("", "")


class AtOnce:
    """A timer that does not wait."""

    def __init__(self, _, function):
        self.start = function

    def cancel(self):
        pass


@pytest.fixture
def plate(tmp_path):
    path = tmp_path / "plate.toml"
    problem = compressed_plate(0.2, cells=(3, 3))
    save_problem(path, problem, title="The plate", units=Units("mm", "MPa"), solve_options={"damping": 0.6})
    return path


@pytest.fixture
def sliding(tmp_path):
    """A block with more shear than friction can carry."""
    path = tmp_path / "sliding.toml"
    text = (EXAMPLES / "dragged_block_slides.toml").read_text(encoding="utf-8")
    path.write_text(text.replace("cells = 8", "cells = 2").replace("cells = 4", "cells = 2"), encoding="utf-8")
    return path


@pytest.fixture
def cycle(tmp_path):
    """Three steps of the cyclic example."""
    path = tmp_path / "cycle.toml"
    text = (EXAMPLES / "cyclic_shear.toml").read_text(encoding="utf-8")
    text = text.replace("cells = 8", "cells = 4").replace("cells = 4", "cells = 2")
    path.write_text(text.replace("stop = 2.0, steps = 16", "stop = 0.5, steps = 2"), encoding="utf-8")
    return path


@pytest.fixture
def shell(capsys, monkeypatch):
    """Run the command in this process; exit status, standard output, standard error."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["qvi-contact", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "qvi-contact")
        return (caught.value.code, *capsys.readouterr())

    return call


def test_solve_reports_what_python_computes(shell, plate):
    status, out, err = shell("solve", plate)
    assert (status, err) == (0, "")
    line = solve(load_problem(plate).problem).contacts["plate"]
    assert out.splitlines()[0] == "The plate"
    assert "\nsolved after" in out
    assert "certificate passed" in out
    row = next(row for row in out.splitlines() if row.startswith("plate "))
    assert float(row.split()[1]) == pytest.approx(line.normal_force, rel=1e-5)
    assert float(row.split()[2]) == pytest.approx(line.tangential_force, rel=1e-5)
    shares = [float(word) for word in row.split()[3::2]]
    assert sum(shares) == pytest.approx(100.0, abs=0.2)
    assert "[N/mm]" in out


def test_solve_as_json(shell, plate):
    status, out, err = shell("solve", plate, "--json")
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert document["solved"] is True
    assert document["title"] == "The plate"
    force = solve(load_problem(plate).problem).contacts["plate"].normal_force
    assert str(round(force, 6)) in json.dumps(json.loads(out, parse_float=lambda text: str(round(float(text), 6))))


def test_a_load_beyond_friction_is_status_1_with_the_reason(shell, sliding):
    status, out, err = shell("solve", sliding)
    assert (status, err) == (1, "")
    assert "friction on 'base'" in out
    status, out, err = shell("solve", sliding, "--json")
    assert (status, err) == (1, "")
    assert json.loads(out)["solved"] is False
    assert "friction on 'base'" in out


def test_files_are_written_beside_the_report(shell, plate, tmp_path):
    files = {"--plot": "a.png", "--vtk": "a.vtu", "--npz": "a.npz", "--save-json": "a.json"}
    status, out, err = shell("solve", plate, *(str(part) for o, f in files.items() for part in (o, tmp_path / f)))
    assert (status, err) == (0, "")
    assert out.startswith("The plate")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["solved"] is True
    assert all((tmp_path / name).stat().st_size > 100 for name in (*files.values(), "a_contacts.vtu"))


def test_without_a_state_there_are_no_fields(shell, sliding, tmp_path):
    status, _, err = shell("solve", sliding, "--vtk", tmp_path / "a.vtu", "--plot", tmp_path / "a.png")
    assert status == 1
    assert "no stress state" in err
    assert not (tmp_path / "a.vtu").exists()
    assert (tmp_path / "a.png").exists()


@pytest.fixture
def gone(tmp_path, monkeypatch):
    """A working folder that is deleted."""
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()


@pytest.mark.usefixtures("gone")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--plot", "a.png"), "--plot: 'a.png': cannot be written (No such file or directory)"),
        (("--save-json", "a.json"), "--save-json: 'a.json': cannot be written (No such file or directory)"),
    ],
)
def test_a_deleted_working_folder_is_one_line(shell, plate, arguments, words):
    status, out, err = shell("solve", plate, *arguments)
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert words in err


@pytest.mark.skipif(sys.platform == "win32", reason="folders in use cannot be deleted")
def test_a_deleted_working_folder_does_not_matter_where_nothing_is_written(plate, tmp_path):
    """In a process of its own, which some libraries would end."""
    code = f"""
import os, sys
os.rmdir(os.getcwd())
from qvi_contact.cli import main
sys.argv = ["qvi-contact", "solve", {str(plate)!r}]
main()
"""
    folder = tmp_path / "gone"
    folder.mkdir()
    root = str(Path(__file__).parent.parent.parent)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "certificate passed" in done.stdout


def test_a_wrong_back_end_of_matplotlib_is_one_line(plate, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "qvi_contact", "solve", plate, "--plot", tmp_path / "a.png"],
        env=os.environ | {"MPLBACKEND": "nonsense"}, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (2, "", 1)
    assert "MPLBACKEND: 'nonsense'" in done.stderr
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize(
    ("option", "value"), [("--method", ""), ("--inner", ""), ("--factorisation", ""), ("--threads", str(10**30))]
)
def test_options_that_mean_nothing(shell, plate, option, value):
    status, out, err = shell("solve", plate, option, value)
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert option.removeprefix("--") in err


@pytest.mark.parametrize(
    ("option", "target", "words"),
    [
        ("--plot", "a.jpeg", ".png"),
        ("--plot", "missing/a.png", "cannot be written"),
        ("--vtk", "", "name of a file"),
        ("--vtk", "a.vtk", "ends in .vtu"),
        ("--npz", ".", "name of a file"),
        ("--save-json", "plate.toml", "the problem file"),
    ],
)
def test_targets_are_checked_before_the_work(shell, plate, monkeypatch, option, target, words):
    monkeypatch.setattr("qvi_contact.files.problem_file.load_problem", None)
    monkeypatch.chdir(plate.parent)
    status, out, err = shell("solve", "plate.toml", option, target)
    assert (status, out) == (2, "")
    assert err.startswith(f"qvi-contact: {option}: ")
    assert words in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("make", ["symlink_to", "hardlink_to"])
def test_another_name_of_the_problem_file_is_no_target(shell, plate, make):
    other = plate.with_name("other.json")
    getattr(other, make)(plate)
    before = plate.read_bytes()
    status, _, err = shell("solve", plate, "--save-json", other)
    assert status == 2
    assert "the problem file" in err
    assert plate.read_bytes() == before


def test_what_cannot_be_written_costs_nothing_else(shell, plate, tmp_path, monkeypatch):
    """The disk is full for one of three files: the report and the others come, with a line and status 2."""

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(
        "solvers.basics.files._put", lambda *files: (full if files[1].suffix == ".json" else put)(*files)
    )
    json_file, npz, fields = tmp_path / "a.json", tmp_path / "a.npz", tmp_path / "a.vtu"
    status, out, err = shell("solve", plate, "--save-json", json_file, "--npz", npz, "--vtk", fields)
    assert (status, len(err.splitlines())) == (2, 1)
    assert err.startswith(f"qvi-contact: --save-json: '{json_file}': cannot be written (No space left on device)")
    assert "certificate passed" in out
    assert (json_file.exists(), npz.exists(), fields.exists()) == (False, True, True)


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="no /dev/stdout")
def test_standard_output_by_its_name(plate, monkeypatch, capfd):
    """The document and then the report, in the file that the shell has opened: here that of `capfd`."""
    monkeypatch.setattr(sys, "argv", ["qvi-contact", "solve", str(plate), "--save-json", "/dev/stdout"])
    with pytest.raises(SystemExit) as caught:
        terminal.run(group, "qvi-contact")
    text, err = capfd.readouterr()
    assert (caught.value.code, err) == (0, "")
    document, end = json.JSONDecoder().raw_decode(text)
    assert document["solved"] is True
    assert text[end:].strip().startswith("The plate")


NOISY = """
import atexit, ctypes, os, sys
import qpsolvers, scipy.optimize
from qvi_contact.cli import main

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
@pytest.mark.parametrize("words", [("solve", "--inner", "qp:clarabel"), ("limit", "--load", "thrust")])
def test_json_is_json_whatever_a_back_end_prints(words):
    """While it runs, or when the process ends."""
    line = [sys.executable, "-c", NOISY, words[0], str(EXAMPLES / "gravity_dam.toml"), *words[1:], "--json"]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)
    assert done.stderr == ""


def test_what_stands_at_the_target_is_kept(shell, plate, tmp_path):
    link, target = tmp_path / "link.json", tmp_path / "target.json"
    link.symlink_to(target)
    assert shell("solve", plate, "--save-json", link)[0] == 0
    assert link.is_symlink()
    assert json.loads(target.read_text(encoding="utf-8"))["solved"] is True


def test_two_options_cannot_share_a_file(shell, plate, tmp_path):
    status, _, err = shell("solve", plate, "--npz", tmp_path / "a.npz", "--save-json", tmp_path / "a.npz")
    assert status == 2
    assert "the file of --npz too" in err


def test_options_override_the_file(shell, plate):
    status, out, _ = shell("solve", plate, "--method", "uzawa", "--tolerance", "1e-3")  # without the file's damping
    assert status in (0, 1)
    assert "damping" not in out
    text = plate.read_text(encoding="utf-8")
    plate.write_text(text.replace("[solve]", '[solve]\ninner = "qp:nonsense"'), encoding="utf-8")
    assert shell("solve", plate, "--inner", "qp:clarabel")[0] == 0
    status, _, err = shell("solve", plate)
    assert status == 2
    assert "solve.inner: 'qp:nonsense'" in err
    assert "qp:clarabel" in err


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--method", "nonsense", "uzawa"),
        ("--inner", "qp:nonsense", "qp:clarabel"),
        ("--tolerance", "2", "between 0 and 1"),
        ("--time-limit", "nan", "nan"),
        ("--time-limit", "0", "0.0"),
    ],
)
def test_unknown_options_list_what_there_is(shell, plate, option, value, words):
    status, out, err = shell("solve", plate, option, value)
    assert (status, out) == (2, "")
    assert err.startswith(f"qvi-contact: {option}: ")
    assert words in err
    assert "None" not in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("command", "option", "begun", "expected"),
    [
        ("solve", "--method", "", {"condensed", "fixed-point", "pivoting", "uzawa"}),
        ("solve", "--factorisation", "s", {"shared-subdomains", "superlu"}),
        ("refine", "--inner", "direct:cl", {"direct:clarabel"}),
    ],
)
def test_the_shell_completes_what_can_be_used(command, option, begun, expected):
    complete = BashComplete(group, {}, "qvi-contact", "_QVI_CONTACT_COMPLETE")
    assert {found.value for found in complete.get_completions([command, option], begun)} == expected


def test_what_cannot_be_carried_is_said_once(shell, sliding):
    """The status and the advice, whatever the command has tried."""
    for command in ("solve", "refine", "bracket"):
        status, out, err = shell(command, sliding)
        assert (status, err) == (1, "")
        assert out.count("infeasible") == 1
        assert out.count("reduce the tension") == 1


def test_too_little_time_is_status_1_with_the_state_so_far(shell, plate, cycle, tmp_path):
    limited = "--method", "condensed", "--time-limit", "1e-9"
    status, out, err = shell("solve", plate, *limited, "--json", "--vtk", tmp_path / "a.vtu")
    assert (status, err) == (1, "")
    document = json.loads(out)
    assert (document["status"], document["solved"]) == ("time_limit", False)
    assert (tmp_path / "a.vtu").exists()
    status, out, err = shell("solve", cycle, "--time-limit", "1e-9")
    assert (status, err) == (1, "")
    assert out.splitlines()[-1].startswith("step 1 of 3: time limit after ")
    status, out, err = shell("bracket", plate, "--time-limit", "1e-9", "--json")
    assert (status, err) == (1, "")
    assert json.loads(out)["status"] == "time_limit"
    status, out, err = shell("limit", cycle, "--load", "ground", "--time-limit", "-1")
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 1


def test_the_time_limit_of_the_file(shell, plate):
    text = plate.read_text(encoding="utf-8")
    plate.write_text(text.replace("[solve]", "[solve]\ntime_limit = 1e-9"), encoding="utf-8")
    assert "time limit after" in shell("solve", plate)[1]
    assert "time limit after" in shell("solve", plate, "--method", "condensed")[1]
    assert "time limit after" in shell("bracket", plate)[1]
    assert shell("solve", plate, "--time-limit", "60")[0] == 0
    plate.write_text(text.replace("[solve]", "[solve]\ntime_limit = -1.0"), encoding="utf-8")
    status, _, err = shell("solve", plate)
    assert status == 2
    assert "solve.time_limit: -1.0" in err


def test_a_history_is_a_table(shell, cycle):
    status, out, err = shell("solve", cycle)
    assert (status, err) == (0, "")
    rows = [line.split() for line in out.splitlines() if line[:1].isdigit()]
    assert [row[:3] for row in rows] == [["1", "0", "solved"], ["2", "0.25", "solved"], ["3", "0.5", "solved"]]
    assert "all 3 steps solved" in out


def test_a_history_as_json_and_picture(shell, cycle, tmp_path):
    status, out, err = shell("solve", cycle, "--json", "--plot", tmp_path / "loop.svg")
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert document["times"] == [0.0, 0.25, 0.5]
    assert len(document["steps"]) == 3
    assert "<svg" in (tmp_path / "loop.svg").read_text(encoding="utf-8")


def test_check_says_what_was_understood(shell, tmp_path):
    rich = tmp_path / "rich.toml"
    rich.write_text(RICH, encoding="utf-8")
    status, out, err = shell("check", rich, "--plot", tmp_path / "rich.png")
    assert (status, err) == (0, "")
    for words in ("everything", "cells", "unknowns", "joint", "friction = mu", "E = 2000 Pa", "max_iterations = 60"):
        assert words in out
    assert (tmp_path / "rich.png").exists()


def test_check_shows_forces_of_zero_that_let_an_obstacle_move(shell):
    """Without a force it would stand still in that direction."""
    status, out, err = shell("check", EXAMPLES / "lug.toml")
    assert (status, err) == (0, "")
    assert "force_y = 0.0" in out
    assert "rotation = 0.0" in out


@pytest.mark.parametrize(("given", "heading"), [("gap=0,1e-4", "added gap [mm]"), ("load=1,0.5", "load factor")])
def test_sweeps_say_what_their_values_do(shell, plate, given, heading):
    assert heading in shell("solve", plate, "--set", given)[1]


def test_check_as_json_adds_up_the_loads(shell):
    status, out, err = shell("check", EXAMPLES / "gravity_column.toml", "--json")
    assert (status, err) == (0, "")
    document = json.loads(out)
    (body,) = document["loads"]
    assert body["name"] == "body"
    assert body["y"] == pytest.approx(-98100.0)
    assert body["moment"] == pytest.approx(-98100.0 * 0.5)
    assert document["mesh"]["cells"] == 2 * 6 * 12


def test_check_finds_loads_out_of_balance(shell, tmp_path):
    free = [Traction(side, x=1.0 if side == "top" else 0.0, y=0.0) for side in ("left", "right", "top", "bottom")]
    mesh = RectilinearMesh.rectangle((1, 1))
    save_problem(tmp_path / "free.toml", ContactProblem(mesh, Material(1.0, 0.0), free))
    for command in ("check", "solve"):
        status, out, err = shell(command, tmp_path / "free.toml")
        assert (status, out) == (2, "")
        assert "boundary conditions: " in err
        assert "out of balance" in err


def test_limit(shell, sliding):
    loads = ["--load", "drag"]
    status, out, err = shell("limit", sliding, *loads, "--json")
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert document["outcome"] == "bounded"
    assert document["factor"] == pytest.approx(1 / 1.01, rel=1e-6)
    assert document["upper"] == pytest.approx(1 / 1.01, rel=1e-9)
    picture = sliding.with_name("sliding.svg")
    assert "0.99009901 times" in shell("limit", sliding, *loads, "--plot", picture)[1]
    assert picture.stat().st_size > 1000
    status, _, err = shell("limit", sliding, "--load", "nonsense")
    assert status == 2
    assert "drag" in err


def test_limit_to_a_target(shell, sliding):
    loads = ["--load", "drag"]
    status, out, err = shell("limit", sliding, *loads, "--target", "1e-4", "--element", "hct", "--json")
    assert (status, err) == (0, "")
    refinement = json.loads(out)["refinement"]
    assert (refinement["status"], refinement["guaranteed"], refinement["rounds"]) == ("reached", True, 1)
    assert 0.0 <= refinement["estimate"] <= 1e-4
    status, out, err = shell("limit", sliding, *loads, "--target", "-1")
    assert (status, out) == (2, "")
    assert err.startswith("qvi-contact: --target: -1.0")


@pytest.mark.parametrize("name", ["solve", "check", "limit"])
def test_a_missing_file_is_one_line(shell, name):
    status, out, err = shell(name, "missing.toml", *(["--load", "a"] if name == "limit" else []))
    assert (status, out) == (2, "")
    assert "file: 'missing.toml': cannot be read" in err
    assert len(err.splitlines()) == 1


def test_broken_files_end_in_one_helpful_line(shell, tmp_path):
    """Most of the generated files are broken; those that are not are solved, or not, and checked."""
    path, endings = tmp_path / "broken.toml", []

    @settings(max_examples=examples(60), derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
    @given(mutated())
    def one_file(content):
        path.write_bytes(content)
        status, out, err = shell("solve", path)
        endings.append(status)
        if status == 2:
            assert out == ""
            assert len(err.splitlines()) == 1
            assert err.startswith("qvi-contact: ")
            assert len(err) > 30
        else:
            assert status in (0, 1)
            assert err == ""
            status, out, err = shell("check", path)
            assert (status, err) == (0, "")

    one_file()
    assert endings.count(2) >= examples(42)
    assert endings.count(0) >= examples(1)


@pytest.mark.parametrize("content", [b"\xff", b"version = 1\n[mesh]\nx = 3", b"x = [", b""])
def test_broken_files_end_alike(shell, tmp_path, content):
    (tmp_path / "broken.toml").write_bytes(content)
    status, out, err = shell("solve", tmp_path / "broken.toml")
    assert (status, out) == (2, "")
    assert len(err.splitlines()) == 1


def test_a_terminal_without_greek_gets_question_marks(monkeypatch, capsysbinary):
    screen = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(screen, encoding="latin-1"))
    monkeypatch.setattr(sys, "argv", ["qvi-contact", "check", str(EXAMPLES / "punch.toml")])
    with pytest.raises(SystemExit) as caught:
        terminal.run(group, "qvi-contact")
    sys.stdout.flush()
    assert (caught.value.code, capsysbinary.readouterr().err) == (0, b"")
    assert b"? = 0.3" in screen.getvalue()
