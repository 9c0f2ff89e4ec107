"""From the continuous problem (D1) to the algebraic one (D2)."""

from qvi_contact.discretization.discretization import Discretization, discretize
from solvers.basics.front import front

__all__ = ["Discretization", "discretize"]

__getattr__ = front(
    __name__,
    {
        "displacements": ("DisplacementSpace", "Triangle"),
        "energy": ("BodyStiffness", "Root"),
        "frames": ("shortest_cuts",),
        "loads": ("physical",),
        "plates": ("pins",),
        "scaling": ("REACH", "Scales"),
        "space": ("Functionals", "StressSpace", "edge_rule", "split_points"),
        "supports": ("Elimination", "Supports", "walk"),
    },
)
