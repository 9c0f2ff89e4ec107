"""What happens on the parts of a body: loads, supports, contacts of every law, plates."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from comparisons.wild.bodies import Dice, Part
from qvi_contact import Contact, Displacement, Polynomial, RigidPlate, Symmetry, Traction, TriangleMesh
from qvi_contact.basics.checks import Field
from qvi_contact.problem.conditions import Condition

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
