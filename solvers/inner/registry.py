"""Names of inner solvers: what exists, what is installed, and how one is built."""

import sys
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any, Final

from solvers.basics.foreign import foreign_code
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.errors import SolverUnavailableError
from solvers.inequality.problem import FrictionQVI
from solvers.inner import qp, socp
from solvers.inner.linear_program import BackendFailure, attempt, one_line, real_vector
from solvers.inner.problem import Centre, InnerSolution, InnerSolver, no_result

_FREE = frozenset(
    {"clarabel", "cvxopt", "daqp", "ecos", "highspy", "osqp", "piqp", "proxsuite", "qpalm", "quadprog", "scs"}
)
"""Modules that a package index has under the same name, free of charge."""


def available() -> tuple[str, ...]:
    """Names of the inner solvers that can be used now, ``"kind:name"``, found without importing them."""
    return tuple(name for name, modules in _catalogue().items() if all(map(find_spec, modules)))


def make_inner(name: str, qvi: FrictionQVI, tolerance: float, options: Mapping[str, Any] | None = None) -> InnerSolver:
    """Build the inner solver `name` for a QVI; `SolverUnavailableError` lists what exists.

    `options`, by the back end's own names, replace all that `tolerance` would set.
    """
    name = check_name(name)
    kind, backend = name.split(":")
    with foreign_code():
        return Guarded(name, qvi, _KINDS[kind](qvi, backend, tolerance, options))


_KINDS: Final[Mapping[str, Callable[..., InnerSolver]]] = {
    "qp": qp.QPSolver,
    "direct": qp.DirectClarabel,
    "socp": socp.SOCPSolver,
}


class Guarded:
    """Another inner solver; what it raises, and an answer that is none, is a result with the status backend_failed."""

    def __init__(self, name: str, qvi: FrictionQVI, solver: InnerSolver) -> None:
        self.packages = solver.packages
        self._name, self._qvi, self._solver = name, qvi, solver

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """As `InnerSolver.solve`; warnings end in the message."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            answer = attempt(self._name, lambda: self._checked(self._solver.solve(threshold, centre, start)))
        if isinstance(answer, BackendFailure):
            return no_result(self._qvi, Status.BACKEND_FAILED, str(answer))
        return replace(answer, message=one_line("; ".join([answer.message, *(str(each.message) for each in caught)])))

    def _checked(self, answer: object) -> InnerSolution:
        """An answer of the promised form, and finite where it claims to be one; how good it is others judge."""
        if not isinstance(answer, InnerSolution):
            raise TypeError(f"the answer is {type(answer).__name__}, not an InnerSolution")
        for part, size in {"z": self._qvi.n, "m_N": self._qvi.m, "m_T": self._qvi.m, "nu": self._qvi.p}.items():
            real_vector(part, getattr(answer, part), size)
        if answer.status.usable and not answer.finite:
            return no_result(self._qvi, Status.BACKEND_FAILED, f"{answer.message}; result is not finite")
        return answer


def check_name(name: object) -> str:
    """Return the name in lower case if it can be used now, else `SolverUnavailableError`."""
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
    """The command that installs the library of an inner solver ``"kind:name"``, or where others are described."""
    modules = _catalogue()[name]
    free = [module for module in modules if module in _FREE]
    return f"pip install {' '.join(free)}" if free else "https://qpsolvers.github.io and https://www.cvxpy.org say how"


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Package → version, "unknown" where the distribution has another name."""
    return {package: _version(package) for package in packages}


@cache
def _version(package: str) -> str:
    """As the loaded module has it: looking through the metadata of all packages takes longer than a small solve."""
    told = getattr(sys.modules.get(package), "__version__", None)
    try:
        return told if isinstance(told, str) else version(package)
    except PackageNotFoundError:
        return "unknown"


def _catalogue() -> dict[str, tuple[str, ...]]:
    """Name → modules it needs."""
    return {
        **{f"qp:{name}": ("qpsolvers", entry.module) for name, entry in sorted(qp.BACKENDS.items())},
        "direct:clarabel": ("clarabel",),
        **{f"socp:{name}": ("cvxpy", entry.module) for name, entry in sorted(socp.BACKENDS.items())},
    }
