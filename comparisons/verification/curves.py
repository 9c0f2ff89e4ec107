"""Chapter on bodies that end at arcs and other curves: orders of convergence where a closed form is known."""

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from comparisons.verification.curved import kirsch, kirsch_energy, lame, lame_energy, plate, ring, stretched
from comparisons.verification.elements import Chapter, Element
from comparisons.verification.measures import Stress, stress_deviation
from comparisons.verification.proof import certified
from comparisons.verification.row import Row, absolute, at_least
from qvi_contact import ContactProblem

PROBLEMS: Final = Chapter()

_SHORT: Final = 0.35  # of the order p − 1 on these meshes
_COARSE, _FINE = 4, 8  # triangles across, half of those around
_DEGREES: Final = tuple(Element(f"triangles of degree {p}", "hct", p) for p in (3, 4, 5, 6, 8))


@PROBLEMS.on("lame-ring", *_DEGREES, few=1)
def lame_ring(element: Element, quick: bool) -> Iterator[Row]:
    """A quarter of a ring under pressure inside, radii 1 and 2, against Lamé: σ has the order p − 1 of straight bodies.

    Its sides are arcs of circles. With chords the energy is wrong by 1e-3 whatever the degree.
    """
    yield from _orders(element, quick, ring, lame, lame_energy(), "Lamé's ring")


@PROBLEMS.on("elliptic-hole", *_DEGREES, few=1)
def elliptic_hole(element: Element, quick: bool) -> Iterator[Row]:
    """A quarter of a plate with an elliptic hole 1.25 × 0.75, pulled from all sides, against Kirsch and Inglis.

    The plate ends at a confocal ellipse, where it has the exact tractions. Both ellipses are given as functions.
    """
    yield from _orders(element, quick, _plate, kirsch, kirsch_energy(), "Kirsch, Inglis; Muskhelishvili § 82a")


def _orders(
    element: Element, quick: bool, posed: Callable[[int], ContactProblem], stress: Stress, energy: float, source: str
) -> Iterator[Row]:
    p, sizes = element.degree, (_COARSE // 2, _COARSE) if quick else (_COARSE, _FINE)
    results = [element.solve(posed(size)) for size in sizes]
    coarse, fine = (stress_deviation(result, stress) for result in results)
    order, proof = float(np.log2(coarse / fine)), certified(*results)
    source = f"{source}; {sizes[0]} and {sizes[1]} cells across"
    yield at_least("order of σ in L² [-]", order, p - 1.0, 2.0 * _SHORT if quick else _SHORT, source, proof)
    error = abs(results[-1].energies.strain / energy - 1.0)
    yield absolute("relative error of the energy [-]", error, 0.0, 4.0 * fine**2 + 1e-13, source, proof)


def _plate(size: int) -> ContactProblem:
    return stretched(plate(size, 2 * size))
