"""What the command line says of a limit load."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qvi_contact.errors import InputError
from qvi_contact.limit.check_proof import check, sentences
from qvi_contact.limit.load_factor import limit_proof
from qvi_contact.limit.proof import save_proof

if TYPE_CHECKING:
    from qvi_contact.files.problem_file import ProblemFile
    from qvi_contact.limit.load_factor import LimitLoad
    from qvi_contact.problem.problem import ContactProblem
    from qvi_contact.refinement import LimitRefinement

_REMEDY = "give a file written by qvi-contact limit --proof"


def checked_proof(path: str) -> tuple[bool, str]:
    """Whether a proof file holds, and what people read of it.

    Raises
    ------
    InputError
        If the file cannot be read, or is no proof file.

    """
    try:
        proof = json.loads(Path(path).read_text(encoding="utf-8"))
        *proved, counted = check(proof)
    except OSError as error:
        raise InputError("file", path, f"cannot be read ({error.strerror}): {_REMEDY}") from error
    except (KeyError, TypeError, IndexError, AttributeError, ZeroDivisionError, UnicodeDecodeError) as error:
        raise InputError("file", path, f"is no proof file: {_REMEDY}") from error
    except json.JSONDecodeError as error:
        raise InputError("file", path, f"is no JSON ({error}): {_REMEDY}") from error
    except ValueError as error:
        return False, f"not proved: {error}"
    checked = ", ".join(f"{count} {name}" for name, count in counted.items())
    return True, "\n".join([*sentences(*proved), f"checked: {checked}"])


def proved(path: str, problem: ContactProblem, loads: Sequence[str], degree: int | None) -> list[str]:
    """Write a proof file; what people read of it."""
    proof = limit_proof(problem, loads, degree=degree)
    save_proof(path, proof)
    found = sentences(*check(proof)[:2])
    return found + [f"not proved: the {side} bound ({reason})" for side, reason in proof["missing"].items()]


def drawn(path: str, loads: Sequence[str], problem: ContactProblem, limit: LimitLoad, file: ProblemFile) -> None:
    """Draw how the body of a problem gives way, on the mesh of the analysis."""
    from qvi_contact.plots import limit_figure, save_figure

    answer = f"{'; '.join(lines(loads, limit, None))}."
    save_figure(path, limit_figure(problem, limit, file.units, file.title, answer))


def lines(loads: Sequence[str], limit: LimitLoad, refinement: LimitRefinement | None) -> list[str]:
    """What people read."""
    found = [f"{', '.join(loads)}: {sentence(limit)}"]
    if refinement is not None:
        found.append(refinement.message)
        if refinement.status != "reached":
            found.append(refinement.status.advice)
    return found


def sentence(limit: LimitLoad) -> str:
    """How much the mesh and the body carry."""
    if limit.upper == -math.inf:
        return "no multiple can be carried"
    if limit.upper == limit.lower == math.inf:
        return "no upper limit"
    if limit.collapse is not None and not limit.collapse.guaranteed:
        numbers = f"{_multiple(limit.lower)} and {_multiple(limit.upper)} these loads"
        return (
            f"estimates of what the body carries are {numbers}; they are no bounds, as sides are arcs or the body "
            "force is no polynomial of the mesh"
        )
    mesh = "this mesh carries " + _multiple(limit.lower)
    body = "no stress of the body carries more than " + _multiple(limit.upper)
    return f"{mesh} these loads; {body if limit.upper < math.inf else 'for the body there is no upper limit'}"


def document(limit: LimitLoad, refinement: LimitRefinement | None) -> dict[str, Any]:
    """The same for programs: factors that are not finite are None, `outcome` says what they stand for."""
    outcome = "none" if limit.upper == -math.inf else "unbounded" if limit.upper == math.inf else "bounded"
    lower, upper = (value + 0.0 if math.isfinite(value) else None for value in (limit.lower, limit.upper))
    bounds = limit.collapse is None or limit.collapse.guaranteed
    known: dict[str, Any] = {
        "outcome": outcome,
        "bounds": bounds,
        "factor": lower,
        "upper": upper,
        "message": sentence(limit),
    }
    if refinement is not None:
        known["refinement"] = {
            "status": refinement.status.value,
            "target": refinement.target,
            "estimate": refinement.estimate if math.isfinite(refinement.estimate) else None,
            "guaranteed": refinement.guaranteed,
            "certainty": str(refinement.certainty),
            "unknowns": refinement.rounds[-1].unknowns,
            "rounds": len(refinement.rounds),
            "message": refinement.message,
        }
    return known


def _multiple(factor: float) -> str:
    """A factor in a sentence."""
    if math.isinf(factor):
        return "any multiple of" if factor > 0.0 else "no multiple of"
    return f"{factor + 0.0:.9g} times"
