"""Problem files: what is read is what was written, and what is wrong is one error that says where and what to do."""

import dataclasses
import time
import tomllib
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Expression,
    InputError,
    Material,
    Polynomial,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    load_problem,
    save_problem,
    solve,
)
from qvi_contact.files.problem_document import SolveTable
from qvi_contact.files.problem_file import ELEMENT_OPTIONS, problem_from_toml
from qvi_contact.files.problem_writer import problem_to_toml
from qvi_contact.gallery import compressed_plate
from qvi_contact.units import Units
from solvers.condensed.method import CondensedOptions
from solvers.fixed_point import FixedPointOptions
from solvers.uzawa import UzawaOptions
from tests.effort import examples
from tests.qvi_contact.broken_files import PRINTED, RICH

SMALL = """
version = 1
[mesh]
x = [0.0, 1.0]
y = [0.0, 1.0]
[material]
young = 1000.0
poisson = 0.3
[[symmetry]]
edges = "bottom"
[[symmetry]]
edges = "left"
[[tractions]]
edges = "right"
x = 0.0
y = 0.0
[[contacts]]
edges = "top"
friction = 0.2
gap = -1e-3
"""


def same(first, second):
    """Whether two problems are the same up to the order of kinds of conditions."""
    a, b = first.mesh, second.mesh
    lines = np.array_equal(a.x, b.x) and np.array_equal(a.y, b.y) and np.array_equal(a.active, b.active)
    kinds = (Symmetry, Displacement, Traction, Contact)
    sort = [[[c for c in p.conditions if isinstance(c, kind)] for kind in kinds] for p in (first, second)]
    rest = [(p.material, p.body_potential, [(r.material, r.x, r.y) for r in p.regions]) for p in (first, second)]
    return lines and dict(a.named) == dict(b.named) and sort[0] == sort[1] and rest[0] == rest[1]


def refusal(text):
    with pytest.raises(InputError) as caught:
        problem_from_toml(text)
    assert len(str(caught.value).splitlines()) == 1
    return caught.value


def test_a_file_means_what_the_gallery_makes(tmp_path):
    problem = compressed_plate(0.2, cells=(3, 2), grading=0.7)
    save_problem(
        tmp_path / "plate.toml", problem, title="Plate", units=Units("mm", "MPa"), solve_options={"damping": 0.4}
    )
    file = load_problem(tmp_path / "plate.toml")
    assert same(file.problem, problem)
    assert (file.title, file.units, dict(file.solve_options)) == ("Plate", Units("mm", "MPa"), {"damping": 0.4})
    answers = [solve(p).contacts["plate"].normal_force for p in (problem, file.problem)]
    assert answers[0] == answers[1]


numbers = st.floats(-1e6, 1e6)
positive = st.floats(1e-6, 1e6)
constants = {"p": 2.5, "mu": 0.3}
texts = st.sampled_from(["x", "1e-3 * sin(pi * x) + y", "where(x < 0.5, y, 2)", "hypot(x, y) / 3"])
expressions = texts.map(Expression) | st.sampled_from(["p * x", "p + y"]).map(lambda text: Expression(text, {"p": 2.5}))
timed = st.just(Expression("mu * t * x", {"mu": 0.3}, 0.7))
polynomials = st.lists(st.lists(numbers, min_size=1, max_size=3), min_size=1, max_size=3).map(Polynomial)
fields = numbers | expressions | timed | polynomials
frictions = st.floats(0.0, 2.0) | st.sampled_from(["abs(x)", "hypot(x, y) / 3"]).map(Expression)
names = st.text(PRINTED, min_size=1, max_size=8)


@st.composite
def lines(draw):
    steps = draw(st.lists(st.floats(0.1, 3.0), min_size=2, max_size=4))
    return draw(st.floats(-5.0, 5.0)) + np.concatenate([[0.0], np.cumsum(steps)])


@st.composite
def problems(draw):
    """Problems that are consistent, not all of them solvable: a corner may be cut off, a joint or plate be there."""
    x, y = draw(lines()), draw(lines())
    active = np.ones((len(y) - 1, len(x) - 1), dtype=bool)
    if draw(st.booleans()):
        active[-1, -1] = False
    name = draw(names.filter(lambda text: text not in ("bottom", "right", "top", "left")))
    mesh = RectilinearMesh(x, y, active).with_edges(name, "top", stop=x[1], at=y[-1])
    conditions = [Displacement("left", x=draw(fields), y=draw(fields)), Symmetry("bottom")]
    conditions += [Traction("right", x=draw(fields), y=draw(fields), name=draw(st.just("") | names))]
    law = {"cohesion": draw(frictions), "shear_limit": draw(st.none() | frictions)}
    plate = draw(st.none() | st.builds(RigidPlate, force_x=st.none() | numbers, force_y=numbers))
    gap, offset = draw(fields), draw(fields)
    conditions.append(Contact(name, draw(frictions), gap, offset, draw(st.just("") | names), **law, plate=plate))
    mesh, rest = _rest_of_top(mesh, x, y, active)
    conditions += [Traction(edges, x=0.0, y=draw(fields)) for edges in rest]
    if draw(st.booleans()):
        mesh = mesh.with_joint("joint", "vertical", at=x[1], stop=y[1])
        conditions.append(draw(st.sampled_from([Contact.tied("joint"), Contact("joint", 0.5, law="bilateral")])))
    material = Material(draw(positive), draw(st.floats(-0.5, 0.49)), "strain")
    regions = [Region(Material(draw(positive), 0.2, "strain"), x=(x[0], x[1]))] if draw(st.booleans()) else []
    return ContactProblem(mesh, material, conditions, draw(fields), regions)


def _rest_of_top(mesh, x, y, active):
    """Names for the edges that face upwards, beside the contact."""
    found = []
    if active[-1, 1:].any():
        mesh, found = mesh.with_edges("rest", "top", start=x[1], at=y[-1]), ["rest"]
    if not active[-1, -1]:
        mesh, found = mesh.with_edges("step", "top", at=y[-2]), [*found, "step"]
    return mesh, found


@settings(max_examples=examples(20), derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(problems())
def test_round_trip(problem):
    text = problem_to_toml(problem)
    file = problem_from_toml(text)
    assert same(file.problem, problem)
    assert same(problem_from_toml(problem_to_toml(file.problem)).problem, problem)
    assert (file.times == (0.7,)) == ("t *" in text)


def test_masks_become_rectangles():
    generator = np.random.default_rng(3)
    found = 0
    while found < 20:
        mask = generator.random((5, 6)) < 0.85
        try:
            mesh = RectilinearMesh(np.arange(7.0) ** 1.5, np.arange(6.0), mask)
        except InputError:
            continue  # not one piece
        free = [Traction(side, x=0.0, y=0.0) for side in ("right", "top", "left", "bottom")]
        again = problem_from_toml(problem_to_toml(ContactProblem(mesh, Material(1.0, 0.0), free))).problem
        assert np.array_equal(again.mesh.active, mask)
        found += 1


def test_written_files_are_for_people():
    text = problem_to_toml(compressed_plate(0.2, cells=(40, 2)), title='Więckowski\'s "plate"')
    assert tomllib.loads(text)["title"] == 'Więckowski\'s "plate"'
    assert '[[contacts]]\nedges = "top"\nfriction = 0.2\ngap = -0.001\nname = "plate"\n' in text
    assert max(map(len, text.splitlines())) <= 120
    assert len(text.splitlines()) < 45  # grid lines are not one a line


def plate(**changes):
    problem = compressed_plate(0.2)
    contact = dataclasses.replace(problem.conditions[-1], **changes)
    return dataclasses.replace(problem, conditions=[*problem.conditions[:-1], contact])


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"gap": lambda x, y: x * y}, "contacts[0].gap", "Expression"),
        ({"gap": Expression("a", {"a": 1.0}), "offset": Expression("a", {"a": 2.0})}, "contacts[0].offset", "rename"),
        ({"gap": Expression("t", t=1.0), "offset": Expression("t", t=2.0)}, "contacts[0].offset", "one time"),
        ({"name": "two\nlines"}, "contacts[0].name", "one line"),
    ],
)
def test_what_a_file_cannot_hold_is_refused(tmp_path, changes, field, words):
    with pytest.raises(InputError, match=words) as caught:
        save_problem(tmp_path / "plate.toml", plate(**changes))
    assert caught.value.field == field
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        ("version = 1", "", "version", "add this key"),
        ("version = 1", "version = 2", "version", "give 1"),
        ("version = 1", "version = true", "version", "give 1"),
        ("[mesh]", "[msh]", "msh", "did you mean mesh"),
        ("friction = 0.2", "frictoin = 0.2", "contacts[0].frictoin", "did you mean friction"),
        ("friction = 0.2", "", "contacts[0].friction", "coefficient of friction"),
        ("friction = 0.2", "friction = -0.2", "contacts[0].friction", "at least 0"),
        ("friction = 0.2", 'friction = "x - 0.5"', "contacts[0].friction", "found this one at x = 0"),
        ("friction = 0.2", "friction = true", "contacts[0].friction", "give a number"),
        ("friction = 0.2", "friction = nan", "contacts[0].friction", "finite"),
        ("friction = 0.2", "friction = 1e300", "contacts[0].friction", "finite"),
        ("friction = 0.2", 'friction = "mu"', "contacts[0].friction", "mu is not a known name"),
        ("gap = -1e-3", 'gap = "g"\n[constants]\ngrip = 0.1', "contacts[0].gap", "there are x, y, t, pi, grip"),
        ("friction = 0.2", "friction = \"__import__('os')\"", "contacts[0].friction", "not a known function"),
        ("friction = 0.2", "friction = { polynomial = [] }", "contacts[0].friction", "at least one"),
        ("friction = 0.2", 'friction = "t"', "contacts[0].friction", "[history]"),
        ("friction = 0.2", 'friction = 0.2\nlaw = "bilatral"', "contacts[0].law", "did you mean 'bilateral'"),
        ("friction = 0.2", "friction = 0.2\nplate = {}", "contacts[0].plate", "at least one of force_x"),
        ("friction = 0.2", 'friction = 0.2\nplate = { force_y = "x" }', "contacts[0].plate.force_y", "one number"),
        (
            "friction = 0.2",
            "friction = 0.2\nplate = { x = 0.0, force_x = 1.0 }",
            "contacts[0].plate.force_x",
            "leave one",
        ),
        ("gap = -1e-3", "pin = { centre = [0, 0], force_y = 1.0 }", "contacts[0].pin.radius", "add this key"),
        ("gap = -1e-3", "pin = { centre = [0, 0], radius = 0, y = 0 }", "contacts[0].pin.radius", "greater than 0"),
        ("gap = -1e-3", "pin = { centre = [0, 0], radius = 1 }", "contacts[0].pin", "at least one of force_x"),
        ("gap = -1e-3", "gap = 1.0\npin = { centre = [0, 0], radius = 1, x = 0 }", "contacts[0].pin", "leave out gap"),
        ("[[contacts]]", "[contacts]", "contacts", "double brackets"),
        ('edges = "top"', 'edges = "to"', "contacts[0].edges", "[[edges]]"),
        ('edges = "right"', 'edges = "top"', "contacts[0]", "already has the condition"),
        ('[[symmetry]]\nedges = "left"', "", "boundary conditions", "add [[tractions]]"),
        ("x = [0.0, 1.0]", "x = [0.0, 0.0]", "mesh.x", "increasing"),
        ("x = [0.0, 1.0]", "x = { stop = 1.0, cells = 2 }", "mesh.x.start", "add this key"),
        ("x = [0.0, 1.0]", "x = { start = 0, stop = 1.0, cells = 2.5 }", "mesh.x.cells", "whole number"),
        ("x = [0.0, 1.0]", "x = { start = 0, stop = 1.0, cells = 100000000000 }", "mesh.x.cells", "at most"),
        (
            "x = [0.0, 1.0]",
            "x = [{ start = 0, stop = 1, cells = 1 }, { stop = 0.5, cells = 1 }]",
            "mesh.x[1].stop",
            "great",
        ),
        ("y = [0.0, 1.0]", "y = [0.0, 1.0]\nremove = [{ x = [0.0, 1.0] }]", "mesh.remove", "at least one cell"),
        ("y = [0.0, 1.0]", "y = [0.0, 1.0]\nremove = [{ x = [0.0, 0.4] }]", "mesh.remove[0].x", "nearest one is at 0"),
        ("y = [0.0, 1.0]", "y = [0.0, 1.0]\nrefine = { largest = 1e-9 }", "mesh.refine.largest", "cells in all"),
        (
            "y = [0.0, 1.0]",
            'y = [0.0, 1.0]\nrefine = { largest = 1.0, towards = ["a"] }',
            "mesh.refine.towards[0]",
            "name",
        ),
        ("[material]", "[[regions]]\nyoung = 1.0\npoisson = 0.9\n[material]", "regions[0].poisson", "at most 0.5"),
        (
            "[material]",
            "[[regions]]\nyoung = 1.0\npoisson = 0.3\ny = [0.0, 0.5]\n[material]",
            "regions[0].y",
            "nearest",
        ),
        ("[material]", "[constants]\nx = 1.0\n[material]", "constants.x", "means something already"),
        ("[material]", '[constants]\n"a b" = 1.0\n[material]', "constants.'a b'", "letters"),
        ("[material]", '[[edges]]\nname = "top"\nside = "top"\n[material]', "edges[0].name", "another name"),
        (
            "[material]",
            '[[joints]]\nname = "j"\ndirection = "up"\nat = 0.0\n[material]',
            "joints[0].direction",
            "horizontal",
        ),
        ("young = 1000.0", "young = 1000.0\nbody_potential = 1.0", "material.body_potential", "top of the file"),
        ("young = 1000.0", "young = 1979-05-27", "material.young", "dates"),
        ("young = 1000.0", "young = 0x" + "f" * 400, "material.young", "64 bits"),
        ("young = 1000.0", "young = 1000.0 1000.0", "TOML", "line 7"),
        ("young = 1000.0", "young = " + "[" * 5000, "TOML", "nested too deeply"),
        ("young = 1000.0", "young = " + "1" * 5000, "TOML", "syntax"),
    ],
)
def test_an_error_names_its_place_and_the_remedy(old, new, field, words):
    assert old in SMALL
    error = refusal(SMALL.replace(old, new))
    assert error.field == field
    assert words in error.remedy
    assert "None" not in str(error)


def test_a_body_without_cells_is_refused_with_the_rectangles_that_were_written():
    error = refusal(SMALL.replace("y = [0.0, 1.0]", "y = [0.0, 1.0]\nremove = [{ x = [0.0, 1.0] }]"))
    assert (error.field, error.value) == ("mesh.remove", [{"x": [0.0, 1.0]}])


def test_the_rich_file_is_fine():
    file = problem_from_toml(RICH)
    assert solve(file.problem, **file.solve_options).status == "solved"


def test_bad_values_at_a_later_time():
    text = SMALL.replace("friction = 0.2", 'friction = "0.2 - t"') + "[history]\ntimes = [0.0, 0.1, 0.3]\n"
    error = refusal(text)
    assert error.field == "contacts[0].friction"
    assert error.remedy.startswith("at t = 0.3: ")


def test_times_and_their_problems():
    text = SMALL.replace("gap = -1e-3", 'gap = "-1e-3 * t"\nplate = { moment = "2 * t + a" }')
    file = problem_from_toml(text + "[history]\ntimes = { stop = 1.0, steps = 4 }\n[constants]\na = 0.5\n")
    assert file.times == (0.0, 0.25, 0.5, 0.75, 1.0)
    assert [p.contacts[0].gap(np.zeros(1), np.zeros(1))[0] for p in file.problems] == [-1e-3 * t for t in file.times]
    assert [p.contacts[0].plate.moment for p in file.problems] == [0.5, 1.0, 1.5, 2.0, 2.5]
    assert file.problem_at(0.5).mesh is file.problem.mesh


def test_pins_move_in_time_and_are_written_as_gap_and_plate(tmp_path):
    pin = 'pin = { centre = [0.25, 2.0], radius = 0.9, x = "1e-3 * t", force_y = -1.0 }'
    file = problem_from_toml(SMALL.replace("gap = -1e-3", pin) + "[history]\ntimes = [0.0, 1.0]\n")
    contact = file.problems[1].contacts[0]
    assert (contact.plate.x, contact.plate.force_y, contact.plate.pivot) == (1e-3, -1.0, (0.25, 2.0))
    assert contact.gap(np.array([0.25, 0.25]), np.array([1.0, 3.0])) == pytest.approx([0.1, 0.1])
    assert contact == Contact.pin("top", 0.2, (0.25, 2.0), 0.9, x=1e-3, force_y=-1.0, name=contact.name)
    save_problem(tmp_path / "pin.toml", file.problems[1])
    assert load_problem(tmp_path / "pin.toml").problem.contacts == (contact,)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"version = 1 # \xe4", b"\x00" * 100])
def test_files_that_are_no_text(tmp_path, content):
    (tmp_path / "bad.toml").write_bytes(content)
    with pytest.raises(InputError, match=r"UTF-8|syntax"):
        load_problem(tmp_path / "bad.toml")


def test_files_that_are_not_there(tmp_path):
    for path in (tmp_path, tmp_path / "missing.toml", "a\0b", tmp_path / ("x" * 300)):
        with pytest.raises(InputError, match="cannot be read"):
            load_problem(path)


def test_a_byte_order_mark_and_other_line_ends_do_no_harm(tmp_path):
    (tmp_path / "windows.toml").write_bytes(b"\xef\xbb\xbf" + SMALL.replace("\n", "\r\n").encode())
    assert load_problem(tmp_path / "windows.toml").problem.mesh.shape == (1, 1)


def test_solve_takes_all_options_a_file_can_hold():
    kinds = (CondensedOptions, FixedPointOptions, UzawaOptions)
    options = {f.name for kind in kinds for f in dataclasses.fields(kind)}
    general = {"method", "inner", "tolerance", "factorisation", "threads", "time_limit", *ELEMENT_OPTIONS}
    not_stored = {"initial", "callback", "inner_options"}  # the last: settings of a back end, no part of a problem
    assert set(SolveTable.model_fields) - general == options - not_stored


def test_a_joint_that_no_contact_uses_is_named():
    text = (Path(__file__).parents[2] / "examples" / "stacked_blocks.toml").read_text(encoding="utf-8")
    last = text.rindex("[[contacts]]")
    with pytest.raises(InputError, match=r"joints\[1\].*'upper'.*no contact uses this joint"):
        problem_from_toml(text[:last])


ZEROS = ",".join(["0"] * 400_001)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a" + ".a" * 1000 + " = 1", "too many parts"),
        ("[a" + " . a" * 60_000 + "]", "too many parts"),
        ('"a"' + ".'a'" * 1000 + " = 1", "too many parts"),
        ("a = " + "{a=" * 900 + "1" + "}" * 900, "nested too deeply"),
        (
            "a = " + "{" + ".".join("a" * 19) + "=" + ("{" + ".".join("a" * 19) + "=") * 200 + "1" + "}" * 201,
            "nested too deeply",
        ),
        ("a = " + "[" * 5000 + "1" + "]" * 5000, "nested too deeply"),
        (f"contacts = [{ZEROS}]", "200000 numbers"),
        ("[[contacts]]\n" * 200_001, "200000 numbers"),
        ("a.a = 1\n" * 200_001, "200000 numbers"),
        ("a = " + "1" * 1_000_000, "too long"),
        ("a = 0." + "1" * 1_000_000, "too long"),
        ("title = '" + "a" * 20_000_001 + "'", "20000000 bytes"),
    ],
)
def test_texts_beyond_measure_are_refused_before_they_are_parsed(text, words):
    began = time.perf_counter()
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            problem_from_toml(text)
        assert tracemalloc.get_traced_memory()[1] < 2 * len(text) + 50_000_000
    finally:
        tracemalloc.stop()
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert time.perf_counter() - began < 30.0


def test_what_looks_deep_in_texts_and_comments_is_none():
    dots = "a." * 1000 + "," * 500_000
    assert problem_from_toml(f"{RICH}\n# {dots}\n").problem.contacts
    for text in (f"'{dots}'", f'"{dots}\\""', f"'''\n{dots}'\n'''", f'"""\n{dots}\\"""\n"""'):
        assert dots in problem_from_toml(RICH.replace('"everything"', text)).title


def test_more_values_than_mean_anything():
    times = ", ".join(["0.0"] * 10_001)
    with pytest.raises(InputError, match=r"history\.times"):
        problem_from_toml(f"{RICH}\n[history]\ntimes = [{times}]\n")
    with pytest.raises(InputError, match=r"edges: .* at most 2000"):
        problem_from_toml(RICH + "".join(f'\n[[edges]]\nname = "e{i}"\nside = "top"' for i in range(2001)))
    with pytest.raises(InputError, match="powers of x and y below 100"):
        Polynomial([[0.0]] * 101)
