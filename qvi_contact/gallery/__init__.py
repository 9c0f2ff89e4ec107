"""Ready-made problems: of the literature, with exact solutions, and of many blocks."""

from qvi_contact.gallery.benchmarks import (
    CORNER_EXPONENTS,
    block_corner,
    cylinder_in_bore,
    cylinder_on_block,
    half_discs,
    loaded_pin,
    persson_pressure,
    press_fit,
    press_fit_torque,
    rings,
)
from qvi_contact.gallery.blocks import DOOR_AND_WINDOW, jointed_slope, masonry_wall
from qvi_contact.gallery.exact import ExactState, cantilever, gravity_column, problem_from_state, pure_bending, uniform
from qvi_contact.gallery.literature import (
    SSNV128_DISPLACEMENTS,
    compressed_plate,
    sliding_block,
    ssnv128,
    stick_slip_block,
)
from solvers.basics.front import front

__all__ = [
    "CORNER_EXPONENTS",
    "DOOR_AND_WINDOW",
    "SSNV128_DISPLACEMENTS",
    "ExactState",
    "block_corner",
    "cantilever",
    "compressed_plate",
    "cylinder_in_bore",
    "cylinder_on_block",
    "gravity_column",
    "half_discs",
    "jointed_slope",
    "loaded_pin",
    "masonry_wall",
    "persson_pressure",
    "press_fit",
    "press_fit_torque",
    "problem_from_state",
    "pure_bending",
    "rings",
    "sliding_block",
    "ssnv128",
    "stick_slip_block",
    "uniform",
]

__getattr__ = front(__name__, {"meshes": ("arc", "fan")})
