"""Proof files in rational numbers, checked by a script that uses nothing else of this package.

"Proof files" in `docs/theory.md` says which equations are solved exactly, and which inequalities hold with room.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import combinations
from operator import add
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, evaluate
from qvi_contact.basics.writing import write_text
from qvi_contact.element.edge import bernstein_from_values, legendre_basis, lobatto_points
from qvi_contact.element.triangle import EDGES
from qvi_contact.errors import InputError, SolveError, refuse_arguments
from qvi_contact.limit.check_proof import FORMAT, at_factor, check, dissipated, dot, edges, gradient, less, triangles
from qvi_contact.limit.check_proof import exponents as _exponents
from qvi_contact.limit.flow import FlowProgram, Velocities
from qvi_contact.limit.load_factor import OPTIONS, LimitProblem, checked_loads
from qvi_contact.limit.split import (
    ONE,
    ZERO,
    OutOfBalanceError,
    Row,
    Smooth,
    Terms,
    Vector,
    combined,
    lattice,
    middle,
    part_corners,
    solved,
)
from qvi_contact.limit.stresses import StressProgram
from qvi_contact.mechanism import RigidMotion, find_mechanism
from qvi_contact.mechanism.bodies import straight_groups
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import CARTESIAN, SHEAR_LAW, Contact, Traction
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.material import MohrCoulomb, Strength
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.progress import deadline

_KEPT_BACK: Final = 1e-6  # share of the way to a stress inside all limits, room for rounding
_KEPT_BACK_ABOVE: Final = 1e-9  # share of the way to a flow inside all limits, which may dissipate much more

_STRAIGHT: Final = "proof files are for bodies of straight triangles without holes that carry forces"
_AFFINE: Final = 1e-10  # relative size of a misfit or of a coefficient of an affine potential that is rounding
_ACTIVE: Final = 1e-9  # speed of opening, relative, up to which a contact of rigid blocks is at its limit
_PARALLEL: Final = 1e-9  # sine of an angle that is rounding
_FACE: Final = 1e-11  # tension, or stress across a direction, relative, that is rounding
_AXES: Final[list[Vector]] = [(ONE, ZERO), (ZERO, ONE)]
_Edge: TypeAlias = tuple[int, int]
_Load: TypeAlias = tuple[Vector, list[list[Fraction]]]  # d; ordinates of d·σn that are fixed, and that are multiplied


def limit_proof(
    problem: ContactProblem,
    loads: Sequence[str],
    *,
    degree: int | None = None,
    time_limit: float | None = None,
    **unknown: Any,
) -> dict[str, Any]:
    """A proof in rational numbers of both sides of `limit_load_factor`, or that the loads cannot be carried.

    The proof states loads, strengths and contact laws. It has stresses that carry the named loads times a factor just
    below `LimitLoad.lower`, and velocities that show that no stress carries more than a factor just above
    `LimitLoad.upper`. Without names of loads it has only velocities of rigid blocks, which show that no stress carries
    all loads as they are. `qvi_contact/limit/check_proof.py`, a script that needs only Python, checks it exactly. In
    the file straight sides are exactly straight, where rounding moved vertices.

    Parameters
    ----------
    problem : ContactProblem
        The problem: straight triangles; friction, strengths and caps that are numbers.
    loads : sequence of str
        Names of the loads to multiply, see `limit_load_factor`.
    degree, time_limit, **unknown
        As for `limit_load_factor`.

    Returns
    -------
    dict
        To be saved as JSON. A side that cannot be proved is left out; "missing" says why.

    Raises
    ------
    InputError
        If the problem has something that proof files cannot state.
    SolveError
        If there is no finite bound, or no proof holds in exact arithmetic.

    """
    refuse_arguments(unknown, OPTIONS)
    with deadline(time_limit):
        no_loads = isinstance(loads, Sequence) and not loads
        analysis = LimitProblem.of(problem, () if no_loads else checked_loads(problem, loads), degree)
        statement = Statement(problem, analysis.names, analysis.low.space.element.traction_degree)
        provers: dict[Callable[[], dict[str, Any]], str] = {lambda: exceeded_by_blocks(statement, analysis): "upper"}
        if analysis.names and problem.yields:
            provers = {partial(exceeded, statement, program): "upper" for program in analysis.flows} | provers
        if analysis.names:
            provers = {lambda: carried(statement, analysis.stresses): "lower", **provers}
        about, proved = _written(statement.about), dict[str, tuple[Any, dict[str, Any]]]()
        errors: dict[str, InputError | SolveError] = {}
        for prove, side in provers.items():  # the proof with the lowest bound is taken for each side
            try:
                part = _written(prove())
                lower, upper, _ = check(about | part)
            except (InputError, SolveError) as error:
                errors.setdefault(side, error)
            except (ValueError, OutOfBalanceError) as error:
                remedy = "take a mesh that is less graded, or change by a millionth the loads that are not multiplied"
                errors.setdefault(side, SolveError(f"proof: in exact arithmetic {error}: {remedy}"))
            else:
                bound = lower if side == "lower" else upper
                if side not in proved or bound < proved[side][0]:
                    proved[side] = bound, part
        if not proved:
            raise next(iter(errors.values()))
        proof: dict[str, Any] = about | {"missing": {side: str(errors[side]) for side in errors if side not in proved}}
        for _, part in proved.values():
            proof |= part
        return proof


def save_proof(path: str | Path, proof: dict[str, Any]) -> None:
    """Write a proof file."""
    write_text(path, json.dumps(proof))


def _written(value: Any) -> Any:
    """A value in the types of JSON, with fractions as texts."""
    return json.loads(json.dumps(value, default=str))


def _number(name: str, field: Field, x: FloatArray, y: FloatArray) -> Fraction:
    """The single value of a field at points; `InputError` if the values differ."""
    values = evaluate(name, field, x, y, minimum=0.0)
    if np.ptp(values) > 0.0:
        raise InputError(name, field, "proof files need constant numbers here")
    return Fraction(float(values.flat[0]))


class Statement:
    """A problem in rational numbers, in the form of the file, with the named loads to be multiplied.

    Attributes
    ----------
    about : dict
        The part of the file that states the problem.
    outward : dict
        By edge (i, j) with a load or contact, 1 if (e_y, −e_x) points out of the body, −1 if into it; on joints out of
        the first cell.

    """

    def __init__(self, problem: ContactProblem, names: Sequence[str], degree: int) -> None:
        self.problem, self.mesh, self.k = problem, problem.mesh, degree
        if self.mesh.curved.any():
            raise InputError("proof", "arcs", _STRAIGHT)
        self.points: list[Vector] = [(Fraction(x), Fraction(y)) for x, y in self.mesh.vertices.tolist()]
        self._straighten()
        self.outward: dict[_Edge, int] = {}
        self.potentials = [[ZERO] * 3, [ZERO] * 3]
        for name, field in problem.body_forces.items():
            total = self.potentials[name in names]
            total[:] = map(add, total, self._affine(field))
        laws, plane = [material.strength for material in problem.materials], problem.material.plane
        self.contacts = [each for each in problem.contacts
                         if each.law != "tied" or (each.plate is not None and each.plate.driven)]  # fmt: skip
        self.loads = dict[_Edge, list[_Load]]()
        for pair, load in self._loads(names):
            self.loads.setdefault(pair, []).append(load)
        self.cells: list[list[int]] = self.mesh.cells.tolist()
        parts = [[cell[a], cell[b], len(self.points) + n] for n, cell in enumerate(self.cells) for a, b in EDGES]
        centres = [middle([self.points[v] for v in cell]) for cell in self.cells]
        self.about: dict[str, Any] = {
            "format": FORMAT,
            "about": "bounds of a limit load; check_proof.py says what this means, and checks it",
            "multiplied": list(names),
            "vertices": self.points + centres,
            "triangles": parts,
            "body_force": [[-c for c in potential[1:]] for potential in self.potentials],
            "strengths": [[] if law is None else list(self._cones(law, plane)) for law in laws],
            "strength_of": np.repeat(problem.cell_materials, 3).tolist(),
            "loads": [{"edge": pair, "along": [*loads, *(((-y, x), None) for (x, y), _ in loads if len(loads) == 1)]}
                      for pair, loads in self.loads.items()],
            "contacts": [self._contact(contact, names) for contact in self.contacts],
        }  # fmt: skip

    @property
    def plates(self) -> dict[str, dict[str, Any]]:
        """The contacts with plates driven by force, by name."""
        return {known["name"]: known for known in self.about["contacts"] if any(known["forces"])}

    def potential(self, factor: Fraction) -> list[Fraction]:
        """The coefficients c₀, c_x and c_y of φ at a load factor."""
        return at_factor(self.potentials, factor)

    def edge(self, pair: Sequence[int]) -> Vector:
        """The vector from the first vertex of an edge to the second."""
        vector: Vector = less(self.points[pair[1]], self.points[pair[0]])
        return vector

    def _straighten(self) -> None:
        """Put vertices of straight sides and joints exactly on lines: thrust along a side with a kink needs tension."""
        moved = set[int]()
        for line in (self.mesh.boundary, *map(self.mesh.edges, self.mesh.joint_names)):  # sides may have several names
            for group in straight_groups(self.mesh.vertices, line):
                along = self.mesh.vertices @ line.tangent[group[0]]
                nodes = np.unique([line.first[group], line.second[group]])
                start, *inner, end = nodes[np.argsort(along[nodes])].tolist()
                a, (x, y) = self.points[start], less(self.points[end], self.points[start])
                for n in inner:
                    if n not in moved and dot(less(self.points[n], a), (-y, x)) != 0:
                        t = Fraction(float((along[n] - along[start]) / (along[end] - along[start])))
                        self.points[n] = a[0] + t * x, a[1] + t * y
                moved.update(inner)

    def _pairs(self, edges: Edges) -> list[_Edge]:
        """The ends of edges; notes in `outward` the side of their normals."""
        pairs: list[_Edge] = list(zip(edges.first.tolist(), edges.second.tolist(), strict=True))
        for pair, (x, y) in zip(pairs, edges.normal.tolist(), strict=True):
            e = self.edge(pair)
            self.outward[pair] = 1 if float(e[1]) * x - float(e[0]) * y > 0.0 else -1
        return pairs

    def _affine(self, field: Field) -> list[Fraction]:
        """The coefficients c₀, c_x and c_y of an affine potential; `InputError` if it is not affine."""
        if not callable(field):
            return [Fraction(field), ZERO, ZERO]
        points = np.concatenate([self.mesh.vertices, self.mesh.midpoints])
        values = evaluate("ContactProblem.body_potential", field, *points.T)
        A = np.column_stack([np.ones(len(points)), points - points[0]])
        coefficients = np.linalg.lstsq(A, values, rcond=None)[0]
        largest = float(np.abs(values).max())
        if np.abs(A @ coefficients - values).max() > _AFFINE * largest:
            raise InputError("ContactProblem.body_potential", field, "proof files need an affine potential")
        slope = np.where(np.abs(coefficients[1:]) > _AFFINE * np.abs(coefficients[1:]).max(), coefficients[1:], 0.0)
        constant = float(values[0] - points[0] @ slope)
        constant = constant if abs(constant) > _AFFINE * largest else 0.0
        return [Fraction(float(c)) for c in (constant, *slope)]

    def _ordinates(self, edges: Edges, name: str, field: Field) -> list[list[Fraction]]:
        """Ordinates of a field along edges (e, k + 1), from the first end of each edge to the second."""
        values = np.full((len(edges), self.k + 1), 0.0 if callable(field) else float(field))
        if callable(field):
            legendre = legendre_basis(self.k, lobatto_points(self.k))
            coefficients = along_edges(self.mesh, edges, name, field).coefficients(self.k)
            values = coefficients @ legendre.T @ bernstein_from_values(self.k).T
        return [[Fraction(value) for value in edge] for edge in values.tolist()]

    def _loads(self, names: Sequence[str]) -> Iterator[tuple[_Edge, _Load]]:
        """Ordinates of d·σn on edges, n outward and as long as the edge: of prescribed tractions and symmetry lines."""
        for traction in self.problem.prescribed(Traction):
            edges, name = traction.edges, traction.name.partition(".")[2]
            is_live = isinstance(traction.condition, Traction) and traction.condition.name in names
            by_edge = zip(self._pairs(edges), self._ordinates(edges, traction.name, traction.value), strict=True)
            for n, (pair, ordinates) in enumerate(by_edge):
                e, outward = self.edge(pair), self.outward[pair]
                d, length = (e if name == "tangential" else (outward * e[1], -outward * e[0])), dot(e, e)
                if name in CARTESIAN:
                    d = (Fraction(name == "x"), Fraction(name == "y"))
                    length = abs(e[0] + e[1]) if 0 in e else Fraction(float(edges.length[n]))
                values, zeros = [length * each for each in ordinates], [ZERO] * len(ordinates)
                yield pair, (d, [zeros, values] if is_live else [values, zeros])

    def _cones(self, law: Strength, plane: Literal["stress", "strain"]) -> Iterator[list[Fraction]]:
        """The cones a, β, γ² of a strength, first the cones under which the volume may change."""
        if isinstance(law, MohrCoulomb) and callable(law.phi):
            law = replace(law, phi=float(_number("MohrCoulomb.phi", law.phi, *self.mesh.vertices.T)))
        for cone in sorted(law.cones(plane), key=lambda cone: cone.pressure == 0.0 == cone.mean):
            strength = _number(cone.name, cone.field, *self.mesh.vertices.T)
            factor, beta, gamma = (Fraction(float(each)) for each in (cone.factor, cone.pressure, cone.mean))
            yield [factor * strength, beta, gamma**2]

    def _contact(self, contact: Contact, names: Sequence[str]) -> dict[str, Any]:
        """A contact, with its plate if forces drive the plate; `InputError` if a part of its law varies."""
        edges, stated = self.mesh.edges(contact.edges), dict[str, Any]()
        for name in SHEAR_LAW:
            field, points = getattr(contact, name), self.mesh.points_along(edges, np.linspace(0.0, 1.0, 9))
            stated[name] = None if field is None else _number(f"Contact.{name}", field, *points)
        stated |= {"name": contact.name, "law": contact.law, "edges": self._pairs(edges)}
        stated["pressures"] = self._ordinates(edges, "Contact.pore_pressure", contact.pore_pressure)
        stated |= {"pivot": [ZERO, ZERO], "forces": [None] * 3}
        if (plate := contact.plate) is not None and plate.driven:
            stated["pivot"] = [Fraction(x) for x in plate.pivot]
            parts, is_live = (plate.force_x, plate.force_y, plate.moment), contact.name in names
            forces = [None if each is None else [Fraction(each)] for each in parts]
            stated["forces"] = [each and ([[ZERO], each] if is_live else [each, [ZERO]]) for each in forces]
        return stated


def carried(statement: Statement, program: StressProgram) -> dict[str, Any]:
    """The part of a proof with stresses of the program, which carry the loads times a factor."""
    found = program.carried(_KEPT_BACK)
    if found.unknowns is None or found.stress is None:
        carried_loads = (
            "no multiple of the loads with a margin for rounding" if found.factor < 0.0 else "any multiple of the loads"
        )
        raise SolveError(f"proof: this mesh carries {carried_loads}: there is nothing to prove")
    p, factor = program.cones.degree + 2, Fraction(found.factor)
    space = Smooth(statement.about["vertices"], statement.about["triangles"], p)
    rough = space.rounded(_rounded_airy(program, found.unknowns))

    stress, amounts = found.stress.reshape(len(space.triangles), -1, 3), list[Fraction]()
    while True:
        try:
            rows = [*_tractions(statement, space, factor), *_resultants(statement, space, factor)]
            rows += _on_faces(statement, space, factor, stress)
            values = space.solved(rows, rough)
            airy = [[(values[n],) for n in part] for part in space.columns.tolist()]
            return {"stress": {"factor": factor, "degree": p - 2, "ordinates": _stresses(statement, p, factor, airy)}}
        except OutOfBalanceError as error:
            amounts.append(error.amount)
            if amounts[-2:-1] == amounts[-1:] or len(amounts) > 2:
                raise
            # loads may be in balance at one factor only: the amount is affine in it
            factor += amounts[1] / (amounts[0] - amounts[1]) if len(amounts) == 2 else ONE


def _stresses(statement: Statement, p: int, factor: Fraction, airy: Sequence[Any]) -> list[list[Any]]:
    """Ordinates of σ = (Φ_yy + φ, Φ_xx + φ, −Φ_xy) from ordinates of Φ."""
    ordinates, c = [], statement.potential(factor)
    for t, _, _, slopes, values in triangles(statement.about, {"degree": p, "ordinates": airy}):
        first = dict(zip(_exponents(p - 1), (slope for (slope,) in gradient(values, slopes)), strict=True))
        corners, stress = [statement.about["vertices"][n] for n in statement.about["triangles"][t]], []
        for alpha, ((xx, xy), (_, yy)) in zip(_exponents(p - 2), gradient(first, slopes), strict=True):
            phi = c[0] + dot(c[1:], middle(corners, [Fraction(n, p - 2) for n in alpha]))
            stress.append((yy + phi, xx + phi, -xy))
        ordinates.append(stress)
    return ordinates


def _tractions(statement: Statement, space: Smooth, factor: Fraction) -> Iterator[Row]:
    """Equations of loads, and of contacts without shear, on edges."""
    k, potential, loads_of = space.p - 2, statement.potential(factor), dict(statement.loads)
    for contact in statement.about["contacts"]:
        no_shear = contact["friction"] == contact["cohesion"] == 0 or contact["shear_limit"] == 0
        if no_shear and contact["law"] != "tied":
            loads_of |= {pair: [(statement.edge(pair), [[ZERO] * (k + 1)] * 2)] for pair in contact["edges"]}
    for pair, loads in loads_of.items():
        e, out, (t, a, b) = statement.edge(pair), statement.outward[pair], space.sides[pair][0]
        for d, values in loads:
            for n, value in enumerate(at_factor(values, factor)):
                alpha = [(k - n) * (i == a) + n * (i == b) for i in range(3)]
                yield _traction(space, potential, t, alpha, e, d, out * value)


def _traction(
    space: Smooth, c: Sequence[Fraction], t: int, alpha: Sequence[int], e: Vector, d: Vector, value: Fraction = ZERO
) -> Row:
    """The equation d·σn = value, n = (e_y, −e_x), at the ordinate α of a triangle; φ has the coefficients c."""
    corners = [space.points[v] for v in space.triangles[t]]
    phi = c[0] + dot(c[1:], middle(corners, [Fraction(n, space.p - 2) for n in alpha]))
    return space.second(t, alpha, (-d[1], d[0]), e), value - phi * dot(d, (e[1], -e[0]))


def _resultants(statement: Statement, space: Smooth, factor: Fraction) -> Iterator[Row]:
    """Equations of forces and moments of plates in (Φ, Φ_x, Φ_y) at vertices.

    With r from the pivot, ∫ σn = [G] and ∫ r × σn = [Φ − r·∇Φ] between the ends of an edge, less the part of φ.
    """
    c = statement.potential(factor)
    for contact in statement.about["contacts"]:
        for i, force in enumerate(contact["forces"]):
            if force is None:
                continue
            row, (right,) = Terms(), at_factor(force, factor)
            for pair in contact["edges"]:
                e, out, ends = statement.edge(pair), statement.outward[pair], [statement.points[v] for v in pair]
                arms, phi = [less(at, contact["pivot"]) for at in ends], [c[0] + dot(c[1:], at) for at in ends]
                for v, r, sign in zip(pair, arms, (-out, out), strict=True):
                    parts = [(ZERO, ZERO, ONE), (ZERO, -ONE, ZERO), (ONE, -r[0], -r[1])][i]
                    row = combined((ONE, row), (Fraction(sign), space.at_vertex(v, parts)))
                first, second = (out * [e[1], -e[0], -dot(r, e)][i] for r in arms)  # n, and r × n
                right -= (phi[0] * (2 * first + second) + phi[1] * (first + 2 * second)) / 6
            yield row, right


def _on_faces(statement: Statement, space: Smooth, factor: Fraction, stress: FloatArray) -> Iterator[Row]:
    """Equations σ n = 0 of stresses that, up to rounding, bear pressure along one direction only, or none.

    Cones R ≤ −S without room leave only such stresses, and rounding would take these out of the cones. Directions are
    those of `YieldCones.rays`. Of directions that differ by rounding the first counts: two would leave no stress.
    """
    c, small = statement.potential(factor), _FACE * np.abs(stress).max()
    for t, corners in enumerate(space.triangles):
        if [ZERO, ONE, ZERO] not in statement.about["strengths"][statement.about["strength_of"][t]]:
            continue
        named = sorted(statement.outward, key=frozenset(corners).isdisjoint)  # near ones first
        ways = [less(space.points[j], space.points[i]) for i, j in (*named, *combinations(corners, 2))]
        unit = np.array(ways, dtype=float)
        unit /= np.hypot(*unit.T)[:, None]
        is_new = ~np.tril(np.abs(unit @ (unit[:, ::-1] * [1.0, -1.0]).T) <= _PARALLEL, -1).any(axis=1)
        for alpha, (xx, yy, xy) in zip(_exponents(space.p - 2), stress[t], strict=True):
            across = np.abs([unit[:, 1] * xx - unit[:, 0] * xy, unit[:, 1] * xy - unit[:, 0] * yy]).max(axis=0)
            for n in np.flatnonzero(is_new & (across <= small)):
                yield from (_traction(space, c, t, alpha, ways[n], d) for d in _AXES)


def _rounded_airy(program: StressProgram, unknowns: FloatArray) -> FloatArray:
    """Ordinates of Φ in floating point (parts, count)."""
    low, high, space = program.low, program.high, program.low.space
    if len(space.frames.cuts):
        raise InputError("proof", f"{len(space.frames.cuts)} holes", _STRAIGHT)
    element, n = space.element, low.qvi.n
    u = low.values(unknowns[:n]) + (unknowns[-1] - 1.0) * (high.root.particular - low.root.particular)
    factors = low.root.stiffness.coefficients(u, None)
    factors[:, element.shared :] = unknowns[n:-1].reshape(len(factors), -1)
    corners = space.triangles.corners
    arms = lattice(element.degree) @ part_corners(corners) - corners[:, None, None, 0]
    ordinates = np.einsum("scd,nd->nsc", element.coefficients[:, :, 3:], factors[:, 3:])
    ordinates += factors[:, None, None, 0] + np.einsum("npcx,nx->npc", arms, factors[:, 1:3])
    return np.asarray(ordinates.reshape(-1, ordinates.shape[-1]) * low.scales.airy)


def exceeded_by_blocks(statement: Statement, analysis: LimitProblem) -> dict[str, Any]:
    """The part of a proof with velocities of rigid blocks: a bound for all stresses."""
    mechanism = analysis.of_blocks[1] if analysis.names else find_mechanism(analysis.problem)
    if mechanism is None:
        remedy = "" if analysis.names else ": name one or more to multiply"
        raise SolveError(f"proof: no motion of rigid blocks bounds the loads{remedy}")
    isochoric = np.zeros(len(mechanism.blocks), dtype=bool)
    space = Velocities(statement.problem, 1, ~isochoric)
    points_of = zip(mechanism.blocks, part_corners(statement.mesh.corners).reshape(-1, 9, 2), strict=True)
    velocities = np.array([mechanism.motions[block].at(points) for block, points in points_of]).reshape(-1, 3, 3, 2)
    return _flow(statement, space, velocities, mechanism.plates, isochoric, {})


def exceeded(statement: Statement, program: FlowProgram) -> dict[str, Any]:
    """The part of a proof with velocities of the flow program: a bound for all stresses."""
    flow = program.solved(_KEPT_BACK_ABOVE)
    if flow.motion is None or flow.shares is None:
        raise SolveError("proof: no flow without slip along supports bounds the loads")
    cones, isochoric = program.cones, ~program.cones.strong
    changes_volume = (cones.pressure != 0.0) | (cones.mean != 0.0)
    isochoric[cones.cell[changes_volume]] = False
    # parts of (tr ε, ε_xx − ε_yy, 2 ε_xy) that all cones but the first take, by coefficient
    strain, shares = flow.shares / statement.mesh.length, dict[int, FloatArray]()
    order = np.lexsort((~changes_volume, cones.coefficient))
    for rows in np.split(order, np.flatnonzero(np.diff(cones.coefficient[order])) + 1):
        if len(rows) > 1:
            shares[int(cones.coefficient[rows[0]])] = strain[rows[1:]]
    return _flow(statement, program.space, flow.motion.velocities, flow.motion.plates, isochoric, shares)


def _flow(
    statement: Statement, space: Velocities, velocities: FloatArray, plates: Mapping[str, RigidMotion],
    isochoric: BoolArray, shares: Mapping[int, FloatArray],
) -> dict[str, Any]:  # fmt: skip
    """The part of a proof with velocities and the dissipation of all cones, by one cone or by the given shares."""
    parts, plate_motions = _exactly(statement, space, velocities, plates, isochoric)
    field, rates = {"degree": space.degree, "ordinates": parts}, list[Any]()
    zero = [ZERO] * 3
    for t, laws, _, slopes, v in triangles(statement.about, field):
        rates_of_triangle = list[Any]()
        strains = [[u_x + v_y, u_x - v_y, u_y + v_x] for (u_x, u_y), (v_x, v_y) in gradient(v, slopes)]
        for number, strain in enumerate(strains, t * len(strains)):
            candidates = [[strain if n == m else zero for n in range(1, len(laws))] for m in range(len(laws))]
            if number in shares:
                candidates.append([[Fraction(x) for x in share] for share in shares[number].tolist()])
            if len(laws) == 2:  # a trace that is too small for the first cone by rounding goes to the second
                deficit = laws[0][1] * Fraction(math.hypot(*strain[1:]) * (1.0 + 1e-15)) - strain[0]
                candidates.append([[-deficit, ZERO, ZERO]])
            choices = [_shared(laws, strain, each) for each in candidates]
            rates_of_triangle.append(min(choices, key=partial(_cost, laws, strain), default=[]))
        rates.append(rates_of_triangle)
    return {"flow": {**field, "rates": rates, "plates": plate_motions}}


def _shared(laws: list[Any], strain: Sequence[Fraction], others: Sequence[Sequence[Fraction]]) -> list[list[Fraction]]:
    """By cone s and its part of a strain rate; the first cone has the strain less the parts of the others."""
    shares, first = list[list[Fraction]](), [whole - sum(parts) for whole, *parts in zip(strain, *others, strict=True)]
    for (_, beta, gamma2), (trace, *d) in zip(laws, [first, *others], strict=True):
        square = dot(d, d) + (trace**2 / gamma2 if gamma2 else 0)
        s = trace / beta if beta else Fraction(math.sqrt(square) * (1.0 + 1e-15))  # not below the root
        shares.append([s, trace, *d] if shares else [s])
    return shares


def _cost(laws: list[Any], strain: Sequence[Fraction], shares: list[Any]) -> float:
    """The dissipation; infinity if the cones cannot flow like this."""
    try:
        return float(dissipated(0, list(strain), laws, shares))
    except ValueError:
        return np.inf


def _held(
    statement: Statement, space: Velocities, moving: Sequence[Sequence[Terms]], points: Sequence[Vector],
    values: Sequence[Fraction],
) -> Iterator[Terms]:  # fmt: skip
    """Terms that are zero: velocities without a given traction, jumps that laws exclude, and contacts at a limit."""
    numbers = [[(n,) for n in part] for cell in space.table.tolist() for part in cell]
    field, rigid = {"degree": space.degree, "ordinates": numbers}, space.rigid.tolist()
    names = list(statement.plates)
    for (i, j), normal, (own, *beyond), contact, _, loads in edges(statement.about, field):
        directions, body = [d for d, given in loads if given is None], -1
        nodes = [(first, beyond[0][k][0] if beyond else -1) for k, (first,) in enumerate(own)]
        if contact:
            e, body = statement.edge((i, j)), names.index(contact["name"]) if contact["name"] in names else -1
            if contact["law"] != "unilateral":
                is_stuck = contact["law"] == "tied" or (contact["friction"] > 0 and contact["shear_limit"] is None)
                directions = [normal, e] if is_stuck else [normal]
            elif all(rigid[n] >= 0 for side in (own, *beyond) for (n,) in side):
                for first, second in (nodes[0], nodes[-1]):
                    at, other = points[first], rigid[second] if beyond else body
                    opening, slip = (
                        combined((ONE, _rigid_row(rigid[first], d, at)), (-ONE, _rigid_row(other, d, at)))
                        for d in (less((0, 0), normal), e)
                    )
                    yield from _at_limit(contact, e, opening, slip, values)
        for first, second in nodes:
            for d in directions:
                other = _along(moving[second], d) if beyond else _rigid_row(body, d, points[first])
                yield combined((ONE, _along(moving[first], d)), (-ONE, other))


def _at_limit(
    contact: dict[str, Any], e: Vector, opening: Terms, slip: Terms, values: Sequence[Fraction]
) -> Iterator[Terms]:
    """Terms that are zero where a contact that opens is, up to rounding, at its limit w = 0 or w = μ |[v]_T|."""
    mu, small = contact["friction"], _ACTIVE * float(dot(e, e)) ** 0.5
    dilates = contact["shear_limit"] is None and mu > 0
    w, t = (float(_value(row, values)) for row in (opening, slip))
    if w - dilates * float(mu) * abs(t) <= small:
        does_slide = dilates and abs(t) > small
        yield combined((ONE, opening), (-mu if t > 0 else mu, slip)) if does_slide else opening
        if dilates and not does_slide:
            yield slip


def _along(v: Sequence[Terms], d: Vector) -> Terms:
    """d·v as terms."""
    return combined((d[0], v[0]), (d[1], v[1]))


def _rigid_row(body: int, d: Vector, at: Vector) -> Terms:
    """d·v at a point as terms of the motions (a − θ y, b + θ x) of a body; no terms without a body."""
    parts = (d[0], d[1], d[1] * at[0] - d[0] * at[1])
    return {3 * body + i: part for i, part in enumerate(parts) if part} if body >= 0 else {}


def _value(terms: Terms, values: Sequence[Fraction]) -> Fraction:
    """The sum of terms with these values of the unknowns."""
    return sum((c * values[column] for column, c in terms.items()), ZERO)


def _exactly(
    statement: Statement, space: Velocities, velocities: FloatArray, plates: Mapping[str, RigidMotion],
    isochoric: BoolArray,
) -> tuple[list[Any], dict[str, Any]]:  # fmt: skip
    """Ordinates of velocities, and motions of plates about their pivots, near given ones, that keep all equations."""
    rough, points, rigid = np.zeros((space.count, 2)), _places(statement, space), space.rigid.tolist()
    rough[space.table] = velocities
    values, rows, pivots = list[Fraction](), list[Terms](), dict[str, list[Terms]]()
    for body, (name, contact) in enumerate(statement.plates.items()):
        values += [Fraction(x) for x in (*plates[name].at(np.zeros(2)).tolist(), plates[name].rotation)]
        pivots[name] = [*(_rigid_row(body, axis, contact["pivot"]) for axis in _AXES), {3 * body + 2: ONE}]
        rows += [row for row, force in zip(pivots[name], contact["forces"], strict=True) if force is None]
    for body in range(len(pivots), len(space.centres)):
        nodes = np.flatnonzero(space.rigid == body)
        x, y = np.array([points[n] for n in nodes.tolist()], dtype=float).T
        one, none = np.ones(len(nodes)), np.zeros(len(nodes))
        A = np.concatenate([np.column_stack([one, none, -y]), np.column_stack([none, one, x])])
        values += map(Fraction, np.linalg.lstsq(A, rough[nodes].T.ravel(), rcond=None)[0].tolist())
    smooth, streams = _streams(statement, space, isochoric, len(values))
    if smooth is not None:
        values += smooth.rounded(smooth.integrated(velocities[isochoric].reshape(-1, *velocities.shape[2:])))
    moving = list[Sequence[Terms]]()
    for n, body in enumerate(rigid):
        terms = [_rigid_row(body, axis, points[n]) for axis in _AXES]
        if body < 0 and n not in streams:
            terms = [{len(values): ONE}, {len(values) + 1: ONE}]
            values += map(Fraction, rough[n].tolist())
        moving.append(streams.get(n, terms))
    stiff = [(n, body) for n, body in enumerate(rigid) if n in streams and body >= 0]
    for n, body in (*stiff, *space.hinges.T.tolist()):
        rows += [combined((ONE, terms), (-ONE, _rigid_row(body, axis, points[n])))
                 for terms, axis in zip(moving[n], _AXES, strict=True)]  # fmt: skip
    all_rows = [(row, ZERO) for row in (*rows, *_held(statement, space, moving, points, values))]
    values = smooth.solved(all_rows, values) if smooth else solved(all_rows, values)
    exact = [[_value(terms, values) for terms in each] for each in moving]
    moved = {each.name: [_value(row, values) for row in pivots.get(each.name, [{}] * 3)] for each in statement.contacts}
    return [[exact[n] for n in part] for cell in space.table.tolist() for part in cell], moved


def _places(statement: Statement, space: Velocities) -> list[Vector]:
    """The points of the coefficients of velocities."""
    points, alpha = [(ZERO, ZERO)] * space.count, _exponents(space.degree)
    shares = [[Fraction(weight, space.degree) for weight in weights] for weights in alpha]
    for names, numbers in zip(statement.about["triangles"], space.table.reshape(-1, len(alpha)).tolist(), strict=True):
        for n, weights in zip(numbers, shares, strict=True):
            points[n] = middle([statement.about["vertices"][v] for v in names], weights)
    return points


def _streams(
    statement: Statement, space: Velocities, isochoric: BoolArray, first: int
) -> tuple[Smooth | None, dict[int, list[Terms]]]:
    """Stream functions ψ, C1 on each part that keeps its volume, and the terms of (ψ_y, −ψ_x) by coefficient."""
    if not isochoric.any():
        return None, {}
    alpha = np.array(_exponents(space.degree))
    table = space.table[isochoric].reshape(-1, len(alpha))
    tips = table[:, alpha.argmax(axis=0)]
    _, first_place, corners = np.unique(tips, return_index=True, return_inverse=True)  # blocks do not share them
    names = np.array(statement.about["triangles"])[np.repeat(isochoric, 3)]
    points = [statement.about["vertices"][n] for n in names.ravel()[first_place].tolist()]
    smooth, terms = Smooth(points, corners.reshape(-1, 3).tolist(), space.degree + 1, first), dict[int, list[Terms]]()
    for t, numbers in enumerate(table.tolist()):
        for number, (_, n, inner) in zip(numbers, alpha.tolist(), strict=True):
            terms[number] = [smooth.slope((t, 0, 1), axis, n, inner) for axis in ((ZERO, ONE), (-ONE, ZERO))]
    return smooth, terms
