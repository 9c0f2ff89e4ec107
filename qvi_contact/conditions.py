"""Boundary conditions on named edge sets, one Cartesian component at a time.

With stresses as the unknown, a prescribed traction is the essential condition and a prescribed displacement the
natural one. Every boundary edge needs exactly one condition for each of its two Cartesian components.

Signs: n is the outward normal; the tangent is the coordinate direction along the edge (+x on horizontal edges, +y on
vertical ones), whichever way the edge faces. σ_N = n·σn is negative under pressure, σ_T is the tangential component of
the traction σn, u_N and u_T are the components of the displacement.
"""

from dataclasses import dataclass
from typing import TypeAlias

from qvi_contact.checks import Field, check_field
from qvi_contact.errors import InputError


def _check_components(kind: str, x: Field | None, y: Field | None) -> None:
    if x is None and y is None:
        raise InputError(f"{kind}.x", None, "give at least one of the components x and y")
    for name, value in (("x", x), ("y", y)):
        if value is not None:
            check_field(f"{kind}.{name}", value)


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

    Notes
    -----
    Exact if the normal component is linear along each cell edge, and the tangential one continuous and quadratic
    along each. Anything else is projected so that the resultant force and moment of every cell edge are kept.

    """

    edges: str
    x: Field | None = None
    y: Field | None = None

    def __post_init__(self) -> None:
        _check_components("Traction", self.x, self.y)


@dataclass(frozen=True)
class Displacement:
    """Prescribed displacement (1.4).

    Parameters
    ----------
    edges : str
        Name of an edge set of the mesh.
    x, y : float or function of (x, y), optional
        Cartesian components of the displacement [length]; None leaves a component to another condition.

    """

    edges: str
    x: Field | None = None
    y: Field | None = None

    def __post_init__(self) -> None:
        _check_components("Displacement", self.x, self.y)


@dataclass(frozen=True)
class Symmetry:
    """Line of symmetry: no normal displacement, no tangential traction.

    Parameters
    ----------
    edges : str
        Name of an edge set of the mesh.

    """

    edges: str


@dataclass(frozen=True)
class Contact:
    """Unilateral contact with Coulomb friction against a rigid obstacle (1.6).

        u_N ≤ g,   σ_N ≤ 0,   (u_N − g) σ_N = 0
        |σ_T| ≤ μ|σ_N|,   |σ_T| < μ|σ_N| ⇒ u_T = w,   (u_T − w) σ_T ≤ 0

    Parameters
    ----------
    edges : str
        Name of an edge set of the mesh.
    friction : float or function of (x, y)
        Coefficient of friction μ ≥ 0.
    gap : float or function of (x, y)
        Position g of the obstacle along the outward normal [length]: positive where it stands away from the body,
        negative where a rigid plate is pushed into it.
    offset : float or function of (x, y)
        Tangential displacement w of the obstacle along the tangent [length].
    name : str, optional
        Key of this contact in the result; the edge set's name by default.

    """

    edges: str
    friction: Field
    gap: Field = 0.0
    offset: Field = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        check_field("Contact.friction", self.friction, minimum=0.0)
        check_field("Contact.gap", self.gap)
        check_field("Contact.offset", self.offset)
        if not isinstance(self.name, str):
            raise InputError("Contact.name", self.name, "give a string")
        if not self.name:
            object.__setattr__(self, "name", self.edges)


Condition: TypeAlias = Traction | Displacement | Symmetry | Contact
