"""Meshes that a computation refines by itself until a number is as accurate as asked for."""

from qvi_contact.refinement.adaptive import refine
from qvi_contact.refinement.outcome import LimitRefinement, Refinement, RefinementRound, RefinementStatus
from qvi_contact.refinement.quantity import LimitFactor

__all__ = ["LimitFactor", "LimitRefinement", "Refinement", "RefinementRound", "RefinementStatus", "refine"]
