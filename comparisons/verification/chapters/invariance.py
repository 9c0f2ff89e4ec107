"""Chapter on invariance: the same body described otherwise has the same answer."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from typing import Final

import numpy as np

from comparisons.verification.elements import TRIANGLES, Chapter, Element
from comparisons.verification.measures import point_states, runs, scattered
from comparisons.verification.proof import certified
from comparisons.verification.row import Row, absolute, relative, word
from qvi_contact import (
    Contact,
    ContactProblem,
    ContactResult,
    Displacement,
    Material,
    Symmetry,
    Traction,
    TriangleMesh,
)
from qvi_contact.basics.checks import FloatArray
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem.conditions import Condition

PROBLEMS: Final = Chapter()

_WIDTH, _HEIGHT, _CELLS, _GRADING, _FRICTION = 1.5, 1.0, (4, 3), 0.8, 0.12
_STEEL: Final = Material(2.09e5, 0.3)
_SIDES: Final = ("left", "bottom", "right", "top")

Map = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class _Change:
    """Another description: where points and sides go, what becomes of σ_xx, σ_yy, σ_xy, and the unit of force."""

    place: Map = lambda x, y: (x, y)
    back: Callable[[FloatArray], FloatArray] = lambda stress: stress
    force: float = 1.0
    order: int = 1
    sides: tuple[str, ...] = _SIDES


def _mirrored(stress: FloatArray) -> FloatArray:
    return np.asarray(stress * np.array([1.0, 1.0, -1.0]))


def _turned(stress: FloatArray) -> FloatArray:
    return _mirrored(stress[..., [1, 0, 2]])


@PROBLEMS.on("mirror", TRIANGLES)
def mirror_images(element: Element, _: bool) -> Iterator[Row]:
    """Left and right exchanged, and upside down."""
    left = _Change(lambda x, y: (-x, y), _mirrored, order=-1, sides=("right", "bottom", "left", "top"))
    yield from _same(element, _plate(left), left, "(x, y) → (−x, y)")
    down = _Change(lambda x, y: (x, -y), _mirrored, sides=("left", "top", "right", "bottom"))
    yield from _same(element, _plate(down), down, "(x, y) → (x, −y)")


@PROBLEMS.on("quarter-turn", TRIANGLES)
def quarter_turn(element: Element, _: bool) -> Iterator[Row]:
    """Turned by 90°: the plate touches a vertical side."""
    turned = _Change(lambda x, y: (-y, x), _turned, sides=("bottom", "right", "top", "left"))
    yield from _same(element, _plate(turned), turned, "(x, y) → (−y, x)")


@PROBLEMS.on("shift", TRIANGLES)
def far_from_the_origin(element: Element, _: bool) -> Iterator[Row]:
    """The domain shifted by 1e3 of its size."""
    change = _Change(lambda x, y: (x + 1e3, y - 1e3))
    yield from _same(element, _plate(change), change, "(x, y) → (x + 1e3, y − 1e3)")


@PROBLEMS.on("units", TRIANGLES)
def units(element: Element, _: bool) -> Iterator[Row]:
    """Metres and MPa changed to millimetres and Pa."""
    change = _Change(lambda x, y: (1e3 * x, 1e3 * y), lambda stress: stress / 1e6, force=1e9)
    other = _plate(change, Material(2.09e11, 0.3), displacement=1.0)
    yield from _same(element, other, change, "lengths times 1e3, stresses times 1e6")


@PROBLEMS.on("order", TRIANGLES)
def order_of_the_data(element: Element, _: bool) -> Iterator[Row]:
    """The same conditions listed in the opposite order."""
    problem = _plate(_Change())
    turned = ContactProblem(problem.mesh, problem.material, list(problem.conditions)[::-1])
    yield from _same(element, turned, _Change(), "conditions listed backwards")


@PROBLEMS.on("proportional-load", TRIANGLES)
def proportional_loads(element: Element, quick: bool) -> Iterator[Row]:
    """A million times more or less compression: Coulomb's law is positively homogeneous."""
    for size in (1e6,) if quick else (1e6, 1e-6):
        change = _Change(back=partial(np.multiply, 1.0 / size), force=size)
        other = _plate(change, displacement=size * 1e-3)
        yield from _same(element, other, change, f"load times {size:g}")


@PROBLEMS.on("rigid-motion", TRIANGLES)
def rigid_motion(element: Element, _: bool) -> Iterator[Row]:
    """Supports and obstacle moved together by five hundred times the compression."""
    still, moved = element.solve(_supported(0.0)), element.solve(_supported(0.5))
    proof, source = certified(still, moved), "rigid motions leave no stress"
    force, known = moved.contacts["top"].normal_force, still.contacts["top"].normal_force
    yield relative("force [stress length]", force, known, 1e-7, source, proof)
    x, y = scattered(still)
    error = float(np.abs(moved.stress(x, y) - still.stress(x, y)).max()) / 209.0
    yield absolute("largest difference of σ over E U", error, 0.0, 1e-7, source, proof)


def _original() -> ContactProblem:
    return compressed_plate(_FRICTION, _CELLS, _WIDTH, _HEIGHT, grading=_GRADING)


@cache
def _solved(element: Element) -> ContactResult:
    """What all others are compared with."""
    return element.solve(_original())


def _mesh(change: _Change) -> TriangleMesh:
    """The same triangles where the change puts them."""
    mesh = _original().mesh
    x, y = change.place(*mesh.vertices.T)
    names = dict(zip(_SIDES, change.sides, strict=True))
    sets = {names[name]: pairs for name, pairs in mesh.edge_sets.items()}
    return TriangleMesh(np.column_stack([x, y]), mesh.cells, sets)


def _plate(change: _Change, material: Material = _STEEL, displacement: float = 1e-3) -> ContactProblem:
    """The compressed plate; sides are those of (symmetry, symmetry, free, contact)."""
    first, second, free, contact = change.sides
    plate = Contact(contact, friction=_FRICTION, gap=-displacement, name="plate")
    conditions: list[Condition] = [Symmetry(first), Symmetry(second), Traction(free, x=0.0, y=0.0), plate]
    return ContactProblem(_mesh(change), material, conditions)


def _supported(shift: float) -> ContactProblem:
    """The plate on supports that are all moved by (shift, shift)."""
    left: list[Condition] = [Displacement("left", x=shift), Traction("left", y=0.0)]
    bottom: list[Condition] = [Displacement("bottom", y=shift), Traction("bottom", x=0.0)]
    rest: list[Condition] = [
        Traction("right", x=0.0, y=0.0),
        Contact("top", friction=0.2, gap=shift - 1e-3, offset=shift),
    ]
    return ContactProblem(TriangleMesh.rectangle((3, 3)), _STEEL, [*left, *bottom, *rest])


def _same(element: Element, problem: ContactProblem, change: _Change, source: str) -> Iterator[Row]:
    """Rows on force, stresses and states of the same body described otherwise."""
    first, result = _solved(element), element.solve(problem)
    proof = certified(first, result)
    known, ours = first.contacts["plate"], result.contacts["plate"]
    yield relative("force [stress length]", ours.normal_force / change.force, known.normal_force, 1e-9, source, proof)
    x, y = scattered(first)
    difference = change.back(result.stress(*change.place(x, y))) - first.stress(x, y)
    error = float(np.abs(difference).max()) / 209.0
    yield absolute("largest difference of σ over E U", error, 0.0, 1e-7, source, proof)
    states = runs(point_states(ours)[:: change.order])
    yield word("states along the plate", states, runs(point_states(known)), source, proof)
