"""All chapters of the manual, in its order, and the choice among them by name."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from comparisons.verification import (
    bounds,
    energies,
    exact_states,
    examples,
    invariance,
    limits,
    manufactured,
    not_unique,
    paper,
    plate,
    ssnv128,
    strict,
)
from comparisons.verification.chapter import Chapter, Problem
from qvi_contact.errors import InputError

CHAPTERS: Final = (
    paper.CHAPTER,
    exact_states.CHAPTER,
    manufactured.CHAPTER,
    ssnv128.CHAPTER,
    limits.CHAPTER,
    not_unique.CHAPTER,
    invariance.CHAPTER,
    plate.CHAPTER,
    energies.CHAPTER,
    bounds.CHAPTER,
    strict.CHAPTER,
    examples.CHAPTER,
)


def choose(names: Sequence[str], chapters: Sequence[Chapter] = CHAPTERS) -> tuple[Chapter, ...]:
    """The chapters with the problems of these names, in the manual's order; all if there are no names.

    Parameters
    ----------
    names : sequence of str
        Names of chapters or of problems.
    chapters : sequence of Chapter
        What to choose from.

    Raises
    ------
    InputError
        If a name is unknown.

    """
    known = [chapter.name for chapter in chapters] + [name for chapter in chapters for name in chapter.problems]
    for name in names:
        if name not in known:
            raise InputError("--only", name, f"choose from {', '.join(known)}")
    if not names:
        return tuple(chapters)
    chosen = [replace(chapter, problems=_chosen(chapter, names)) for chapter in chapters]
    return tuple(chapter for chapter in chosen if chapter.problems)


def _chosen(chapter: Chapter, names: Sequence[str]) -> Mapping[str, Problem]:
    if chapter.name in names:
        return chapter.problems
    return {name: problem for name, problem in chapter.problems.items() if name in names}
