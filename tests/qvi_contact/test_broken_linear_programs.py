"""What `scipy.optimize.linprog` answers is looked at before it is used: if it is broken, this package says so."""

from functools import cache

import numpy as np
import pytest
from scipy import optimize

from qvi_contact import (
    Contact,
    ContactProblem,
    Corner,
    Material,
    SolveError,
    Traction,
    TriangleMesh,
    limit_load_factor,
    solve,
)
from qvi_contact.mechanism import find_mechanism
from solvers import Status


@cache
def outlined(size, *corners):
    return TriangleMesh.outline([Corner(*corner) for corner in corners], size)


def dragged_block(drag):
    """A block of 2 × 1 under a pressure of 1, pulled along a base of friction 0.3."""
    mesh = outlined(0.6, ((0, 0), "base"), ((2, 0), "right"), ((2, 1), "top"), ((0, 1), "left"))
    free = [Traction("left", x=0.0, y=0.0), Traction("top", normal=-1.0, tangential=0.0)]
    return ContactProblem(mesh, Material(1e4, 0.3), [Contact("base", 0.3), Traction("right", x=drag, y=0.0), *free])


def wedge():
    """A triangle pressed between two obstacles, one of them aslant: its units come from a linear program."""
    mesh = outlined(0.8, ((0, 0), "base"), ((2, 0), "right"), ((1, 1.5), "left"))
    pressed = Traction("left", normal=-1.0, tangential=0.0)
    return ContactProblem(mesh, Material(1e4, 0.3), [Contact("base", 0.3), Contact("right", 0.3, gap=-1e-3), pressed])


def _part(name, change):
    def broken(answer):
        answer[name] = change(answer[name])
        return answer

    return broken


def _marginals(change):
    def broken(answer):
        if answer.ineqlin is not None:
            answer.ineqlin = change(answer.ineqlin)
        return answer

    return broken


def _raised(_):
    raise RuntimeError("broken")


BROKEN = {
    "x is None": _part("x", lambda _: None),
    "x is NaN": _part("x", lambda x: None if x is None else np.full(len(x), np.nan)),
    "x is short": _part("x", lambda x: None if x is None else x[:1]),
    "no marginals": _marginals(lambda _: None),
    "marginals are NaN": _marginals(lambda found: optimize.OptimizeResult(marginals=np.nan * found.marginals)),
    "raises": _raised,
}


@pytest.fixture(params=BROKEN)
def broken_linprog(request, monkeypatch):
    sound = optimize.linprog

    def broken(*arguments, **program):
        answer = sound(*arguments, **program)
        return BROKEN[request.param](answer if answer.status == 0 else optimize.OptimizeResult(answer))

    monkeypatch.setattr(optimize, "linprog", broken)


@pytest.mark.usefixtures("broken_linprog")
def test_a_broken_answer_decides_nothing():
    """No limit load and no mechanism; a mesh has its own proof, and units that are sought in vain stay as they are."""
    with pytest.raises(SolveError):
        limit_load_factor(dragged_block(-0.1), ["right"])
    with pytest.raises(SolveError):
        find_mechanism(dragged_block(-2.0))
    assert solve(dragged_block(-2.0)).status is Status.INFEASIBLE_ON_MESH
    result = solve(wedge())
    assert result.status is Status.SOLVED
    assert result.certificate.passed
