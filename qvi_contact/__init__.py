"""Frictional contact computed from the stress side.

A plane elastic body is described by an Airy stress function on Bogner-Fox-Schmit elements, so every computed stress is
in equilibrium; contact with Coulomb friction is then a quasi-variational inequality for the stress, solved as one
complementarity problem on the contact or as a sequence of convex programs, and certified on the original data.

Names are loaded on first use, so that importing the package, or asking the command line for help, costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from qvi_contact.bracket import refined_where_apart
    from qvi_contact.companion import solve_companion
    from qvi_contact.conditions import Contact, Displacement, RigidPlate, Symmetry, Traction
    from qvi_contact.contact import ContactLine, ContactState
    from qvi_contact.discretization import Discretization, discretize
    from qvi_contact.errors import InputError, QVIError, SolveError, SolverUnavailableError
    from qvi_contact.fields import Expression, Polynomial
    from qvi_contact.history import History, loop_area, solve_history
    from qvi_contact.limit import limit_load_factor
    from qvi_contact.lines import graded_lines
    from qvi_contact.material import Material, Region
    from qvi_contact.mesh import RectilinearMesh
    from qvi_contact.problem import ContactProblem
    from qvi_contact.problem_file import ProblemFile, load_problem
    from qvi_contact.problem_writer import save_problem
    from qvi_contact.refinement import Refinement, RefinementStatus, refine
    from qvi_contact.result import ContactResult
    from qvi_contact.solver import solve
    from qvi_contact.stored import load_result
    from qvi_contact.stress import principal_stresses
    from qvi_contact.verification import verify_result

_HOME = {
    "Contact": "conditions",
    "ContactLine": "contact",
    "ContactProblem": "problem",
    "ContactResult": "result",
    "ContactState": "contact",
    "Discretization": "discretization",
    "Displacement": "conditions",
    "Expression": "fields",
    "History": "history",
    "InputError": "errors",
    "Material": "material",
    "Polynomial": "fields",
    "ProblemFile": "problem_file",
    "QVIError": "errors",
    "RectilinearMesh": "mesh",
    "Refinement": "refinement",
    "RefinementStatus": "refinement",
    "Region": "material",
    "RigidPlate": "conditions",
    "SolveError": "errors",
    "SolverUnavailableError": "errors",
    "Symmetry": "conditions",
    "Traction": "conditions",
    "discretize": "discretization",
    "graded_lines": "lines",
    "limit_load_factor": "limit",
    "load_problem": "problem_file",
    "load_result": "stored",
    "loop_area": "history",
    "principal_stresses": "stress",
    "refine": "refinement",
    "refined_where_apart": "bracket",
    "save_problem": "problem_writer",
    "solve": "solver",
    "solve_companion": "companion",
    "solve_history": "history",
    "verify_result": "verification",
}

__all__ = [
    "Contact",
    "ContactLine",
    "ContactProblem",
    "ContactResult",
    "ContactState",
    "Discretization",
    "Displacement",
    "Expression",
    "History",
    "InputError",
    "Material",
    "Polynomial",
    "ProblemFile",
    "QVIError",
    "RectilinearMesh",
    "Refinement",
    "RefinementStatus",
    "Region",
    "RigidPlate",
    "SolveError",
    "SolverUnavailableError",
    "Symmetry",
    "Traction",
    "discretize",
    "graded_lines",
    "limit_load_factor",
    "load_problem",
    "load_result",
    "loop_area",
    "principal_stresses",
    "refine",
    "refined_where_apart",
    "save_problem",
    "solve",
    "solve_companion",
    "solve_history",
    "verify_result",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
