"""Files that a command is to write, checked before it works for them."""

import tempfile
from importlib.util import find_spec
from pathlib import Path

from qvi_contact.basics.writing import check_suffix
from qvi_contact.errors import InputError

_MODULES = {"plot": ("matplotlib", "plot"), "vtk": ("meshio", "vtk")}  # option → module, extra that brings it
_SUFFIXES = {"vtk": ".vtu", "npz": ".npz"}


def checked_targets(source: str, **targets: str | None) -> dict[str, str]:
    """The files asked for, by option.

    Raises
    ------
    InputError
        If one cannot be written, is the problem file or another option's, or needs a package that is missing.

    """
    given = {option: path for option, path in targets.items() if path is not None}
    taken = {Path(source).absolute(): "the problem file"}
    for option, path in given.items():
        name = f"--{option.replace('_', '-')}"
        place = Path(path).absolute()
        if place in taken:
            raise InputError(name, path, f"is {taken[place]}: give a file of its own")
        taken[place] = f"the file of {name} too"
        _check_writable(name, path)
        _check_kind(option, path)
    return given


def _check_kind(option: str, path: str) -> None:
    if option in _MODULES:
        module, extra = _MODULES[option]
        if find_spec(module) is None:
            raise InputError(f"--{option}", path, f"needs {module}: python -m pip install 'qvi-contact[{extra}]'")
    if option == "plot":
        from qvi_contact.plots import picture_suffix

        picture_suffix(path)
    elif option in _SUFFIXES:
        check_suffix(f"--{option}", path, _SUFFIXES[option])


def _check_writable(name: str, path: str) -> None:
    try:
        if not path or Path(path).is_dir():
            raise InputError(name, path, "give the name of a file")
        with tempfile.TemporaryFile(dir=Path(path).parent):
            pass
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(name, path, f"cannot be written ({reason}): give another place") from error
