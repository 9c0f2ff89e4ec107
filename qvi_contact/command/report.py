"""What commands print about results, problems and limit loads: text for a terminal, and JSON documents."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import product
from typing import TYPE_CHECKING, Any, Final, NamedTuple, TypeAlias

import numpy as np

from qvi_contact import export
from qvi_contact.basics.schema import write_table
from qvi_contact.discretization.discretization import discretize
from qvi_contact.errors import place_of
from qvi_contact.files.problem_file import ELEMENT_OPTIONS, ProblemFile
from qvi_contact.mechanism import Bodies, works
from qvi_contact.problem.conditions import Condition, Contact, Traction
from qvi_contact.problem.fields import Expression, PointData, Polynomial
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.contact_line import SUMMARY, ContactState
from qvi_contact.solution.result import PLATE_COLUMNS, RESULTANT, ContactResult, Resultant, contact_numbers, reactions
from qvi_contact.units import Certainty, Rounding, Units, shown
from solvers.errors import counted

if TYPE_CHECKING:
    from qvi_contact.limit.load_factor import LimitLoad, StrengthReduction
    from qvi_contact.refinement import LimitRefinement, Refinement, RefinementRound
    from qvi_contact.refinement.adaptive import Outcome

STATES = [state.name.lower() for state in ContactState]
OF_CONTACTS = {name: SUMMARY[name] for name in ("normal_force", "tangential_force", "largest_pressure")}
_LAW_ON = {"points": "at Gauss points", "edges": "on whole edges"}
_NUMBER = re.compile(r"\d[\d.e+-]*(?![^()]*\))")  # other than places, which stand in parentheses
_HIDDEN = ("kind", "edges", "length", "joint")  # keys of conditions that their line shows elsewhere
_ELASTIC = ("young", "poisson", "plane", "cells")  # keys of materials that every line shows


def result_lines(result: ContactResult, units: Units) -> Iterator[str]:
    """Message, remarks, certificate, and a table with a row for each contact; then plates, pins and supports."""
    yield result.message
    yield from (f"remark: {units.filled(remark)}" for remark in result.remarks)
    if not result.has_state:
        return
    if result.solution.factorisation:
        yield f"factorisation: {result.solution.factorisation}"
    summary = result.certificate.summary()
    if summary not in result.message:
        yield summary
    lines = result.contacts.values()
    states = [state for state in STATES if any(state in line.shares for line in lines)]
    numbers, force = contact_numbers(result), units.force
    rows = [
        [line.name, *cells(numbers[line.name], OF_CONTACTS, result.rounding), *shares(line.shares, states)]
        for line in lines
    ]
    if rows:
        yield ""
        headings = with_units(("normal", "tangential", "peak"), OF_CONTACTS, units)
        yield from table(["contact", *headings, *states], rows)
    for line in result.contacts.values():
        if line.has_fluid:
            effective = shown(line.effective_normal_force, result.rounding.force)
            yield f"contact {line.name}: effective normal force, without the pore pressure, {effective} {force}"
    for name, motion in result.plates.items():
        x, y, rotation, force_x, force_y, moment = cells(numbers[name], PLATE_COLUMNS, result.rounding)
        at = place_of(motion.centre)
        yield f"obstacle {name} moves by ({x}, {y}) {units.displacement} at {at}, turns by {rotation} rad"
        yield f"obstacle {name} pushes with ({force_x}, {force_y}) {force}, moment {moment} {units.moment} about {at}"
    place, forces = about_middle(result.problem, reactions(result))
    for name, resultant in forces.items():
        x, y, moment = cells(resultant, RESULTANT, result.rounding)
        yield f"support {name} acts with ({x}, {y}) {force}, moment {moment} {units.moment} about {place}"


def about_middle(problem: ContactProblem, forces: Mapping[str, Resultant]) -> tuple[str, dict[str, dict[str, float]]]:
    """The middle of the body, and the forces with their moments about it, by the keys of `RESULTANT`."""
    low, high = (end(problem.mesh.vertices, axis=0).tolist() for end in (np.min, np.max))
    centre = middle(low[0], high[0]), middle(low[1], high[1])
    numbers = {name: vars(force) for name, force in forces.items()}
    return place_of(centre), {name: {**each, "moment": moment_about(centre, **each)} for name, each in numbers.items()}


Titled: TypeAlias = tuple[str, list[str], list[list[str]]]
"""A table: title, headings, rows."""


class Series(NamedTuple):
    """Results of a history, with label "t" and its times, or of a sweep over the parameter `label` of contacts `of`."""

    results: Any
    label: str
    values: tuple[float, ...]
    of: tuple[str, ...] | None = None

    @property
    def owners(self) -> str:
        """Text behind the label: the contacts or loads of a sweep, if it is restricted to some."""
        return f" of {', '.join(self.of)}" if self.of else ""

    def document(self, summaries: Sequence[dict[str, Any]], units: Units) -> dict[str, Any]:
        """Keys for JSON: times or values, summaries of the results, of a history the energy lost in friction."""
        if self.label != "t":
            return {self.label: list(self.values), "steps": list(summaries)}
        lost = self.results.dissipated
        values = {"total": float(lost.sum()), "steps": lost.tolist()}
        dissipated = {name: {"value": value, "unit": units.energy} for name, value in values.items()}
        return {"times": list(self.values), "dissipated": dissipated, "steps": list(summaries)}

    def lines(self, units: Units) -> Iterator[str]:
        """The tables, and the sentences about all results."""
        for title, headings, rows in self.tables(units):
            yield title
            yield from table(headings, rows)
            yield ""
        yield from self.said(units)

    def said(self, units: Units) -> Iterator[str]:
        """Sentences: the energy lost, each remark with the time or value at which it first appears, the message."""
        steps = self.results.steps
        if self.label == "t":
            rounding = Rounding.largest(step.rounding for step in steps)
            dissipated = shown(float(self.results.dissipated.sum()), rounding.energy)
            yield f"energy lost in friction: {dissipated} {units.energy}"
        first_remarks = dict[str, str]()  # a remark whose numbers alone change is given once
        for value, step in zip(self.values, steps, strict=False):
            first = f"remark, first at {self.label}{self.owners} = {value:g}: "
            for remark in step.remarks:
                first_remarks.setdefault(_NUMBER.sub("", remark), first + units.filled(remark))
        yield from first_remarks.values()
        yield self.results.message

    def tables(self, units: Units) -> Iterator[Titled]:
        """One table for each contact and each plate, with a row for each time or value.

        Rounding noise, which is shown as 0, is measured by the largest step of a history, in a sweep by each result.
        """
        is_history, length = self.label == "t", f"[{units.displacement}]"
        headings = {"load": "load factor", "gap": "added gap", "offset": "added offset"}
        heading = headings.get(self.label, self.label) + self.owners + f" {length}" * (self.label in ("gap", "offset"))
        first_headings = ["step", "t", "status"] if is_history else [heading, "status", "iterations"]
        records = list[tuple[list[str], Mapping[str, Any], Mapping[str, Any], Rounding]]()
        for number, step in enumerate(self.results.steps):  # read each step once: it may be a file
            start = [f"{self.values[number]:.6g}", str(step.status)]
            start = [str(number + 1), *start] if is_history else [*start, str(step.iterations)]
            lines = step.contacts if step.has_state else {}
            share_of = {name: line.shares for name, line in lines.items()}
            records.append((start, contact_numbers(step) if lines else {}, share_of, step.rounding))
        largest = Rounding.largest(least for *_, least in records) if is_history else None
        kinds: Any = (
            ("contact", f"forces in {units.force}", OF_CONTACTS, ["normal", "tangential", f"peak [{units.stress}]"]),
            ("obstacle", "its motion and its force on the body, at its pivot", PLATE_COLUMNS, plate_headings(units)),
        )
        for (kind, content, columns, labels), contact in product(kinds, self.results.steps[0].problem.contacts):
            if columns is PLATE_COLUMNS and contact.plate is None:
                continue
            name = contact.name
            present = {state for _, _, share_of, _ in records for state in share_of.get(name, ())}
            states = [state for state in STATES if state in present and columns is OF_CONTACTS]
            rows = [
                [*start, *cells(numbers.get(name), columns, largest or own), *shares(share_of.get(name, {}), states)]
                for start, numbers, share_of, own in records
            ]
            yield f"{kind} {name}, {content}", [*first_headings, *labels, *states], rows


def plate_headings(units: Units) -> list[str]:
    """Headings of the motion, the force and the moment of a plate."""
    return with_units(("moved x", "moved y", "turned", "F_x", "F_y", "moment"), PLATE_COLUMNS, units)


def with_units(labels: Iterable[str], columns: Mapping[str, str], units: Units) -> list[str]:
    """Headings with units: `columns` has the kind of unit, a name in `Units`, of each column."""
    return [f"{label} [{getattr(units, kind)}]" for label, kind in zip(labels, columns.values(), strict=True)]


def cells(
    numbers: Mapping[str, float] | None, columns: Mapping[str, str], least: Rounding, digits: int = 6
) -> list[str]:
    """The numbers of these columns as texts, see `Rounding.cleaned`; an empty list without numbers."""
    cleaned = least.cleaned([numbers[name] for name in columns], columns.values()) if numbers is not None else []
    return [shown(value, digits=digits) for value in cleaned]


def outline_lines(outline: Mapping[str, Any], units: Units) -> Iterator[str]:
    """The document of `outline` as lines of text."""
    mesh = outline["mesh"]
    yield (
        f"mesh: {counted(mesh['cells'], 'triangle')}, "
        f"edges {mesh['smallest']:.4g} to {mesh['largest']:.4g} {units.length} long; "
        f"x from {mesh['x'][0]:.9g} to {mesh['x'][1]:.9g}, y from {mesh['y'][0]:.9g} to {mesh['y'][1]:.9g}"
    )
    element = outline["element"]
    yield f"element: {element['name']}, degree {element['degree']}, contact law {_LAW_ON[element['law_on']]}"
    yield f"unknowns: {outline['unknowns']}, contact points: {outline['contact_points']}"
    for material in outline["materials"]:
        yield (
            f"material: E = {material['young']:g} {units.stress}, ν = {material['poisson']:.12g}, "
            f"plane {material['plane']}, {counted(material['cells'], 'cell')}"
            + "".join(f", {_toml({name: value})}" for name, value in material.items() if name not in _ELASTIC)
        )
    if outline["temperature"] != 0.0:
        yield f"temperature: {outline['temperature']}"
    for condition in outline["boundary"]:
        data = {name: value for name, value in condition.items() if name not in _HIDDEN and value != "unilateral"}
        data |= data.pop("plate", {})
        place = f"{condition['kind']} on {condition['edges']} ({condition['length']:g} {units.length})"
        yield f"{place}: {_toml(data)}" if data else place
    for name in outline["whole"]:
        yield f"inner line {name}: no contact, so the body holds together there"
    centre = middle(*mesh["x"]), middle(*mesh["y"])
    for load in outline["loads"]:
        moment = moment_about(centre, load["x"], load["y"], load["moment"])
        yield (
            f"load {load['name']}: ({load['x']:.6g}, {load['y']:.6g}) {units.force}, "
            f"moment {moment:.6g} {units.moment} about {place_of(centre)}"
        )
    for name in ("solve", "refine"):
        if outline[name]:
            yield f"{name}: " + ", ".join(f"{key} = {value}" for key, value in outline[name].items())
    times = outline["times"]
    if times:
        yield f"history: {len(times)} steps, t between {min(times):g} and {max(times):g}; shown at t = {times[0]:g}"
    if outline["sweep"]:
        values = outline["sweep"]["values"]
        yield f"sweep: {outline['sweep']['parameter']}, {len(values)} values from {min(values):g} to {max(values):g}"
    yield from (f"remark: {remark}" for remark in outline["remarks"])


def middle(low: float, high: float) -> float:
    """The middle of a range of coordinates; 0 if it is rounding."""
    return (low + high) / 2.0 if abs(low + high) > _NOISE * (high - low) else 0.0


def moment_about(point: tuple[float, float], x: float, y: float, moment: float) -> float:
    """The moment about a point of a force (x, y) whose moment about the origin is given; 0 if it is rounding.

    About the middle of a body the digits count that are shown, however far the body is from the origin.
    """
    terms = moment, point[1] * x, -point[0] * y
    return sum(terms) if abs(sum(terms)) > _NOISE * max(map(abs, terms)) else 0.0


def _toml(table: Mapping[str, Any]) -> str:
    """Keys and values on one line, inner tables in braces, as in a problem file."""
    texts = {name: f"{{ {_toml(value)} }}" if isinstance(value, Mapping) else value for name, value in table.items()}
    return ", ".join(f"{name} = {value}" for name, value in texts.items())


def shares(share_of: Mapping[str, float], states: Iterable[str]) -> list[str]:
    """Shares of a contact's length in these states as texts, "-" for other states; empty without shares."""
    return [f"{100.0 * share_of[name]:.1f} %" if name in share_of else "-" for name in states if share_of]


def table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """The lines of a table: the first column is aligned left, the others right; short rows are filled up."""
    full_rows = [list(heading), *([*row, *[""] * (len(heading) - len(row))] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*full_rows, strict=True)]
    for row in full_rows:
        cells = [row[0].ljust(widths[0]), *(text.rjust(width) for text, width in zip(row[1:], widths[1:], strict=True))]
        yield "  ".join(cells).rstrip()


def _accuracy(outcome: Outcome | RefinementRound) -> dict[str, Any]:
    """The relative error of a number and its kind, for JSON."""
    return {"estimate": outcome.estimate, "guaranteed": outcome.guaranteed, "certainty": str(outcome.certainty)}


def refinement_document(outcome: Outcome, units: Units) -> dict[str, Any]:
    """Outcome and rounds of a refinement for JSON."""
    return {
        "status": outcome.status.value,
        "quantity": outcome.quantity,
        "value": {"value": outcome.value, "unit": _unit(outcome, units)},
        **_accuracy(outcome),
        "target": outcome.target,
        "message": outcome.message,
        "advice": outcome.status.advice,
        "rounds": [
            {"cells": [step.cells], "unknowns": step.unknowns, "value": step.value, **_accuracy(step)}
            for step in outcome.rounds
        ],
    }


def refinement_lines(refined: Refinement, units: Units) -> Iterator[str]:
    """The rounds as a table, the message, and the error of the number."""
    if refined.rounds:
        yield from table(*refinement_table(refined, units))
        yield ""
    yield refined.message
    if refined.rounds:
        yield trust(refined, units)
    if refined.status != "reached" and (refined.rounds or refined.result.status.advice not in refined.message):
        yield refined.status.advice


def refinement_table(refined: Refinement, units: Units) -> tuple[list[str], list[list[str]]]:
    """Headings, and a row for each round: cells, unknowns, value, relative error, and the kind of error."""
    headings = ["round", "cells", "unknowns", f"{refined.quantity} [{_unit(refined, units)}]", "relative error", ""]
    return headings, [
        [str(number), str(step.cells), str(step.unknowns), f"{step.value:.9g}", *_error(step)]
        for number, step in enumerate(refined.rounds, 1)
    ]


def _unit(outcome: Outcome, units: Units) -> str:
    from qvi_contact.refinement.measure import unit_of

    return unit_of(outcome.quantity, units)


def trust(refined: Refinement, units: Units) -> str:
    """A sentence with the error of the last round, which says whether it is a bound or an estimate."""
    if not math.isfinite(refined.estimate):
        return "Error: not known."
    size = f"{shown(refined.error, digits=2)} {_unit(refined, units)}"
    if refined.certainty is Certainty.ESTIMATE:
        return f"Error: about {size}. This is an estimate, not a guaranteed bound."
    return f"Error: at most {size}. This is a guaranteed bound, up to rounding."


def so_far(step: RefinementRound) -> str:
    """A round as the line of progress shows it."""
    error, kind = _error(step)
    return f"{step.unknowns} unknowns, relative error {error} ({kind or 'not known'})"


def _error(step: RefinementRound) -> tuple[str, str]:
    """The relative error, and its kind: "estimate", "guaranteed" or empty."""
    if not math.isfinite(step.estimate):
        return "-", ""
    return f"{step.estimate:.1e}", "estimate" if step.certainty is Certainty.ESTIMATE else "guaranteed"


_ESTIMATES: Final = (
    "these are estimates, not bounds, because sides are arcs or the body force is not a polynomial on the mesh"
)


def limit_sentence(limit: LimitLoad) -> str:
    """How much the mesh carries, and the body at most, in a sentence."""
    if limit.upper == -math.inf:
        return "no multiple can be carried: the other loads alone are not carried either"
    if limit.upper == limit.lower == math.inf:
        return "no upper limit"
    lower, upper = limit.lower, limit.upper
    if 1e-7 * abs(upper) < upper - lower < math.inf:  # outwards, to 1e-3 of their distance or to the ninth digit
        step = 10.0 ** math.floor(math.log10(max(1e-3 * (upper - lower), 1e-8 * max(upper, -lower))))
        lower, upper = math.floor(lower / step + 1e-6) * step, math.ceil(upper / step - 1e-6) * step
    sides = ("at least", lower), ("at most", upper)
    numbers = " and ".join(f"{side} about {factor:.9g} times" for side, factor in sides if math.isfinite(factor))
    if numbers and not limit.guaranteed:
        return f"the body carries {numbers} these loads; {_ESTIMATES}"
    mesh = f"this mesh carries {'no multiple of' if lower == -math.inf else f'{lower:.9g} times'} these loads"
    body = "the body has no upper limit"
    if upper < math.inf:
        body = f"no stress of the body carries more than {upper:.9g} times"
    if limit.missing and lower == -math.inf:
        return f"{body} these loads"
    return mesh if limit.missing and upper == math.inf else f"{mesh}; {body}"


def safety_sentence(factor: StrengthReduction) -> str:
    """By how much strengths may be divided, in a sentence."""
    divided, reason = "with strengths divided by", []
    if not factor.guaranteed:
        divided, reason = "with strengths divided by about", [_ESTIMATES]
    carried = f"this mesh carries the loads {divided} {factor.lower:.6g}"
    if factor.lower == 0.0:
        carried = "no factor was found with which this mesh carries the loads"
    fallen = f"no stress of the body carries them {divided} {factor.upper:.6g}"
    if factor.upper == math.inf:
        fallen = "no factor was found with which the body collapses"
    return "; ".join([carried, fallen, *reason])


def limit_document(limit: LimitLoad, refinement: LimitRefinement | None) -> dict[str, Any]:
    """The result for JSON, where infinite factors are null: `outcome`, `in_time` and `remarks` tell what that means."""
    outcome = "unbounded" if limit.upper == math.inf else "none" if limit.upper == -math.inf else "bounded"
    document: dict[str, Any] = {
        "outcome": "bounded" if limit.missing else outcome,
        "in_time": limit.in_time,
        "bounds": limit.guaranteed,
        "factor": limit.lower,
        "upper": limit.upper,
        "message": limit_sentence(limit),
    }
    if refinement is not None:
        document["refinement"] = {
            "status": refinement.status.value,
            "target": refinement.target,
            **_accuracy(refinement),
            "unknowns": refinement.rounds[-1].unknowns,
            "rounds": len(refinement.rounds),
            "message": refinement.message,
        }
    return document


_NOISE: Final = 1e-12  # a resultant below this share of the sum of the loads' magnitudes is rounding


def outline(file: ProblemFile, options: Mapping[str, Any]) -> tuple[ContactProblem, dict[str, Any]]:
    """The problem at its first time, discretised but not solved, and its description for JSON, with these options."""
    element = {name: value for name, value in options.items() if name in ELEMENT_OPTIONS}
    discretization = discretize(file.problem, **element)
    problem, mesh, qvi = discretization.problem, discretization.problem.mesh, discretization.qvi
    low, high = mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()
    smallest, largest = mesh.cell_range
    counts = np.bincount(problem.cell_materials, minlength=len(problem.materials))
    return problem, {
        "title": file.title,
        "description": file.description,
        "units": {"length": file.units.length, "stress": file.units.stress},
        "mesh": {
            "cells": mesh.cell_count,
            "vertices": len(mesh.vertices),
            "x": [low[0], high[0]],
            "y": [low[1], high[1]],
            "smallest": smallest,
            "largest": largest,
        },
        "element": export.element_of(discretization),
        "unknowns": qvi.n,
        "contact_points": qvi.m,
        "materials": [
            write_table("material", stated, _written) | {"plane": problem.material.plane, "cells": int(count)}
            for stated, count in zip((problem.material, *problem.regions), counts, strict=True)
        ],
        "temperature": _written("temperature", problem.temperature),
        "boundary": [_condition(problem, condition) for condition in problem.conditions],
        "whole": [name for name in mesh.joint_names if name not in {each.edges for each in problem.contacts}],
        "loads": list(_loads(problem)),
        "solve": dict(options),
        "refine": dict(file.refine_options),
        "times": list(file.times),
        "sweep": None if file.sweep is None else asdict(file.sweep),
        "remarks": [file.units.filled(remark) for remark in discretization.remarks],
    }


def _written(_path: str, value: Any) -> Any:
    """A field as JSON can hold it: a number, the text of an expression, a polynomial, or a number of points."""
    if isinstance(value, Polynomial):
        return {"polynomial": [list(row) for row in value.coefficients]}
    if isinstance(value, PointData):
        return f"values at {len(value.values)} points"
    return value.text if isinstance(value, Expression) else value


def _condition(problem: ContactProblem, condition: Condition) -> dict[str, Any]:
    """A condition with the keys of a problem file, and the length of its edges."""
    kind, length = type(condition).__name__.lower(), float(problem.mesh.edges(condition.edges).length.sum())
    document = {"kind": kind, "edges": condition.edges, "length": length}
    if isinstance(condition, Contact):
        document |= {"name": condition.name, "law": condition.law, "joint": condition in problem.joints}
    return document | write_table(kind, condition, _written)


def act(problem: ContactProblem, loads: Iterable[str]) -> bool:
    """Whether any of these loads is more than 0."""
    power_of_loads = works(problem, Bodies.of(problem))
    return any(power_of_loads[name].size > 0.0 for name in loads if name in power_of_loads)


def _loads(problem: ContactProblem) -> Iterator[dict[str, Any]]:
    """Names and resultants of tractions and body forces; moments are about the origin."""
    bodies = Bodies.of(problem)
    tractions = {each.name for each in problem.conditions if isinstance(each, Traction)}
    for name, work in works(problem, bodies).items():
        if not (name in tractions or (name in problem.body_forces and work.row.any())) or work.size == 0.0:
            continue  # forces on plates, fluids in contacts, and loads that are zero
        x, y, rotation = work.row.reshape(-1, 3).T
        moment = rotation @ bodies.size + y @ bodies.centre[:, 0] - x @ bodies.centre[:, 1]
        arm = float(np.hypot(*problem.mesh.vertices.T).max())
        sums = {"x": (x.sum(), work.size), "y": (y.sum(), work.size), "moment": (moment, work.size * arm)}
        yield {"name": name} | {n: float(s) if abs(s) > _NOISE * most else 0.0 for n, (s, most) in sums.items()}
