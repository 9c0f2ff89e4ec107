"""Chapter on the compressed plate against displacement codes."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from comparisons.settled import SETTLED, SOURCE
from comparisons.verify.chapter import Chapter
from comparisons.verify.proof import certified
from comparisons.verify.row import Kind, Row, at_least, at_most, relative
from qvi_contact import Contact, ContactProblem, refine, solve
from qvi_contact.gallery import compressed_plate

_GRADED: Final = ((48, 48), 0.86)
_COARSE: Final = ((32, 32), 0.8)


def graded_equilibrium_model(quick: bool) -> Iterator[Row]:
    """Stress elements on one graded mesh, cells shrinking towards the free corner."""
    cells, grading = _COARSE if quick else _GRADED
    for friction, settled in SETTLED.items():
        result = solve(compressed_plate(friction, cells, grading=grading))
        force = result.contacts["plate"].normal_force
        quantity = f"P/2, μ = {friction:g}, {cells[0]}² cells graded by {grading:g} [MPa length]"
        yield relative(quantity, force, settled, 1e-4, Kind.EXTERNAL, SOURCE, certified(result))


def adaptive_equilibrium_model(quick: bool) -> Iterator[Row]:
    """Stress elements on the mesh that `refine` makes for P/2 with a target of 1e-6."""
    for friction in (0.25,) if quick else SETTLED:
        start = compressed_plate(friction, (4, 4))
        refined = refine(start, None, target=1e-6, quantity="plate.normal_force")
        quantity = f"P/2, μ = {friction:g}, refined [MPa length]"
        settled, proof = SETTLED[friction], certified(refined.result)
        yield relative(quantity, refined.value, settled, 3e-6, Kind.EXTERNAL, SOURCE, proof)


def between_slip_and_stick(quick: bool) -> Iterator[Row]:
    """Friction makes the plate stiffer than smooth, at most as stiff as one that sticks: E U ≤ P ≤ P_tied."""
    cells, grading = _COARSE if quick else _GRADED
    tied = solve(_tied(cells, grading))
    for friction in (0.05, 0.1, 0.2, 0.5):
        result = solve(compressed_plate(friction, cells, grading=grading))
        force, proof = result.contacts["plate"].normal_force, certified(result, tied)
        source = "from J(u) ≤ J(v) and P U = 2 J(u) − ∫s|u_T|"
        quantity = f"P/2, μ = {friction:g} [MPa length]"
        yield at_least(quantity, force, 209.0, 1e-7, Kind.ANALYTIC, f"E U; {source}", proof)
        glued = tied.contacts["plate"].normal_force
        yield at_most(quantity, force, glued, 1e-7, Kind.ANALYTIC, f"P_tied on the same mesh; {source}", proof)


def _tied(cells: tuple[int, int], grading: float) -> ContactProblem:
    """The plate glued to what presses it."""
    rough = compressed_plate(1.0, cells, grading=grading)
    glued = Contact.tied("top", gap=-1e-3, name="plate")
    return replace(rough, conditions=[*[c for c in rough.conditions if not isinstance(c, Contact)], glued])


CHAPTER = Chapter(
    "plate",
    "The compressed plate against displacement codes",
    "An equilibrium model and the displacement models of other codes settle on the same force.",
    "Stress and displacement elements share nothing but the problem: they approach from both sides.",
    "More than 1e-4 of the force on a graded mesh, or more than 3e-6 on a refined one.",
    {
        "plate-graded": graded_equilibrium_model,
        "plate-refined": adaptive_equilibrium_model,
        "plate-between": between_slip_and_stick,
    },
)
