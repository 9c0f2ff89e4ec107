"""Every golden number of the examples is what it was, see `tests.golden`."""

import json

import pytest

from tests.golden.__main__ import STORE, compare
from tests.golden.problems import PROBLEMS

STORED = json.loads(STORE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", [name for name in PROBLEMS if name.startswith("example")])
def test_numbers_are_as_they_were(name):
    assert list(compare(name, STORED[name], PROBLEMS[name](1.0))) == []
