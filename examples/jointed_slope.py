"""A jointed rock slope with water in a tension crack: what makes it slide, by both bounds and by hand.

    python examples/jointed_slope.py slope.png moves.png

The bedding dips out of the face. Water in the crack behind the crest pushes. By hand, the weight W above the lowest
bedding plane slides at the thrust W (μ cos β - sin β)/(cos β + μ sin β). Without water the factor of safety is
tan φ/tan β: friction divided by it just holds. The first picture shows the stresses, the second how the blocks move.
"""

import math

import numpy as np
from known import Known, compare, draw_mechanism

import qvi_contact as qc
from qvi_contact.gallery import jointed_slope
from qvi_contact.mechanism import find_mechanism
from qvi_contact.units import Units

FRICTION, DIP, WEIGHT, WATER, CRACK = 0.7, math.radians(30.0), 25.0, 10.0, 4.0  # weights [kN/m³], depth [m]
UNITS = Units(length="m", stress="kPa")

problem = jointed_slope()
mesh = problem.mesh
result = qc.solve(problem)
limit = qc.limit_load_factor(problem, ["water"])
draw_mechanism(problem, limit, UNITS)


def dry_factor(low: float = 1.0, high: float = 2.0) -> float:
    """By how much friction can be divided before a dry slope has a mechanism: bisection."""
    while high - low > 1e-4:
        middle = (low + high) / 2.0
        dry = jointed_slope(4, 1, friction=FRICTION / middle, crack_water=0.0)
        low, high = (middle, high) if find_mechanism(dry) is None else (low, middle)
    return (low + high) / 2.0


x, y = np.array([(0.0, 0.0), (8.0, 8.0), (8.0, 12.0), (6.0, 12.0)]).T  # above the lowest plane, x in m / cot β
weight = WEIGHT / math.tan(DIP) * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0
thrust = WATER * CRACK**2 / 2.0
exact = weight * math.tan(math.atan(FRICTION) - DIP) / thrust
compare(
    [
        Known("thrust of the water [kN/m]", -result.resultant("crack").x, thrust, 1e-9, "γ_w z²/2"),
        Known("factor of the thrust, from below", limit.lower, exact, 1e-6, "W tan(φ - β)/V"),
        Known("factor of the thrust, from above", limit.upper, exact, 1e-9, "W tan(φ - β)/V"),
        Known("factor of safety when dry", dry_factor(), FRICTION / math.tan(DIP), 1e-4, "tan φ/tan β"),
    ],
    result,
    UNITS,
)
