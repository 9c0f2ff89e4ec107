"""Proof files: stresses that carry the loads in rational numbers, for a checker that trusts nothing of this package.

Rounding breaks the smoothness of Φ and its tractions by some 1e-16. So Φ is built again, exactly, from numbers that are
free: Φ and ∇Φ at vertices, along each edge the ordinates of Φ and of its cross derivative that these leave open, and in
each triangle what its C1 conditions leave open. Prescribed tractions are linear equations between values at vertices of
the boundary, solved in rationals. With G = (Φ_y, −Φ_x) along an edge e from i to j, d/ds G = σn for the normal
n = (e_y, −e_x), and n·G and e·G are the derivatives of Φ along e and m = (−e_y, e_x).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.basics.writing import write_text
from qvi_contact.element import legendre
from qvi_contact.element.triangle import EDGES, exponents
from qvi_contact.errors import InputError, SolveError
from qvi_contact.limit.check_proof import check
from qvi_contact.limit.stresses import lattice, part_corners
from qvi_contact.problem.conditions import CARTESIAN, Contact, Symmetry, Traction, components
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.material import Mises, Strength
from qvi_contact.problem.problem import ContactProblem

if TYPE_CHECKING:
    from qvi_contact.limit.stresses import CarriedStress, StressProgram

_STRAIGHT: Final = "proof files are for bodies of straight triangles without holes that carry forces"
_CONSTANT: Final = "proof files need constant numbers here"
_AFFINE: Final = 1e-10  # misfit of an affine potential, and parts of it, relative, that are rounding
_KEPT_BACK: Final = 1e-6  # share of the way to a state inside that a proof keeps back for rounding

Row = tuple[dict[int, Fraction], Fraction]
"""Coefficients of vertex values by their numbers, and the right-hand side."""


def lower_proof(problem: ContactProblem, names: Sequence[str], program: StressProgram) -> dict[str, Any]:
    """A proof that the problem carries the named loads times a factor, as `check_proof.check` reads it.

    Raises
    ------
    InputError
        If the problem has something that proof files do not hold: arcs, plates, pins, fluids, functions that are not
        affine, friction that varies, bilateral contacts with friction.
    SolveError
        If there is nothing to prove, or rounding is larger than what the stresses leave inside their limits.

    """
    _refuse(problem)
    carried = program.strictly_carried(_KEPT_BACK)
    if carried.unknowns is None:
        raise SolveError("proof: this mesh carries no largest multiple of the loads: there is nothing to prove")
    exact = _Exact(problem, names, program, carried)
    proof = exact.stated()
    try:
        check(proof)
    except ValueError as error:
        remedy = "take a mesh that is less graded, or change the loads that are not multiplied by a millionth"
        raise SolveError(f"proof: in exact arithmetic {error}: {remedy}") from error
    return proof


def save_proof(path: str | Path, proof: dict[str, Any]) -> None:
    """Write a proof file."""
    write_text(path, json.dumps(proof))


def _refuse(problem: ContactProblem) -> None:
    """`InputError` for what a proof file does not hold."""
    mesh = problem.mesh
    if mesh.curved.any():
        raise InputError("proof", "arcs", _STRAIGHT)
    for contact in problem.contacts:
        if contact.plate is not None or contact.has_fluid:
            raise InputError("Contact", contact.name, "proof files hold no plates, pins or fluids")
        if contact.law == "bilateral" and _law(problem, contact)[0] != 0:
            raise InputError("Contact.law", contact.name, "proof files hold no bilateral contact with friction")


def _law(problem: ContactProblem, contact: Contact) -> tuple[Fraction, Fraction, Fraction | None]:
    """μ, c and t_max of a contact, or None for the last one; `InputError` if one of them varies."""
    x, y = problem.mesh.points_along(problem.mesh.edges(contact.edges), np.linspace(0.0, 1.0, 9))
    found = []
    for name in ("friction", "cohesion", "shear_limit"):
        field = getattr(contact, name)
        found.append(None if field is None else _number(f"Contact.{name}", field, x, y))
    mu, c, cap = found
    return mu or Fraction(0), c or Fraction(0), cap


def _number(name: str, field: Field, x: FloatArray, y: FloatArray) -> Fraction:
    """The one value of a field at points; `InputError` if there are several."""
    values = evaluate(name, field, x, y, minimum=0.0)
    if np.ptp(values) > 0.0:
        raise InputError(name, field, _CONSTANT)
    return Fraction(float(values.flat[0]))


class _Exact:
    """Φ in rational numbers."""

    def __init__(
        self, problem: ContactProblem, names: Sequence[str], program: StressProgram, carried: CarriedStress
    ) -> None:
        mesh = problem.mesh
        assert carried.unknowns is not None
        self.problem, self.names, self.mesh = problem, tuple(names), mesh
        self.p = program.cones.degree + 2
        self.k = program.cones.degree
        self.factor = Fraction(carried.factor)
        self.points = [(Fraction(x), Fraction(y)) for x, y in mesh.vertices.tolist()]
        self.rough, self.at_vertices = _rounded_airy(program, carried)
        self.dead, self.live = self._potentials()
        self.potential = [a + self.factor * b for a, b in zip(self.dead, self.live, strict=True)]
        self.loads = list(self._loads())
        self.given = self._given()
        self.values = self._vertex_values()

    def _potentials(self) -> tuple[list[Fraction], list[Fraction]]:
        """φ of the loads that stay, and of those that are multiplied: c₀ + c_x x + c_y y."""
        dead, live = [Fraction(0)] * 3, [Fraction(0)] * 3
        for name, field in self.problem.body_forces.items():
            into = live if name in self.names else dead
            for i, value in enumerate(self._affine(field)):
                into[i] += value
        return dead, live

    def _affine(self, field: Field) -> list[Fraction]:
        """c₀, c_x and c_y of an affine field; `InputError` if it is another one."""
        if not callable(field):
            return [Fraction(field), Fraction(0), Fraction(0)]
        places = np.concatenate([self.mesh.vertices, self.mesh.midpoints])
        values = evaluate("ContactProblem.body_potential", field, *places.T)
        origin, size = places.mean(axis=0), float(np.ptp(places, axis=0).max())
        A = np.column_stack([np.ones(len(places)), (places - origin) / size])
        found = np.linalg.lstsq(A, values, rcond=None)[0]
        largest = float(np.abs(values).max())
        if np.abs(A @ found - values).max() > _AFFINE * largest:
            raise InputError("ContactProblem.body_potential", field, "proof files need an affine potential")
        slope = np.where(np.abs(found[1:]) > _AFFINE * np.abs(found[1:]).max(), found[1:] / size, 0.0)
        constant = float(values[0] - places[0] @ slope)
        constant = constant if abs(constant) > _AFFINE * largest else 0.0
        return [Fraction(float(c)) for c in (constant, *slope)]

    def _loads(self) -> Iterator[_Load]:
        """Prescribed tractions, symmetry lines included."""
        for condition in self.problem.conditions:
            if isinstance(condition, Traction):
                given, live = components(condition), condition.name in self.names
            elif isinstance(condition, Symmetry):
                given, live = {"tangential": 0.0}, False
            else:
                continue
            edges = self.mesh.edges(condition.edges)
            for name, value in given.items():
                if callable(value):
                    field = along_edges(self.mesh, edges, f"Traction.{name}", value)
                    ordinates = field.coefficients(self.k) @ legendre.to_bernstein(self.k).T
                else:
                    ordinates = np.full((len(edges), self.k + 1), float(value))
                for n in range(len(edges)):
                    i, j = int(edges.first[n]), int(edges.second[n])
                    e = _less(self.points[j], self.points[i])
                    normal = (e[1], -e[0])
                    outward = 1 if _dot(normal, [Fraction(x) for x in edges.normal[n].tolist()]) > 0 else -1
                    length = _dot(e, e)
                    d = e if name == "tangential" else (outward * normal[0], outward * normal[1])
                    if name in CARTESIAN:
                        d = (Fraction(name == "x"), Fraction(name == "y"))
                        length = abs(e[0] + e[1]) if 0 in e else Fraction(float(edges.length[n]))
                    values = tuple(length * Fraction(float(value)) for value in ordinates[n])
                    yield _Load((i, j), d, values, live, outward)

    def _given(self) -> dict[tuple[int, int], list[list[Fraction] | None]]:
        """What loads say of an edge: ordinates of n·G' and of e·G' from its first end on, or None."""
        by_edge: dict[tuple[int, int], list[_Load]] = {}
        for load in self.loads:
            by_edge.setdefault(load.edge, []).append(load)
        found: dict[tuple[int, int], list[list[Fraction] | None]] = {}
        for (i, j), loads in by_edge.items():
            e = _less(self.points[j], self.points[i])
            normal = (e[1], -e[0])
            between = [self._between(i, j, m) for m in range(self.k + 1)]
            phi = [self.potential[0] + self.potential[1] * x + self.potential[2] * y for x, y in between]
            # d·G' = d·σn less the part of φ, for the normal of the edge
            right = []
            for load in loads:
                factor = self.factor if load.live else 1
                rows = [load.outward * factor * v for v in load.values]
                right.append([a - b * _dot(load.direction, normal) for a, b in zip(rows, phi, strict=True)])
            if len(loads) == 2:
                (a, b), (c, d) = loads[0].direction, loads[1].direction
                det = a * d - b * c
                x = [(d * u - b * v) / det for u, v in zip(*right, strict=True)]
                y = [(a * v - c * u) / det for u, v in zip(*right, strict=True)]
                along = [normal[0] * u + normal[1] * v for u, v in zip(x, y, strict=True)]
                across = [e[0] * u + e[1] * v for u, v in zip(x, y, strict=True)]
                found[i, j] = [along, across]
                continue
            only = loads[0].direction
            n_part = _dot(only, normal)
            if n_part == 0:
                scale = _dot(e, e) / _dot(only, e)
                found[i, j] = [None, [scale * value for value in right[0]]]
            elif _dot(only, e) == 0:
                scale = _dot(normal, normal) / n_part
                found[i, j] = [[scale * value for value in right[0]], None]
            else:
                remedy = "on slanted edges proof files hold x and y together, or normal and tangential ones"
                raise InputError("Traction", self.problem.mesh.edge_names, remedy)
        for contact in self.problem.contacts:
            mu, c, cap = _law(self.problem, contact)
            if (mu == c == 0 or cap == 0) and contact.law != "tied":  # a shear of exactly zero
                edges = self.mesh.edges(contact.edges)
                for i, j in np.column_stack([edges.first, edges.second]).tolist():
                    found[i, j] = [None, [Fraction(0)] * (self.k + 1)]
        return found

    def _between(self, i: int, j: int, m: int) -> tuple[Fraction, Fraction]:
        """Place of the ordinate m of degree k between two vertices."""
        t = Fraction(m, self.k)
        a, b = self.points[i], self.points[j]
        return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])

    def _vertex_values(self) -> list[Fraction]:
        """Φ, Φ_x, Φ_y of all vertices so that the loads hold: those that depend on others in rationals."""
        rows: list[Row] = []
        k1 = self.k + 1
        for (i, j), (along, across) in self.given.items():
            e = _less(self.points[j], self.points[i])
            normal = (e[1], -e[0])
            if along is not None:  # n·G = Φ_e
                sums = _sums(along, k1)
                rows.append(_row(_dot_gradient(i, j, e), sums[-1]))
                own = {3 * j: Fraction(1), 3 * i: Fraction(-1), 3 * i + 1: -e[0], 3 * i + 2: -e[1]}
                rows.append(_row(own, sum(sums, Fraction(0)) / self.p))
            if across is not None:  # e·G = Φ_m with m = −n
                rows.append(_row(_dot_gradient(i, j, (-normal[0], -normal[1])), _sums(across, k1)[-1]))
        return _solved(rows, [Fraction(float(value)) for value in self.at_vertices.ravel()])

    def _edge(self, i: int, j: int, rough: tuple[FloatArray, FloatArray]) -> tuple[list[Fraction], list[Fraction]]:
        """Ordinates of Φ (p + 1) and of Φ_m (p) from i to j; `rough` are those in floating point."""
        p, e = self.p, _less(self.points[j], self.points[i])
        m = (-e[1], e[0])
        flipped = (j, i) in self.given
        along, across = self.given.get((i, j), self.given.get((j, i), [None, None]))
        values = [self.values[3 * v : 3 * v + 3] for v in (i, j)]
        first, second = (_dot(e, value[1:]) for value in values)
        q = [Fraction(float(value)) for value in rough[0]]
        if along is None:
            q[0], q[1], q[p - 1], q[p] = (
                values[0][0], values[0][0] + first / p, values[1][0] - second / p, values[1][0],
            )  # fmt: skip
        else:
            q[0] = values[0][0]
            # second derivatives along the edge do not mind from which end they are counted
            sums = [Fraction(0), *_sums(along[::-1] if flipped else along, p - 1)]
            for n in range(p):
                q[n + 1] = q[n] + (first + sums[n]) / p
        cross = [Fraction(float(value)) for value in rough[1]]
        cross[0], cross[-1] = (_dot(m, value[1:]) for value in values)
        if across is not None:
            sums = _sums(across[::-1] if flipped else across, p - 1)
            cross[1:] = [cross[0] + value for value in sums]
        return q, cross

    def stated(self) -> dict[str, Any]:
        """The proof."""
        triangles = self.mesh.cells.tolist()
        edges: dict[tuple[int, int], tuple[list[Fraction], list[Fraction]]] = {}
        airy = []
        for t, corners in enumerate(triangles):
            centre = tuple(sum((self.points[v][i] for v in corners), Fraction(0)) / 3 for i in (0, 1))
            known: dict[tuple[int, ...], Fraction] = {}
            for s, (a, b) in enumerate(EDGES):
                i, j = corners[a], corners[b]
                e = _less(self.points[j], self.points[i])
                m, inwards = (-e[1], e[0]), _less(centre, self.points[i])
                square = _dot(e, e)
                alpha, beta = _dot(inwards, e) / square, _dot(inwards, m) / square
                if (i, j) not in edges:
                    edges[i, j] = self._edge(i, j, _rough_edge(self.rough[t, s], self.p, float(alpha), float(beta)))
                q, cross = edges[i, j]
                for n in range(self.p + 1):
                    known[_key(a, self.p - n, b, n, 0)] = q[n]
                for n in range(self.p):
                    slope = alpha * self.p * (q[n + 1] - q[n]) + beta * cross[n]
                    known[_key(a, self.p - 1 - n, b, n, 1)] = q[n] + slope / self.p
            free, dependent = _inner(self.p)
            for key, (s, n) in free.items():
                known[key] = Fraction(float(self.rough[t, s, n]))
            for key, parts in dependent:
                known[key] = sum((c * known[other] for other, c in parts.items()), Fraction(0))
            airy.append([[str(known[key]) for key in _keys(self.p, s)] for s in range(3)])
        laws = [material.strength for material in self.problem.materials]
        plane = self.problem.material.plane
        numbers = self.problem.cell_materials.tolist()
        return {
            "about": "a lower bound of a limit load; check_proof.py says what this means, and checks it",
            "degree": self.p,
            "factor": str(self.factor),
            "multiplied": list(self.names),
            "vertices": [[str(x), str(y)] for x, y in self.points],
            "triangles": triangles,
            "airy": airy,
            "potential": {"dead": [str(c) for c in self.dead], "live": [str(c) for c in self.live]},
            "strengths": [[] if law is None else list(self._cones(law, plane)) for law in laws],
            "strength_of": [None if laws[number] is None else number for number in numbers],
            "loads": [load.stated() for load in self.loads],
            "contacts": [self._contact(contact) for contact in self.problem.contacts if contact.law != "tied"],
        }

    def _cones(self, law: Strength, plane: Literal["stress", "strain"]) -> Iterator[dict[str, Any]]:
        """The cones of a strength as `check_proof` reads them."""
        for cone in law.cones(plane):
            value = _number(cone.name, cone.field, *self.mesh.vertices.T)
            found: dict[str, Any] = {"a": [str(value), "0", "0"]}
            if isinstance(law, Mises):
                found |= {"f2": "4/3", "gamma2": "1/3" if cone.mean else "0"}
            else:
                found |= {"f": str(Fraction(cone.factor)), "beta": str(Fraction(cone.pressure))}
            yield found

    def _contact(self, contact: Contact) -> dict[str, Any]:
        """A contact as `check_proof` reads it."""
        mu, c, cap = _law(self.problem, contact)
        edges = self.mesh.edges(contact.edges)
        return {
            "name": contact.name,
            "law": contact.law,
            "friction": str(mu),
            "cohesion": str(c),
            "shear_limit": None if cap is None else str(cap),
            "edges": np.column_stack([edges.first, edges.second]).tolist(),
        }


@dataclass(frozen=True)
class _Load:
    """Ordinates of d·σn on an edge, n outward and as long as the edge."""

    edge: tuple[int, int]
    direction: tuple[Fraction, Fraction]
    values: tuple[Fraction, ...]
    live: bool
    outward: int

    def stated(self) -> dict[str, Any]:
        values, zeros = [str(value) for value in self.values], ["0"] * len(self.values)
        return {
            "edge": list(self.edge),
            "direction": [str(value) for value in self.direction],
            "dead": zeros if self.live else values,
            "live": values if self.live else zeros,
        }


def _rounded_airy(program: StressProgram, carried: CarriedStress) -> tuple[FloatArray, FloatArray]:
    """Φ in floating point: its ordinates (cells, 3, count), and (Φ, Φ_x, Φ_y) at vertices (v, 3)."""
    low, high = program.low, program.high
    assert carried.unknowns is not None
    space = low.space
    if len(space.cuts):
        raise InputError("proof", f"{len(space.cuts)} holes", _STRAIGHT)
    element, n = space.element, low.qvi.n
    change = high.particular - low.particular
    u = low.basis @ carried.unknowns[:n] + low.particular + (carried.factor - 1.0) * change
    affine, w = space.differences.apply(u)
    frames, first = space.frames, space.mesh.cells[:, 0]
    if frames.several:
        affine = affine + (frames.affine(first) @ u[frames.columns(first)][:, :, None])[:, :, 0]
    B = element.transformations(space.triangles)[:, 3:, 3:]
    inner = carried.unknowns[n:-1].reshape(len(w), -1)
    factors = np.hstack([(B @ w[:, :, None])[:, :, 0], inner])
    ordinates = np.einsum("scd,nd->nsc", element.coefficients[:, :, 3:], factors)
    arms = lattice(element.degree) @ part_corners(space.triangles.corners)
    arms = arms - space.triangles.corners[:, None, None, 0]
    ordinates = ordinates + affine[:, None, None, 0] + np.einsum("npcx,nx->npc", arms, affine[:, 1:])
    # values and slopes at vertices from the ordinates of one triangle each
    values = np.empty((len(space.vertices), 3))
    alpha, p = exponents(element.degree), element.degree
    for s, (a, b) in enumerate(EDGES):
        for own, end in ((0, a), (1, b)):
            at = {tuple(row): i for i, row in enumerate(alpha.tolist())}
            corner = [0, 0, 0]
            corner[own] = p
            around = [[*corner] for _ in range(2)]
            for which, other in enumerate(i for i in range(3) if i != own):
                around[which][own] -= 1
                around[which][other] += 1
            c0, c1, c2 = (ordinates[:, s, at[tuple(each)]] for each in (corner, *around))
            corners = part_corners(space.triangles.corners)[:, s]
            others = [i for i in range(3) if i != own]
            directions = np.stack([corners[:, i] - corners[:, own] for i in others], axis=1)
            slopes = np.linalg.solve(directions, np.stack([c1 - c0, c2 - c0], axis=1)[:, :, None])[:, :, 0] * p
            values[space.mesh.cells[:, end]] = np.column_stack([c0, slopes])
    scales = low.scales
    return ordinates * scales.airy, values * [scales.airy, scales.airy / scales.length, scales.airy / scales.length]


def _rough_edge(part: FloatArray, p: int, alpha: float, beta: float) -> tuple[FloatArray, FloatArray]:
    """Ordinates of Φ and of Φ_m along the edge of a part, from those of Φ."""
    at = {tuple(row): i for i, row in enumerate(exponents(p).tolist())}
    q = np.array([part[at[p - n, n, 0]] for n in range(p + 1)])
    inner = np.array([part[at[p - 1 - n, n, 1]] for n in range(p)])
    return q, (p * (inner - q[:-1]) - alpha * p * np.diff(q)) / beta


def _key(a: int, i: int, b: int, j: int, inner: int) -> tuple[int, int, int, int]:
    """The ordinate with weights i of corner a, j of corner b, and of the barycentre."""
    key = [0, 0, 0, inner]
    key[a], key[b] = i, j
    return key[0], key[1], key[2], key[3]


def _keys(p: int, s: int) -> list[tuple[int, int, int, int]]:
    """The ordinates of a part in their order."""
    a, b = EDGES[s]
    return [_key(a, i, b, j, inner) for i, j, inner in exponents(p).tolist()]


@cache
def _inner(p: int) -> tuple[dict[Any, tuple[int, int]], list[tuple[Any, dict[Any, Fraction]]]]:
    """Ordinates of a split triangle that its C1 conditions leave open, by part and number; and the others by these.

    Two layers along the sides are known. Across the line from corner v to the barycentre, ordinates of both parts add
    to three times the one on the line that is nearer to the barycentre, less the one that is farther.
    """
    places = {key: (s, n) for s in range(3) for n, key in enumerate(_keys(p, s))}
    rows: list[dict[Any, Fraction]] = []
    for v in range(3):
        a, b = (i for i in range(3) if i != v)
        for inner in range(1, p):
            i = p - 1 - inner
            row: dict[Any, Fraction] = {}
            for key, c in (
                (_key(v, i, a, 1, inner), 1), (_key(v, i, b, 1, inner), 1), (_key(v, i + 1, a, 0, inner), 1),
                (_key(v, i, a, 0, inner + 1), -3),
            ):  # fmt: skip
                row[key] = row.get(key, Fraction(0)) + c
            rows.append(row)
    pivots: list[tuple[Any, dict[Any, Fraction]]] = []
    for row in rows:
        rest = dict(row)
        for key, parts in pivots:
            c = rest.pop(key, Fraction(0))
            for other, value in parts.items():
                rest[other] = rest.get(other, Fraction(0)) + c * value
        open_ = [key for key, c in rest.items() if c != 0 and key[3] > 1]
        if open_:
            pivot = max(open_, key=lambda key: (key[3], key))
            c = rest.pop(pivot)
            pivots.append((pivot, {key: -value / c for key, value in rest.items() if value != 0}))
    chosen = {key for key, _ in pivots}
    free = {key: place for key, place in places.items() if key[3] > 1 and key not in chosen}
    return free, pivots[::-1]


def _sums(values: Sequence[Fraction], count: int) -> list[Fraction]:
    """Sums of the first 1, 2, … values over their count: ordinates of the integral."""
    found, total = [], Fraction(0)
    for value in values:
        total += value / count
        found.append(total)
    return found


def _row(own: dict[int, Fraction], right: Fraction) -> Row:
    return own, right


def _dot_gradient(i: int, j: int, d: tuple[Fraction, Fraction]) -> dict[int, Fraction]:
    """d·(∇Φ_j − ∇Φ_i) as a row."""
    parts = {3 * j + 1: d[0], 3 * j + 2: d[1], 3 * i + 1: -d[0], 3 * i + 2: -d[1]}
    return {column: value for column, value in parts.items() if value != 0}


def _solved(rows: Sequence[Row], values: list[Fraction]) -> list[Fraction]:
    """Values nearest at hand for which the rows hold exactly: the last one of each row follows from the others."""
    pivots: dict[int, Row] = {}
    order: list[int] = []
    for row, right in rows:
        rest = dict(row)
        while True:
            hit = next((column for column in rest if column in pivots), None)
            if hit is None:
                break
            c = rest.pop(hit)
            parts, constant = pivots[hit]
            right -= c * constant
            for column, value in parts.items():
                rest[column] = rest.get(column, Fraction(0)) + c * value
                if rest[column] == 0:
                    del rest[column]
        if not rest:
            if right != 0:
                raise SolveError("proof: the loads are in balance up to rounding only: they cannot be stated exactly")
            continue
        pivot = max(
            rest, key=lambda column: (abs(float(rest[column])) > 0.5 * max(map(abs, map(float, rest.values()))), column)
        )
        c = rest.pop(pivot)
        pivots[pivot] = ({column: -value / c for column, value in rest.items()}, right / c)
        order.append(pivot)
    for pivot in reversed(order):
        parts, constant = pivots[pivot]
        values[pivot] = constant + sum((c * values[column] for column, c in parts.items()), Fraction(0))
    return values


def _less(u: Sequence[Fraction], v: Sequence[Fraction]) -> tuple[Fraction, Fraction]:
    return u[0] - v[0], u[1] - v[1]


def _dot(u: Sequence[Fraction], v: Sequence[Fraction]) -> Fraction:
    return u[0] * v[0] + u[1] * v[1]
