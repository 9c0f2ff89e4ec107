"""Remarks on a result: warnings about data, about uniqueness and accuracy, and about motions nothing determines."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.schema import WithFields
from qvi_contact.discretization.loads import joined
from qvi_contact.mechanism.bodies import Bodies
from qvi_contact.mechanism.mechanism import Rigid, null_space
from qvi_contact.mesh.edges import closes
from qvi_contact.problem.conditions import DRIVES, Displacement, RigidPlate, Symmetry, has_coulomb
from qvi_contact.problem.problem import ContactProblem, with_contacts
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.stress import stress_in_cells
from solvers import Status
from solvers.factorisation.base import FactorisationError
from solvers.inner.linear_program import solved

if TYPE_CHECKING:
    from qvi_contact.solution.result import ContactResult

_MISFIT: Final = 1e-6  # misfit of prescribed tractions over the unit of stress, above which a remark is made
_STOPPED: Final = 1e-3  # motion of a plate beyond a support over the unit of displacement, above which it is named
_FAR: Final = 1e4  # gaps over displacements, above which rounding of gaps explains an inaccurate result
_LARGE_STRAIN: Final = 0.05  # strain or rotation [rad] above which the theory of small displacements is a first guess
_LARGE_FRICTION: Final = 1.0  # friction from which on a remark is made, as several solutions are known
_EXCESS: Final = 1e-2  # excess of friction between points over the contact's largest traction, allowed without remark
_EDGES_IN_CONTACT: Final = 4  # least number of edges that resolve a contact zone on an arc
_FLAT: Final = 1e-6  # distance of gaps from a linear function over the largest, above which an obstacle is curved
_YIELDS: Final = 1e-6  # excess of the strength over the unit of stress, above which the body yields


def remarks(result: ContactResult) -> tuple[str, ...]:
    """Sentences about approximated data, the solution's attempts, and the computed state, if there is one."""
    sentences = [*result.discretization.remarks, *result.solution.remarks, *_turning_plates(result)]
    if result.has_state:
        sentences += [*_about_numbers(result), *_about_contacts(result), *stopped_plates(result)]
    return tuple(sentences)


def _turning_plates(result: ContactResult) -> Iterator[str]:
    """Sentences about plates and inner blocks under a moment that may slip round, where the solve has failed."""
    if result.status is not Status.SOLVED and not result.status.impossible:
        for contact, rows in zip(result.problem.contacts, result.discretization.contacts, strict=True):
            turns = np.ptp(rows.points.normals, axis=0).max() > _MOVES  # on a straight line pressure carries the moment
            driven = turns and contact.plate is not None and contact.plate.moment is not None
            inside = contact in result.problem.joints and closes(result.problem.mesh.edges(contact.edges))
            if (driven or inside) and has_coulomb(contact):
                yield (
                    f"{'The block inside' if inside else 'The plate or pin at'} {contact.name!r} may slip round under "
                    "its moment. This is not proved, as equilibrium alone would allow a larger pressure, and with it "
                    "more friction. Give a rotation or displacements in place of the moment: the resulting moment is "
                    "then the one that friction carries."
                )


def stopped_plates(result: ContactResult) -> Iterator[str]:
    """Sentences about driven plates that move farther on this mesh than a support in a corner allows on any."""
    problem = result.problem
    motions = {row.contact: result.plates[row.contact] for row in result.discretization.plates.rows}
    if not (motions and problem.prescribed(Displacement)):
        return
    plates = {name: RigidPlate(x=m.x, y=m.y, rotation=m.rotation, pivot=m.centre) for name, m in motions.items()}
    moved = with_contacts(problem, lambda each: replace(each, plate=plates.get(each.name, each.plate)))
    for place, name, excess in result.discretization.corners_that_jump(moved, _STOPPED):
        if name in motions:
            yield (
                f"At {place} a support stops the plate of {name!r}, which moves {excess:.3g} [length] too far. On "
                "finer meshes its motion falls very slowly to what the support allows. Do not rely on this motion, nor "
                "on the force that the support takes. Leave a free side between plate and support."
            )


def _about_numbers(result: ContactResult) -> Iterator[str]:
    """Sentences about accuracy and uniqueness: misfit, large strains or turns, several solutions, digits lost."""
    scales, certified, qvi = result.discretization.scales, result.certificate.scales, result.solution.problem
    if result.traction_misfit > _MISFIT * scales.stress:
        yield (
            f"Computed tractions differ from the prescribed ones by up to {result.traction_misfit:.3g} [stress] at "
            "single points. Force and moment on every edge are right. To reduce the difference, let an edge end where "
            "the tractions jump or bend, or refine there."
        )
    t, weight = (each[:1] for each in result.discretization.space.cell_quadrature)  # at one point of each triangle
    stress = scales.stress * stress_in_cells(result.discretization, result.dofs, t=t)[1].swapaxes(1, 2)
    strains = np.abs(result.problem.compliances @ stress).max(axis=(1, 2))
    order, areas = np.argsort(strains), result.discretization.space.cell_measures(t, weight)[:, 0]
    share = np.cumsum(areas[order])  # the median by area: small triangles in corners count little
    strain = float(strains[order[np.searchsorted(share, share[-1] / 2.0)]])
    if strain > _LARGE_STRAIN:
        yield (
            f"Half of the body has strains above {strain:.2g}. Strains and displacements are taken to be small: "
            "this answer is a first guess. If you expected less, check the units of moduli, loads and lengths."
        )
    for contact, rows in zip(result.problem.contacts, result.discretization.contacts, strict=True):
        turn = abs(result.plates[rows.name].rotation) if rows.name in result.plates else 0.0
        if turn > _LARGE_STRAIN and np.ptp(rows.points.normals, axis=0).max() <= _MOVES:  # a pin may turn in its bore
            tips = "" if contact.plate is None or contact.plate.moment is None else ", and the body may tip over"
            yield (
                f"The plate of {rows.name!r} turns by {turn:.2g} rad. Rotations are taken to be small: this answer is "
                f"a first guess{tips}."
            )
    friction = float(qvi.mu[qvi.law.moving].max(initial=0.0))
    large = friction >= _LARGE_FRICTION and result.status is Status.SOLVED and not result.solution.remarks
    unique = False  # friction below the bound that proves uniqueness, on usual meshes 0.01 to 0.1
    with suppress(FactorisationError, ValueError):  # dense algebra raises ValueError after an overflow
        unique = large and result.solution.uniqueness.satisfied
    if large and not unique:
        yield (
            f"Friction is {friction:.3g}. From {_LARGE_FRICTION:g} on the discrete problem may have several solutions. "
            "This is one of them. To look for others, call other_solutions(result) in Python."
        )
    yield from (motion.remark for motion in undetermined_motions(result))
    largest = largest_counted(result)
    if largest is not None:
        yield (
            f"The contacts carry at most {scales.stress * largest:.2g} [stress], very little compared with the stress "
            "in the body. No digit of these tractions is reliable. To compute them, leave out the loads that strain "
            "the body elsewhere."
        )
    unit = certified.get("displacement", 0.0)
    gaps = {rows.name: float(np.abs(rows.gap).max(initial=0.0)) for rows in result.discretization.contacts}
    name = max(gaps, key=gaps.__getitem__, default="")
    if result.status is Status.INACCURATE and unit and gaps[name] > _FAR * unit:
        accuracy = result.certificate.accuracy
        yield (
            f"On {name!r} gaps are up to {gaps[name] / unit:.0e} times the displacements of the body. Rounding of the "
            f"gaps limits the accuracy, here to {accuracy:.1e}. Ask for a tolerance of "
            f"{10.0 ** np.ceil(np.log10(2.0 * accuracy)):.0e}, or state the problem with a smaller clearance or gap."
        )


def _about_contacts(result: ContactResult) -> Iterator[str]:
    """Sentences about stresses above the strength, and contacts for which the mesh is too coarse."""
    problem, scales = result.problem, result.discretization.scales
    if problem.yields:
        from qvi_contact.limit.stresses import excess  # loaded only for bodies that yield

        x, y, stress = result.gauss_stress()
        above = excess(problem, x, y, stress)
        least, largest = _YIELDS * scales.stress, float(above.max())
        if largest > least:
            at = np.unravel_index(int(np.argmax(above)), above.shape)
            share = 100.0 * float((above.max(axis=1) > least).mean())
            yield (
                f"The elastic stress exceeds the strength of the material by up to {largest:.3g} [stress], most around "
                f"({x[at]:.6g}, {y[at]:.6g}), and in {share:.0f} % of the triangles. There the body yields, which is "
                "not computed. limit_load_factor, or 'qvi-contact limit', finds the largest load that it carries."
            )
    mirrors = [problem.mesh.edges(each.edges) for each in problem.conditions if isinstance(each, Symmetry)]
    mirrored = [vertex for each in mirrors for vertex in (*each.first, *each.second)]
    for rows in result.discretization.contacts:
        line, edges = result.contacts[rows.name], rows.points.edges
        touches = (line.state != ContactState.OPEN).reshape(len(edges), -1)
        plane = np.column_stack([np.ones(len(line.x)), line.x, line.y])
        off_plane = np.abs(rows.gap - plane @ np.linalg.lstsq(plane, rows.gap, rcond=None)[0]).max(initial=0.0)
        in_contact = edges.take(touches.any(axis=1) & (edges.bent | (off_plane > _FLAT * np.abs(rows.gap).max())))
        is_mirrored = np.isin([in_contact.first, in_contact.second], mirrored).any()
        count = len(in_contact) * (2 if is_mirrored else 1)  # with the mirrored half
        if not touches.all() and 0 < count < _EDGES_IN_CONTACT:
            x, y = (part[touches.ravel()].mean() for part in (line.x, line.y))
            yield (
                f"Contact {rows.name!r} touches around ({x:.6g}, {y:.6g}) on fewer than {_EDGES_IN_CONTACT} edges "
                f"({count}). The pressure there is not resolved. Refine the mesh there until "
                f"{_EDGES_IN_CONTACT} edges or more touch, as by graded([(x, y)], 2)."
            )
    for name, line in result.contacts.items():
        largest = float(np.hypot(line.normal_stress, line.tangential_stress).max(initial=0.0))
        beyond = line.excess_between_points
        if beyond > max(_EXCESS * largest, line.rounding.stress):
            yield (
                f"On {name!r} friction exceeds its bound between the points of an edge, by up to {beyond:.3g} "
                f"[stress]: {100.0 * beyond / largest:.1f} % of the largest traction. Refine the mesh there."
            )


# Rigid motions that nothing determines: of bodies held by contacts only, and of plates driven by force.
#
# Two displacement fields with the stresses of a result differ by rigid motions v of the bodies between joints, and of
# the plates in their components driven by force. Both fields obey supports and contact laws if d·v = 0 for every
# prescribed component d·u, and along the contacts, with the jump [v] as in `mechanism.bodies`,
#
#     M(v) = ∫_{closed} −σ_N' [v]_N² ds + ∫ (b − |σ_T|) [v]_T² ds = 0.
#
# Points under pressure stay closed. Points with shear below its bound b do not slip. Points at their bound may move.
# Stresses and forces are the same for all v with M(v) = 0. Gaps and slips differ if [v] ≠ 0 somewhere. Then the motion
# is undetermined, unless contacts that touch without pressure prevent it in both directions.

_HELD: Final = 1e-12  # M(v) over (largest pressure × length of all contacts), up to which v counts as free
_SLACK: Final = 1e-6  # b − |σ_T| over the certificate's unit of stress, up to which |σ_T| counts as at its bound
_MOVES: Final = 1e-6  # displacement over the size of a motion, up to which it is rounding
_COUNTED: Final = 1e-6  # tractions over the certificate's unit of stress, below which they are not certified by it
_NOTHING: Final = 1e-9  # the same, below which tractions are zero up to rounding


@dataclass(frozen=True)
class UndeterminedMotion(WithFields):
    """Rigid motions that several bodies have in common and nothing determines."""

    names: tuple[str, ...]
    """Names of the bodies: that of the region with the same cells, or the place of the body."""
    motions: int
    """Number of independent motions, 1 to 3."""
    way: str
    """The motions in words, such as "turn about (0, 0)"."""
    plate: bool = False
    """Whether a rigid plate or pin is among them."""

    @property
    def remark(self) -> str:
        """Sentences for the user: what the motion means, and what determines it."""
        what = " and ".join(self.names)
        together = "which together" if len(self.names) > 1 else "which"
        instead = " For a plate or pin, you can give the motion instead of the force." if self.plate else ""
        return (
            f"Nothing determines the position of {what}, {together} can {self.way}. Stresses and forces do not depend "
            "on it. Those of later steps of a history may: each step takes the position nearest to that of the step "
            "before. Gaps and slips belong to one of the possible positions. "
            f"To determine it, add a support, friction, or a load that closes a contact.{instead}"
        )


def undetermined_motions(result: ContactResult) -> tuple[UndeterminedMotion, ...]:
    """The rigid motions of bodies and driven plates that neither supports nor contacts determine.

    Gaps and slips on their contacts hold for one of the possible positions. The list is also empty without a certified
    state, and where contact tractions are too small to tell which points are closed.
    """
    if result.status is not Status.SOLVED or largest_counted(result) is not None:
        return ()
    free = free_motions(result)
    if free is None:
        return ()
    bodies = free.bodies
    motions, (G, h) = free.motions, free.limits
    closed = G[h <= _MOVES * result.certificate.scales.get("displacement", 0.0)]
    # max Σ t  s.t.  G y + t ≤ 0, 0 ≤ t ≤ 1: a row with t = 0 in the answer is zero for all motions G y ≤ 0
    if len(closed):
        (r, d), closed = closed.shape, closed / np.abs(closed).max(axis=1)[:, None]
        cost, bounds = np.repeat([0.0, -1.0], [d, r]), [(None, None)] * d + [(0.0, 1.0)] * r
        answer = solved(cost, A_ub=np.column_stack([closed, np.eye(r)]), b_ub=np.zeros(r), bounds=bounds)
        if answer.solved:
            motions = motions @ null_space(closed[answer.x[d:] < 0.5], _MOVES)
    at = bodies.centre[0] + bodies.size[0] * np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]])
    directions = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    velocities = [bodies.rows(np.full(3, body), at, directions) @ motions for body in range(len(bodies))]
    moving = [body for body, each in enumerate(velocities) if np.abs(each).max(initial=0.0) > _MOVES]
    undetermined = []
    while moving:  # bodies with the same motion are listed together
        first, least = moving[0], _MOVES * np.abs(velocities[moving[0]]).max()
        same = [body for body in moving if np.abs(velocities[body] - velocities[first]).max() <= least]
        moving = [body for body in moving if body not in same]
        of_body, names = motions[3 * first : 3 * first + 3], tuple(_name(result.problem, bodies, body) for body in same)
        count, words = int(np.linalg.matrix_rank(of_body, tol=_MOVES)), motions_in_words(of_body, bodies, first)
        undetermined.append(UndeterminedMotion(names, count, words, max(same) >= bodies.blocks))
    return tuple(undetermined)


def largest_counted(result: ContactResult) -> float | None:
    """The largest contact traction, if it is too small against the stress in the body to be certified; else None."""
    qvi, z, stress = result.solution.problem, result.solution.z, result.certificate.scales.get("stress", 0.0)
    largest = float(np.abs(qvi.tractions(z)).max(initial=0.0))
    return largest if _NOTHING * stress < largest < _COUNTED * stress else None


class FreeMotions(NamedTuple):
    """Rigid motions that change gaps or slips only; of bodies that move together the largest one is kept at rest."""

    bodies: Bodies
    motions: FloatArray  # (3 k, d): d motions as columns, in the unit of displacement
    speeds: FloatArray  # (2, m, d): [v]_N and [v]_T at the points of all contacts that are not tied
    changes: FloatArray  # (2, m, d): changes of the multipliers m_N and m_T
    # G (r, d) and h (r,) ≥ 0: multipliers over W keep their signs under the motions y (d,) with G y ≤ h
    limits: tuple[FloatArray, FloatArray]


def free_motions(result: ContactResult) -> FreeMotions | None:
    """The free motions of a solved result; None if supports hold all bodies."""
    problem, mesh, solution = result.problem, result.problem.mesh, result.solution

    def by_supports() -> FloatArray:  # without friction on bilateral contacts, which M(v) accounts for
        smooth = with_contacts(problem, lambda c: replace(c, friction=0.0) if c.law == "bilateral" else c)
        return Rigid(smooth).free

    # all motions that supports, plates, and contacts that cannot open or slip allow; they depend on these data only
    lines = [(each.law, mesh.numbers(each.edges).tobytes()) for each in problem.contacts]
    plates = [
        (each.name, each.plate.pivot, *(getattr(each.plate, name) is None for name in DRIVES))
        for each in problem.contacts if each.plate is not None
    ]  # fmt: skip
    supports = [(each.name, each.edges.number.tobytes()) for each in problem.prescribed(Displacement)]
    free = mesh.kept(np.ndarray, ("free", *lines, *plates, *supports), by_supports)  # kept for all steps of a history
    if not free.shape[1]:
        return None
    bodies = Bodies.of(problem)
    discretization, qvi, size = result.discretization, solution.problem, result.certificate.scales.get("stress", 1.0)
    unit, rule = size * discretization.scales.stress, discretization.rule
    # [v] at the points of contacts, and the weights of M(v)
    jumps, resistance, weights = [np.zeros((2, 0, 3 * len(bodies)))], [np.zeros((2, 0))], list[FloatArray]()
    for contact, contact_rows in zip(problem.contacts, discretization.contacts, strict=True):
        if contact.law == "tied":  # already in the motions allowed above
            continue
        line, points, edges = result.contacts[contact.name], contact_rows.points, contact_rows.points.edges
        places, pair = np.column_stack([line.x, line.y]), bodies.beside(edges, contact)
        first, second = (np.repeat(body, points.count) for body in pair)
        axes = (points.normals, points.tangents)
        jumps.append(np.stack([bodies.rows(first, places, d) - bodies.rows(second, places, d) for d in axes]))
        slack = line.friction_bound - np.abs(line.tangential_stress)
        # on an edge that sticks in part every point may have slipped, while its shear is below the bound
        sticks = (line.state == ContactState.STICK) | (slack > _SLACK * unit)
        presses = np.where(line.state == ContactState.OPEN, 0.0, -line.effective_normal_stress)
        resistance.append(line.weights * np.maximum([presses, np.where(sticks, slack, 0.0)], 0.0))
        weights.append(points.weights)
    rows = np.concatenate(jumps, axis=1).reshape(2 * qvi.m, 3 * len(bodies))
    length = sum(float(line.weights.sum()) for line in result.contacts.values())
    M_root = sparse.csr_array(np.sqrt(np.concatenate(resistance, axis=1).ravel() / (unit * length))[:, None] * rows)
    # the motions with M(v) = 0; if touching bodies move together without [v], the largest of them is kept at rest
    M, motions = np.linalg.eigh(free.T @ (M_root.T @ M_root).toarray() @ free)
    free = free @ motions[:, M <= _HELD]
    common = _still(free, rows)
    for body in np.argsort(-bodies.size, kind="stable").tolist():
        of_body = np.eye(3 * len(bodies))[3 * body : 3 * body + 3]
        if np.abs(of_body @ common).max(initial=0.0) > _MOVES:
            free, common = _still(free, of_body), _still(common, of_body)
    # changes of the multipliers of rows, by the works of the motions, and the limits of their signs
    d = free.shape[1]
    speeds, by_edges = (rows @ free).reshape(2, qvi.m, d), (2, qvi.m // rule.count, rule.count, d)
    works = (joined(weights)[:, None] * speeds).reshape(by_edges)
    changes = -np.einsum("aeqd,qr->aerd", works, rule.to_points).reshape(speeds.shape)
    slips = np.sign(qvi.tangential(solution.z)) * (qvi.threshold(qvi.pressure(solution.z)) > _SLACK * size)
    signs = np.stack([~qvi.bilateral, slips]) / qvi.W
    G = (-signs[:, :, None] * changes).reshape(2 * qvi.m, d)
    h = (signs * (solution.normal_multiplier, solution.tangential_multiplier)).ravel()
    limited = np.abs(G).max(axis=1, initial=0.0) > _MOVES
    return FreeMotions(bodies, free, speeds, changes, (G[limited], np.maximum(h[limited], 0.0)))


def _still(motions: FloatArray, rows: FloatArray) -> FloatArray:
    """Orthonormal motions that span the part of `motions` (n, d) on which rows (m, n) are zero up to rounding."""
    return np.asarray(motions @ null_space(rows @ motions, _MOVES))


def motions_in_words(motions: FloatArray, bodies: Bodies, body: int) -> str:
    """The motions (3, d) of a body in words; the rows are translations of its centre, and rotation times its size."""
    basis, values, _ = np.linalg.svd(motions, full_matrices=False)
    basis = basis[:, values > _MOVES]
    moves = _still(basis, np.array([[0.0, 0.0, 1.0]]))
    if not moves.shape[1]:
        x, y, turn = basis[:, 0]
        arm = bodies.size[body] / turn * np.array([-y, x])
        return f"turn about {_pair(bodies.centre[body] + arm, float(bodies.size[body]))}"
    along = moves[:2, 0] / np.hypot(*moves[:2, 0])
    along = np.where(np.abs(along) > _MOVES, along, 0.0)
    along = -along if tuple(along) < (0.0, 0.0) else along  # points to the right, or upwards
    way = "move" if moves.shape[1] > 1 else f"move along {_pair(along)}"
    return f"turn and {way}" if basis.shape[1] > moves.shape[1] else way


def _pair(at: FloatArray, size: float = 1.0) -> str:
    x, y = np.where(np.abs(at) > _MOVES * size, at, 0.0).tolist()
    return f"({x:.4g}, {y:.4g})"


def _name(problem: ContactProblem, bodies: Bodies, body: int) -> str:
    """The name of a body: the region with the same cells, or the body's place; for a plate its contact."""
    if body >= bodies.blocks:
        return f"the plate at {bodies.plates[body - bodies.blocks]!r}"
    mesh, cells = problem.mesh, np.flatnonzero(bodies.of_cells == body)
    if bodies.blocks == 1:
        return "the body"
    named = [*mesh.regions.items(), *((region.name, region.cells(mesh)) for region in problem.regions)]
    for name, chosen in named:
        if name is not None and np.array_equal(chosen, cells):
            return f"the body {name!r}"
    centres = mesh.vertices[mesh.cells[cells]].mean(axis=1)
    distance = np.hypot(*(centres - centres.mean(axis=0)).T)
    return f"the body around {_pair(centres[int(np.argmin(distance))], mesh.length)}"
