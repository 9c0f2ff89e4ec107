"""Chapter on invariance: the same body described otherwise has the same answer."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from comparisons.verify.chapter import Chapter
from comparisons.verify.measures import runs, scattered
from comparisons.verify.proof import certified
from comparisons.verify.row import Kind, Row, absolute, relative, word
from qvi_contact import (
    Contact,
    ContactProblem,
    ContactResult,
    Displacement,
    Material,
    RectilinearMesh,
    Symmetry,
    Traction,
    solve,
)
from qvi_contact.basics.checks import FloatArray
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem.conditions import Condition

_WIDTH, _HEIGHT, _CELLS, _GRADING, _FRICTION = 1.5, 1.0, (4, 3), 0.8, 0.12
_STEEL: Final = Material(2.09e5, 0.3)
_SIDES: Final = ("left", "bottom", "right", "top")

Map = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class _Change:
    """Another description: where points go, what becomes of σ_xx, σ_yy, σ_xy, and units of stress and force."""

    place: Map = lambda x, y: (x, y)
    back: Callable[[FloatArray], FloatArray] = lambda stress: stress
    force: float = 1.0
    order: int = 1


def _mirrored(stress: FloatArray) -> FloatArray:
    return np.asarray(stress * np.array([1.0, 1.0, -1.0]))


def _turned(stress: FloatArray) -> FloatArray:
    return _mirrored(stress[..., [1, 0, 2]])


def mirror_images(quick: bool) -> Iterator[Row]:
    """Left and right exchanged, and upside down."""
    del quick
    first, (x, y) = _original(), _lines()
    left = _plate((-x[::-1], y), ("right", "bottom", "left", "top"))
    yield from _same(first, left, _Change(lambda x, y: (-x, y), _mirrored, order=-1), "(x, y) → (−x, y)")
    down = _plate((x, -y[::-1]), ("left", "top", "right", "bottom"))
    yield from _same(first, down, _Change(lambda x, y: (x, -y), _mirrored), "(x, y) → (x, −y)")


def quarter_turn(quick: bool) -> Iterator[Row]:
    """Turned by 90°: the plate touches a vertical side."""
    del quick
    x, y = _lines()
    turned = _plate((-y[::-1], x), ("bottom", "right", "top", "left"))
    yield from _same(_original(), turned, _Change(lambda x, y: (-y, x), _turned), "(x, y) → (−y, x)")


def far_from_the_origin(quick: bool) -> Iterator[Row]:
    """The domain shifted by 1e3 of its size."""
    del quick
    x, y = _lines()
    moved = _plate((x + 1e3, y - 1e3), _SIDES)
    change = _Change(lambda x, y: (x + 1e3, y - 1e3))
    yield from _same(_original(), moved, change, "(x, y) → (x + 1e3, y − 1e3)")


def units(quick: bool) -> Iterator[Row]:
    """Metres and MPa changed to millimetres and Pa."""
    del quick
    x, y = _lines()
    other = _plate((1e3 * x, 1e3 * y), _SIDES, Material(2.09e11, 0.3), displacement=1.0)
    change = _Change(lambda x, y: (1e3 * x, 1e3 * y), lambda stress: stress / 1e6, force=1e9)
    yield from _same(_original(), other, change, "lengths times 1e3, stresses times 1e6")


def order_of_the_data(quick: bool) -> Iterator[Row]:
    """The same conditions listed in the opposite order."""
    del quick
    problem = _plate(_lines(), _SIDES)
    turned = ContactProblem(problem.mesh, problem.material, list(problem.conditions)[::-1])
    yield from _same(_original(), turned, _Change(), "conditions listed backwards")


def proportional_loads(quick: bool) -> Iterator[Row]:
    """A million times more or less compression: Coulomb's law is positively homogeneous."""
    for size in (1e6,) if quick else (1e6, 1e-6):
        other = _plate(_lines(), _SIDES, displacement=size * 1e-3)
        change = _Change(back=partial(np.multiply, 1.0 / size), force=size)
        yield from _same(_original(), other, change, f"load times {size:g}")


def rigid_motion(quick: bool) -> Iterator[Row]:
    """Supports and obstacle moved together by five hundred times the compression."""
    del quick
    still, moved = solve(_supported(0.0)), solve(_supported(0.5))
    proof, source = certified(still, moved), "rigid motions leave no stress"
    force, known = moved.contacts["top"].normal_force, still.contacts["top"].normal_force
    yield relative("force [stress length]", force, known, 1e-7, Kind.ANALYTIC, source, proof)
    x, y = scattered(still)
    error = float(np.abs(moved.stress(x, y) - still.stress(x, y)).max()) / 209.0
    yield absolute("largest difference of σ over E U", error, 0.0, 1e-7, Kind.ANALYTIC, source, proof)


def _lines() -> tuple[FloatArray, FloatArray]:
    mesh = RectilinearMesh.rectangle(_CELLS, _WIDTH, _HEIGHT, grading=_GRADING)
    return mesh.x, mesh.y


def _original() -> ContactResult:
    return solve(compressed_plate(_FRICTION, _CELLS, _WIDTH, _HEIGHT, grading=_GRADING))


def _plate(
    lines: tuple[FloatArray, FloatArray],
    sides: tuple[str, ...],
    material: Material = _STEEL,
    displacement: float = 1e-3,
) -> ContactProblem:
    """The compressed plate; sides are those of (symmetry, symmetry, free, contact)."""
    first, second, free, contact = sides
    plate = Contact(contact, friction=_FRICTION, gap=-displacement, name="plate")
    conditions: list[Condition] = [Symmetry(first), Symmetry(second), Traction(free, x=0.0, y=0.0), plate]
    return ContactProblem(RectilinearMesh(*lines), material, conditions)


def _supported(shift: float) -> ContactProblem:
    """The plate on supports that are all moved by (shift, shift)."""
    left: list[Condition] = [Displacement("left", x=shift), Traction("left", y=0.0)]
    bottom: list[Condition] = [Displacement("bottom", y=shift), Traction("bottom", x=0.0)]
    rest: list[Condition] = [
        Traction("right", x=0.0, y=0.0),
        Contact("top", friction=0.2, gap=shift - 1e-3, offset=shift),
    ]
    return ContactProblem(RectilinearMesh.rectangle((3, 3)), _STEEL, [*left, *bottom, *rest])


def _same(first: ContactResult, problem: ContactProblem, change: _Change, source: str) -> Iterator[Row]:
    """Rows on force, stresses and states of the same body described otherwise."""
    result = solve(problem)
    proof = certified(first, result)
    known, ours = first.contacts["plate"], result.contacts["plate"]
    force = ours.normal_force / change.force
    yield relative("force [stress length]", force, known.normal_force, 1e-9, Kind.ANALYTIC, source, proof)
    x, y = scattered(first)
    difference = change.back(result.stress(*change.place(x, y))) - first.stress(x, y)
    error = float(np.abs(difference).max()) / 209.0
    yield absolute("largest difference of σ over E U", error, 0.0, 1e-7, Kind.ANALYTIC, source, proof)
    states = runs(ours.state[:: change.order])
    yield word("states along the plate", states, runs(known.state), Kind.ANALYTIC, source, proof)


CHAPTER = Chapter(
    "invariance",
    "Invariance",
    "Units, mirror images, turns, shifts and the order of the data do not change the answer.",
    "Each row compares the compressed plate with itself described otherwise, mapped back.",
    "A difference that is more than round-off.",
    {
        "mirror": mirror_images,
        "quarter-turn": quarter_turn,
        "shift": far_from_the_origin,
        "units": units,
        "order": order_of_the_data,
        "proportional-load": proportional_loads,
        "rigid-motion": rigid_motion,
    },
)
