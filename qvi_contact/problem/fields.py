"""Functions of position: polynomials and expressions, which files can hold; values at points; fields along edges."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, reduce
from itertools import zip_longest
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final

import numpy as np
from numpy.polynomial import polynomial

from qvi_contact.basics.checks import Field, FloatArray, IntArray, check_field, evaluate, finite_number, real_array
from qvi_contact.basics.schema import Checked, Listed, Number, WithFields
from qvi_contact.element.edge import EdgeQuadrature, adapted, constant
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import Edges, frames_along, rounding_along
from qvi_contact.mesh.files import read_point_data
from qvi_contact.mesh.triangles import TriangleMesh
from solvers.basics.types import PicklesFields
from solvers.errors import counted, one_line

_MAX_LENGTH: Final = 2000  # characters of an expression
_MAX_SHOWN: Final = 60  # characters of a part of an expression in a message
_MAX_POWERS: Final = 100  # rows, and columns, of the coefficients of a polynomial
_VARIABLES: Final = ("x", "y", "t")

FUNCTIONS: Final[Mapping[str, Any]] = MappingProxyType(
    {
        "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "exp": np.exp, "log": np.log,
        "sin": np.sin, "cos": np.cos, "tan": np.tan, "arcsin": np.arcsin, "arccos": np.arccos, "arctan": np.arctan,
        "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "hypot": np.hypot,
        "min": np.minimum, "max": np.maximum, "where": np.where,
    }
)  # fmt: skip
"""Functions that expressions may call."""

_ARGUMENTS: Final = {"hypot": 2, "min": 2, "max": 2, "where": 3}  # all others take one

_CANCELLED: Final = 8.0 * np.finfo(float).eps  # size of a sum, relative to its terms, up to which it is rounding


def _sum(one: Any, other: Any) -> Any:
    """The sum of two terms, 0 if it is rounding."""
    value = np.add(one, other)
    return np.where(np.abs(value) < _CANCELLED * np.abs(one), 0.0, value)  # infinity is not below itself


_OPERATORS: Final[Mapping[type, Any]] = {
    ast.Add: _sum, ast.Sub: lambda one, other: _sum(one, np.negative(other)),
    ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
    ast.USub: np.negative, ast.UAdd: np.positive,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
}  # fmt: skip


@dataclass(frozen=True)
class Polynomial(Checked):
    """The function Σ_ij c_ij xⁱ yʲ."""

    coefficients: Annotated[Sequence[Sequence[float]], Listed(Listed(Number(-np.inf, np.inf)))]
    """Rows i of c_ij; short rows end with zeros."""

    def __post_init__(self) -> None:
        super().__post_init__()
        rows = self.coefficients
        if not any(rows) or max(len(rows), *map(len, rows)) > _MAX_POWERS:
            remedy = f"give rows [i][j] for xⁱ yʲ with at least one number, and powers of x and y below {_MAX_POWERS}"
            raise InputError("Polynomial.coefficients", rows, remedy)

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values at (x, y)."""
        coefficients = np.array(list(zip_longest(*self.coefficients, fillvalue=0.0))).T
        return np.asarray(polynomial.polyval2d(x, y, coefficients))


def times(field: Field, factor: float) -> Field:
    """The field times a number."""
    if not callable(field):
        return factor * field
    function: Callable[[FloatArray, FloatArray], object] = field
    return lambda x, y: factor * np.asarray(function(x, y), dtype=float)


def plus(field: Field, number: float) -> Field:
    """The field and a number."""
    if not callable(field):
        return field + number
    function: Callable[[FloatArray, FloatArray], object] = field
    return lambda x, y: np.asarray(function(x, y), dtype=float) + number


@dataclass(frozen=True)
class BodyForces(WithFields, PicklesFields):
    """Several body forces by name: a potential φ = Σ φ_name [stress] whose parts limit loads and sweeps can multiply.

    `InputError` if there is no part, a name is no text or is taken, or a part is no number or function.
    """

    parts: Mapping[str, Any] = field(hash=False)
    """Number or function of (x, y) by name [stress]: ρ g y for the weight, −ρ a x for an acceleration a along x."""

    def __post_init__(self) -> None:
        if not isinstance(self.parts, Mapping) or not self.parts:
            raise InputError("BodyForces.parts", self.parts, "give a mapping from names to potentials")
        for name in self.parts:
            if not isinstance(name, str) or not name or name in ("body", "pore pressure"):
                raise InputError("BodyForces.parts", name, "give a name other than 'body', which means all of them")
        parts = {name: check_field(f"BodyForces.{name}", potential) for name, potential in self.parts.items()}
        object.__setattr__(self, "parts", MappingProxyType(parts))

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """The sum of all parts at (x, y)."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        return np.asarray(sum(evaluate(f"BodyForces.{name}", part, x, y) for name, part in self.parts.items()))


@dataclass(frozen=True)
class Expression(WithFields):
    """A function written as text, such as ``"1e6 * where(x < 0.5, x, 0.5) * sin(pi * t)"``.

    An expression never runs code. `InputError` names the part of the text that is wrong. A sum that is the rounding of
    its terms is 0, such as 0.3 - 0.1 * x at x = 3.
    """

    text: str
    """Numbers, x, y [length], t, pi, constants, + - * / **, comparisons and `FUNCTIONS`."""
    constants: Mapping[str, float] = field(default_factory=dict, hash=False, repr=False)
    """Numbers that the text uses by name."""
    t: float = field(default=0.0, repr=False)
    """Pseudo-time of a load history."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", finite_number("Expression.t", self.t))
        if not isinstance(self.constants, Mapping):
            raise InputError("Expression.constants", self.constants, "give a mapping from names to numbers")
        for name, value in self.constants.items():
            if name in (*_VARIABLES, "pi", *FUNCTIONS):
                raise InputError(f"constants.{name}", value, "is x, y, time t, pi or a function: choose another name")
        # a copy, so the caller's later changes have no effect; floats, as NumPy's integers overflow and float32 rounds
        constants = {name: finite_number(f"constants.{name}", value) for name, value in self.constants.items()}
        object.__setattr__(self, "constants", constants)
        _ = self._tree
        try:
            self(np.array([0.25, 0.75]), np.array([0.25, 0.75]))  # refuse here what cannot be evaluated
        except Exception as error:
            raise InputError("expression", self.text, f"cannot be evaluated: {error}") from error

    @cached_property
    def _tree(self) -> ast.expr:
        if not isinstance(self.text, str) or len(self.text) > _MAX_LENGTH:
            raise InputError("expression", self.text, f"give a text of at most {_MAX_LENGTH} characters")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # SyntaxWarning for texts such as 1(x), which `_value` refuses
                tree = ast.parse(self.text.strip(), mode="eval")
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            reason = getattr(error, "msg", str(error))
            raise InputError("expression", self.text, f"is not an expression in x, y and t ({reason})") from error
        return tree.body

    @property
    def names(self) -> set[str]:
        """All names in the expression: of coordinates, t, constants and functions."""
        return {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values at (x, y)."""
        names = {"x": np.asarray(x, float), "y": np.asarray(y, float), "t": self.t, "pi": np.pi, **self.constants}
        with np.errstate(all="ignore"):  # `evaluate` refuses values that are not finite
            value = _value(self._tree, names)
        return np.array(np.broadcast_to(np.asarray(value, dtype=float), np.shape(x)))


def _value(node: ast.AST, names: Mapping[str, Any]) -> Any:
    """The value of a part of an expression; `ValueError` with the part's text if it is not arithmetic."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return float(number)  # powers of Python's integers could grow without limit
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(operand, names))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in _OPERATORS for op in ops):
            sides = [_value(each, names) for each in (left, *others)]
            pairs = zip(ops, sides, sides[1:], strict=False)
            all_true = reduce(np.logical_and, [_OPERATORS[type(op)](one, other) for op, one, other in pairs])
            return np.asarray(all_true, float)  # a sum of booleans would be a boolean, a root of one half precision
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=keywords) if name in FUNCTIONS:
            n_arguments = _ARGUMENTS.get(name, 1)  # NumPy would write its result to a further argument
            if keywords or len(arguments) != n_arguments:
                raise ValueError(f"{name} takes {counted(n_arguments, 'argument')}")
            return FUNCTIONS[name](*(_value(each, names) for each in arguments))
        case ast.Call(func=function):
            raise ValueError(f"{_shown(function)} is not a known function; there are {', '.join(FUNCTIONS)}")
        case ast.Name():
            raise ValueError(f"{_shown(node)} is not a known name; there are {', '.join(names)}")
    hints = {
        ast.BitXor: "write ** for powers", ast.IfExp: "write where(condition, then, else)",
        ast.Compare: "compare by < <= > >=", ast.And: "write min(one, other)", ast.Or: "write max(one, other)",
    }  # fmt: skip
    remedy = f"{_shown(node)} is not allowed: use numbers, x, y, t, + - * / ** and functions"
    raise ValueError(hints.get(type(getattr(node, "op", node)), remedy))


def _shown(part: ast.AST) -> str:
    return one_line(ast.unparse(part), _MAX_SHOWN)


_PLACES: Final = np.array([0.25, 0.5, 0.75])  # points of an edge beside which a field is sampled
_STEP: Final = 32.0  # their distance from the edge over the rounding of coordinates: that of less could be nothing


def along_edges(
    mesh: TriangleMesh, edges: Edges, name: str, field: Field, points: int = 8, *, minimum: float | None = None
) -> EdgeQuadrature:
    """Values of a field at Gauss points of edges: `points` on each edge, or on each part of a divided edge.

    Edges are divided where the field jumps or bends. `InputError`, which calls the field by `name`, if it fails, is not
    finite or is below the minimum at a point.
    """
    if not callable(field):
        return constant(field, len(edges), points)

    def values(edge: IntArray, t: FloatArray) -> FloatArray:
        return evaluate(name, field, *mesh.points_along(edges.take(edge), t), minimum=minimum)

    rounding = rounding_along(mesh.vertices, edges)

    def noise() -> FloatArray:
        (x, y), normals = mesh.points_along(edges, _PLACES), frames_along(edges, _PLACES)[0]
        dx, dy = np.moveaxis(_STEP * (rounding * edges.length)[:, None, None] * normals, -1, 0)
        with suppress(InputError), np.errstate(all="ignore"):  # a field may have no values beside the edges
            values_beside = [evaluate(name, field, x + step * dx, y + step * dy) for step in range(-2, 3)]
            changes = np.abs(np.diff(values_beside, axis=0)).min(axis=0)  # a jump at the edge changes one step only
            return np.asarray(changes.max(axis=1) / _STEP)
        return np.zeros(len(edges))

    return adapted(values, len(edges), points, rounding, noise)


_EXTENSION: Final = 1.0  # triangles of point data are extended to points with barycentric coordinates of at least −1


@dataclass(frozen=True, eq=False)
class PointData(WithFields):
    """The function that is linear on each triangle of a mesh and has these values (v,) at the vertices.

    The mesh may differ from that of the problem. A point just outside, as between an arc and its chord, gets its value
    by extending the nearest triangle. `InputError` if there is not one finite value for each vertex, and when the
    function is called at a point far outside the triangles.
    """

    mesh: TriangleMesh
    values: FloatArray

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, TriangleMesh):
            raise InputError("PointData.mesh", self.mesh, "give a TriangleMesh")
        values = real_array("PointData.values", self.values, "give a number for each vertex")
        if values.shape != (len(self.mesh.vertices),) or not np.isfinite(values).all():
            remedy = f"give one finite number for each of the {len(self.mesh.vertices)} vertices"
            raise InputError("PointData.values", self.values, remedy)
        object.__setattr__(self, "values", values)

    @classmethod
    def load(cls, path: str | Path, name: str) -> PointData:
        """The point data of that name in a file .msh, or one that meshio reads, such as .vtu, .vtk or .med.

        Quadrilaterals are cut into two triangles. `InputError` if meshio is missing, the file cannot be read, is not
        plane or has no triangles and quadrilaterals, or has no data of that name with one number per point.
        """
        mesh, values = read_point_data(path, name)
        return cls(TriangleMesh(*mesh.given), values)

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values at (x, y) [length]."""
        points = np.column_stack([np.ravel(x), np.ravel(y)])
        cells = self.mesh.locate(points)
        outside = np.flatnonzero(cells < 0)
        outside_point, nearby_cell = self.mesh.around(points[outside], _EXTENSION)
        order = self.mesh.reference(nearby_cell, points[outside[outside_point]]).min(axis=1).argsort(kind="stable")
        cells[outside[outside_point[order]]] = nearby_cell[order]  # the last value counts: the nearest triangle
        if (cells < 0).any():
            place = tuple(points[np.argmin(cells)].tolist())
            raise InputError("PointData", place, "this point lies outside of the triangles of the data")
        weights = self.mesh.reference(cells, points)
        return np.asarray((weights * self.values[self.mesh.cells[cells]]).sum(axis=1).reshape(np.shape(x)))
