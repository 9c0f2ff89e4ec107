"""Solvers compared on frictional contact: inner problems, sequences of them, and whole outer loops."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "accuracies": ("LEVELS", "METHODS", "TABLE", "asked", "installed", "options", "without_row"),
        "figures": ("profiles",),
        "measures": (
            "OUTCOMES",
            "area",
            "condensed_ratios",
            "error_powers",
            "frame_of",
            "geometric_mean",
            "numbers_of",
            "of_kind",
            "performance_ratios",
            "profile",
            "ranking",
            "runs_of",
            "shifted_mean",
            "steps",
            "told_by",
            "values_of",
            "warm_ratios",
        ),
        "outcomes": ("FALSE_ALARM", "GAVE_UP", "MODEST", "NO_ANSWER", "RIGHT", "UNTRUE", "outcome"),
        "problems": ("Described", "Instance", "PROBLEMS", "instance"),
        "report": ("FORMS", "left_out", "report_of", "tables_of"),
        "study": ("QUICK", "declared", "keep"),
        "tasks": ("solve_case",),
    },
)
