"""The numbers that refinements and derivatives are for, by name: forces, motions, stresses, slip, energies."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Final, TypeAlias

import numpy as np
from numpy.polynomial import Polynomial

from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.units import Units
from qvi_contact.discretization.loads import potential_at
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import Edges, frames_along, points_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import COMPONENTS, cell_factors, held_along_z, stress_component, stress_in_cells
from solvers.basics.names import known_name

Quantity: TypeAlias = str | Callable[[ContactResult], float]

_FORCES: Final = ("normal_force", "tangential_force")
_PLATE_FORCES: Final = {"force_x": "x", "force_y": "y", "moment": "moment"}
_MOTIONS: Final = ("x", "y", "rotation")
_ENERGIES: Final = ("energy", "dissipation")
_UNITS: Final = {
    **dict.fromkeys(_ENERGIES, "engineering_energy"),
    "moment": "engineering_moment",
    **dict.fromkeys(("x", "y", "slip"), "displacement"),
    "rotation": "",
    **dict.fromkeys((*COMPONENTS, "pressure"), "stress"),
}
"""Which of the `Units` kinds of numbers are in, all but forces."""

_SMALL: Final = 1e-6  # of the problem's unit: numbers below count as this for relative errors
_ON: Final = 1e-6  # of the body's length: distance from a contact that is rounding
_LOOK: Final = np.linspace(0.0, 1.0, 33)  # places along an edge where extremes are looked for
_STEPS: Final = 4  # of Newton's method towards a point on an arc


@dataclass(frozen=True)
class Measure:
    """A quantity: how it is computed, and what is known of it."""

    name: str  # see `refine`
    value: Callable[[ContactResult], float]  # the number
    kind: str = ""  # such as "normal_force", "slip" or "von_mises"; empty for a function
    point: bool = False  # whether it is that of a point given by its coordinates

    def unit(self, result: ContactResult, value: float) -> float:
        """What the error of its value is relative to."""
        if self.kind == "energy":
            return result.energies.strain
        scales = result.discretization.scales
        force = scales.stress * scales.length
        sizes = {
            "engineering_energy": scales.energy,
            "engineering_moment": force * scales.length,
            "displacement": scales.displacement,
            "": scales.displacement / scales.length,
            "stress": scales.stress,
        }
        size = sizes.get(_UNITS.get(self.kind, ""), force) if self.kind else 0.0
        return max(abs(value), _SMALL * size)

    @property
    def bounded(self) -> bool:
        """Whether a bracket may bound it."""
        return self.kind in ("energy", *_FORCES, *_PLATE_FORCES, *_MOTIONS)

    @property
    def of_a_force(self) -> bool:
        """Whether it is the force of a contact, which may have bounds where contacts slip."""
        return self.kind in _FORCES

    @property
    def linear(self) -> bool:
        """Whether it is an affine function of stresses and multipliers."""
        at_point = self.point and self.kind in ("xx", "yy", "xy", "slip")
        return at_point or (self.bounded and self.kind != "energy")

    @classmethod
    def of(cls, problem: ContactProblem, quantity: Quantity) -> Measure:
        """The measure that `refine` calls by this name, or a function; `InputError` if there is none."""
        if not isinstance(quantity, str):
            if not callable(quantity):
                raise InputError("quantity", quantity, "give a name or a function of a ContactResult")
            name = getattr(quantity, "__name__", "quantity")
            return cls(name, lambda result: float(quantity(result)))
        called, point = _with_point(quantity)
        own, _, kind = called.rpartition(".")
        sign, _, component = kind.partition("_")
        plates = {contact.name for contact in problem.contacts if contact.plate is not None}
        lines = {contact.name: contact.edges for contact in problem.contacts}
        if component != "pressure":
            lines = {name: name for name in (*problem.mesh.edge_names, *problem.mesh.joint_names)} | lines
        if own in lines and sign in ("largest", "smallest") and component in (*COMPONENTS, "pressure"):
            value = partial(_extreme, edges=lines[own], component=component, sign=1.0 if sign == "largest" else -1.0)
            return cls(quantity, value, component)
        known = [*_ENERGIES, *(f"{name}(x, y)" for name in COMPONENTS)]
        for contact in problem.contacts:
            kinds = [*_FORCES, "largest_pressure", "slip(x, y)"]
            kinds += [*_PLATE_FORCES, *_MOTIONS] if contact.name in plates else []
            known += [f"{contact.name}.{kind}" for kind in kinds]
        extremes = f"largest or smallest along edges, as in {next(iter(lines), 'EDGES')}.largest_von_mises"
        known_name("quantity", quantity if point is None else f"{called}(x, y)", {"numbers": known}, extremes)
        if point is None:
            return cls(quantity, lambda result: _number(result, own, kind), kind)
        if kind == "slip":
            _place_on(problem.mesh, problem.mesh.edges(lines[own]), point)  # or an error
            return cls(quantity, partial(_slip, name=own, point=point), kind, point=True)
        if not len(problem.mesh.around(point[None])[1]):
            raise InputError("quantity", quantity, "give a point inside the body")
        return cls(quantity, partial(_stress, component=kind, point=point), kind, point=True)


def unit_of(quantity: str, units: Units) -> str:
    """The unit of a quantity of a refinement by its name, that of forces for a function."""
    kind = quantity.partition("(")[0].rpartition(".")[2]
    chosen = _UNITS.get(kind.removeprefix("largest_").removeprefix("smallest_"), "engineering_force")
    return str(getattr(units, chosen)) if chosen else "rad"


def _with_point(quantity: str) -> tuple[str, FloatArray | None]:
    """The name and the point of "NAME(x, y)"."""
    called, _, numbers = quantity.removesuffix(")").partition("(")
    if not quantity.endswith(")"):
        return quantity, None
    with suppress(ValueError):
        point = np.array([float(number) for number in numbers.split(",")])
        if len(point) == 2 and np.isfinite(point).all():
            return called.strip(), point
    raise InputError("quantity", quantity, f"give the coordinates of a point, as in {called}(0.5, 1.0)")


def _number(result: ContactResult, own: str, kind: str) -> float:
    """An energy, or a force or motion on a contact."""
    if kind in _ENERGIES:
        return float(result.energies.complementary if kind == "energy" else result.energies.dissipation)
    if kind in _FORCES:
        return float(getattr(result.contacts[own], kind))
    if kind in _PLATE_FORCES:
        return float(getattr(result.plate_force(own), _PLATE_FORCES[kind]))
    return float(getattr(result.plates[own], kind))


def _stress(result: ContactResult, component: str, point: FloatArray) -> float:
    """A stress at a point, between cells that of the mean."""
    problem, cells = result.problem, result.problem.mesh.locate(point[None])
    held = held_along_z(problem, cells, *point[:, None])
    stress = result.stress(*point[:, None])
    return float(stress_component(stress, component, cell_factors(problem)[cells], held)[0])


def _slip(result: ContactResult, name: str, point: FloatArray) -> float:
    """The slip at a point of a contact: the polynomial through the Gauss points of its edge."""
    points = next(rows.points for rows in result.discretization.contacts if rows.name == name)
    number, t = _place_on(result.problem.mesh, points.edges, point)
    slip = result.contacts[name].slip.reshape(-1, points.count)[number]
    return float(Polynomial.fit(points.reference, slip, points.count - 1, domain=[0.0, 1.0])(t))


def _place_on(mesh: TriangleMesh, edges: Edges, point: FloatArray) -> tuple[int, float]:
    """The edge nearest to a point of a contact, and the coordinate on it, 0 to 1."""
    apart = points_along(mesh.vertices, edges, _LOOK) - point
    number, k = np.unravel_index(np.argmin(np.hypot(*np.moveaxis(apart, -1, 0))), apart.shape[:2])
    edge, t = edges.take(np.array([number])), float(_LOOK[k])
    length = float(np.hypot(*(mesh.vertices[edge.second] - mesh.vertices[edge.first])[0]) * edge.stretch[0])
    for _ in range(_STEPS):
        away = point - points_along(mesh.vertices, edge, np.array([t]))[0, 0]
        t = min(max(t + float(away @ frames_along(edge, np.array([t]))[1][0, 0]) / length, 0.0), 1.0)
    if np.hypot(*(points_along(mesh.vertices, edge, np.array([t]))[0, 0] - point)) > _ON * mesh.length:
        raise InputError("quantity", tuple(point.tolist()), "give a point on the contact")
    return int(number), t


def _extreme(result: ContactResult, edges: str, component: str, sign: float) -> float:
    """The largest or smallest stress along edges, on both sides of joints, or pressure on them.

    A parabola goes through the largest of the values looked at and its neighbours on that edge.
    """
    problem, discretization = result.problem, result.discretization
    mesh, space, scales = problem.mesh, discretization.space, discretization.scales
    chosen = mesh.edges(edges)
    if component == "pressure":
        points = points_along(space.vertices, chosen, _LOOK)
        normal = space.tractions(result.dofs, chosen, _LOOK)[0].reshape(points.shape[:2])
        values = -scales.stress * (normal + potential_at(problem, scales, points))
    else:
        cells = chosen.cells.T.ravel()
        places = np.tile(np.stack(mesh.points_along(chosen, _LOOK), axis=-1), (2, 1, 1))[cells >= 0]
        cells = cells[cells >= 0]
        at = mesh.reference(np.repeat(cells, len(_LOOK)), places.reshape(-1, 2)).reshape(len(cells), len(_LOOK), -1)
        stress = scales.stress * stress_in_cells(discretization, discretization.coefficients(result.dofs), cells, at)[1]
        x, y = np.moveaxis(places, -1, 0)
        factor, held = cell_factors(problem)[cells][:, None], held_along_z(problem, cells, x, y)
        values = stress_component(stress, component, factor, held)
    number, k = np.unravel_index(np.argmax(sign * values), values.shape)
    value = float(values[number, k])
    if 0 < k < len(_LOOK) - 1:
        before, after = values[number, [k - 1, k + 1]]
        bend = before - 2.0 * value + after
        value -= float((after - before) ** 2 / (8.0 * bend)) if bend != 0.0 else 0.0
    return value
