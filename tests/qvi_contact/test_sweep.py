"""Sweeps: the answers of single solves, one factorisation, and what a failing value or the time does."""

import json
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Traction,
    load_problem,
    solve,
    solve_sweep,
)
from qvi_contact.basics.units import Units
from qvi_contact.command.cli import group
from qvi_contact.gallery import compressed_plate
from solvers import Status
from solvers.factorisation import registry
from solvers.factorisation.base import Factorisation


def pushed(shear=0.1, friction=0.3):
    """A block pressed on the ground, and pushed to the side by its upper and right side."""
    mesh = RectilinearMesh.rectangle((3, 2), 2.0, 1.0)
    sides = [Traction("left", x=0.0, y=-shear), Traction("right", x=0.0, y=shear)]
    top = [Traction("top", x=shear, y=-1.0, name="push")]
    return ContactProblem(mesh, Material(1e3, 0.2), [Contact("bottom", friction, name="base"), *top, *sides])


PLATE = compressed_plate(0.2, (6, 6))

SWEEPS = {
    "friction": ((0.1, 0.3, 0.2), lambda mu: compressed_plate(mu, (6, 6))),
    "gap": ((0.0, -1e-4, 1e-4), lambda shift: compressed_plate(0.2, (6, 6), displacement=1e-3 - shift)),
    "offset": (
        (0.0, 2e-5),
        lambda w: replace(
            PLATE, conditions=[replace(c, offset=w) if isinstance(c, Contact) else c for c in PLATE.conditions]
        ),
    ),
}


@pytest.mark.parametrize("element", ["bfs", "hct"])
@pytest.mark.parametrize("parameter", SWEEPS)
def test_every_value_has_the_answer_of_a_solve_of_its_own(parameter, element):
    values, single = SWEEPS[parameter]
    sweep = solve_sweep(PLATE, parameter, values, element=element)
    assert sweep.status is Status.SOLVED
    for value, step in zip(values, sweep.steps, strict=True):
        alone = solve(single(value), element=element)
        line, expected = step.contacts["plate"], alone.contacts["plate"]
        assert step.certificate.passed
        assert line.normal_force == pytest.approx(expected.normal_force, rel=1e-10)
        assert line.tangential_force == pytest.approx(expected.tangential_force, abs=1e-10 * expected.normal_force)
        assert step.energies.strain == pytest.approx(alone.energies.strain, rel=1e-10)


def test_one_factorisation_serves_all_values(monkeypatch):
    made = []
    factorise = registry.factorise
    monkeypatch.setattr("solvers.factorisation.choice.factorise", lambda *a, **k: made.append(1) or factorise(*a, **k))
    sweep = solve_sweep(PLATE, "friction", [0.1, 0.2, 0.3, 0.4], factorisation="superlu")
    assert sweep.status is Status.SOLVED
    assert len(made) == 1
    first, *others = (step.discretization.qvi for step in sweep.steps)
    assert all(qvi.K is first.K and qvi.operator is first.operator for qvi in others)


@pytest.mark.parametrize("parameter", ["friction", "gap"])
def test_what_friction_does_not_change_is_eliminated_once(parameter, monkeypatch):
    """The state at rest: one elimination less for each value of friction after the first, not for those of a gap."""
    count, counts = [0], []
    reduce = Factorisation.reduce
    monkeypatch.setattr(Factorisation, "reduce", lambda *given: count.append(1) or reduce(*given))

    def told(_, result):
        counts.append(len(count) - 1 - len(result.solution.corrections) - 1)  # one for each, and one to certify
        count[:] = [0]

    sweep = solve_sweep(
        PLATE, parameter, [0.1, 0.2, 0.3] if parameter == "friction" else [0.0, -1e-4, 1e-4], callback=told
    )
    assert sweep.status is Status.SOLVED
    assert np.diff(counts)[1] == 0
    assert counts[1] == (0 if parameter == "friction" else 1)


def test_starts_that_are_never_near_are_tried_ever_more_seldom():
    """A punch whose contact grows with each value."""
    sides = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    punch = Contact("top", 0.3, lambda x, y: 0.02 * (x - 1.0) ** 2 + 0.0 * y)
    mesh = RectilinearMesh.rectangle((12, 4), 2.0, 1.0)
    layer = ContactProblem(mesh, Material(1e3, 0.3), [punch, Displacement("bottom", x=0.0, y=0.0), *sides])
    depths = -0.001 * np.array([1.0, 3.0, 6.0, 10.0, 15.0, 20.0, 30.0, 40.0])
    warm, cold = (solve_sweep(layer, "gap", depths, element="bfs", warm_start=warm) for warm in (True, False))
    assert [step.solution.near for step in warm.steps] == [None, False, None, False, None, None, False, None]
    assert [step.solution.near for step in cold.steps] == [None] * 8
    more = [one.iterations - other.iterations for one, other in zip(warm.steps, cold.steps, strict=True)]
    assert [number for number, extra in enumerate(more) if extra] == [1, 3, 6]
    near = solve_sweep(layer, "gap", [-0.02, -0.0201, -0.0202], element="bfs")
    assert [step.solution.near for step in near.steps] == [None, True, True]


def test_a_load_factor_multiplies_named_loads():
    problem = pushed(shear=0.0)
    base, top, *sides = problem.conditions
    problem = replace(problem, conditions=[base, replace(top, x=0.1), *sides])
    found = solve_sweep(problem, "load", [0.5, 2.0], of=["push"])
    for factor, step in zip(found.values, found.steps, strict=True):
        line = step.contacts["base"]
        assert (line.normal_force, abs(line.tangential_force)) == pytest.approx((2.0 * factor, 0.2 * factor), abs=1e-8)


def test_a_value_without_an_answer_does_not_end_the_sweep():
    seen = []
    problem = pushed()
    sweep = solve_sweep(problem, "friction", [0.5, 0.05, 0.4], callback=lambda number, _: seen.append(number))
    assert seen == [1, 2, 3]
    assert [step.status is Status.SOLVED for step in sweep.steps] == [True, False, True]
    assert sweep.status is sweep.steps[1].status is Status.INFEASIBLE
    assert "friction = 0.05" in sweep.message


def test_the_time_limit_keeps_what_was_done():
    sweep = solve_sweep(PLATE, "friction", [0.1, 0.2, 0.3], callback=lambda *_: time.sleep(0.4), time_limit=0.4)
    assert len(sweep.steps) == 1
    assert sweep.status is Status.TIME_LIMIT


def test_as_a_table():
    frame = solve_sweep(PLATE, "gap", [0.0, -1e-4]).to_frame(Units("mm", "MPa"))
    assert frame["gap [mm]"].tolist() == [0.0, -1e-4]
    assert frame["contact"].tolist() == ["plate", "plate"]
    forces = frame[[name for name in frame if name.startswith("normal_force")]].to_numpy().ravel()
    assert forces[1] > forces[0]


@pytest.mark.parametrize(
    ("parameter", "values", "of", "field"),
    [("mu", [0.1], None, "parameter"), ("friction", [], None, "values"), ("friction", [-0.1], None, "values"),
     ("gap", [np.nan], None, "values"), ("gap", 1.0, None, "values"), ("gap", "0.1", None, "values"),
     ("friction", [0.1], ["base"], "of"), ("friction", [0.1], "plate", "of"), ("load", [1.0], ["base"], "of"),
     ("load", [1.0], [], "of")],
)  # fmt: skip
def test_bad_sweeps_are_refused(parameter, values, of, field):
    with pytest.raises(InputError) as caught:
        solve_sweep(PLATE, parameter, values, of)
    assert caught.value.field == field


def test_values_by_way_of_a_history_are_other_problems():
    """A sweep of offsets up and down ends where it began; a history does not."""
    path = [0.0, 3e-4, 0.0]
    forces = [step.contacts["plate"].tangential_force for step in solve_sweep(PLATE, "offset", path).steps]
    assert forces[2] == pytest.approx(forces[0], rel=1e-8)
    assert all(abs(one - other) > 1e-3 * abs(one) for one, other in pairwise(forces))


FILE = Path(__file__).parents[2] / "examples" / "compressed_plate.toml"


def command(*arguments):
    """Exit status and output of qvi-contact."""
    outcome = CliRunner().invoke(group, [str(word) for word in arguments], standalone_mode=False)
    if isinstance(outcome.exception, InputError):
        return 2, str(outcome.exception)
    assert outcome.exception is None, outcome.output
    return outcome.return_value, outcome.output


def test_values_on_the_command_line():
    status, out = command("solve", FILE, "--element", "bfs", "--set", "friction=0.1,0.3", "--json")
    document = json.loads(out)
    assert (status, document["solved"], document["friction"]) == (0, True, [0.1, 0.3])
    alone = [solve(replace_friction(load_problem(FILE).problem, mu), element="bfs") for mu in (0.1, 0.3)]
    found = [next(iter(step["contacts"].values()))["normal_force"]["value"] for step in document["steps"]]
    assert found == pytest.approx([next(iter(each.contacts.values())).normal_force for each in alone], rel=1e-9)


def replace_friction(problem, mu):
    """The problem with another coefficient of friction in all contacts."""
    changed = [replace(c, friction=mu) if isinstance(c, Contact) else c for c in problem.conditions]
    return replace(problem, conditions=changed)


def test_values_in_a_problem_file(tmp_path):
    text = FILE.read_text(encoding="utf-8")
    path = tmp_path / "sweep.toml"
    sweep = '\n[sweep]\nparameter = "friction"\nvalues = { start = 0.1, stop = 0.3, steps = 2 }\n'
    path.write_text(text + sweep, encoding="utf-8")
    name = load_problem(path).problem.contacts[0].name
    status, out = command("solve", path, "--element", "bfs", "--certificate")
    rows = [line.split() for line in out.splitlines() if line[:2] == "0."]
    assert status == 0
    assert [row[:2] for row in rows] == [["0.1", "solved"], ["0.2", "solved"], ["0.3", "solved"]]
    assert "friction = 0.3" in out
    assert "sweep: friction, 3 values" in command("check", path)[1]
    named = command("solve", path, "--element", "bfs", "--set", f"{name}.gap=0.0,1e-4", "--json")
    assert list(json.loads(named[1])["gap"]) == [0.0, 1e-4]


@pytest.mark.parametrize(
    "words",
    [
        "friction",
        "friction=",
        "=0.1",
        "friction=a,b",
        "young=1.0",
        "friction=-0.1",
        "friction=nan",
        "nobody.friction=0.1",
    ],
)
def test_bad_values_on_the_command_line(words):
    status, message = command("solve", FILE, "--set", words)
    assert status == 2
    assert message.startswith("--set: ")


def test_one_number_is_swept_at_a_time():
    """The first of two was left out without a word."""
    status, message = command("solve", FILE, "--set", "friction=0.1", "--set", "gap=0.0")
    assert status == 2
    assert message.startswith("--set: 'friction=0.1 gap=0.0': ")


def test_a_history_is_not_swept(tmp_path):
    cycle = FILE.parent / "cyclic_shear.toml"
    assert "[history]" in command("solve", cycle, "--set", "friction=0.1")[1]
    path = tmp_path / "both.toml"
    text = cycle.read_text(encoding="utf-8")
    path.write_text(f'{text}\n[sweep]\nparameter = "gap"\nvalues = [0.0]\n', encoding="utf-8")
    assert command("solve", path)[0] == 2
