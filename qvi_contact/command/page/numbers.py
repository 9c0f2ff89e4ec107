"""Numbers as the page writes them: four digits or as many as are asked for, rounding noise as 0, a real minus."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from qvi_contact.basics.units import Rounding, Units, shown
from qvi_contact.command.report import plate_limits, shares
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.result import ContactResult, plate_numbers


def number(value: float, digits: int = 5, least: float = 0.0) -> str:
    """A number for people."""
    return shown(value, least, digits).replace("-", "−")


def contact_rows(lines: Iterable[ContactLine], states: Sequence[str]) -> list[list[str]]:
    """Forces, largest tractions and motions, and shares of the length, a row for each contact."""
    return [
        [
            line.name,
            *_numbers(line.rounding.force, line.normal_force, line.tangential_force),
            *_numbers(line.rounding.stress, (-line.normal_stress).max(), np.abs(line.tangential_stress).max()),
            *_numbers(line.rounding.displacement, line.gap.max(), np.abs(line.slip).max()),
            *shares(line.shares, states),
        ]
        for line in lines
    ]


def contact_headings(units: Units, states: Sequence[str]) -> list[str]:
    """Headings of `contact_rows`."""
    force, stress, length = units.engineering_force, units.stress, units.displacement
    return [
        "contact", f"N [{force}]", f"T [{force}]", f"largest pressure [{stress}]", f"largest |σ_T| [{stress}]",
        f"largest gap [{length}]", f"largest |slip| [{length}]", *states,
    ]  # fmt: skip


def resultant_rows(result: ContactResult) -> list[list[str]]:
    """Force and moment on each edge set that a condition names."""
    names = list(dict.fromkeys(condition.edges for condition in result.problem.conditions))
    least = result.rounding
    found = [result.resultant(name) for name in names]
    return [
        [name, *_numbers(least.force, force.x, force.y), *_numbers(least.moment, force.moment)]
        for name, force in zip(names, found, strict=True)
    ]


def resultant_headings(units: Units) -> list[str]:
    """Headings of `resultant_rows`."""
    force = units.engineering_force
    return ["edges", f"F_x [{force}]", f"F_y [{force}]", f"moment about the origin [{units.engineering_moment}]"]


def step_tables(
    steps: Sequence[ContactResult], values: Sequence[float]
) -> tuple[list[list[str]], dict[str, list[list[str]]]]:
    """Time or value, status and forces of each result of a series; and the same with the numbers of each plate."""
    read = [_read(step) for step in steps]  # once: those of a store are files
    least = Rounding.largest(rounding for *_, rounding in read)
    limits = plate_limits(least)
    forces: list[list[str]] = []
    plates: dict[str, list[list[str]]] = {name: [] for name in read[0][2]}
    for value, (status, of_contacts, of_plates, _) in zip(values, read, strict=False):
        first = [f"{value:.6g}", status]
        forces.append([*first, *_numbers(least.force, *of_contacts)])
        for name, found in of_plates.items():
            plates[name].append([*first, *(_plate(found, limits) if found else [])])
    return forces, plates


def _read(step: ContactResult) -> tuple[str, list[float], dict[str, tuple[float, ...]], Rounding]:
    """Status, forces of all contacts, what there is of each plate, and the rounding of a step."""
    lines = step.contacts.values() if step.has_state else ()
    forces = [force for line in lines for force in (line.normal_force, line.tangential_force)]
    names = [contact.name for contact in step.problem.contacts if contact.plate is not None]
    plates = {name: plate_numbers(step, name) if step.has_state else () for name in names}
    return str(step.status), forces, plates, step.rounding


def plate_rows(result: ContactResult) -> list[list[str]]:
    """Motion, force and moment of each plate or pin."""
    limits = plate_limits(result.rounding)
    return [[name, *_plate(plate_numbers(result, name), limits)] for name in result.plates]


def _plate(values: Sequence[float], limits: Sequence[float]) -> list[str]:
    return [number(value, least=limit) for value, limit in zip(values, limits, strict=True)]


def _numbers(least: float, *values: Any) -> list[str]:
    """Numbers of one kind."""
    return [number(float(value), least=least) for value in values]
