"""The generator: a family and a number make a problem, always the same.

Each family is wild in one way, and now and then in another one as well; "everything" in half of them at once.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from comparisons.wild.bodies import Dice, Part, body, with_parts
from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    Polynomial,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    TriangleMesh,
)
from qvi_contact.basics.checks import Field
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
})  # fmt: skip
"""Family → what is wild about it."""

_LATE: Final = ("fluids", "incompressible")
"""Traits with dice of their own, so that the problems of families that were there before stay the same."""

_TRAITS: Final = tuple(name for name in FAMILIES if name not in ("everything", "idle", *_LATE))
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

    """

    problem: ContactProblem
    settings: Mapping[str, Any] = field(default_factory=dict)


def wild_problem(family: str, number: int) -> Wild:
    """Problem `number` of a family; raises `InputError` where the package refuses it."""
    dice = Dice(family, number)
    traits = _traits(dice, family)
    return Wild(_problem(dice, traits | _late(family, number)), _settings(Dice("settings", family, number), traits))


def _settings(dice: Dice, traits: frozenset[str]) -> dict[str, Any]:
    """Degree and kind of contact rows, for the most part the usual ones."""
    often = "degrees" in traits
    degree = dice.pick((3, 5, 6, 7, 8)) if dice.chance(0.9 if often else 0.15) else 4
    return {"degree": degree, **({"law_on": "points"} if dice.chance(0.5 if often else 0.1) else {})}


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


# What happens on the parts of a body: loads, supports, contacts of every law, plates.


_NORMAL: Final = {
    "bottom": ("y", "x", -1.0), "right": ("x", "y", 1.0), "top": ("y", "x", 1.0), "left": ("x", "y", -1.0),
}  # fmt: skip
"""Side → component across it, component along it, sign of the outward normal; on slanted ones local components."""

_SLANTED: Final = ("normal", "tangential", 1.0)

_FREE: Final = 0.1
"""Share of conditions that are none of what usually stands on that side."""


@dataclass(frozen=True)
class Maker:
    """Conditions in the units of one body.

    Attributes
    ----------
    dice : source of choices
    mesh : the body
    stress, displacement : what loads and gaps are like [stress], [length]
    traits : what is wild about it, see `generator.FAMILIES`
    wet : source of choices for fluids; None where there are none

    """

    dice: Dice
    mesh: TriangleMesh
    stress: float
    displacement: float
    traits: frozenset[str]
    wet: Dice | None = None

    def condition(self, part: Part) -> list[Condition]:
        """What happens on a part: mostly something that holds or presses the body, now and then anything."""
        if "idle" in self.traits:
            kinds: tuple[str, ...] = ("contact", "contact", "nothing", "support", "clamped", "symmetry")
        else:
            usual = {"bottom": ("contact",), "top": ("pressed", "pushed", "contact", "plate")}
            kinds = usual.get(part.side, ("nothing", "nothing", "symmetry", "loaded", "contact"))
        if self.dice.chance(_FREE):
            kinds = ("nothing", "loaded", "support", "clamped", "symmetry", "contact", "plate", "pressed", "pushed")
        return self._made("loaded" if part.is_hole else self.dice.pick(kinds), part)

    def _made(self, kind: str, part: Part) -> list[Condition]:
        """A kind of condition on a part."""
        match kind:
            case "loaded":
                return [Traction(part.name, self._field(self._load()), self._field(self._load()))]
            case "support":
                return self._guided(part, 0.0)
            case "clamped":
                return [Displacement(part.name, 0.0, 0.0)]
            case "symmetry":
                return [Symmetry(part.name)]
            case "contact" | "plate":
                driven = kind == "plate" or ("plates" in self.traits and self.dice.chance(0.4))
                return [self.contact(part.name, plate=self._driver(part) if driven else None)]
            case "pressed":
                return self._pressed(part)
            case "pushed":
                return self._pushed(part)
        return [Traction(part.name, 0.0, 0.0)]

    def contact(self, edges: str, *, joint: bool = False, plate: RigidPlate | None = None) -> Contact:
        """A contact of any law."""
        dice = self.dice
        law = dice.pick(("unilateral", "bilateral", "tied")) if "laws" in self.traits and dice.chance(0.5) else ""
        gap = self._gap(joint)
        offset = self._field(self._move()) if dice.chance(0.15) else 0.0
        fluid = self._fluid(law)
        if law == "tied":
            return Contact(edges, 0.0, gap, offset, law="tied", plate=plate, pore_pressure=fluid)
        cohesion, cap = self._bounds()
        return Contact(
            edges, self._friction(), gap, offset, "", cohesion, cap,
            "bilateral" if law == "bilateral" else "unilateral", plate, fluid,
        )  # fmt: skip

    def _pressed(self, part: Part) -> list[Condition]:
        """Pressure, and some shear."""
        across, along, sign = _NORMAL[part.side] if part.straight else _SLANTED
        pressure = -sign * abs(self._load() or self.stress * ("idle" not in self.traits))
        shear = self._field(self._load()) if self.dice.chance(0.3) else 0.0
        given: dict[str, Any] = {along: shear, across: self._field(pressure)}
        return [Traction(part.name, **given)]

    def _pushed(self, part: Part) -> list[Condition]:
        """A given displacement, most often into the body, and free or held along the side."""
        across, along, sign = _NORMAL[part.side] if part.straight else _SLANTED
        move = self._field(-sign * abs(self._move()))
        if self.dice.chance(0.4):
            return [Displacement(part.name, **{across: move, along: self._field(self._move())})]
        return self._guided(part, move)

    def _guided(self, part: Part, move: Field) -> list[Condition]:
        """A displacement across the side, no traction along it."""
        across, along, _ = _NORMAL[part.side] if part.straight else _SLANTED
        free: dict[str, Any] = {along: 0.0}
        return [Displacement(part.name, **{across: move}), Traction(part.name, **free)]

    def _driver(self, part: Part) -> RigidPlate:
        """A plate that mostly presses, with a moment about a pivot that may be far away."""
        dice, edges = self.dice, self.mesh.edges(part.name)
        extent = float(np.ptp(self.mesh.vertices, axis=0).max())
        force = self.stress * float(edges.length.sum())
        pressed = -dice.between(0.2, 2.0) * force
        if part.straight:
            across, along, sign = _NORMAL[part.side]
            given = {f"force_{across}": sign * pressed}
        else:
            x, y = edges.length @ edges.normal / edges.length.sum()
            along, given = "x", {"force_x": float(x) * pressed, "force_y": float(y) * pressed}
        if "plates" in self.traits:
            if dice.chance(0.3):
                given[f"force_{along}"] = given.get(f"force_{along}", 0.0) + force * dice.between(-0.4, 0.4)
            if dice.chance(0.5):
                given["moment"] = force * extent * dice.pick((0.0, 0.01, -0.05, 0.3))
            if dice.chance(0.15):
                given = {"moment": force * extent * dice.between(-0.3, 0.3)}
        if "idle" in self.traits:
            given = dict.fromkeys(given, 0.0)
        far = dice.magnitude(0.0, 4.0) if "plates" in self.traits and dice.chance(0.3) else dice.between(0.0, 1.0)
        near = (float(self.mesh.vertices[:, 0].mean()), float(self.mesh.vertices[:, 1].mean()))
        pivot = (near[0] + far * extent * dice.sign(), near[1] + extent * dice.between(-1.0, 1.0))
        if "moment" in given and dice.chance(0.7):  # the moment of a force at the middle, plus a little
            given["moment"] = self._balanced(given, near, pivot) + 0.1 * given["moment"]
        return RigidPlate(pivot=pivot, **given)

    @staticmethod
    def _balanced(given: dict[str, float], near: tuple[float, float], pivot: tuple[float, float]) -> float:
        return (near[0] - pivot[0]) * given.get("force_y", 0.0) - (near[1] - pivot[1]) * given.get("force_x", 0.0)

    def _load(self) -> float:
        if "idle" in self.traits:
            return 0.0
        return self.stress * self.dice.pick((0.0, 0.1, -0.1, 0.5, -0.5, 1.0, -1.0))

    def _move(self) -> float:
        return 0.0 if "idle" in self.traits else self.displacement * self.dice.pick((0.0, 0.2, -0.2, 1.0, -1.0))

    def _friction(self) -> Field:
        dice = self.dice
        if "friction" in self.traits:
            return self._field(dice.pick((0.0, dice.magnitude(-3.0, 3.0), dice.magnitude(-1.0, 1.0), 1000.0)), True)
        return self._field(dice.pick((0.0, 0.05, 0.2, 0.3, 0.6, 1.0)), True)

    def _gap(self, joint: bool) -> Field:
        dice = self.dice
        if "idle" in self.traits:
            return self._field(dice.pick((0.0, 0.0, self.displacement, 1e4 * self.displacement)), True)
        if "gaps" in self.traits and dice.chance(0.7):
            far = self.displacement * dice.magnitude(1.0, 9.0)
            return self._field(dice.pick((abs(self._move()), far, self._move(), -self.displacement)), False, 0.9)
        if joint or dice.chance(0.6):
            return 0.0
        return self._field(self._move())

    def _fluid(self, law: str) -> Field:
        """The pressure of a fluid, constant, rising along an axis as water does, or of any other shape."""
        if self.wet is None or law == "tied" or self.wet.chance(0.2):
            return 0.0
        size = abs(self.stress) * self.wet.pick((0.01, 0.1, 0.5, 1.0, 3.0, 100.0))
        return replace(self, dice=self.wet)._field(size, True, 0.6)

    def _bounds(self) -> tuple[Field, Field | None]:
        """Cohesion and cap."""
        dice = self.dice
        if not ("laws" in self.traits or dice.chance(0.1)):
            return 0.0, None
        cohesion = abs(self.stress) * dice.pick((0.0, 0.03, 0.3, 1.0, 100.0))
        cap = abs(self.stress) * dice.pick((0.0, 0.01, 0.2, 1.0, 10.0)) if dice.chance(0.3) else None
        return self._field(cohesion, True), cap

    def _field(self, value: float, positive: bool = False, varied: float = 0.15) -> Field:
        """The value itself, or a function of its size: linear, with a kink, waves, a jump on a grid line."""
        dice = self.dice
        if not value or not dice.chance(varied):
            return value
        axis = dice.whole(0, 1)
        lines = np.unique(np.round(self.mesh.vertices[:, axis], 14))
        low, size = float(lines[0]), float(np.ptp(lines))
        kind = dice.pick(("linear", "kink", "waves", "jump"))
        if kind == "linear":
            slope = value / size * (1.0 if positive else dice.pick((-1.0, 0.5)))
            start = (value if slope < 0.0 or not positive else 0.0) - slope * low
            return Polynomial([[start, 0.0], [slope, 0.0]] if axis == 0 else [[start, slope]])
        at = float(dice.pick(lines.tolist()))
        return _shaped(kind, value, axis, at, size)


def _shaped(kind: str, value: float, axis: int, at: float, size: float) -> Callable[..., Any]:
    """A function that is no polynomial."""
    shapes: dict[str, Callable[[Any], Any]] = {
        "kink": lambda s: value * np.abs(s - at) / size,
        "waves": lambda s: value * np.sin(3.0 * (s - at) / size) ** 2,
        "jump": lambda s: np.where(s < at, value, 0.3 * value),
    }
    return lambda x, y: shapes[kind]((x, y)[axis])
