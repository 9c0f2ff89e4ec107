"""Limit loads against closed forms, what solving says around them, and the reasons given beyond."""

from itertools import pairwise, product
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import optimize

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    RigidPlate,
    SolveError,
    Symmetry,
    Traction,
    solve,
)
from qvi_contact.basics import linear_program
from qvi_contact.gallery import masonry_wall, stick_slip_block
from qvi_contact.solution.limit import limit_load, limit_load_factor
from solvers import Status
from tests.effort import thinned

STEEL = Material(1000.0, 0.3)
SIDES = {"top": 1.0, "right": 1.0, "left": -1.0}
MESHES = {
    "one cell": RectilinearMesh.rectangle((1, 1), 2.0, 1.0),
    "uniform": RectilinearMesh.rectangle((6, 4), 2.0, 1.0),
    "graded": RectilinearMesh.rectangle((5, 5), 2.0, 1.0, grading=0.5),
    "flat": RectilinearMesh.rectangle((6, 2), 30.0, 1.0),
    "millimetres": RectilinearMesh.rectangle((3, 3), 2e3, 1e3, origin=(1e5, -1e5)),
    "fine": RectilinearMesh.rectangle((16, 12), 2.0, 1.0),
}


def dragged(mesh, pressure, shear, contact, material=STEEL):
    """A block under pressure p and uniform shear, with the complementary shear on its sides: σ_T = −T, σ_N = −p."""
    return ContactProblem(
        mesh,
        material,
        [
            contact,
            Traction("top", y=-pressure, name="pressure"),
            Traction("top", x=shear, name="shear"),
            Traction("right", x=0.0, name="free"),
            Traction("right", y=shear, name="shear"),
            Traction("left", x=0.0),
            Traction("left", y=-shear, name="shear"),
        ],
    )


@pytest.mark.parametrize(
    ("mesh", "stress"),
    thinned(
        [*((mesh, 1.0) for mesh in MESHES), *((mesh, unit) for mesh in ("graded", "flat") for unit in (1e6, 1e-6))], 7
    ),
)
class TestDraggedBlock:
    """The admissible shear is μp/T, on every mesh and in all units."""

    def test_coulomb(self, mesh, stress):
        problem = dragged(MESHES[mesh], 10.0 * stress, 2.0 * stress, Contact("bottom", 0.3))
        assert limit_load_factor(problem, ["shear"]) == pytest.approx(1.5, rel=1e-6)

    def test_backwards(self, mesh, stress):
        problem = dragged(MESHES[mesh], 10.0 * stress, -7.0 * stress, Contact("bottom", 0.3))
        assert limit_load_factor(problem, ["shear"]) == pytest.approx(3.0 / 7.0, rel=1e-6)

    def test_cohesion_and_cap(self, mesh, stress):
        cohesive = Contact("bottom", 0.3, cohesion=1.5 * stress)
        assert limit_load_factor(dragged(MESHES[mesh], 10.0 * stress, stress, cohesive), ["shear"]) == pytest.approx(
            4.5, rel=1e-6
        )
        capped = Contact("bottom", 0.3, cohesion=1.5 * stress, shear_limit=4.0 * stress)
        assert limit_load_factor(dragged(MESHES[mesh], 10.0 * stress, stress, capped), ["shear"]) == pytest.approx(
            4.0, rel=1e-6
        )
        tresca = Contact.tresca("bottom", 2.0 * stress)
        assert limit_load_factor(dragged(MESHES[mesh], 10.0 * stress, stress, tresca), ["shear"]) == pytest.approx(
            2.0, rel=1e-6
        )


@pytest.mark.parametrize("cells", [(1, 1), (4, 3), (8, 6)])
class TestAroundTheLimit:
    """Just below the factor the problem is solved, just above it infeasible with the contact and the reason."""

    def test_dragged_block(self, cells):
        mesh = RectilinearMesh.rectangle(cells, 2.0, 1.0)
        base = Contact("bottom", 0.3, name="base")
        below, above = (solve(dragged(mesh, 10.0, 3.0 * factor, base)) for factor in (0.99, 1.01))
        assert below.status is Status.SOLVED, below.message
        assert below.contacts["base"].tangential_force == pytest.approx(-0.99 * 3.0 * 2.0, rel=1e-8)
        assert above.status is Status.INFEASIBLE
        assert "friction on 'base'" in above.message
        assert not above.has_state

    def test_without_friction(self, cells):
        mesh = RectilinearMesh.rectangle(cells, 2.0, 1.0)
        problem = dragged(mesh, 10.0, 1e-3, Contact.frictionless("bottom", name="ice"))
        assert limit_load_factor(problem, ["shear"]) == pytest.approx(0.0, abs=1e-9)
        failed = solve(problem)
        assert failed.status is Status.INFEASIBLE
        assert "friction on 'ice'" in failed.message


def stack(mesh, frictions, joints, weight=0.0):
    """Blocks on each other and on the ground, pressed by 10 and dragged by 1."""
    contacts = [Contact("bottom", frictions[0], name="ground")]
    contacts += [Contact(name, mu) for name, mu in zip(joints, frictions[1:], strict=True)]
    problem = dragged(mesh, 10.0, 1.0, contacts[0])
    return ContactProblem(mesh, STEEL, [*contacts, *problem.conditions[1:]], body_potential=lambda _, y: weight * y)


class TestStack:
    """The weakest joint decides, weight included: μ_i (p + γ (h − y_i)) in pure shear."""

    MESH = RectilinearMesh([0.0, 0.7, 2.0], [0.0, 0.25, 0.5, 0.75, 1.0]).with_joint("low", "horizontal", 0.25)
    MESH = MESH.with_joint("high", "horizontal", 0.75)

    @pytest.mark.parametrize(
        ("frictions", "factor", "name"),
        [((0.3, 0.4, 0.5), 3.0, "ground"), ((0.3, 0.2, 0.5), 2.0, "low"), ((0.6, 0.5, 0.1), 1.0, "high")],
    )
    def test_weakest_joint(self, frictions, factor, name):
        problem = stack(self.MESH, frictions, ("low", "high"))
        assert limit_load_factor(problem, ["shear"]) == pytest.approx(factor, rel=1e-6)
        scaled = dragged(self.MESH, 10.0, 1.01 * factor, problem.contacts[0]).conditions
        failed = solve(ContactProblem(self.MESH, STEEL, [*problem.contacts, *scaled[1:]]))
        assert failed.status is Status.INFEASIBLE
        assert f"'{name}'" in failed.message.split(":")[0]

    def test_weight_helps_the_lower_joints(self):
        """μ = (0.3, 0.35, 0.4) and γ = 20: ground 0.3 · 30, low 0.35 · 25 = 8.75, high 0.4 · 15 = 6."""
        problem = stack(self.MESH, (0.3, 0.35, 0.4), ("low", "high"), weight=20.0)
        assert limit_load_factor(problem, ["shear"]) == pytest.approx(6.0, rel=1e-6)
        problem = stack(self.MESH, (0.1, 0.35, 0.4), ("low", "high"), weight=20.0)
        assert limit_load_factor(problem, ["shear"]) == pytest.approx(3.0, rel=1e-6)

    def test_tied_joints_carry_all(self):
        problem = stack(self.MESH, (0.5, 0.5, 0.5), ("low", "high"))
        tied = [Contact.tied("bottom"), Contact.tied("low"), Contact.tied("high"), *problem.conditions[3:]]
        assert limit_load_factor(ContactProblem(self.MESH, STEEL, tied), ["shear"]) == np.inf


class TestTipping:
    """A tall block under N = p w, pushed sideways by H at the height h: it tips at H h = N w/2, friction enough."""

    WIDTH, HEIGHT, PRESSURE = 1.0, 3.0, 4.0

    def problem(self, cells, shear, friction=5.0):
        mesh = RectilinearMesh.rectangle(cells, self.WIDTH, self.HEIGHT)
        return ContactProblem(
            mesh,
            STEEL,
            [
                Contact("bottom", friction, name="base"),
                Traction("top", y=-self.PRESSURE),
                Traction("top", x=shear, name="push"),
                Traction("left", 0.0, 0.0),
                Traction("right", 0.0, 0.0),
            ],
        )

    def reach(self, cells):
        """Edge pressures are linear on each edge, so at the utmost N acts a third of the last edge from the toe."""
        return self.WIDTH / 2.0 - self.WIDTH / cells[0] / 3.0

    @pytest.mark.parametrize("cells", [(2, 3), (4, 6), (8, 8)])
    def test_factor(self, cells):
        """The push is zero in the corners, a parabola of the resultant H; the friction it needs is there."""
        limit = limit_load_factor(self.problem(cells, lambda x, _: 6.0 * x * (1.0 - x), 1e3), ["push"])
        exact = self.PRESSURE * self.WIDTH**2 / 2.0 / self.HEIGHT
        mesh_limit = self.PRESSURE * self.WIDTH * self.reach(cells) / self.HEIGHT
        assert limit <= exact * (1.0 + 1e-9)
        # four Gauss points do not see the ends of an edge: σ_N ≤ 0 there allows a little tension outside
        assert mesh_limit * (1.0 - 1e-9) <= limit

    def test_factor_converges(self):
        errors = []
        exact = self.PRESSURE * self.WIDTH**2 / 2.0 / self.HEIGHT
        for n in (2, 4, 8, 16):
            limit = limit_load_factor(self.problem((n, 4), lambda x, _: 6.0 * x * (1.0 - x), 1e3), ["push"])
            errors.append(1.0 - limit / exact)
        assert errors[-1] < 0.05
        assert all(second < 0.6 * first for first, second in pairwise(errors))

    def test_around(self):
        shape = self.problem((4, 6), lambda x, _: 6.0 * x * (1.0 - x), 1e3)
        factor = limit_load_factor(shape, ["push"])
        below, above = (
            self.problem((4, 6), lambda x, _, c=c: c * 6.0 * x * (1.0 - x), 1e3)
            for c in (0.9 * factor, 1.01 * factor.upper)
        )
        assert solve(below).status is Status.SOLVED
        failed = solve(above)
        assert failed.status is Status.INFEASIBLE
        assert "'base'" in failed.message.split(":")[0]

    def test_a_wide_block_slides_first(self):
        mesh = RectilinearMesh.rectangle((8, 2), 10.0, 1.0)
        base, loads = Contact("bottom", 0.2, name="base"), [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
        push = Traction("top", x=lambda x, _: x * (10.0 - x), name="push")
        problem = ContactProblem(mesh, STEEL, [base, *loads, Traction("top", y=-4.0), push])
        factor = limit_load_factor(problem, ["push"])
        assert factor <= 0.2 * 40.0 * 6.0 / 1000.0 * (1.0 + 1e-9)
        assert factor == pytest.approx(0.2 * 40.0 * 6.0 / 1000.0, rel=0.1)  # corners with no shear carry none


class TestKindsOfLoads:
    """Plates' forces and the body force are loads as well; some are carried without limit, some not at all."""

    def test_force_of_a_plate(self):
        """N from a plate, dragged by H: the limit of N is none, the least one is not asked for."""
        mesh = MESHES["uniform"]
        conditions = [
            Contact("bottom", 0.3, name="base"),
            Contact.tied("top", name="grip"),
            Traction("left", 0.0, 0.0),
            Traction("right", 0.0, 0.0),
        ]
        plate = RigidPlate(force_y=-20.0, force_x=1.0, moment=-21.0)
        conditions[1] = Contact("top", 0.0, law="tied", plate=plate, name="grip")
        problem = ContactProblem(mesh, STEEL, conditions)
        assert limit_load_factor(problem, ["grip"]) == np.inf  # all grows together
        ground = solve(problem)
        assert ground.status is Status.SOLVED
        force = ground.resultant("base")
        assert (force.x, force.y) == pytest.approx((-1.0, 20.0), rel=1e-9)

    @pytest.mark.parametrize("given", [0.5, 1.0, 20.0])
    def test_plate_that_pushes(self, given):
        """A ram on the side of a block under pressure 10 · 2: its force is at most μ times that."""
        ram = Contact("left", 0.0, law="bilateral", plate=RigidPlate(force_x=given), name="ram")
        loads = [Traction("top", 0.0, -10.0), Traction("right", 0.0, 0.0)]
        problem = ContactProblem(MESHES["fine"], STEEL, [Contact("bottom", 0.3), ram, *loads])
        force = given * limit_load_factor(problem, ["ram"])
        assert 5.5 < force < 6.0 * (1.0 + 1e-9)  # the corners with the free sides carry no shear
        assert force == pytest.approx(limit_load_factor(self.ram_of_one(), ["ram"]), rel=1e-6)

    @staticmethod
    def ram_of_one():
        ram = Contact("left", 0.0, law="bilateral", plate=RigidPlate(force_x=1.0), name="ram")
        loads = [Traction("top", 0.0, -10.0), Traction("right", 0.0, 0.0)]
        return ContactProblem(MESHES["fine"], STEEL, [Contact("bottom", 0.3), ram, *loads])

    def test_weight_that_holds(self):
        """Dragged by T under its own weight only: μ γ h/T, and with the weight as the load any multiple."""
        mesh = MESHES["uniform"]
        problem = dragged(mesh, 0.0, 1.0, Contact("bottom", 0.3))
        heavy = ContactProblem(mesh, STEEL, problem.conditions, body_potential=lambda _, y: 20.0 * y)
        assert limit_load_factor(heavy, ["shear"]) == pytest.approx(6.0, rel=1e-6)
        assert limit_load_factor(heavy, ["body"]) == np.inf
        assert limit_load_factor(heavy, ["shear", "body"]) == np.inf

    def test_weight_that_drags(self):
        """On a slope: the weight's component along it against friction under a pressure that stays, μp/(γ_x h).

        Gravity (γ_x, 0) acts along the base; the sides carry what makes σ_xy linear in height.
        """
        mesh = RectilinearMesh.rectangle((3, 4), 2.0, 1.0)
        # φ = −γ x is the potential of b = γ e_x; σ_xx = 0, σ_xy = γ (h − y) carries it down to the base
        conditions = [
            Contact("bottom", 0.4, name="slope"),
            Traction("top", 0.0, -10.0),
            Traction("left", 0.0, lambda _, y: -(1.0 - y), name="sides"),
            Traction("right", 0.0, lambda _, y: 1.0 - y, name="sides"),
        ]
        problem = ContactProblem(mesh, STEEL, conditions, body_potential=lambda x, _: -1.0 * x)
        assert limit_load_factor(problem, ["body", "sides"]) == pytest.approx(4.0, rel=1e-6)

    def test_pressure_is_carried_without_limit(self):
        problem = dragged(MESHES["uniform"], 10.0, 2.0, Contact("bottom", 0.3))
        assert limit_load_factor(problem, ["pressure"]) == np.inf
        assert limit_load_factor(problem, ["pressure", "shear"]) == np.inf

    def test_nothing_can_be_carried(self):
        """Shear 4 stays and no multiple of the free surfaces' nothing helps; with more pressure it would."""
        problem = dragged(MESHES["uniform"], 10.0, 4.0, Contact("bottom", 0.3))
        assert limit_load_factor(problem, ["free"]) == -np.inf
        assert limit_load(problem, ["free"]).bound == -np.inf

    def test_a_body_without_contact(self):
        conditions = [Displacement("bottom", 0.0, 0.0), *(Traction(side, 1.0, 1.0) for side in SIDES)]
        assert limit_load_factor(ContactProblem(MESHES["uniform"], STEEL, conditions), ["top"]) == np.inf

    def test_tension(self):
        """Pressure 10 from the body force's side, tension as the load: lifted at 10."""
        mesh = MESHES["uniform"]
        conditions = [
            Contact("bottom", 0.0, name="floor"),
            Traction("top", y=1.0, x=0.0, name="crane"),
            Symmetry("left"),
            Traction("right", 0.0, 0.0),
        ]
        problem = ContactProblem(mesh, STEEL, conditions, body_potential=lambda _, y: 7.0 * y)
        assert limit_load_factor(problem, ["crane"]) == pytest.approx(7.0, rel=1e-6)
        failed = solve(ContactProblem(mesh, STEEL, conditions, body_potential=lambda _, y: 0.99 * y))
        assert failed.status is Status.INFEASIBLE
        assert "off 'floor'" in failed.message

    @pytest.mark.parametrize("loads", [["tide"], [], "shear", ["shear", "bottom"], None, [3]])
    def test_unknown_loads(self, loads):
        with pytest.raises(InputError, match=r"loads.*(shear|pressure)"):
            limit_load_factor(dragged(MESHES["uniform"], 10.0, 1.0, Contact("bottom", 0.3)), loads)

    def test_loads_out_of_balance(self):
        """Refused before any program is solved: a body in the air, pushed from one side."""
        conditions = [Traction(side, 0.0, 0.0) for side in ("bottom", "left", "right")]
        problem = ContactProblem(MESHES["uniform"], STEEL, [*conditions, Traction("top", 0.0, -1.0)])
        with pytest.raises(InputError, match="out of balance"):
            limit_load_factor(problem, ["top"])
        with pytest.raises(InputError, match="out of balance"):
            solve(problem)


class TestAnswer:
    """The bound and violation that come with a factor."""

    def test_bound(self):
        limit = limit_load(dragged(MESHES["fine"], 10.0, 2.0, Contact("bottom", 0.3)), ["shear"])
        assert limit <= limit.bound * (1.0 + 1e-9)
        assert limit.bound == pytest.approx(1.5, rel=1e-7)
        assert limit.violation < 1e-9

    def test_gap_material_and_offset_do_not_enter(self):
        here, there = Contact("bottom", 0.3), Contact("bottom", 0.3, gap=0.1, offset=-0.2)
        soft = Material(1.0, 0.49, "strain")
        first = limit_load_factor(dragged(MESHES["graded"], 10.0, 2.0, here), ["shear"])
        second = limit_load_factor(dragged(MESHES["graded"], 10.0, 2.0, there, soft), ["shear"])
        assert first == pytest.approx(second, rel=1e-9)

    def test_friction_that_varies(self):
        """Pure shear with μ(x): the pressure may move, μ may not; the least favourable mean bounds it from below."""
        mu = Contact("bottom", lambda x, _: 0.2 + 0.1 * x)
        factor = limit_load_factor(dragged(MESHES["fine"], 10.0, 1.0, mu), ["shear"])
        assert 2.0 <= factor <= 4.0

    def test_solved_states_lie_below(self):
        """A solution's own load has a factor of at least one."""
        problem, _ = stick_slip_block((4, 3))
        assert limit_load_factor(problem, ["top", "left"]) >= 1.0


def test_limit_and_solve_mean_the_same_problem_where_corners_carry_no_shear():
    """Nearly smooth ends: the shear of the sides is met in the resultants by both."""

    def friction(x, y):
        return np.where(np.abs(x - 1.0) > 0.75, 1e-3, 0.3) + 0 * y

    def dragged(shear):
        mesh = RectilinearMesh.rectangle((8, 4), 2.0, 1.0)
        sides = [Traction("left", x=0.0, y=-shear, name="drag"), Traction("right", x=0.0, y=shear, name="drag")]
        top = [Traction("top", y=-100.0, name="weight"), Traction("top", x=shear, name="drag")]
        return ContactProblem(mesh, Material(1e3, 0.3), [Contact("bottom", friction, name="base"), *top, *sides])

    factor = limit_load_factor(dragged(1.0), ["drag"])
    assert solve(dragged(0.6 * factor)).status is Status.SOLVED
    assert solve(dragged(0.75 * factor)).status is not Status.INFEASIBLE  # although the corners alone carry nothing
    assert solve(dragged(1.001 * factor)).status is Status.INFEASIBLE


def test_the_linear_program_gets_what_is_left(monkeypatch):
    """300 seconds at most, less with a limit; that there was too little time is not taken for a load."""
    given = []

    def too_slow(*_, options, **__):
        given.append(options["time_limit"])
        return SimpleNamespace(status=1)

    monkeypatch.setattr(optimize, "linprog", too_slow)
    problem = dragged(RectilinearMesh.rectangle((2, 2)), 10.0, 1.0, Contact("bottom", 0.5))
    for seconds in (None, 20.0):
        with pytest.raises(SolveError, match="time limit"):
            limit_load_factor(problem, ["shear"], time_limit=seconds)
    assert given[0] == 300.0
    assert 0.0 < given[1] <= 20.0


@pytest.mark.parametrize("status", [4, 1])
def test_large_programs_take_the_interior_point_method_first(status, monkeypatch):
    """With the simplex method behind it, also where the first one cycles; both find the same bound."""
    problem = masonry_wall(3, 3, ())
    expected, given, true_linprog = limit_load(problem, ["wind"]), [], optimize.linprog

    def recorded(*arguments, method, **program):
        given.append(method)
        assert ("maxiter" in program["options"]) == (method == "highs-ipm")
        if method == "highs-ipm" and len(given) > 1:
            return SimpleNamespace(status=status)
        return true_linprog(*arguments, method=method, **program)

    monkeypatch.setattr(optimize, "linprog", recorded)
    monkeypatch.setattr(linear_program, "_LARGE", 10)
    found = limit_load(problem, ["wind"])
    assert given[0] == "highs-ipm"
    assert "highs" in given
    assert (found.lower, found.upper) == pytest.approx((expected.lower, expected.upper), rel=1e-9)


@pytest.mark.parametrize("coarse", [0, 2])
def test_where_no_vertex_is_found_less_accuracy_is_asked_for(coarse, monkeypatch):
    """Its solutions count, which are checked; that there is none it may not say."""
    problem = masonry_wall(3, 3, ())
    expected, given, true_linprog = limit_load(problem, ["wind"]), [], optimize.linprog

    def recorded(*arguments, method, options, **program):
        given.append(method)
        tolerance = options["primal_feasibility_tolerance"]
        if method == "highs-ipm" and (tolerance < 1e-8 or coarse):
            return SimpleNamespace(status=4 if tolerance < 1e-8 else coarse)
        return true_linprog(*arguments, method=method, options=options, **program)

    monkeypatch.setattr(optimize, "linprog", recorded)
    monkeypatch.setattr(linear_program, "_LARGE", 10)
    found = limit_load(problem, ["wind"])
    assert given[:2] == ["highs-ipm", "highs-ipm"]
    assert ("highs" in given) == bool(coarse)
    assert found.violation < 1e-7
    assert (found.lower, found.upper, found.bound) == pytest.approx(
        (expected.lower, expected.upper, expected.bound), rel=1e-6
    )


def _carried_by_rigid_blocks(friction, loads, named, heights):
    """Largest factor on the named loads: resultants (N at both ends, T) of each joint of a column of rigid blocks.

    `loads`: name → (force x, force y, application x, y); joint i at height heights[i] carries all loads above it.
    """
    count = len(heights)
    rows, dead = [], []
    for i, height in enumerate(heights):
        above = {name: load for name, load in loads.items() if load[3] > height}
        total = {True: np.zeros(3), False: np.zeros(3)}
        for name, (fx, fy, x, y) in above.items():
            total[name in named] += np.array([fx, fy, (x - 0.5) * fy - (y - height) * fx])
        forces = np.zeros((3, 3 * count + 1))  # of the joint on what is above: N at x = 0 and 1, upwards, and T
        forces[:, 3 * i : 3 * i + 3] = [[0.0, 0.0, 1.0], [1.0, 1.0, 0.0], [-0.5, 0.5, 0.0]]
        forces[:, -1] = total[True]
        rows.append(forces)
        dead.append(-total[False])
    sliding = np.zeros((2 * count, 3 * count + 1))
    for i in range(count):
        sliding[2 * i : 2 * i + 2, 3 * i : 3 * i + 3] = [[-friction, -friction, 1.0], [-friction, -friction, -1.0]]
    ends = [(0.0, None), (0.0, None), (None, None)] * count + [(None, None)]
    answer = optimize.linprog(
        np.append(np.zeros(3 * count), -1.0), A_ub=sliding, b_ub=np.zeros(2 * count), A_eq=np.concatenate(rows),
        b_eq=np.concatenate(dead), bounds=ends,
    )  # fmt: skip
    return {0: answer.x[-1] if answer.status == 0 else None, 2: -np.inf, 3: np.inf}[answer.status]


@pytest.mark.parametrize("seed", range(12))
def test_several_named_loads_of_a_column_against_its_resultants(seed):
    """Loads of different sizes, some of which cancel in part: what blocks of a column carry by statics alone."""
    rng = np.random.default_rng(seed)
    heights, friction = [0.0, 1.0], float(rng.uniform(0.1, 0.8))
    mesh = RectilinearMesh([0.0, 1.0], [0.0, 1.0, 2.0])
    for side, level in product(("left", "right"), (0, 1)):
        mesh = mesh.with_edges(f"{side} {level}", side, level, level + 1.0)
    mesh = mesh.with_joint("joint", "horizontal", 1.0)
    forces = {"top": (rng.uniform(-3.0, 3.0), -10.0, 0.5, 2.0)}
    for level in (0, 1):
        push = rng.uniform(-4.0, 4.0)
        forces[f"left {level}"] = (push, 0.0, 0.0, level + 0.5)
        forces[f"right {level}"] = (-push * rng.choice([0.5, 1.0, 0.9]), 0.0, 1.0, level + 0.5)
    conditions = [Traction(name, x=fx, y=fy) for name, (fx, fy, _, _) in forces.items()]
    problem = ContactProblem(mesh, STEEL, [Contact("bottom", friction), Contact("joint", friction), *conditions])
    named = [name for name in forces if name != "top"][: 2 + seed % 3]
    limit = limit_load_factor(problem, named)
    assert limit.upper == pytest.approx(_carried_by_rigid_blocks(friction, forces, named, heights), rel=1e-8)
    assert limit.lower <= limit.upper * (1.0 + 1e-7)
