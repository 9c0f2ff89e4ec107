"""Boundary conditions on named edge sets, one component at a time.

With stresses as the unknown, a prescribed traction is the essential condition and a prescribed displacement the
natural one. Every boundary edge needs exactly one condition for each of two perpendicular components: the Cartesian
ones, or the normal and the tangential one.

A `Contact` on a joint inside the body is no condition of a boundary edge.

Signs: n is the outward normal. The tangent t is the direction along the edge with t_x > 0, or t_y > 0 where |t_x| is at
most 1e-5 (+x on horizontal edges, +y on vertical ones), whichever way the edge faces. On a joint around a block t is n
turned clockwise, also on vertical edges, so one offset all around turns the block. σ_N = n·σn is negative under
pressure, σ_T = t·σn is the tangential traction, u_N = n·u and u_T = t·u are the components of the displacement.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Final, Literal, TypeAlias

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, acts, finite_number, positive_number
from qvi_contact.basics.schema import Checked, Key, Name, Positive, Scalar, Table, Varying, defaults_of, key, keys_of
from qvi_contact.errors import InputError
from qvi_contact.problem.fields import Expression

Law: TypeAlias = Literal["unilateral", "bilateral", "tied"]
"""Kind of contact: it may open and slip; it slips, but keeps the gap closed; or it neither opens nor slips."""

Driven: TypeAlias = Annotated[float, Scalar()]
"""A number, written in problem files also as an expression of constants and the pseudo-time t."""

_STIFF: Final = Varying(0.0, instead="leave it out if it is rigid, and the contact if the side is free")

SHEAR_LAW: Final = ("friction", "cohesion", "shear_limit")
"""Data of a contact that bound its shear by min(c + μ|σ_N|, t_max): μ without a unit, c and t_max [stress]."""

SPRINGS: Final = ("normal_stiffness", "tangential_stiffness")
"""Data of a contact with springs, normal and tangential to its line."""

CARTESIAN: Final = ("x", "y")
LOCAL: Final = ("normal", "tangential")


def components(condition: Traction | Displacement) -> dict[str, Field]:
    """The components that a condition gives, by name: "x", "y" or "normal", "tangential"."""
    return {name: value for name in (*CARTESIAN, *LOCAL) if (value := getattr(condition, name)) is not None}


class _ByComponents(Checked):
    """A condition with one or two components, either Cartesian or normal and tangential; else `InputError`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        condition: Any = self
        kind, given = type(self).__name__, components(condition)
        if not given:
            raise InputError(f"{kind}.x", None, "give at least one of the components x and y, or normal and tangential")
        if given.keys() & set(CARTESIAN) and given.keys() & set(LOCAL):
            remedy = "give x and y, or normal and tangential, not one of each"
            raise InputError(f"{kind}.{next(iter(given))}", " and ".join(given), remedy)


@dataclass(frozen=True)
class Traction(_ByComponents):
    """Prescribed traction σn (1.5).

    With elements of degree p, tractions whose components are polynomials of degree p − 2 along each edge are met
    exactly. Other tractions are projected onto these polynomials; the projection keeps the resultant force and moment
    of every edge. The integrals are also accurate where the function jumps, bends or peaks inside an edge, as far as 99
    sample points on the edge show it: a peak narrower than a hundredth of the edge may be missed.
    """

    edges: str
    """Name of an edge set of the mesh: `edges = "right"`."""
    x: Field | None = None
    y: Field | None = None
    """Cartesian component of the traction on the body [stress]; if left out, another condition gives it: `x = 0.0`."""
    name: Name = field(default="", metadata=key(like="edges"))
    """Name of this load in a limit analysis; the edge set's name by default: `name = "thrust"`."""
    normal: Field | None = field(default=None, kw_only=True)
    tangential: Field | None = field(default=None, kw_only=True)
    """Component σ_N or σ_T instead [stress]; a pressure p is normal = −p. The tangent points to the right, or up on
    vertical edges, also around a hole or a shaft; a torque there is given by x and y: `normal = -10.0`."""


@dataclass(frozen=True)
class Displacement(_ByComponents):
    """Prescribed displacement (1.4)."""

    edges: str
    """Name of an edge set of the mesh: `edges = "top"`."""
    x: Field | None = None
    y: Field | None = None
    """Cartesian component of the displacement [length]; if left out, another condition gives it: `x = "-1e-3 * t"`."""
    normal: Field | None = field(default=None, kw_only=True)
    tangential: Field | None = field(default=None, kw_only=True)
    """Component u_N or u_T instead [length], with the same tangent as for tractions: `normal = 0.0`."""


@dataclass(frozen=True)
class Symmetry(Checked):
    """Line of symmetry: u_N = 0 and σ_T = 0."""

    edges: str
    """Name of an edge set of the mesh: `edges = "left"`."""


DRIVES: Final = {"force_x": "x", "force_y": "y", "moment": "rotation"}
"""Names of the force or moment that drives a component of a rigid plate, and of the motion that can replace it."""


@dataclass(frozen=True)
class RigidMotion:
    """A small motion u(x) of a rigid body."""

    x: float
    y: float
    """Translation of the centre [length]."""
    rotation: float
    """Rotation, counterclockwise [rad]."""
    centre: tuple[float, float]
    """Centre of the rotation [length]; u(centre) is the translation."""

    def at(self, points: FloatArray) -> FloatArray:
        """Displacements of points (..., 2) [length]."""
        arm = np.asarray(points) - self.centre
        rotation_part = self.rotation * np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        return np.asarray(np.array([self.x, self.y]) + rotation_part)


@dataclass(frozen=True)
class RigidPlate(Checked):
    """A rigid obstacle, such as a plate, a stamp or a pin, that moves as a whole.

    The motion (x, y, rotation) of the plate displaces each point of the obstacle by

        u = (x − rotation (y − y₀),   y + rotation (x − x₀)).

    This adds n·u to the `gap` and t·u to the `offset` of the contact there. For each force or moment given, the
    resultant of the tractions on the body is prescribed,

        ∫ t_x ds = force_x,   ∫ t_y ds = force_y,   ∫ [(x − x₀) t_y − (y − y₀) t_x] ds = moment,

    and the motion in that component is unknown: it is the multiplier of the equation. Without a force or a motion the
    plate does not move in that component.
    """

    force_x: Driven | None = field(default=None, metadata=key(symbol="F_x", unit="force"))
    force_y: Driven | None = field(default=None, metadata=key(symbol="F_y", unit="force"))
    """Force on the body per unit of thickness [stress × length]; force_y < 0 presses down: `force_x = -10.0`."""
    moment: Driven | None = field(default=None, metadata=key(symbol="M", unit="moment"))
    """Moment on the body about the pivot, counterclockwise [stress × length²]: `moment = 0.0`."""
    pivot: tuple[float, float] = (0.0, 0.0)
    """The point (x₀, y₀) that the moment and the plate's rotation refer to [length]: `pivot = [0.5, 2.0]`."""
    x: Driven | None = field(default=None, kw_only=True, metadata=key(symbol="u_x", unit="length"))
    y: Driven | None = field(default=None, kw_only=True, metadata=key(symbol="u_y", unit="length"))
    """Displacement of the pivot along x or y [length], instead of the force: `x = "1e-3 * t"`."""
    rotation: Driven | None = field(default=None, kw_only=True, metadata=key(symbol="θ", unit="rotation"))
    """Rotation about the pivot, counterclockwise [rad], instead of the moment: `rotation = 0.0`."""

    def __post_init__(self) -> None:
        given = [name for pair in DRIVES.items() for name in pair if getattr(self, name) is not None]
        if not given:
            remedy = "give at least one of force_x, force_y, moment, x, y and rotation: x = 0 if it stands still"
            raise InputError("RigidPlate", None, remedy)
        super().__post_init__()
        for name in given:
            if DRIVES.get(name) in given:
                remedy = f"{DRIVES[name]} is given too: a plate is moved by a force or by a motion, leave one out"
                raise InputError(f"RigidPlate.{name}", getattr(self, name), remedy)

    @property
    def driven(self) -> bool:
        """Whether a force or moment is given."""
        return any(getattr(self, name) is not None for name in DRIVES)

    def displacement(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """The given motion at points x, y [length], shape (2, *shape) [length]; zero in components driven by force."""
        motion = RigidMotion(self.x or 0.0, self.y or 0.0, self.rotation or 0.0, self.pivot)
        return np.moveaxis(motion.at(np.stack([x, y], axis=-1)), -1, 0)

    def reference(self, x: float, y: float) -> tuple[float, float]:
        """Origin of the moment's arms [length]: x if force_y is given, y if force_x is given, otherwise the pivot's."""
        return x if self.force_y is not None else self.pivot[0], y if self.force_x is not None else self.pivot[1]

    def moment_about(self, x: float, y: float) -> float:
        """Moment about (x, y) of the given moment and the given forces, which act at the pivot [stress × length²]."""
        x, y = self.reference(x, y)
        forces = (x - self.pivot[0]) * (self.force_y or 0.0) - (y - self.pivot[1]) * (self.force_x or 0.0)
        return (self.moment or 0.0) - forces


def disc_gap(centre: tuple[float, float], radius: float) -> Expression:
    """The distance from points to a disc [length], negative inside it."""
    differences = ", ".join(
        f"{name} {'-' if at > 0.0 else '+'} {abs(at)!r}" if at else name
        for name, at in zip("xy", (finite_number("centre", value) for value in centre), strict=True)
    )
    return Expression(f"hypot({differences}) - {positive_number('radius', radius)!r}")


@dataclass(frozen=True, kw_only=True)
class Pin(RigidPlate):
    """A rigid round pin or disc in a problem file; it moves as a `RigidPlate` and gives a contact's gap and plate."""

    pivot: tuple[float, float] = field(default=(0.0, 0.0), metadata={"key": None})  # no key: the pivot is the centre
    centre: tuple[float, float]
    """Centre, before it moves [length]: `centre = [0.0, 0.0]`."""
    radius: Positive
    """Radius [length]: `radius = 9.95`."""


@dataclass(frozen=True)
class Contact(Checked):
    """Contact with dry friction, against a rigid obstacle (1.6) or between two blocks of the body.

        σ_N ≤ 0,   u_N ≤ g,   (u_N − g) σ_N = 0                             unilateral
        u_N = g                                                             bilateral, tied
        |σ_T| ≤ b(σ_N) = min(c + μ|σ_N|, t_max)
        |σ_T| < b ⇒ u_T = w,   (u_T − w) σ_T ≤ 0                            unilateral, bilateral
        u_T = w                                                             tied

    A fluid of pressure p_w in the contact presses the sides apart. The law then holds for the effective normal stress
    σ_N' = σ_N + p_w: σ_N' ≤ 0, (u_N − g) σ_N' = 0, |σ_T| ≤ min(c + μ|σ_N'|, t_max). An open contact has σ_N = −p_w.

    On a joint (an edge set made by the mesh's `with_joint`) u is the displacement of the lower or left block minus that
    of the upper or right block, n points from the first block to the second, and g is the opening without load.
    """

    edges: str
    """Name of an edge set or joint of the mesh: `edges = "bottom"`."""
    friction: Field = field(metadata=key(kind=Varying(0.0), needed=False, tied=False, symbol="μ"))
    """Coefficient of friction μ ≥ 0; problem files may omit it for tied contacts. With μ = 0 and a cohesion the law is
    Tresca's: `friction = 0.3`."""
    gap: Field = field(default=0.0, metadata=key(symbol="gap", unit="length"))
    """Position g of the obstacle along the outward normal [length]: positive for an obstacle at a distance from the
    body, negative for one that is pushed into the body: `gap = -1e-3`."""
    offset: Field = field(default=0.0, metadata=key(symbol="offset", unit="length"))
    """Tangential displacement w of the obstacle [length], to the right, or up on vertical edges. On joints the
    displacement of the lower or left block relative to the other; on a closed joint of the block inside, clockwise:
    `offset = "1e-3 * sin(t)"`."""
    name: Name = field(default="", metadata=key(like="edges"))
    """Key of this contact in the result; the edge set's name by default: `name = "base"`."""
    cohesion: Field = field(default=0.0, metadata=key(kind=Varying(0.0), tied=False, symbol="c", unit="stress"))
    """Cohesion c ≥ 0 [stress]. It acts on the whole contact, also where it is open: `cohesion = 0.1`."""
    shear_limit: Field | None = field(
        default=None, metadata=key(kind=Varying(0.0), tied=False, symbol="t_max", unit="stress")
    )
    """Largest shear stress t_max ≥ 0 [stress]: `shear_limit = 5.0`."""
    law: Law = "unilateral"
    """Whether the contact may open and slip, slip only, or neither. A tied contact takes no friction, cohesion or
    limit: `law = "bilateral"`."""
    plate: RigidPlate | None = None
    """Makes the obstacle a rigid plate, moved by force and moment or by a motion; not on joints. The forces are the
    resultants of the total stress: contact pressure plus fluid pressure: `plate = { force_y = -10.0 }`."""
    pore_pressure: Field = field(default=0.0, metadata=key(kind=Varying(0.0), tied=False, symbol="p_w", unit="stress"))
    """Given pressure p_w ≥ 0 of a fluid in the contact [stress], such as uplift under a dam. It acts whether the
    contact is open or closed. A tied contact takes none: `pore_pressure = "0.01 * (40 - y)"`."""
    normal_stiffness: Field | None = field(default=None, metadata=key(kind=_STIFF, symbol="k_N", unit="stiffness"))
    tangential_stiffness: Field | None = field(default=None, metadata=key(kind=_STIFF, symbol="k_T", unit="stiffness"))
    """Stiffness k_N or k_T of springs along the edges [stress/length], such as a bed or a compliant joint. The law,
    and the result's gap and slip, take u_N + σ_N'/k_N and u_T + σ_T/k_T for u_N and u_T: `normal_stiffness = 50.0`."""

    in_files: ClassVar[dict[str, Key]] = {"pin": Key(Table(Pin), needed=False)}
    """Rigid pin, see `pin`, instead of gap and plate: `pin = { centre = [0, 0], radius = 9.95, force_x = 10.0 }`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, schema_key in keys_of(Contact).items() if self.law == "tied" else ():
            value = getattr(self, name)
            if not schema_key.tied and (callable(value) or value != defaults_of(Contact).get(name, 0.0)):
                raise InputError(f"Contact.{name}", value, "a tied contact neither opens nor slips: leave this out")

    @classmethod
    def from_file(cls, *, pin: Pin | None = None, **values: Any) -> Contact:
        """The contact of a table of a problem file, in which a pin may give gap and plate."""
        if values.get("law") == "tied":
            values.setdefault("friction", 0.0)
        if "friction" not in values:
            raise InputError("friction", None, "give the coefficient of friction, 0.0 if there is none")
        if pin is not None:
            if "plate" in values or values.get("gap", 0.0) != 0.0:
                remedy = "a pin gives the gap and its own motion: leave out gap and plate, or the pin"
                raise InputError("pin", None, remedy)
            drives = {name: getattr(pin, name) for pair in DRIVES.items() for name in pair}
            values |= {"gap": disc_gap(pin.centre, pin.radius), "plate": RigidPlate(**drives, pivot=pin.centre)}
        return cls(**values)

    @property
    def has_springs(self) -> bool:
        """Whether the contact has springs, normal or tangential."""
        return self.normal_stiffness is not None or self.tangential_stiffness is not None

    @property
    def has_fluid(self) -> bool:
        """Whether a pore pressure is given."""
        return acts(self.pore_pressure)

    @classmethod
    def tresca(cls, edges: str, bound: Field, gap: Field = 0.0, offset: Field = 0.0, name: str = "") -> Contact:
        """Unilateral contact with Tresca's law |σ_T| ≤ bound [stress], whatever the pressure."""
        return cls(edges, 0.0, gap, offset, name, cohesion=bound)

    @classmethod
    def pin(
        cls, edges: str, friction: Field, centre: tuple[float, float], radius: float, *, name: str = "", **drives: Any
    ) -> Contact:
        """A rigid round pin or disc of this centre and radius; it moves as a `RigidPlate` with its pivot in the centre.

        `drives` are force_x, force_y, moment, x, y or rotation of the plate. The gap is the distance from the body to
        the disc, √((x − x₀)² + (y − y₀)²) − radius; negative where the disc is larger than its hole. Motions are small.
        """
        plate = RigidPlate(**drives, pivot=centre)
        return cls(edges, friction, disc_gap(plate.pivot, radius), name=name, plate=plate)

    @classmethod
    def frictionless(cls, edges: str, gap: Field = 0.0, name: str = "") -> Contact:
        """Unilateral contact without friction (Signorini)."""
        return cls(edges, 0.0, gap, 0.0, name)

    @classmethod
    def tied(cls, edges: str, gap: Field = 0.0, offset: Field = 0.0, name: str = "") -> Contact:
        """Tied contact, which neither opens nor slips: u_N = g, u_T = w. The result has its tractions too."""
        return cls(edges, 0.0, gap, offset, name, law="tied")


Condition: TypeAlias = Traction | Displacement | Symmetry | Contact


def has_coulomb(contact: Contact) -> bool:
    """Whether the friction bound depends on the pressure."""
    shear_free = contact.shear_limit is not None and not acts(contact.shear_limit)
    return contact.law != "tied" and not shear_free and acts(contact.friction)


def bears_shear(contact: Contact) -> bool:
    """Whether a contact that is not tied has friction or cohesion."""
    return contact.law != "tied" and (acts(contact.friction) or acts(contact.cohesion))
