"""Chapter on bodies that end at arcs and other curves: orders of convergence where a closed form is known."""

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from comparisons.verification.elements import Element, on
from comparisons.verification.proof import certified
from comparisons.verification.row import Kind, Row, absolute, at_least
from qvi_contact import ContactProblem, ContactResult, Material, Symmetry, Traction, TriangleMesh
from qvi_contact.basics.checks import FloatArray
from qvi_contact.gallery.meshes import arc, fan

_NU: Final = 0.3
_OUTER: Final = 2.0  # radius, of the ring over that of its bore, of the plate in the plane of ζ
_M: Final = 0.25  # of the ellipse: half axes 1 + m and 1 − m
_SHORT: Final = 0.35  # of the order p − 1 on these meshes
_COARSE, _FINE = 4, 8  # triangles across, half of those around
_DEGREES: Final = tuple(Element(f"triangles of degree {p}", "hct", p) for p in (3, 4, 5, 6, 8))

Stress = Callable[[FloatArray, FloatArray], FloatArray]
"""(σ_xx, σ_yy, σ_xy) (..., 3) at points x, y (...)."""


@on(*_DEGREES, few=1)
def lame_ring(element: Element, quick: bool) -> Iterator[Row]:
    """A quarter of a ring under pressure inside, radii 1 and 2, against Lamé: σ has the order p − 1 of straight bodies.

    Its sides are arcs of circles. With chords the energy is wrong by 1e-3 whatever the degree.
    """
    yield from _orders(element, quick, _ring, _lame, _lame_energy(), "Lamé's ring")


@on(*_DEGREES, few=1)
def elliptic_hole(element: Element, quick: bool) -> Iterator[Row]:
    """A quarter of a plate with an elliptic hole 1.25 × 0.75, pulled from all sides, against Kirsch and Inglis.

    The plate ends at a confocal ellipse, where it has the exact tractions. Both ellipses are given as functions.
    """
    yield from _orders(element, quick, _plate, _kirsch, _kirsch_energy(), "Kirsch, Inglis; Muskhelishvili § 82a")


def _orders(
    element: Element, quick: bool, posed: Callable[[int], ContactProblem], stress: Stress, energy: float, source: str
) -> Iterator[Row]:
    p, sizes = element.degree, (_COARSE // 2, _COARSE) if quick else (_COARSE, _FINE)
    results = [element.solve(posed(size)) for size in sizes]
    coarse, fine = (_stress_error(result, stress) for result in results)
    order, proof = float(np.log2(coarse / fine)), certified(*results)
    source = f"{source}; {sizes[0]} and {sizes[1]} cells across"
    quantity = "order of σ in L² [-]"
    yield at_least(quantity, order, p - 1.0, 2.0 * _SHORT if quick else _SHORT, Kind.ANALYTIC, source, proof)
    error = abs(results[-1].energies.strain / energy - 1.0)
    yield absolute("relative error of the energy [-]", error, 0.0, 4.0 * fine**2 + 1e-13, Kind.ANALYTIC, source, proof)


def _stress_error(result: ContactResult, exact: Stress) -> float:
    """Error of σ in the mean square over the body, relative."""
    known, mesh = result.discretization, result.problem.mesh
    space, cells = known.space, np.arange(mesh.cell_count)
    t, weights = space.cell_points, space.cell_measures(space.cell_points, space.cell_weights)
    x, y = np.moveaxis(space.points(cells, t) * known.scales.length + mesh.origin, -1, 0)
    found = space.stress(known.energy.coefficients(result.dofs), cells, t) * known.scales.stress
    wanted, twice = exact(x, y), weights[..., None] * np.array([1.0, 1.0, 2.0])
    return float(np.sqrt((twice * (found - wanted) ** 2).sum() / (twice * wanted**2).sum()))


def _ring(size: int) -> ContactProblem:
    angles = np.linspace(0.0, np.pi / 2.0, 2 * size + 1)
    lines = [arc(radius, angles) for radius in np.linspace(1.0, _OUTER, size + 1)]
    mesh = fan(lines, closed=False, arcs=("inner", "outer"))
    loads = Traction("inner", normal=-1.0, tangential=0.0), Traction("outer", normal=0.0, tangential=0.0)
    return ContactProblem(mesh, Material(1.0, _NU), [*loads, Symmetry("start"), Symmetry("end")])


def _lame(x: FloatArray, y: FloatArray) -> FloatArray:
    square, factor = x**2 + y**2, 1.0 / (_OUTER**2 - 1.0)
    radial, hoop = factor * (1.0 - _OUTER**2 / square), factor * (1.0 + _OUTER**2 / square)
    parts = radial * x**2 + hoop * y**2, radial * y**2 + hoop * x**2, (radial - hoop) * x * y
    return np.asarray(np.stack(parts, axis=-1) / square[..., None])


def _lame_energy() -> float:
    """Half of what unit pressure does on the widening of the bore, a quarter."""
    return float(np.pi / 4.0 * ((1.0 - _NU) + (1.0 + _NU) * _OUTER**2) / (_OUTER**2 - 1.0))


def _plate(size: int) -> ContactProblem:
    angles = np.linspace(0.0, np.pi / 2.0, 2 * size + 1)
    mesh = fan([_ellipse(radius)(angles) for radius in np.geomspace(1.0, _OUTER, size + 1)], closed=False)
    mesh = TriangleMesh(np.where(np.abs(mesh.vertices) < 1e-14, 0.0, mesh.vertices), mesh.cells, mesh.edge_sets)
    for name, radius in (("inner", 1.0), ("outer", _OUTER)):
        mesh = mesh.with_curve(name, _ellipse(radius), 0.0, np.pi / 2.0)
    pulled = Traction("outer", x=lambda x, y: _pull(x, y)[0], y=lambda x, y: _pull(x, y)[1])
    free = Traction("inner", normal=0.0, tangential=0.0)
    return ContactProblem(mesh, Material(1.0, _NU), [pulled, free, Symmetry("start"), Symmetry("end")])


def _ellipse(radius: float) -> Callable[[FloatArray], FloatArray]:
    """The ellipse z = ζ + m/ζ with |ζ| given, by the angle of ζ."""
    a, b = radius + _M / radius, radius - _M / radius
    return lambda angle: np.column_stack([a * np.cos(angle), b * np.sin(angle)])


def _zeta(x: FloatArray, y: FloatArray) -> np.ndarray:
    """ζ outside the hole."""
    z = x + 1j * np.asarray(y)
    root = np.sqrt(z**2 - 4.0 * _M)
    return np.asarray((z + np.where((root * z.conj()).real < 0.0, -root, root)) / 2.0)


def _kirsch(x: FloatArray, y: FloatArray) -> FloatArray:
    return _of_potentials(_zeta(x, y))


def _of_potentials(zeta: np.ndarray) -> FloatArray:
    """Stresses of φ = (ζ − m/ζ)/2, ψ = −(1 + m²) ζ/(ζ² − m), tension 1 from all sides far away, at ζ (...)."""
    z, slope = zeta + _M / zeta, 1.0 - _M / zeta**2
    first = (1.0 + _M / zeta**2) / 2.0  # dφ/dζ
    phi = first / slope
    second = (-_M / zeta**3 * slope - first * 2.0 * _M / zeta**3) / slope**3  # d²φ/dz²
    psi = (1.0 + _M**2) * (zeta**2 + _M) / (zeta**2 - _M) ** 2 / slope
    trace, deviator = 4.0 * phi.real, 2.0 * (z.conj() * second + psi)
    return np.stack([(trace - deviator.real) / 2.0, (trace + deviator.real) / 2.0, deviator.imag / 2.0], axis=-1)


def _pull(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Tractions along x and y on an ellipse with the foci of the hole."""
    zeta = _zeta(x, y)
    normal = zeta * (1.0 - _M / zeta**2)
    normal = normal / np.abs(normal)
    xx, yy, xy = np.moveaxis(_of_potentials(zeta), -1, 0)
    return np.asarray(xx * normal.real + xy * normal.imag), np.asarray(xy * normal.real + yy * normal.imag)


def _kirsch_energy() -> float:
    """By 40 × 40 points of Gauss of ζ in polar coordinates."""
    t, w = np.polynomial.legendre.leggauss(40)
    half = (_OUTER - 1.0) / 2.0
    r, angle = np.meshgrid(1.0 + half * (1.0 + t), np.pi / 4.0 * (1.0 + t))
    zeta = r * np.exp(1j * angle)
    xx, yy, xy = np.moveaxis(_of_potentials(zeta), -1, 0)
    density = (xx**2 + yy**2 - 2.0 * _NU * xx * yy + 2.0 * (1.0 + _NU) * xy**2) / 2.0
    return float((np.outer(w, w) * half * np.pi / 4.0 * r * density * np.abs(1.0 - _M / zeta**2) ** 2).sum())


PROBLEMS: Final = {"lame-ring": lame_ring, "elliptic-hole": elliptic_hole}
