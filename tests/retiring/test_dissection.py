"""Subdomains shared by classes: a chain of equal links, where every level of bisection is one class."""

from functools import partial

import numpy as np
import pytest

from solvers import InputError
from solvers.factorisation import FactorisationError
from solvers.factorisation.dissection import Part, SharedSubdomains, SubdomainClass, SubdomainTree
from tests.steps import steps

LINK = np.array([[1.5, -1.0], [-1.0, 1.5]])
NOTHING = np.zeros(0, dtype=np.int64)
NO_MIX = np.zeros((0, 0))


def whole_chain(levels, link=LINK):
    """Matrix of a chain of 2^levels links, shape (2^levels + 1,) twice."""
    K = np.zeros((2**levels + 1, 2**levels + 1))
    for first in range(2**levels):
        K[first : first + 2, first : first + 2] += link
    return K


def chain_classes(levels, link=LINK):
    """A class for every level: columns are the middle, eliminated, then the two ends."""
    classes = [SubdomainClass(np.zeros((2**levels, 0), dtype=np.int64), 2, link)]
    for level in range(1, levels + 1):
        middle = 2 ** (level - 1) + 2**level * np.arange(2 ** (levels - level))
        halves = 2 * np.arange(len(middle))
        parts = (
            Part(level - 1, halves, np.array([1, 0]), NOTHING, NO_MIX),
            Part(level - 1, halves + 1, np.array([0, 2]), NOTHING, NO_MIX),
        )
        classes.append(SubdomainClass(middle[:, None], 2, None, parts))
    return classes


def chain(levels, link=LINK):
    ends = np.array([0, 2**levels])
    return SharedSubdomains(SubdomainTree(2**levels + 1, ends, tuple(chain_classes(levels, link)), 0.25))


def schur(K, interface):
    interior = np.setdiff1d(np.arange(len(K)), interface)
    coupling = K[np.ix_(interior, interface)]
    inner = np.linalg.solve(K[np.ix_(interior, interior)], coupling)
    return K[np.ix_(interface, interface)] - coupling.T @ inner


@pytest.mark.parametrize("levels", [1, 2, 5])
def test_schur_complement_of_a_chain(levels):
    factor = chain(levels)
    expected = schur(whole_chain(levels), factor.interface)
    assert factor.schur == pytest.approx(expected, rel=1e-13)
    assert np.array_equal(factor.schur, factor.schur.T)


@pytest.mark.parametrize("shape", [(), (1,), (3,)])
def test_solutions(shape):
    factor = chain(4)
    right = np.random.default_rng(0).normal(size=(17, *shape))
    expected = np.linalg.solve(whole_chain(4), right)
    assert factor.solve(right) == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_reduce_and_expand():
    """The reduced right-hand side by its definition; the interior for any values on Γ, one state used twice."""
    K, factor = whole_chain(3), chain(3)
    ends, interior = factor.interface, np.arange(1, 8)
    right = np.random.default_rng(1).normal(size=9)
    inner, coupling = K[1:8, 1:8], K[np.ix_(interior, ends)]
    reduced, state = factor.reduce(right)
    assert reduced == pytest.approx(right[ends] - coupling.T @ np.linalg.solve(inner, right[interior]), rel=1e-13)
    for values in (np.array([0.3, -2.0]), np.zeros(2)):
        x = factor.expand(state, values)
        assert np.array_equal(x[ends], values)
        assert x[interior] == pytest.approx(np.linalg.solve(inner, right[interior] - coupling @ values), rel=1e-12)


@pytest.mark.parametrize("inner", [[], [8], [0], [0, 9], [0, 8, 9]])
def test_combined_columns(inner):
    """The last node is ½ a + 2 b with unknowns a, b on supports: Bᵀ K B is factorised, whichever of the ends stay."""
    mix, ends = np.array([[0.5, 2.0]]), np.array([0, 8, 9])
    B = np.zeros((9, 10))
    B[:8, :8] = np.eye(8)
    B[8, 8:] = mix
    support = np.array([0.0, 1.0, 3.0])
    K = B.T @ whole_chain(3) @ B
    K[ends, ends] += support

    staying = np.setdiff1d(ends, inner)
    order = np.searchsorted(ends, np.concatenate([inner, staying]).astype(int))
    column = np.argsort(order)
    part = Part(3, np.zeros(1, dtype=np.int64), column[:1], column[1:], mix)
    eliminated = np.array(inner, dtype=np.int64)[None, :]
    top = SubdomainClass(eliminated, len(staying), np.diag(support[order]), (part,))
    factor = SharedSubdomains(SubdomainTree(10, staying, (*chain_classes(3), top)))

    right = np.random.default_rng(2).normal(size=(10, 2))
    assert factor.schur == pytest.approx(schur(K, staying), rel=1e-13)
    assert factor.solve(right) == pytest.approx(np.linalg.solve(K, right), rel=1e-12, abs=1e-13)


def test_order_of_columns_is_free():
    """A whole that wants the columns of its part in another order gets the same sums."""
    link = np.array([[2.0, -1.0, 0.3, 0.1], [-1.0, 3.0, 0.2, 0.4], [0.3, 0.2, 2.5, -0.7], [0.1, 0.4, -0.7, 4.0]])
    for places in ([0, 1, 2, 3], [3, 2, 1, 0], [2, 0, 3, 1], [1, 2, 3, 0]):
        K = np.zeros((4, 4))
        K[np.ix_(places, places)] = link
        leaf = SubdomainClass(np.zeros((1, 0), dtype=np.int64), 4, link)
        part = Part(0, np.zeros(1, dtype=np.int64), np.array(places), NOTHING, NO_MIX)
        top = SubdomainClass(np.array([[0, 1]]), 2, None, (part,))
        factor = SharedSubdomains(SubdomainTree(4, np.array([2, 3]), (leaf, top)))
        assert factor.schur == pytest.approx(schur(K, factor.interface), rel=1e-14)


def test_each_class_is_factorised_once():
    """2²⁰ links are 20 small matrices; the ends of such a chain do not feel each other."""
    assert steps(partial(chain, 20)) < 3 * steps(partial(chain, 10))
    factor = chain(20)
    root = np.sqrt(1.25)  # stiffness of a half-infinite chain: c = 1.5 − 1/(1.5 + c)
    assert factor.schur == pytest.approx(np.diag([root, root]), rel=1e-12)
    assert factor.size == 2**20 + 1
    right = np.ones(factor.size)
    assert factor.solve(right)[2**19] == pytest.approx(1.0, rel=1e-12)  # K 1 = 1 far from the ends


def test_what_it_says_of_itself():
    factor = chain(2)
    assert factor.backend == "shared-subdomains"
    assert factor.version.startswith("scipy ")
    assert factor.seconds["analysis"] == 0.25


@pytest.mark.parametrize("link", [-LINK, np.array([[1.0, -2.0], [-2.0, 1.0]]) - 1.5 * np.eye(2)])
def test_indefinite_matrices(link):
    with pytest.raises(FactorisationError, match="shared-subdomains") as caught:
        chain(3, link)
    assert caught.value.reason == "singular"


@pytest.mark.parametrize("early", [0, 1, 2])
def test_vanishing_pivots(early):
    """Singular but for rounding; the last pivot is compared with K, not with what earlier classes left of it."""
    link = np.array([[1.0, -1.0], [-1.0, 1.0 + 4e-16]])
    first, staying = np.arange(early)[None, :], 2 - early
    leaf = SubdomainClass(first, staying, link)
    part = Part(0, np.zeros(1, dtype=np.int64), np.arange(staying), NOTHING, NO_MIX)
    top = SubdomainClass(np.arange(early, 2)[None, :], 0, None, (part,))
    with pytest.raises(FactorisationError, match=r"pivot is 4\.4e-16"):
        SharedSubdomains(SubdomainTree(2, NOTHING, (leaf, top)))


def test_vanishing_pivots_of_combined_columns():
    """One node moved by two unknowns, of which one is held by no more than rounding."""
    leaf = SubdomainClass(np.zeros((1, 0), dtype=np.int64), 1, np.array([[1.0]]))
    part = Part(0, np.zeros(1, dtype=np.int64), NOTHING, np.array([0, 1]), np.array([[0.5, 2.0]]))
    top = SubdomainClass(np.array([[0, 1]]), 0, np.diag([0.0, 8.0 * np.finfo(float).eps]), (part,))
    with pytest.raises(FactorisationError, match="of its diagonal entry"):
        SharedSubdomains(SubdomainTree(2, NOTHING, (leaf, top)))


def test_released_factors():
    factor = chain(2)
    _, state = factor.reduce(np.ones(5))
    for _ in range(2):
        factor.release()
    for late in (lambda: factor.reduce(np.ones(5)), lambda: factor.expand(state, np.ones(2))):
        with pytest.raises(FactorisationError, match="released"):
            late()


def test_wrong_shapes():
    with pytest.raises(InputError, match="right"):
        chain(2).reduce(np.ones(4))
