"""A brake pad on a disc that turns: all of its face slips.

    python examples/brake_pad.py brake_pad.png

A piston presses the pad on the disc, which drags it against a pivoted abutment. The whole face slips, so the friction
force is μ times the normal force. The moment of friction moves the centre of pressure towards the side from which the
disc comes. Both follow from statics. The program computes the pressure along the face.
"""

from pathlib import Path

from known import Known, compare

import qvi_contact as qc
from qvi_contact.units import Units

FORCE, FRICTION = 160.0, 0.4  # of the piston [N/mm]
MIDDLE, PIVOT = 40.0, 14.5  # where the piston presses, and height of the abutment's pivot above the disc [mm]
PISTON = 40.0  # its width [mm]

mesh = qc.TriangleMesh.load(Path(__file__).parent / "meshes" / "brake_pad.msh")
problem = qc.ContactProblem(
    mesh,
    qc.Material(young=1000.0, poisson=0.25, plane="strain"),  # the lining [MPa]
    [
        qc.Contact("face", friction=FRICTION, offset=1.0),  # the disc has moved by 1 mm, far more than the pad deforms
        qc.Contact("abutment", friction=0.0, plate=qc.RigidPlate(moment=0.0, pivot=(80.0, PIVOT))),
        qc.Traction("piston", x=0.0, y=-FORCE / PISTON),
        qc.Traction("free", normal=0.0, tangential=0.0),
    ],
    regions=[qc.Region(qc.Material(young=2.1e5, poisson=0.3, plane="strain"), name="plate")],
)
result = qc.solve(problem)

face, abutment = result.contacts["face"], result.contacts["abutment"]
centre = -(face.weights @ (face.x * face.normal_stress)) / face.normal_force
sticking = face.weights[face.state == qc.ContactState.STICK].sum()
compare(
    [
        Known("normal force [N/mm]", face.normal_force, FORCE, 1e-9, "force of the piston"),
        Known("friction force [N/mm]", face.tangential_force, FRICTION * FORCE, 1e-6, "μ N, the whole face slips"),
        Known("length that sticks [mm]", sticking, 0.0, 0.0, "the disc turns"),
        Known("force on the abutment [N/mm]", abutment.normal_force, FRICTION * FORCE, 1e-6, "balance"),
        Known("centre of pressure x [mm]", centre, MIDDLE - FRICTION * PIVOT, 1e-6, "balance of moments"),
    ],
    result,
    Units(length="mm", stress="MPa"),
)
