"""The whole suite on one factorisation back end: ``python -m pytest --factorisation superlu``."""

import gc
import os
from types import SimpleNamespace

# Before NumPy is loaded. Each core has a process of tests already, and BLAS waits for its threads by spinning.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qvi_contact.discretization import families
from solvers import InputError
from solvers.basics import watch
from solvers.factorisation import set_default
from solvers.factorisation.registry import VARIABLE
from tests.effort import examples

# neither time nor chance decides a test
settings.register_profile("suite", max_examples=examples(50), deadline=None, derandomize=True)
settings.load_profile("suite")


def pytest_addoption(parser):
    parser.addoption("--factorisation", metavar="NAME", help="back end that 'auto' means in all tests")


def pytest_configure(config):
    try:
        set_default(config.getoption("factorisation"))
    except InputError as error:
        raise pytest.UsageError(str(error)) from error
    config.option.loadscopereorder = False  # else files of few long tests come last, and one process waits for another


@settings(max_examples=1)
@given(st.none())
def _first_example(_nothing):
    """Hypothesis looks for whoever holds NumPy's generator, which it could not see among what is frozen, once."""


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """What is imported and collected stays: to look through it for garbage again and again is a third of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        _first_example()
        gc.freeze()
        gc.set_threshold(10_000, 20, 100)  # nor is it looked through at every few tests


def pytest_collection_modifyitems(items):
    """Whole pages and examples first, single formulas last: processes that share files end at about the same time."""
    items.sort(key=lambda item: len(item.path.parts))


@pytest.fixture(autouse=True, scope="module")
def _forced_factorisation(request):
    """Again for each file, since some of them change it, and for the processes they start."""
    name = request.config.getoption("factorisation")
    if name is None:
        yield
        return
    set_default(name)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(os.environ, VARIABLE, name)
        yield


@pytest.fixture(scope="module")
def bogner_fox_schmit():
    """Rectangles keep the Bogner-Fox-Schmit element where none is named: for files of tests about that element."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(families, "DEFAULT_ELEMENT", "bfs")
        yield


class Clock:
    """Seconds of `solvers.basics.watch` that pass only when something lets them."""

    def __init__(self):
        self.now = 0.0

    def passes(self, seconds):
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(watch, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock
