"""What solves say while they run: printed with verbose=True, and logged."""

import itertools
import json
import logging
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

import qvi_contact
from qvi_contact import InputError, LimitFactor, limit_load_factor, load_problem, refine, solve, solve_history
from qvi_contact.bracket import bracket
from qvi_contact.command.cli import group
from qvi_contact.gallery import compressed_plate
from solvers import Status
from solvers.settings import METHODS

NAME = "qvi_contact"
DRAGGED = Path(__file__).parent.parent / "examples" / "dragged_block_holds.toml"
PLATE = compressed_plate(0.2, (2, 2))


def numbers(printed):
    """First numbers of the lines of the table."""
    lines = printed.split("-" * 79)[1].splitlines()[2:]
    return [int(line.split()[1]) for line in lines]


@pytest.mark.parametrize("method", METHODS)
def test_every_method_counts_and_calls_back(method, capsys):
    called = []
    result = solve(PLATE, method=method, tolerance=1e-3, callback=called.append, verbose=True)
    printed = capsys.readouterr().out
    assert result.status is Status.SOLVED
    assert [entry.number for entry in called] == list(range(1, result.solution.iterations + 1))
    assert numbers(printed) == [entry.number for entry in called]
    assert printed.count(f"qvi_contact {qvi_contact.__version__}: solve\n") == 1
    assert "status          solved\n" in printed
    stopped = solve(PLATE, method=method, tolerance=1e-30, max_iterations=1)
    assert (stopped.solution.iterations, stopped.status) == (1, Status.MAX_ITERATIONS)
    with pytest.raises(InputError, match="max_iterations"):
        solve(PLATE, method=method, max_iterations=0)


def test_a_bracket_counts(capsys):
    """The stress violates the law between its points: it is solved for again, twice, then displacements twice."""
    found = bracket(solve(PLATE, law_on="points"), verbose=True)
    counted = numbers(capsys.readouterr().out)
    lengths = [number for number, following in itertools.pairwise([*counted, 1]) if following == 1]
    assert counted == [number for length in lengths for number in range(1, length + 1)]
    assert len(lengths) == 4
    assert [lengths[0], lengths[2]] == [each.solution.iterations for each in (found.result, found.companion)]


@pytest.mark.parametrize(
    ("words", "titles"),
    [(["solve", DRAGGED], ["solve"]), (["bracket", DRAGGED], ["solve", "bracket"]),
     (["limit", DRAGGED, "--load", "drag"], ["limit_load_factor"])], ids=lambda words: "-".join(map(str, words[:1])),
)  # fmt: skip
def test_commands_speak_on_standard_error(words, titles):
    """What is printed on standard output stays one JSON document."""
    loud = CliRunner().invoke(group, [*map(str, words), "--json", "--verbose"])
    json.loads(loud.stdout)
    assert re.findall(rf"qvi_contact {re.escape(qvi_contact.__version__)}: (\w+)\n", loud.stderr) == titles


def test_histories_refinements_and_limits_have_a_line_for_each_step(capsys):
    history = solve_history([PLATE, PLATE], verbose=True)
    lines = capsys.readouterr().out.splitlines()[7:9]
    assert [line.split()[:2] for line in lines] == [["1", "solved"], ["2", "solved"]]
    assert history.status is Status.SOLVED
    rounds = []
    refine(PLATE, target=1e-3, callback=rounds.append, verbose=True)
    table = capsys.readouterr().out.split("-" * 79)[1].splitlines()[2:]
    assert [int(line.split()[2]) for line in table] == [each.unknowns for each in rounds]
    block, loads = load_problem(DRAGGED).problem, ["drag"]
    limit = limit_load_factor(block, loads, verbose=True)
    assert f"{limit.lower:.9g}" in capsys.readouterr().out
    refine(block, quantity=LimitFactor(loads), verbose=True)
    assert f"{limit.lower:.9g}" in capsys.readouterr().out


def test_the_log_has_the_outermost_call_at_info_and_failures_as_warnings(caplog, capsys):
    """It is silent unless a program listens, as is the standard output unless `verbose` is asked for."""
    logger = logging.getLogger(NAME)
    assert [type(handler) for handler in logger.handlers] == [logging.NullHandler]
    assert logger.level == logging.NOTSET
    with caplog.at_level(logging.DEBUG, NAME):
        solve_history([PLATE])
    levels = [(record.levelname, record.getMessage().split(": ")[1]) for record in caplog.records]
    assert [name for level, name in levels if level == "INFO"] == ["solve_history", "solve_history"]
    assert ("DEBUG", "solve") in levels
    caplog.clear()
    with caplog.at_level(logging.INFO, NAME):
        solve(PLATE, method="uzawa", max_iterations=1)
    assert [record.levelname for record in caplog.records] == ["INFO", "WARNING"]
    assert capsys.readouterr().out == ""
