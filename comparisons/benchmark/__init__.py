"""Times of whole solves beside those of one factorisation, of other loops, and the accuracy that they buy."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "measures": ("PARTS", "solves_of", "values_of", "wall_values", "walls_of"),
        "reference": ("CONVERGED", "SETTLED"),
        "report": ("document_of", "frames_of", "wall_report"),
        "study": ("METHODS", "graded", "loops", "walls", "whole"),
        "task": ("affordable", "loop", "predicted", "repetitions"),
        "wall": ("wall_of",),
    },
)
