"""Tractions and displacements by normal and tangential component say what x and y say."""

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Symmetry,
    Traction,
    limit_load_factor,
    load_problem,
    save_problem,
    solve,
)
from qvi_contact.problem.fields import Expression

MATERIAL = Material(1000.0, 0.3)
MESH = RectilinearMesh.rectangle((4, 3), 2.0, 1.0, origin=(1.0, -1.0))


def problem(*conditions, mesh=MESH):
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


def test_both_ways_of_stating_are_one_problem():
    first, second = (solve(stated) for stated in LOADED)
    x, y, stress = first.gauss_stress()
    assert second.stress(x, y) == pytest.approx(stress, abs=1e-9)
    assert second.contacts["bottom"].slip == pytest.approx(first.contacts["bottom"].slip, abs=1e-12)
    assert second.traction_misfit == pytest.approx(first.traction_misfit, abs=1e-12)
    assert second.energies.load == pytest.approx(first.energies.load, rel=1e-10)


def test_one_component_of_each_kind_makes_a_guided_edge():
    guided = [
        problem(
            Contact("bottom", 0.0),
            Traction("top", x=0.0, y=-5.0),
            *left,
            Symmetry("right"),
        )
        for left in (
            [Displacement("left", normal=0.001), Traction("left", tangential=0.0)],
            [Displacement("left", x=-0.001), Traction("left", y=0.0)],
        )
    ]
    first, second = (solve(stated) for stated in guided)
    assert first.resultant("left").x == pytest.approx(second.resultant("left").x, rel=1e-10)
    assert (guided[0].owners == guided[1].owners).all()


def test_a_component_that_two_rule_is_refused_whatever_it_is_called():
    with pytest.raises(InputError, match=r"component x of the edge around \(1, -0.8\d+\) already has the condition"):
        problem(Traction("left", normal=0.0), Displacement("left", x=0.0))
    with pytest.raises(InputError, match=r"component y of the edge .* has no condition"):
        problem(*(Traction(side, 0.0, 0.0) for side in ("top", "right", "bottom")), Traction("left", normal=0.0))


@pytest.mark.parametrize("kind", [Traction, Displacement])
def test_the_two_kinds_of_components_do_not_mix_in_one_condition(kind):
    with pytest.raises(InputError, match=f"{kind.__name__}.x: 'x and tangential'"):
        kind("top", x=0.0, tangential=1.0)
    with pytest.raises(InputError, match="give at least one"):
        kind("top")


def test_a_limit_load_multiplies_them():
    pulled = [
        problem(Contact("bottom", 0.3), Traction("left", 0.0, 0.0), Traction("top", 0.0, -10.0), load)
        for load in (
            Traction("right", x=1.0, y=0.0, name="pull"),
            Traction("right", normal=1.0, tangential=0.0, name="pull"),
        )
    ]
    factors = [limit_load_factor(stated, ["pull"]) for stated in pulled]
    assert factors[0] == pytest.approx(6.0, rel=1e-9)  # μ × 10 × 2 over 1 × 1
    assert factors[1] == pytest.approx(factors[0], rel=1e-9)


def test_they_are_kept_in_problem_files(tmp_path):
    stated = problem(
        Contact("bottom", 0.4),
        Traction("top", normal=Expression("-10 - x"), tangential=1.0),
        Traction("left", 0.0, 0.0),
        Displacement("right", normal=0.0, tangential=0.0),
    )
    save_problem(tmp_path / "stated.toml", stated)
    text = (tmp_path / "stated.toml").read_text(encoding="utf-8")
    assert 'normal = "-10 - x"' in text
    read = load_problem(tmp_path / "stated.toml").problem
    assert solve(read).contacts["bottom"].normal_force == pytest.approx(solve(stated).contacts["bottom"].normal_force)


def test_pictures_and_bounds_see_them():
    from matplotlib.quiver import Quiver

    from qvi_contact.plots import problem_figure

    figures = [problem_figure(stated) for stated in LOADED]
    drawn = [[c for c in figure.axes[0].collections if isinstance(c, Quiver)] for figure in figures]
    first, second = (np.concatenate([np.column_stack([q.XY, q.U, q.V]) for q in arrows]) for arrows in drawn)
    assert len(first)
    assert first[np.lexsort(first.T)] == pytest.approx(second[np.lexsort(second.T)], abs=1e-12)
    brackets = [solve(stated).bracket for stated in LOADED]
    assert brackets[1].upper == pytest.approx(brackets[0].upper, rel=1e-9)
    assert brackets[1].lower == pytest.approx(brackets[0].lower, rel=1e-9)


def test_slipping_support_has_a_loop():
    """A tangential displacement by its own name is what drives the body along."""
    from qvi_contact import solve_history

    steps = [
        problem(
            Contact("bottom", 0.3),
            Traction("left", 0.0, 0.0),
            Traction("right", 0.0, 0.0),
            Displacement("top", normal=0.01, tangential=shift),
        )
        for shift in (0.0, 0.005)
    ]
    turned = [
        problem(
            Contact("bottom", 0.3),
            Traction("left", 0.0, 0.0),
            Traction("right", 0.0, 0.0),
            Displacement("top", x=shift, y=0.01),
        )
        for shift in (0.0, 0.005)
    ]
    first, second = solve_history(steps).loop("top"), solve_history(turned).loop("top")
    assert first[0] == pytest.approx([0.0, 0.005])
    assert np.allclose(first[1], second[1], rtol=1e-9, atol=1e-9)
