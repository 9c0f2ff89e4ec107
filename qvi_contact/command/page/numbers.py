"""Numbers as the page writes them: four digits or as many as are asked for, rounding noise as 0, a real minus."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from qvi_contact.basics.units import Units
from qvi_contact.solution.contact_line import ContactLine
from qvi_contact.solution.result import ContactResult

_NOISE: Final = 1e-9  # share of the largest value of its kind below which one is rounding


def number(value: float, digits: int = 5, least: float = 0.0) -> str:
    """A number for people."""
    return "0" if abs(value) <= least else f"{value:.{digits}g}".replace("-", "−")


def contact_rows(lines: Iterable[ContactLine]) -> list[list[str]]:
    """Forces, largest tractions and motions, and shares of the length, a row for each contact."""
    lines = list(lines)
    columns = [
        [[line.normal_force, line.tangential_force] for line in lines],
        [[(-line.normal_stress).max(), np.abs(line.tangential_stress).max()] for line in lines],
        [[line.gap.max(), np.abs(line.slip).max()] for line in lines],
    ]
    shown = [_group(values) for values in columns]
    shares = [[f"{100.0 * share:.1f} %" for share in line.shares.values()] for line in lines]
    return [
        [line.name, *(cell for group in shown for cell in group[row]), *shares[row]] for row, line in enumerate(lines)
    ]


def contact_headings(units: Units) -> list[str]:
    """Headings of `contact_rows`."""
    force, stress, length = units.engineering_force, units.stress, units.displacement
    return [
        "contact", f"N [{force}]", f"T [{force}]", f"largest pressure [{stress}]", f"largest |σ_T| [{stress}]",
        f"largest gap [{length}]", f"largest |slip| [{length}]", "open", "stick", "slip",
    ]  # fmt: skip


def resultant_rows(result: ContactResult) -> list[list[str]]:
    """Force and moment on each edge set that a condition names."""
    names = list(dict.fromkeys(condition.edges for condition in result.problem.conditions))
    found = [result.resultant(name) for name in names]
    largest = max((float(np.hypot(force.x, force.y)) for force in found), default=0.0)
    forces = _group([[force.x, force.y] for force in found])
    moments = _group([[force.moment] for force in found], largest * result.problem.mesh.length)
    return [[name, *force, *moment] for name, force, moment in zip(names, forces, moments, strict=True)]


def resultant_headings(units: Units) -> list[str]:
    """Headings of `resultant_rows`."""
    force = units.engineering_force
    return ["edges", f"F_x [{force}]", f"F_y [{force}]", f"moment about the origin [{units.engineering_moment}]"]


def step_rows(steps: Sequence[ContactResult], times: Sequence[float]) -> list[list[str]]:
    """Time, status and forces of each load step."""
    lines = [list(step.contacts.values()) if step.has_state else [] for step in steps]
    forces = [[force for line in of for force in (line.normal_force, line.tangential_force)] for of in lines]
    least = _NOISE * max((abs(force) for row in forces for force in row), default=0.0)
    return [
        [f"{t:.6g}", str(step.status), *(number(force, least=least) for force in row)]
        for t, step, row in zip(times, steps, forces, strict=False)
    ]


def _group(values: list[list[Any]], size: float = 0.0) -> list[list[str]]:
    """Numbers of one kind, of which the largest, or the size given, says what is rounding."""
    least = _NOISE * float(np.abs(np.array(values, dtype=float)).max(initial=size))
    return [[number(float(value), least=least) for value in row] for row in values]
