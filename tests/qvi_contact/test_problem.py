"""Materials, conditions and problems: what they mean, in both kinds of components, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qvi_contact import InputError, TriangleMesh, discretize, solve
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import BodyForces, Contact, ContactProblem, Displacement, Material, Region, Symmetry, Traction
from tests.cases import refused_at

MESH = TriangleMesh.rectangle((2, 2))
STEEL = Material(2.1e5, 0.3)
FREE = (Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=0.0))


@given(young=st.floats(1e-3, 1e12), poisson=st.floats(-0.99, 0.49))
def test_compliance(young, poisson):
    stress = Material(young, poisson).compliance * young
    strain = Material(young, poisson, "strain").compliance * young
    assert stress == pytest.approx(np.array([[1, -poisson, 0], [-poisson, 1, 0], [0, 0, 2 + 2 * poisson]]))
    assert strain[0, 0] == pytest.approx(1 - poisson**2)
    assert strain[0, 1] == pytest.approx(-poisson * (1 + poisson))
    assert np.linalg.eigvalsh(strain).min() > 0


@pytest.mark.parametrize(
    ("name", "value"),
    [("young", 0.0), ("young", np.nan), ("young", "steel"), ("young", 1e25),  # too stiff beside the rest
     ("poisson", 0.51), ("poisson", -1.0), ("plane", "shell")],
)  # fmt: skip
def test_bad_materials_are_refused(name, value):
    with refused_at(f"Material.{name}"):
        material = Material(**{"young": 1.0, "poisson": 0.3, "plane": "stress", name: value})
        replace(compressed_plate(0.1), regions=[Region(material, x=(0.0, 0.5))])


@pytest.mark.parametrize("kind", [np.uint8, np.float16, np.int64, np.float32, int])
def test_numbers_of_any_kind_are_floats(kind):
    """So that −5 is not 251, and nothing is computed with few digits."""
    material = Material(kind(3), kind(1) / kind(3) if issubclass(kind, np.floating) else 0.25, prestress=[kind(1)] * 3)
    conditions = [Contact("bottom", kind(1)), Traction("top", normal=kind(5), tangential=kind(0)),
                  Traction("left", kind(0), kind(0)), Displacement("right", kind(1), kind(1))]  # fmt: skip
    regions = [Region(material, x=[kind(1), kind(2)])]
    stated = ContactProblem(BLOCK, material, conditions, regions=regions, temperature=kind(7))
    found = [*material.prestress, material.young, material.poisson, *stated.regions[0].x, stated.temperature]
    found += [value for each in stated.conditions for value in vars(each).values() if not isinstance(value, str)]
    assert {type(value) for value in found if value is not None} == {float}
    assert (material.compliance == Material(3.0, float(material.poisson)).compliance).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, "2*y"])
@pytest.mark.parametrize(
    ("kind", "name"),
    [(Contact, "friction"), (Contact, "gap"), (Contact, "offset"), (Traction, "x"), (Displacement, "y")],
)
def test_what_is_not_finite_or_a_text_is_refused(kind, name, value):
    with refused_at(f"{kind.__name__}.{name}", r"finite|such as Expression\('2\*y'\)"):
        kind("top", **({"friction": 0.1} if kind is Contact else {}) | {name: value})


@pytest.mark.parametrize(
    "friction",
    [lambda x, y: -x - y, lambda x, y: x * y * np.nan, lambda x: x, lambda x, y: np.ones(len(x) + len(y) - 1),
     lambda x, _: np.abs(x[0]),  # the first of several rows
     lambda x, y: f"rough {x} {y}"],
)  # fmt: skip
def test_bad_friction_functions_are_refused(friction):
    with pytest.raises(InputError, match=r"Contact\.friction"):
        discretize(compressed_plate(friction))


@pytest.mark.parametrize(
    ("conditions", "words"),
    [([*FREE, Symmetry("left")], "component x of the edge around .* has no condition.* free = "),
     ([*FREE, Symmetry("left"), Displacement("bottom", y=0.0)], "'bottom': component x.* or a contact$"),
     ([*FREE, Symmetry("left"), Symmetry("bottom"), Contact("top", friction=0.1)],
      r"already has the condition Traction\('top'\)"),
     ([*FREE, Symmetry("left"), Symmetry("floor")], "'floor': name one of the edge sets"),
     ([*FREE, Contact("left", friction=0, name="a"), Contact("bottom", friction=0, name="a")], "a name of its own"),
     ("top", "give a list"), ([*FREE, "bottom"], "each entry must be")],
)  # fmt: skip
def test_overlap_omission_and_unknown_names_are_refused(conditions, words):
    with pytest.raises(InputError, match=words):
        ContactProblem(MESH, STEEL, conditions)


def test_unbalanced_loads_are_refused_with_their_size():
    for below, above in (((0.0, 0.0), (0.0, 1.0)), ((1.0, 0.0), (-1.0, 0.0))):  # one of these turns the body
        load = [Traction("bottom", *below), Traction("top", *above), Traction("left", 0.0, 0.0), FREE[0]]
        with pytest.raises(InputError, match="out of balance") as caught:
            discretize(ContactProblem(MESH, STEEL, load))
        assert caught.value.value == pytest.approx(1.0, rel=1e-12)


MATERIAL = Material(1000.0, 0.3)
BLOCK = TriangleMesh.rectangle((4, 3), 2.0, 1.0, origin=(1.0, -1.0))


def problem(*conditions, mesh=BLOCK):
    return ContactProblem(mesh, MATERIAL, conditions)


LOADED = (
    problem(
        Contact("bottom", 0.4),
        Traction("top", x=lambda x, _: 1.0 - x, y=-10.0, name="lid"),
        Traction("left", x=2.0, y=lambda _, y: y),
        Displacement("right", x=-0.01, y=0.002),
    ),
    problem(
        Contact("bottom", 0.4),
        Traction("top", normal=-10.0, tangential=lambda x, _: 1.0 - x, name="lid"),
        Traction("left", normal=-2.0, tangential=lambda _, y: y),  # the normal points to −x
        Displacement("right", normal=-0.01, tangential=0.002),
    ),
)


def test_functions_may_write_to_their_arguments():
    x = np.linspace(0.0, 1.0, 5)
    parts = dict.fromkeys("abc", lambda x, y: np.add(x, y, out=x))
    assert (BodyForces(parts)(x, x) == 6.0 * x).all()
    assert (x == np.linspace(0.0, 1.0, 5)).all()


def test_both_ways_of_stating_are_one_problem():
    first, second = (solve(stated) for stated in LOADED)
    x, y, stress = first.gauss_stress()
    assert second.stress(x, y) == pytest.approx(stress, abs=1e-9)
    assert second.contacts["bottom"].slip == pytest.approx(first.contacts["bottom"].slip, abs=1e-12)
    assert second.traction_misfit == pytest.approx(first.traction_misfit, abs=1e-12)
    assert second.energies.load == pytest.approx(first.energies.load, rel=1e-10)


def test_a_component_that_two_rule_is_refused_whatever_it_is_called():
    with pytest.raises(InputError, match=r"x of .*\(1, -0.8\d+\) already has"):
        problem(Traction("left", normal=0.0), Displacement("left", x=0.0))
    with pytest.raises(InputError, match=r"y of .* no condition"):
        problem(*(Traction(side, 0.0, 0.0) for side in ("top", "right", "bottom")), Traction("left", normal=0.0))
    for kind in (Traction, Displacement):  # the two kinds of components do not mix in one condition
        with pytest.raises(InputError, match=f"{kind.__name__}.x: 'x and tangential'"):
            kind("top", x=0.0, tangential=1.0)
        with pytest.raises(InputError, match="give at least one"):
            kind("top")
