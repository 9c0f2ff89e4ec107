"""Ready-made problems: of the literature, and with exact solutions."""

from qvi_contact.gallery.exact import ExactState, cantilever, gravity_column, problem_from_state, pure_bending, uniform
from qvi_contact.gallery.literature import (
    SSNV128_DISPLACEMENTS,
    compressed_plate,
    sliding_block,
    ssnv128,
    stick_slip_block,
)

__all__ = [
    "SSNV128_DISPLACEMENTS",
    "ExactState",
    "cantilever",
    "compressed_plate",
    "gravity_column",
    "problem_from_state",
    "pure_bending",
    "sliding_block",
    "ssnv128",
    "stick_slip_block",
    "uniform",
]
