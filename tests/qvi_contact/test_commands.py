"""What the commands other than a plain `qvi-contact solve` say: verify, check, limit, refine, histories, sweeps."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from qvi_contact import InputError, LimitLoad, TriangleMesh, load_problem, refine, save_problem, solve
from qvi_contact.command import limit_sentence
from qvi_contact.export import write_npz
from qvi_contact.files import Archive
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import Contact, ContactProblem, Material, Traction
from qvi_contact.units import Units
from tests.qvi_contact.builders import RICH, refused, told

EXAMPLES = Path(__file__).parents[2] / "examples"
FORCE = "plate.normal_force"


def answered(ending):
    """The document of a command that has ended well."""
    return json.loads(told(ending))


def plate_file(folder, friction, **details):
    """Quarter of the plate on 2 × 2 cells; tied instead of rough without a friction coefficient; with these tables."""
    problem = compressed_plate(friction or 0.2, cells=(2, 2))
    if friction is None:
        tied = Contact.tied("top", gap=-1e-3, name="plate")
        problem = replace(problem, conditions=[*problem.conditions[:-1], tied])
    path = folder / "plate.toml"
    save_problem(path, problem, title="The plate", units=Units("mm", "MPa"))
    with path.open("a", encoding="utf-8") as file:
        file.writelines(f"[{name}]\n{tomli_w.dumps(table)}" for name, table in details.items())
    return path


def example(folder, name, *changes):
    """A coarser copy of an example."""
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in changes:
        text = text.replace(old, new)
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def cycle(tmp_path):
    """Three steps of the cyclic example."""
    coarse = ("cells = 8", "cells = 4"), ("cells = 4", "cells = 2")
    return example(tmp_path, "cyclic_shear", *coarse, ("stop = 2.0, steps = 16", "stop = 0.5, steps = 2"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A problem file, its result, and the result of an iteration that was cut short."""
    path = tmp_path_factory.mktemp("verify")
    plate_file(path, 0.2)
    write_npz(path / "plate.npz", solve(compressed_plate(0.2, (2, 2))))
    write_npz(path / "short.npz", solve(compressed_plate(0.2, (3, 3)), method="fixed-point", max_iterations=3))
    return path


class TestVerify:
    """`qvi-contact verify`."""

    def test_what_solve_has_written_verifies(self, shell, folder, tmp_path):
        assert shell("solve", folder / "plate.toml", "--npz", tmp_path / "a.npz")[0] == 0
        status, out, err = shell("verify", tmp_path / "a.npz")
        assert (status, err, len(out.splitlines())) == (0, "", 1)
        assert out.startswith("verified: ")
        out = shell("verify", tmp_path / "a.npz", "-v")[1]
        assert out.splitlines()[-1].startswith("verified: ")
        assert "natural_map" in out
        assert 'title = "The plate"' in Archive(tmp_path / "a.npz").text("problem")
        document = answered(shell("verify", tmp_path / "a.npz", "--json"))
        assert (document["passed"], document["failures"]) == (True, [])
        assert {"digest", "status", "plate: tractions"} <= {check["name"] for check in document["checks"]}

    def test_a_changed_file_is_status_1_and_says_what(self, shell, folder, tmp_path):
        entries = Archive(folder / "plate.npz").arrays
        stress = entries["plate.tangential_stress"]
        stress[np.abs(stress).argmax()] *= 1.0 + 1e-5
        np.savez(tmp_path / "a.npz", **entries)
        status, out, err = shell("verify", tmp_path / "a.npz")
        assert (status, err) == (1, "")
        wrong = [line.split("  ")[0] for line in out.splitlines() if line.endswith("FAILED")]
        assert wrong == ["digest", "plate: tractions"]
        assert "natural_map" not in out
        assert json.loads(shell("verify", tmp_path / "a.npz", "--json")[1])["failures"] == wrong

    def test_the_tolerance_decides_what_is_good_enough(self, shell, folder):
        status, out, _ = shell("verify", folder / "short.npz")
        assert status == 1
        assert "energy_gap" in out.splitlines()[-1]
        assert shell("verify", folder / "short.npz", "--tolerance", "1e-5")[0] == 0
        refused(shell("verify", folder / "plate.toml"), "qvi-contact: result: ", "plate.toml")
        for tolerance in ("0", "2", "nan", "small"):
            status, out, err = shell("verify", folder / "plate.npz", "--tolerance", tolerance)
            assert (status, out, "tolerance" in err) == (2, "", True)


class TestHistory:
    """Problem files with times."""

    def test_a_table_with_a_row_for_each_step_and_files(self, shell, cycle, tmp_path):
        out = told(shell("solve", cycle, "--npz", tmp_path / "a.npz", "--vtk", tmp_path / "a.vtu"))
        rows = [line.split() for line in out.splitlines() if line[:1].isdigit()]
        assert [row[:3] for row in rows] == [["1", "0", "solved"], ["2", "0.25", "solved"], ["3", "0.5", "solved"]]
        assert shell("verify", tmp_path / "a.npz")[0] == 0
        names = [name.split()[0] for name in pytest.importorskip("meshio").read(tmp_path / "a.vtu").point_data]
        assert ("stress" in names, "displacement" in names) == (True, True)

    @pytest.mark.usefixtures("outlined")
    def test_a_document_and_a_picture(self, shell, cycle, tmp_path):
        document = answered(shell("solve", cycle, "--json", "--plot", tmp_path / "loop.svg"))
        assert document["times"] == [0.0, 0.25, 0.5]
        assert len(document["steps"]) == 3
        lost = document["dissipated"]
        of_steps = [each["energies"]["dissipation"]["value"] for each in document["steps"]]
        assert lost["steps"]["value"] == pytest.approx(of_steps)
        assert lost["total"]["value"] == pytest.approx(sum(lost["steps"]["value"]))
        assert lost["total"]["unit"] == document["steps"][0]["units"]["energy"]
        assert "<svg" in (tmp_path / "loop.svg").read_text(encoding="utf-8")

    def test_a_history_is_neither_swept_nor_refined(self, shell, cycle, tmp_path):
        refused(shell("solve", cycle, "--set", "friction=0.1"), "[history]")
        cycle.write_text(cycle.read_text(encoding="utf-8") + '\n[sweep]\nparameter = "gap"\nvalues = [0.0]\n')
        refused(shell("solve", cycle))
        refused(shell("refine", plate_file(tmp_path, 0.2, history={"times": [0.0, 1.0]})), "history")


class TestCheck:
    """`qvi-contact check` says what was understood."""

    @pytest.mark.usefixtures("outlined")
    def test_everything(self, shell, tmp_path):
        (tmp_path / "rich.toml").write_text(RICH, encoding="utf-8")
        out = told(shell("check", tmp_path / "rich.toml", "--plot", tmp_path / "rich.png"))
        stated = ("friction = 0.3,", "E = 2000 Pa", "max_iterations = 60")
        for words in ("everything", "cells", "unknowns", "joint", *stated):
            assert words in out
        assert (tmp_path / "rich.png").exists()
        strong = told(shell("check", EXAMPLES / "strip_footing.toml"))
        assert ", strength = { law = tresca, c = 50.0 }\n" in strong
        whole = ("meshes/", f"{EXAMPLES}/meshes/"), ('[[contacts]]\nedges = "cross joints"\nfriction = 0.7\n', "")
        assert "\ninner line cross joints: no contact" in told(
            shell("check", example(tmp_path, "jointed_slope", *whole))
        )

    def test_loads_are_added_up(self, shell):
        document = answered(shell("check", EXAMPLES / "gravity_column.toml", "--json"))
        (body,) = document["loads"]
        assert body["name"] == "body"
        assert (body["y"], body["moment"]) == pytest.approx((-98100.0, -98100.0 * 0.5))
        assert document["mesh"]["cells"] == 2 * 6 * 12

    def test_loads_out_of_balance(self, shell, tmp_path):
        free = [Traction(side, x=1.0 if side == "top" else 0.0, y=0.0) for side in ("left", "right", "top", "bottom")]
        problem = ContactProblem(TriangleMesh.rectangle((1, 1)), Material(1.0, 0.0), free)
        save_problem(tmp_path / "free.toml", problem)
        for command in ("check", "solve"):
            refused(shell(command, tmp_path / "free.toml"), "boundary conditions: ", "out of balance")
        mesh = problem.mesh.part([0]).with_edges("rim", lambda x, _: x > -1.0)
        save_problem(path := tmp_path / "one.toml", replace(problem, mesh=mesh, conditions=[Traction("rim", 0.0, 0.0)]))
        assert re.findall("[0-9]+ (?:tri|cell).*?\\b", shell("check", path)[1]) == ["1 triangle", "1 cell"]


@pytest.mark.usefixtures("outlined")
def test_limit(shell, sliding):
    loads = ["--load", "drag"]
    document = answered(shell("limit", sliding, *loads, "--json"))
    assert (document["outcome"], document["factor"]) == ("bounded", pytest.approx(1 / 1.01, rel=1e-6))
    assert document["upper"] == pytest.approx(1 / 1.01, rel=1e-9)
    said = shell("limit", sliding, *loads, *loads, "--plot", picture := sliding.with_name("a.svg"))[1]
    assert said.startswith("drag: this mesh carries 0.99009901 times")  # named once
    assert re.findall("[0-9.-]+", limit_sentence(LimitLoad(-1e-14, 2.0 + 1e-14, None, 2.0, 0.0))) == ["0", "2"]
    lower, upper = 0.1015148965, 0.1015149074
    shown = re.findall("[0-9.]+(?= times)", limit_sentence(LimitLoad(lower, upper, None, lower, 0.0)))
    assert float(shown[0]) <= lower < upper <= float(shown[1])
    assert picture.stat().st_size > 1000
    assert "even 1, may be too small" in shell("limit", sliding, "--load", "pressure")[1]
    refused(shell("limit", sliding, "--load", "nonsense"), "drag")
    refused(shell("limit", sliding), "--load: missing: name one of the loads (", "drag")
    cyclic = EXAMPLES / "cyclic_shear.toml"
    refused(shell("limit", cyclic, "--load", "left"), "multiply. These loads are those at t = 0, the first time")
    said = shell("safety", cyclic, "--accuracy=0.5", "--json")[1]
    assert re.search("at t = 0, the first time.*friction the body may slide", said, re.DOTALL)
    smooth = sliding.with_name("smooth.toml")
    smooth.write_text(re.sub("(mu|T) = [0-9.]+", r"\1 = 0.0", sliding.read_text(encoding="utf-8")), encoding="utf-8")
    assert shell("limit", smooth, "--load", "pressure")[1].endswith("to hold the body.\n")  # and nothing about friction
    late = sliding.with_name("late.toml")
    late.write_text(sliding.read_text(encoding="utf-8") + "[history]\ntimes = [0.5, 2.0, -1.0]\n", encoding="utf-8")
    assert "3 steps, t between -1 and 2; shown at t = 0.5\n" in shell("check", late)[1]
    assert "those at t = 0.5, the first" in shell("limit", late, "--proof", sliding.with_name("a.json"))[1]
    found = answered(shell("limit", sliding, *loads, "--target", "1e-4", "--json"))["refinement"]
    reached = found["status"], found["guaranteed"], found["rounds"], 0.0 <= found["estimate"] <= 1e-4
    assert reached == ("reached", True, 1, True)
    refused(shell("limit", sliding, *loads, "--target", "-1"), "qvi-contact: --target: -1.0")
    refused(shell("limit", sliding, *loads, "--max-unknowns", 9), "--max-unknowns: 9: a mesh of ")


class TestRefine:
    """`qvi-contact refine`: rounds, what the error is, files, and what a problem file says of it."""

    @pytest.mark.usefixtures("outlined")
    def test_a_guaranteed_bound(self, shell, tmp_path):
        """Table and sentence say what the function finds; every file is written, and the archive verifies."""
        page, npz, kept = (tmp_path / name for name in ("page.html", "answer.npz", "answer.json"))
        asked = ("--target", 1e-3, "--quantity", FORCE, "--degree", 4)
        file = plate_file(tmp_path, None)
        status, out, _ = shell("refine", file, *asked, "--report", page, "--npz", npz, "--save-json", kept)
        known = refine(load_problem(file).problem, target=1e-3, quantity=FORCE, degree=4)
        assert (status, known.guaranteed) == (0, True)
        rounds = [[str(r.unknowns), f"{r.value:.9g}", "guaranteed"] for r in known.rounds]
        rows = [line.split() for line in out.splitlines() if re.match(r"\d+ +\d+ ", line)]
        assert [[*row[2:4], row[-1]] for row in rows] == rounds
        assert "This is a guaranteed bound" in out
        assert "friction" not in out
        assert f"{FORCE} [N/mm]" in out
        found = json.loads(kept.read_text(encoding="utf-8"))["refinement"]
        assert [each["unknowns"] for each in found["rounds"]] == [each.unknowns for each in known.rounds]
        assert found["value"] == {"value": pytest.approx(known.value, rel=1e-10), "unit": "N/mm"}
        assert found["estimate"] == pytest.approx(known.estimate, rel=1e-4)
        assert shell("verify", npz)[0] == 0
        said = re.sub(r"<[^>]*>", " ", page.read_text(encoding="utf-8"))
        assert "Refinement of the mesh" in said
        assert f"{known.value:.9g}" in said

    def test_an_estimate_that_misses_its_target(self, shell, tmp_path):
        words = ("refine", plate_file(tmp_path, 0.2), "--target", 1e-9, "--max-rounds", 2, "--degree", 3)
        status, out, _ = shell(*words, "--json")
        found = json.loads(out)
        assert (status, found["status"], found["refinement"]["status"]) == (1, "solved", "rounds")
        assert (found["refinement"]["guaranteed"], len(found["refinement"]["rounds"])) == (False, 2)
        assert found["refinement"]["estimate"] > 1e-9
        text = shell(*words)[1]
        assert "This is an estimate" in text
        assert "raise max_rounds" in text

    def test_bounds_under_friction_where_they_are_asked_for(self, shell, tmp_path):
        def guaranteed(path, *words):
            found = json.loads(shell("refine", path, *words, "--json")[1])["refinement"]
            return [each["guaranteed"] for each in found["rounds"]]

        asked = {"target": 0.02, "quantity": FORCE, "max_rounds": 1}
        path = plate_file(tmp_path, 0.2, solve={"degree": 3}, refine=asked)
        assert guaranteed(path, "--guaranteed") == [True]
        path = plate_file(tmp_path, 0.2, solve={"degree": 3}, refine=asked | {"guaranteed": True})
        assert dict(load_problem(path).refine_options) == asked | {"guaranteed": True}
        assert (guaranteed(path), guaranteed(path, "--estimated")) == ([True], [False])

    def test_the_file_is_overridden(self, shell, tmp_path):
        asked = {"target": 0.05, "quantity": FORCE, "max_rounds": 1, "max_unknowns": 5000}
        path = plate_file(tmp_path, 0.2, solve={"degree": 3}, refine=asked)
        assert dict(load_problem(path).refine_options) == asked
        others = ("--target", 0.5, "--quantity", "energy", "--degree", 4)
        for words, expected in (((), (FORCE, 0.05, 3)), (others, ("energy", 0.5, 4))):
            found = json.loads(shell("refine", path, *words, "--json")[1])
            refinement = found["refinement"]
            assert (refinement["quantity"], refinement["target"], found["element"]["degree"]) == expected

    def test_what_is_wrong_is_named_by_its_path(self, shell, tmp_path):
        path = plate_file(tmp_path, 0.2, refine={"quantity": "plate.force"})
        refused(shell("refine", path), "refine.quantity: ")
        assert "refine: quantity = plate.force" in shell("check", path)[1]
        refused(shell("refine", path, "--quantity", "energy", "--degree", 12), "--degree: 12: ", "from 3 to 11")
        refused(shell("solve", path, "--degree", -1), "--degree: -1: ", "from 3 to 12")
        refused(shell("refine", path, "--quantity", "energy", "--max-unknowns", 1), "--max-unknowns: 1:")


class TestSweep:
    """Values of one number on the command line, or in the file."""

    def test_on_the_command_line(self, shell, tmp_path):
        path = plate_file(tmp_path, 0.2)
        picture = tmp_path / "a.svg"
        document = answered(shell("solve", path, "--set", "friction=0.1,0.3", "--json", "--plot", picture))
        assert "friction = 0.3" in picture.read_text(encoding="utf-8")  # that of the last value
        assert (document["solved"], document["friction"]) == (True, [0.1, 0.3])
        alone = [solve(compressed_plate(mu, (2, 2))).contacts["plate"].normal_force for mu in (0.1, 0.3)]
        found = [step["contacts"]["plate"]["normal_force"]["value"] for step in document["steps"]]
        assert found == pytest.approx(alone, rel=1e-9)
        named = ("plate.gap=0,1e-4", "\nadded gap of plate [mm] "), ("plate.friction=0.1,0.2", "\nfriction of plate ")
        for given, heading in (("gap=0,1e-4", "added gap [mm]"), ("load=1,0.5", "load factor"), *named):
            assert heading in shell("solve", path, "--set", given)[1]
        out = shell("solve", example(tmp_path, "preloaded_joint"), "--set", "load=1,2")[1]
        assert "\nremark, first at load = 2: Nothing determines" in out  # where the base opens
        rough = shell("solve", path, "--set", "friction=1.1,1.2")[1]
        assert (rough.count("Friction is"), "first at friction = 1.1: Friction is 1.1" in rough) == (1, True)
        path = example(tmp_path, "dragged_block_holds", ("cells = 8", "cells = 2"), ("cells = 4", "cells = 2"))
        small, large = (line.split() for line in shell("solve", path, "--set", "load=1,1e12")[1].splitlines()[-5:-3])
        assert float(large[3]) == pytest.approx(1e12 * float(small[3]), rel=1e-4)  # rounding is each value's own

    def test_in_a_problem_file(self, shell, tmp_path):
        path = plate_file(tmp_path, 0.2)
        sweep = '\n[sweep]\nparameter = "friction"\nvalues = { start = 0.1, stop = 0.3, steps = 2 }\n'
        path.write_text(path.read_text(encoding="utf-8").replace('"plate"', '"a=b.c"') + sweep, encoding="utf-8")
        status, out, _ = shell("solve", path)
        rows = [line.split() for line in out.splitlines() if line[:2] == "0."]
        assert (status, [row[:2] for row in rows]) == (0, [[value, "solved"] for value in ("0.1", "0.2", "0.3")])
        assert "sweep: friction, 3 values" in shell("check", path)[1]
        assert answered(shell("solve", path, "--set", "a=b.c.gap=0.0,1e-4", "--json"))["gap"] == [0.0, 1e-4]

    def test_constants_of_the_file_and_loads_by_name(self, shell, tmp_path, monkeypatch):
        changes = ("cells = 8", "cells = 2"), ("cells = 4", "cells = 2"), ('"drag"', '"a.b"')
        path = example(tmp_path, "dragged_block_holds", *changes)

        def force(*words):
            steps = answered(shell("solve", path, *words, "--json"))["steps"]
            return [step["contacts"]["base"]["tangential_force"]["value"] for step in steps]

        whole, half = force("--set", "load.a.b=1,0.5")
        assert half == pytest.approx(0.5 * whole, rel=1e-6)
        assert force("--set", "mu=0.9", "--set", "a.b.load=1.0") == pytest.approx([whole], rel=1e-6)
        assert force("--set", "mu=0.8,0.9") == pytest.approx([whole, whole], rel=1e-6)
        assert shell("solve", path, "--set", "constants.mu=0.8:0.9:2")[1].count("\nmu ") == 1
        assert force("--set", "T=0.1", "--set", "p=0.5,1.0") == pytest.approx([-0.2, -0.2], rel=1e-6)
        shell("solve", path, "--set", "mu=0.1,0.9", "--report", tmp_path / "a.html")
        assert "<p>mu = 0.1: The load exceeds" in (tmp_path / "a.html").read_text(encoding="utf-8")  # no Mu
        late = shell("solve", path, "--set", "mu=0.8,0.9", "--method=condensed", "--time-limit=1e-9", "--json")
        assert [step["status"] for step in json.loads(late[1])["steps"]] == ["time_limit"]
        refused(shell("solve", path, "--set", "nu=0.1,0.2"), "--set: 'nu': name one of", "constants (p, mu, T)")
        refused(shell("solve", path, "--set", "mu=0.1=0.2"), "'1': name one of", "gap, offset)\n")
        refused(shell("solve", path, "--set", "mu=0.1,1e100"), "constants.mu: 1e+100: give at most 1e+60")
        refused(shell("solve", path, "--set", "mu=0.1,0.2", "--store", tmp_path / "a.sqlite"), "--store")
        text, seen = path.read_text(encoding="utf-8"), []
        monkeypatch.setattr("qvi_contact.bracket.bracket", lambda _, time_limit: seen.append(time_limit))
        path.write_text(f"{text}[solve]\ntime_limit = 50.0\n", encoding="utf-8")
        assert shell("solve", path, "--set", "mu=0.8,0.9", "--vtk", tmp_path / "a.vtu")[0] == 0
        assert seen == [50.0]  # the second solve, for displacements, had no limit
        path.write_text(text.replace("mu = ", "load = ").replace('"mu"', '"load"'), encoding="utf-8")
        assert force("--set", "constants.load=0.8,0.9") == pytest.approx([whole, whole], rel=1e-6)  # no factor of loads
        with pytest.raises(InputError, match="name one of the constants"):
            load_problem(path).with_constants({"mu": 0.1})

    @pytest.mark.parametrize(
        "words",
        ["friction", "friction=", "=0.1", "friction=a,b", "young=1.0", "friction=-0.1", "friction=nan", "no.gap=0.1"],
    )
    def test_bad_values(self, shell, tmp_path, words):
        refused(shell("solve", plate_file(tmp_path, 0.2), "--set", words), "qvi-contact: --set: ")

    def test_one_number_is_swept_at_a_time(self, shell, tmp_path):
        """The first of two was left out without a word."""
        path = example(tmp_path, "dragged_block_holds")
        for one, other in (("friction=0.1", "gap=0.0"), ("p=1", "p=2"), ("p=3", "p=1,2")):
            refused(shell("solve", path, "--set", one, "--set", other), f"--set: '{one} {other}': ")


def test_guaranteed_example_with_all_files(shell, tmp_path):
    """A stack of blocks that only friction holds along its joints: the bounds and displacements."""
    fields = tmp_path / "moved.vtu"
    status, out, _ = shell("bracket", EXAMPLES / "stacked_blocks.toml", "--vtk", fields)
    assert (status, "as contacts alone hold a body" in out) == (0, True)
    assert ".normal_force between" in out
    assert b"displacement" in fields.read_bytes()


def test_one_json_document(shell, tmp_path):
    found = answered(shell("bracket", plate_file(tmp_path, 0.2), "--json", "--degree", 3))
    bounds = found["bracket"]["energies"]
    assert bounds["lower"]["value"] < bounds["upper"]["value"]
    coulomb, degree = found["bracket"]["coulomb"], found["bracket"]["companion"]["degree"]
    assert (coulomb["kind"], degree, found["status"]) == ("guaranteed", 3, "solved")
    assert 0.0 < coulomb["solutions_apart"] < 0.5
    force = found["bracket"]["forces"]["plate.normal_force"]
    assert (force["lower"] < force["upper"], force["unit"]) == (True, "N/mm")
    assert sum(part["value"] for part in found["bracket"]["gap"].values()) > 0.0


@pytest.mark.parametrize(
    ("words", "field"),
    [(["cyclic_shear.toml"], "history"), (["punch.toml", "--degree", 7], "degree"),
     (["punch.toml", "--tolerance", 0.5], "tolerance")],
)  # fmt: skip
def test_refusals(shell, words, field):
    refused(shell("bracket", EXAMPLES / words[0], *words[1:]), field)
