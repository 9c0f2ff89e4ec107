"""Meshes that a computation refines by itself until a number is as accurate as asked for."""

from qvi_contact.refinement.adaptive import refine
from qvi_contact.refinement.outcome import Refinement, RefinementRound, RefinementStatus

__all__ = ["Refinement", "RefinementRound", "RefinementStatus", "refine"]
