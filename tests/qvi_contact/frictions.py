"""Problems that differ in friction alone."""

from dataclasses import replace

from qvi_contact import Contact
from qvi_contact.discretization import Discretization
from qvi_contact.solution import discretized


def with_friction(known: Discretization, friction: float) -> Discretization:
    """The problem of a discretisation with another friction: it shares matrices and factorisation, which take time."""
    conditions = [
        replace(each, friction=friction) if isinstance(each, Contact) else each for each in known.problem.conditions
    ]
    return discretized(replace(known.problem, conditions=conditions), before=known)
