"""From (D2) back to mechanics: solve, result, contact line, stresses and tractions, sweeps and histories."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "contact_line": (
            "ContactLine",
            "ContactPath",
            "ContactState",
            "STATE_TOLERANCE",
            "contact_states",
            "leads_one_way",
            "turning_senses",
        ),
        "history": ("loop_area", "solve_history"),
        "remarks": ("UndeterminedMotion", "motions_in_words", "undetermined_motions"),
        "result": ("ContactResult",),
        "solver": ("discretized", "solve"),
        "stress": ("sample_body", "stress_at", "stress_component", "stress_in_cells", "von_mises"),
    },
)
