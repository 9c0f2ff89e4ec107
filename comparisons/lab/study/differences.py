"""In what two declarations of a study differ, for people."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from comparisons.lab.worker.plain import canonical

_SHOWN: Final = 3
"""Values of a factor that are told; more are counted."""

_LONGEST: Final = 40


def differences(there: Mapping[str, Any], here: Mapping[str, Any]) -> str:
    """What is different in the declaration of a store ("there") and the one of a command ("here"), in one line.

    Both are of the form of `Study.declaration`. Factors come first, as they are what options change.
    """
    factors = [dict(each["factors"]) for each in (there, here)]
    names = dict.fromkeys([*factors[0], *factors[1]])
    found = [text for name in names for text in _factor(name, factors[0].get(name), factors[1].get(name))]
    found += [f"{name}: {there[name]} there, {here[name]} here"
              for name in ("repeats", "seed") if there[name] != here[name]]  # fmt: skip
    if not found and list(factors[0]) != list(factors[1]):
        found = ["the factors in another order"]
    if not found:
        found = [f"other combinations: {there['cases']} there, {here['cases']} here"]
    return "; ".join(found)


def _factor(name: str, there: Sequence[Any] | None, here: Sequence[Any] | None) -> Iterator[str]:
    """How the values of a factor differ, if they do."""
    if there is None or here is None:
        yield f"{name}: only {'here' if there is None else 'there'}"
        return
    texts = [[canonical(value) for value in values] for values in (there, here)]
    if texts[0] == texts[1]:
        return
    if len(there) != len(here):
        yield f"{name}: {len(there)} value{'s' if len(there) > 1 else ''} there, {len(here)} here"
        return
    only = [[text for text in texts[i] if text not in texts[1 - i]] for i in (0, 1)]
    if only[0]:
        yield f"{name}: {_listed(only[0])} there, {_listed(only[1])} here"
    else:
        yield f"{name}: the same values in another order"


def _listed(texts: Sequence[str]) -> str:
    more = len(texts) - _SHOWN
    shown = (text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…" for text in texts[:_SHOWN])
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")
