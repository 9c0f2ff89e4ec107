"""Ready-made problems: of the literature, with exact solutions, and of many blocks."""

from qvi_contact.gallery.benchmarks import (
    CORNER_EXPONENTS,
    SSNV128_DISPLACEMENTS,
    arc,
    block_corner,
    compressed_plate,
    cylinder_in_bore,
    cylinder_on_block,
    fan,
    half_discs,
    loaded_pin,
    persson_pressure,
    press_fit,
    press_fit_torque,
    rings,
    ssnv128,
)
from qvi_contact.gallery.exact import (
    DOOR_AND_WINDOW,
    ExactState,
    cantilever,
    gravity_column,
    jointed_slope,
    masonry_wall,
    problem_from_state,
    pure_bending,
    sliding_block,
    stick_slip_block,
    uniform,
)

__all__ = [
    "CORNER_EXPONENTS", "DOOR_AND_WINDOW", "SSNV128_DISPLACEMENTS", "ExactState", "arc", "block_corner",
    "cantilever", "compressed_plate", "cylinder_in_bore", "cylinder_on_block", "fan", "gravity_column",
    "half_discs", "jointed_slope", "loaded_pin", "masonry_wall", "persson_pressure", "press_fit",
    "press_fit_torque", "problem_from_state", "pure_bending", "rings", "sliding_block", "ssnv128",
    "stick_slip_block", "uniform",
]  # fmt: skip
