"""Bodies: grid lines, masks, joints, and the parts of their boundary that get a condition each."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from comparisons.wild.dice import Dice
from qvi_contact import InputError, RectilinearMesh
from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.mesh.rectilinear import DIRECTIONS, SIDES

_DIRECTION: Final = {"bottom": 0, "right": 1, "top": 0, "left": 1}


@dataclass(frozen=True)
class Part:
    """A named set of edges that face one way; on rectangles, which this study is of, holes can only be loaded."""

    name: str
    side: str
    is_hole: bool


def _steps(dice: Dice, number: int, wild: bool) -> FloatArray:
    """Sizes of cells: uniform, graded, or any."""
    kind = dice.pick(("uniform", "uniform", "graded", "any"))
    if kind == "graded":
        ratio = dice.magnitude(-0.7, 0.7) if wild else dice.between(0.6, 1.6)
        return np.asarray(ratio ** np.arange(number), dtype=np.float64)
    if kind == "any":
        reach = 1.5 if wild else 0.4
        return np.array([dice.magnitude(-reach, reach) for _ in range(number)])
    return np.ones(number)


def _lines(dice: Dice, number: int, length: float, wild: bool, start: float) -> FloatArray:
    steps = _steps(dice, number, wild)
    return np.asarray(start * length + np.concatenate([[0.0], np.cumsum(steps)]) * length / steps.sum())


def _comb(dice: Dice, active: BoolArray) -> None:
    """Teeth that hang down, or stand up."""
    rows = slice(0, dice.whole(1, active.shape[0] - 1))
    active[rows, dice.whole(0, 1) :: 2] = False
    if dice.chance(0.5):
        active[:] = active[::-1].copy()


def _slit(dice: Dice, active: BoolArray) -> None:
    """A row or column cut out from one end, not to the other."""
    rows, columns = active.shape
    if dice.chance(0.5):
        active[dice.whole(0, rows - 1), : dice.whole(1, columns - 1)] = False
    else:
        active[: dice.whole(1, rows - 1), dice.whole(0, columns - 1)] = False


def _checkerboard(_: Dice, active: BoolArray) -> None:
    """Cells that meet in corners only, held together by a row and a column."""
    rows, columns = np.indices(active.shape)
    active[(rows + columns) % 2 == 1] = False
    active[-1] = active[:, 0] = True


def _touching(dice: Dice, active: BoolArray) -> None:
    """Two cells missing that meet in a corner, somewhere."""
    row, column = dice.whole(0, active.shape[0] - 2), dice.whole(0, active.shape[1] - 2)
    active[row, column] = active[row + 1, column + 1] = False


def _corner(dice: Dice, active: BoolArray) -> None:
    """One corner cut off: an L."""
    active[dice.whole(1, active.shape[0] - 1) :, dice.whole(1, active.shape[1] - 1) :] = False


def _stairs(_: Dice, active: BoolArray) -> None:
    """Every row shorter than the one below."""
    for row in range(len(active)):
        active[row, max(1, active.shape[1] - row) :] = False


def _waist(dice: Dice, active: BoolArray) -> None:
    """Cut in from both sides."""
    row = dice.whole(1, max(1, active.shape[0] - 2))
    active[row, : dice.whole(0, 1)] = active[row, 2 + dice.whole(0, 1) :] = False


def _window(dice: Dice, active: BoolArray) -> None:
    """A hole."""
    active[1 : dice.whole(2, active.shape[0] - 1), 1 : dice.whole(2, active.shape[1] - 1)] = False


def _random(dice: Dice, active: BoolArray) -> None:
    """Any cells left out."""
    for place in np.ndindex(active.shape):
        active[place] = not dice.chance(0.15)


_MASKS: Final[tuple[Callable[[Dice, BoolArray], None], ...]] = (
    _comb, _comb, _slit, _slit, _checkerboard, _touching, _corner, _stairs, _waist, _window, _window, _random,
)  # fmt: skip


def body(dice: Dice, length: float, traits: frozenset[str]) -> RectilinearMesh:
    """A mesh of 1 to 7 cells each way; "thin": 1e-3 to 1e3 as high as wide; "masks": cells left out.

    Raises `InputError` where the mask is none that a mesh may have.
    """
    least = 3 if traits & {"masks", "joints"} else 1
    columns, rows = dice.whole(least, 6), dice.whole(least, 6)
    aspect = dice.magnitude(-3.0, 3.0) if "thin" in traits else dice.magnitude(-0.5, 0.5)
    width, height = length / max(1.0, aspect), length * min(1.0, aspect)
    start = dice.pick((0.0, 0.0, 0.0, -0.5, 1.0, 100.0))
    x = _lines(dice, columns, width, "thin" in traits, start)
    y = _lines(dice, rows, height, "thin" in traits, start)
    active = np.ones((rows, columns), dtype=bool)
    if "masks" in traits:
        dice.pick(_MASKS)(dice, active)
    return RectilinearMesh(x, y, active)


def with_joints(dice: Dice, mesh: RectilinearMesh, number: int) -> RectilinearMesh:
    """Joints along grid lines inside the body, whole or in part, that may cross each other."""
    for index in range(number):
        axis = dice.whole(0, 1)
        along, across = (mesh.x, mesh.y) if axis == 0 else (mesh.y, mesh.x)
        if len(across) < 3:
            continue
        at = float(dice.pick(across[1:-1].tolist()))
        start = float(dice.pick(along[:-1].tolist())) if dice.chance(0.25) else None
        try:
            mesh = mesh.with_joint(f"joint {index}", DIRECTIONS[axis], at, start)
        except InputError:  # no two cells meet there
            continue
    return mesh


def with_parts(dice: Dice, mesh: RectilinearMesh) -> tuple[RectilinearMesh, list[Part]]:
    """The boundary cut into parts: by the side that edges face, by the line they lie on, or somewhere along it."""
    parts = []
    for side in SIDES:
        names = [side]
        along, across = (mesh.x, mesh.y) if _DIRECTION[side] == 0 else (mesh.y, mesh.x)
        edges = mesh.edge_set(side)
        on = np.unique(mesh.boundary_midpoints[edges, 1 - _DIRECTION[side]])
        if len(on) > 1 and (mesh.hole_edges.any() or dice.chance(0.5)):
            lines = [float(across[np.argmin(np.abs(across - at))]) for at in on]
            names = [f"{side} {number}" for number in range(len(lines))]
            for name, at in zip(names, lines, strict=True):
                mesh = mesh.with_edges(name, side, at=at)
        elif len(along) > 2 and dice.chance(0.15):
            middle = float(dice.pick(along[1:-1].tolist()))
            cut = _cut(mesh, side, middle)
            mesh, names = cut or (mesh, names)
        parts += [Part(name, side, bool(mesh.hole_edges[mesh.edge_set(name)].any())) for name in names]
    return mesh, parts


def _cut(mesh: RectilinearMesh, side: str, middle: float) -> tuple[RectilinearMesh, list[str]] | None:
    """A side in two, or nothing where one of the two would be empty."""
    names = [f"{side} before", f"{side} beyond"]
    try:
        return mesh.with_edges(names[0], side, stop=middle).with_edges(names[1], side, start=middle), names
    except InputError:
        return None
