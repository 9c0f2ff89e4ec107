"""Linear elastic material in plane stress or plane strain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.schema import Inline, Name, Positive, Tagged, check_keys
from qvi_contact.errors import InputError
from qvi_contact.mesh.selection import triangles_in_box
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.strength import STRENGTHS, Strength

Plane: TypeAlias = Literal["stress", "strain"]
"""Whether σ_zz or ε_zz is zero."""


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material.

    Parameters
    ----------
    young : float
        Young's modulus E > 0 [stress]: `young = 2.1e5`.
    poisson : float
        Poisson's ratio ν: −1 < ν ≤ 0.5. In plane strain ν = 0.5 is an incompressible material: its compliance is
        singular, and a constant pressure must be determined by tractions, see `ContactProblem`: `poisson = 0.3`.
    plane : "stress" or "strain"
        Plane stress or plane strain, κ = 0 or 1 in the compliance: `plane = "strain"`.
    strength : Tresca, Mises, MohrCoulomb or NoTension, optional
        What the material can carry in a limit analysis; without it any stress. `solve` stays elastic: `strength = { law
        = "tresca", c = 1.0 }`.

    Raises
    ------
    InputError
        If a constant is out of its range.

    """

    young: Positive
    poisson: float
    plane: Plane = "stress"
    strength: Annotated[Strength, Tagged(STRENGTHS)] | None = None

    def __post_init__(self) -> None:
        check_keys(self)
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
class Region:
    """A part of the body with a material of its own: a named region of the mesh, or what lies in ranges of x and y.

    Parameters
    ----------
    material : Material
        Its material, in the plane state of the rest of the body.
    x, y : (float, float), optional
        Range along x or y [length] that ends on edges of the mesh; without it all of the mesh: `x = [0.0, 0.5]`.
    name : str, optional
        Name of a region of the mesh, instead of ranges; in files, beside ranges, a new name for them:
        `name = "inclusion"`.

    Notes
    -----
    Across the border the tractions agree and the bodies are bonded.

    """

    material: Annotated[Material, Inline(Material, ("plane",))]
    x: tuple[float, float] | None = None
    y: tuple[float, float] | None = None
    name: Name | None = None

    def __post_init__(self) -> None:
        check_keys(self)
        if self.name is not None and not self.x is self.y is None:
            raise InputError("Region.name", self.name, "give the name of a region of the mesh, or ranges x and y")


def cell_materials(mesh: TriangleMesh, regions: Sequence[Region]) -> IntArray:
    """For each cell 0 for the body's own material, else 1 + the number of the last region it lies in; (cells,)."""
    number = np.zeros(mesh.cell_count, dtype=np.int64)
    for index, region in enumerate(regions):
        if region.name is None:
            chosen = triangles_in_box(mesh.vertices, mesh.cells, region.x, region.y)
        else:
            chosen = mesh.region(region.name)
        number[chosen] = 1 + index
    return number
