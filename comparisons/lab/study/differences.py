"""In what two declarations of a study differ, for people."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from comparisons.lab.worker.plain import canonical

_SHOWN: Final = 3
"""Values of a factor that are told; more are counted."""

_LONGEST: Final = 40


def differences(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """What is different in the declaration of a store ("there") and the one of a command ("here"), in one line.

    Both are of the form of `Study.declaration`. Factors come first, as they are what options change.
    """
    one, other = ({**dict(each["factors"]), "repeats of each": [each["repeats"]], "seed": [each["seed"]]}
                  for each in (there, here))  # fmt: skip
    found = [f"{name}: {told}" for name in {**one, **other} if (told := _told(one.get(name, []), other.get(name, [])))]
    if not found and list(one) != list(other):
        return "the factors in another order"
    return "; ".join(found) or f"other combinations: {there['cases']} there, {here['cases']} here"


def _told(there: Sequence[Any], here: Sequence[Any]) -> str:
    """How the values of a factor differ; empty if they do not."""
    one, other = (list(map(canonical, values)) for values in (there, here))
    sides = ((one, other, "there"), (other, one, "here"))
    only = [f"{_listed(lacking)} only {side}" for own, others, side in sides
            if (lacking := [text for text in own if text not in others])]  # fmt: skip
    return ", ".join(only) or ("" if one == other else "the same values in another order")


def _listed(texts: Sequence[str]) -> str:
    more = len(texts) - _SHOWN
    shown = (text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…" for text in texts[:_SHOWN])
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")
