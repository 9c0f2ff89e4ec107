"""Golden numbers are what they were, see `tests.golden`, whose command compares those of examples and long runs too."""

import copy
import json

import pytest

from tests.golden.__main__ import STORE, compare
from tests.golden.problems import PROBLEMS

STORED = json.loads(STORE.read_text(encoding="utf-8"))
LONG = {"arch", "sticks on a coarse mesh", "half discs", "arcs: degree 3"}
LONG |= {f"paper: μ = {mu:.2f}" for mu in (0.0, 0.05, 0.1, 0.3)}  # which tests/comparisons/test_paper.py has
QUICK = [name for name in PROBLEMS if not name.startswith("example") and name not in LONG]


def test_every_problem_is_stored():
    assert list(STORED) == list(PROBLEMS)


@pytest.mark.parametrize("name", QUICK)
def test_numbers_are_as_they_were(name):
    assert list(compare(name, STORED[name], PROBLEMS[name](1.0))) == []


def test_a_moved_number_is_named_with_old_and_new():
    name = "example: trapezoid"
    stored = STORED[name]
    moved = {kind: {key: pair[0] for key, pair in stored[kind].items()} for kind in stored.keys() - {"status"}}
    moved["status"] = dict(stored["status"])
    assert list(compare(name, stored, copy.deepcopy(moved))) == []
    moved["force"]["base: N"] *= 1.0 + 1e-7
    moved["status"][""] = "stalled"
    del moved["energy"]["strain"]
    lines = list(compare(name, stored, moved))
    assert len(lines) == 3
    assert all(name in line for line in lines)
    assert any(repr(moved["force"]["base: N"]) in line for line in lines)
