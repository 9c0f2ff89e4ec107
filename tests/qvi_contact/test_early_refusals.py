"""Arguments that cannot be right are refused before anything is computed."""

import pytest

from qvi_contact import InputError, QVIError, refine, solve, solve_history, solve_sweep, stream_sweep
from qvi_contact.bracket import bracket
from qvi_contact.gallery import compressed_plate
from solvers import solve_qvi

PROBLEM = compressed_plate(4)
WRONG = {
    "tolerance": "1e-8",
    "callback": 3,
    "factorisation": "pen and paper",
    "threads": 0,
    "max_iterations": 0,
    "gap": 2.0,
    "colour": "red",
    "method": "guess",
    "inner": "guess",
}
ENTRIES = {
    "solve": lambda _, **options: solve(PROBLEM, **options),
    "sweep": lambda _, **options: solve_sweep(PROBLEM, "friction", [0.1, 0.2], **options),
    "stream": lambda path, **options: stream_sweep(PROBLEM, "friction", [0.1], path / "rows.sqlite", **options),
    "history": lambda _, **options: solve_history([PROBLEM, PROBLEM], **options),
    "refine": lambda _, **options: refine(PROBLEM, **options),
}


@pytest.fixture(scope="module")
def result():
    return solve(PROBLEM)


@pytest.fixture
def no_work(monkeypatch):
    """Nothing may be discretised or solved."""

    def refuse(*_arguments, **_options):
        raise AssertionError("something was computed first")

    for place in (
        "qvi_contact.discretization.discretization._discretized",
        "qvi_contact.bracket.bounds.admissible_stress",
        "qvi_contact.bracket.bounds.stress_under_slip",
        "solvers.solve._attempt",
    ):
        monkeypatch.setattr(place, refuse)


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("entry", ENTRIES)
@pytest.mark.parametrize("option", WRONG)
def test_wrong_options_are_refused_at_once(entry, option, tmp_path):
    with pytest.raises(QVIError, match=f"^{option}: "):
        ENTRIES[entry](tmp_path, **{option: WRONG[option]})


def test_wrong_options_of_a_bracket_are_refused_at_once(result, request):
    request.getfixturevalue("no_work")
    for option, value in {"degree": 99, "max_iterations": 0, "callback": 3}.items():
        with pytest.raises(InputError, match=f"^{option}: "):
            bracket(result, **{option: value})


@pytest.mark.parametrize("tolerance", ["1e-8", 0.0, 1.0])
def test_the_algebraic_solve_refuses_them_too(result, tolerance, request):
    request.getfixturevalue("no_work")
    with pytest.raises(InputError, match=r"^tolerance: "):
        solve_qvi(result.discretization.qvi, tolerance=tolerance)
