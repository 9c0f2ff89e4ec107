"""From (D2) back to mechanics: solve, result, contact line, stress, work, sampling and histories."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "contact_line": ("ContactLine", "ContactState", "STATE_TOLERANCE", "contact_states"),
        "contact_path": ("ContactPath", "leads_one_way", "turning_senses"),
        "history": ("loop_area", "solve_history"),
        "result": ("ContactResult",),
        "sampling": ("cell_factors", "sample_body", "von_mises"),
        "solver": ("discretized", "solve"),
        "stress": ("stress_at", "stress_in_cells"),
        "undetermined": ("UndeterminedMotion", "motions_in_words", "undetermined_motions"),
    },
)
