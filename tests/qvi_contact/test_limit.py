"""Limit loads against closed forms, what solving says around them, and the linear programs behind them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import optimize

from qvi_contact import Corner, SolveError, TriangleMesh, solve
from qvi_contact.gallery import masonry_wall
from qvi_contact.limit import limit_load_factor
from qvi_contact.mechanism import find_mechanism
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Traction
from solvers import Status
from tests.qvi_contact.builders import polygon, with_line
from tests.qvi_contact.test_mechanism import STEEL, dragged

MESHES = {"one cell": TriangleMesh.rectangle((1, 1), 2.0, 1.0), "uniform": TriangleMesh.rectangle((6, 4), 2.0, 1.0),
          "graded": TriangleMesh.rectangle((5, 5), 2.0, 1.0, grading=0.5)}  # fmt: skip


@pytest.mark.parametrize(
    ("frictions", "factor", "name"),
    [((0.3, 0.4, 0.5), 3.0, "bottom"), ((0.3, 0.2, 0.5), 2.0, "low"), ((0.6, 0.5, 0.1), 1.0, "high")],
)
def test_the_weakest_joint_of_a_stack_decides(frictions, factor, name):
    """Blocks on each other and on the ground, pressed by 10 and dragged by 1."""
    mesh = TriangleMesh.grid([0.0, 0.7, 2.0], [0.0, 0.25, 0.5, 0.75, 1.0])
    mesh = with_line(with_line(mesh, "low", "horizontal", 0.25), "high", "horizontal", 0.75)
    contacts = [Contact(edges, mu) for edges, mu in zip(("bottom", "low", "high"), frictions, strict=True)]
    held, beyond = (
        ContactProblem(mesh, STEEL, [*contacts, *dragged(contacts[0], shear=shear).conditions[1:]])
        for shear in (1.0, 1.01 * factor)
    )
    assert limit_load_factor(held, ["shear"]) == pytest.approx(factor, rel=1e-6)
    failed = solve(beyond)
    assert failed.status is Status.INFEASIBLE
    assert [joint for joint, motion in failed.mechanism.contacts.items() if motion.slides] == [name]


def test_force_of_a_plate_and_of_a_body_without_contact():
    """N from a plate, dragged by H: the limit of N is none, the least one is not asked for."""
    plate = RigidPlate(force_y=-20.0, force_x=1.0, moment=-21.0)
    contacts = [Contact("bottom", 0.3, name="base"), Contact("top", 0.0, law="tied", plate=plate, name="grip")]
    problem = ContactProblem(MESHES["uniform"], STEEL, [*contacts, Traction("left", 0, 0), Traction("right", 0, 0)])
    assert limit_load_factor(problem, ["grip"]) == np.inf  # all grows together
    ground = solve(problem)
    assert ground.status is Status.SOLVED
    force = ground.resultant("base")
    assert (force.x, force.y) == pytest.approx((-1.0, 20.0), rel=1e-9)
    conditions = [Displacement("bottom", 0.0, 0.0), *(Traction(side, 1.0, 1.0) for side in ("top", "right", "left"))]
    assert limit_load_factor(ContactProblem(MESHES["uniform"], STEEL, conditions), ["top"]) == np.inf


def test_cohesion_on_a_circle_carries_a_torque():
    """2π c r², whatever presses there: unknowns that make no stress on a joint but rounding carry nothing."""
    mesh = polygon(12, 2, 0.5, 2.0).with_joint("seam", lambda x, y: np.abs(np.hypot(x, y) - 0.966) < 0.01)
    for name, radius in (("hole", 0.5), ("seam", 1.0), ("outside", 2.0)):
        mesh = mesh.with_arc(name, (0.0, 0.0), radius)
    torque = Traction("outside", x=lambda _, y: -y, y=lambda x, _: x, name="torque")  # 16π
    for law in ("bilateral", "unilateral"):
        held = [Contact("seam", 0.0, cohesion=0.5, law=law), Displacement("hole", x=0.0, y=0.0)]
        limit = limit_load_factor(ContactProblem(mesh, STEEL, [*held, torque]), ["torque"], degree=3)
        assert (limit.lower, limit.upper) == pytest.approx((0.0625, 0.0625), rel=1e-9)


def test_gap_material_and_offset_do_not_enter():
    here, there = Contact("bottom", 0.3), Contact("bottom", 0.3, gap=0.1, offset=-0.2)
    given = (here, STEEL), (there, Material(1.0, 0.49, "strain"))
    problems = (dragged(contact, 10.0, 2.0, MESHES["graded"], material) for contact, material in given)
    first, second = (limit_load_factor(problem, ["shear"]) for problem in problems)
    assert first == pytest.approx(second, rel=1e-9)
    smooth = dragged(Contact("bottom", 0.0, law="bilateral"), 10.0, 2.0, MESHES["uniform"])
    heavy = ContactProblem(smooth.mesh, STEEL, smooth.conditions, lambda _, y: y)
    assert limit_load_factor(heavy, ["shear"]) == pytest.approx(0.0, abs=1e-12)  # the limit itself is rounding


@pytest.fixture
def linprog(monkeypatch):
    """HiGHS: its calls are kept, and parts of its answers are others where `change` says so."""
    true, kept = optimize.linprog, SimpleNamespace(calls=[], change=lambda _: {})

    def recorded(*cost, options, **program):
        kept.calls.append((options, program["A_ub"]))
        answer = true(*cost, options=options, **program)
        return optimize.OptimizeResult(answer, **kept.change(answer)) if answer.status == 0 else answer

    monkeypatch.setattr(optimize, "linprog", recorded)
    return kept


def test_the_linear_program_gets_what_is_left(linprog):
    """All attempts together 300 seconds at most, less with a limit; limits of steps are not taken for one of time."""
    linprog.change = lambda _: {"status": 1}
    problem = dragged(Contact("bottom", 0.5), mesh=TriangleMesh.rectangle((2, 2)))
    for seconds in (None, 20.0):
        with pytest.raises(SolveError, match="limits of steps"):
            limit_load_factor(problem, ["shear"], time_limit=seconds)
    limits = [options["time_limit"] for options, _ in linprog.calls]
    assert 300.0 >= limits[0] > limits[1] > 20.0 >= limits[-1] > 0.0


def test_growth_without_end_is_doubted(linprog):
    """HiGHS may say so of a mesh by rounding, and once more: then the mechanism is right."""
    problem = dragged(Contact("bottom", 0.3), 10.0, 4.0, MESHES["one cell"])
    assert limit_load_factor(problem, ["shear"]) == pytest.approx(0.75)
    last, linprog.calls[:] = len(linprog.calls), []
    linprog.change = lambda _: {"status": 3} if len(linprog.calls) == last else {}
    assert limit_load_factor(problem, ["shear"]) == pytest.approx(0.75)
    linprog.calls.clear()
    linprog.change = lambda _: {"status": 3} if len(linprog.calls) >= last else {}
    with pytest.raises(SolveError, match="contradict"):
        limit_load_factor(problem, ["shear"])
    linprog.calls.clear()
    glued = dragged(Contact("bottom", 0.3, cohesion=1.0, law="bilateral"), 10.0, 4.0, MESHES["one cell"])
    linprog.change = lambda _: {"status": 4} if len(linprog.calls) > 1 else {}
    assert limit_load_factor(glued, ["shear"]) == pytest.approx(0.25)  # by cohesion: the signs of pressure all failed


def test_programs_of_many_blocks_are_sparse(linprog):
    """Conditions of a joint have entries for its two blocks, and for what slips there. Cycling has an end."""
    assert find_mechanism(masonry_wall(4, 6, ())) is None
    ((options, matrix),) = linprog.calls  # solved at the first attempt
    assert (matrix.nnz < 4 * matrix.shape[0], options["maxiter"] <= 10 * sum(matrix.shape)) == (True, True)
    linprog.change = lambda _: {"status": 1} if len(linprog.calls) < 4 else {}  # at limits of steps of all but one
    assert find_mechanism(masonry_wall(4, 6, ())) is None
    assert len(linprog.calls) == 4


BROKEN = {
    "x is None": lambda _: {"x": None},
    "x is NaN": lambda found: {"x": np.full(len(found.x), np.nan)},
    "x is short": lambda found: {"x": found.x[:1]},
    "no marginals": lambda _: {"ineqlin": None},
    "marginals are NaN": lambda found: {"ineqlin": optimize.OptimizeResult(marginals=np.nan * found.ineqlin.marginals)},
    "fails": lambda _: {"status": 4},
    "raises": lambda _: 1 // 0,
}


@pytest.mark.parametrize("change", BROKEN.values(), ids=BROKEN)
def test_a_broken_answer_decides_nothing(linprog, change):
    """No limit load and no mechanism; a mesh has its own proof, and units that are sought in vain stay as they are."""
    linprog.change, problem = change, dragged(Contact("bottom", 0.3), 10.0, 4.0, MESHES["one cell"])
    for found in (find_mechanism, lambda each: limit_load_factor(each, ["shear"])):
        with pytest.raises(SolveError):
            found(problem)
    assert solve(problem).status is Status.INFEASIBLE_ON_MESH
    # a triangle pressed between two obstacles, one of them aslant: its units come from a linear program
    mesh = TriangleMesh.outline([Corner((0, 0), "base"), Corner((2, 0), "right"), Corner((1, 1.5), "left")], 0.8)
    wedge = [Contact("base", 0.3), Contact("right", 0.3, gap=-1e-3), Traction("left", normal=-1.0, tangential=0.0)]
    result = solve(ContactProblem(mesh, Material(1e4, 0.3), wedge))
    assert (result.status, result.certificate.passed) == (Status.SOLVED, True)
