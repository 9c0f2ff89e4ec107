"""Chapter on friction with a closed form: data are chosen so that a given stress obeys Coulomb's law."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from comparisons.verification.elements import QUINTIC, TRIANGLES, Chapter, Element
from comparisons.verification.measures import point_states, runs, stress_error
from comparisons.verification.proof import certified
from comparisons.verification.row import Row, absolute, relative, word
from qvi_contact import ContactResult
from qvi_contact.basics.checks import FloatArray
from qvi_contact.exact import ExactState
from qvi_contact.gallery import sliding_block, stick_slip_block

PROBLEMS: Final = Chapter()

TOLERANCE: Final = 1e-8
TOUCHING: Final = 1e-7  # where slip begins from zero at a loaded point, tractions are as accurate as √complementarity
_STRESS = "largest error of σ at 60 points over the largest |σ|"
_FORMULA: Final = "docstring of gallery.stick_slip_block"
_SLIP: Final = 0.02
_INSIDE, _DROP = 0.77, 40.0
_MOVED: Final[dict[str, Any]] = {"rotation": 0.03, "lift": -0.05}
_CELLS: Final = {"4 × 3 cells": ((4, 3), 1.0), "7 × 3 cells": ((7, 3), 1.0), "8 × 4 cells graded by 0.8": ((8, 4), 0.8)}


@PROBLEMS.on("full-slip", TRIANGLES)
def full_slip(element: Element, quick: bool) -> Iterator[Row]:
    """A block that slips on its whole base in uniform stress: pressure p = 100, σ_xy = μp, σ_xx = −20, μ = 0.3."""
    for name, (cells, grading) in list(_CELLS.items())[: 1 if quick else 3]:
        for plane in ("stress", "strain"):
            problem, state = sliding_block(cells, plane=plane, grading=grading)
            result = element.solve(problem, tolerance=1e-9)
            yield from _sliding(result, state, f"{name}, plane {plane}")


@PROBLEMS.on("stick-slip-on-a-node", TRIANGLES)
def transition_on_a_node(element: Element, quick: bool) -> Iterator[Row]:
    """A base that sticks for x < x_t and slips beyond, with curved obstacle, offset and μ(x); x_t on a grid line."""
    cases = {"4 × 3 cells": ((4, 3), 1.0), "16 × 8 cells": ((16, 8), 1.0)}
    for name, (cells, grading) in list(cases.items())[: 1 if quick else 2]:
        problem, state = stick_slip_block(cells, 1.0, grading=grading, slip=_SLIP, **_MOVED)
        result = element.solve(problem, tolerance=1e-9)
        yield from _sticking(result, state, f"x_t = 1, {name}")
        base, proof = result.contacts["base"], certified(result)
        error = float(np.abs(base.slip - _exact_slip(base.x, 1.0)).max()) / _SLIP
        source = f"u_T − w = −A (x − x_t)², {_FORMULA}; x_t = 1, {name}"
        yield absolute("largest error of the slip over the largest slip", error, 0.0, 1e-6, source, proof)
        yield word("states along the base", runs(point_states(base)), "stick, slip", source, proof)


@PROBLEMS.on("stick-slip-in-an-element", TRIANGLES)
def transition_in_an_element(element: Element, quick: bool) -> Iterator[Row]:
    """The same with x_t inside an element: stresses stay exact on any mesh."""
    for name, (cells, grading) in list(_CELLS.items())[: 1 if quick else 3]:
        for transition in (0.77,) if quick else (0.3, 0.77, 1.31):
            problem, state = stick_slip_block(cells, transition, grading=grading, slip=_SLIP, **_MOVED)
            result = element.solve(problem, tolerance=1e-9)
            yield from _sticking(result, state, f"x_t = {transition:g}, {name}", TOUCHING)


@PROBLEMS.on("stick-slip-quadratic", TRIANGLES, QUINTIC)
def quadratic_pressure(element: Element, quick: bool) -> Iterator[Row]:
    """The same under a pressure that is quadratic along the base: triangles contain that stress and its slip too."""
    for name, (cells, grading) in list(_CELLS.items())[: 1 if quick else 3]:
        problem, state = stick_slip_block(cells, _INSIDE, grading=grading, slip=_SLIP, pressure_drop=_DROP, **_MOVED)
        result = element.solve(problem, tolerance=1e-9)
        base, proof = result.contacts["base"], certified(result)
        source = f"{_FORMULA}; x_t = {_INSIDE:g}, {name}"
        yield absolute(_STRESS, stress_error(result, state), 0.0, TOUCHING, source, proof)
        error = float(np.abs(base.slip - _exact_slip(base.x, _INSIDE)).max()) / _SLIP
        yield absolute("largest error of the slip over the largest slip", error, 0.0, 1e-6, source, proof)


def _sliding(result: ContactResult, state: ExactState, where: str) -> Iterator[Row]:
    base, proof = result.contacts["base"], certified(result)
    source = f"docstring of gallery.sliding_block; {where}"
    yield absolute(_STRESS, stress_error(result, state), 0.0, TOLERANCE, source, proof)
    normal, tangential = base.normal_force, base.tangential_force
    yield relative("N [stress length]", normal, 200.0, TOLERANCE, f"p a; {where}", proof)
    yield relative("T [stress length]", tangential, -60.0, TOLERANCE, f"−μ p a; {where}", proof)
    exact = state.displacement(base.x, base.y)[0]
    error = float(np.abs(base.slip - exact).max() / np.abs(exact).max())
    quantity = "largest error of the slip over the largest slip"
    yield absolute(quantity, error, 0.0, TOLERANCE, f"U₀ + ε_xx (x − a); {where}", proof)
    yield word("states along the base", runs(point_states(base)), "slip", source, proof)


def _sticking(result: ContactResult, state: ExactState, where: str, tolerance: float = TOLERANCE) -> Iterator[Row]:
    base, proof = result.contacts["base"], certified(result)
    yield absolute(_STRESS, stress_error(result, state), 0.0, tolerance, f"Φ = −p x²/2 + a x³ y; {where}", proof)
    normal, tangential = base.normal_force, base.tangential_force
    yield relative("N [stress length]", normal, 200.0, TOLERANCE, f"∫ p dx; {where}", proof)
    yield relative("T [stress length]", tangential, 20.0, tolerance, f"∫ 3a x² dx; {where}", proof)


def _exact_slip(x: FloatArray, transition: float) -> FloatArray:
    return np.asarray(-_SLIP * (np.maximum(x - transition, 0.0) / (2.0 - transition)) ** 2)
