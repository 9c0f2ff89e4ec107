"""From (D2) back to mechanics: solve, result, contact line, stress, work, sampling, histories and limit loads."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "carried_forces": ("Relations",),
        "contact_line": ("ContactLine", "ContactState", "STATE_TOLERANCE", "contact_states"),
        "contact_path": ("ContactPath", "leads_one_way", "turning_senses"),
        "history": ("loop_area", "solve_history"),
        "limit": ("LimitLoad", "limit_load", "limit_load_factor"),
        "loose": ("motions_in_words",),
        "result": ("ContactResult",),
        "sampling": ("cell_factors", "sample_body", "von_mises"),
        "solver": ("posed", "solve"),
        "stress": ("cell_weights", "stress_at", "stress_in_cells"),
    },
)
