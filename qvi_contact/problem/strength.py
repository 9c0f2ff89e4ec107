"""What a material can carry: yield criteria, as cones on the stresses.

With S = σ_xx + σ_yy and R = |(σ_xx − σ_yy, 2σ_xy)|, the difference of the principal stresses in the plane, every
criterion here is a list of second-order cones

    |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S,

compression being negative. The flow rule is associated: a body that yields flows along the normal of its cones.

| strength     | plane strain                                | plane stress, in addition or instead                 |
|--------------|---------------------------------------------|------------------------------------------------------|
| Tresca       | R ≤ 2c                                      | R ≤ 4c − S,  R ≤ 4c + S                              |
| Mises        | R ≤ 2σ_0/√3                                 | |(S/√3, σ_xx − σ_yy, 2σ_xy)| ≤ 2σ_0/√3 instead       |
| MohrCoulomb  | R ≤ 2c cos φ − S sin φ;  R ≤ 2t − S         | R ≤ 2f_t − S,  R ≤ 2f_c + S                          |
| NoTension    | R ≤ −S;  R ≤ 2f + S                         | the same                                             |

with f_t = 2c cos φ/(1 + sin φ) and f_c = 2c cos φ/(1 − sin φ).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal, NamedTuple, TypeAlias

from qvi_contact.basics.checks import Field
from qvi_contact.basics.schema import Scalar, Varying, check_keys
from qvi_contact.errors import InputError

Strong: TypeAlias = Annotated[Field, Varying(0.0, positive=True)]


class YieldCone(NamedTuple):
    """One cone |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S.

    Attributes
    ----------
    name : str
        What messages call the field behind a, such as "Tresca.c".
    field : float or function of (x, y)
        The field, at least 0 [stress].
    factor : float
        a over that field.
    pressure : float
        β.
    mean : float
        γ.

    """

    name: str
    field: Field
    factor: float
    pressure: float = 0.0
    mean: float = 0.0


@dataclass(frozen=True)
class Tresca:
    """Largest shear stress: half the difference of the principal stresses is at most c. For undrained clay c is s_u.

    Parameters
    ----------
    c : float or function of (x, y)
        Strength in shear, positive [stress]; half the yield stress in tension: `c = 20.0`.

    """

    c: Strong
    kind: ClassVar[str] = "tresca"

    def __post_init__(self) -> None:
        check_keys(self)

    def cones(self, plane: Literal["stress", "strain"]) -> Iterator[YieldCone]:
        """Its cones in that plane state."""
        yield YieldCone("Tresca.c", self.c, 2.0)
        if plane == "stress":
            yield YieldCone("Tresca.c", self.c, 4.0, 1.0)
            yield YieldCone("Tresca.c", self.c, 4.0, -1.0)


@dataclass(frozen=True)
class Mises:
    """Von Mises: the equivalent stress is at most the yield stress. In plane strain a Tresca body with c = σ_0/√3.

    Parameters
    ----------
    yield_stress : float or function of (x, y)
        Yield stress σ_0 in tension, positive [stress]: `yield_stress = 235.0`.

    """

    yield_stress: Strong
    kind: ClassVar[str] = "mises"

    def __post_init__(self) -> None:
        check_keys(self)

    def cones(self, plane: Literal["stress", "strain"]) -> Iterator[YieldCone]:
        """Its cone in that plane state."""
        mean = 1.0 / math.sqrt(3.0) if plane == "stress" else 0.0
        yield YieldCone("Mises.yield_stress", self.yield_stress, 2.0 / math.sqrt(3.0), 0.0, mean)


@dataclass(frozen=True)
class MohrCoulomb:
    """Cohesion and friction: |τ| ≤ c − σ tan φ on every plane, and no tension above the cut-off.

    Parameters
    ----------
    c : float or function of (x, y)
        Cohesion, at least 0 [stress]: `c = 20.0`.
    phi : float
        Angle of friction φ, from 0 to below π/2 [rad]: `phi = "30 * pi / 180"`.
    tension : float or function of (x, y), optional
        Largest tensile stress t, at least 0 [stress]; without it c cot φ is: `tension = 0.0`.

    """

    c: Annotated[Field, Varying(0.0)]
    phi: Annotated[float, Scalar()]
    tension: Annotated[Field, Varying(0.0)] | None = None
    kind: ClassVar[str] = "mohr-coulomb"

    def __post_init__(self) -> None:
        check_keys(self)
        phi = float(self.phi)
        if not 0.0 <= phi < math.pi / 2.0:
            remedy = "give the angle of friction in radians, from 0 to below pi/2: 30 degrees are 0.5236"
            raise InputError("MohrCoulomb.phi", phi, remedy)
        if phi == 0.0:
            Varying(0.0, positive=True).check("MohrCoulomb.c", self.c)

    def cones(self, plane: Literal["stress", "strain"]) -> Iterator[YieldCone]:
        """Its cones in that plane state."""
        sine, cosine = math.sin(self.phi), math.cos(self.phi)
        yield YieldCone("MohrCoulomb.c", self.c, 2.0 * cosine, sine)
        if plane == "stress":
            yield YieldCone("MohrCoulomb.c", self.c, 4.0 * cosine / (1.0 + sine), 1.0)
            yield YieldCone("MohrCoulomb.c", self.c, 4.0 * cosine / (1.0 - sine), -1.0)
        if self.tension is not None:
            yield YieldCone("MohrCoulomb.tension", self.tension, 2.0, 1.0)


@dataclass(frozen=True)
class NoTension:
    """Masonry after Heyman: no tension in any direction, and crushing at f if that is given.

    Parameters
    ----------
    crushing : float or function of (x, y), optional
        Strength f in compression, positive [stress]; without it there is no limit: `crushing = 4.0`.

    """

    crushing: Strong | None = None
    kind: ClassVar[str] = "no-tension"

    def __post_init__(self) -> None:
        check_keys(self)

    def cones(self, plane: Literal["stress", "strain"]) -> Iterator[YieldCone]:  # noqa: ARG002  # as in all of them
        """Its cones, the same in both plane states."""
        yield YieldCone("NoTension", 0.0, 2.0, 1.0)
        if self.crushing is not None:
            yield YieldCone("NoTension.crushing", self.crushing, 2.0, -1.0)


Strength: TypeAlias = Tresca | Mises | MohrCoulomb | NoTension
"""What a material can carry."""

STRENGTHS: Final[tuple[type, ...]] = (Tresca, Mises, MohrCoulomb, NoTension)
