"""Messages of errors: one line, and long values keep both their ends."""

from hypothesis import given, settings
from hypothesis import strategies as st

from solvers.errors import InputError
from tests.effort import examples


@settings(max_examples=examples(30), deadline=None)
@given(st.text(max_size=400), st.integers(0, 300))
def test_one_line_of_limited_length(text, count):
    for value in (text, list(range(count)), "/folder" * count):
        message = str(InputError("field", value, "remedy"))
        assert len(message.splitlines()) == 1
        assert len(message) <= len("field: : remedy") + 120


def test_a_long_path_keeps_its_beginning_and_its_name():
    message = str(InputError("output", "/data" + "/very/deep" * 40 + "/result.npz", "give another place"))
    assert message.startswith("output: '/data/very")
    assert "/result.npz': give another place" in message
    assert "…" in message


def test_short_values_are_whole():
    assert str(InputError("mu", -1.0, "give a number ≥ 0")) == "mu: -1.0: give a number ≥ 0"
