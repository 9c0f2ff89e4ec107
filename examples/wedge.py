"""A block pushed up a slope: the push that makes it slide, for four coefficients of friction.

    python examples/wedge.py wedge.png

The slope rises by tan α = 0.1. A block under the weight G slides up when the horizontal push F reaches
F/G = (tan α + μ)/(1 − μ tan α). This is test CGS-4 of NAFEMS. Equilibrium alone decides, so a method whose stresses
are in equilibrium has the exact answer on any mesh. The picture shows the block at 99 % of its limit, for μ = 0.3.
"""

from pathlib import Path

from known import Known, compare

import qvi_contact as qc
from qvi_contact.units import Units

WEIGHT, SLOPE = 1.0, 0.1  # [MN/m], rise over run
TOP, LEFT = 4.0, 2.0  # lengths of these sides [m]

mesh = qc.TriangleMesh.load(Path(__file__).parent / "meshes" / "wedge.msh")


def pushed(friction: float, push: float) -> qc.ContactProblem:
    """The block under a force `push` [MN/m]."""
    return qc.ContactProblem(
        mesh,
        qc.Material(young=1e4, poisson=0.2, plane="strain"),  # [MPa]
        [
            qc.Contact("slope", friction=friction),
            qc.Traction("top", x=0.0, y=-WEIGHT / TOP),
            qc.Traction("left", x=push / LEFT, y=0.0, name="push"),
            qc.Traction("right", x=0.0, y=0.0),
        ],
    )


rows = []
for friction in (0.0, 0.1, 0.2, 0.3):
    exact = (SLOPE + friction) / (1.0 - friction * SLOPE)
    limit = qc.limit_load_factor(pushed(friction, push=WEIGHT), ["push"])
    rows.append(Known(f"F/G, from below, μ = {friction}", limit.lower, exact, 1e-8, "(tan α + μ)/(1 - μ tan α)"))
    rows.append(Known(f"F/G, from above, μ = {friction}", limit.upper, exact, 1e-9, "the same"))

compare(rows, qc.solve(pushed(0.3, push=0.99 * exact * WEIGHT)), Units(length="m", stress="MPa"))
