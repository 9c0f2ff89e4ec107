"""What is kept of one value of a sweep where results would be too much: a row of numbers for each contact."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

from qvi_contact.basics.units import Units
from qvi_contact.errors import InputError
from qvi_contact.solution.result import ContactResult, completed, contact_numbers, forces_units
from solvers import Status
from solvers.basics.frames import columns_of, frame

if TYPE_CHECKING:
    from pandas import DataFrame

Parameter: TypeAlias = Literal["friction", "load", "gap", "offset"]
"""What a sweep changes."""

COLUMNS: Final = {"step": ">5", "value": ">12g", "status": "<20", "iterations": ">10", "accuracy": ">9.1e"}
"""What a narration says of each value."""


@dataclass(frozen=True)
class SweepRow:
    """One value of a sweep.

    Attributes
    ----------
    number : int
        Its place among all values, from 1.
    value : float
        The value.
    status : Status
        What became of it.
    message : str
        One sentence about that.
    iterations : int
        Of the method.
    accuracy : float
        What the certificate confirms, dimensionless.
    seconds : float
        How long it took.
    contacts : mapping of str to mapping of str to float
        `ContactLine.summary` by the name of the contact, with motion, force and moment where it has a plate or pin;
        empty without a state.

    """

    number: int
    value: float
    status: Status
    message: str
    iterations: int
    accuracy: float
    seconds: float
    contacts: Mapping[str, Mapping[str, float]]

    @classmethod
    def of(cls, number: int, value: float, result: ContactResult, seconds: float = 0.0) -> SweepRow:
        """The row of a result; `InputError` for what is none."""
        if not isinstance(result, ContactResult):
            raise InputError("result", result, "give a ContactResult")
        contacts = contact_numbers(result) if result.has_state else {}
        accuracy = result.certificate.accuracy
        return cls(number, value, result.status, result.message, result.iterations, accuracy, seconds, contacts)


def table_of(parameter: Parameter, rows: Iterable[SweepRow], units: Units | None) -> DataFrame:
    """One line for each value and contact, see `Sweep.to_frame`."""
    lines: list[dict[str, Any]] = [
        {parameter: row.value, "status": str(row.status), "iterations": row.iterations, "contact": name, **summary}
        for row in rows
        for name, summary in row.contacts.items()
    ]
    length = Units.labels(units, {parameter: "displacement"} if parameter in ("gap", "offset") else {})
    return frame(columns_of(completed(lines)), {**forces_units(units), **length})


def outcome_of(parameter: Parameter, failures: Sequence[tuple[float, str]], done: int, planned: int) -> str:
    """One sentence about so many values, of which those given with their messages are not solved."""
    if failures:
        value, message = failures[0]
        others = f" ({len(failures) - 1} more not solved)" if len(failures) > 1 else ""
        return f"{parameter} = {value:g}: {message}{others}"
    if done < planned:
        return f"time limit after {done} of {planned} values. {Status.TIME_LIMIT.advice}"
    return f"all {planned} values solved" if planned > 1 else "the value is solved"
