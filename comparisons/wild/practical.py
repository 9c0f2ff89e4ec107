"""Problems of practice: a number makes a problem, a quantity and a target, always the same.

Bodies, laws and loads are those of practice, not the extremes of `wild`: there answers are wanted, here their accuracy.
"""

from dataclasses import dataclass
from typing import Final

from comparisons.wild.bodies import Dice, quadrilateral
from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    Polynomial,
    RigidPlate,
    Symmetry,
    Traction,
)
from qvi_contact.basics.checks import Field
from qvi_contact.problem.conditions import Condition, Law

_BASE: Final = "base"
_PLATE: Final = "plate"
_FRICTION: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
_FORCES: Final = ("normal_force", "tangential_force")


@dataclass(frozen=True)
class Stated:
    """What a number makes.

    Attributes
    ----------
    problem : the problem
    quantity : name of the quantity, as `refine` takes it
    target : relative error asked for
    degree : of the element

    """

    problem: ContactProblem
    quantity: str
    target: float
    degree: int


def stated(number: int) -> Stated:
    """Problem `number`."""
    dice = Dice("estimates", number)
    width, height = dice.magnitude(-0.2, 0.5), 1.0
    mesh = quadrilateral(dice, width, height)
    strain = dice.magnitude(-4.0, -2.0)
    young, poisson = dice.pick((1.0, 2.1e5)), dice.pick((0.0, 0.2, 0.3, 0.45))
    contacts = [_base(dice, strain * height, width)]
    sides = [_side(dice, side, strain * young) for side in ("left", "right")]
    guided = isinstance(sides[0], Symmetry)
    above = _top(dice, strain, young, width, height, guided)
    conditions: list[Condition] = [*contacts, *above, *sides]
    contacts += [each for each in above if isinstance(each, Contact)]
    conditions += [Traction("step", 0.0, 0.0)] if "step" in mesh.edge_names else []
    problem = ContactProblem(mesh, Material(young, poisson, dice.pick(("stress", "strain"))), conditions)
    quantity = dice.pick(("energy", *_forces(contacts, above, guided)))
    return Stated(problem, quantity, dice.magnitude(-4.5, -2.0), dice.pick((3, 4, 5, 5)))


def _forces(contacts: list[Contact], above: list[Condition], guided: bool) -> list[str]:
    """The forces that equilibrium alone does not give, each twice."""
    pushed = any(isinstance(each, Traction) for each in above)
    driven = any(each.plate is not None for each in contacts)
    kinds = [*([] if pushed or driven else ["normal_force"]), *([] if pushed and not guided else ["tangential_force"])]
    return 2 * [f"{each.name}.{kind}" for each in contacts for kind in kinds]


def _base(dice: Dice, move: float, width: float) -> Contact:
    """A rough obstacle below: flat, inclined, or bent away from the body."""
    shape: Field = 0.0
    kind = dice.pick(("flat", "flat", "inclined", "bent"))
    if kind == "inclined":
        slope = dice.between(-0.5, 0.5) * move / width
        shape = Polynomial([[0.0], [slope]])
    elif kind == "bent":
        shape = Polynomial([[move / 4], [-move / width], [move / width**2]])  # move (x/width − ½)²
    coefficient = dice.pick(_FRICTION)
    rising = Polynomial([[0.5 * coefficient], [0.5 * coefficient / width]])
    friction: Field = rising if dice.chance(0.15) else coefficient
    law: Law = "bilateral" if dice.chance(1.0 / 6.0) else "unilateral"
    return Contact("bottom", friction, shape, name=_BASE, law=law)


def _top(dice: Dice, strain: float, young: float, width: float, height: float, guided: bool) -> list[Condition]:
    """What presses from above, most often with some shear."""
    push, stress = strain * height, strain * young
    kind = dice.pick(("held", "held", "pressed", "plate", "driven"))
    if kind == "held":
        return [Displacement("top", x=0.0 if guided else push * dice.pick((0.0, 0.1, 0.3, -0.2)), y=-push)]
    if kind == "pressed":
        rise = dice.pick((0.0, 0.5, -0.5)) * stress / width
        return [Traction("top", x=stress * dice.pick((0.0, 0.05, -0.1)), y=Polynomial([[-stress], [rise]]))]
    friction = dice.pick(_FRICTION)
    if kind == "plate":
        offset = push * dice.pick((0.0, 0.1, -0.1))
        return [Contact("top", friction, -push, offset, name=_PLATE)]
    plate = RigidPlate(force_y=-stress * width, pivot=(width / 2, height))
    return [Contact("top", friction, name=_PLATE, plate=plate)]


def _side(dice: Dice, side: str, stress: float) -> Condition | Symmetry:
    """Free, held normally, or loaded."""
    kind = (
        dice.pick(("free", "free", "free", "symmetry", "loaded")) if side == "left" else dice.pick(("free", "loaded"))
    )
    if kind == "symmetry":
        return Symmetry(side)
    return Traction(side, x=stress * dice.pick((0.05, -0.1)) if kind == "loaded" else 0.0, y=0.0)
