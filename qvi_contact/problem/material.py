"""Materials: linear elastic in plane stress or plane strain, and what they can carry: yield criteria, as cones.

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

Initial strain: what temperature, shrinkage and prestress strain a body without stress, or stress without strain.

With α ΔT of `Material.expansion` and the temperature, the shrinkage s and the prestress σ_p, a free piece of material
strains by e = α ΔT − s in all directions of space, and the law of the body is

    c σ = ε(u) − ε⁰,      σ = C ε(u) + σ⁰,      σ⁰ = −C ε⁰ = σ_p − E e/(1 − ν) I      in plane stress,
                                                     = σ_p − E e/(1 − 2ν) I     in plane strain,

where ε⁰ = (1 + ν) e I, as the body is held along z. σ⁰ is the stress of a body that is held everywhere. It is what the
package computes with: the energies are

    J*(σ) = ½ ∫ cσ:σ dx + ∫ ε⁰:σ dx − …,      J(v) = ½ ∫ (ε(v) − ε⁰) : C : (ε(v) − ε⁰) dx − …
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal, NamedTuple, TypeAlias, cast

import numpy as np

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, acts, evaluate
from qvi_contact.basics.schema import Checked, Inline, Name, Positive, Scalar, Varying
from qvi_contact.errors import InputError
from qvi_contact.mesh.selection import new_name, triangles_in_box
from qvi_contact.mesh.triangles import TriangleMesh

if TYPE_CHECKING:
    from qvi_contact.problem.problem import ContactProblem

Plane: TypeAlias = Literal["stress", "strain"]
"""Whether σ_zz or ε_zz is zero."""

_STRONG: Final = Varying(0.0, instead="leave the strength out if the body does not yield")
Strong: TypeAlias = Annotated[Field, _STRONG]


class YieldCone(NamedTuple):
    """One cone |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S."""

    name: str
    """What messages call the field behind a, such as "Tresca.c"."""
    field: Field
    """The field, at least 0 [stress]."""
    factor: float | FloatArray
    """a over that field; an array where it is for several angles of friction."""
    pressure: float | FloatArray = 0.0
    """β."""
    mean: float = 0.0
    """γ."""


@dataclass(frozen=True)
class Tresca(Checked):
    """Largest shear stress: half the difference of the principal stresses is at most c. For undrained clay c is s_u."""

    c: Strong
    """Strength in shear, positive [stress]; half the yield stress in tension: `c = 20.0`."""
    kind: ClassVar[str] = "tresca"

    def cones(self, plane: Plane) -> Iterator[YieldCone]:
        """Its cones in that plane state."""
        yield YieldCone("Tresca.c", self.c, 2.0)
        if plane == "stress":
            yield YieldCone("Tresca.c", self.c, 4.0, 1.0)
            yield YieldCone("Tresca.c", self.c, 4.0, -1.0)


@dataclass(frozen=True)
class Mises(Checked):
    """Von Mises: the equivalent stress is at most the yield stress. In plane strain a Tresca body with c = σ_0/√3."""

    yield_stress: Strong
    """Yield stress σ_0 in tension, positive [stress]: `yield_stress = 235.0`."""
    kind: ClassVar[str] = "mises"

    def cones(self, plane: Plane) -> Iterator[YieldCone]:
        """Its cone in that plane state."""
        mean = 1.0 / math.sqrt(3.0) if plane == "stress" else 0.0
        yield YieldCone("Mises.yield_stress", self.yield_stress, 2.0 / math.sqrt(3.0), 0.0, mean)


@dataclass(frozen=True)
class MohrCoulomb(Checked):
    """Cohesion and friction: |τ| ≤ c − σ tan φ on every plane, and no tension above the cut-off.

    Where φ varies on a part of a triangle, limit loads count there from below with what each of its angles carries,
    from above with a cone around all of them. That has no end where φ begins at zero without a cut-off.
    """

    c: Annotated[Field, Varying(0.0)]
    """Cohesion, at least 0 [stress]: `c = 20.0`."""
    phi: Annotated[Field, Varying(0.0)]
    """Angle of friction φ, from 0 to below π/2 [rad]: `phi = "30 * pi / 180"`."""
    tension: Annotated[Field, Varying(0.0)] | None = None
    """Largest tensile stress t, at least 0 [stress]; without it c cot φ is: `tension = 0.0`."""
    kind: ClassVar[str] = "mohr-coulomb"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not callable(self.phi):
            self.angles(np.zeros(1), np.zeros(1))
            if self.phi == 0.0:
                _STRONG.check("MohrCoulomb.c", self.c)

    def angles(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """The angle of friction φ at points; `InputError` if it is out of its range."""
        phi = evaluate("MohrCoulomb.phi", self.phi, x, y, minimum=0.0)
        if (phi >= math.pi / 2.0).any():
            remedy = "give the angle of friction in radians, from 0 to below pi/2: 30 degrees are 0.5236"
            raise InputError("MohrCoulomb.phi", float(phi.max()), remedy)
        return phi

    def cones(self, plane: Plane, phi: FloatArray | float | None = None) -> Iterator[YieldCone]:
        """Its cones in that plane state, for given angles where φ is no number."""
        angle = cast("FloatArray | float", self.phi if phi is None else phi)
        sine, cosine = np.sin(angle), np.cos(angle)
        yield YieldCone("MohrCoulomb.c", self.c, 2.0 * cosine, sine)
        if plane == "stress":
            yield YieldCone("MohrCoulomb.c", self.c, 4.0 * cosine / (1.0 + sine), 1.0)
            yield YieldCone("MohrCoulomb.c", self.c, 4.0 * cosine / (1.0 - sine), -1.0)
        if self.tension is not None:
            yield YieldCone("MohrCoulomb.tension", self.tension, 2.0, 1.0)


@dataclass(frozen=True)
class NoTension(Checked):
    """Masonry after Heyman: no tension in any direction, and crushing at f if that is given."""

    crushing: Strong | None = None
    """Strength f in compression, positive [stress]; without it there is no limit: `crushing = 4.0`."""
    kind: ClassVar[str] = "no-tension"

    def cones(self, plane: Plane) -> Iterator[YieldCone]:  # noqa: ARG002  # as in all of them
        """Its cones, the same in both plane states."""
        yield YieldCone("NoTension", 0.0, 2.0, 1.0)
        if self.crushing is not None:
            yield YieldCone("NoTension.crushing", self.crushing, 2.0, -1.0)


Strength: TypeAlias = Tresca | Mises | MohrCoulomb | NoTension
"""What a material can carry."""


@dataclass(frozen=True)
class Material(Checked):
    """Isotropic linear elastic material."""

    young: Positive
    """Young's modulus E > 0 [stress]: `young = 2.1e5`."""
    poisson: float
    """Poisson's ratio ν: −1 < ν ≤ 0.5. In plane strain ν = 0.5 is an incompressible material: its compliance is
    singular, and a constant pressure must be determined by tractions, see `ContactProblem`: `poisson = 0.3`."""
    plane: Plane = "stress"
    """Plane stress or plane strain, κ = 0 or 1 in the compliance: `plane = "strain"`."""
    strength: Strength | None = None
    """What the material can carry in a limit analysis; without it any stress. `solve` stays elastic: `strength = { law
    = "tresca", c = 1.0 }`."""
    expansion: Annotated[float, Scalar()] = 0.0
    """Coefficient of thermal expansion α [1/temperature], see `ContactProblem.temperature`: `expansion = 1.2e-5`."""
    shrinkage: Field = 0.0
    """Strain by which a free piece contracts in all directions, such as that of concrete as it dries: `shrinkage =
    3e-4`."""
    prestress: tuple[Field, Field, Field] | None = None
    """Stress (xx, yy, xy) of the body where it is not strained [stress]: `prestress = [-2.0, 0.0, 0.0]`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not -1.0 < self.poisson <= 0.5:
            raise InputError("Material.poisson", self.poisson, "give a number above -1 and at most 0.5")
        with np.errstate(over="ignore"):
            if not np.isfinite(self.compliance).all() or not self.compliance[0, 0] > 0.0:
                raise InputError("Material.young", self.young, "is beyond double precision: take other units")

    @property
    def incompressible(self) -> bool:
        """Whether a constant pressure in the plane strains it not at all: plane strain with ν = 0.5."""
        return self.plane == "strain" and self.poisson == 0.5

    @property
    def compliance(self) -> FloatArray:
        """Compliance c, shape (3, 3) [1/stress], with (ε_xx, ε_yy, 2ε_xy) = c (σ_xx, σ_yy, σ_xy).

            c11 = c22 = [(1+ν) − ν(1+κν)] / E,   c12 = −ν(1+κν) / E,   c33 = 2(1+ν) / E

        Equation (1.3) of Więckowski (1992), κ = 0 in plane stress and 1 in plane strain, with engineering shear.
        """
        nu = self.poisson
        kappa = 1.0 if self.plane == "strain" else 0.0
        coupling = nu * (1.0 + kappa * nu)
        direct = 1.0 + nu - coupling
        matrix = np.array([[direct, -coupling, 0.0], [-coupling, direct, 0.0], [0.0, 0.0, 2.0 * (1.0 + nu)]])
        return matrix / self.young


@dataclass(frozen=True)
class Region(Checked):
    """A part of the body with a material of its own: a named region of the mesh, or what lies in ranges of x and y.

    Across the border the tractions agree and the bodies are bonded.
    """

    material: Annotated[Material, Inline(Material, ("plane",))]
    """Its material, in the plane state of the rest of the body."""
    x: tuple[float, float] | None = None
    y: tuple[float, float] | None = None
    """Range along x or y [length] that ends on edges of the mesh; without it all of the mesh: `x = [0.0, 0.5]`."""
    name: Name | None = None
    """Name of a region of the mesh; beside ranges what to call the part that lies in them: `name = "inclusion"`."""
    temperature: Field | None = None
    """Rise of temperature here, instead of that of the body: `temperature = 60.0`."""

    def cells(self, mesh: TriangleMesh, before: Sequence[Region] = ()) -> IntArray:
        """Numbers of the triangles of a mesh that lie in it, in ascending order.

        `InputError` if ranges cut triangles, or have a name that the mesh, or a region before, has.
        """
        if self.name is not None and self.x is self.y is None:
            return mesh.region(self.name)
        found = triangles_in_box(mesh.vertices, mesh.cells, self.x, self.y)
        if self.name is not None:
            new_name(self.name, {*mesh.regions, *(each.name for each in before if each.name)}, "region")
        return found


def cell_materials(mesh: TriangleMesh, regions: Sequence[Region]) -> IntArray:
    """For each cell 0 for the body's own material, else 1 + the number of the last region it lies in; (cells,)."""
    number = np.zeros(mesh.cell_count, dtype=np.int64)
    for index, region in enumerate(regions):
        number[region.cells(mesh, regions[:index])] = 1 + index
    return number


# initial strain


def is_strained(problem: ContactProblem) -> bool:
    """Whether a part of the body has an initial strain, be it constant."""
    return any(
        material.prestress is not None
        or acts(material.shrinkage)
        or (material.expansion != 0.0 and acts(_temperature(problem, number)))
        for number, material in enumerate(problem.materials)
    )


def varies(problem: ContactProblem) -> bool:
    """Whether a part of it is a function of position."""
    fields = [problem.temperature, *(region.temperature for region in problem.regions)]
    for material in problem.materials:
        fields += [material.shrinkage, *(material.prestress or ())]
    return any(callable(field) for field in fields)


def stress_at_rest(problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """σ⁰ = −C ε⁰ (xx, yy, xy) at points of cells (k,), from coordinates (k, …) [length] to (k, …, 3) [stress]."""
    found = np.zeros((*np.shape(x), 3))
    for material, here, swelling, prestress in _strained(problem, cells, x, y):
        if swelling.any():
            nu = material.poisson
            modulus = material.young / (1.0 - (2.0 * nu if material.plane == "strain" else nu))
            found[here, ..., :2] -= modulus * swelling[..., None]
        for component, values in enumerate(prestress):
            found[here, ..., component] += values
    return found


def stress_along_z(
    problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray, stress: FloatArray
) -> FloatArray:
    """σ_zz (k, …) of stresses (k, …, 3) at such points: 0 in plane stress, else ν (σ_xx + σ_yy) + what is held along z.

    That is −E e, and −ν times the prestress in the plane, which has no part along z.
    """
    found = np.zeros(np.shape(x))
    for material, here, swelling, prestress in _strained(problem, cells, x, y):
        if material.plane == "strain":
            strained = stress[here, ..., :2].sum(axis=-1) - sum(prestress[:2], np.zeros(swelling.shape))
            found[here] = material.poisson * strained - material.young * swelling
    return found


def _temperature(problem: ContactProblem, number: int) -> Field:
    """That of the part with this number in `ContactProblem.materials`."""
    own = problem.regions[number - 1].temperature if number else None
    return problem.temperature if own is None else own


def _strained(
    problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray
) -> Iterator[tuple[Material, BoolArray, FloatArray, list[FloatArray]]]:
    """Materials of cells (k,), which of these have each, and e = α ΔT − s and the prestress at their points."""
    numbers = problem.cell_materials[cells]
    for number in np.unique(numbers).tolist():
        material, temperature, here = problem.materials[number], _temperature(problem, number), numbers == number
        place = x[here], y[here]
        swelling = -evaluate("Material.shrinkage", material.shrinkage, *place)
        if material.expansion != 0.0 and acts(temperature):
            swelling += material.expansion * evaluate("ContactProblem.temperature", temperature, *place)
        prestress = [evaluate("Material.prestress", field, *place) for field in material.prestress or ()]
        yield material, here, swelling, prestress
