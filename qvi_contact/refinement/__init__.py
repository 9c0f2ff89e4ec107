"""Meshes that a computation refines by itself until a number is as accurate as asked for."""

from qvi_contact.refinement.adaptive import LimitRefinement, Refinement, refine
from qvi_contact.refinement.bisection import RefinementRound, RefinementStatus
from qvi_contact.refinement.measure import LimitFactor
from solvers.basics.front import front

__all__ = ["LimitFactor", "LimitRefinement", "Refinement", "RefinementRound", "RefinementStatus", "refine"]

__getattr__ = front(__name__)
