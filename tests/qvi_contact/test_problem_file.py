"""Problem files: what is read is what was written, and what is wrong is one error that says where and what to do."""

import dataclasses
import re
import time
import tomllib
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qvi_contact import InputError, Polynomial, Region, RigidPlate, Tresca, load_problem, save_problem, solve
from qvi_contact.files import problem_from_toml, problem_to_toml
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import BodyForces, Contact, Displacement, Expression, Material, Mises, MohrCoulomb, NoTension
from qvi_contact.units import Units
from tests.cases import examples, refusal, refused_at
from tests.qvi_contact.builders import PRINTED, RICH, same

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


def test_a_file_means_what_the_gallery_makes(tmp_path):
    problem = compressed_plate(0.2, cells=(3, 2), grading=0.7)
    save_problem(tmp_path / "plate.toml", problem, title="Plate", units=Units("mm", "MPa"))
    file = load_problem(tmp_path / "plate.toml")
    assert same(file.problem, problem)
    assert (file.title, file.units) == ("Plate", Units("mm ", " MPa"))
    answers = [solve(p).contacts["plate"].normal_force for p in (problem, file.problem)]
    assert answers[0] == answers[1]


EXAMPLES = Path(__file__).parents[2] / "examples"
WHOLE = [RICH, *((path.read_text(encoding="utf-8")) for path in sorted(EXAMPLES.glob("*.toml")))]


@pytest.mark.parametrize("text", [text for text in WHOLE if "[mesh.outline]" not in text and "file = " not in text])
def test_what_is_written_is_read_again(text):
    file = problem_from_toml(text)
    times = file.times or (0.0,)
    for problem, at in ((file.problem, times[0]), (file.problems[-1], times[-1])):
        again = problem_from_toml(written := problem_to_toml(problem))
        assert same(again.problem, problem)
        assert not re.search(r"\[[^]\n]+,\n", written)  # rows of numbers are on one line
        assert again.times in ((), (at,))


NUMBERS, POSITIVE = st.floats(-1e6, 1e6), st.floats(1e-6, 1e6)
FIELDS = NUMBERS | st.builds(lambda p: Expression("p * x", {"p": p}), st.just(2.0)) | st.builds(
    lambda a, b: Polynomial([[a, b], [1.0]]), NUMBERS, NUMBERS)  # fmt: skip
FRICTIONS = st.floats(0.0, 1e6) | st.just(Expression("p + 0 * x", {"p": 2.0}))
LAWS = st.fixed_dictionaries({}, optional={
    "gap": FIELDS, "offset": FIELDS, "cohesion": FRICTIONS, "shear_limit": FRICTIONS, "pore_pressure": FRICTIONS,
    "law": st.sampled_from(["unilateral", "bilateral"]), "name": st.text(PRINTED, min_size=1, max_size=8),
    "normal_stiffness": POSITIVE, "tangential_stiffness": st.just(Expression("10 + abs(x)")),
    "plate": st.builds(RigidPlate, force_x=NUMBERS, force_y=st.none() | NUMBERS, rotation=st.none() | NUMBERS,
                       pivot=st.tuples(NUMBERS, NUMBERS)),
})  # fmt: skip
GROWING = POSITIVE | st.just(Expression("1 + abs(x)"))
STRENGTHS = st.none() | st.builds(Tresca, GROWING) | st.builds(Mises, GROWING) | st.builds(NoTension, POSITIVE) | (
    st.builds(MohrCoulomb, POSITIVE, st.floats(0.0, 1.5), st.none() | POSITIVE))  # fmt: skip


@settings(max_examples=examples(25))
@given(FRICTIONS, LAWS, st.builds(Material, POSITIVE, st.floats(-0.9, 0.4), st.just("stress"), STRENGTHS), NUMBERS)
def test_any_contact_and_material_is_read_again(friction, law, material, moved):
    """Field by field: every datum that is left out, a number, an expression or a polynomial."""
    problem = plate(friction=friction, **law)
    driven = [Displacement(c.edges, y=moved, x=c.x) if isinstance(c, Displacement) else c for c in problem.conditions]
    regions = [Region(material, y=(0.0, 1.0), name="layer")] if moved > 0.0 else []
    forces = BodyForces({law.get("name", "w"): Polynomial([[0.0, moved]]), "of quake.2": friction})
    problem = dataclasses.replace(problem, material=material, conditions=driven, regions=regions, body_potential=forces)
    again = problem_from_toml(problem_to_toml(problem)).problem
    assert same(again, problem)


def test_written_files_are_for_people():
    text = problem_to_toml(compressed_plate(0.2, cells=(40, 2)), title='Więckowski\'s "plate"')
    assert tomllib.loads(text)["title"] == 'Więckowski\'s "plate"'
    assert '[[contacts]]\nedges = "top"\nfriction = 0.2\ngap = -0.001\nname = "plate"\n' in text
    assert max(map(len, text.splitlines())) <= 120
    assert len(text.splitlines()) < 120  # triangles are not one a line


def test_edges_without_a_condition_are_free_if_the_file_says_so():
    """Also in load steps, and if there are none; the name has to be new."""
    part = SMALL.replace('[[tractions]]\nedges = "right"\nx = 0.0\ny = 0.0', "[history]\ntimes = [1, 2]")
    problems = [problem for text in (SMALL, part) for problem in problem_from_toml('free = "rest"' + text).problems]
    forces = [solve(each).contacts["top"].normal_force for each in problems]
    assert forces == pytest.approx(3 * [forces[0]], rel=1e-9)
    assert [each.mesh.edges("rest").normal.tolist() for each in problems[1:]] == 2 * [[[1.0, 0.0]]]
    with refused_at("free", "another name"):
        problem_from_toml('free = "left"' + part)


def plate(**changes):
    problem = compressed_plate(0.2)
    contact = dataclasses.replace(problem.conditions[-1], **changes)
    return dataclasses.replace(problem, conditions=[*problem.conditions[:-1], contact])


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [({"gap": lambda x, y: x * y}, "contacts[0].gap", "Expression"),
     ({"gap": Expression("a", {"a": 1.0}), "offset": Expression("a", {"a": 2.0})}, "contacts[0].offset", "rename"),
     ({"gap": Expression("t", t=1.0), "offset": Expression("t", t=2.0)}, "contacts[0].offset", "one time"),
     ({"name": "two\nlines"}, "Contact.name", "one line")],
)  # fmt: skip
def test_what_a_file_cannot_hold_is_refused(tmp_path, changes, field, words):
    with refused_at(field, words):
        save_problem(tmp_path / "plate.toml", plate(**changes))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [("version = 1", "", "version", "add this key"),
     ("version = 1", "version = 1\n[refine]\nguaranteed = 1", "refine.guaranteed", "true or false"),
     ("version = 1", "version = 2", "version", "give 1"), ("y = [0.0, 1.0]", "", "mesh.y", "add this key"),
     ("friction = 0.2", "frictoin = 0.2", "contacts[0].frictoin", "did you mean friction"),
     ("friction = 0.2", "c = 0.2", "contacts[0].c", "did you mean cohesion"),
     ("friction = 0.2", "t = 0.2", "contacts[0].t", "there is no such key; the keys here are"),
     ("friction = 0.2", "s = 0.2", "contacts[0].s", "there is no such key; the keys here are"),
     ("young = 1000.0", "young_modulus = 1.0", "material.young_modulus", "did you mean young"),
     ("version = 1", "version = 1\ndegre = 4", "degre", "did you mean degree, of [solve]?"),
     ("[mesh]", "[mesh]\nyoung = 1.0", "mesh.young", "this belongs to [material]"),
     ("x = 0.0\ny = 0.0", "pressure = 1.0", "tractions[0].pressure", "did you mean normal? "),
     ("poisson = 0.3", "pressure = 1.0", "material.pressure", "did you mean pore_pressure, of"),
     ("friction = 0.2", "", "contacts[0].friction", "coefficient of friction"),
     ("friction = 0.2", "friction = -0.2", "contacts[0].friction", "at least 0"),
     ("friction = 0.2", 'friction = "x - 0.5"', "contacts[0].friction", "found this one at (0, "),
     ("friction = 0.2", "friction = true", "contacts[0].friction", "give a number"),
     ("friction = 0.2", 'friction = "mu"', "contacts[0].friction", "mu is not a known name"),
     ("gap = -1e-3", 'gap = "g"\n[constants]\ngrip = 0.1', "contacts[0].gap", "there are x, y, t, pi, grip"),
     ("friction = 0.2", "friction = { polynomial = [] }", "contacts[0].friction", "at least one"),
     ("friction = 0.2", 'friction = "t"', "contacts[0].friction", "[history]"),
     ("friction = 0.2", 'friction = 0.2\nlaw = "bilatral"', "contacts[0].law", "did you mean 'bilateral'"),
     ("friction = 0.2", "friction = 0.2\nplate = {}", "contacts[0].plate", "at least one of force_x"),
     ("friction = 0.2", 'friction = 0.2\nplate = { force_y = "x" }', "contacts[0].plate.force_y", "one number"),
     ("friction = 0.2", "friction = 0.2\nplate = { x = 0.0, force_x = 1.0 }", "contacts[0].plate.force_x", "leave one"),
     ("gap = -1e-3", "gap = 1.0\npin = { centre = [0, 0], radius = 1, x = 0 }", "contacts[0].pin", "leave out gap"),
     ("[[contacts]]", "[contacts]", "contacts", "double brackets"),
     ('edges = "top"', 'edges = "to"', "contacts[0].edges", "[[edges]]"),
     ('edges = "top"', 'edges = ["top", "left"]', "contacts[0].edges", "each name needs a table"),
     ('edges = "right"', 'edges = "top"', "contacts[0]", "already has the condition"),
     ('[[symmetry]]\nedges = "left"', "", "boundary conditions", "add a traction"),
     ("x = [0.0, 1.0]", "x = [0.0, 0.0]\nremove = [{ y = [0.0, 1.0] }]", "mesh.x", "increasing"),
     ("x = [0.0, 1.0]", "x = []\nremove = [{ y = [0.0, 1.0] }]", "mesh.x", "at least two grid lines"),
     ("x = [0.0, 1.0]", "x = { stop = 1.0, cells = 2 }", "mesh.x.start", "add this key"),
     ("x = [0.0, 1.0]", "x = { start = 0, stop = 1.0, cells = 2.5 }", "mesh.x.cells", "whole number"),
     ("x = [0.0, 1.0]", "x = { start = 0, stop = 1.0, cells = 100000000000 }", "mesh.x.cells", "at most"),
     ("x = [0.0, 1.0]", "x = [{ start = 0, stop = 1, cells = 1 }, { stop = 0, cells = 1 }]", "mesh.x[1].stop", "great"),
     ("y = [0.0, 1.0]", "y = [0.0, 1.0]\nremove = [{ x = [0.0, 1.0] }]", "mesh.remove", "at least one cell"),
     ("y = [0.0, 1.0]", "y = [0.0, 1.0]\nremove = [{ x = [0.0, 0.4] }]", "mesh.remove[0].x", "nearest one is at 0"),
     ("y = [0.0, 1.0]", "y = [0.0, 1.0]\nrefine = { largest = 1e-9 }", "mesh.refine.largest", "cells in all"),
     ("y = [0.0, 1.0]", 'y = [0.0, 1.0]\nrefine = { largest = 1, towards = ["a"] }', "mesh.refine.towards[0]", "name"),
     ("[material]", "[[joints]]\nname = 'a'\nsegment = [[0, 0], [1, 1]]\n[material]", "joints[0]", "no contact uses"),
     ("[material]", "[[regions]]\nyoung = 1.0\npoisson = 0.3\n[material]", "regions[0].name", "which part"),
     ("[material]", "[[regions]]\nyoung = 1.0\npoisson = 0.3\ny = [0.0, 0.5]\n[material]", "regions[0]", "cuts the"),
     ("[material]", 2 * '[[regions]]\nname = "a"\nx = [0, 1]\nyoung = 1\npoisson = 0\n' + "[material]",
      "regions[1].name", "exists already"),
     ("[material]", "[constants]\nx = 1.0\n[material]", "constants.x", "time t, pi or"),
     ("[material]", '[constants]\n"a b" = 1.0\n[material]', "constants.'a b'", "letters"),
     ("[material]", '[[edges]]\nname = "top"\nside = "top"\n[material]', "edges[0].name", "another name"),
     ("young = 1000.0", "young = 1000.0\nbody_potential = 1.0", "material.body_potential", "top of the file"),
     ("young = 1000.0", "young = 1979-05-27", "material.young", "real number"),
     ("young = 1000.0", "young = 1e-70", "material.young", "at least 1e-60"),
     ("x = [0.0, 1.0]", "x = [{ start = 0, stop = 1, cells = 1 }, { start = 2, stop = 3, cells = 1 }]",
      "mesh.x[1].start", "stops, at 1"),
     ("young = 1000.0", "young = 0x" + "f" * 400, "material.young", "finite"),
     ("young = 1000.0", "young = 1000.0 1000.0", "TOML", "line 7"), ("[mesh]", "[msh]", "msh", "did you mean mesh")],
)  # fmt: skip
def test_an_error_names_its_place_and_the_remedy(old, new, field, words):
    assert old in SMALL
    error = refusal(problem_from_toml, SMALL.replace(old, new))
    assert error.field == field
    assert words in error.remedy
    assert "None" not in str(error)


def test_times_and_their_problems():
    bad = SMALL.replace("friction = 0.2", 'friction = "0.2 - t"') + "[history]\ntimes = [0.0, 0.1, 0.3]\n"
    error = refusal(problem_from_toml, bad)
    assert (error.field, error.remedy.startswith("at t = 0.3: ")) == ("contacts[0].friction", True)
    text = SMALL.replace("gap = -1e-3", 'gap = "-1e-3 * t"\nplate = { moment = "2 * t + a" }')
    file = problem_from_toml(text + "[history]\ntimes = { stop = 1.0, steps = 4 }\n[constants]\na = 0.5\n")
    assert file.times == (0.0, 0.25, 0.5, 0.75, 1.0)
    assert [p.contacts[0].gap for p in file.problems] == [-1e-3 * t for t in file.times]
    assert [p.contacts[0].plate.moment for p in file.problems] == [0.5, 1.0, 1.5, 2.0, 2.5]
    assert file.problems[-1].mesh is file.problem.mesh


def test_pins_move_in_time_and_are_written_as_gap_and_plate(tmp_path):
    pin = 'pin = { centre = [0.25, 2.0], radius = 0.9, x = "1e-3 * t", force_y = -1.0 }'
    file = problem_from_toml(SMALL.replace("gap = -1e-3", pin) + "[history]\ntimes = [0.0, 1.0]\n")
    contact = file.problems[1].contacts[0]
    assert (contact.plate.x, contact.plate.force_y, contact.plate.pivot) == (1e-3, -1.0, (0.25, 2.0))
    assert contact.gap(np.array([0.25, 0.25]), np.array([1.0, 3.0])) == pytest.approx([0.1, 0.1])
    assert contact == Contact.pin("top", 0.2, (0.25, 2.0), 0.9, x=1e-3, force_y=-1.0, name=contact.name)
    save_problem(tmp_path / "pin.toml", file.problems[1])
    assert load_problem(tmp_path / "pin.toml").problem.contacts == (contact,)
    with pytest.raises(InputError, match="the problem of a file that was read"):
        save_problem(tmp_path / "pin.toml", file)  # not its times, nor how to solve it


def test_files_that_are_no_text_or_not_there(tmp_path):
    (tmp_path / "bad.toml").write_bytes(b"version = 1 # \xe4")
    for path in (tmp_path / "bad.toml", tmp_path, tmp_path / "missing.toml", "a\0b", tmp_path / ("x" * 300)):
        with refused_at("file"):
            load_problem(path)


def test_a_byte_order_mark_and_other_line_ends_do_no_harm(tmp_path):
    (tmp_path / "windows.toml").write_bytes(b"\xef\xbb\xbf" + SMALL.replace("\n", "\r\n").encode())
    assert load_problem(tmp_path / "windows.toml").problem.mesh.cell_count == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [("a" + ".a" * 1000 + " = 1", "a"),  # an unknown key where Python can show so deep a table, as 3.13 can
     ("a = " + "{a=" * 900 + "1" + "}" * 900, "nested too deeply"),
     ("a = " + "{" + ".".join("a" * 19) + "=" + ("{" + ".".join("a" * 19) + "=") * 200 + "1" + "}" * 201, "a"),
     ("a = " + "[" * 5000 + "1" + "]" * 5000, "nested too deeply"), ("a = " + "1" * 5_000, "correct the syntax"),
     ("a = { b = 1, }", "no comma may stand before }"),
     ("title = '" + "a" * 20_000_001 + "'", "20000000 bytes")],
)  # fmt: skip
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
