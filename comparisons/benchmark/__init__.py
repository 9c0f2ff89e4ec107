"""Times of whole solves beside one factorisation and other loops, of sequences and walls, and the accuracy they buy."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "report": (
            "document_of", "frames_of", "growth", "runs_of", "solves_of", "values_of", "wall_report", "walls_of",
        ),
        "study": (
            "METHODS", "PARTS", "affordable", "graded", "loops", "predicted", "repetitions", "sequences", "solve_loop",
            "wall_of", "walls", "whole",
        ),
    },
)  # fmt: skip
