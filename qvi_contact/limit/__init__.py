"""Limit loads: how much of a load contacts and bodies that yield can carry, from both sides.

| module        | contents                                                                       |
|---------------|--------------------------------------------------------------------------------|
| `load_factor` | `limit_load_factor`, `strength_reduction_factor` and their answers             |
| `stresses`    | from below: contact laws on whole edges, and stresses in the yield cones       |
| `flow`        | from above: velocities, with jumps on contacts; where to refine                |
| `split`       | polynomials on split triangles, and C1 functions in rational numbers           |
| `conic`       | cone programs by Clarabel, and answers corrected to be feasible                |
| `proof`       | `limit_proof`: files that prove both sides                                     |
| `check_proof` | a script that checks them, by Python's standard library alone                  |
"""

from solvers.basics.front import front

__getattr__ = front(__name__)
