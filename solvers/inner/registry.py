"""Names of inner solvers: what exists, what is installed, and how one is built."""

from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any

from solvers.basics.foreign import foreign_code
from solvers.basics.types import load
from solvers.errors import InputError, SolverUnavailableError
from solvers.inequality.problem import FrictionQVI
from solvers.inner import qp_backends, socp
from solvers.inner.guarded import Guarded
from solvers.inner.names import STRICT_DEFAULT, is_strict
from solvers.inner.problem import InnerSolver

_DIRECT = ("clarabel", "osqp")
_FREE = frozenset(
    {"clarabel", "cvxopt", "daqp", "ecos", "highspy", "osqp", "piqp", "proxsuite", "qpalm", "quadprog", "scs"}
)
"""Modules that a package index has under the same name, free of charge."""


def available(kind: str | None = None) -> tuple[str, ...]:
    """Names of the inner solvers that can be used now, ``"kind:name"``, found without importing them.

    `kind` restricts to "qp", "direct", "socp", "strict" or "strict-direct"; the last two bound tractions on whole
    edges, which is another problem (`FrictionQVI.strict`), and are listed when asked for only. Sorted within each kind.
    """
    names = tuple(name for name, modules in _catalogue().items() if all(map(_installed, modules)))
    return tuple(name for name in names if (not is_strict(name) if kind is None else name.split(":")[0] == kind))


def make_inner(name: str, qvi: FrictionQVI, tolerance: float, options: Mapping[str, Any] | None = None) -> InnerSolver:
    """Build the inner solver `name` for a QVI; `SolverUnavailableError` lists what exists.

    `options`, by the back end's own names, replace all that `tolerance` would set; strict solvers take none.
    """
    name = check_name(name)
    with foreign_code():
        return Guarded(name, qvi, _make(name, qvi, tolerance, options))


def _make(name: str, qvi: FrictionQVI, tolerance: float, options: Mapping[str, Any] | None) -> InnerSolver:
    kind, backend = name.split(":")
    if kind == "qp":
        from solvers.inner.qp import QPSolver

        return QPSolver(qvi, backend, tolerance, options)
    if kind == "socp":
        return socp.SOCPSolver(qvi, backend, tolerance, options)
    if is_strict(kind):
        if options is not None:
            raise InputError(
                "options", dict(options), f"{name} takes its settings from the tolerance alone: leave them out"
            )
        return _make_strict(kind, backend, qvi, tolerance)
    if backend == "clarabel":
        from solvers.inner.direct_clarabel import DirectClarabel

        return DirectClarabel(qvi, tolerance, options)
    from solvers.inner.direct_osqp import DirectOSQP

    return DirectOSQP(qvi, tolerance, options)


def _make_strict(kind: str, backend: str, qvi: FrictionQVI, tolerance: float) -> InnerSolver:
    """Through cvxpy, or Clarabel itself; the room of strict solvers builds on this one and is loaded by name."""
    if kind == "strict":
        through_cvxpy: InnerSolver = load("solvers.strict.cvxpy_cones").StrictSOCPSolver(qvi, backend, tolerance)
        return through_cvxpy
    direct: InnerSolver = load("solvers.strict.direct_clarabel").DirectStrictClarabel(qvi, tolerance)
    return direct


def check_name(name: object) -> str:
    """Return the name in lower case if it can be used now, else `SolverUnavailableError`."""
    canonical = name.lower() if isinstance(name, str) else ""
    modules = _catalogue().get(canonical)
    if modules is None:
        raise SolverUnavailableError("inner", name, f"there is no such inner solver; {_choices()}")
    missing = [module for module in modules if not _installed(module)]
    if missing:
        remedy = f"module {', '.join(missing)} is not installed ({how_to_install(canonical)}); {_choices()}"
        raise SolverUnavailableError("inner", name, remedy)
    return canonical


def how_to_install(name: str) -> str:
    """The command that installs the library of an inner solver ``"kind:name"``, or where others are described."""
    modules = _catalogue()[name]
    free = [module for module in modules if module in _FREE]
    return f"pip install {' '.join(free)}" if free else "https://qpsolvers.github.io and https://www.cvxpy.org say how"


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Package → version, "unknown" where the distribution has another name."""
    return {package: _version(package) for package in packages}


@cache
def _version(package: str) -> str:
    """Read once: looking through the metadata of all packages takes longer than a small solve."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "unknown"


def _choices() -> str:
    return f"choose one of {', '.join((*available(), *available('strict'), *available('strict-direct')))}"


def _catalogue() -> dict[str, tuple[str, ...]]:
    """Name → modules it needs."""
    return {
        **{f"qp:{name}": ("qpsolvers", entry.module) for name, entry in sorted(qp_backends.BACKENDS.items())},
        **{f"direct:{name}": (name,) for name in _DIRECT},
        **{f"socp:{name}": ("cvxpy", entry.module) for name, entry in sorted(socp.BACKENDS.items())},
        **{f"strict:{name}": ("cvxpy", entry.module) for name, entry in sorted(socp.BACKENDS.items())},
        STRICT_DEFAULT: ("clarabel",),
    }


def _installed(module: str) -> bool:
    return find_spec(module) is not None
