"""Names of inner solvers: which exist, which are installed, and `make_inner`, which builds one."""

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any, Final

from solvers.basics.foreign import foreign_code
from solvers.errors import SolverUnavailableError
from solvers.inequality.problem import FrictionQVI
from solvers.inner import qp
from solvers.inner.linear_program import Guarded
from solvers.inner.problem import InnerSolver

_FREE_MODULES = frozenset(
    {"clarabel", "cvxopt", "daqp", "ecos", "highspy", "osqp", "piqp", "proxsuite", "qpalm", "quadprog", "scs"}
)
"""Modules that can be installed from PyPI under the same name, free of charge."""


def available() -> tuple[str, ...]:
    """Names ``"kind:name"`` of the installed inner solvers, which are not imported."""
    return tuple(name for name, modules in _catalogue().items() if all(map(find_spec, modules)))


def make_inner(name: str, qvi: FrictionQVI, tolerance: float, options: Mapping[str, Any] | None = None) -> InnerSolver:
    """Build the inner solver `name` for a QVI; `SolverUnavailableError` if it is unknown or not installed.

    `options`, by the back end's own names, replace all settings that `tolerance` stands for.
    """
    name = check_name(name)
    kind, backend = name.split(":")
    with foreign_code():
        return Guarded(name, qvi, _KINDS[kind](qvi, backend, tolerance, options))


_KINDS: Final[Mapping[str, Callable[..., InnerSolver]]] = {
    "qp": qp.QPSolver, "direct": qp.DirectClarabel, "socp": qp.SOCPSolver,
}  # fmt: skip


def check_name(name: object) -> str:
    """The name in lower case if it is installed, else `SolverUnavailableError`."""
    canonical = name.lower() if isinstance(name, str) else ""
    modules = _catalogue().get(canonical)
    missing = [module for module in modules or () if not find_spec(module)]
    if modules is not None and not missing:
        return canonical
    why = "there is no such inner solver"
    if missing:
        why = f"module {', '.join(missing)} is not installed ({how_to_install(canonical)})"
    raise SolverUnavailableError("inner", name, f"{why}; choose one of {', '.join(available())}")


def how_to_install(name: str) -> str:
    """The command that installs the library of an inner solver ``"kind:name"``, or the pages that describe it."""
    modules = _catalogue()[name]
    free = [module for module in modules if module in _FREE_MODULES]
    return f"pip install {' '.join(free)}" if free else "https://qpsolvers.github.io and https://www.cvxpy.org say how"


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Package → version, "unknown" if its distribution has another name."""
    return {package: _version(package) for package in packages}


@cache
def _version(package: str) -> str:
    """The loaded module's `__version__`, as the metadata of all packages take longer to read than a small solve."""
    loaded = getattr(sys.modules.get(package), "__version__", None)
    try:
        return loaded if isinstance(loaded, str) else version(package)
    except PackageNotFoundError:
        return "unknown"


def _catalogue() -> dict[str, tuple[str, ...]]:
    """Name of each inner solver → the modules that it needs."""
    return {
        **{f"qp:{name}": ("qpsolvers", entry.module) for name, entry in sorted(qp.BACKENDS.items())},
        "direct:clarabel": ("clarabel",),
        **{f"socp:{name}": ("cvxpy", entry.module) for name, entry in sorted(qp.SOCP_BACKENDS.items())},
    }
