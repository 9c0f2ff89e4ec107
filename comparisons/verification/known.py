"""Known values of the problem files in the folder examples, from sources other than this package.

The chapter on these files below, the gallery of the documentation and the tests read this table. A line has a quantity
with its unit, its measure, known value, tolerance and source. A tolerance is relative to the known value, or in the
unit of the quantity where that is zero, or where the comparison is not relative (`Known.compare`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from math import atan, pi, sqrt, tan
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from comparisons.settled import SETTLED
from comparisons.settled import SOURCE as DISPLACEMENT_CODES
from comparisons.verification.measures import edge_states, ellipse, runs, two_models, value_at
from comparisons.verification.rows import (
    Chapter,
    Check,
    Kind,
    Proof,
    Row,
    Value,
    both,
    bounded,
    by_hand,
    certified,
    certified_companion,
    infeasible,
)
from qvi_contact import ContactLine, ContactResult, ContactState, InputError, ProblemFile, load_problem, solve
from qvi_contact.companion import CompanionResult, solve_companion
from qvi_contact.limit import LimitLoad, StrengthReduction, limit_load_factor, strength_reduction_factor
from qvi_contact.refinement.measure import Measure as Quantity
from qvi_contact.solution.history import History, loop_area, solve_history
from solvers import Status

FOLDER: Final = Path(__file__).resolve().parents[2] / "examples"

SSNV128: Final = "Code_Aster, V6.04.128 (SSNV128)"
CYLINDER: Final = (358.536, 0.62146)
"""Hertz, under a hundredth of the load of `gallery.cylinder_on_block`: peak pressure [MPa] and half-width [mm]."""

HALF_DISCS: Final = (9.351351, 0.680778, 0.496511)
"""Peak pressure and half-width of `gallery.half_discs`, and the half-width that sticks by Cattaneo [mm]."""


def read_example(name: str) -> ProblemFile:
    """The problem file of this name; `InputError` outside of a checkout."""
    if not FOLDER.is_dir():
        raise InputError("examples", "the folder examples", "run this in a checkout of the repository")
    return load_problem(FOLDER / f"{name}.toml")


class Answer:
    """The package's results for a problem file, each computed at its first use, by triangles of this degree."""

    def __init__(self, name: str, degree: int) -> None:
        self.file = read_example(name)
        self.problem = self.file.problem
        self.options = {**self.file.solve_options, "degree": degree}

    @cached_property
    def result(self) -> ContactResult:
        """The result of `solve`."""
        return solve(self.problem, **self.options)

    @cached_property
    def history(self) -> History:
        """The result of `solve_history`, with the law at Gauss points.

        In these files no Gauss point opens. A Bernstein coefficient at a toe does, and then pressure does work between
        steps.
        """
        return solve_history(self.file.problems, law_on="points", **self.options)

    @cached_property
    def safety(self) -> StrengthReduction:
        """The result of `strength_reduction_factor`, to 1 %."""
        return strength_reduction_factor(self.problem, accuracy=0.01, degree=self.options["degree"])


@lru_cache(maxsize=1)
def limit_of(answer: Answer, load: str) -> LimitLoad:
    """The result of `limit_load_factor` for the load of this name."""
    return limit_load_factor(answer.problem, [load], degree=answer.options["degree"])


Measure: TypeAlias = Callable[[Answer], tuple[Value, Proof]]
"""The computed value of a quantity, and its proof."""

Further: TypeAlias = Callable[[Answer, bool], Iterator[Row]]
"""Rows that compare with another method, or another model on the same mesh; fewer in quick runs."""


@dataclass(frozen=True)
class Known:
    """One line of the table, see above; `measure` may be a quantity of `refine` by its name.

    The comparison is one of `Check`, by default "relative", or "absolute" where the value is zero.
    """

    quantity: str
    measure: str | Measure
    value: Value
    tolerance: float
    source: str
    kind: Kind = Kind.ANALYTIC
    compare: str = ""

    def row(self, answer: Answer) -> Row:
        """The row that compares the computed with the known value."""
        if isinstance(self.measure, str):
            ours: Value = Quantity.of(answer.problem, self.measure).value(answer.result)
            proof = certified(answer.result)
        else:
            ours, proof = self.measure(answer)
        rows = Check(proof, self.source, self.tolerance, self.kind)
        if isinstance(self.value, str):
            return rows.word(self.quantity, str(ours), self.value)
        compare = getattr(rows, self.compare or ("relative" if self.value else "absolute"))
        return compare(self.quantity, float(ours), self.value)  # type: ignore[no-any-return]


def _of(value: Callable[[ContactResult], Value]) -> Measure:
    return lambda answer: (value(answer.result), certified(answer.result))


def _line(contact: str, value: Callable[[ContactLine], Value]) -> Measure:
    return _of(lambda result: value(result.contacts[contact]))


def _slope(contact: str) -> Measure:
    return _line(contact, lambda line: line.tangential_force / line.normal_force)


def _share(contact: str, state: str) -> Measure:
    return _line(contact, lambda line: line.shares[state])


def _centre(contact: str, axis: str) -> Measure:
    return _line(contact, lambda line: -float(line.weights @ (getattr(line, axis) * line.normal_stress))
                 / line.normal_force)  # fmt: skip


def _ellipse(contact: str, part: int) -> Measure:
    """Height (0) or half-width (1) of the ellipse through the pressure."""
    return _line(contact, lambda line: ellipse(line.x, -line.normal_stress)[part])


def _edges(edges: str, axis: str) -> Measure:
    return _of(lambda result: float(getattr(result.resultant(edges), axis)))


def _beside(edges: str, axis: str, contact: str, sign: float = 1.0) -> Measure:
    """A contact's force less the force on edges, over the normal force: zero in balance."""

    def unbalanced(result: ContactResult) -> float:
        line, other = result.contacts[contact], getattr(result.resultant(edges), axis)
        force = line.normal_force if axis == "y" else line.tangential_force
        return float((force - sign * other) / line.normal_force)

    return _of(unbalanced)


def _limit(load: str, value: Callable[[LimitLoad], float]) -> Measure:
    return lambda answer: (value(limit_of(answer, load)), bounded(limit_of(answer, load)))


def _bound(quantity: str, side: str) -> Measure:
    return _of(lambda result: float(getattr(result.bracket.forces[quantity], side)))


def _cycle(value: Callable[..., float]) -> Measure:
    """`value` of the normal forces N, motions w and shears T of a history, and of the work lost in its second cycle."""

    def measured(answer: Answer) -> tuple[float, Proof]:
        history = answer.history
        normal = np.array([step.contacts["ground"].normal_force for step in history.steps])
        work = history.friction_work[-(len(normal) // 2) :]
        proof = both(*map(certified, history.steps))
        failed = Proof(passed=False, text=f"failed, {history.status.value}")
        return float(value(normal, *history.loop("ground"), work)), proof if history.status is Status.SOLVED else failed

    return measured


def _both_sides(load: str, factor: float, source: str, below: float = 1e-6, above: float = 1e-9) -> tuple[Known, Known]:
    """The limit load factor, by the stresses of the mesh and by a mechanism or a flow, with their tolerances."""
    return (
        Known("limit load factor, from below", _limit(load, lambda limit: limit.lower), factor, below, source),
        Known("limit load factor, from above", _limit(load, lambda limit: limit.upper), factor, above, source),
    )


def _safety(side: str) -> Measure:
    """The factor of safety on strength to 1 %, from one side."""

    def measured(answer: Answer) -> tuple[float, Proof]:
        found = answer.safety
        return getattr(found, side), Proof(0.0 < found.lower <= found.upper, "bounds from both sides")

    return measured


def _displacements(answer: Answer, quick: bool, tolerance: float) -> tuple[CompanionResult, Check]:
    """The displacement model on the same mesh, of the default degree, in quick runs of degree 2."""
    companion = solve_companion(answer.problem, degree=2 if quick else None)
    proof = both(certified(answer.result), certified_companion(companion))
    return companion, Check(proof, "displacement model on the same mesh", tolerance, Kind.METHODS)


_BY_DISPLACEMENTS: Final = {
    "normal_force": "N of {}, stress against displacement model",
    "tangential_force": "T of {}, stress against displacement model",
    "x": "motion of {} [mm]", "y": "motion of {} [mm]",
}  # fmt: skip


def _by_displacements(tolerance: float, *quantities: str) -> list[Further]:
    """Forces, and motions of plates and pins, by both models; the tolerance is the discretisation error of both."""

    def rows(answer: Answer, quick: bool) -> Iterator[Row]:
        companion, rows = _displacements(answer, quick, tolerance)
        for name, _, kind in (quantity.partition(".") for quantity in quantities):
            ours, theirs = (getattr((each.contacts if "force" in kind else each.plates)[name], kind)
                            for each in (answer.result, companion))  # fmt: skip
            yield rows.relative(_BY_DISPLACEMENTS[kind].format(name), ours, theirs)

    return [rows]


def _toe(answer: Answer, quick: bool) -> Iterator[Row]:
    """The settlement of the toe of the retaining wall."""
    companion, rows = _displacements(answer, quick, 0.01)
    known = 2.0 * _WALL[0] / (3.0 * _WALL[2]) / 30.0
    settlement = -float(companion.displacement(0.0, 0.0)[1])
    yield rows.relative("settlement of the toe [m]", settlement, known, "2 N/(3 x k), a rigid wall; concrete bends")


@dataclass(frozen=True)
class Table:
    """Known values of a problem file: its subject in one sentence, lines, further rows, and the degree."""

    about: str
    lines: Sequence[Known]
    further: Sequence[Further] = ()
    degree: int = 4


_HERTZ: Final = "Hertz; half planes, a/R = "
_DAM: Final = (10.44, 0.00981 * 28.0 * 12.0, 0.00981 * 28.0**2 / 2.0)  # weight, uplift and thrust [MN/m]
_SEAM: Final = (15.24, 0.00981 * 33.0 * 40.0 / 2.0, 0.00981 * 33.0**2 / 2.0)  # those of the dam on a seam
_SLIDING: Final = (0.5 * (_SEAM[0] - _SEAM[1]) + 0.05 * 40.0) / _SEAM[2]
_WALL: Final = (0.1539, 0.36 * 0.018 * 4.5**2 / 2.0, (0.20049 - 0.36 * 0.018 * 4.5**3 / 6.0) / 0.1539)
"""Weight and thrust of the retaining wall [MN/m], and distance of the resultant pressure behind the toe [m]."""

_UPHILL: Final = 0.99 * (0.1 + 0.3) / (1.0 - 0.1 * 0.3)  # 0.99 of the push that moves the wedge, over its weight
_EXTERNAL, _METHODS, _PUBLISHED = Kind.EXTERNAL, Kind.METHODS, Kind.PUBLISHED

KNOWN: Final[dict[str, Table]] = {
    "block_with_hole": Table("A block with a free hole under a plate: top and bottom carry the same.", [
        Known("force on hole floor [N/mm]", _edges("hole floor", "y"), 0.0, 1e-7, "the hole is free"),
        Known("force on hole roof [N/mm]", _edges("hole roof", "y"), 0.0, 1e-7, "the hole is free"),
        Known("N less the force on the bottom, over N", _beside("block bottom", "y", "plate"), 0.0, 1e-9, "balance"),
        Known("T over N", _slope("plate"), 0.0, 1e-8, "symmetry in x"),
        Known("N [N/mm]", "plate.normal_force", 3e4 / (1.0 - 0.25**2) * 1e-3, 0.0,
              "E U/(1 − ν²), the whole block held sideways; a hole makes it softer", compare="at_most"),
    ], _by_displacements(0.02, "plate.normal_force")),
    "bolted_angle": Table("An angle bolted to a wall: forces, centre of pressure, and the load at which it slides.", [
        Known("N [N/mm]", "wall.normal_force", 400.0, 1e-9, "force of the bolt"),
        Known("T [N/mm]", "wall.tangential_force", 100.0, 1e-9, "load"),
        Known("centre of pressure y [mm]", _centre("wall", "y"), 60.0 - 80.0 * 100.0 / 400.0, 1e-8,
              "60 - 80 F/B, moments"),
        *_both_sides("load", 0.4 * 400.0 / 100.0, "μB/F"),
    ]),
    "bracket": Table("An L on rough ground: forces and their centre by statics alone.", [
        Known("N [MN/m]", "ground.normal_force", 10.0, 1e-9, "load on the roof, balance"),
        Known("T [MN/m]", "ground.tangential_force", -3.0, 1e-9, "wind, balance"),
        Known("centre of pressure x [m]", _centre("ground", "x"), (10.0 * 0.5 + 3.0 * 1.5) / 10.0, 1e-9,
              "(10 · 0.5 + 3 · 1.5)/10, balance of moments"),
    ]),
    "brake_pad": Table("A brake pad in full slip: friction force and centre of pressure by statics.", [
        Known("N [N/mm]", "face.normal_force", 160.0, 1e-9, "force of the piston"),
        Known("T [N/mm]", "face.tangential_force", 0.4 * 160.0, 1e-6, "μ N in full slip"),
        Known("share of the face that sticks", _share("face", "stick"), 0.0, 0.0, "the disc turns"),
        Known("force on the abutment [N/mm]", "abutment.normal_force", 0.4 * 160.0, 1e-6, "balance"),
        Known("centre of pressure x [mm]", _centre("face", "x"), 40.0 - 0.4 * 14.5, 1e-6, "balance of moments"),
    ]),
    "compressed_plate": Table("The paper's plate on 16 × 16 graded cells, against displacement codes.", [
        Known("N [N/mm]", "plate.normal_force", SETTLED[0.2], 1e-3, f"{DISPLACEMENT_CODES}; the mesh is coarse",
              _EXTERNAL),
    ], _by_displacements(1e-3, "plate.normal_force")),
    "cyclic_shear": Table("A block sheared to and fro: the second cycle repeats the first and loses the loop's area.", [
        Known("largest |T| − μN over N", _cycle(lambda N, _w, T, _work: (np.abs(T) - 0.3 * N).max() / N.max()),
              0.0, 1e-9, "|T| ≤ μN", compare="at_most"),
        Known("largest difference of T between the cycles, over N",
              _cycle(lambda N, _w, T, work: np.abs(T[-len(work) :] - T[-2 * len(work) : -len(work)]).max() / N.max()),
              0.0, 1e-6, "a cyclic state repeats itself after the first loading"),
        Known("work of friction in the second cycle over the loop's area",
              _cycle(lambda _, w, T, work: work.sum() / loop_area(w[-len(work) - 1 :], T[-len(work) - 1 :])),
              1.0, 1e-6, "∮T dw, balance of energy"),
    ]),
    "cylinder_on_block": Table("A cylinder on a block: NAFEMS R0094-1 with a hundredth of its force, against Hertz.", [
        Known("peak pressure [MPa]", _ellipse("contact", 0), CYLINDER[0], 2e-4, f"{_HERTZ}0.012"),
        Known("half-width [mm]", _ellipse("contact", 1), CYLINDER[1], 2e-4, f"{_HERTZ}0.012"),
    ]),
    "dam_on_seam": Table("A dam on rock with a weak seam: its factor of safety, and the thrust it carries.", [
        Known("N of seam [MN/m]", "seam.normal_force", _SEAM[0], 1e-9, "W"),
        Known("T of seam [MN/m]", "seam.tangential_force", _SEAM[2], 1e-9, "H = γ h²/2"),
        Known("factor of safety, from below", _safety("lower"), _SLIDING, 0.01, "(μ (W - U) + c L)/H, to 1 %"),
        Known("factor of safety, from above", _safety("upper"), _SLIDING, 0.01, "(μ (W - U) + c L)/H, to 1 %"),
        *_both_sides("thrust", _SLIDING, "(μ (W - U) + c L)/H", 2e-5, 2e-5),
    ], degree=3),
    "dragged_block_holds": Table("A block at 0.99 of what friction can carry: balance, and the limit load factor.", [
        Known("N [MN/m]", "base.normal_force", 20.0, 1e-9, "p w, balance"),
        Known("T [MN/m]", "base.tangential_force", -9.9, 1e-9, "−T w, balance"),
        Known("limit load factor", _limit("drag", lambda limit: limit.lower), 1.0 / 0.99, 1e-6, "μp/T"),
    ]),
    "dragged_block_slides": Table("The same block at 1.01 of the limit: infeasible, with a proof.", [
        Known("status", lambda a: (a.result.status.value, infeasible(a.result)), "infeasible", 0.0, "T > μp"),
        Known("limit load factor", _limit("drag", lambda limit: limit.lower), 1.0 / 1.01, 1e-6, "μp/T"),
    ]),
    "dry_stone_wall": Table("A wall of three courses: every bed carries load and weight above it.", [
        line
        for bed, height in (("upper bed", 1.0), ("lower bed", 2.0), ("ground", 3.0))
        for line in (
            Known(f"N of {bed} [kN/m]", f"{bed}.normal_force", 3.0 * (30.0 + 24.0 * height), 1e-9,
                  "3 (30 + 24 h), balance of what lies above"),
            Known(f"T of {bed} over N", _slope(bed), 0.0, 1e-9, "balance in x"),
        )
    ], _by_displacements(5e-3, "head 1.normal_force")),
    "gravity_column": Table("A column under its own weight: balance, and uniform pressure away from the ends.", [
        Known("N [N/m]", "ground.normal_force", 98100.0, 1e-9, "ρ g w h"),
        Known("T over N", _slope("ground"), 0.0, 1e-9, "symmetry in x"),
        Known("σ_yy at mid-height [Pa]", _of(lambda r: float(r.stress(0.5, 2.0)[1])), -49050.0, 1e-3,
              "−ρ g (h − y), Saint-Venant two widths above the ground"),
    ]),
    "gravity_dam": Table("A dam on rock with uplift in its base joint: forces, and the factor of sliding.", [
        Known("N [MN/m]", "base.normal_force", _DAM[0], 1e-9, "W"),
        Known("effective N [MN/m]", _line("base", lambda line: line.effective_normal_force), _DAM[0] - _DAM[1], 1e-9,
              "W - U"),
        Known("T [MN/m]", "base.tangential_force", _DAM[2], 1e-9, "H = γ h²/2"),
        *_both_sides("thrust", 0.75 * (_DAM[0] - _DAM[1]) / _DAM[2], "μ (W - U)/H, factor of sliding"),
    ], [lambda answer, quick: two_models(quick, answer.result, "base", 1e-9, 1e-4)]),
    "half_discs": Table("Two half discs with partial slip, against Hertz and Cattaneo.", [
        Known("peak pressure [MPa]", _ellipse("contact", 0), HALF_DISCS[0], 0.01, f"{_HERTZ}0.085"),
        Known("half-width [mm]", _ellipse("contact", 1), HALF_DISCS[1], 0.01, f"{_HERTZ}0.085"),
        Known("half-width that sticks [mm]",
              _line("contact", lambda line: float(np.abs(line.x[line.state == ContactState.STICK]).max())),
              HALF_DISCS[2], 0.05, "Cattaneo, a √(1 - Q/(μP)); to one point of the mesh"),
        Known("shear in the middle [MPa]",
              _line("contact", lambda line: float(np.abs(line.tangential_stress)[np.argmin(np.abs(line.x))])),
              0.2 * HALF_DISCS[0] * (1.0 - HALF_DISCS[2] / HALF_DISCS[1]), 0.03,
              "Cattaneo, μ p₀ (1 - c/a); half planes, a/R = 0.085"),
    ]),
    "jointed_slope": Table("A jointed slope pushed by water in its crack slides on its lowest bedding plane.", [
        Known("thrust [kN/m]", _edges("crack", "x"), -10.0 * 4.0**2 / 2.0, 1e-9, "γ_w z²/2"),
        *_both_sides("water", 25.0 * 28.0 * sqrt(3.0) * tan(atan(0.7) - pi / 6.0) / 80.0,
                     "W tan(φ - β)/V, plane failure; W of 28 √3 m²"),
    ]),
    "lug": Table("A lug pulled by a rigid pin: the force goes through the bore.", [
        Known("force where it is held [N/mm]", _edges("held", "x"), -4000.0, 1e-12, "force of the pin, balance"),
        Known("force across, over the pin's", _of(lambda r: r.resultant("held").y / 4000.0), 0.0, 1e-12, "balance"),
        Known("force of the pin [N/mm]", "bore.force_x", 4000.0, 1e-12, "the pull"),
        Known("share of the bore that sticks", _share("bore", "stick"), 0.0, 0.0, "the bore gives way on both sides"),
    ], _by_displacements(1e-3, "bore.x")),
    "masonry_wall": Table("A masonry wall with openings: forces on the ground, and bounds of the wind it carries.", [
        Known("N of ground [kN/m]", "ground.normal_force", 20.0 * (3.0 * 2.0 - 0.5 * 1.0 - 0.75 * 0.75), 1e-9,
              "weight, balance"),
        Known("T of ground [kN/m]", "ground.tangential_force", -2.0 * 2.0, 1e-9, "p h, balance"),
        *(Known("limit load factor, from below over from above",
                _limit("wind", lambda limit: limit.lower / limit.upper),
                value, 0.0, "motion of rigid blocks on the same joints", _METHODS, compare)
          for value, compare in ((1.0, "at_most"), (0.92, "at_least"))),
    ]),
    "meshed_apart": Table("A block on a base, meshed apart: the patch test.", [
        Known("N [N/mm]", "seam.normal_force", 500.0, 1e-9, "balance"),
        Known("T over N", _slope("seam"), 0.0, 1e-9, "uniform stress"),
        Known("largest pressure [MPa]", _line("seam", lambda line: float(-line.normal_stress.min())), 10.0, 1e-9,
              "uniform stress"),
        Known("least pressure [MPa]", _line("seam", lambda line: float(-line.normal_stress.max())), 10.0, 1e-9,
              "uniform stress"),
    ]),
    "preloaded_joint": Table("The preload diagram of a bolted joint, the bolt as springs below its head.", [
        Known("force of the bolt [N/mm]", "bolt.normal_force", 1000.0 + 0.5 * 2e4 / (2e4 + 1.4e5) * 800.0, 1e-9,
              "F + n c_b/(c_b + c_m) P, n = 1/2 for a load that is spread over the height"),
        Known("N of the base [N/mm]", "base.normal_force", 1000.0 + (0.5 * 2e4 / (2e4 + 1.4e5) - 1.0) * 800.0, 1e-9,
              "what is left of the preload, balance"),
        Known("derivative of the bolt's force by a factor of the load [N/mm]",
              _of(lambda result: result.derivative("bolt.normal_force", "load.body")),
              0.5 * 2e4 / (2e4 + 1.4e5) * 800.0, 1e-9, "n c_b/(c_b + c_m) P"),
        Known("T of the base over N", _slope("base"), 0.0, 1e-9, "symmetry"),
    ]),
    "punch": Table("A rigid flat punch on a block: balance, symmetry, and the half-plane's pressure.", [
        Known("N [N/mm]", "punch.normal_force", 100.0, 1e-9, "force on the punch"),
        Known("T over N", _slope("punch"), 0.0, 1e-3, "symmetry in x; diagonals of the cells are not"),
        Known("centre of pressure x [mm]", _centre("punch", "x"), 0.0, 1e-3, "symmetry in x"),
        Known("pressure in the middle [MPa]", _line("punch", lambda line: -value_at(line, line.normal_stress, 0.0)),
              100.0 / pi, 0.08, "P/(π a), Johnson, Contact Mechanics, section 2.8; "
              "frictionless half-plane, 8 % for a block 20 times as wide"),
        Known("share that sticks", _share("punch", "stick"), 0.775, 0.05,
              "displacements on lines 0.01 apart; an element of 0.05 to 0.2 has the end of stick", _METHODS,
              "absolute"),
    ], _by_displacements(0.02, "punch.y")),
    "retaining_wall": Table("A retaining wall on springs: the heel lifts off, and pressure and tilt are by hand.", [
        Known("N [MN/m]", "base.normal_force", _WALL[0], 1e-9, "weight of the wall and of the soil on its heel"),
        Known("T [MN/m]", "base.tangential_force", _WALL[1], 1e-9, "Ka γ h²/2"),
        Known("centre of pressure x [m]", _centre("base", "x"), _WALL[2], 1e-9, "balance of moments"),
        Known("largest pressure [MPa]", _line("base", lambda line: -value_at(line, line.normal_stress, 0.0)),
              2.0 * _WALL[0] / (3.0 * _WALL[2]), 0.01, "2 N/(3 x), a rigid wall on springs; concrete bends"),
        Known("share of the base that is open", _share("base", "open"), 1.0 - 3.0 * _WALL[2] / 2.2, 0.03,
              "1 − 3 x/b, a rigid wall on springs; to one point of the mesh", compare="absolute"),
        *_both_sides("earth", 0.55 * _WALL[0] / _WALL[1], "μ N/H, factor of sliding"),
    ], [_toe]),
    "shrink_fit": Table("A warm shaft in a cold hub: a shrink fit by temperature.", [
        Known("N [N/mm]", "fit.normal_force", 47.25 * 25.0 * pi / 2.0, 1e-5, "(E α ΔT/2)(1 - R²/b²) R π/2, Lamé"),
        Known("pressure in the middle [MPa]",
              _line("fit", lambda line: -value_at(line, line.normal_stress, 25.0 / sqrt(2.0))), 47.25, 2e-3, "Lamé"),
        Known("T over N", _slope("fit"), 0.0, 1e-4, "symmetry"),
        Known("hoop stress at the bore of the hub [MPa]", _of(lambda result: float(result.stress(25.0 + 1e-6, 0.0)[1])),
              78.75, 5e-3, "(E α ΔT/2)(1 + R²/b²), Lamé"),
        Known("derivative of N by the temperature of the shaft [N/mm/K]",
              _of(lambda result: result.derivative("fit.normal_force", "shaft.temperature")),
              47.25 * 25.0 * pi / 2.0 / 50.0, 1e-5, "N is proportional to ΔT"),
        Known("derivative of N by the gap [N/mm/mm]",
              _of(lambda result: result.derivative("fit.normal_force", "fit.gap")),
              -47.25 * 25.0 * pi / 2.0 / (1.2e-5 * 50.0 * 25.0), 1e-5, "N over the interference α ΔT R"),
    ], _by_displacements(1e-3, "fit.normal_force"), degree=5),
    "ssnv128": Table("SSNV128 on 32 × 32 cells.", [
        Known("N [Pa m]", "base.normal_force", 2e6, 1e-9, "p a, balance"),
        Known("T [Pa m]", "base.tangential_force", -1.40535e6, 2e-3, "biquadratic displacement elements; ± 5 N/m",
              _EXTERNAL),
        Known("u_x at point A [m]", _line("base", lambda line: value_at(line, line.slip, 0.0)), 2.86e-5, 0.05,
              f"{SSNV128}; ± 5 %", _PUBLISHED),
        Known("zones from the left", _line("base", lambda line: runs(edge_states(line))), "open, slip, stick", 0.0,
              "biquadratic displacement elements", _EXTERNAL),
    ], _by_displacements(1e-3, "base.normal_force", "base.tangential_force")),
    "stacked_blocks": Table("Three blocks: every joint hands on what acts on the top, and holds it.", [
        line
        for joint in ("lower", "upper")
        for line in (
            Known(f"N of {joint} less the force on the top, over N", _beside("top", "y", joint, -1.0), 0.0, 1e-9,
                  "balance of the blocks above"),
            Known(f"T of {joint} less the force on the top, over N", _beside("top", "x", joint), 0.0, 1e-9,
                  "balance of the blocks above"),
        )
    ], _by_displacements(5e-3, "lower.normal_force", "lower.tangential_force")),
    "strip_footing": Table("A strip footing on clay: Prandtl's pressure lies between both bounds.", [
        Known(f"limit load factor, from {side}", _limit("footing", value), (2.0 + pi) / 2.0, tolerance,
              "(2 + π) c, Prandtl", compare=compare)
        for side, value, further in (("below", lambda limit: limit.lower, "at_most"),
                                     ("above", lambda limit: limit.upper, "at_least"))
        for compare, tolerance in (("relative", 0.01), (further, 0.0))
    ], degree=5),
    "trapezoid": Table("A trapezoid on a plane that holds it: bounds around the force of a displacement code.", [
        *(Known(f"P, {side} bound [MN/m]", _bound("base.normal_force", side), 14.0483793, 0.0,
                "NGSolve, degree 12, mesh graded to the corners", _EXTERNAL, compare)
          for side, compare in (("lower", "at_most"), ("upper", "at_least"))),
        Known("share of the base that sticks", _share("base", "stick"), 1.0, 0.0, "rough enough"),
    ], degree=5),
    "wedge": Table("A block pushed up a slope: NAFEMS CGS-4.", [
        Known("N [MN/m]", "slope.normal_force", (1.0 + 0.1 * _UPHILL) / sqrt(1.01), 1e-9,
              "(G + F tan α) cos α, balance"),
        Known("T [MN/m]", "slope.tangential_force", (0.1 - _UPHILL) / sqrt(1.01), 1e-9,
              "(G tan α - F) cos α, balance"),
        *_both_sides("push", 1.0 / 0.99, "F/G = (tan α + μ)/(1 - μ tan α), 0.99 of it applied"),
    ], [lambda answer, quick: two_models(quick, answer.result, "slope", 1e-9, 1e-2)]),
}  # fmt: skip
"""Name of a problem file → what is known of it."""

EXAMPLES: Final = Chapter()


def _rows(p: int, quick: bool, name: str) -> Iterator[Row]:
    answer = Answer(name, p)
    for line in KNOWN[name].lines:
        yield line.row(answer)
    for check in KNOWN[name].further:
        yield from check(answer, quick)


for _name, _table in KNOWN.items():
    _problem = partial(_rows, name=_name)
    _problem.__doc__ = _table.about
    EXAMPLES(f"examples/{_name}", _table.degree)(_problem)


@EXAMPLES("examples/all")
def every_file(_: bool) -> Iterator[Row]:
    """No problem file is left out of this chapter."""
    found = sorted(path.stem for path in FOLDER.glob("*.toml"))
    rows = Check(by_hand(bool(found), "folder read"))
    yield rows.word("files", ", ".join(found), ", ".join(KNOWN), "the folder examples")
