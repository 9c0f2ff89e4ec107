"""Generated problems: a family and a number make one, always the same.

Contacts are straight lines: an obstacle below, flat, inclined or bent, or a joint between two blocks. Above, the body
is held and moved, or loaded.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from comparisons.wild.bodies import Dice, quadrilateral
from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    Polynomial,
    Region,
    Symmetry,
    Traction,
    TriangleMesh,
)
from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.gallery import fan
from qvi_contact.problem.conditions import Condition

FAMILIES: Final = ("grids", "polygons", "joints", "strains", "springs")
"""What each has is said in `report.md`. All but a tenth have friction."""

_FRICTION: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
_FEW: Final = 28
"""Triangles below which a mesh is divided once more."""


def stated(family: str, number: int) -> tuple[ContactProblem, int]:
    """Problem `number` of a family, and the degree to solve it with."""
    dice = Dice("bounds", family, number)
    warm = family in {"strains", "springs"}
    body = dice.pick(("grids", "polygons", "joints")) if warm else family
    strain, young, poisson = dice.magnitude(-4.0, -2.0), dice.pick((1.0, 2.1e5)), dice.pick((0.0, 0.2, 0.3, 0.45))
    size = strain * young
    expansion = 1.2e-5 if warm else 0.0
    material = Material(young, poisson, dice.pick(("stress", "strain")), expansion=expansion)
    mesh, conditions = (_polygon if body == "polygons" else _block)(dice, strain, size, body == "joints")
    temperature: Field = 0.0
    if warm:
        rise = strain / expansion * dice.pick((0.3, -0.3, 1.0, -1.0))
        first, up, upwards = (dice.pick(each) * rise for each in ((0.0, 1.0), (0.0, 1.0), (0.0, -0.5)))
        along, squared = (dice.pick(each) * rise for each in ((0.0, 0.5, -1.0), (0.0, 0.0, 0.7)))
        temperature = Polynomial([[first, up, upwards], [along], [squared or 1e-3 * rise]])
    weight = size * dice.pick((0.0, 0.0, 0.0, 0.2))
    potential: Field = Polynomial([[0.0, weight]]) if weight else 0.0
    stiffer = replace(material, young=young * dice.pick((0.1, 10.0)))
    regions = [Region(stiffer, name="upper")] if "upper" in mesh.region_names else []
    degree = dice.pick((3, 4, 4, 5))
    if family == "springs":
        conditions = _on_springs(dice, conditions, young)
    return ContactProblem(mesh, material, conditions, potential, regions, temperature), degree


def _on_springs(dice: Dice, conditions: list[Condition], young: float) -> list[Condition]:
    """The same, the contact compliant or, for one in four, tied; and some lower blocks on a bed."""

    def on_springs(contact: Contact) -> Contact:
        """With a stiffness across, and for most along; for bodies about as large as 1."""
        across = young * dice.magnitude(-1.0, 2.0)
        along = across * dice.pick((0.1, 0.4, 1.0)) if dice.chance(0.7) else None
        return replace(contact, normal_stiffness=across, tangential_stiffness=along)

    found: list[Condition] = []
    for each in conditions:
        if isinstance(each, Contact):
            tied = Contact.tied(each.edges, each.gap, each.offset, each.name)
            found.append(on_springs(tied if dice.chance(0.25) else each))
        elif isinstance(each, Displacement) and each.edges == "bottom" and dice.chance(0.5):
            found.append(on_springs(Contact.tied("bottom", name="bed")))
        else:
            found.append(each)
    return found


def _block(dice: Dice, strain: float, size: float, joint: bool) -> tuple[TriangleMesh, list[Condition]]:
    """A block on an obstacle, or one block on another, which is held below."""
    width = dice.magnitude(-0.2, 0.5)
    if joint:
        rows = dice.whole(2, 4)
        mesh = TriangleMesh.rectangle((dice.whole(2, 5), rows), width)
        level = dice.whole(1, rows - 1) / rows
        mesh = mesh.with_joint("joint", lambda _, y: np.abs(y - level) < 1e-9)
        mesh = mesh.with_region("upper", lambda _, y: y > level) if dice.chance(0.3) else mesh
    else:
        mesh = quadrilateral(dice, width, 1.0)
    mesh = mesh.refined() if mesh.cell_count < _FEW else mesh
    edges = "joint" if joint else "bottom"
    conditions: list[Condition] = [_contact(dice, edges, strain, size, width, np.array([1.0, 0.0]), (0.0, 0.0))]
    conditions += [Displacement("bottom", 0.0, 0.0)] if joint else []
    left = dice.pick(("free", "free", "loaded", "symmetry")) if not joint else "free"
    if abs(float(mesh.edges("left").normal[:, 0].max()) + 1.0) > 1e-9 and left == "symmetry":
        left = "free"
    push, kind = strain, dice.pick(("held", "held", "held", "pressed"))
    if kind == "pressed":
        slope = dice.pick((0.0, 0.5, -0.5)) * size / width
        shear = dice.pick((0.0, 0.05, -0.1, 0.2)) * size
        conditions += [Traction("top", x=shear, y=Polynomial([[-size], [slope]]))]
    else:
        shares = (0.3, 0.6, -0.4) if joint else (0.0, 0.0, 0.1, 0.3, -0.2)
        moved = 0.0 if left == "symmetry" else push * dice.pick(shares)
        conditions += [Displacement("top", moved, -push * dice.pick((1.0, 1.0, 0.3)))]
    if left == "symmetry":
        conditions += [Symmetry("left")]
    else:
        conditions += [Traction("left", size * dice.pick((0.05, -0.1)) if left == "loaded" else 0.0, 0.0)]
    conditions += [Traction("right", size * dice.pick((0.0, 0.0, 0.05, -0.1)), 0.0)]
    conditions += [Traction("step", 0.0, 0.0)] if "step" in mesh.edge_names else []
    return mesh, conditions


def _polygon(dice: Dice, strain: float, size: float, joint: bool) -> tuple[TriangleMesh, list[Condition]]:  # noqa: ARG001
    """A polygon on an obstacle along a side, held along the side across or loaded there."""
    corners, start = dice.whole(5, 8), dice.between(0.0, 2.0 * np.pi)
    angles = start + 2.0 * np.pi * (np.arange(corners) + [dice.between(-0.3, 0.3) for _ in range(corners)]) / corners
    radii = np.array([dice.between(0.4, 0.6) for _ in range(corners)])
    outline = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    mesh = fan([0.55 * outline, outline], closed=True, centre=(0.0, 0.0))
    sides = {f"side {k}": np.array([[corners + k, corners + (k + 1) % corners]]) for k in range(corners)}
    mesh = TriangleMesh(mesh.vertices, mesh.cells, sides)
    across, base = corners // 2, mesh.edges("side 0")
    n, t, length, first = base.normal[0], base.tangent[0], float(base.length[0]), mesh.vertices[base.first[0]]
    mesh = mesh.refined()
    conditions: list[Condition] = [_contact(dice, "side 0", strain, size, length, t, tuple(first.tolist()))]
    if dice.chance(0.75):
        moved = strain * (dice.pick((1.0, 1.0, 0.4)) * n + dice.pick((0.0, 0.0, 0.2, -0.3)) * t)
        conditions += [Displacement(f"side {across}", *moved.tolist())]
    else:
        load = size * (dice.pick((0.5, 1.0)) * n + dice.pick((0.0, 0.05, -0.1)) * t)
        conditions += [Traction(f"side {across}", *load.tolist())]
    for k in range(1, corners):
        if k != across:
            load = size * (dice.pick((0.0, 0.0, 0.05)) * n + dice.pick((0.0, 0.0, 0.05, -0.05)) * t)
            conditions += [Traction(f"side {k}", *load.tolist())]
    return mesh, conditions


def _contact(
    dice: Dice, edges: str, strain: float, size: float, length: float, t: FloatArray, first: tuple[float, ...]
) -> Contact:
    """A contact along a line from `first` along t."""
    s = Polynomial([[-float(t @ np.array(first)), float(t[1])], [float(t[0])]])  # distance along it
    kind, gap = dice.pick(("flat", "flat", "inclined", "bent")), dice.between(-0.5, 0.5) * strain
    shape: Field = 0.0
    if kind == "inclined":
        shape = Polynomial([[gap / length * c for c in row] for row in s.coefficients])
    elif kind == "bent":  # strain · length/4 … (s/length − ½)²
        (c, b), (a, *_) = s.coefficients
        c -= length / 2.0
        share = strain * dice.pick((1.0, 0.4)) / length
        shape = Polynomial([[share * c * c, 2 * share * b * c, share * b * b], [2 * share * a * c, 2 * share * a * b],
                            [share * a * a]])  # fmt: skip
    friction = 0.0 if dice.chance(0.1) else dice.pick(_FRICTION)
    cohesion = size * dice.pick((0.02, 0.1)) if dice.chance(0.1) else 0.0
    return Contact(edges, friction, shape, name="contact", cohesion=cohesion)
