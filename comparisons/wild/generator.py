"""The generator: a family and a number make a problem, always the same.

Each family is wild in one way, and now and then in another one as well; "everything" in half of them at once.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from comparisons.wild.bodies import Dice, body, with_parts
from comparisons.wild.conditions import Maker
from comparisons.wild.nonsense import nonsense
from qvi_contact import ContactProblem, Material, Polynomial, Region
from qvi_contact.problem.conditions import Condition

FAMILIES: Final[Mapping[str, str]] = MappingProxyType({
    "thin": "bodies 1e-3 to 1e3 times as high as wide, cells graded by up to a factor of 5",
    "units": "lengths and moduli of 1e-9 to 1e12 units, each on its own",
    "friction": "μ from 0 and 1e-3 to 1e3",
    "poisson": "ν up to the ends of what a material may have",
    "masks": "combs, slits, checkerboards, waists, stairs, holes, cells that touch in a point",
    "joints": "one to four joints inside the body, crossing or ending there",
    "gaps": "gaps with kinks, waves and jumps, obstacles far away or pushed into the body",
    "laws": "cohesion, caps, Tresca's law, bilateral and tied contacts",
    "plates": "plates driven by forces and moments about pivots far away",
    "fluids": "fluids under pressure in contacts and joints",
    "incompressible": "ν = 0.5 in plane strain, where only a traction says how large a constant pressure is",
    "polygons": "polygons, trapezoids, distorted meshes, bodies turned by any angle, holes",
    "arcs": "discs and rings with sides that are arcs, whole and half",
    "bodies": "bodies one in another, with a joint all round",
    "files": "meshes that come from a file of Gmsh, Abaqus or MED",
    "degrees": "degrees 3 to 8, contact laws on edges and at points",
    "idle": "bodies without any load",
    "everything": "half of all that at once",
    "nonsense": "one argument that is no number, no name, no shape or out of range",
})  # fmt: skip
"""Family → what is wild about it."""

_LATE: Final = ("fluids", "incompressible")
"""Traits with dice of their own, so that the problems of families that were there before stay the same."""

_TRAITS: Final = tuple(name for name in FAMILIES if name not in ("everything", "nonsense", "idle", *_LATE))
_STRAY: Final = 0.04
"""Probability of a trait that is not the family's own."""

_NEAR: Final = (0.5, 0.499999, 0.4999, 0.49, -0.9, -0.99, -0.9999, -0.999999)
"""Poisson's ratios at the ends; 0.5 itself in plane stress alone, see "incompressible" for plane strain."""


@dataclass(frozen=True)
class Wild:
    """What a family and a number make.

    Attributes
    ----------
    problem : the problem
    settings : keyword arguments for `solve`
    wrong : the argument that is nonsense, if there is one, in words: it ought to have been refused

    """

    problem: ContactProblem
    settings: Mapping[str, Any] = field(default_factory=dict)
    wrong: str = ""


def wild_problem(family: str, number: int) -> Wild:
    """Problem `number` of a family; raises `InputError` where the package refuses it."""
    dice = Dice(family, number)
    if family == "nonsense":
        return Wild(*nonsense(dice))
    traits = _traits(dice, family)
    return Wild(_problem(dice, traits | _late(family, number)), _settings(Dice("settings", family, number), traits))


def _settings(dice: Dice, traits: frozenset[str]) -> dict[str, Any]:
    """Degree and kind of contact rows, for the most part the usual ones."""
    often = "degrees" in traits
    degree = dice.pick((3, 5, 6, 7, 8)) if dice.chance(0.9 if often else 0.15) else 4
    return {"degree": degree, **({"contact_rows": "gauss"} if dice.chance(0.5 if often else 0.1) else {})}


def _traits(dice: Dice, family: str) -> frozenset[str]:
    if family == "everything":
        return frozenset(name for name in _TRAITS if dice.chance(0.5))
    return frozenset({family, *(name for name in _TRAITS if dice.chance(_STRAY))})


def _late(family: str, number: int) -> frozenset[str]:
    """Traits of `_LATE` that other families have now and then: "everything" in half of its problems."""
    dice = Dice("late", family, number)
    return frozenset(name for name in _LATE if dice.chance(0.5 if family == "everything" else 0.0))


def _material(dice: Dice, young: float, traits: frozenset[str], plane: Any) -> Material:
    poisson = dice.pick((0.0, 0.2, 0.3, 0.45))
    if "poisson" in traits:
        poisson = dice.pick([value for value in _NEAR if value < 0.5 or plane == "stress"])
    return Material(young, 0.5 if "incompressible" in traits else poisson, plane)


def _problem(dice: Dice, traits: frozenset[str]) -> ContactProblem:
    wild = "units" in traits
    length = dice.magnitude(-9.0, 12.0) if wild else dice.pick((1.0, 1.0, 0.04, 30.0))
    young = dice.magnitude(-9.0, 12.0) if wild else dice.pick((1.0, 1e3, 2.1e5))
    strain = dice.magnitude(-7.0, -1.0) if wild else dice.pick((1e-4, 1e-3, 1e-2))
    plane = dice.pick(("stress", "strain"))
    plane = "strain" if "incompressible" in traits else plane
    mesh = body(dice, length, traits)
    mesh, parts = with_parts(dice, mesh)
    wet = Dice("wet", dice.whole(0, 10**6)) if "fluids" in traits else None
    maker = Maker(dice, mesh, strain * young, strain * length, traits, wet)
    conditions: list[Condition] = [condition for part in parts for condition in maker.condition(part)]
    conditions += [maker.contact(name, joint=True) for name in mesh.joint_names]
    material = _material(dice, young, traits, plane)
    regions = []
    if dice.chance(0.2 if "bodies" in traits else 0.1):
        other = _material(dice, young * dice.magnitude(-2.0, 2.0), traits, plane)
        half = np.flatnonzero(mesh.corners.mean(axis=1)[:, 0] < float(np.median(mesh.vertices[:, 0])))
        if 0 < len(half) < len(mesh.cells):
            mesh = mesh.with_region("half", half)
            regions.append(Region(other, name="half"))
    weight = strain * young / length if dice.chance(0.1) and "idle" not in traits else 0.0
    potential = Polynomial([[0.0, weight]]) if weight else 0.0
    return ContactProblem(mesh, material, conditions, potential, regions)
