"""Frictional contact computed from the stress side.

A plane elastic body is described by an Airy stress function on C1 triangles, so every computed stress is in
equilibrium. Contact with Coulomb friction is then a quasi-variational inequality for the stress. It is solved as one
complementarity problem on the contact, or as a sequence of convex programs, and certified on the original data.

Names are loaded on first use, so that importing the package and asking the command line for help are quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from qvi_contact.bracket import Branches, other_solutions
    from qvi_contact.companion import solve_companion
    from qvi_contact.discretization.discretization import Discretization, discretize
    from qvi_contact.errors import InputError, QVIError, SolveError, SolverUnavailableError, UnknownNameError
    from qvi_contact.files.archive import load_result
    from qvi_contact.files.problem_file import ProblemFile, load_problem
    from qvi_contact.files.problem_text import save_problem
    from qvi_contact.limit.load_factor import LimitLoad, StrengthReduction, limit_load_factor, strength_reduction_factor
    from qvi_contact.limit.proof import limit_proof
    from qvi_contact.mechanism import Mechanism
    from qvi_contact.mesh.grid import graded_lines
    from qvi_contact.mesh.outline import Corner
    from qvi_contact.mesh.triangles import TriangleMesh
    from qvi_contact.problem.conditions import Contact, Displacement, RigidPlate, Symmetry, Traction
    from qvi_contact.problem.fields import BodyForces, Expression, Polynomial
    from qvi_contact.problem.material import Material, Mises, MohrCoulomb, NoTension, Region, Tresca
    from qvi_contact.problem.problem import ContactProblem
    from qvi_contact.refinement import LimitFactor, LimitRefinement, Refinement, RefinementStatus, refine
    from qvi_contact.solution.contact_line import ContactLine, ContactState
    from qvi_contact.solution.history import History, loop_area, solve_history
    from qvi_contact.solution.result import ContactResult
    from qvi_contact.solution.settings import Settings
    from qvi_contact.solution.solver import solve
    from qvi_contact.solution.stress import principal_stresses
    from qvi_contact.solution.sweep import StoredSweep, Sweep, SweepRow, read_sweep, solve_sweep
    from qvi_contact.verification import verify_result

_HOMES = {
    "bracket": "Branches, other_solutions",
    "companion": "solve_companion",
    "discretization.discretization": "Discretization, discretize",
    "errors": "InputError, QVIError, SolveError, SolverUnavailableError, UnknownNameError",
    "files.archive": "load_result",
    "files.problem_file": "ProblemFile, load_problem",
    "files.problem_text": "save_problem",
    "limit.load_factor": "LimitLoad, StrengthReduction, limit_load_factor, strength_reduction_factor",
    "limit.proof": "limit_proof",
    "mechanism": "Mechanism",
    "mesh.grid": "graded_lines",
    "mesh.outline": "Corner",
    "mesh.triangles": "TriangleMesh",
    "problem.conditions": "Contact, Displacement, RigidPlate, Symmetry, Traction",
    "problem.fields": "BodyForces, Expression, Polynomial",
    "problem.material": "Material, Mises, MohrCoulomb, NoTension, Region, Tresca",
    "problem.problem": "ContactProblem",
    "refinement": "LimitFactor, LimitRefinement, Refinement, RefinementStatus, refine",
    "solution.contact_line": "ContactLine, ContactState",
    "solution.history": "History, loop_area, solve_history",
    "solution.result": "ContactResult",
    "solution.settings": "Settings",
    "solution.solver": "solve",
    "solution.stress": "principal_stresses",
    "solution.sweep": "StoredSweep, Sweep, SweepRow, read_sweep, solve_sweep",
    "verification": "verify_result",
}
"""Public names by the module that defines them."""

__all__ = [
    "BodyForces", "Branches", "Contact", "ContactLine", "ContactProblem", "ContactResult", "ContactState", "Corner",
    "Discretization", "Displacement", "Expression", "History", "InputError", "LimitFactor", "LimitLoad",
    "LimitRefinement", "Material", "Mechanism", "Mises", "MohrCoulomb", "NoTension", "Polynomial", "ProblemFile",
    "QVIError", "Refinement", "RefinementStatus", "Region", "RigidPlate", "Settings", "SolveError",
    "SolverUnavailableError", "StoredSweep", "StrengthReduction", "Sweep", "SweepRow", "Symmetry", "Traction", "Tresca",
    "TriangleMesh", "UnknownNameError", "discretize", "graded_lines", "limit_load_factor", "limit_proof",
    "load_problem", "load_result", "loop_area", "other_solutions", "principal_stresses", "read_sweep", "refine",
    "save_problem", "solve", "solve_companion", "solve_history", "solve_sweep", "strength_reduction_factor",
    "verify_result",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names.split(", "):
            value = globals()[name] = getattr(import_module(f"{__name__}.{home}"), name)
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
