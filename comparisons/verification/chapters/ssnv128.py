"""Chapter on Code_Aster's test SSNV128: opening, slip and stick on one contact."""

from collections.abc import Iterator
from functools import lru_cache
from typing import Final

from comparisons.verification.elements import TRIANGLES, Chapter, Element
from comparisons.verification.measures import edge_states, runs, value_at, zone_ends
from comparisons.verification.proof import certified
from comparisons.verification.row import Kind, Row, absolute, relative, word
from qvi_contact import ContactResult
from qvi_contact.gallery import SSNV128_DISPLACEMENTS, ssnv128

PROBLEMS: Final = Chapter()

SIDE: Final = 0.04
TANGENTIAL_FORCE: Final = -1.40535e6
SOURCE: Final = "Code_Aster, V6.04.128 (SSNV128)"
_DISPLACEMENT_MODEL: Final = "biquadratic displacement elements with nodal contact, up to 320 × 96 cells"
_SETTLED: Final = {"A": 2.8603e-5, "B": 2.7226e-5, "C": 2.2868e-5, "D": 1.9808e-5, "E": 1.5414e-5}


@PROBLEMS.on("ssnv128-published", TRIANGLES)
def published_displacements(element: Element, quick: bool) -> Iterator[Row]:
    """Tangential displacements of the base that the manual prints, within its own tolerance of 5 %."""
    result = _solved(element, quick)
    base = result.contacts["base"]
    for point, x, published in SSNV128_DISPLACEMENTS:
        ours = value_at(base, base.slip, x)
        source = f"{SOURCE}, point {point}, x = {1e3 * x:g} mm; ± 5 %"
        yield relative(f"u_x at point {point} [m]", ours, published, 0.05, source, certified(result), Kind.PUBLISHED)


@PROBLEMS.on("ssnv128-displacement-model", TRIANGLES)
def displacement_model(element: Element, quick: bool) -> Iterator[Row]:
    """Displacements, forces, zones and pressure of an independent displacement model of the same square."""
    cells, result = _cells(quick), _solved(element, quick)
    base, proof, source = result.contacts["base"], certified(result), _DISPLACEMENT_MODEL
    for point, x, _ in SSNV128_DISPLACEMENTS:
        ours, quantity = value_at(base, base.slip, x), f"u_x at point {point} [m]"
        yield relative(quantity, ours, _SETTLED[point], 2e-3, f"{source}; ± 2e-9 m", proof, Kind.EXTERNAL)
    yield relative("T [N/m]", base.tangential_force, TANGENTIAL_FORCE, 1e-3, f"{source}; ± 5 N/m", proof, Kind.EXTERNAL)
    yield word("zones from the left", runs(edge_states(base)), "open, slip, stick", source, proof, Kind.EXTERNAL)
    ends = zone_ends(base)
    for name, end, exact in zip(("open", "slip"), ends, (3.28e-3, 29.84e-3), strict=False):
        text = f"{source}; within one of our cells"
        yield absolute(f"end of {name} [m]", float(end), exact, SIDE / cells[0], text, proof, Kind.EXTERNAL)
    pressure = -value_at(base, base.normal_stress, SIDE)
    yield relative("pressure at x = a [Pa]", pressure, 8.3882e7, 1e-3, source, proof, Kind.EXTERNAL)


@PROBLEMS.on("ssnv128-equilibrium", TRIANGLES)
def equilibrium(element: Element, quick: bool) -> Iterator[Row]:
    """Resultants that balance alone decides."""
    result = _solved(element, quick)
    base, proof = result.contacts["base"], certified(result)
    yield relative("N [N/m]", base.normal_force, 5e7 * SIDE, 1e-9, "p a, balance in y", proof)
    rest = -15e7 * SIDE - base.tangential_force
    yield relative("force on x = a [N/m]", result.resultant("right").x, rest, 1e-9, "−15e7 a − T, balance in x", proof)


@PROBLEMS.on("ssnv128-without-friction", TRIANGLES)
def without_friction(element: Element, quick: bool) -> Iterator[Row]:
    """μ = 0: uniform stress, and the corner moves by exactly ε_xx a."""
    result = element.solve(ssnv128(_cells(quick), friction=0.0))
    exact = -float(result.problem.material.compliance[0] @ [-15e7, -5e7, 0.0]) * SIDE
    base, proof = result.contacts["base"], certified(result)
    source = "−(c11 σ_xx + c12 σ_yy) a = 4.061538e-5 m"
    yield relative("u_x at x = 0 [m]", value_at(base, base.slip, 0.0), exact, 1e-8, source, proof)
    yield from _uniform(result)


@lru_cache(maxsize=2)
def _solved(element: Element, quick: bool) -> ContactResult:
    """What the first three problems look at."""
    return element.solve(ssnv128(_cells(quick)))


def _uniform(result: ContactResult) -> Iterator[Row]:
    stress = result.stress(0.013, 0.021)
    for name, ours, exact in zip(("σ_xx", "σ_yy"), stress, (-15e7, -5e7), strict=False):
        yield relative(f"{name} inside [Pa]", float(ours), exact, 1e-9, "the pressure on that side", certified(result))


def _cells(quick: bool) -> tuple[int, int]:
    return (16, 16) if quick else (32, 32)
