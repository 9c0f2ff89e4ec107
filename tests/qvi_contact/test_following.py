"""Discretisations: linear conditions, load and gradient; those of a sequence share what does not change."""

import gc
from dataclasses import replace
from weakref import ref

import numpy as np
import pytest

from qvi_contact import InputError, Polynomial, TriangleMesh, discretize, solve
from qvi_contact.discretization import Elimination, Functionals, walk
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, RigidPlate, Traction
from solvers.basics import Kept


def eliminated(C, age=None):
    C = np.asarray(C, dtype=float)
    rows = Functionals(np.tile(np.arange(C.shape[1]), (len(C), 1)), C[:, None], C.shape[1])
    return Elimination.of(rows, np.zeros(C.shape[1], dtype=int) if age is None else age)


@pytest.mark.parametrize("seed", range(4))
def test_all_solutions_and_nothing_else(seed):
    rng = np.random.default_rng(seed)
    C = rng.normal(size=(7, 12)) * (rng.random((7, 12)) < 0.4)
    C[5] = C[1] - 2.0 * C[3]  # follows from others
    exact, found, rank = rng.normal(size=12), eliminated(C, rng.integers(0, 5, 12)), np.linalg.matrix_rank(C)
    particular, misfit = found.particular(C @ exact)
    B = found.basis.matrix.toarray()
    assert B.shape == (12, 12 - rank)
    assert np.linalg.matrix_rank(B) == 12 - rank
    assert np.abs(C @ B).max() < 1e-11
    assert C @ particular == pytest.approx(C @ exact, abs=1e-11)
    assert B[found.basis.kept] == pytest.approx(np.eye(12 - rank))
    assert not particular[found.basis.kept].any()
    assert np.abs(misfit).max() < 1e-11
    assert len(misfit) == 7 - rank


def test_rows_that_contradict_have_a_misfit_and_pivots_are_the_latest_unless_their_entry_is_tiny():
    misfit = eliminated([[1, -1, 0], [0, 1, -1], [1, 0, -1]]).particular(np.array([1.0, 2.0, 3.5]))[1]
    assert misfit == pytest.approx([0.5])
    rows = [[0.0, 0.0, 1.0]]
    assert eliminated([[5.0, 1.0, 1.0], *rows], np.array([0, 1, 0])).basis.kept.tolist() == [0]
    assert eliminated([[5.0, 1e-9, 1.0], *rows], np.array([0, 1, 0])).basis.kept.tolist() == [1]


def test_a_chain_of_differences_depends_on_its_end_only():
    n = 200
    found = eliminated(np.eye(n, n + 1, 1) - np.eye(n, n + 1), np.arange(n + 1))
    assert found.basis.kept.tolist() == [0]
    assert (found.basis.matrix.toarray() == 1.0).all()
    assert found.particular(np.ones(n))[0].tolist() == list(range(n + 1))


def test_lines_are_walked_from_the_start_outward_and_then_from_their_ends_and_closed_ones_around():
    ends = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [7, 9], [8, 9]])
    place, age = walk(ends, [2], 10)
    assert place.tolist() == [1, 0, 2, 3, 4, 5]
    assert age.tolist() == [3, 2, 1, 4, 5, 0, 0, 6, 8, 7]
    place, age = walk(np.array([[0, 1], [1, 2], [2, 3], [0, 3]]), [7], 8)
    assert sorted(place.tolist()) == [0, 1, 2, 3]
    assert place[3] == 3
    assert age.tolist() == [1, 2, 3, 4, 0, 0, 0, 0]


def test_both_ways_to_the_load_vector_agree():
    """Assembled loads f, and load − Rᵀr₀ through element stresses, with body force, obstacle and displacement."""
    mesh = TriangleMesh.rectangle((4, 3), 2.0, 1.0, grading=0.8)
    sides = [
        Contact("bottom", friction=0.3, gap=Polynomial([[0.0], [1e-3]]), offset=1e-3),
        Displacement("left", x=0.0, y=Polynomial([[0.0, 2e-3]])),
        Traction("right", x=Polynomial([[1.0, -1.0]]), y=0.0),
        Traction("top", x=0.0, y=-1.0),
    ]
    qvi = discretize(ContactProblem(mesh, Material(1e3, 0.3, "strain"), sides, lambda x, y: 3.0 * y + x**2)).qvi
    other = qvi.load - qvi.root.adjoint(qvi.root.apply(np.zeros(qvi.n)))
    assert qvi.f == pytest.approx(other, abs=1e-12 * np.abs(qvi.f).max())


VECTORS = ("f", "load", "n0", "t0", "mu", "W", "b", "cohesion", "cap")


def block(friction=0.3, shear=0.0, push=-1.0, gap=0.0, weight=0.0, force=-3.0, law="unilateral", poisson=0.2):
    """A block on the ground, pressed by a plate, with a shear on its right side that the ground's corner shares."""
    mesh = TriangleMesh.rectangle((3, 2), 2.0, 1.0)
    limits = (0.0, 0.0) if law == "tied" else (friction, 0.1)
    ground = Contact("bottom", limits[0], gap, 0.1 * gap, "ground", limits[1], law=law)
    plate = Contact("top", friction, name="plate", plate=RigidPlate(force_y=force))
    sides = [Traction("right", x=push, y=shear), Displacement("left", x=0.0), Traction("left", y=0.0)]
    return ContactProblem(
        mesh, Material(1e3, poisson), [ground, plate, *sides], body_potential=lambda x, y: weight * y + 0.0 * x
    )


DATA = {
    "friction": {"friction": 0.5}, "loads": {"push": -2.0}, "another unit": {"push": -50.0, "force": -90.0},
    "gap": {"gap": -1e-3}, "weight": {"weight": 0.7}, "plate": {"force": -5.0},
}  # fmt: skip


@pytest.mark.parametrize("change", DATA.values(), ids=DATA)
def test_other_data_share_matrices_and_are_those_made_alone(change):
    first, alone = discretize(block()), discretize(block(**change))
    after = first.with_data(alone.problem)
    assert after.qvi.K is first.qvi.K
    assert after.qvi.N is first.qvi.N
    assert after.qvi.stiffness is first.qvi.stiffness
    for name in VECTORS:
        expected = getattr(alone.qvi, name)
        size = np.abs(expected[np.isfinite(expected)]).max(initial=1.0)
        assert getattr(after.qvi, name) == pytest.approx(expected, rel=1e-12, abs=1e-12 * size), name
    z = np.random.default_rng(1).normal(size=alone.qvi.n)
    assert after.qvi.gradient(z) == pytest.approx(alone.qvi.gradient(z), rel=1e-9, abs=1e-9)
    assert after.coefficients(after.values(z)) == pytest.approx(alone.coefficients(alone.values(z)))


def test_tractions_are_eliminated_once():
    """Other values, of tractions and of the body force in them, change the particular stress only."""
    weight = Polynomial([[0.0, 0.5]])
    first = discretize(replace(block(), body_potential=weight))
    for changed in (block(push=-1.1), replace(block(), body_potential=Polynomial([[0.0, 0.6]]))):
        other = first.with_data(changed, first.scales)
        assert other.supports.basis is first.supports.basis
        assert np.abs(other.root.particular - first.root.particular).max() > 1e-3


def test_other_bodies_share_nothing_and_other_contact_rows_no_rows():
    """A tied contact limits no traction: it has no rows."""
    first = discretize(block())
    for problem in (block(poisson=0.3), replace(block(), regions=[Region(Material(5e2, 0.2), y=(0.0, 0.5))])):
        alone = discretize(problem)
        after = first.with_data(alone.problem)
        assert after.qvi.stiffness is not first.qvi.stiffness
        assert abs(after.qvi.K - alone.qvi.K).max() == 0.0
    alone = discretize(block(law="tied"))
    assert first.with_data(alone.problem).qvi.m == alone.qvi.m < first.qvi.m


def test_one_factorisation_and_one_schur_complement_serve_the_sequence():
    first = discretize(block())
    solve(first)
    factor, stiffness = first.qvi.stiffness.factor, first.qvi.condensed_contact.reduced[2]
    after = first.with_data(discretize(block(friction=0.6, push=-1.5)).problem)
    shared = solve(after)
    assert after.qvi.stiffness.factor is factor
    assert after.qvi.condensed_contact.reduced[2] is stiffness
    alone = solve(block(friction=0.6, push=-1.5))
    assert shared.contacts["ground"].normal_stress == pytest.approx(alone.contacts["ground"].normal_stress, abs=1e-10)


def test_factors_of_a_mesh_that_is_gone_are_freed():
    """At once, with the mesh: what it keeps does not refer to it. Memory of refinements would add up."""
    gc.disable()
    try:
        result = solve(block())
        factor, mesh = ref(result.discretization.qvi.stiffness.factor), ref(result.problem.mesh)
        assert result.contacts["ground"].normal_force > 0.0
        del result
        assert (factor(), mesh()) == (None, None)
    finally:
        gc.enable()


def test_what_problems_share_cannot_be_written_to():
    qvi = discretize(block()).qvi
    for matrix in (qvi.stiffness.K, qvi.contact.N, qvi.contact.T):
        with pytest.raises(ValueError, match="read-only"):
            matrix[0, 0] = 1.0


def test_of_one_kind_the_latest_few_are_kept():
    kept, made = Kept(), []
    for key in (1, 2, 3, 4, 1, 5, 1, 2):
        kept(int, key, lambda key=key: made.append(key) or key)
    assert made == [1, 2, 3, 4, 5, 2]


def test_conditions_rule_edges_of_their_own_mesh():
    """Equal meshes keep one set of matrices, also where they call other edges by one name."""
    first = block()
    names = {"bottom": "bottom", "top": "top", "left": "right", "right": "left"}
    sets = {name: first.mesh.edge_sets[other] for name, other in names.items()}
    swapped = replace(first, mesh=TriangleMesh(first.mesh.vertices, first.mesh.cells, sets))
    owners = swapped.owners
    discretize(first).with_data(swapped)
    assert np.array_equal(replace(swapped).owners, owners)
    assert not np.array_equal(first.owners, owners)


def test_a_problem_on_another_mesh_is_refused():
    finer = replace(block(), mesh=TriangleMesh.rectangle((4, 2), 2.0, 1.0))
    with pytest.raises(InputError) as caught:
        discretize(block()).with_data(finer)
    assert caught.value.field == "ContactProblem.mesh"


@pytest.mark.parametrize("options", [{}, {"degree": 5}, {"law_on": "points"}])
def test_the_same_options_again_share_all_matrices(options):
    before = discretize(block(), **options)
    assert before.with_data(block(push=-2.0)).qvi.K is before.qvi.K
