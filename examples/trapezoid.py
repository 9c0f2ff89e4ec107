"""A trapezoid pressed on a rough plane: its stiffness with an error, and between bounds.

    python examples/trapezoid.py trapezoid.png

The plane is rough enough to hold the whole base. `refine` bisects triangles, beginning with 24, until the error is small
enough. Stresses and displacements on the same mesh bound the force from both sides, under Coulomb's law itself. A displacement code (NGSolve, degree 12, mesh graded to the corners) gives 14.0483793 for the same force.
"""

from pathlib import Path

from known import Known, compare

import qvi_contact as qc
from qvi_contact.units import Units

KNOWN = 14.0483793417
TARGET = 1e-5

mesh = qc.TriangleMesh.load(Path(__file__).parent / "meshes" / "trapezoid.msh")
problem = qc.ContactProblem(
    mesh,
    qc.Material(young=1e4, poisson=0.2, plane="strain"),  # [MPa]
    [
        qc.Contact("base", friction=0.8, gap=-1e-3),  # the plane is pushed up by 1 mm
        qc.Displacement("top", x=0.0, y=0.0),
        *(qc.Traction(free, x=0.0, y=0.0) for free in ("left", "right")),
    ],
)
finer = qc.refine(problem, target=TARGET, quantity="base.normal_force")
print(finer.message)

result = finer.result
bounds = result.bracket.forces["base.normal_force"]
print(f"{bounds.lower:.7f} <= P <= {bounds.upper:.7f}, {result.bracket.certainty}")
sticking = (result.contacts["base"].state == qc.ContactState.STICK).mean()
compare(
    [
        Known("share of the base that sticks", sticking, 1.0, 0.0, "rough enough"),
        Known(
            "NGSolve's P is between the bounds",
            float(bounds.lower <= KNOWN <= bounds.upper),
            1.0,
            0.0,
            "they are bounds",
        ),
        Known("P [MN/m]", finer.value, KNOWN, TARGET, "NGSolve"),
    ],
    result,
    Units(length="m", stress="MPa"),
)
