"""A steel cylinder pressed on an aluminium block: Hertz' half-width and peak pressure.

    python examples/cylinder_on_block.py cylinder_on_block.png

Test R0094-1 of NAFEMS with a hundredth of its force, so that strains stay small. By symmetry the right half is enough.
The two bodies are one mesh with a joint between them, which is given the gap that the cylinder leaves beside the axis.
Hertz takes the bodies for half planes; at a/R = 0.012 that is true to about 1e-4.
"""

import math
from pathlib import Path

import numpy as np
from known import Known, compare

import qvi_contact as qc
from qvi_contact.units import Units

RADIUS, FORCE = 50.0, 350.0  # [mm], [N/mm]
STEEL = qc.Material(young=2.1e5, poisson=0.3, plane="strain")  # [MPa]
BLOCK = qc.Material(young=7e4, poisson=0.3, plane="strain")

mesh = qc.TriangleMesh.load(Path(__file__).parent / "meshes" / "cylinder_on_block.msh")
mesh = mesh.with_arc("cylinder", (0.0, math.sqrt(RADIUS**2 - 1.5**2)), RADIUS)  # the file has chords
problem = qc.ContactProblem(
    mesh,
    BLOCK,
    [
        qc.Contact("contact", friction=0.0, gap=lambda x, _: RADIUS - np.sqrt(RADIUS**2 - x**2)),
        qc.Traction("load", x=0.0, y=-FORCE / (2.0 * RADIUS)),  # spread over the flat side of the half cylinder
        qc.Traction("cylinder", normal=0.0, tangential=0.0),
        *(qc.Traction(free, x=0.0, y=0.0) for free in ("top", "side")),
        *(qc.Symmetry(side) for side in ("axis", "bottom")),
    ],
    regions=[qc.Region(STEEL, name="steel")],
)
result = qc.solve(problem)

modulus = 1.0 / sum((1.0 - body.poisson**2) / body.young for body in (STEEL, BLOCK))
width = math.sqrt(4.0 * FORCE * RADIUS / (math.pi * modulus))
peak = 2.0 * FORCE / (math.pi * width)

line = result.contacts["contact"]
pressure = -line.normal_stress
loaded = pressure > 0.3 * pressure.max()  # p² = p₀² − (p₀/a)² x²
slope, square = np.polyfit(line.x[loaded] ** 2, pressure[loaded] ** 2, 1)
compare(
    [
        Known("force on the right half [N/mm]", line.normal_force, FORCE / 2.0, 1e-9, "F/2"),
        Known("peak pressure [MPa]", math.sqrt(square), peak, 2e-4, "Hertz, 2F/(π a)"),
        Known("half-width of the contact [mm]", math.sqrt(-square / slope), width, 2e-4, "Hertz, √(4FR/(π E*))"),
    ],
    result,
    Units(length="mm", stress="MPa"),
)
