"""Words and numbers in pictures."""

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.plots.style import plain_text
from qvi_contact.problem.conditions import CARTESIAN, LOCAL, Condition, Displacement, Traction, components

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

Spot: TypeAlias = tuple[FloatArray, dict[str, Any]]
"""Where a text may stand [length], and how it is aligned there."""

Written: TypeAlias = "tuple[Text, Sequence[Spot]]"
"""A text at the first of the spots that it may have."""

_WRAP: Final = 44  # characters in a line of the legend
_NOISE: Final = 1e-12  # share of the largest value below which one is rounding
_LONG: Final = 6  # powers of ten from which on numbers are written with them
_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UPRIGHT: Final = 0.3  # component of a normal below which a side counts as facing across it


def merged(conditions: Sequence[Condition]) -> list[Condition]:
    """The conditions, the two components of one edge set's traction or displacement in one where they are apart."""
    found: list[Condition] = []
    for condition in conditions:
        for index, other in enumerate(found):
            if not isinstance(other, (Traction, Displacement)) or not isinstance(condition, type(other)):
                continue
            more: dict[str, Any] = components(condition)
            names = {*components(other), *more}
            if other.edges == condition.edges and (names <= set(CARTESIAN) or names <= set(LOCAL)):
                found[index] = replace(other, **more)
                break
        else:
            found.append(condition)
    return found


def alignment(normal: FloatArray) -> dict[str, Any]:
    """How a text beside a side is aligned, so that it grows away from the body."""
    x, y = normal.tolist()
    across = "center" if abs(x) < _UPRIGHT else "left" if x > 0.0 else "right"
    upward = "center" if abs(y) < _UPRIGHT else "bottom" if y > 0.0 else "top"
    return {"ha": across, "va": upward}


def value_range(name: str, values: FloatArray, unit: str) -> str:
    """The value or the range of values of a named quantity, with its unit."""
    noise = _NOISE * float(np.abs(values).max())
    low, high = (0.0 if abs(value) <= noise else float(value) for value in (values.min(), values.max()))  # no −0
    numbers = f"{low:.4g}" if high - low <= 1e-9 * max(abs(low), abs(high)) else f"{low:.4g} … {high:.4g}"
    return f"{name} = {numbers} {unit}".replace("-", "−").rstrip().replace(" ", "\xa0")  # kept on one line


def beside(values: Sequence[float], digits: int = 4) -> list[str]:
    """Numbers that stand beside each other, to the last place of the largest with so many digits: noise is 0."""
    largest = max((abs(value) for value in values), default=0.0)
    if largest == 0.0 or not np.isfinite(largest):
        return [f"{value:g}" for value in values]
    power = int(np.floor(np.log10(largest)))
    unit = 10.0 ** (power - digits + 1)
    if _LONG > power > -_LONG:
        found = [f"{round(value / unit) * unit + 0.0:.{max(digits - 1 - power, 0)}f}" for value in values]
        found = [text.rstrip("0").rstrip(".") if "." in text else text for text in found]
    else:
        tens = str(power).translate(_RAISED)
        found = [f"{round(value / unit) * unit / 10.0**power:.{digits}g} · 10{tens}" for value in values]
    return ["0" if float(text.split(" ")[0]) == 0.0 else text.replace("-", "−") for text in found]


def wrapped(text: str) -> str:
    """The text in lines short enough for a legend."""
    return plain_text(textwrap.fill(text, _WRAP, subsequent_indent="   ", break_on_hyphens=False))


def spread(axes: "Axes", written: Sequence[Written]) -> None:
    """Move each text to the first of its spots where it covers none of those before it; without one it stays."""
    figure = axes.get_figure(root=True)
    if figure is None or not written:
        return
    engine = figure.get_layout_engine()
    if axes.get_axes_locator() is not None:  # a panel inside another one, which gets its place while that is drawn
        figure.draw_without_rendering()
    else:  # sizes are known once the layout is; drawing without a picture would take as long again
        if engine is not None:
            engine.execute(figure)
        axes.apply_aspect()
    taken: list[Any] = []
    for text, spots in written:
        for place, align in (*spots, spots[0]):
            text.set_position(place.tolist())
            text.set(**align)
            box = text.get_window_extent()
            if not any(box.overlaps(other) for other in taken):
                break
        taken.append(box)
