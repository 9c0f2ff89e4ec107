"""Frictional contact computed from the stress side.

A plane elastic body is described by an Airy stress function on Bogner-Fox-Schmit elements, so every computed stress is
in equilibrium; contact with Coulomb friction is then a quasi-variational inequality for the stress, solved as a
sequence of convex programs and certified on the original data.

Names are loaded on first use, so that importing the package, or asking the command line for help, costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from qvi_contact.conditions import Contact, Displacement, Symmetry, Traction
    from qvi_contact.contact import ContactLine, ContactState
    from qvi_contact.discretization import Discretization, discretize
    from qvi_contact.errors import InputError, QVIError, SolveError, SolverUnavailableError
    from qvi_contact.material import Material, Region
    from qvi_contact.mesh import RectilinearMesh, graded_lines
    from qvi_contact.problem import ContactProblem
    from qvi_contact.result import ContactResult
    from qvi_contact.solver import solve
    from qvi_contact.stress import principal_stresses

_HOME = {
    "Contact": "conditions",
    "ContactLine": "contact",
    "ContactProblem": "problem",
    "ContactResult": "result",
    "ContactState": "contact",
    "Discretization": "discretization",
    "Displacement": "conditions",
    "InputError": "errors",
    "Material": "material",
    "QVIError": "errors",
    "RectilinearMesh": "mesh",
    "Region": "material",
    "SolveError": "errors",
    "SolverUnavailableError": "errors",
    "Symmetry": "conditions",
    "Traction": "conditions",
    "discretize": "discretization",
    "graded_lines": "mesh",
    "principal_stresses": "stress",
    "solve": "solver",
}

__all__ = [
    "Contact",
    "ContactLine",
    "ContactProblem",
    "ContactResult",
    "ContactState",
    "Discretization",
    "Displacement",
    "InputError",
    "Material",
    "QVIError",
    "RectilinearMesh",
    "Region",
    "SolveError",
    "SolverUnavailableError",
    "Symmetry",
    "Traction",
    "discretize",
    "graded_lines",
    "principal_stresses",
    "solve",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
