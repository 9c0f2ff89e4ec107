"""Chapter on the problem files of the folder examples: what is known of them, and what other methods say of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Final, TypeAlias

import numpy as np

from comparisons.verification.elements import Chapter, Element
from comparisons.verification.known import FOLDER, KNOWN, Answer
from comparisons.verification.measures import traction_difference
from comparisons.verification.proof import both, by_hand, certified, certified_companion
from comparisons.verification.row import Kind, Row, absolute, relative, word
from comparisons.verification.two_models import two_models
from qvi_contact.companion import CompanionResult, solve_companion

PROBLEMS: Final = Chapter()

_OTHER_METHOD: Final = "qp:clarabel"
_SOURCE: Final = "displacement model on the same mesh"


def _by_another_method(answer: Answer, quick: bool, contact: str, form: str = "full") -> Iterator[Row]:
    """The fixed point with quadratic programs against the condensed interior point.

    They are in the full unknowns, unless the mesh is graded too strongly for the back end: `form`.
    """
    if quick:
        return
    result = answer.result
    other = answer.element.solve(result.problem, inner=_OTHER_METHOD, form=form)
    unit = float(np.abs(other.contacts[contact].normal_stress).max())
    difference = traction_difference(result.contacts[contact], other.contacts[contact], unit)
    quantity = f"largest difference of tractions on {contact} over the largest pressure"
    unknowns = "the full unknowns" if form == "full" else "the tractions alone"
    source, proof = f"fixed point, {_OTHER_METHOD} in {unknowns}; ours: condensed", certified(result, other)
    yield absolute(quantity, difference, 0.0, 1e-5, source, proof, Kind.METHODS)


def _displacements(answer: Answer, quick: bool) -> CompanionResult:
    """Displacements on the same mesh, of the degree that goes with the element; in quick runs of degree 2."""
    return solve_companion(answer.result.problem, degree=2 if quick else None)


def _by_displacements(
    answer: Answer, quick: bool, contact: str, tolerance: float, shear: bool = False
) -> Iterator[Row]:
    """Forces of displacements on the same mesh; the tolerance is what both models leave open."""
    companion = _displacements(answer, quick)
    proof = both(certified(answer.result), certified_companion(companion))
    ours, theirs = answer.result.contacts[contact], companion.contacts[contact]
    for letter, name in (("N", "normal_force"), ("T", "tangential_force"))[: 2 if shear else 1]:
        quantity = f"{letter} of {contact}, stress against displacement model"
        yield relative(quantity, getattr(ours, name), getattr(theirs, name), tolerance, _SOURCE, proof, Kind.METHODS)


def _motions(answer: Answer, quick: bool, plate: str, axis: str, tolerance: float) -> Iterator[Row]:
    """How far a plate or pin moves, of stresses and of displacements on the same mesh."""
    companion = _displacements(answer, quick)
    proof, quantity = both(certified(answer.result), certified_companion(companion)), f"motion of {plate} [mm]"
    ours, theirs = (getattr(each.plates[plate], axis) for each in (answer.result, companion))
    yield relative(quantity, ours, theirs, tolerance, _SOURCE, proof, Kind.METHODS)


def _bounds(answer: Answer, quick: bool, contact: str, tolerance: float, apart: float) -> Iterator[Row]:
    yield from two_models(quick, answer.result, contact, tolerance, apart)


_Check: TypeAlias = Callable[[Answer, bool], Iterator[Row]]

_METHODS: Final[dict[str, tuple[_Check, ...]]] = {
    "block_with_hole": (
        partial(_by_another_method, contact="plate"), partial(_by_displacements, contact="plate", tolerance=0.02),
    ),
    "bracket": (partial(_by_another_method, contact="ground"),),
    "compressed_plate": (
        partial(_by_another_method, contact="plate"), partial(_by_displacements, contact="plate", tolerance=1e-3),
    ),
    "dry_stone_wall": (partial(_by_displacements, contact="head 1", tolerance=5e-3),),
    "gravity_column": (partial(_by_another_method, contact="ground"),),
    "gravity_dam": (partial(_bounds, contact="base", tolerance=1e-9, apart=1e-4),),
    "lug": (partial(_motions, plate="bore", axis="x", tolerance=1e-3),),
    "punch": (
        partial(_by_another_method, contact="punch", form="condensed"),
        partial(_motions, plate="punch", axis="y", tolerance=0.02),
    ),
    "ssnv128": (partial(_by_displacements, contact="base", tolerance=1e-3, shear=True),),
    "stacked_blocks": (
        partial(_by_another_method, contact="lower"),
        partial(_by_displacements, contact="lower", tolerance=5e-3, shear=True),
    ),
}  # fmt: skip
"""Name of a problem file → what another method, or another model on the same mesh, is compared in."""


def _rows(element: Element, quick: bool, name: str) -> Iterator[Row]:
    answer = Answer(name, element)
    for line in KNOWN[name].lines:
        yield line.row(answer)
    for check in _METHODS.get(name, ()):
        yield from check(answer, quick)


for _name, _table in KNOWN.items():
    _problem = partial(_rows, name=_name)
    _problem.__doc__ = _table.about
    PROBLEMS.on(f"examples/{_name}", _table.element)(_problem)


@PROBLEMS.named("examples/all")
def every_file(_: bool) -> Iterator[Row]:
    """No problem file is left out of this chapter."""
    found = sorted(path.stem for path in FOLDER.glob("*.toml"))
    proof = by_hand(bool(found), "folder read")
    yield word("files", ", ".join(found), ", ".join(KNOWN), "the folder examples", proof)
