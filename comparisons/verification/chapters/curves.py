"""Chapter on bodies that end at arcs and other curves: orders of convergence where a closed form is known.

The ring is Lamé's, of radii 1 and 2. The plate with an elliptic hole is Kirsch's and Inglis', between two confocal
ellipses, images of circles: z = ζ + m/ζ with |ζ| = 1 and |ζ| = OUTER. Tension 1 from all sides far away has the
potentials (Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, § 82a)

    φ = (ζ − m/ζ)/2,   ψ = −(1 + m²) ζ/(ζ² − m)

Both are quarters, and Young's modulus is 1.
"""

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from comparisons.verification.measures import Stress, stress_deviation
from comparisons.verification.rows import Chapter, Check, Row, certified
from qvi_contact import ContactProblem, Material, Symmetry, Traction, TriangleMesh, solve
from qvi_contact.basics.checks import FloatArray
from qvi_contact.gallery import arc, fan

CURVES: Final = Chapter()

NU: Final = 0.3
OUTER: Final = 2.0
"""Radius of the ring over that of its bore, and of the plate in the plane of ζ."""
M: Final = 0.25
"""m of the elliptic hole, with the half axes 1 + m and 1 − m."""
_SHORT: Final = 0.35  # most that a measured order is below p − 1 on these meshes
_DEGREES: Final = (3, 4, 5, 6, 8)


@CURVES("lame-ring", *_DEGREES)
def lame_ring(p: int, quick: bool) -> Iterator[Row]:
    """A quarter of a ring under pressure inside, radii 1 and 2, against Lamé: σ has the order p − 1 of straight bodies.

    Its sides are arcs of circles. With chords the energy is wrong by 1e-3 whatever the degree.
    """
    yield from _orders(p, quick, ring, lame, lame_energy(), "Lamé's ring")


@CURVES("elliptic-hole", *_DEGREES)
def elliptic_hole(p: int, quick: bool) -> Iterator[Row]:
    """A quarter of a plate with an elliptic hole 1.25 × 0.75, pulled from all sides, against Kirsch and Inglis.

    The plate ends at a confocal ellipse, where it has the exact tractions. Both ellipses are given as functions.
    """
    source = "Kirsch, Inglis; Muskhelishvili § 82a"
    yield from _orders(p, quick, lambda size: stretched(sheet(size, 2 * size)), kirsch, kirsch_energy(), source)


def _orders(
    p: int, quick: bool, posed: Callable[[int], ContactProblem], stress: Stress, energy: float, source: str
) -> Iterator[Row]:
    sizes = (2, 4) if quick else (4, 8)  # triangles across, half of those around
    results = [solve(posed(size), degree=p) for size in sizes]
    coarse, fine = (stress_deviation(result, stress) for result in results)
    rows = Check(certified(*results), f"{source}; {sizes[0]} and {sizes[1]} cells across")
    short = 2.0 * _SHORT if quick else _SHORT
    yield rows.at_least("order of σ in L² [-]", np.log2(coarse / fine), p - 1.0, tolerance=short)
    error = abs(results[-1].energies.strain / energy - 1.0)
    yield rows.absolute("relative error of the energy [-]", error, 0.0, tolerance=4.0 * fine**2 + 1e-13)


def ring(size: int) -> ContactProblem:
    """A quarter of a ring under unit pressure inside, of so many cells across."""
    angles = np.linspace(0.0, np.pi / 2.0, 2 * size + 1)
    lines = [arc(radius, angles) for radius in np.linspace(1.0, OUTER, size + 1)]
    mesh = fan(lines, closed=False, arcs=("inner", "outer"))
    loads = Traction("inner", normal=-1.0, tangential=0.0), Traction("outer", normal=0.0, tangential=0.0)
    return ContactProblem(mesh, Material(1.0, NU), [*loads, Symmetry("start"), Symmetry("end")])


def lame(x: FloatArray, y: FloatArray) -> FloatArray:
    """σ_xx, σ_yy, σ_xy (…, 3) of the ring."""
    square, factor = x**2 + y**2, 1.0 / (OUTER**2 - 1.0)
    radial, hoop = factor * (1.0 - OUTER**2 / square), factor * (1.0 + OUTER**2 / square)
    parts = radial * x**2 + hoop * y**2, radial * y**2 + hoop * x**2, (radial - hoop) * x * y
    return np.asarray(np.stack(parts, axis=-1) / np.asarray(square)[..., None])


def lame_energy() -> float:
    """Half of what unit pressure does on the widening of the bore, a quarter."""
    return float(np.pi / 4.0 * ((1.0 - NU) + (1.0 + NU) * OUTER**2) / (OUTER**2 - 1.0))


def sheet(radial: int, around: int, *, curved: bool = True) -> TriangleMesh:
    """A quarter of the sheet between its ellipses "inner" and "outer", or chords of them."""
    angles = np.linspace(0.0, np.pi / 2.0, around + 1)
    mesh = fan([ellipse(radius)(angles) for radius in np.geomspace(1.0, OUTER, radial + 1)], closed=False)
    mesh = TriangleMesh(np.where(np.abs(mesh.vertices) < 1e-14, 0.0, mesh.vertices), mesh.cells, mesh.edge_sets)
    for name, radius in (("inner", 1.0), ("outer", OUTER)) if curved else ():
        mesh = mesh.with_curve(name, ellipse(radius), 0.0, np.pi / 2.0)
    return mesh


def stretched(mesh: TriangleMesh) -> ContactProblem:
    """The plate with a free hole, and the exact tractions on the outer ellipse."""
    pulled = Traction("outer", x=lambda x, y: _pull(x, y)[0], y=lambda x, y: _pull(x, y)[1])
    free = Traction("inner", normal=0.0, tangential=0.0)
    return ContactProblem(mesh, Material(1.0, NU), [pulled, free, Symmetry("start"), Symmetry("end")])


def ellipse(radius: float) -> Callable[[FloatArray], FloatArray]:
    """The ellipse z = ζ + m/ζ with |ζ| given, by the angle of ζ."""
    a, b = radius + M / radius, radius - M / radius
    return lambda angle: np.column_stack([a * np.cos(angle), b * np.sin(angle)])


def zeta_of(x: FloatArray, y: FloatArray) -> np.ndarray:
    """ζ outside the hole."""
    z = x + 1j * np.asarray(y)
    root = np.sqrt(z**2 - 4.0 * M)
    return np.asarray((z + np.where((root * z.conj()).real < 0.0, -root, root)) / 2.0)


def kirsch(x: FloatArray, y: FloatArray) -> FloatArray:
    """σ_xx, σ_yy, σ_xy (…, 3) of the plate."""
    return _of_potentials(zeta_of(x, y))


def _of_potentials(zeta: np.ndarray) -> FloatArray:
    """Stresses of φ = (ζ − m/ζ)/2, ψ = −(1 + m²) ζ/(ζ² − m), tension 1 from all sides far away, at ζ (...)."""
    z, slope = zeta + M / zeta, 1.0 - M / zeta**2
    first = (1.0 + M / zeta**2) / 2.0  # dφ/dζ
    phi = first / slope
    second = (-M / zeta**3 * slope - first * 2.0 * M / zeta**3) / slope**3  # d²φ/dz²
    psi = (1.0 + M**2) * (zeta**2 + M) / (zeta**2 - M) ** 2 / slope
    trace, deviator = 4.0 * phi.real, 2.0 * (z.conj() * second + psi)
    return np.stack([(trace - deviator.real) / 2.0, (trace + deviator.real) / 2.0, deviator.imag / 2.0], axis=-1)


def _pull(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tractions along x and y on an ellipse with the foci of the hole."""
    zeta = zeta_of(x, y)
    normal = zeta * (1.0 - M / zeta**2)
    normal = normal / np.abs(normal)
    xx, yy, xy = np.moveaxis(_of_potentials(zeta), -1, 0)
    return np.asarray(xx * normal.real + xy * normal.imag), np.asarray(xy * normal.real + yy * normal.imag)


def kirsch_energy() -> float:
    """The strain energy of the plate, by 40 × 40 points of Gauss of ζ in polar coordinates."""
    t, w = np.polynomial.legendre.leggauss(40)
    half = (OUTER - 1.0) / 2.0
    r, angle = np.meshgrid(1.0 + half * (1.0 + t), np.pi / 4.0 * (1.0 + t))
    zeta = r * np.exp(1j * angle)
    xx, yy, xy = np.moveaxis(_of_potentials(zeta), -1, 0)
    density = (xx**2 + yy**2 - 2.0 * NU * xx * yy + 2.0 * (1.0 + NU) * xy**2) / 2.0
    return float((np.outer(w, w) * half * np.pi / 4.0 * r * density * np.abs(1.0 - M / zeta**2) ** 2).sum())
