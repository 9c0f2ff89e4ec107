"""A masonry wall with a door and a window in the wind: states of its joints, and the wind that it carries.

    python examples/masonry_wall.py wall.png moves.png

Blocks lie dry on one another. The program computes which joints open, slip and stick, and a lower and an upper bound of
the wind. The first picture shows the stresses, the second how the blocks move when the wind is too strong. Without
openings the limit of low walls is known by hand: at the width w they slide at the wind μ γ w, on every bed.
"""

from known import Known, compare, draw_mechanism

import qvi_contact as qc
from qvi_contact.gallery import masonry_wall
from qvi_contact.units import Units

FRICTION, WEIGHT, WIND, WIDTH, HEIGHT = 0.6, 20.0, 2.0, 3.0, 2.0  # weight [kN/m³], wind [kPa], sizes [m]
OPENINGS = 0.5 * 1.0 + 0.75 * 0.75  # area of door and window [m²]
UNITS = Units(length="m", stress="kPa")

problem = masonry_wall(friction=FRICTION, weight=WEIGHT, wind=WIND)
mesh = problem.mesh
result = qc.solve(problem)
limit = qc.limit_load_factor(problem, ["wind"])
plain = qc.limit_load_factor(masonry_wall(4, 6, (), friction=FRICTION, weight=WEIGHT, wind=WIND), ["wind"])

for name, line in result.contacts.items():
    print(f"{name}: " + ", ".join(f"{share:.0%} {state}" for state, share in line.shares.items()))
print(f"limit of the wind: from {limit.lower * WIND:.2f} to {limit.upper * WIND:.2f} kPa")
draw_mechanism(problem, limit, UNITS)

ground, exact = result.contacts["ground"], FRICTION * WEIGHT * WIDTH / WIND
compare(
    [
        Known("weight on the ground [kN/m]", ground.normal_force, WEIGHT * (WIDTH * HEIGHT - OPENINGS), 1e-9, "γ A"),
        Known("thrust on the ground [kN/m]", ground.tangential_force, -WIND * HEIGHT, 1e-9, "p h"),
        Known("four courses, closed, from below", plain.lower, exact, 1e-6, "μ γ w/p"),
        Known("four courses, closed, from above", plain.upper, exact, 1e-9, "μ γ w/p"),
    ],
    result,
    UNITS,
)
