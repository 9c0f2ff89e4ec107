"""Functions of position: polynomials and expressions, which files hold; values at points; and fields on edges."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from functools import cached_property, reduce
from io import StringIO
from itertools import zip_longest
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.polynomial import polynomial

from qvi_contact.basics.checks import Field, FloatArray, IntArray, check_field, evaluate, finite_number, real_array
from qvi_contact.basics.writing import given_path, open_regular
from qvi_contact.element.edge import EdgeQuadrature, adapted, constant
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import MeshParts
from qvi_contact.mesh.edges import Edges, rounding_along
from qvi_contact.mesh.files import corners_of, triangles_of
from qvi_contact.mesh.triangles import TriangleMesh
from solvers.basics.types import PicklesFields, load
from solvers.errors import known_name

_LONGEST: Final = 2000  # characters of an expression
_MOST_POWERS: Final = 100  # of x, and of y
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

_OPERATORS: Final = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
    ast.USub: np.negative, ast.UAdd: np.positive,
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
}  # fmt: skip


@dataclass(frozen=True)
class Polynomial:
    """The function Σ_ij c_ij xⁱ yʲ.

    ``coefficients[i][j]`` is c_ij; short rows are filled up with zeros.
    """

    coefficients: Sequence[Sequence[float]]

    def __post_init__(self) -> None:
        remedy = "give rows of finite real numbers, [i][j] for xⁱ yʲ, at least one"
        try:
            table = [real_array("Polynomial", row, remedy) for row in self.coefficients]
        except TypeError as error:
            raise InputError("Polynomial", self.coefficients, remedy) from error
        if any(row.ndim != 1 or not np.isfinite(row).all() for row in table) or not any(row.size for row in table):
            raise InputError("Polynomial", self.coefficients, remedy)
        if max([len(table), *map(len, table)]) > _MOST_POWERS:
            raise InputError("Polynomial", self.coefficients, f"give powers of x and y below {_MOST_POWERS}")
        rows = tuple(tuple(row.tolist()) for row in table)
        object.__setattr__(self, "coefficients", rows)

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values at (x, y)."""
        table = np.array(list(zip_longest(*self.coefficients, fillvalue=0.0))).T
        return np.asarray(polynomial.polyval2d(x, y, table))


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
class BodyForces(PicklesFields):
    """Several body forces by name: a potential φ = Σ φ_name whose parts limit loads and sweeps can multiply.

    Parts are numbers or functions of (x, y) [stress]: weight is ρ g y, an acceleration a along x the potential −ρ a x.
    `InputError` if there is no part, a name is no text or means something already, or a part is no number or function.
    """

    parts: Mapping[str, Any] = field(hash=False)

    def __post_init__(self) -> None:
        if not isinstance(self.parts, Mapping) or not self.parts:
            raise InputError("BodyForces.parts", self.parts, "give a mapping from names to potentials")
        for name in self.parts:
            if not isinstance(name, str) or not name or name in ("body", "pore pressure"):
                raise InputError("BodyForces.parts", name, "give a name other than 'body', which means all of them")
        parts = {name: check_field(f"BodyForces.{name}", potential) for name, potential in self.parts.items()}
        object.__setattr__(self, "parts", MappingProxyType(parts))

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values at (x, y): of all parts together."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        return np.asarray(sum(evaluate(f"BodyForces.{name}", part, x, y) for name, part in self.parts.items()))


@dataclass(frozen=True)
class Expression:
    """A function written as text, such as ``"1e6 * where(x < 0.5, x, 0.5) * sin(pi * t)"``.

    It is in x, y [length], t (pseudo-time of a load history), constants by name, and ``pi``, which is always there.
    Its tree has numbers, these names, + - * / **, comparisons and the `FUNCTIONS` alone; anything else is refused, so
    an expression can never run code. `InputError` if the text is no such expression, naming the part that is wrong.
    """

    text: str
    constants: Mapping[str, float] = field(default_factory=dict, hash=False)
    t: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", finite_number("Expression.t", self.t))
        if not isinstance(self.constants, Mapping):
            raise InputError("Expression.constants", self.constants, "give a mapping from names to numbers")
        for name, value in self.constants.items():
            if name in (*_VARIABLES, "pi", *FUNCTIONS):
                raise InputError(f"constants.{name}", value, "this name means something already: choose another one")
        # a copy, which later changes of the caller's do not reach; NumPy's numbers have limits, or fewer digits
        constants = {name: finite_number(f"constants.{name}", value) for name, value in self.constants.items()}
        object.__setattr__(self, "constants", constants)
        _ = self._tree
        try:
            self(np.array([0.25, 0.75]), np.array([0.25, 0.75]))  # all of it, so that a bad text is refused here
        except Exception as error:
            raise InputError("expression", self.text, f"cannot be evaluated: {error}") from error

    @cached_property
    def _tree(self) -> ast.expr:
        if not isinstance(self.text, str) or len(self.text) > _LONGEST:
            raise InputError("expression", self.text, f"give a text of at most {_LONGEST} characters")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # such as for 1(x): refused below
                tree = ast.parse(self.text.strip(), mode="eval")
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            told = getattr(error, "msg", str(error))
            raise InputError("expression", self.text, f"is not an expression in x, y and t ({told})") from error
        return tree.body

    @property
    def names(self) -> set[str]:
        """All names that occur: of coordinates, t, constants and functions."""
        return {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values at (x, y)."""
        names = {"x": np.asarray(x, float), "y": np.asarray(y, float), "t": self.t, "pi": np.pi, **self.constants}
        with np.errstate(all="ignore"):  # what is not finite is refused where it is used
            value = _value(self._tree, names)
        return np.array(np.broadcast_to(np.asarray(value, dtype=float), np.shape(x)))


def _value(node: ast.AST, names: Mapping[str, Any]) -> Any:
    """The value of a part of an expression; `ValueError`, naming it, for whatever is not arithmetic."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return float(number)  # arithmetic of whole numbers has no limit
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(operand, names))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(left, names), _value(right, names))
        case ast.Compare(left=left, ops=ops, comparators=others) if all(type(op) in _OPERATORS for op in ops):
            sides = [_value(each, names) for each in (left, *others)]
            pairs = zip(ops, sides, sides[1:], strict=False)
            holds = reduce(np.logical_and, [_OPERATORS[type(op)](one, other) for op, one, other in pairs])
            return np.asarray(holds, float)  # a sum of truths were a truth, a root of one had few digits
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=named) if name in FUNCTIONS:
            wanted = _ARGUMENTS.get(name, 1)  # more would be taken for the place to write the result to
            if named or len(arguments) != wanted:
                raise ValueError(f"{name} takes {wanted} argument{'s' if wanted > 1 else ''}")
            return FUNCTIONS[name](*(_value(each, names) for each in arguments))
        case ast.Call(func=function):
            raise ValueError(f"{ast.unparse(function)} is not a known function; there are {', '.join(FUNCTIONS)}")
        case ast.Name(id=name):
            raise ValueError(f"{name} is not a known name; there are {', '.join(names)}")
    hints = {
        ast.BitXor: "write ** for powers", ast.IfExp: "write where(condition, then, else)",
        ast.Compare: "compare by < <= > >=", ast.And: "write min(one, other)", ast.Or: "write max(one, other)",
    }  # fmt: skip
    refused = f"{ast.unparse(node)} is not allowed: use numbers, x, y, t, + - * / ** and functions"
    raise ValueError(hints.get(type(getattr(node, "op", node)), refused))


def along_edges(
    mesh: TriangleMesh, edges: Edges, name: str, field: Field, points: int = 8, *, minimum: float | None = None
) -> EdgeQuadrature:
    """A field on edges; so many Gauss points on each, or on each of its parts where the field jumps or bends.

    `InputError` if the field fails, is not finite or is below the minimum somewhere; `name` is what it is called then.
    """
    if not callable(field):
        check_field(name, field, minimum=minimum)
        return constant(field, len(edges), points)

    def values(edge: IntArray, t: FloatArray) -> FloatArray:
        return evaluate(name, field, *mesh.points_along(edges.take(edge), t), minimum=minimum)

    return adapted(values, len(edges), points, rounding_along(mesh.vertices, edges))


_BEYOND: Final = 1.0  # what their barycentric coordinates may be below 0 where they are extended


@dataclass(frozen=True, eq=False)
class PointData:
    """The function that is linear on each triangle of a mesh and has these values (v,) at the vertices.

    The mesh need not be that of the problem. Beside chords of its boundary, as along an arc, the nearest triangle is
    extended. `InputError` if there is not one finite value for each vertex; later, if a point lies far outside of the
    triangles.
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
        """The point data of that name in a file that meshio reads, such as .vtu, .vtk, .msh or .med.

        Quadrilaterals are cut in two. `InputError` if meshio is missing, the file cannot be read, has no such cells and
        no triangles, or no such data with one number a point.
        """
        path, printed, meshio = given_path("file", path), StringIO(), load("meshio")
        try:
            with open_regular(path), redirect_stderr(printed):
                read: Any = meshio.read(path)
        except FileNotFoundError as error:
            raise InputError("file", str(path), "there is no such file: correct its name or folder") from error
        except (Exception, SystemExit) as error:  # whatever a broken file makes a reader stumble over
            told = " ".join(f"{error} {printed.getvalue()}".split()) or type(error).__name__
            raise InputError("file", str(path), f"cannot be read ({told}): write the file again") from error
        data = read.point_data[known_name("data", name, {"point data": read.point_data})]
        cells = triangles_of(read.points[:, :2], corners_of(read.cells))[0]
        if not len(cells) or np.ndim(data) != 1:
            raise InputError("file", str(path), f"needs triangles, and one number a point as {name!r}")
        mesh = MeshParts(read.points[:, :2], cells).without_others()
        return cls(TriangleMesh(*mesh.given), np.asarray(data, dtype=float)[np.unique(cells)])

    def __call__(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Values at (x, y) [length]."""
        points = np.column_stack([np.ravel(x), np.ravel(y)])
        cells = self.mesh.locate(points)
        outside = np.flatnonzero(cells < 0)
        point, near = self.mesh.around(points[outside], _BEYOND)
        order = self.mesh.reference(near, points[outside[point]]).min(axis=1).argsort(kind="stable")
        cells[outside[point[order]]] = near[order]  # the triangles that they are least far from come last
        if (cells < 0).any():
            place = tuple(points[np.argmin(cells)].tolist())
            raise InputError("PointData", place, "this point lies outside of the triangles of the data")
        weights = self.mesh.reference(cells, points)
        return np.asarray((weights * self.values[self.mesh.cells[cells]]).sum(axis=1).reshape(np.shape(x)))
