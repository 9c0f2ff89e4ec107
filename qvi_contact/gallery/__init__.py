"""Ready-made problems: of the literature, and with exact solutions."""

from qvi_contact.gallery.benchmarks import (
    CORNER_EXPONENTS,
    block_corner,
    cylinder_in_bore,
    loaded_pin,
    persson_pressure,
    press_fit,
    rings,
)
from qvi_contact.gallery.exact import ExactState, cantilever, gravity_column, problem_from_state, pure_bending, uniform
from qvi_contact.gallery.literature import (
    SSNV128_DISPLACEMENTS,
    compressed_plate,
    sliding_block,
    ssnv128,
    stick_slip_block,
)

__all__ = [
    "CORNER_EXPONENTS",
    "SSNV128_DISPLACEMENTS",
    "ExactState",
    "block_corner",
    "cantilever",
    "compressed_plate",
    "cylinder_in_bore",
    "gravity_column",
    "loaded_pin",
    "persson_pressure",
    "press_fit",
    "problem_from_state",
    "pure_bending",
    "rings",
    "sliding_block",
    "ssnv128",
    "stick_slip_block",
    "uniform",
]
