"""The problems of the study: how they are meshed, what is known about their answers, and which orders to expect."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

import numpy as np

from comparisons.convergence.mesh.corner import exponent
from comparisons.convergence.mesh.tractions import Field, quadrature
from comparisons.settled import SETTLED, UNCERTAINTY
from comparisons.verification.chapters.ssnv128 import TANGENTIAL_FORCE
from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Symmetry, Traction
from qvi_contact.basics.checks import FloatArray
from qvi_contact.exact import ExactState
from qvi_contact.gallery import compressed_plate, ssnv128, stick_slip_block
from qvi_contact.problem.conditions import Condition

FORCE, ENERGY, TRACTIONS = "force", "energy", "tractions"
"""What all problems are measured by; each may have ends of zones besides."""

_PUSH: Final = 1e-3
_STICKING: Final = 0.25  # from here on the plate sticks everywhere
_PLATE: Final = "GetFEM and NGSolve, agreeing"
_WIDTH, _HEIGHT, _RADIUS = 4.0, 2.0, 800.0  # of the punch [mm]
_BLOCK: Final[dict[str, Any]] = {"transition": 1.0, "slip": 0.02, "pressure_drop": 40.0}


@dataclass(frozen=True)
class Known:
    """A value known from elsewhere: `uncertainty` ≥ 0 in its own unit, 0 for closed forms."""

    value: float
    uncertainty: float
    source: str


@dataclass(frozen=True)
class Expected:
    """Order in h to expect on uniform meshes, and why."""

    order: float
    reason: str


@dataclass(frozen=True)
class Problem:
    """A problem of the study.

    Attributes
    ----------
    name, title : word for tables and options, words for headings
    contact : name of its contact, which is horizontal
    force : "normal_force" or "tangential_force", the one that is not given by balance alone
    units : of stress and length
    uniform : number of cells along the contact → the problem on equal cells
    lines : number of cells along the contact → grid lines x, y of cells that shrink towards the places where stresses
        are singular; None if there are none
    start : cells along the contact where adaptive meshes start
    known : force, energy (−J*, the complementary energy with the sign of the potential energy) or the kind of a zone's
        end → value
    tractions : exact ones on the contact, if they are known
    expected : force, energy, tractions → order

    """

    name: str
    title: str
    contact: str
    force: str
    units: tuple[str, str]
    uniform: Callable[[int], ContactProblem]
    lines: Callable[[int], tuple[FloatArray, FloatArray]] | None
    start: int = 4
    known: Mapping[str, Known] = field(default_factory=dict)
    tractions: Field | None = None
    expected: Mapping[str, Expected] = field(default_factory=dict)

    def graded(self, cells: int) -> ContactProblem:
        """The problem on `lines`."""
        assert self.lines is not None
        return self.uniform(2).on_lines(*self.lines(cells))


def towards(start: float, stop: float, cells: int, power: float) -> FloatArray:
    """Grid lines (cells + 1,) with stop − x ~ (1 − i/cells)^power: cells shrink towards `stop`."""
    lines = stop - (stop - start) * (1.0 - np.arange(cells + 1) / cells) ** power
    return np.concatenate([[start], lines[1:-1], [stop]])


def _around(start: float, place: float, stop: float, cells: int, power: float) -> FloatArray:
    """Grid lines whose cells shrink towards a place in between, shared out by the lengths of the two sides."""
    left = min(max(round(cells * (place - start) / (stop - start)), cells // 4), cells - cells // 4)
    right = -towards(-stop, -place, cells - left, power)[::-1]
    return np.concatenate([towards(start, place, left, power), right[1:]])


def _towards_corner(cells: int) -> tuple[FloatArray, FloatArray]:
    lines = towards(0.0, 1.0, cells, 3.0)
    return lines, lines


def _square_lines(cells: int) -> tuple[FloatArray, FloatArray]:
    return _around(0.0, 3.28e-3, 0.04, cells, 2.0), 0.04 - towards(0.0, 0.04, cells, 2.0)[::-1]


def _punch_lines(end: float, cells: int) -> tuple[FloatArray, FloatArray]:
    return _around(0.0, end, _WIDTH, cells, 2.0), towards(0.0, _HEIGHT, cells // 2, 2.0)


def punch(friction: float, cells: int) -> ContactProblem:
    """Right half of a block on a smooth foundation, pressed by a rigid punch of parabolic shape.

    [0, 4] × [0, 2] mm, steel in plane strain, symmetry on x = 0 and y = 0, x = 4 mm free. The punch goes down by 1e-3
    mm and has the radius 800 mm: u_y ≤ −1e-3 + x²/1600 on the top.
    """

    def gap(x: FloatArray, y: FloatArray) -> FloatArray:
        return -_PUSH + x**2 / (2.0 * _RADIUS) + 0.0 * y

    mesh = RectilinearMesh.rectangle((cells, max(cells // 2, 1)), _WIDTH, _HEIGHT)
    contact = (
        Contact("top", friction=friction, gap=gap, name="punch")
        if friction
        else Contact.frictionless("top", gap=gap, name="punch")
    )
    sides: list[Condition] = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0)]
    return ContactProblem(mesh, Material(2.1e5, 0.3, "strain"), [*sides, contact])


def _block(cells: int) -> ContactProblem:
    """Odd numbers of cells: the change from stick to slip is never on a grid line."""
    return stick_slip_block((cells + 1 - cells % 2, max(cells // 2, 1)), **_BLOCK)[0]


def _exact_block() -> tuple[Mapping[str, Known], Field]:
    """Forces, energy and tractions of the block in closed form; integrals by quadrature of polynomials."""
    problem, state = stick_slip_block(**_BLOCK)

    def exact(s: FloatArray) -> tuple[FloatArray, FloatArray]:
        stress = state.stress(s, 0.0 * s)
        return np.asarray(stress[1]), np.asarray(-stress[2])

    places = np.array([0.0, _BLOCK["transition"], 2.0])
    s, weights = quadrature(places)
    _, tangential = exact(s)
    energy = _load(problem, state, places) - _strain(problem, state)
    forces = {"force": float((weights * tangential).sum()), "energy": energy, "stick ends": _BLOCK["transition"]}
    source = "closed form, gallery.stick_slip_block"
    return {name: Known(value, 0.0, source) for name, value in forces.items()}, exact


def _strain(problem: ContactProblem, state: ExactState) -> float:
    """½ ∫ cσ:σ over the block [0, 2] × [0, 1]."""
    (x, wx), (y, wy) = quadrature(np.array([0.0, 2.0])), quadrature(np.array([0.0, 1.0]))
    stress = state.stress(*np.meshgrid(x.ravel(), y.ravel(), indexing="ij"))
    density = np.einsum("iab,ij,jab->ab", stress, problem.material.compliance, stress)
    return float(0.5 * wx.ravel() @ density @ wy.ravel())


def _load(problem: ContactProblem, state: ExactState, places: FloatArray) -> float:
    """∫ U·σn over the right side and ∫ g σ_N + w σ_T over the base."""
    y, weights = quadrature(np.array([0.0, 1.0]))
    x = np.full_like(y, 2.0)
    (u, v), stress = state.displacement(x, y), state.stress(x, y)
    side = float((weights * (u * stress[0] + v * stress[2])).sum())
    s, weights = quadrature(places)
    zero, stress, (base,) = 0.0 * s, state.stress(s, 0.0 * s), problem.contacts
    gap, offset = (data(s, zero) if callable(data) else data + zero for data in (base.gap, base.offset))
    return side + float((weights * (gap * stress[1] - offset * stress[2])).sum())


_ROOT: Final = "pressure ~ √r where contact ends"
_ROOT_LIKE: Final = {FORCE: Expected(3.0, _ROOT), ENERGY: Expected(3.0, _ROOT), TRACTIONS: Expected(1.0, _ROOT)}
_SMOOTH: Final = {"tractions": Expected(2.0, "linear σ_N for a quadratic one")}


def _corner(friction: float) -> dict[str, Expected]:
    """Orders of the plate on equal cells, from the exponent λ of its free corner.

    Where the contact sticks, the squared error of the stresses, and with it energy and force, fall like h^2λ, the
    tractions in L² like h^(λ−½). Where it slips, Φ_xy of the corner node is zero and |σ_T| = μ|σ_N| beside it: the last
    edge misses friction ~ h^(λ−1) h in the work on a slip that is not zero there, which makes h^λ.
    """
    if friction == 0.0:
        return {}
    sticks = friction >= _STICKING
    power = exponent(0.3, None if sticks else friction)
    reason = f"Williams: σ ~ r^−{1.0 - power:.3f} at the free corner{'' if sticks else ', where friction is missed'}"
    work = Expected(2.0 * power if sticks else power, reason)
    return {"force": work, "energy": work, "tractions": Expected(power - 0.5, reason)}


def _plate(friction: float) -> Problem:
    what = {0.0: " (frictionless)", 1.0: " (sticks everywhere)"}.get(friction, "")
    return Problem(
        f"plate {friction:g}", f"The plate, μ = {friction:g}{what}", "plate", "normal_force", ("MPa", "length"),
        lambda cells: compressed_plate(friction, (cells, cells)), _towards_corner, known=_known_plate(friction),
        expected=_corner(friction),
    )  # fmt: skip


def _known_plate(friction: float) -> dict[str, Known]:
    if friction == 0.0:
        exact = "closed form, E U"
        return {"force": Known(209.0, 0.0, exact), "energy": Known(209.0 * _PUSH / 2.0, 0.0, exact)}
    force = Known(SETTLED[friction], UNCERTAINTY, _PLATE)
    if friction < 1.0:
        return {"force": force}
    half = _PUSH / 2.0  # nothing is lost in friction: J(u) = ½ P U
    return {"force": force, "energy": Known(half * force.value, half * force.uncertainty, f"½ P U; {_PLATE}")}


def _all() -> dict[str, Problem]:
    block, tractions = _exact_block()
    model = "biquadratic displacement elements with nodal contact"
    base = {
        "force": Known(TANGENTIAL_FORCE, 5.0, model),
        "contact begins": Known(3.28e-3, 1e-5, model),
        "stick begins": Known(2.984e-2, 1e-5, model),
    }
    found = [
        *map(_plate, (0.0, 0.05, 0.1, 0.15, 0.2, 1.0)),
        Problem("ssnv128", "SSNV128: opens, slips and sticks", "base", "tangential_force", ("Pa", "m"),
                lambda cells: ssnv128((cells, cells)), _square_lines, 8, base),
        Problem("punch smooth", "Parabolic punch, frictionless: closed and open", "punch", "normal_force",
                ("MPa", "mm"), partial(punch, 0.0), partial(_punch_lines, 0.985), 8, expected=_ROOT_LIKE),
        Problem("punch rough", "Parabolic punch, μ = 0.3: sticks, slips and opens", "punch", "normal_force",
                ("MPa", "mm"), partial(punch, 0.3), partial(_punch_lines, 0.97), 8),
        Problem("block", "Block with an exact solution: sticks and slips", "base", "tangential_force",
                ("MPa", "length"), _block, None, 4, block, tractions, _SMOOTH),
    ]  # fmt: skip
    return {problem.name: problem for problem in found}


PROBLEMS: Final = _all()
"""Name → problem."""
