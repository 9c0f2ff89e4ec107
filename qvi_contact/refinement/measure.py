"""Numbers of results by name, for refinements: forces, motions, stresses, slip, energies; and their derivatives.

Data enter (D2) linearly; moduli and stiffnesses enter by their compliance, divided by a factor. So the direction in
which loads, bounds and energies change follows from a second problem, in which the datum is larger by a step.

In `docs/theory.md`: (D34).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.polynomial import Polynomial

from qvi_contact.basics.checks import FloatArray, finite_number
from qvi_contact.basics.schema import WithFields
from qvi_contact.discretization.loads import potential_at
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError, SolveError
from qvi_contact.limit.conic import ConicProgram
from qvi_contact.limit.load_factor import LimitProblem, checked_loads, loads_of, multiplied
from qvi_contact.limit.stresses import StressProgram, both_signs
from qvi_contact.mesh.edges import Edges, frames_along, points_along, shares_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import SHEAR_LAW, SPRINGS, Contact, Displacement, components
from qvi_contact.problem.fields import plus
from qvi_contact.problem.material import stress_along_z
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import COMPONENTS, stress_at, stress_component, stress_in_cells
from qvi_contact.units import Rounding, Units
from solvers.derivative import change
from solvers.errors import known_name

Quantity: TypeAlias = str | Callable[[ContactResult], float]

FORCES: Final = ("normal_force", "tangential_force")
PLATE_FORCES: Final = {"force_x": "x", "force_y": "y", "moment": "moment"}
_MOTIONS: Final = ("x", "y", "rotation")
_ENERGIES: Final = ("energy", "dissipation")
_UNITS: Final = {
    **dict.fromkeys(_ENERGIES, "energy"),
    "moment": "moment",
    **dict.fromkeys(("x", "y", "slip"), "displacement"),
    "rotation": "rotation",
    **dict.fromkeys((*COMPONENTS, "pressure"), "stress"),
}
"""Units of the kinds of numbers, by their names in `Units`; all other kinds are forces."""

_SMALL: Final = 1e-6  # of the problem's unit: least reference of relative errors
_ON: Final = 1e-6  # of the body's length: distance from a contact that is rounding
_LOOK: Final = np.linspace(1e-9, 1.0 - 1e-9, 33)  # samples on an edge for extremes, not at vertices
_SMOOTH: Final = 0.9  # cosine of the angle between tangents below which a contact has a kink


@dataclass(frozen=True)
class Measure:
    """A quantity: how it is computed, and of which kind it is."""

    name: str  # see `refine`
    value: Callable[[ContactResult], float]  # the number
    kind: str = ""  # such as "normal_force", "slip" or "von_mises"; empty for a function
    point: FloatArray | None = None  # (2,), if it belongs to a point given by its coordinates

    def unit(self, result: ContactResult, value: float) -> float:
        """The reference of its relative error."""
        if self.kind == "energy":
            return result.energies.strain
        scales = result.discretization.scales
        least = Rounding.of(scales.stress, scales.displacement, scales.length, _SMALL)
        return max(abs(value), getattr(least, _UNITS.get(self.kind, "force")) if self.kind else 0.0)

    @property
    def alone(self) -> bool:
        """Whether there are no numbers `beside` it."""
        return self.kind != "tangential_force" and (self.point is None or self.kind not in COMPONENTS)

    def beside(self, result: ContactResult) -> FloatArray:
        """Numbers that err by about as much, times a share: half of all stresses at a point; ¼ of the normal force."""
        if self.point is None:
            return np.array([0.25 * result.contacts[self.name.rpartition(".")[0]].normal_force])
        return 0.5 * np.sqrt([1.0, 1.0, 2.0]) * stress_at(result.discretization, result.dofs, *self.point)[:3]

    @classmethod
    def of(cls, problem: ContactProblem, quantity: Quantity) -> Measure:
        """The measure with a name of `refine`, or of a function; `InputError` if there is no such name."""
        if not isinstance(quantity, str):
            if not callable(quantity):
                raise InputError("quantity", quantity, "give a name or a function of a ContactResult")
            name = getattr(quantity, "__name__", "quantity")
            return cls(name, lambda result: finite_number("quantity", np.asarray(quantity(result))[()]))
        base_name, point = _with_point(quantity)
        owner, _, kind = base_name.rpartition(".")
        which, _, component = kind.partition("_")
        plates = {contact.name for contact in problem.contacts if contact.plate is not None}
        lines = {contact.name: contact.edges for contact in problem.contacts}
        if component != "pressure":
            lines = {name: name for name in (*problem.mesh.edge_names, *problem.mesh.joint_names)} | lines
        if owner in lines and which in ("largest", "smallest") and component in (*COMPONENTS, "pressure"):
            value = partial(_extreme, edges=lines[owner], component=component, sign=1.0 if which == "largest" else -1.0)
            return cls(quantity, value, component)
        names = [*_ENERGIES, *(f"{name}(x, y)" for name in COMPONENTS)]
        for contact in problem.contacts:
            kinds = [*FORCES, "largest_pressure", "slip(x, y)"]
            kinds += [*PLATE_FORCES, *_MOTIONS] if contact.name in plates else []
            names += [f"{contact.name}.{kind}" for kind in kinds]
        extremes = f"largest or smallest along edges, as in {next(iter(lines), 'EDGES')}.largest_von_mises"
        known_name("quantity", quantity if point is None else f"{base_name}(x, y)", {"numbers": names}, extremes)
        if point is None:
            return cls(quantity, lambda result: _number(result, owner, kind), kind)
        if kind == "slip":
            _places_on(problem.mesh, problem.mesh.edges(lines[owner]), point)  # or an error
            return cls(quantity, partial(_slip, name=owner, point=point), kind, point)
        cell = problem.mesh.around(point[None])[1][:1]
        if not len(cell):
            raise InputError("quantity", quantity, "give a point inside the body")
        t = problem.mesh.reference(cell, point[None]).clip(0.0)  # rounding may put a point outside of finer triangles
        point = (problem.mesh.placed(cell, t / t.sum()) @ problem.mesh.corners[cell[0]]).ravel()
        return cls(quantity, partial(_stress, component=kind, point=point), kind, point)


def unit_of(quantity: str, units: Units) -> str:
    """The unit of a quantity with this name; for a function the unit of forces."""
    kind = quantity.partition("(")[0].rpartition(".")[2]
    return str(getattr(units, _UNITS.get(kind.removeprefix("largest_").removeprefix("smallest_"), "force")))


def _with_point(quantity: str) -> tuple[str, FloatArray | None]:
    """The name and the point of "NAME(x, y)"; None without a point."""
    called, _, numbers = quantity.removesuffix(")").partition("(")
    if not quantity.endswith(")"):
        return quantity, None
    with suppress(ValueError):
        point = np.array([float(number) for number in numbers.split(",")])
        if len(point) == 2 and np.isfinite(point).all():
            return called.strip(), point
    raise InputError("quantity", quantity, f"give the coordinates of a point, as in {called}(0.5, 1.0)")


def _number(result: ContactResult, owner: str, kind: str) -> float:
    """An energy, or a force or motion on a contact."""
    if kind in _ENERGIES:
        return float(result.energies.complementary if kind == "energy" else result.energies.dissipation)
    if kind in FORCES:
        return float(getattr(result.contacts[owner], kind))
    if kind in PLATE_FORCES:
        return float(getattr(result.plate_force(owner), PLATE_FORCES[kind]))
    return float(getattr(result.plates[owner], kind))


def _stress(result: ContactResult, component: str, point: FloatArray) -> float:
    """A stress at a point; where cells meet, of their mean stress."""
    stress = stress_at(result.discretization, result.dofs, *point)
    return float(stress_component(stress[:3], component, float(stress[3])))


def _slip(result: ContactResult, name: str, point: FloatArray) -> float:
    """The slip at a point of a contact, by polynomials through the points of edges; the mean over the edges there."""
    points = next(rows.points for rows in result.discretization.contacts if rows.name == name)
    slip = result.contacts[name].slip.reshape(-1, points.count)
    values = (
        Polynomial.fit(points.reference, slip[number], points.count - 1, domain=[0.0, 1.0])(t)
        for number, t in _places_on(result.problem.mesh, points.edges, point)
    )
    return float(np.mean(list(values)))


def _places_on(mesh: TriangleMesh, edges: Edges, point: FloatArray) -> list[tuple[int, float]]:
    """The edges that hold a point of a contact, with the coordinate on each, 0 to 1.

    At a vertex these are both edges if the contact is smooth there, at a kink the edge of lower number.
    """
    first, second = mesh.vertices[edges.first], mesh.vertices[edges.second]
    t = shares_along(second - first, edges.bend, point - first).clip(0.0, 1.0)
    offset = points_along(mesh.vertices, edges, t[:, None])[:, 0] - point
    near = np.flatnonzero(np.hypot(*offset.T) <= _ON * mesh.length)
    if not len(near):
        raise InputError("quantity", tuple(point.tolist()), "give a point on the contact")
    tangents = frames_along(edges, t[:, None])[1][near, 0]
    is_smooth = tangents @ tangents[0] >= _SMOOTH
    return list(zip(near[is_smooth].tolist(), t[near[is_smooth]].tolist(), strict=True))


def _extreme(result: ContactResult, edges: str, component: str, sign: float) -> float:
    """The largest (sign 1) or smallest (−1) stress along edges, on both sides of joints, or pressure on them.

    A parabola goes through the extreme of the sampled values and its neighbours on the edge.
    """
    problem, discretization = result.problem, result.discretization
    mesh, space, scales = problem.mesh, discretization.space, discretization.scales
    line = mesh.edges(edges)
    if component == "pressure":
        points = points_along(space.vertices, line, _LOOK)
        normal = space.tractions(result.dofs, line, _LOOK)[0].reshape(points.shape[:2])
        values = -scales.stress * (normal + potential_at(problem, scales, points))
    else:
        side, edge = (line.cells.T >= 0).nonzero()
        cells, line = line.cells[edge, side], line.take(edge)
        corners, t = mesh.cells[cells, None], _LOOK[:, None]  # coordinates of places lose digits far from the origin
        at = (corners == line.first[:, None, None]) * (1.0 - t) + (corners == line.second[:, None, None]) * t
        stress = scales.stress * stress_in_cells(discretization, result.dofs, cells, at)[1]
        along_z = stress_along_z(problem, cells, *mesh.points_along(line, _LOOK), stress)
        values = stress_component(stress, component, along_z)
    row, k = np.unravel_index(np.argmax(sign * values), values.shape)
    value = float(values[row, k])
    if 0 < k < len(_LOOK) - 1:
        before, after = values[row, [k - 1, k + 1]]
        curvature = before - 2.0 * value + after
        value -= float((after - before) ** 2 / (8.0 * curvature)) if curvature != 0.0 else 0.0
    return value


# derivatives

Side: TypeAlias = Literal["above", "below"]
"""The side from which a parameter approaches its value."""

_AGREE: Final = 1e-6  # relative difference of one-sided derivatives up to which they agree
_NEXT: Final = 1e-7  # of a datum: step between two programs whose rows are subtracted
_CLOSED: Final = 1e-5  # largest relative gap to the bound by multipliers, with what these miss of their equations
_NEAR: Final = 1e-3  # of a datum: steps to either side from which one-sided derivatives are extrapolated
_SAME: Final = 1e-4  # relative difference up to which these extrapolated derivatives agree


def derivative(result: ContactResult, quantity: str, parameter: str, side: Side | None = None) -> float:
    """See `ContactResult.derivative`."""
    if not result.certificate.passed:
        raise InputError("result", result.status.value, "has no derivatives: give a solved result")
    _check_side(side)
    measure = Measure.of(result.problem, quantity)
    at_point = measure.point is not None and measure.kind in ("xx", "yy", "xy", "slip")
    if not at_point and measure.kind not in (*FORCES, *PLATE_FORCES, *_MOTIONS):  # no affine function of the solution
        remedy = "give a force, a motion of a plate, or at a point NAME.slip(x, y), xx(x, y), yy(x, y) or xy(x, y)"
        raise InputError("quantity", quantity, remedy)
    discretization = result.discretization
    datum = _datum(result.problem, discretization.scales, parameter)
    base = discretization.with_data(discretization.problem, discretization.scales)
    moved = discretization.with_data(datum.moved(1.0), discretization.scales)
    if moved.qvi.A.shape != base.qvi.A.shape or moved.qvi.n != base.qvi.n:
        raise InputError("parameter", parameter, "a step adds or removes unknowns: give the load a value first")
    value, solution = measure.value, result.solution
    moved_result, base_result = (ContactResult(each, replace(solution, problem=each.qvi)) for each in (moved, base))
    direct_change = value(moved_result) - value(base_result)

    def one_sided(sign: float) -> tuple[float, bool]:
        direction = change(solution, base.qvi, moved.qvi, sign)
        next_solution = replace(
            solution, z=solution.z + direction.z, normal_multiplier=solution.normal_multiplier + direction.normal,
            tangential_multiplier=solution.tangential_multiplier + direction.tangential,
            equality_multiplier=solution.equality_multiplier + direction.equality,
        )  # fmt: skip
        difference = value(ContactResult(discretization, next_solution)) - value(result)
        return (difference * sign + direct_change) / datum.unit, direction.changes_state

    above, changes = one_sided(1.0)
    if not changes or side == "above":
        return above
    below, _ = one_sided(-1.0)
    if side == "below" or abs(above - below) <= _AGREE * max(abs(above), abs(below)):
        return below
    raise _sides_differ("a point changes its state", below, above)


def _check_side(side: object) -> None:
    if side not in (None, "above", "below"):
        raise InputError("side", side, "give 'above' or 'below', or leave it out")


def _sides_differ(why: str, below: float, above: float) -> InputError:
    remedy = f"the derivative is {below:.6g} from below and {above:.6g} from above; ask for one of them"
    return InputError("side", None, f"{why} here: {remedy}")


_Path: TypeAlias = tuple[str | int, ...]
"""Fields, and indices of lists, that lead from a problem to a datum; ("load", NAME) is the factor of a load."""


def _paths(problem: ContactProblem, *, limit: bool = False) -> Iterator[tuple[str, _Path]]:
    """All data by name, with their paths; only those of limit loads if `limit`."""
    for number, condition in enumerate(problem.conditions):
        start = "conditions", number
        if isinstance(condition, Contact):
            names = [] if condition.law == "tied" else [*SHEAR_LAW]
            of_plate: list[str] = []
            if not limit:
                names += ["gap", "offset", *(name for name in SPRINGS if not callable(getattr(condition, name)))]
                of_plate += [*_MOTIONS, *PLATE_FORCES]
            paths: list[_Path] = [(name,) for name in names if getattr(condition, name) is not None]
            paths += [("plate", name) for name in of_plate if getattr(condition.plate, name, None) is not None]
            yield from ((f"{condition.name}.{path[-1]}", (*start, *path)) for path in paths)
        elif isinstance(condition, Displacement) and not limit:
            yield from ((f"{condition.edges}.{name}", (*start, name)) for name in components(condition))
    yield from ((f"load.{name}", ("load", name)) for name in loads_of(problem))
    if any(material.expansion for material in problem.materials) and not limit:
        yield "temperature", ("temperature",)
        for number, region in enumerate(problem.regions):
            if region.name is not None and region.temperature is not None:
                yield f"{region.name}.temperature", ("regions", number, "temperature")
    materials: list[tuple[str, _Path]] = [("material", ("material",))]  # of the body, and of regions with a name
    materials += [(each.name, ("regions", k, "material")) for k, each in enumerate(problem.regions) if each.name]
    for title, place in materials:
        inner: list[_Path] = [("young",)]
        if limit:
            strength = _at(problem, place).strength
            names_of_strength = () if strength is None else (each.name for each in fields(strength))
            inner = [("strength", name) for name in names_of_strength if getattr(strength, name) is not None]
        yield from ((f"{title}.{path[-1]}", (*place, *path)) for path in inner)


def _at(part: Any, path: _Path) -> Any:
    """The part of a problem at the end of a path."""
    for place in path:
        part = part[place] if isinstance(place, int) else getattr(part, place)
    return part


def _with(part: Any, path: _Path, value: Any) -> Any:
    """The part with another value at the end of a path."""
    place, *rest = path
    if rest:
        value = _with(_at(part, (place,)), tuple(rest), value)
    return [*part[:place], value, *part[place + 1 :]] if isinstance(place, int) else replace(part, **{place: value})


class _Datum(NamedTuple):
    """The problem with a datum larger by a number of units, the unit, and whether the datum is 0 and has no less.

    One more unit of a modulus doubles the compliance: the unit is the negative modulus.
    """

    moved: Callable[[float], ContactProblem]
    unit: float
    least: bool


def _datum(problem: ContactProblem, scales: Scales, parameter: str, *, limit: bool = False) -> _Datum:
    """The datum of a name. Its unit is its own size in limit loads; temperatures have the unit of thermal stress 1."""
    paths = dict(_paths(problem, limit=limit))
    path = paths[known_name("parameter", parameter, {"parameters": paths})]
    name = str(path[-1])
    if path[0] == "load":
        return _Datum(lambda step: multiplied(problem, [name], 1.0 + step), 1.0, least=False)
    value = _at(problem, path)
    if name == "young" or name in SPRINGS:
        return _Datum(lambda step: _with(problem, path, value / (1.0 + step)), -value, least=False)
    force, length = scales.stress * scales.length, scales.displacement
    expansion = max(abs(each.expansion) for each in problem.materials) or 1.0
    units = {  # all others have the unit of stress
        **dict.fromkeys(("friction", "phi"), 1.0),
        **dict.fromkeys(("gap", "offset", "x", "y", "normal", "tangential"), length),
        **dict.fromkeys(("force_x", "force_y"), force),
        "moment": force * scales.length,
        "rotation": length / scales.length,
        "temperature": scales.stress * scales.compliance / expansion,
    }
    unit = units.get(name, scales.stress)
    is_number = not callable(value)
    if limit and is_number:
        unit = abs(value) or unit

    return _Datum(lambda step: _with(problem, path, plus(value, step * unit)), unit, is_number and value == 0.0)


@dataclass(frozen=True)
class LimitFactor(WithFields):
    """The quantity of a limit analysis: the largest multiple of loads that contacts and bodies can carry."""

    loads: Sequence[str]
    """Names of the loads to multiply, see `limit_load_factor`."""

    def derivative(self, problem: ContactProblem, parameter: str, side: Side | None = None) -> float:
        """By how much the factor grows with a datum of the problem [1/unit of the datum].

            LimitFactor(["drag"]).derivative(problem, "ground.friction")

        This is the derivative of `LimitLoad.lower`, the factor of the mesh, and of the body's factor where both sides
        agree. It follows from the multipliers of the program; `SolveError` if these are not found. `InputError` if
        there is no such name or no finite factor, if the derivatives from both sides differ, or if bilateral contacts
        have friction.

        Parameters
        ----------
        problem : ContactProblem
            The problem.
        parameter : str
            "NAME.friction" and other bounds of the shear of a contact; "load.NAME", the factor of a load; "material.c"
            and other strengths, "NAME.phi" of a region. A function grows by the same number everywhere.
        side : "above" or "below", optional
            Needed where another mechanism begins within 0.2 % of this value, so that the derivatives from both sides
            differ; they are good to about five digits. A datum that is zero has only the derivative from above.

        """
        analysis = LimitProblem.of(problem, checked_loads(problem, self.loads))
        if both_signs(analysis.low).any():
            raise InputError(
                "problem", "bilateral", "the friction of bilateral contacts has no derivative: leave it out"
            )
        _check_side(side)
        datum = _datum(problem, analysis.low.scales, parameter, limit=True)
        unit = datum.unit

        def program(step: float) -> ConicProgram:
            low, high = (multiplied(datum.moved(step), analysis.names, factor) for factor in (1.0, 2.0))
            first = analysis.low.with_data(low, analysis.low.scales)
            return StressProgram(first, first.with_data(high, analysis.low.scales)).program()

        def at(step: float) -> float:
            base, next_program = program(step), program(step + _NEXT)
            answer = base.at_vertex() or base.solve()
            if isinstance(answer, str):
                remedy = "have no finite limit, and no derivative of it: name loads that are limited"
                raise InputError("loads", ", ".join(analysis.names), remedy)
            value = float(base.q @ answer.x)
            if not abs(value - answer.least) <= _CLOSED * abs(value):
                remedy = "the solver does not find its multipliers; compare factors of limit_load_factor at two values"
                raise SolveError(f"derivative by {parameter}: {remedy}")
            change_of_rows = next_program.b - base.b - (next_program.A @ answer.x - base.A @ answer.x)
            return float(answer.multipliers @ change_of_rows) / (_NEXT * unit)

        above = 2.0 * at(_NEAR) - at(2.0 * _NEAR)
        if datum.least or side == "above":
            return above
        below = 2.0 * at(-_NEAR) - at(-2.0 * _NEAR)
        if side == "below":
            return below
        if abs(above - below) <= _SAME * max(abs(above), abs(below), 1e-3 / unit):
            return at(0.0)
        raise _sides_differ("another mechanism begins", below, above)
