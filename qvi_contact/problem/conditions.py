"""Boundary conditions on named edge sets, one component at a time.

With stresses as the unknown, a prescribed traction is the essential condition and a prescribed displacement the
natural one. Every boundary edge needs exactly one condition for each of two perpendicular components: the Cartesian
ones, or the normal and the tangential one.

A `Contact` on a joint inside the body rules no boundary edge.

Signs: n is the outward normal; the tangent t is the direction along the edge with t_x > 0, or t_y > 0 where t_x = 0 (+x
on horizontal edges, +y on vertical ones), whichever way the edge faces. σ_N = n·σn is negative under pressure, σ_T is
the tangential component of the traction σn, u_N and u_T are the components of the displacement.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, Literal, TypeAlias, get_args

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, check_field, finite_number, one_of, positive_number
from qvi_contact.errors import InputError
from qvi_contact.problem.fields import Expression

Law: TypeAlias = Literal["unilateral", "bilateral", "tied"]
"""What a contact does across its line: it may open, it keeps its distance, or it does not move at all."""


CARTESIAN: Final = ("x", "y")
LOCAL: Final = ("normal", "tangential")


def components(condition: Traction | Displacement) -> dict[str, Field]:
    """The components that a condition gives, by name: "x", "y" or "normal", "tangential"."""
    values = {name: getattr(condition, name) for name in (*CARTESIAN, *LOCAL)}
    return {name: value for name, value in values.items() if value is not None}


def _check_edges(condition: Condition) -> None:
    edges: object = condition.edges
    if not isinstance(edges, str):
        raise InputError(f"{type(condition).__name__}.edges", edges, "give the name of an edge set of the mesh")


def _check_components(condition: Traction | Displacement) -> None:
    kind, given = type(condition).__name__, components(condition)
    if not given:
        raise InputError(f"{kind}.x", None, "give at least one of the components x and y, or normal and tangential")
    if given.keys() & set(CARTESIAN) and given.keys() & set(LOCAL):
        mixed = " and ".join(given)
        raise InputError(
            f"{kind}.{next(iter(given))}", mixed, "give x and y, or normal and tangential, not one of each"
        )
    for name, value in given.items():
        check_field(f"{kind}.{name}", value)


def _name_after_edges(condition: Traction | Contact, kind: str) -> None:
    """Check the name, and take that of the edge set if there is none."""
    if not isinstance(condition.name, str):
        raise InputError(f"{kind}.name", condition.name, "give a string")
    if not condition.name:
        object.__setattr__(condition, "name", condition.edges)


@dataclass(frozen=True)
class Traction:
    """Prescribed traction σn (1.5).

    Parameters
    ----------
    edges : str
        Name of an edge set of the mesh.
    x, y : float or function of (x, y), optional
        Cartesian components of the traction that acts on the body [stress]; None leaves a component to another
        condition.
    name : str, optional
        What a limit analysis calls this load; the edge set's name by default.
    normal, tangential : float or function of (x, y), optional
        The components σ_N and σ_T instead [stress]: a pressure p is normal=−p.

    Notes
    -----
    Exact, on elements of degree p, if both components are polynomials of degree p − 2 along each edge. Anything else is
    projected so that the resultant force and moment of every cell edge are kept. They are integrated where the function
    jumps, bends or peaks inside an edge too, if that shows at 99 points of it: what is narrower than a hundredth of an
    edge may be missed.

    """

    edges: str
    x: Field | None = None
    y: Field | None = None
    name: str = ""
    normal: Field | None = field(default=None, kw_only=True)
    tangential: Field | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        _check_edges(self)
        _check_components(self)
        _name_after_edges(self, "Traction")


@dataclass(frozen=True)
class Displacement:
    """Prescribed displacement (1.4).

    Parameters
    ----------
    edges : str
        Name of an edge set of the mesh.
    x, y : float or function of (x, y), optional
        Cartesian components of the displacement [length]; None leaves a component to another condition.
    normal, tangential : float or function of (x, y), optional
        The components u_N and u_T instead [length].

    """

    edges: str
    x: Field | None = None
    y: Field | None = None
    normal: Field | None = field(default=None, kw_only=True)
    tangential: Field | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        _check_edges(self)
        _check_components(self)


@dataclass(frozen=True)
class Symmetry:
    """Line of symmetry: no normal displacement, no tangential traction.

    Parameters
    ----------
    edges : str
        Name of an edge set of the mesh.

    """

    edges: str

    def __post_init__(self) -> None:
        _check_edges(self)


DRIVES: Final = {"force_x": "x", "force_y": "y", "moment": "rotation"}
"""What drives a rigid plate in each component: a force or moment, or a motion."""


@dataclass(frozen=True)
class RigidPlate:
    """A rigid obstacle, such as a plate, a stamp or a pin, that moves as a whole.

    On every point of its contact, whichever way the edge there faces, its motion (x, y, rotation) adds

        u = (x − rotation (y − y₀),   y + rotation (x − x₀))

    to where the obstacle stands: n·u to `gap`, t·u to `offset`. For each force or moment given, the resultant of the
    tractions on the body is prescribed,

        ∫ t_x ds = force_x,   ∫ t_y ds = force_y,   ∫ [(x − x₀) t_y − (y − y₀) t_x] ds = moment,

    and the motion in that component is unknown: the multiplier of the equation. In a component with neither force nor
    motion the plate stands still.

    Parameters
    ----------
    force_x, force_y : float, optional
        Force on the body a unit of thickness [stress × length]; a plate that presses down on the top has force_y < 0.
    moment : float, optional
        Moment on the body about the pivot, counterclockwise [stress × length²].
    pivot : (float, float)
        The point (x₀, y₀) that the moment and the plate's rotation refer to [length].
    x, y : float, optional
        Displacement of the pivot [length], instead of the force.
    rotation : float, optional
        Rotation about the pivot, counterclockwise [rad], instead of the moment.

    """

    force_x: float | None = None
    force_y: float | None = None
    moment: float | None = None
    pivot: tuple[float, float] = (0.0, 0.0)
    x: float | None = field(default=None, kw_only=True)
    y: float | None = field(default=None, kw_only=True)
    rotation: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        names = [name for pair in DRIVES.items() for name in pair if getattr(self, name) is not None]
        if not names:
            remedy = "give at least one of force_x, force_y, moment, x, y and rotation: x = 0 if it stands still"
            raise InputError("RigidPlate", None, remedy)
        for name in names:
            finite_number(f"RigidPlate.{name}", getattr(self, name))
            if DRIVES.get(name) in names:
                remedy = f"{DRIVES[name]} is given too: what moves a plate is a force or a motion, leave one out"
                raise InputError(f"RigidPlate.{name}", getattr(self, name), remedy)
        if not isinstance(self.pivot, (tuple, list)) or len(self.pivot) != 2:
            raise InputError("RigidPlate.pivot", self.pivot, "give a pair (x, y)")
        object.__setattr__(self, "pivot", tuple(finite_number("RigidPlate.pivot", value) for value in self.pivot))

    @property
    def driven(self) -> bool:
        """Whether a force or moment is given."""
        return any(getattr(self, name) is not None for name in DRIVES)

    def displacement(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """The given motion at points x, y [length], shape (2, *shape) [length]; zero in components driven by force."""
        turn = self.rotation or 0.0
        along_x = (self.x or 0.0) - turn * (y - self.pivot[1])
        return np.stack([along_x, (self.y or 0.0) + turn * (x - self.pivot[0])])

    def reference(self, x: float, y: float) -> tuple[float, float]:
        """Arms of the moment count from here [length]: x, y as far as the forces that go with them are given."""
        return x if self.force_y is not None else self.pivot[0], y if self.force_x is not None else self.pivot[1]

    def moment_about(self, x: float, y: float) -> float:
        """The given moment about the pivot, less that of the given forces acting at (x, y) [stress × length²]."""
        x, y = self.reference(x, y)
        forces = (x - self.pivot[0]) * (self.force_y or 0.0) - (y - self.pivot[1]) * (self.force_x or 0.0)
        return (self.moment or 0.0) - forces


def disc_gap(centre: tuple[float, float], radius: float) -> Expression:
    """The distance from points to a disc [length], negative inside it."""
    away = ", ".join(
        f"{name} {'-' if at > 0.0 else '+'} {abs(at)!r}" if at else name
        for name, at in zip("xy", (finite_number("centre", value) for value in centre), strict=True)
    )
    return Expression(f"hypot({away}) - {positive_number('radius', radius)!r}")


@dataclass(frozen=True)
class Contact:
    """Contact with dry friction, against a rigid obstacle (1.6) or between two blocks of the body.

        σ_N ≤ 0,   u_N ≤ g,   (u_N − g) σ_N = 0                             unilateral
        u_N = g                                                             bilateral, tied
        |σ_T| ≤ b(σ_N) = min(c + μ|σ_N|, t_max)
        |σ_T| < b ⇒ u_T = w,   (u_T − w) σ_T ≤ 0                            unilateral, bilateral
        u_T = w                                                             tied

    A fluid of pressure p_w in the contact presses the sides apart, and the law holds for the effective normal stress
    σ_N' = σ_N + p_w in the place of σ_N: σ_N' ≤ 0, (u_N − g) σ_N' = 0, |σ_T| ≤ min(c + μ|σ_N'|, t_max). An open contact
    then carries σ_N = −p_w.

    On a joint (an edge set made by `with_joint` of the mesh) u stands for the displacement of the lower or left block
    less that of the upper or right one, n points from the former to the latter, and g is how far the joint stands open
    without load.

    Parameters
    ----------
    edges : str
        Name of an edge set or joint of the mesh.
    friction : float or function of (x, y)
        Coefficient of friction μ ≥ 0. With μ = 0 and a cohesion the law is Tresca's.
    gap : float or function of (x, y)
        Position g of the obstacle along the outward normal [length]: positive where it stands away from the body,
        negative where a rigid plate is pushed into it.
    offset : float or function of (x, y)
        Tangential displacement w of the obstacle along the tangent [length].
    name : str, optional
        Key of this contact in the result; the edge set's name by default.
    cohesion : float or function of (x, y)
        Cohesion c ≥ 0 [stress]. It acts wherever the law does, also where the contact is open.
    shear_limit : float or function of (x, y), optional
        Cap t_max ≥ 0 of |σ_T| [stress].
    law : "unilateral", "bilateral" or "tied"
        Whether the contact may open and slip, slip only, or neither. A tied contact takes no friction, cohesion or
        limit.
    plate : RigidPlate, optional
        Moves the obstacle as a rigid body, by force and moment or by a motion; not on joints. Forces are the resultants
        of the total stress, of the obstacle's own pressure and the fluid's.
    pore_pressure : float or function of (x, y)
        Pressure p_w ≥ 0 of a fluid in the contact [stress], such as uplift under a dam. It is given, not computed, and
        acts whether the contact is open or closed. A tied contact takes none.

    """

    edges: str
    friction: Field
    gap: Field = 0.0
    offset: Field = 0.0
    name: str = ""
    cohesion: Field = 0.0
    shear_limit: Field | None = None
    law: Law = "unilateral"
    plate: RigidPlate | None = None
    pore_pressure: Field = 0.0

    def __post_init__(self) -> None:
        _check_edges(self)
        check_field("Contact.friction", self.friction, minimum=0.0)
        check_field("Contact.gap", self.gap)
        check_field("Contact.offset", self.offset)
        check_field("Contact.cohesion", self.cohesion, minimum=0.0)
        if self.shear_limit is not None:
            check_field("Contact.shear_limit", self.shear_limit, minimum=0.0)
        check_field("Contact.pore_pressure", self.pore_pressure, minimum=0.0)
        _name_after_edges(self, "Contact")
        one_of("Contact.law", self.law, get_args(Law))
        if self.plate is not None and not isinstance(self.plate, RigidPlate):
            raise InputError("Contact.plate", self.plate, "give a RigidPlate")
        limiting: dict[str, Any] = {"friction": 0.0, "cohesion": 0.0, "shear_limit": None, "pore_pressure": 0.0}
        for name, absent in limiting.items():
            value = getattr(self, name)
            if self.law == "tied" and (callable(value) or value != absent):
                raise InputError(f"Contact.{name}", value, "a tied contact neither opens nor slips: leave this out")

    @property
    def has_fluid(self) -> bool:
        """Whether a pore pressure is given."""
        return callable(self.pore_pressure) or self.pore_pressure != 0.0

    @classmethod
    def tresca(cls, edges: str, bound: Field, gap: Field = 0.0, offset: Field = 0.0, name: str = "") -> Contact:
        """Unilateral contact with Tresca's law |σ_T| ≤ bound [stress], whatever the pressure."""
        return cls(edges, 0.0, gap, offset, name, cohesion=bound)

    @classmethod
    def pin(
        cls,
        edges: str,
        friction: Field,
        centre: tuple[float, float],
        radius: float,
        *,
        name: str = "",
        force_x: float | None = None,
        force_y: float | None = None,
        moment: float | None = None,
        x: float | None = None,
        y: float | None = None,
        rotation: float | None = None,
    ) -> Contact:
        """A rigid round pin or disc of this centre and radius, that moves as `RigidPlate` does about its centre.

        The gap is the distance from the body to the disc, √((x − x₀)² + (y − y₀)²) − radius; negative where the disc is
        larger than its hole. Motions are small.
        """
        plate = RigidPlate(force_x, force_y, moment, centre, x=x, y=y, rotation=rotation)
        return cls(edges, friction, disc_gap(plate.pivot, radius), name=name, plate=plate)

    @classmethod
    def frictionless(cls, edges: str, gap: Field = 0.0, name: str = "") -> Contact:
        """Unilateral contact without friction (Signorini)."""
        return cls(edges, 0.0, gap, 0.0, name)

    @classmethod
    def tied(cls, edges: str, gap: Field = 0.0, offset: Field = 0.0, name: str = "") -> Contact:
        """Neither opens nor slips: u_N = g, u_T = w; reports tractions like any contact."""
        return cls(edges, 0.0, gap, offset, name, law="tied")


Condition: TypeAlias = Traction | Displacement | Symmetry | Contact


def has_coulomb(contact: Contact) -> bool:
    """Whether the friction bound depends on the pressure."""
    limited = not callable(contact.shear_limit) and contact.shear_limit == 0.0
    return contact.law != "tied" and not limited and (callable(contact.friction) or contact.friction != 0.0)


def is_frictionless(contact: Contact) -> bool:
    """Whether a contact is open or closed, with nothing that could stick or slip."""
    return contact.law != "tied" and not bears_shear(contact)


def bears_shear(contact: Contact) -> bool:
    """Whether a contact that is not tied has friction or cohesion."""
    fields = (contact.friction, contact.cohesion)
    return contact.law != "tied" and any(callable(field) or field != 0.0 for field in fields)
