"""Options of the suite, such as ``--factorisation multifrontal``, its set-up, and fixtures that many tests share."""

import gc
import os
import shutil
import sys
from types import SimpleNamespace

# Set before NumPy is imported: each core runs a process of tests already, and idle BLAS threads would spin.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from importlib.util import find_spec

import pytest
from xdist import is_xdist_controller

# The tested packages are imported inside functions, so that the process that distributes tests does not wait for them.


def pytest_addoption(parser):
    parser.addoption("--factorisation", metavar="NAME", help="back end of 'auto' in all tests")


def pytest_configure(config):
    if config.getoption("factorisation") is not None:
        _force(config.getoption("factorisation"))
    config.option.loadscopereorder = False  # or files of few long tests would be last, and processes wait for one


def _force(name):
    from solvers import InputError
    from solvers.factorisation import VARIABLE, resolve

    os.environ[VARIABLE] = name
    try:
        resolve()
    except InputError as error:
        raise pytest.UsageError(str(error)) from error


def _hypothesis_starts():
    """Load a profile in which neither time nor chance decides a test."""
    from hypothesis import given, settings
    from hypothesis import strategies as st

    from tests.cases import examples

    @settings(max_examples=1)
    @given(st.none())
    def first_example(_nothing):
        """Hypothesis searches, once, for references to NumPy's generator, and would not see them after `gc.freeze`."""

    settings.register_profile("suite", max_examples=examples(25), deadline=None, derandomize=True)
    settings.load_profile("suite")
    return first_example


@pytest.hookimpl(wrapper=True)
def pytest_collection(session):
    """Freeze imported and collected objects: to search them for garbage again and again takes a third of the time."""
    if is_xdist_controller(session):
        return (yield)
    first_example = _hypothesis_starts()
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        first_example()
        gc.freeze()
        gc.set_threshold(10_000, 20, 100)  # fewer searches in tests, too


class _FromTheLast(pytest.Dir):
    """A folder whose files are collected from the last to the first."""

    def collect(self):
        return reversed(list(super().collect()))


def pytest_collect_directory(path, parent):
    """Every second process collects from the last file on, so that it reads bytecode that others have compiled."""
    worker = getattr(parent.config, "workerinput", {"workerid": "gw0"})["workerid"]
    return _FromTheLast.from_parent(parent, path=path) if int(worker.removeprefix("gw")) % 2 else None


def pytest_collection_modifyitems(items):
    """Long tests of pages and examples first, short ones last, so that processes end at about the same time."""
    items.sort(key=lambda item: (len(item.path.parts), item.path.parts))


@pytest.fixture(autouse=True, scope="module")
def _forced_factorisation(request):
    """Set the back end again for each file, since some tests change it, and for the processes they start."""
    name = request.config.getoption("factorisation")
    if name is None:
        yield
        return
    from solvers.factorisation import VARIABLE

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, name)
        yield


@pytest.fixture
def clock(monkeypatch):
    """The clock of `solvers.basics.progress`, which only its method `passes(seconds)` advances."""
    clock = SimpleNamespace(now=0.0)
    clock.passes = lambda seconds: setattr(clock, "now", clock.now + seconds)
    monkeypatch.setattr("solvers.basics.progress.time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


@pytest.fixture
def without(monkeypatch):
    """A function that hides a package, as if it were not installed."""
    return lambda package: monkeypatch.setitem(sys.modules, package, None)


@pytest.fixture
def in_tmp_path(tmp_path, monkeypatch):
    """Run the test in its own working folder."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def outlined():
    """Write pictures as texts and data, which saves the time to lay them out and draw them."""
    pytest.importorskip("matplotlib")
    from tests.comparisons.conftest import outlines

    with outlines():
        yield


@pytest.fixture
def environ(monkeypatch):
    """A function that sets variables of the environment, or deletes those whose value is None."""

    def change(**variables):
        for name, value in variables.items():
            monkeypatch.delenv(name, raising=False) if value is None else monkeypatch.setenv(name, str(value))

    return change


@pytest.fixture
def shell(capfd, monkeypatch):
    """Run a command in this process, `qvi-contact` if no other is given: exit status, standard output and error."""

    def call(*words, command=None, name="qvi-contact"):
        from qvi_contact.basics import run
        from qvi_contact.command.cli import group

        monkeypatch.setattr("sys.argv", [name, *map(str, words)])
        with pytest.raises(SystemExit) as caught:
            run(command or group, name)
        return caught.value.code, *capfd.readouterr()

    return call


@pytest.fixture
def sliding(tmp_path, pytestconfig):
    """The file of a block with 1 % more shear than friction can carry, on a coarser mesh than in the examples."""
    text = (pytestconfig.rootpath / "examples" / "dragged_block_slides.toml").read_text(encoding="utf-8")
    path = tmp_path / "sliding.toml"
    path.write_text(text.replace("cells = 8", "cells = 2").replace("cells = 4", "cells = 2"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def browser():
    """A Chromium without a window. Without Chromium tests are skipped; they fail where CI is set."""
    found = (shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome", "chrome"))
    program = next(filter(None, found), None)
    if program is None or find_spec("playwright") is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)("playwright, or a Chromium on the path, is missing")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=program, args=["--disable-gpu", "--no-sandbox"])
        yield opened
        opened.close()
