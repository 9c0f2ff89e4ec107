"""The plate as plain data, so that every code solves the gallery's own problem; the study of a run."""

import os
import subprocess
from importlib.util import find_spec
from typing import Any, Final

from comparisons.lab.checks import check_at_least_one, check_not_negative, check_some
from comparisons.lab.machine import PACKAGES
from comparisons.lab.study import Study
from comparisons.lab.study.declaration import Values
from comparisons.peers import LEVELS, measure
from comparisons.peers.models import CODES, MODELS, NAMED
from qvi_contact.errors import InputError

_LOOKING: Final = 60.0  # seconds for another Python to say what it has


def peers_study(friction: tuple[float, ...], cells: tuple[int, ...], repetitions: int, levels: int = LEVELS) -> Study:
    """Every model whose code is installed, at every coefficient μ, on the meshes of its family.

    Those are of so many `cells` a side, or the first `levels`. Codes take turns on meshes of one number, so that what
    else the machine does meets all of them.

    Raises
    ------
    InputError
        If a value is wrong, or the Python that should have GetFEM has not.

    """
    for name, values in (("friction", friction), ("cells", cells)):
        check_some(name, values)
    for mu in friction:
        check_not_negative("friction", mu)
    check_at_least_one("cells", min(cells))
    check_at_least_one("repeat", repetitions)
    if not 1 <= levels <= LEVELS:
        raise InputError("levels", levels, f"give a whole number from 1 to {LEVELS}")
    missing, chosen = missing_codes(), {True: set(cells), False: set(range(levels))}
    factors: dict[str, tuple[Any, ...]] = {
        "friction": tuple(dict.fromkeys(friction)),
        "number": tuple(sorted(chosen[True] | chosen[False])),
        "model": tuple(model.name for model in MODELS if model.code not in missing),
        "repetitions": (repetitions,),
    }

    def keep(case: Values) -> bool:
        return case["number"] in chosen[NAMED[case["model"]].family.counted]

    return Study("peers", 2, measure.TASK, factors, keep=keep, packages=(*PACKAGES, "ngsolve"))


def missing_codes() -> tuple[str, ...]:
    """Keys of the codes that are not installed."""
    return tuple(key for key in CODES if not _installed(key))


def _installed(key: str) -> bool:
    """Whether this Python finds the code, or another one that was named for it does, which has to."""
    code, other = CODES[key], os.environ.get(measure.GETFEM)
    if key != "getfem" or not other:
        return find_spec(code.library) is not None
    look = f"import importlib.util, sys; sys.exit(importlib.util.find_spec({code.library!r}) is None)"
    try:
        found = subprocess.run([other, "-c", look], capture_output=True, timeout=_LOOKING, check=False).returncode
    except (OSError, ValueError, subprocess.SubprocessError):
        found = 1
    if found:
        raise InputError("getfem", other, f"give a Python that finds the module {code.library}")
    return True
