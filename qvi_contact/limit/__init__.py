"""Limit loads: how much of a load contacts and bodies that yield can carry, from both sides.

| module           | contents                                                                      |
|------------------|-------------------------------------------------------------------------------|
| `load_factor`    | `limit_load_factor` and its answer; linear programs where nothing yields      |
| `stresses`       | from below, where bodies yield: stresses in the yield cones                   |
| `flow`           | from above: velocities, with jumps on contacts                                |
| `gap`            | parts of the difference, where to refine                                      |
| `strength_reduction` | the factor of safety on strength                                          |
| `proof`          | proof files in rational numbers                                               |
| `check_proof`    | a script that checks them, by Python's standard library alone                 |
| `yielding`       | strengths as cones on Bernstein coefficients                                  |
| `conic`          | cone programs by Clarabel, and answers made to hold                           |
| `whole_edges`    | contact laws on whole edges as linear rows                                    |
| `carried_forces` | which forces on contacts the stresses of a mesh can have                      |
"""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "linear": ("Relations",),
        "flow": ("BodyMotion", "ContactFlow"),
        "check_proof": ("check",),
        "load_factor": (
            "Collapse",
            "LimitLoad",
            "StrengthReduction",
            "limit_load",
            "limit_load_factor",
            "limit_proof",
            "strength_reduction_factor",
        ),
    },
)
