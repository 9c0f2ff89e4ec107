"""Two half discs pressed together and sheared: the middle of the contact sticks, its rim slips (Cattaneo, Mindlin).

    python examples/half_discs.py half_discs.png

Both are of one material, so shear does not change the pressure of Hertz. The discs are one mesh with a joint, which is
given the gap that they leave beside the axis. The formulas take the discs for half planes. At a/R = 0.085 that is true
to about 1 %, so the numbers do not agree better on finer meshes.
"""

import math
from pathlib import Path

import numpy as np
from known import Known, compare

import qvi_contact as qc
from qvi_contact.units import Units

RADIUS, FRICTION = 8.0, 0.2  # [mm]
HEIGHT = math.sqrt(RADIUS**2 - 1.2**2)  # of the upper disc's centre: the joint is 1.2 long on either side [mm]
NORMAL, SHEAR = 10.0, 0.93616  # forces for a unit of thickness [N/mm]
DISC = qc.Material(young=200.0, poisson=0.3, plane="strain")  # [MPa]

mesh = qc.TriangleMesh.load(Path(__file__).parent / "meshes" / "half_discs.msh")
mesh = mesh.with_arc("upper disc", (0.0, HEIGHT), RADIUS).with_arc("lower disc", (0.0, -HEIGHT), RADIUS)
problem = qc.ContactProblem(
    mesh,
    DISC,
    [
        qc.Contact("contact", friction=FRICTION, gap=lambda x, _: 2.0 * (RADIUS - np.sqrt(RADIUS**2 - x**2))),
        qc.Contact("top", friction=0.0, law="tied", plate=qc.RigidPlate(force_x=SHEAR, force_y=-NORMAL)),
        qc.Displacement("bottom", x=0.0, y=0.0),
        qc.Traction("upper disc", normal=0.0, tangential=0.0),
        qc.Traction("lower disc", normal=0.0, tangential=0.0),
    ],
)
result = qc.solve(problem)

modulus = DISC.young / (2.0 * (1.0 - DISC.poisson**2))
width = math.sqrt(4.0 * NORMAL * (RADIUS / 2.0) / (math.pi * modulus))
peak = 2.0 * NORMAL / (math.pi * width)
sticking = width * math.sqrt(1.0 - SHEAR / (FRICTION * NORMAL))

line = result.contacts["contact"]
pressure, shear = -line.normal_stress, np.abs(line.tangential_stress)
loaded = pressure > 0.3 * pressure.max()  # p² = p₀² − (p₀/a)² x²
slope, square = np.polyfit(line.x[loaded] ** 2, pressure[loaded] ** 2, 1)
outermost = np.abs(line.x[line.state == qc.ContactState.STICK]).max()
middle = shear[np.argmin(np.abs(line.x))]
compare(
    [
        Known("shear force [N/mm]", line.tangential_force, SHEAR, 1e-9, "balance"),
        Known("peak pressure [MPa]", math.sqrt(square), peak, 0.01, "Hertz, 2P/(π a)"),
        Known("half-width of the contact [mm]", math.sqrt(-square / slope), width, 0.01, "Hertz"),
        Known("half-width that sticks [mm]", outermost, sticking, 0.05, "a √(1 - Q/(μP)), to one point"),
        Known("shear in the middle [MPa]", middle, FRICTION * peak * (1.0 - sticking / width), 0.03, "μ p₀ (1 - c/a)"),
    ],
    result,
    Units(length="mm", stress="MPa"),
)
