"""A study as data: what is varied, which cases that makes, and a key for each that stays the same for ever.

Its values are *plain*: None, booleans, integers, floats, texts, and lists and named mappings of these. They mean the
same in this process, in another one, on a cluster and in a file.
"""

import hashlib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from types import MappingProxyType
from typing import Any, Final

from comparisons.lab.machine import PACKAGES
from qvi_contact.errors import InputError

Values = Mapping[str, Any]
Task = str | Callable[[Any], Mapping[str, Any]]

OWN_NAMES: Final = frozenset({
    "case", "certificate", "environment", "finished", "key", "load_average", "machine", "memory_mib", "position",
    "reason", "repeat", "result", "seconds", "seed", "status", "threads", "timeout_seconds", "versions",
})  # fmt: skip
"""Names of a row's own columns, which no factor can have."""

_TASK: Final = re.compile(r"[\w.]+:\w+")
_SHOWN: Final = 3
"""Values of a factor that are told; more are counted."""

_LONG: Final = 40


@dataclass(frozen=True)
class Case:
    """One case of a study.

    Attributes
    ----------
    position : int
        Place in the study, from 0.
    key : str
        32 hexadecimal digits, see `case_key`.
    values : Mapping
        What the task gets: factor → value, and "repeat" and "seed".

    """

    position: int
    key: str
    values: Values


def case_key(study: str, version: int, values: Values) -> str:
    """The first 128 bits of SHA-256 of the canonical JSON of name, version and case.

    The order of the entries does not matter; 1, 1.0 and True are different values.
    """
    text = canonical({"study": study, "version": version, "case": values}, finite=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@dataclass(frozen=True)
class Study:
    """A product of factors, and what is done for each case of it.

    The cases are enumerated with the last factor running fastest, and the repeats inside it. `Study.of` declares a
    study by its cases instead, of which the product may have many more.

    Parameters
    ----------
    name : str
        Name of the study.
    version : int
        To be raised when the task changes what it computes: earlier rows are then another study's.
    task : function or str
        A function of a module, or its name ``"module:function"``, importable wherever the study runs. It takes a case
        (a mapping, see `Case`) and returns a mapping of plain values (see `plain`); its entry "certificate", if there
        is one, is kept apart. It has to take all its randomness from ``case["seed"]``. What its module imports at the
        top is loaded before any time is taken; what is loaded on first use counts for a worker's first case, unless the
        module uses it once.
    factors : Mapping
        Factor → tuple of its plain values, e.g. problem, mesh, friction, method, settings.
    repeats : int
        How often each combination is run.
    seed : int
        Repeat r of every combination has the seed `seed` + r, so that all methods meet the same data.
    keep : callable, optional
        The cases it is false for are left out.
    only : sequence of tuples, optional
        The combinations that there are, each with a level of every factor; all of them if not given.
    packages : tuple of str
        Distributions whose versions every row has to tell.
    fresh : bool
        Whether each case gets a process of its own, as where peak memory is measured.

    Raises
    ------
    InputError
        If a name or value is missing, repeated, or not plain and finite, or no case is left.

    """

    name: str
    version: int
    task: Task
    factors: Mapping[str, tuple[Any, ...]]
    repeats: int = 1
    seed: int = 0
    keep: Callable[[Values], bool] | None = None
    only: Sequence[tuple[Any, ...]] | None = None
    packages: tuple[str, ...] = PACKAGES
    fresh: bool = False

    @classmethod
    def of(cls, name: str, version: int, task: Task, cases: Iterable[Values]) -> "Study":
        """The study of just these cases, all with the same factors, whose values stand in the order they are met.

        Its cases are in the order of the product all the same.
        """
        listed = list(cases)
        factors = {factor: tuple(dict.fromkeys(case[factor] for case in listed)) for factor in listed[0]}
        return cls(name, version, task, factors, only=[tuple(case[factor] for factor in factors) for case in listed])

    def __post_init__(self) -> None:
        if not self.name:
            raise InputError("Study.name", self.name, "give the study a name")
        if not _TASK.fullmatch(self.task_name):
            raise InputError("Study.task", self.task_name, "give a function of a module, or 'module:function'")
        if self.repeats < 1:
            raise InputError("Study.repeats", self.repeats, "give at least 1")
        factors = {name: _levels(name, values) for name, values in self.factors.items()}
        object.__setattr__(self, "factors", MappingProxyType(factors))
        if not self.cases:
            raise InputError("Study.keep", self.name, "no case is left")

    @property
    def task_name(self) -> str:
        """The task as ``"module:function"``."""
        return self.task if isinstance(self.task, str) else f"{self.task.__module__}:{self.task.__qualname__}"

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """All cases in order."""
        values = filter(self.keep or (lambda _: True), self._combinations())
        return tuple(
            Case(position, case_key(self.name, self.version, each), each) for position, each in enumerate(values)
        )

    def _combinations(self) -> list[dict[str, Any]]:
        return [
            {**dict(zip(self.factors, levels, strict=True)), "repeat": repeat, "seed": self.seed + repeat}
            for levels in (product(*self.factors.values()) if self.only is None else self._listed(self.only))
            for repeat in range(self.repeats)
        ]

    def _listed(self, combinations: Sequence[tuple[Any, ...]]) -> Iterator[tuple[Any, ...]]:
        """These combinations in the order of the product, each once."""
        factors = [list(map(canonical, levels)) for levels in self.factors.values()]
        try:
            places = {tuple(texts.index(canonical(value)) for texts, value in zip(factors, each, strict=True))
                      for each in combinations}  # fmt: skip
        except ValueError as error:
            raise InputError("Study.only", self.name, f"give a level of every factor ({error})") from error
        for each in sorted(places):
            yield tuple(levels[place] for levels, place in zip(self.factors.values(), each, strict=True))

    def declaration(self) -> dict[str, Any]:
        """The study in plain values; two studies are the same if and only if these are, see `same_study`.

        What was left out is in there through "digest", a hash of the keys of all cases in order.
        """
        digest = hashlib.sha256("".join(case.key for case in self.cases).encode()).hexdigest()
        return {
            "name": self.name, "version": self.version, "task": self.task_name, "repeats": self.repeats,
            "seed": self.seed, "factors": [[name, list(levels)] for name, levels in self.factors.items()],
            "cases": len(self.cases), "digest": digest,
        }  # fmt: skip


def same_study(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two declarations are of one study: all but the task's name, so that code may move and be renamed.

    What a task computes is told by the study's version.
    """
    return all(one.get(name) == other.get(name) for name in {*one, *other} - {"task"})


def _levels(name: str, values: tuple[Any, ...]) -> tuple[Any, ...]:
    """The values of a factor, checked."""
    field = f"Study.factors[{name!r}]"
    if not name.isidentifier() or name in OWN_NAMES:
        raise InputError("Study.factors", name, "give a factor a name that is a word and not a row's own")
    if not isinstance(values, tuple) or not values:
        raise InputError(field, values, "give a tuple of at least one value")
    try:
        found = tuple(plain(value, name) for value in values)
        texts = [canonical(value, finite=True) for value in found]
    except (TypeError, ValueError) as error:
        raise InputError(field, values, f"give plain values ({error})") from error
    if len(set(texts)) < len(texts):
        raise InputError(field, values, "give each value once")
    return found


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
    shown = (text if len(text) <= _LONG else text[: _LONG - 1] + "…" for text in texts[:_SHOWN])
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def plain(value: Any, name: str) -> Any:
    """The same value in `dict`, `list` and Python's own scalars; `name` says where it stands.

    Sequences become lists, NumPy's scalars Python's, members of enumerations their values.

    Raises
    ------
    TypeError
        If something in it is not plain; the message says what, and where.

    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return _text(value, name)
    if isinstance(value, int | float):
        return int(value) if isinstance(value, int) else float(value)
    if isinstance(value, list | tuple):
        return [plain(item, f"{name}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, Mapping):
        return {_key(key, name): plain(item, f"{name}.{key}") for key, item in value.items()}
    return _scalar(value, name)


def _text(value: str, name: str) -> str:
    try:
        value.encode()
    except UnicodeEncodeError:
        raise TypeError(f"{name} is a text with half a character") from None
    return str.__str__(value)


def _key(key: Any, name: str) -> str:
    if not isinstance(key, str):
        raise TypeError(f"{name} has a key of type {type(key).__name__}, not a text")
    return _text(key, name)


def _scalar(value: Any, name: str) -> Any:
    """The value of a scalar of NumPy."""
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):
        item = value.item()
        if type(item) is not type(value):
            return plain(item, name)
    raise TypeError(f"{name} is of type {type(value).__name__}, not a plain value")


def canonical(value: Any, finite: bool = False) -> str:
    """JSON of a plain value, the same for every order of the entries of mappings.

    Numbers keep their kind (1, 1.0 and true are three texts) and all their digits.

    Raises
    ------
    ValueError
        If `finite` and there is an infinite number or NaN in it.

    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=not finite)
