"""Rigid motions that nothing determines: of bodies that contacts alone hold, and of plates driven by force.

Two displacement fields with the stresses of a result differ by a rigid motion v of each body between joints, and of
each plate in the components in which a force drives it. Both keep
supports and contact laws if d·v = 0 for every prescribed component d·u, and along the contacts, with [v] as in
`mechanism.lines`,

    M(v) = ∫_{closed} −σ_N' [v]_N² ds + ∫_{stick} (b − |σ_T|) [v]_T² ds = 0:

what presses stays closed, what sticks stays stuck; open points may move, and so may points that slip at their bound.
Stresses and forces are the same for all such v. Gaps and slips are not, if [v] ≠ 0 somewhere: then the motion is found.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.loads import EdgePoints
from qvi_contact.mechanism.bodies import Bodies
from qvi_contact.mechanism.program import Rigid, null_space
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import ContactLine, ContactState
from solvers import Status

if TYPE_CHECKING:
    from qvi_contact.solution.result import ContactResult

_HELD: Final = 1e-12  # M(v) over the largest pressure times the length of all contacts: above, something holds
_MOVES: Final = 1e-6  # share of a motion's size below which it is rounding: a point stands still, a body does not turn
_COUNTED: Final = 1e-6  # share of the certificate's unit of stress that tractions reach where it is theirs
_NOTHING: Final = 1e-9  # share of it below which they are none
_ALL: Final = 3  # rigid motions of a body in the plane


@dataclass(frozen=True)
class UndeterminedMotion:
    """Bodies that move as one, and how they can.

    Attributes
    ----------
    names : tuple of str
        What they are called: the name of the region with just these cells, or where they lie.
    motions : int
        Number of independent rigid motions, 1 to 3.
    way : str
        The motions in words, such as "turn about (0, 0)".
    plate : bool
        Whether a rigid plate or pin is among them.

    """

    names: tuple[str, ...]
    motions: int
    way: str
    plate: bool = False

    @property
    def remark(self) -> str:
        """What it means and what to do, as sentences."""
        what = " and ".join(self.names)
        together = "which together" if len(self.names) > 1 else "which"
        instead = " For a plate or pin, you can give the motion instead of the force." if self.plate else ""
        return (
            f"Nothing determines the position of {what}, {together} can {self.way}. Stresses and forces do not depend "
            "on it. Gaps and slips hold for one of the possible positions. To determine it, add a support, friction, "
            f"or a load that closes a contact.{instead}"
        )


def undetermined_motions(result: "ContactResult") -> tuple[UndeterminedMotion, ...]:
    """Bodies that contacts alone hold, and plates, whose place beside others or on an obstacle nothing determines.

    Gaps and slips on their contacts are those of one of the possible places. Without a certified state, or where
    contact tractions are too small to say what is closed, there is no answer, and none is listed.
    """
    if result.status is not Status.SOLVED or largest_counted(result) is not None:
        return ()
    rigid = Rigid(result.problem)
    motions = _undetermined(result, rigid)
    return tuple(_described(result.problem, rigid.bodies, motions)) if motions.shape[1] else ()


def largest_counted(result: "ContactResult") -> float | None:
    """The largest contact traction where it is too small beside the stress in the body to be certified on its own."""
    qvi, z, stress = result.solution.problem, result.solution.z, result.certificate.scales.get("stress", 0.0)
    largest = max(float(np.abs(part).max(initial=0.0)) for part in (qvi.normal(z), qvi.tangential(z)))
    return largest if _NOTHING * stress < largest < _COUNTED * stress else None


def _undetermined(result: "ContactResult", rigid: Rigid) -> FloatArray:
    """Columns (3 k, d) of motions that change gaps or slips and nothing else; of what moves together one body rests."""
    problem, bodies = result.problem, rigid.bodies
    if not rigid.free.shape[1] or not problem.contacts:
        return np.zeros((3 * len(bodies), 0))
    rows, holding = [], []
    for contact, known in zip(problem.contacts, result.discretization.contacts, strict=True):
        line = result.contacts[contact.name]
        relative = _relative(problem, bodies, contact, known.points)
        rows.append(relative.reshape(-1, 3 * len(bodies)))
        holding.append(np.ravel(line.weights * _resistance(contact, line)))
    speeds, weights = np.concatenate(rows), np.concatenate(holding)
    unit = result.certificate.scales.get("stress", 1.0) * result.discretization.scales.stress
    length = sum(float(line.weights.sum()) for line in result.contacts.values())
    held = np.sqrt(weights / (unit * length))[:, None] * speeds
    free = _still(rigid.free, held, float(np.sqrt(_HELD)))
    return _beside_others(bodies, free, speeds)


def _relative(problem: ContactProblem, bodies: Bodies, contact: Contact, points: EdgePoints) -> FloatArray:
    """Rows (2, m, 3 k) of [v]_N and [v]_T at the points of a contact."""
    edges, mesh = points.edges, problem.mesh
    x, y = mesh.points_along(edges, points.reference)
    places, first = np.column_stack([x.ravel(), y.ravel()]), bodies.of_cells[edges.cells[:, 0]]
    second = (
        bodies.of_cells[edges.cells[:, 1]] if contact in problem.joints else np.full(len(edges), bodies.number(contact))
    )
    pair = [np.repeat(body, points.count) for body in (first, second)]
    rows = [[bodies.rows(body, places, along) for body in pair] for along in (points.normals, points.tangents)]
    return np.stack([ours - theirs for ours, theirs in rows])


def _resistance(contact: Contact, line: ContactLine) -> FloatArray:
    """What holds the normal and the tangential motion at each point (2, m) [stress]; ties are equations, not here."""
    if contact.law == "tied":
        return np.zeros((2, len(line.x)))
    closed = np.where(line.state == ContactState.OPEN, 0.0, -line.effective_normal_stress)
    stuck = np.where(line.state == ContactState.STICK, line.friction_bound - np.abs(line.tangential_stress), 0.0)
    return np.asarray(np.maximum(np.stack([closed, stuck]), 0.0))


def _still(motions: FloatArray, rows: FloatArray, least: float) -> FloatArray:
    """The part of the space of orthonormal motions (n, d) on which rows (m, n) are nothing."""
    if not motions.shape[1]:
        return motions
    return np.asarray(motions @ null_space(rows @ motions, least))


def _beside_others(bodies: Bodies, free: FloatArray, speeds: FloatArray) -> FloatArray:
    """Motions without those that move all that touches together: of that the largest body rests."""
    together = _still(free, speeds, _MOVES)
    for body in np.argsort(-bodies.size, kind="stable").tolist():
        if not together.shape[1]:
            break
        own = np.zeros((_ALL, 3 * len(bodies)))
        own[:, 3 * body : 3 * body + _ALL] = np.eye(_ALL)
        if np.abs(own @ together).max() > _MOVES:
            free, together = _still(free, own, _MOVES), _still(together, own, _MOVES)
    return free


def _described(problem: ContactProblem, bodies: Bodies, motions: FloatArray) -> Iterator[UndeterminedMotion]:
    """The bodies that move, those with the same motions together."""
    waiting = {body: _about(bodies, body, motions) for body in range(len(bodies))}
    waiting = {body: moved for body, moved in waiting.items() if np.abs(moved).max() > _MOVES}
    while waiting:
        first, moved = next(iter(waiting.items()))
        alike = [body for body, other in waiting.items() if np.abs(other - moved).max() <= _MOVES * np.abs(moved).max()]
        names = tuple(_name(problem, bodies, body) for body in alike)
        waiting = {body: other for body, other in waiting.items() if body not in alike}
        own = motions[3 * first : 3 * first + _ALL]
        motions_of = int(np.linalg.matrix_rank(own, tol=_MOVES))
        yield UndeterminedMotion(names, motions_of, motions_in_words(own, bodies, first), max(alike) >= bodies.blocks)


def _about(bodies: Bodies, body: int, motions: FloatArray) -> FloatArray:
    """Motions (3, d) of a body as those of the first body's centre, and rotations over one length."""
    x, y, turn = motions[3 * body : 3 * body + _ALL]
    arm, turn = bodies.centre[0] - bodies.centre[body], turn / bodies.size[body]
    return np.stack([x - turn * arm[1], y + turn * arm[0], turn * bodies.size[0]])


def motions_in_words(own: FloatArray, bodies: Bodies, body: int) -> str:
    """The motions (3, d) of a body in words; rows are translations of its centre and rotation times its size."""
    basis, values, _ = np.linalg.svd(own, full_matrices=False)
    basis = basis[:, values > _MOVES]
    if basis.shape[1] == _ALL:
        return "move and turn"
    turning = np.abs(basis[2]).max() > _MOVES
    if not turning:
        return "move" if basis.shape[1] > 1 else f"move along {_pair(_upright(basis[:2, 0]))}"
    if basis.shape[1] > 1:
        x, y, _ = _still(basis, np.array([[0.0, 0.0, 1.0]]), _MOVES)[:, 0]
        return f"turn and move along {_pair(_upright(np.array([x, y])))}"
    x, y, turn = basis[:, 0]
    arm = bodies.size[body] / turn * np.array([-y, x])
    return f"turn about {_pair(bodies.centre[body] + arm, float(bodies.size[body]))}"


def _upright(direction: FloatArray) -> FloatArray:
    """The unit vector along a direction, to the right, or upwards."""
    unit = direction / np.hypot(*direction)
    unit = np.where(np.abs(unit) > _MOVES, unit, 0.0)
    return np.asarray(-unit if tuple(unit) < (0.0, 0.0) else unit)


def _pair(at: FloatArray, size: float = 1.0) -> str:
    x, y = np.where(np.abs(at) > _MOVES * size, at, 0.0).tolist()
    return f"({x:.4g}, {y:.4g})"


def _name(problem: ContactProblem, bodies: Bodies, body: int) -> str:
    """The region with just the cells of a body, or where the body lies; the contact of a plate."""
    if body >= bodies.blocks:
        return f"the plate at {bodies.plates[body - bodies.blocks]!r}"
    mesh, cells = problem.mesh, np.flatnonzero(bodies.of_cells == body)
    if bodies.blocks == 1:
        return "the body"
    for name in mesh.region_names:
        if np.array_equal(mesh.region(name), cells):
            return f"the body {name!r}"
    centres = mesh.vertices[mesh.cells[cells]].mean(axis=1)
    away = np.hypot(*(centres - centres.mean(axis=0)).T)
    return f"the body around {_pair(centres[int(np.argmin(away))], mesh.length)}"
