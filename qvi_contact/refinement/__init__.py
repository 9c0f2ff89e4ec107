"""Meshes that a computation refines by itself until a number is as accurate as asked for."""

from qvi_contact.refinement.adaptive import refine
from qvi_contact.refinement.measure import LimitFactor
from qvi_contact.refinement.outcome import LimitRefinement, Refinement, RefinementRound, RefinementStatus
from solvers.basics.front import front

__all__ = ["LimitFactor", "LimitRefinement", "Refinement", "RefinementRound", "RefinementStatus", "refine"]

__getattr__ = front(
    __name__,
    {
        "bisection": ("energies_between", "places", "reference_problem"),
        "outcome": ("bulk",),
        "measure": ("unit_of",),
    },
)
