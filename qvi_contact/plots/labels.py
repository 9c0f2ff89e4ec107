"""Words and numbers in pictures."""

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

from qvi_contact.basics.checks import FloatArray
from qvi_contact.problem.conditions import Condition, Displacement, Traction

_WRAP: Final = 44  # characters in a line of the legend


def merged(conditions: Sequence[Condition]) -> list[Condition]:
    """The conditions, the two components of one edge set's traction or displacement in one where they are apart."""
    found: list[Condition] = []
    for condition in conditions:
        for index, other in enumerate(found):
            if isinstance(condition, (Traction, Displacement)) and type(other) is type(condition):
                components = [(other.x, condition.x), (other.y, condition.y)]
                if other.edges == condition.edges and all(None in pair for pair in components):
                    x, y = (b if a is None else a for a, b in components)
                    found[index] = replace(other, x=x, y=y)
                    break
        else:
            found.append(condition)
    return found


def alignment(normal: FloatArray) -> dict[str, Any]:
    """How a text beside a side is aligned, so that it grows away from the body."""
    if normal[1]:
        return {"ha": "center", "va": "bottom" if normal[1] > 0 else "top"}
    return {"ha": "left" if normal[0] > 0 else "right", "va": "center"}


def value_range(name: str, values: FloatArray, unit: str) -> str:
    """The value or the range of values of a named quantity, with its unit."""
    low, high = float(values.min()) + 0.0, float(values.max()) + 0.0  # no −0
    numbers = f"{low:.4g}" if high - low <= 1e-9 * max(abs(low), abs(high)) else f"{low:.4g} … {high:.4g}"
    return f"{name} = {numbers} {unit}".replace("-", "−").rstrip().replace(" ", "\xa0")  # kept on one line


def wrapped(text: str) -> str:
    """The text in lines short enough for a legend."""
    return textwrap.fill(text, _WRAP, subsequent_indent="   ", break_on_hyphens=False)
