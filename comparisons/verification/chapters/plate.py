"""Chapter on the compressed plate against displacement codes."""

from collections.abc import Iterator
from typing import Final

from comparisons.settled import LIMITS, LIMITS_SOURCE, SETTLED, SOURCE
from comparisons.verification.chapters.bodies import plate_under
from comparisons.verification.elements import QUINTIC, TRIANGLES, Chapter, Element
from comparisons.verification.measures import FORCE
from comparisons.verification.proof import certified
from comparisons.verification.row import Kind, Row, at_least, at_most, relative
from qvi_contact import Contact, refine
from qvi_contact.gallery import compressed_plate

PROBLEMS: Final = Chapter()

_GRADED: Final = (16, 0.8)
_ERROR: Final = {TRIANGLES: 2e-5, QUINTIC: 1e-5}
"""Cells a side and grading of the meshes, and the error that they leave."""


@PROBLEMS.on("plate-graded", TRIANGLES, QUINTIC)
def graded_equilibrium_model(element: Element, quick: bool) -> Iterator[Row]:
    """Stress elements on one graded mesh, cells shrinking towards the free corner."""
    cells, grading = _GRADED
    for friction, settled in list(SETTLED.items())[:: 2 if quick else 1]:
        result = element.solve(compressed_plate(friction, (cells, cells), grading=grading))
        force, proof = result.contacts["plate"].normal_force, certified(result)
        quantity = f"P/2, μ = {friction:g}, {cells}² cells graded by {grading:g} [{FORCE}]"
        yield relative(quantity, force, settled, _ERROR[element], SOURCE, proof, Kind.EXTERNAL)


@PROBLEMS.on("plate-refined", QUINTIC)
def adaptive_equilibrium_model(element: Element, quick: bool) -> Iterator[Row]:
    """Stress elements on the mesh that `refine` makes for P/2 with a target of 1e-6."""
    for friction in (0.25,) if quick else SETTLED:
        start = compressed_plate(friction, (4, 4))
        refined = refine(start, None, target=1e-6, quantity="plate.normal_force", degree=element.degree)
        quantity = f"P/2, μ = {friction:g}, refined [{FORCE}]"
        settled, proof = SETTLED[friction], certified(refined.result)
        yield relative(quantity, refined.value, settled, 3e-6, SOURCE, proof, Kind.EXTERNAL)


@PROBLEMS.on("plate-limits", QUINTIC)
def limits_of_the_force(element: Element, quick: bool) -> Iterator[Row]:
    """P/2 to eight digits: the triangles that `refine` makes for a target of 1e-8."""
    target = 1e-5 if quick else 1e-8
    for friction in (1.0,) if quick else tuple(LIMITS):
        limit, uncertainty = LIMITS[friction]
        start = compressed_plate(friction, (2, 2))
        refined = refine(start, None, target=target, quantity="plate.normal_force", degree=element.degree)
        source, proof = f"{LIMITS_SOURCE}; ± {uncertainty:.0e}", certified(refined.result)
        quantity = f"P/2, μ = {friction:g}, refined to {target:.0e} [{FORCE}]"
        yield relative(quantity, refined.value, limit, 3.0 * target, source, proof, Kind.EXTERNAL)
        quantity, source = f"{{}} estimate over error in a round, μ = {friction:g}", LIMITS_SOURCE
        ratios = [each.estimate / abs(each.value / limit - 1.0) for each in refined.rounds]
        yield at_least(quantity.format("least"), min(ratios), 1.0 / 3.0, 0.0, source, proof, Kind.EXTERNAL)
        yield at_most(quantity.format("largest"), max(ratios), 3.0, 0.0, source, proof, Kind.EXTERNAL)


@PROBLEMS.on("plate-between", TRIANGLES, QUINTIC)
def between_slip_and_stick(element: Element, quick: bool) -> Iterator[Row]:
    """Friction makes the plate stiffer than smooth, at most as stiff as one that sticks: E U ≤ P ≤ P_tied."""
    cells, grading = _GRADED
    tied = element.solve(plate_under(Contact.tied("top", gap=-1e-3, name="plate"), cells, grading))
    for friction in (0.1, 0.5) if quick else (0.05, 0.1, 0.2, 0.5):
        result = element.solve(compressed_plate(friction, (cells, cells), grading=grading))
        force, proof = result.contacts["plate"].normal_force, certified(result, tied)
        source = "from J(u) ≤ J(v) and P U = 2 J(u) − ∫s|u_T|"
        quantity = f"P/2, μ = {friction:g} [{FORCE}]"
        yield at_least(quantity, force, 209.0, 1e-7, f"E U; {source}", proof)
        glued = tied.contacts["plate"].normal_force
        yield at_most(quantity, force, glued, 1e-7, f"P_tied on the same mesh; {source}", proof)
