"""The generator: a family and a number make a problem, always the same.

Each family is wild in one way, and now and then in another one as well; "everything" in half of them at once.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

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

FAMILIES: Final = (
    "thin", "units", "friction", "poisson", "masks", "joints", "gaps", "laws", "plates", "fluids", "incompressible",
    "polygons", "arcs", "bodies", "files", "degrees", "idle", "everything",
)  # fmt: skip
"""What is wild about each is said in `report.md`."""

_LATE: Final = ("fluids", "incompressible")
"""Traits with dice of their own, so that the problems of families that were there before stay the same."""

_TRAITS: Final = tuple(name for name in FAMILIES if name not in ("everything", "idle", *_LATE))
_STRAY: Final = 0.04
"""Probability of a trait that is not the family's own."""

_NEAR: Final = (0.5, 0.499999, 0.4999, 0.49, -0.9, -0.99, -0.9999, -0.999999)
"""Poisson's ratios at the ends; 0.5 itself in plane stress alone, see "incompressible" for plane strain."""


class Wild(NamedTuple):
    """What a family and a number make: a problem, and keyword arguments for `solve`."""

    problem: ContactProblem
    settings: Mapping[str, Any]


def wild_problem(family: str, number: int) -> Wild:
    """Problem `number` of a family; raises `InputError` where the package refuses it."""
    dice = Dice(family, number)
    if family == "everything":
        traits = frozenset(name for name in _TRAITS if dice.chance(0.5))
    else:
        traits = frozenset({family, *(name for name in _TRAITS if dice.chance(_STRAY))})
    settings, often = Dice("settings", family, number), "degrees" in traits
    degree = settings.pick((3, 5, 6, 7, 8)) if settings.chance(0.9 if often else 0.15) else 4
    law_on = {"law_on": "points"} if settings.chance(0.5 if often else 0.1) else {}
    late = Dice("late", family, number)  # of "everything" in half of its problems
    traits |= {name for name in _LATE if late.chance(0.5 if family == "everything" else 0.0)}
    return Wild(_problem(dice, traits), {"degree": degree, **law_on})


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
    mesh, parts = with_parts(dice, body(dice, length, traits))
    wet = Dice("wet", dice.whole(0, 10**6)) if "fluids" in traits else None
    maker = Maker(dice, mesh, strain * young, strain * length, traits, wet)
    conditions: list[Condition] = [condition for part in parts for condition in maker.conditions(part)]
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
    """Conditions in the units of one body: what loads and gaps are like, and the dice of all and of fluids, if any."""

    dice: Dice
    mesh: TriangleMesh
    stress: float
    displacement: float
    traits: frozenset[str]
    wet: Dice | None = None

    def conditions(self, part: Part) -> list[Condition]:
        """What happens on a part: mostly something that holds or presses the body, now and then anything."""
        dice, idle = self.dice, "idle" in self.traits
        if idle:
            kinds: tuple[str, ...] = ("contact", "contact", "nothing", "support", "clamped", "symmetry")
        else:
            usual = {"bottom": ("contact",), "top": ("pressed", "pushed", "contact", "plate")}
            kinds = usual.get(part.side, ("nothing", "nothing", "symmetry", "loaded", "contact"))
        if dice.chance(_FREE):
            kinds = ("nothing", "loaded", "support", "clamped", "symmetry", "contact", "plate", "pressed", "pushed")
        across, along, sign = _NORMAL[part.side] if part.straight else _SLANTED
        match kind := "loaded" if part.is_hole else dice.pick(kinds):
            case "loaded":
                return [Traction(part.name, self._field(self._load()), self._field(self._load()))]
            case "clamped":
                return [Displacement(part.name, 0.0, 0.0)]
            case "symmetry":
                return [Symmetry(part.name)]
            case "contact" | "plate":
                driven = kind == "plate" or ("plates" in self.traits and dice.chance(0.4))
                return [self.contact(part.name, plate=self._driver(part) if driven else None)]
            case "pressed":  # and some shear
                pressure = -sign * abs(self._load() or self.stress * (not idle))
                shear = self._field(self._load()) if dice.chance(0.3) else 0.0
                given: dict[str, Any] = {along: shear, across: self._field(pressure)}
                return [Traction(part.name, **given)]
            case "pushed" | "support":  # a displacement, most often into the body, and free or held along the side
                move = self._field(-sign * abs(self._move())) if kind == "pushed" else 0.0
                if kind == "pushed" and dice.chance(0.4):
                    return [Displacement(part.name, **{across: move, along: self._field(self._move())})]
                free: dict[str, Any] = {along: 0.0}
                return [Displacement(part.name, **{across: move}), Traction(part.name, **free)]
        return [Traction(part.name, 0.0, 0.0)]

    def contact(self, edges: str, *, joint: bool = False, plate: RigidPlate | None = None) -> Contact:
        """A contact of any law."""
        dice, traits = self.dice, self.traits
        law = dice.pick(("unilateral", "bilateral", "tied")) if "laws" in traits and dice.chance(0.5) else ""
        gap = self._gap(joint)
        offset = self._field(self._move()) if dice.chance(0.15) else 0.0
        fluid: Field = 0.0  # constant, rising along an axis as water does, or of any other shape
        if self.wet is not None and law != "tied" and not self.wet.chance(0.2):
            size = abs(self.stress) * self.wet.pick((0.01, 0.1, 0.5, 1.0, 3.0, 100.0))
            fluid = replace(self, dice=self.wet)._field(size, True, 0.6)
        if law == "tied":
            return Contact(edges, 0.0, gap, offset, law="tied", plate=plate, pore_pressure=fluid)
        cohesion: Field = 0.0
        cap: float | None = None
        if "laws" in traits or dice.chance(0.1):
            size = abs(self.stress) * dice.pick((0.0, 0.03, 0.3, 1.0, 100.0))
            cap = abs(self.stress) * dice.pick((0.0, 0.01, 0.2, 1.0, 10.0)) if dice.chance(0.3) else None
            cohesion = self._field(size, True)
        if "friction" in traits:
            friction = dice.pick((0.0, dice.magnitude(-3.0, 3.0), dice.magnitude(-1.0, 1.0), 1000.0))
        else:
            friction = dice.pick((0.0, 0.05, 0.2, 0.3, 0.6, 1.0))
        return Contact(
            edges, self._field(friction, True), gap, offset, "", cohesion, cap,
            "bilateral" if law == "bilateral" else "unilateral", plate, fluid,
        )  # fmt: skip

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
            arms = (near[0] - pivot[0]) * given.get("force_y", 0.0) - (near[1] - pivot[1]) * given.get("force_x", 0.0)
            given["moment"] = arms + 0.1 * given["moment"]
        return RigidPlate(pivot=pivot, **given)

    def _load(self) -> float:
        if "idle" in self.traits:
            return 0.0
        return self.stress * self.dice.pick((0.0, 0.1, -0.1, 0.5, -0.5, 1.0, -1.0))

    def _move(self) -> float:
        return 0.0 if "idle" in self.traits else self.displacement * self.dice.pick((0.0, 0.2, -0.2, 1.0, -1.0))

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
        shapes: dict[str, Callable[[Any], Any]] = {
            "kink": lambda s: value * np.abs(s - at) / size,
            "waves": lambda s: value * np.sin(3.0 * (s - at) / size) ** 2,
            "jump": lambda s: np.where(s < at, value, 0.3 * value),
        }
        return lambda x, y: shapes[kind]((x, y)[axis])
