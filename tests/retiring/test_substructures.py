"""Schur complements and solutions of shared subdomains are those of the assembled K, whatever the boundary does."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    discretize,
)
from qvi_contact.discretization.bogner_fox_schmit import substructures as module
from qvi_contact.discretization.bogner_fox_schmit.substructures import substructures, why_not
from qvi_contact.gallery import compressed_plate, sliding_block, ssnv128
from solvers.factorisation.dissection import SharedSubdomains
from solvers.factorisation.threads import limited_blas
from tests.effort import thinned

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # subdomains of rectangles

STEEL = Material(2.09e5, 0.3)


@pytest.fixture(autouse=True)
def one_thread():
    """Dense reference solutions on many threads take minutes where other tests run beside them."""
    with limited_blas(1):
        yield


def block(*conditions, cells=(7, 12), width=1.0, height=1.5, origin=(0.0, 0.0)):
    mesh = RectilinearMesh.rectangle(cells, width, height, origin=origin)
    return ContactProblem(mesh, STEEL, conditions)


def press():
    """Free on two sides, so that one of them hangs on three unknowns."""
    left, right = Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)
    return left, right, Contact("bottom", 0.3), Contact("top", 0.2, gap=-1e-3)


def driven():
    """A plate with given force and moment; equality rows touch the ends of the contact."""
    plate = RigidPlate(force_y=-4.0, moment=1.0)
    sides = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    return *sides, Contact.tied("bottom"), Contact("top", 0.2, plate=plate)


def patched():
    """Sides of several conditions each: contact, traction, displacement."""
    mesh = RectilinearMesh.rectangle((14, 11), 1.4, 1.1, origin=(1e3, -5.0))
    mesh = mesh.with_edges("shoe", "top", start=mesh.x[5], stop=mesh.x[9]).with_edges("before", "top", stop=mesh.x[5])
    mesh = mesh.with_edges("behind", "top", start=mesh.x[9]).with_edges("foot", "right", stop=mesh.y[3])
    mesh = mesh.with_edges("shank", "right", start=mesh.y[3])
    conditions = [
        Displacement("bottom", x=0.0, y=0.0),
        Traction("left", 0.0, -2.0),
        Traction("before", 0.0, 0.0),
        Contact("shoe", 0.4),
        Traction("behind", y=0.0),
        Displacement("behind", x=1e-3),
        Contact("foot", 0.1),
        Traction("shank", 0.0, 0.0),
    ]
    return ContactProblem(mesh, STEEL, conditions)


def stamped():
    """A stamp on the middle of the top, free to its left and right: equal traction edges, but of two chains."""
    mesh = RectilinearMesh.rectangle((20, 5), 2.0, 0.5)
    mesh = mesh.with_edges("stamp", "top", start=mesh.x[8], stop=mesh.x[12])
    mesh = mesh.with_edges("before", "top", stop=mesh.x[8]).with_edges("behind", "top", start=mesh.x[12])
    held = [Displacement(side, 0.0, 0.0) for side in ("left", "bottom", "right")]
    return ContactProblem(
        mesh, STEEL, [*held, Traction("before", 0.0, 0.0), Contact("stamp", 0.2), Traction("behind", 0.0, 0.0)]
    )


PROBLEMS = {
    "plate": compressed_plate(0.2, cells=(12, 12)),
    "plate of odd cells": compressed_plate(0.2, cells=(9, 17), width=3.0, height=2.0),
    "one column": compressed_plate(0.2, cells=(1, 19), height=4.0),
    "one row": compressed_plate(0.2, cells=(19, 1), width=4.0),
    "one cell": compressed_plate(0.2, cells=(1, 1)),
    "sliding": sliding_block((15, 7))[0],
    "opening": ssnv128((11, 11)),
    "press": block(*press()),
    "press of thin cells": block(*press(), width=9.0, cells=(10, 9)),
    "driven": block(*driven()),
    "patched": patched(),
    "stamped": stamped(),
    "four contacts": block(*(Contact(side, 0.1) for side in ("bottom", "right", "top", "left")), origin=(2.0, 3.0)),
    "no contact": block(
        Symmetry("left"), Symmetry("bottom"), Traction("right", 0.0, 0.0), Displacement("top", 0.0, -1.0)
    ),
    "glued": block(Contact.tied("bottom"), *(Displacement(side, 1.0, 0.0) for side in ("left", "right", "top"))),
}


def interface_of(problem):
    qvi = problem.qvi
    return np.unique(np.concatenate([rows.nonzero()[1] for rows in (qvi.N, qvi.T, qvi.A)])).astype(np.int64)


def tree_of(discretization, interface=None):
    d = discretization
    interface = interface_of(d) if interface is None else interface
    return substructures(d.energy, d.elimination, interface)


@cache
def reference(name):
    """The problem, K and Γ."""
    discretization = discretize(PROBLEMS[name])
    return discretization, discretization.qvi.K.toarray(), interface_of(discretization)


def schur(K, interface):
    interior = np.setdiff1d(np.arange(len(K)), interface)
    coupling = K[np.ix_(interior, interface)]
    return K[np.ix_(interface, interface)] - coupling.T @ np.linalg.solve(K[np.ix_(interior, interior)], coupling)


@pytest.mark.parametrize(("name", "leaf"), thinned(product(PROBLEMS, (2, 4, 8)), 20))
def test_against_dense(name, leaf, monkeypatch):
    """S to 1e-10, and solutions of the assembled K but for its rounding, for several sizes of leaves."""
    monkeypatch.setattr(module, "_LEAF", leaf)
    discretization, K, interface = reference(name)
    tree = tree_of(discretization)
    factor = SharedSubdomains(tree)
    expected = schur(K, interface)
    assert np.array_equal(factor.interface, interface)
    assert np.abs(factor.schur - expected).max(initial=0.0) <= 1e-10 * np.abs(expected).max(initial=0.0)
    right = np.random.default_rng(0).normal(size=(len(K), 2))
    x = factor.solve(right)
    error = np.linalg.norm(K @ x - right) / (np.linalg.norm(K) * np.linalg.norm(x))
    assert error < 1e-14
    assert factor.solve(right[:, 0]) == pytest.approx(x[:, 0], rel=1e-9, abs=1e-12 * np.abs(x).max())


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_unknown_is_eliminated_once(name):
    discretization, K, interface = reference(name)
    eliminated = [subdomain.eliminated.ravel() for subdomain in tree_of(discretization).classes]
    assert np.array_equal(np.sort(np.concatenate([*eliminated, interface])), np.arange(len(K)))


@pytest.mark.parametrize("name", ["plate", "press", "patched"])
def test_other_interfaces(name):
    """Nothing stays; only roots stay; some unknowns at the contact more than needed."""
    discretization, K, interface = reference(name)
    roots = np.unique(discretization.elimination.slave_basis.nonzero()[1]).astype(np.int64)
    right = np.ones(len(K))
    for chosen in (roots[:0], roots, np.setdiff1d(interface, roots), np.union1d(interface, [len(K) - 1])):
        factor = SharedSubdomains(tree_of(discretization, chosen))
        expected = schur(K, chosen)
        assert np.abs(factor.schur - expected).max(initial=0.0) <= 1e-10 * np.abs(expected).max(initial=0.0)
        x = factor.solve(right)
        assert np.linalg.norm(K @ x - right) < 1e-14 * np.linalg.norm(K) * np.linalg.norm(x)


@pytest.mark.parametrize("sides", ["plate", "press"])
def test_classes_grow_with_the_logarithm_of_the_mesh(sides):
    """A press hangs on unknowns whose coefficients grow along its side; the blocks there are alike nevertheless."""

    def count(n):
        problem = compressed_plate(0.2, cells=(n, n)) if sides == "plate" else block(*press(), cells=(n, n))
        return len(tree_of(discretize(problem)).classes)

    assert count(64) - count(32) <= 20
    assert count(128) - count(64) <= 20
    assert count(100) <= count(128)


@pytest.mark.parametrize("conditions", [compressed_plate(0.2).conditions, press()], ids=["plate", "press"])
def test_finer_mesh_against_scipy(conditions):
    """64²: a residual of the size of SuperLU's, each row over its terms (Oettli and Prager).

    Its norm is that of the few rows of roots, where it differs tenfold from one processor to the next.
    """
    discretization = discretize(block(*conditions, cells=(64, 64)))
    K, load = discretization.qvi.K, np.asarray(discretization.qvi.f)
    x = SharedSubdomains(tree_of(discretization)).solve(load)
    expected = splu(K, "MMD_AT_PLUS_A", 0.0, options={"SymmetricMode": True}).solve(load)
    missed, usual = (np.abs(K @ z - load) / (abs(K) @ np.abs(z) + np.abs(load)) for z in (x, expected))
    assert missed.max() < 10.0 * usual.max()
    assert np.linalg.norm(x - expected) < 1e-6 * np.linalg.norm(expected)


def restricted():
    """One problem for every reason not to share."""
    mesh = RectilinearMesh.rectangle((6, 4), 1.5, 1.0)
    conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", 0.0, 0.0), Contact("top", 0.2)]
    notched = RectilinearMesh(mesh.x, mesh.y, np.arange(24).reshape(4, 6) != 23)
    jointed = mesh.with_joint("joint", "horizontal", mesh.y[2])
    soft = Region(Material(1e5, 0.2), x=(0.0, mesh.x[2]))
    return {
        "the body is not a rectangle": ContactProblem(notched, STEEL, conditions),
        "the cells differ in size": compressed_plate(0.2, (4, 4), grading=0.9),
        "there are several materials": ContactProblem(mesh, STEEL, conditions, regions=[soft]),
        "there are contacts inside the body": ContactProblem(jointed, STEEL, [*conditions, Contact("joint", 0.3)]),
    }


@pytest.mark.parametrize(("reason", "problem"), restricted().items(), ids=restricted())
def test_where_it_does_not_apply(reason, problem):
    d = discretize(problem)
    assert why_not(d.energy, d.elimination, interface_of(d)) == reason
    assert tree_of(d) is None


def test_a_material_that_covers_everything():
    """The material of the cells counts, not the first of the list."""
    plain = compressed_plate(0.2, cells=(5, 5))
    region = Region(Material(1e5, 0.2), x=(0.0, 1.0))
    d = discretize(ContactProblem(plain.mesh, plain.material, plain.conditions, regions=[region]))
    K, interface = d.qvi.K.toarray(), interface_of(d)
    assert SharedSubdomains(tree_of(d)).schur == pytest.approx(schur(K, interface), rel=1e-9, abs=1e-9)


def test_conditions_that_change_too_often(monkeypatch):
    """Every chain of linked values that does not hang on the gauge adds columns to the fronts."""
    d = discretize(block(*press()))
    assert why_not(d.energy, d.elimination, interface_of(d)) is None
    monkeypatch.setattr(module, "_MOST_ROOTS", 2)
    assert "too often" in str(why_not(d.energy, d.elimination, interface_of(d)))
