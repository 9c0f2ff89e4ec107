"""Materials, conditions and problems: what they mean, and what they refuse."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Symmetry,
    Traction,
    discretize,
)
from qvi_contact.gallery import compressed_plate, sliding_block

MESH = RectilinearMesh.rectangle((2, 2))
STEEL = Material(2.1e5, 0.3)
FREE = (Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=0.0))
not_finite = st.sampled_from([np.nan, np.inf, -np.inf])


@given(young=st.floats(1e-3, 1e12), poisson=st.floats(-0.99, 0.49))
def test_compliance(young, poisson):
    stress = Material(young, poisson).compliance * young
    strain = Material(young, poisson, "strain").compliance * young
    assert stress == pytest.approx(np.array([[1, -poisson, 0], [-poisson, 1, 0], [0, 0, 2 + 2 * poisson]]))
    assert strain[0, 0] == pytest.approx(1 - poisson**2)
    assert strain[0, 1] == pytest.approx(-poisson * (1 + poisson))
    assert np.linalg.eigvalsh(strain).min() > 0


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"young": 0.0}, "Material.young"),
        ({"young": -1.0}, "Material.young"),
        ({"young": np.nan}, "Material.young"),
        ({"young": "steel"}, "Material.young"),
        ({"poisson": 0.51}, "Material.poisson"),
        ({"poisson": -1.0}, "Material.poisson"),
        ({"plane": "shell"}, "Material.plane"),
    ],
)
def test_bad_materials_are_refused(arguments, field):
    with pytest.raises(InputError) as caught:
        Material(**{"young": 1.0, "poisson": 0.3, **arguments})
    assert caught.value.field == field


def test_incompressible_plane_stress_is_accepted():
    assert np.isfinite(Material(1.0, 0.5).compliance).all()


@given(friction=st.floats(max_value=-1e-300) | not_finite)
def test_bad_friction_is_refused(friction):
    with pytest.raises(InputError, match=r"Contact\.friction"):
        Contact("top", friction=friction)


@pytest.mark.parametrize(
    "friction",
    [
        lambda x, y: -x - y,
        lambda x, y: x * y * np.nan,
        lambda x: x,
        lambda x, y: np.ones(len(x) + len(y) - 1),
        lambda x, y: f"rough {x} {y}",
    ],
)
def test_bad_friction_functions_are_refused(friction):
    with pytest.raises(InputError, match=r"Contact\.friction"):
        discretize(compressed_plate(friction))


@given(value=not_finite, name=st.sampled_from(["gap", "offset"]))
def test_bad_obstacles_are_refused(value, name):
    with pytest.raises(InputError, match=rf"Contact\.{name}"):
        Contact("top", friction=0.1, **{name: value})


@given(value=not_finite, kind=st.sampled_from([Traction, Displacement]), component=st.sampled_from("xy"))
def test_bad_values_are_refused(value, kind, component):
    with pytest.raises(InputError, match=rf"{kind.__name__}\.{component}"):
        kind("top", **{component: value})


def test_conditions_without_components_are_refused():
    with pytest.raises(InputError, match="at least one"):
        Traction("top")


@pytest.mark.parametrize(
    ("conditions", "words"),
    [
        ([*FREE, Symmetry("left")], "component x of the edge around .* has no condition"),
        ([*FREE, Symmetry("left"), Displacement("bottom", y=0.0)], "'bottom': component x"),
        (
            [*FREE, Symmetry("left"), Symmetry("bottom"), Contact("top", friction=0.1)],
            r"already has the condition Traction\('top'\)",
        ),
        ([*FREE, Symmetry("left"), Symmetry("floor")], "'floor': name one of the mesh's edge sets"),
        (
            [*FREE, Contact("left", friction=0, name="a"), Contact("bottom", friction=0, name="a")],
            "a name of its own",
        ),
        ("top", "give a list"),
        ([*FREE, "bottom"], "each entry must be"),
    ],
)
def test_overlap_omission_and_unknown_names_are_refused(conditions, words):
    with pytest.raises(InputError, match=words) as caught:
        ContactProblem(MESH, STEEL, conditions)
    assert "\n" not in str(caught.value)


def test_components_may_come_from_different_conditions():
    conditions = [*FREE, Symmetry("left"), Displacement("bottom", y=0.0), Traction("bottom", x=0.0)]
    problem = ContactProblem(MESH, STEEL, conditions)
    assert (problem.owners >= 0).all()


def test_unbalanced_loads_are_refused_with_their_size():
    load = [Traction(side, x=0.0, y=1.0 if side == "top" else 0.0) for side in ("bottom", "right", "top", "left")]
    with pytest.raises(InputError, match="out of balance") as caught:
        discretize(ContactProblem(MESH, STEEL, load))
    assert caught.value.value == pytest.approx(1.0, rel=1e-12)
    turning = [
        Traction("bottom", x=1.0, y=0.0),
        Traction("top", x=-1.0, y=0.0),
        *(Traction(s, x=0, y=0) for s in ("left", "right")),
    ]
    with pytest.raises(InputError, match="out of balance"):
        discretize(ContactProblem(MESH, STEEL, turning))


@pytest.mark.parametrize("name", ["mesh", "material", "body_potential"])
def test_wrong_kinds_are_refused(name):
    arguments = {"mesh": MESH, "material": STEEL, "conditions": [*FREE, Symmetry("left"), Symmetry("bottom")]}
    with pytest.raises(InputError, match=rf"ContactProblem\.{name}"):
        ContactProblem(**{**arguments, name: "steel"})


def test_sliding_block_says_when_its_base_would_stick():
    with pytest.raises(InputError, match="translation"):
        sliding_block(translation=0.0)
