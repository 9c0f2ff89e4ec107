"""Files that a command is to write, checked before it works for them."""

import os
from collections.abc import Callable, Mapping
from importlib.util import find_spec

from qvi_contact.basics.writing import check_suffix, check_writable, identity
from qvi_contact.errors import InputError

_MODULES = {
    "plot": "matplotlib",
    "deformed": "matplotlib",
    "report": "matplotlib",
    "vtk": "meshio",
}
"""Option → the library that it needs."""

_SUFFIXES = {"vtk": ".vtu", "npz": ".npz", "report": ".html", "proof": ".json"}


def checked_targets(source: str, **targets: str | None) -> dict[str, str]:
    """The files asked for, by option.

    Raises
    ------
    InputError
        If one cannot be written, is the problem file or another option's, or needs a package that is missing.

    """
    given = {option: path for option, path in targets.items() if path is not None}
    taken = {identity(source): "the problem file"}
    for option, path in given.items():
        name = _name(option)
        if not path or os.path.isdir(path):  # Path's raises for names that no file can have
            raise InputError(name, path, "give the name of a file")
        check_writable(path, name)
        place = identity(path)
        if place in taken:
            raise InputError(name, path, f"is {taken[place]}: give a file of its own")
        taken[place] = f"the file of {name} too"
        _check_kind(option, path)
    return given


def written(targets: Mapping[str, str], writers: Mapping[str, Callable[[str], None]]) -> list[InputError]:
    """Write every file by the writer of its option, whatever becomes of the others; the errors, named by the option."""
    failures = []
    for option, path in targets.items():
        try:
            writers[option](path)
        except InputError as error:
            name = _name(option) if error.field == "output" else error.field
            failures.append(InputError(name, error.value, error.remedy))
    return failures


def _name(option: str) -> str:
    return f"--{option.replace('_', '-')}"


def _check_kind(option: str, path: str) -> None:
    if option in _MODULES:
        module = _MODULES[option]
        if find_spec(module) is None:
            raise InputError(f"--{option}", path, f"needs {module}: python -m pip install {module}")
    if option in _SUFFIXES:
        check_suffix(f"--{option}", path, _SUFFIXES[option])
    if option in ("plot", "deformed", "report"):
        from qvi_contact.plots import picture_suffix, require_matplotlib

        if option != "report":
            picture_suffix(path)
        require_matplotlib()
