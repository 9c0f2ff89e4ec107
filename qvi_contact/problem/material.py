"""Materials: linear elasticity in plane stress or plane strain, yield criteria as cones, and initial strain.

Yield criteria. With S = σ_xx + σ_yy and R = |(σ_xx − σ_yy, 2σ_xy)|, the difference of the principal stresses in the
plane, every criterion here is a list of second-order cones

    |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S,

compression being negative. The flow rule is associated: plastic strain rates are normal to the cones.

| strength     | plane strain                                | plane stress, in addition or instead                 |
|--------------|---------------------------------------------|------------------------------------------------------|
| Tresca       | R ≤ 2c                                      | R ≤ 4c − S,  R ≤ 4c + S                              |
| Mises        | R ≤ 2σ_0/√3                                 | |(S/√3, σ_xx − σ_yy, 2σ_xy)| ≤ 2σ_0/√3 instead       |
| MohrCoulomb  | R ≤ 2c cos φ − S sin φ;  R ≤ 2t − S         | R ≤ 2f_t − S,  R ≤ 2f_c + S                          |
| NoTension    | R ≤ −S;  R ≤ 2f + S                         | the same                                             |

with f_t = 2c cos φ/(1 + sin φ) and f_c = 2c cos φ/(1 − sin φ).

Initial strain. With the thermal strain α ΔT (`Material.expansion`, `ContactProblem.temperature`), the shrinkage s and
the prestress σ_p, a free piece of material strains by e = α ΔT − s in all directions of space, and the elastic law is

    c σ = ε(u) − ε⁰,      σ = C ε(u) + σ⁰,      σ⁰ = −C ε⁰ = σ_p − E e/(1 − ν) I      in plane stress,
                                                     = σ_p − E e/(1 − 2ν) I     in plane strain,

where −cσ_p is a part of ε⁰. The rest of ε⁰ is e I in plane stress, and (1 + ν) e I in plane strain, where ε_zz = 0.
σ⁰ is the stress of a body whose displacements are zero everywhere. The package computes with σ⁰; the energies are

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
"""Plane stress (σ_zz = 0) or plane strain (ε_zz = 0)."""

_POSITIVE_FIELD: Final = Varying(0.0, instead="leave the strength out if the body does not yield")
PositiveField: TypeAlias = Annotated[Field, _POSITIVE_FIELD]


class YieldCone(NamedTuple):
    """One cone |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S."""

    name: str
    """Name in messages of the strength that a is proportional to, such as "Tresca.c"."""
    field: Field
    """This strength, at least 0 [stress]."""
    factor: float | FloatArray
    """a divided by the strength; an array for an array of angles of friction."""
    pressure: float | FloatArray = 0.0
    """β."""
    mean: float = 0.0
    """γ."""


@dataclass(frozen=True)
class Tresca(Checked):
    """Largest shear stress: half the difference of the principal stresses is at most c. For undrained clay c is s_u."""

    c: PositiveField
    """Strength in shear, positive [stress]; half the yield stress in tension: `c = 20.0`."""
    kind: ClassVar[str] = "tresca"

    def cones(self, plane: Plane) -> Iterator[YieldCone]:
        """The criterion's cones in this plane state."""
        yield YieldCone("Tresca.c", self.c, 2.0)
        if plane == "stress":
            yield YieldCone("Tresca.c", self.c, 4.0, 1.0)
            yield YieldCone("Tresca.c", self.c, 4.0, -1.0)


@dataclass(frozen=True)
class Mises(Checked):
    """Von Mises: the equivalent stress is at most the yield stress. In plane strain equal to Tresca with c = σ_0/√3."""

    yield_stress: PositiveField
    """Yield stress σ_0 in tension, positive [stress]: `yield_stress = 235.0`."""
    kind: ClassVar[str] = "mises"

    def cones(self, plane: Plane) -> Iterator[YieldCone]:
        """The criterion's cone in this plane state."""
        mean = 1.0 / math.sqrt(3.0) if plane == "stress" else 0.0
        yield YieldCone("Mises.yield_stress", self.yield_stress, 2.0 / math.sqrt(3.0), 0.0, mean)


@dataclass(frozen=True)
class MohrCoulomb(Checked):
    """Cohesion and friction: |τ| ≤ c − σ tan φ on every plane, and no tension above the cut-off.

    Where φ varies within a part of a triangle, the lower bound of a limit load satisfies the criterion of every angle
    there, and the upper bound uses a cone that contains all, which is unbounded if φ begins at 0 without a cut-off.
    """

    c: Annotated[Field, Varying(0.0)]
    """Cohesion, at least 0 [stress]: `c = 20.0`."""
    phi: Annotated[Field, Varying(0.0)]
    """Angle of friction φ, from 0 to below π/2 [rad]: `phi = "30 * pi / 180"`."""
    tension: Annotated[Field, Varying(0.0)] | None = None
    """Largest tensile stress t, at least 0 [stress]; c cot φ by default: `tension = 0.0`."""
    kind: ClassVar[str] = "mohr-coulomb"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not callable(self.phi):
            self.angles(np.zeros(1), np.zeros(1))
            if self.phi == 0.0:
                _POSITIVE_FIELD.check("MohrCoulomb.c", self.c)

    def angles(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """The angle of friction φ [rad] at points; `InputError` if it is out of range."""
        phi = evaluate("MohrCoulomb.phi", self.phi, x, y, minimum=0.0)
        if (phi >= math.pi / 2.0).any():
            remedy = "give the angle of friction in radians, from 0 to below pi/2: 30 degrees are 0.5236"
            raise InputError("MohrCoulomb.phi", float(phi.max()), remedy)
        return phi

    def cones(self, plane: Plane, phi: FloatArray | float | None = None) -> Iterator[YieldCone]:
        """The criterion's cones in this plane state; `phi` has the angles [rad] if φ is a function of position."""
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
    """Heyman's masonry: no tension in any direction, and crushing at f if f is given."""

    crushing: PositiveField | None = None
    """Strength f in compression, positive [stress]; without it there is no limit: `crushing = 4.0`."""
    kind: ClassVar[str] = "no-tension"

    def cones(self, plane: Plane) -> Iterator[YieldCone]:  # noqa: ARG002  # as in all of them
        """The criterion's cones, the same in both plane states."""
        yield YieldCone("NoTension", 0.0, 2.0, 1.0)
        if self.crushing is not None:
            yield YieldCone("NoTension.crushing", self.crushing, 2.0, -1.0)


Strength: TypeAlias = Tresca | Mises | MohrCoulomb | NoTension
"""A yield criterion."""


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
    """Yield criterion for limit analysis; without it the material carries any stress. `solve` stays elastic:
    `strength = { law = "tresca", c = 1.0 }`."""
    expansion: Annotated[float, Scalar()] = 0.0
    """Coefficient of thermal expansion α [1/temperature], see `ContactProblem.temperature`: `expansion = 1.2e-5`."""
    shrinkage: Field = 0.0
    """Strain by which a free piece contracts in all directions, such as drying concrete: `shrinkage = 3e-4`."""
    prestress: tuple[Field, Field, Field] | None = None
    """Stress (xx, yy, xy) of the body at zero strain [stress]: `prestress = [-2.0, 0.0, 0.0]`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not -1.0 < self.poisson <= 0.5:
            raise InputError("Material.poisson", self.poisson, "give a number above -1 and at most 0.5")

    @property
    def incompressible(self) -> bool:
        """Whether a constant pressure in the plane causes no strain: plane strain with ν = 0.5."""
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
    """A part of the body with its own material: a named region of the mesh, or the triangles in ranges of x and y.

    The part is bonded to its neighbours: tractions and displacements are continuous across the border.
    """

    material: Annotated[Material, Inline(Material, ("plane",))]
    """The material of the region, in the plane state of the rest of the body."""
    x: tuple[float, float] | None = None
    y: tuple[float, float] | None = None
    """Range along x or y [length] that ends on edges of the mesh; unlimited by default: `x = [0.0, 0.5]`."""
    name: Name | None = None
    """Name of a region of the mesh; if ranges are given, a new name for the part in them: `name = "inclusion"`."""
    temperature: Field | None = None
    """Rise of temperature in the region, instead of the body's: `temperature = 60.0`."""

    def cells(self, mesh: TriangleMesh, before: Sequence[Region] = ()) -> IntArray:
        """Numbers of the mesh's triangles in the region, in ascending order.

        `InputError` if ranges cut triangles, or their name is that of a region of the mesh or of a region `before`.
        """
        if self.name is not None and self.x is self.y is None:
            return mesh.region(self.name)
        cells = triangles_in_box(mesh.vertices, mesh.cells, self.x, self.y)
        if self.name is not None:
            new_name(self.name, {*mesh.regions, *(each.name for each in before if each.name)}, "region")
        return cells


# initial strain


def is_strained(problem: ContactProblem) -> bool:
    """Whether a part of the body has an initial strain, constant or not."""
    return any(
        material.prestress is not None
        or acts(material.shrinkage)
        or (material.expansion != 0.0 and acts(temperature_of(problem, number)))
        for number, material in enumerate(problem.materials)
    )


def varies(problem: ContactProblem) -> bool:
    """Whether a datum of the initial strain is a function of position."""
    fields = [problem.temperature, *(region.temperature for region in problem.regions)]
    for material in problem.materials:
        fields += [material.shrinkage, *(material.prestress or ())]
    return any(callable(field) for field in fields)


def stress_at_rest(problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """σ⁰ = −C ε⁰ (xx, yy, xy) [stress], shape (k, …, 3), at points x, y (k, …) [length] of the cells (k,)."""
    stress = np.zeros((*np.shape(x), 3))
    for material, is_here, strain, prestress in _initial_strains(problem, cells, x, y):
        if strain.any():
            nu = material.poisson
            modulus = material.young / (1.0 - (2.0 * nu if material.plane == "strain" else nu))
            stress[is_here, ..., :2] -= modulus * strain[..., None]
        for component, values in enumerate(prestress):
            stress[is_here, ..., component] += values
    return stress


def stress_along_z(
    problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray, stress: FloatArray
) -> FloatArray:
    """σ_zz (k, …) [stress] for stresses (k, …, 3) at points x, y (k, …) of the cells (k,).

    It is 0 in plane stress, and ν (σ_xx + σ_yy − σ_p,xx − σ_p,yy) − E e in plane strain.
    """
    sigma_zz = np.zeros(np.shape(x))
    for material, is_here, strain, prestress in _initial_strains(problem, cells, x, y):
        if material.plane == "strain":
            in_plane = stress[is_here, ..., :2].sum(axis=-1) - sum(prestress[:2], np.zeros(strain.shape))
            sigma_zz[is_here] = material.poisson * in_plane - material.young * strain
    return sigma_zz


def temperature_of(problem: ContactProblem, number: int) -> Field:
    """The temperature where the material is the one with this index in `ContactProblem.materials`."""
    regional = problem.regions[number - 1].temperature if number else None
    return problem.temperature if regional is None else regional


def _initial_strains(
    problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray
) -> Iterator[tuple[Material, BoolArray, FloatArray, list[FloatArray]]]:
    """For each material of the cells (k,): a mask of its cells, e = α ΔT − s and the prestress at their points."""
    numbers = problem.cell_materials[cells]
    for number in np.unique(numbers).tolist():
        material, temperature, is_here = problem.materials[number], temperature_of(problem, number), numbers == number
        points = x[is_here], y[is_here]
        strain = -evaluate("Material.shrinkage", material.shrinkage, *points)
        if material.expansion != 0.0 and acts(temperature):
            strain += material.expansion * evaluate("ContactProblem.temperature", temperature, *points)
        prestress = [evaluate("Material.prestress", field, *points) for field in material.prestress or ()]
        yield material, is_here, strain, prestress
