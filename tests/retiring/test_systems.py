"""Where dense systems stop to pay: the quotient that loses least, and the command that measures it."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from comparisons.benchmark.systems import Pair, crossover
from comparisons.cli import group


def pair(counted, slower):
    return Pair("", 1, 1, counted, slower, 1.0)


def test_the_quotient_that_loses_least():
    """Between 3 and 5; that dense systems lose a little at 2 weighs less than what they gain at 3."""
    pairs = [pair(8.0, 2.0), pair(2.0, 1.1), pair(1.0, 0.5), pair(3.0, 0.8), pair(5.0, 1.3), pair(4.0, np.nan)]
    assert crossover(pairs) == pytest.approx(np.sqrt(15.0))


@pytest.mark.parametrize(("slower", "expected"), [(2.0, 1.0), (0.5, 4.0)])
def test_one_way_always_pays(slower, expected):
    assert crossover([pair(1.0, slower), pair(4.0, slower)]) == pytest.approx(expected)


def test_the_command_measures_pairs():
    done = CliRunner().invoke(group, ["systems", "--only", "wall 4 × 4, bfs", "--repeat", "1", "--json"])
    document = json.loads(done.output)
    (found,) = document["pairs"]
    assert (found["unknowns"], found["interface"]) == (960, 240)
    assert found["counted"] == pytest.approx(2.21, abs=0.01)
    assert min(found["dense"], found["sparse"]) > 0.0


def test_an_unknown_problem_is_refused():
    done = CliRunner().invoke(group, ["systems", "--only", "bridge"])
    assert done.exit_code != 0
    assert "masonry 4 × 6" in str(done.exception)
