"""Discretisations of a sequence share what does not change, and are otherwise those made alone."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    Polynomial,
    RectilinearMesh,
    Region,
    Traction,
    solve,
)
from qvi_contact.discretization.discretization import discretize
from qvi_contact.problem.conditions import RigidPlate
from qvi_contact.solution.solver import posed

ELEMENTS = pytest.mark.parametrize("element", ["bfs", "hct"])
VECTORS = ("f", "load", "n0", "t0", "mu", "W", "b", "cohesion", "cap")


def block(friction=0.3, shear=0.0, push=-1.0, gap=0.0, weight=0.0, force=-3.0, law="unilateral", poisson=0.2):
    """A block on the ground, pressed by a plate, with a shear on its right side that the ground's corner shares."""
    mesh = RectilinearMesh.rectangle((3, 2), 2.0, 1.0)
    limits = (0.0, 0.0) if law == "tied" else (friction, 0.1)
    ground = Contact("bottom", limits[0], gap, 0.1 * gap, "ground", limits[1], law=law)
    plate = Contact("top", friction, name="plate", plate=RigidPlate(force_y=force))
    sides = [Traction("right", x=push, y=shear), Displacement("left", x=0.0), Traction("left", y=0.0)]
    return ContactProblem(
        mesh, Material(1e3, poisson), [ground, plate, *sides], body_potential=lambda x, y: weight * y + 0.0 * x
    )


DATA = {
    "friction": {"friction": 0.5},
    "loads": {"push": -2.0},
    "another unit": {"push": -50.0, "force": -90.0},
    "gap": {"gap": -1e-3},
    "weight": {"weight": 0.7},
    "plate": {"force": -5.0},
}


@ELEMENTS
@pytest.mark.parametrize("change", DATA.values(), ids=DATA)
def test_other_data_share_matrices_and_are_those_made_alone(element, change):
    first = discretize(block(), element=element)
    alone = discretize(block(**change), element=element)
    after = first.following(alone.problem)
    assert after.qvi.K is first.qvi.K
    assert after.qvi.N is first.qvi.N
    assert after.qvi.operator is first.qvi.operator
    for name in VECTORS:
        expected = getattr(alone.qvi, name)
        size = np.abs(expected[np.isfinite(expected)]).max(initial=1.0)
        assert getattr(after.qvi, name) == pytest.approx(expected, rel=1e-12, abs=1e-12 * size), name
    z = np.random.default_rng(1).normal(size=alone.qvi.n)
    assert after.qvi.gradient(z) == pytest.approx(alone.qvi.gradient(z), rel=1e-9, abs=1e-9)
    assert after.energy.coefficients(after.values(z)) == pytest.approx(alone.energy.coefficients(alone.values(z)))


@ELEMENTS
def test_tractions_are_eliminated_anew_only_where_they_change(element):
    weight = Polynomial([[0.0, 0.5]])
    first = discretize(replace(block(), body_potential=weight), element=element)
    problem = discretize(replace(block(friction=0.5), body_potential=weight), element=element).problem
    assert first.following(problem).elimination is first.elimination
    pushed = replace(block(push=-1.1), body_potential=weight)
    other = first.following(discretize(pushed, element=element).problem, first.scales)
    assert other.elimination.basis is first.elimination.basis
    assert np.abs(other.elimination.particular - first.elimination.particular).max() > 1e-3
    heavier = replace(block(), body_potential=Polynomial([[0.0, 0.6]]))
    other = first.following(discretize(heavier, element=element).problem, first.scales)
    assert np.abs(other.elimination.particular - first.elimination.particular).max() > 1e-3


def test_the_rough_stress_is_that_of_the_problem():
    """Problems with other loads, or with stresses that no degree of freedom changes, have one of their own."""
    first = discretize(block(weight=0.0), element="hct")
    rough = first.qvi.rough_stress()
    for change in ({"friction": 0.5}, {"push": -1.1}, {"weight": 0.3}, {"gap": -1e-3}, {"force": -2.5}):
        problem = discretize(block(**change), element="hct").problem
        after, alone = first.following(problem, first.scales), discretize(problem, scales=first.scales)
        assert after.qvi.rough_stress() == pytest.approx(alone.qvi.rough_stress(), rel=1e-9)
        assert (after.qvi.rough_stress() == rough) is (change == {"friction": 0.5})


@ELEMENTS
def test_other_bodies_share_nothing(element):
    first = discretize(block(), element=element)
    for problem in (block(poisson=0.3), replace(block(), regions=[Region(Material(5e2, 0.2), y=(0.0, 0.5))])):
        alone = discretize(problem, element=element)
        after = first.following(alone.problem)
        assert after.qvi.operator is not first.qvi.operator
        assert abs(after.qvi.K - alone.qvi.K).max() == 0.0


@ELEMENTS
def test_other_contact_rows_share_no_rows(element):
    """A tied contact limits no traction: it has no rows."""
    first = discretize(block(), element=element)
    alone = discretize(block(law="tied"), element=element)
    after = first.following(alone.problem)
    assert after.qvi.m == alone.qvi.m < first.qvi.m


def test_a_corner_whose_shears_disagree_is_eliminated_anew():
    """Two tractions meet in the upper right corner: on rectangles only equal shears leave that of the corner fixed."""

    def cornered(shear):
        problem = block(shear=shear)
        others = [condition for condition in problem.conditions if condition.edges != "top"]
        return replace(problem, conditions=[Traction("top", x=0.0, y=-1.0), *others])

    first = discretize(cornered(0.0), element="bfs")
    alone = discretize(cornered(0.4), element="bfs")
    after = first.following(alone.problem)
    assert len(first.elimination.conflicts) != len(alone.elimination.conflicts)
    assert after.qvi.n == alone.qvi.n
    assert after.qvi.K is not first.qvi.K
    assert abs(after.qvi.K - alone.qvi.K).max() == 0.0


@ELEMENTS
def test_one_factorisation_and_one_schur_complement_serve_the_sequence(element):
    first = discretize(block(), element=element)
    solve(first)
    factor, stiffness = first.qvi.operator.factor, first.qvi.interface.stiffness
    after = first.following(discretize(block(friction=0.6, push=-1.5), element=element).problem)
    shared = solve(after)
    assert after.qvi.operator.factor is factor
    assert after.qvi.interface.stiffness is stiffness
    alone = solve(block(friction=0.6, push=-1.5), element=element)
    assert shared.contacts["ground"].normal_stress == pytest.approx(alone.contacts["ground"].normal_stress, abs=1e-10)


def test_a_problem_on_another_mesh_or_element_is_refused():
    triangles, rectangles = posed(block(), element="hct"), posed(block(), element="bfs")
    finer = replace(block(), mesh=RectilinearMesh.rectangle((4, 2), 2.0, 1.0))
    for before, problem, element in [
        (triangles, block(), "bfs"),
        (rectangles, block(), "hct"),
        (rectangles, finer, "bfs"),
        (triangles, finer, "hct"),
    ]:
        with pytest.raises(InputError, match=r"ContactProblem\.mesh"):
            posed(problem, before=before, element=element)


def test_rectangles_are_cut_for_a_problem_before_on_triangles():
    before = posed(block(), element="hct")
    after = posed(block(push=-2.0), before=before, element="hct")
    assert after.qvi.K is before.qvi.K


@pytest.mark.parametrize("options", [{"degree": 5}, {"degree": 4.5}, {"contact_rows": "gauss"}, {"method": "uzawa"}])
def test_another_degree_and_other_rows_than_before_are_refused(options):
    before = posed(block(), degree=4)
    field = "degree" if "degree" in options else "contact_rows"
    with pytest.raises(InputError, match=rf"^{field}: .*before"):
        posed(block(), before=before, **options)


def test_a_law_that_varies_does_not_follow_one_held_by_coefficients():
    before = posed(block())
    rough = replace(block().conditions[0], friction=lambda x, y: 0.3 + 0.1 * x + 0.0 * y)
    varying = replace(block(), conditions=[rough, *block().conditions[1:]])
    with pytest.raises(InputError, match=r"^contact_rows: 'gauss'"):
        posed(varying, before=before)
    assert posed(varying, before=posed(varying)).space.contact_rule.kind == "gauss"


@pytest.mark.parametrize("options", [{}, {"degree": 5}, {"element": "bfs", "degree": 3}, {"contact_rows": "gauss"}])
def test_the_same_options_again_share_all_matrices(options):
    before = posed(block(), **options)
    assert posed(block(push=-2.0), before=before, **options).qvi.K is before.qvi.K
