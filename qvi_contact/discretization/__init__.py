"""From the continuous problem (D1) to the algebraic one (D2)."""

from qvi_contact.discretization.discretization import Discretization, discretize
from solvers.basics.front import front

__all__ = ["Discretization", "discretize"]

__getattr__ = front(
    __name__,
    {
        "basis": ("PrescribedTraction", "SharedCorners"),
        "bogner_fox_schmit": ("BognerFoxSchmit",),
        "bogner_fox_schmit.displacements": ("project_normal", "project_tangential"),
        "bogner_fox_schmit.energy_root": ("StressRoot",),
        "bogner_fox_schmit.stencil": ("energy_matrix",),
        "constraints": ("Rows", "solve_conditions"),
        "edge_points": ("EdgePoints",),
        "elimination": ("UnbalancedLoadError",),
        "hsieh_clough_tocher.basis": ("TriangleBasis",),
        "hsieh_clough_tocher.condensed": ("potential_points",),
        "hsieh_clough_tocher.cuts": ("shortest_cuts",),
        "hsieh_clough_tocher.space": ("TriangleSpace",),
        "hsieh_clough_tocher.tractions": ("walk",),
        "loads": ("physical",),
        "pins": ("misplaced_pins", "pressed_pins"),
        "scaling": ("REACH", "Scales"),
    },
)
