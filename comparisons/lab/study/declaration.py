"""A study as data: what is varied, which cases that makes, and a key for each that stays the same for ever."""

import hashlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from types import MappingProxyType
from typing import Any, Final

from comparisons.lab.machine import PACKAGES
from comparisons.lab.worker.plain import canonical, plain
from qvi_contact.errors import InputError

Values = Mapping[str, Any]
Task = str | Callable[[Any], Mapping[str, Any]]

OWN_NAMES: Final = frozenset({
    "case", "certificate", "environment", "finished", "key", "load_average", "machine", "memory_mib", "position",
    "reason", "repeat", "result", "seconds", "seed", "status", "threads", "timeout_seconds", "versions",
})  # fmt: skip
"""Names of a row's own columns, which no factor can have."""

_TASK: Final = re.compile(r"[\w.]+:\w+")


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
