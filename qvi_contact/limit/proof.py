"""Proof files in rational numbers, for a checker that trusts nothing of this package: statement and lower bound.

Rounding breaks the smoothness of Φ and its tractions by some 1e-16. So Φ is built again, exactly, by `rational`:
prescribed tractions are linear equations between its values at vertices of the boundary.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.basics.writing import write_text
from qvi_contact.element import legendre
from qvi_contact.element.triangle import EDGES, exponents
from qvi_contact.errors import InputError, SolveError
from qvi_contact.limit.check_proof import check
from qvi_contact.limit.rational import Given, OutOfBalanceError, Vector, dot, less, smooth, vertex_values
from qvi_contact.limit.split import lattice, part_corners
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import CARTESIAN, Contact, Symmetry, Traction, components
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.material import Mises, MohrCoulomb, Strength
from qvi_contact.problem.problem import ContactProblem

if TYPE_CHECKING:
    from qvi_contact.limit.linear import Carried
    from qvi_contact.limit.stresses import StressProgram

_STRAIGHT: Final = "proof files are for bodies of straight triangles without holes that carry forces"
_CONSTANT: Final = "proof files need constant numbers here"
_AFFINE: Final = 1e-10  # misfit of an affine potential, and parts of it, relative, that are rounding
_KEPT_BACK: Final = 1e-6  # share of the way to a state inside that a proof keeps back for rounding


def proof_of(
    problem: ContactProblem,
    names: Sequence[str],
    degree: int,
    sides: Mapping[str, Sequence[Callable[[Statement], dict[str, Any]]]],
) -> dict[str, Any]:
    """A proof as `check_proof.check` reads it, of the sides that can be proved; "missing" says why others are not.

    Of several ways to prove a side that with the lowest bound is taken. Tractions are stated by polynomials of the
    degree.

    Raises
    ------
    InputError, SolveError
        What the first of the sides raises, if none is proved.

    """
    stated = Statement(problem, names, degree)
    about, found = stated.stated(), dict[str, tuple[Any, dict[str, Any]]]()
    errors: dict[str, InputError | SolveError] = {}
    for side, prove in ((side, prove) for side, ways in sides.items() for prove in ways):
        try:
            part = prove(stated)
            lower, upper, _ = check(about | part)
        except (InputError, SolveError) as error:
            errors.setdefault(side, error)
        except ValueError as error:
            remedy = "take a mesh that is less graded, or change the loads that are not multiplied by a millionth"
            errors.setdefault(side, SolveError(f"proof: in exact arithmetic {error}: {remedy}"))
        else:
            bound = lower if side == "lower" else upper
            if side not in found or bound < found[side][0]:
                found[side] = bound, part
    if not found:
        raise next(iter(errors.values()))
    proof = about | {"missing": {side: str(error) for side, error in errors.items() if side not in found}}
    for _, part in found.values():
        proof |= part
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
        if contact.plate is not None:
            raise InputError("Contact", contact.name, "proof files hold no plates and pins")


def law_of(problem: ContactProblem, contact: Contact) -> tuple[Fraction, Fraction, Fraction | None]:
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


class Statement:
    """A problem in rational numbers; the loads named are multiplied."""

    def __init__(self, problem: ContactProblem, names: Sequence[str], degree: int) -> None:
        _refuse(problem)
        self.problem, self.names, self.mesh, self.k = problem, tuple(names), problem.mesh, degree
        self.points: list[Vector] = [(Fraction(x), Fraction(y)) for x, y in self.mesh.vertices.tolist()]
        self.dead, self.live = self._potentials()
        self.loads: dict[tuple[int, int], list[_Load]] = {}
        for load in self._loads():
            self.loads.setdefault(load.edge, []).append(load)

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

    def _ordinates(self, edges: Edges, name: str, field: Field) -> FloatArray:
        """Of a field along edges (e, k + 1), from the first end of each to the second."""
        if not callable(field):
            return np.full((len(edges), self.k + 1), float(field))
        return along_edges(self.mesh, edges, name, field).coefficients(self.k) @ legendre.to_bernstein(self.k).T

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
                ordinates = self._ordinates(edges, f"Traction.{name}", value)
                for n in range(len(edges)):
                    i, j = int(edges.first[n]), int(edges.second[n])
                    e = less(self.points[j], self.points[i])
                    normal = (e[1], -e[0])
                    outward = 1 if dot(normal, [Fraction(x) for x in edges.normal[n].tolist()]) > 0 else -1
                    length = dot(e, e)
                    d = e if name == "tangential" else (outward * normal[0], outward * normal[1])
                    if name in CARTESIAN:
                        d = (Fraction(name == "x"), Fraction(name == "y"))
                        length = abs(e[0] + e[1]) if 0 in e else Fraction(float(edges.length[n]))
                    values = tuple(length * Fraction(float(value)) for value in ordinates[n])
                    yield _Load((i, j), d, values, live, outward)

    def stated(self) -> dict[str, Any]:
        """What both sides are about."""
        laws = [material.strength for material in self.problem.materials]
        plane = self.problem.material.plane
        numbers = self.problem.cell_materials.tolist()
        return {
            "about": "bounds of a limit load; check_proof.py says what this means, and checks it",
            "multiplied": list(self.names),
            "vertices": [[str(x), str(y)] for x, y in self.points],
            "triangles": self.mesh.cells.tolist(),
            "potential": {"dead": [str(c) for c in self.dead], "live": [str(c) for c in self.live]},
            "strengths": [[] if law is None else list(self._cones(law, plane)) for law in laws],
            "strength_of": [None if laws[number] is None else number for number in numbers],
            "loads": [load.stated() for loads in self.loads.values() for load in loads],
            "contacts": [self._contact(contact) for contact in self.problem.contacts if contact.law != "tied"],
        }

    def _cones(self, law: Strength, plane: Literal["stress", "strain"]) -> Iterator[dict[str, Any]]:
        """The cones of a strength as `check_proof` reads them."""
        if isinstance(law, MohrCoulomb) and callable(law.phi):
            law = replace(law, phi=float(_number("MohrCoulomb.phi", law.phi, *self.mesh.vertices.T)))
        for cone in law.cones(plane):
            value = _number(cone.name, cone.field, *self.mesh.vertices.T)
            found: dict[str, Any] = {"a": [str(value), "0", "0"]}
            if isinstance(law, Mises):
                found |= {"f2": "4/3", "gamma2": "1/3" if cone.mean else "0"}
            else:
                found |= {"f": str(Fraction(float(cone.factor))), "beta": str(Fraction(float(cone.pressure)))}
            yield found

    def _contact(self, contact: Contact) -> dict[str, Any]:
        """A contact as `check_proof` reads it."""
        mu, c, cap = law_of(self.problem, contact)
        fluid: dict[str, Any] = {}
        if contact.has_fluid:
            edges = self.mesh.edges(contact.edges)
            pressures = self._ordinates(edges, "Contact.pore_pressure", contact.pore_pressure)
            fluid = {"pressures": [[str(Fraction(value)) for value in edge] for edge in pressures.tolist()]}
        return fluid | {
            "name": contact.name,
            "law": contact.law,
            "friction": str(mu),
            "cohesion": str(c),
            "shear_limit": None if cap is None else str(cap),
            "edges": ends(self, contact),
        }


@dataclass(frozen=True)
class _Load:
    """Ordinates of d·σn on an edge, n outward and as long as the edge."""

    edge: tuple[int, int]
    direction: Vector
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


def carried(stated: Statement, program: StressProgram) -> dict[str, Any]:
    """The part of a proof that says what stresses of the program carry."""
    found = program.carried(_KEPT_BACK)
    if found.unknowns is None:
        raise SolveError("proof: this mesh carries no largest multiple of the loads: there is nothing to prove")
    p, factor = program.cones.degree + 2, Fraction(found.factor)
    rough, at_vertices = _rounded_airy(program, found)

    def exact(factor: Fraction) -> tuple[Given, list[Fraction]]:
        given = _second_derivatives(stated, p - 2, factor)
        return given, vertex_values(stated.points, p, given, [], at_vertices)

    try:
        try:
            given, values = exact(factor)
        except OutOfBalanceError as error:  # loads that are in balance at one factor only
            factor += _change(error.amount, exact, factor + 1)
            given, values = exact(factor)
    except OutOfBalanceError as error:
        remedy = "they cannot be stated exactly"
        raise SolveError(f"proof: the loads are in balance up to rounding only: {remedy}") from error
    airy = smooth(stated.points, stated.mesh.cells.tolist(), p, given, values, rough)
    ordinates = [[[str(value) for value in part] for part in cell] for cell in airy]
    return {"factor": str(factor), "degree": p, "airy": ordinates}


def _change(amount: Fraction, exact: Callable[[Fraction], object], more: Fraction) -> Fraction:
    """What brings loads into balance that are out of it by an amount: to be added to the factor; `more` has 1 more."""
    try:
        exact(more)
    except OutOfBalanceError as error:
        return amount / (amount - error.amount) if amount != error.amount else Fraction(0)
    return Fraction(1)


def _second_derivatives(
    stated: Statement, k: int, factor: Fraction
) -> dict[tuple[int, int], list[list[Fraction] | None]]:
    """What loads say of an edge: ordinates of n·G' and of e·G' from its first end on, or None."""
    found: dict[tuple[int, int], list[list[Fraction] | None]] = {}
    potential = [a + factor * b for a, b in zip(stated.dead, stated.live, strict=True)]
    for (i, j), loads in stated.loads.items():
        e = less(stated.points[j], stated.points[i])
        axes = normal, _ = (e[1], -e[0]), e
        places = [[x + Fraction(m, k) * d for x, d in zip(stated.points[i], e, strict=True)] for m in range(k + 1)]
        phi = [potential[0] + dot(potential[1:], place) for place in places]
        # d·G' = d·σn less the part of φ, for the normal of the edge
        right = []
        for load in loads:
            rows = [load.outward * (factor if load.live else 1) * value for value in load.values]
            right.append([a - b * dot(load.direction, normal) for a, b in zip(rows, phi, strict=True)])
        if len(loads) == 2:
            (a, b), (c, d) = (load.direction for load in loads)
            turned = [((d * u - b * v) / (a * d - b * c), (a * v - c * u) / (a * d - b * c))
                      for u, v in zip(*right, strict=True)]  # fmt: skip
            found[i, j] = [[dot(axis, value) for value in turned] for axis in axes]
            continue
        parts = [dot(axis, loads[0].direction) for axis in axes]
        if 0 not in parts:
            remedy = "on slanted edges proof files hold x and y together, or normal and tangential ones"
            raise InputError("Traction", stated.mesh.edge_names, remedy)
        found[i, j] = [None if part == 0 else [dot(axis, axis) / part * value for value in right[0]]
                       for axis, part in zip(axes, parts, strict=True)]  # fmt: skip
    for contact in stated.problem.contacts:
        mu, c, cap = law_of(stated.problem, contact)
        if (mu == c == 0 or cap == 0) and contact.law != "tied":  # a shear of exactly zero
            for i, j in ends(stated, contact):
                found[i, j] = [None, [Fraction(0)] * (k + 1)]
    return found


def ends(stated: Statement, contact: Contact) -> list[list[int]]:
    """Both vertices of the edges of a contact."""
    edges = stated.mesh.edges(contact.edges)
    pairs: list[list[int]] = np.column_stack([edges.first, edges.second]).tolist()
    return pairs


def _rounded_airy(program: StressProgram, carried: Carried) -> tuple[FloatArray, FloatArray]:
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
