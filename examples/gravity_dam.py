"""A gravity dam on rock, with uplift in the joint under its base: factor of safety against sliding.

    python examples/gravity_dam.py gravity_dam.png

The water pushes the dam downstream. Water in the joint lifts the dam. Friction holds it back. By hand, with the weight
W, the uplift U, and the thrust H of the water, the factor of safety against sliding is μ (W − U)/H. The program
computes a lower and an upper bound of this factor, and the stresses. The file gravity_dam.toml is the same problem.
"""

import sys
from pathlib import Path

import qvi_contact as qc
from qvi_contact.units import Units

CONCRETE, WATER = 0.024, 0.00981  # weights [MN/m³]
BASE, CREST, HEIGHT, LEVEL = 24.0, 5.0, 30.0, 28.0  # of the dam, and depth of the water [m]
FRICTION = 0.75

mesh = qc.TriangleMesh.load(Path(__file__).parent / "meshes" / "gravity_dam.msh")  # named parts of the boundary
problem = qc.ContactProblem(
    mesh,
    qc.Material(young=2.5e4, poisson=0.2, plane="strain"),  # concrete and rock [MPa]
    [
        qc.Contact("base", friction=FRICTION, pore_pressure=lambda x, _: WATER * LEVEL * (1.0 - x / BASE)),
        qc.Traction("upstream", normal=lambda _, y: -WATER * (LEVEL - y), tangential=0.0, name="thrust"),
        qc.Traction("reservoir floor", normal=-WATER * LEVEL, tangential=0.0),
        *(qc.Traction(free, x=0.0, y=0.0) for free in ("freeboard", "crest", "downstream", "rock downstream")),
        qc.Symmetry("rock left"),
        qc.Symmetry("rock right"),
        qc.Displacement("underground", x=0.0, y=0.0),
    ],
    body_potential=lambda _, y: CONCRETE * y.clip(min=0.0),  # the rock has settled under its own weight before
)
result = qc.solve(problem)
limit = qc.limit_load_factor(problem, ["thrust"])

weight, uplift, thrust = CONCRETE * (BASE + CREST) / 2.0 * HEIGHT, WATER * LEVEL * BASE / 2.0, WATER * LEVEL**2 / 2.0
joint = result.contacts["base"]
print(result.message)
print(f"carried by the rock: {joint.effective_normal_force:.6f} MN/m, by hand W - U = {weight - uplift:.6f}")
print(f"held by friction: {joint.tangential_force:.6f} MN/m, by hand H = {thrust:.6f}")
print(f"factor of safety against sliding: from {limit.lower:.6f} to {limit.upper:.6f}, "
      f"by hand μ (W - U)/H = {FRICTION * (weight - uplift) / thrust:.6f}")  # fmt: skip

if len(sys.argv) > 1:
    from qvi_contact.plots import result_figure, save_figure

    save_figure(sys.argv[1], result_figure(result, Units(length="m", stress="MPa"), "Gravity dam"))
