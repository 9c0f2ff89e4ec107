"""An angle bolted to a rough wall: forces, centre of pressure, and the load at which it slides down.

    python examples/bolted_angle.py bolted_angle.png

The bolt presses the upright leg against the wall. The load on the other leg pulls it down and away from the wall
above. Statics gives the forces on the wall and the centre of the pressure. The angle slides when friction reaches its
bound, at F = μB. The program computes which part of the leg leaves the wall, and the stress in the fillet.
"""

from pathlib import Path

from known import Known, compare

import qvi_contact as qc
from qvi_contact.units import Units

BOLT, LOAD, FRICTION = 400.0, 100.0, 0.4  # forces for a unit of width [N/mm]
HEAD, SHELF = 20.0, 40.0  # widths of the bolt's head and of the load [mm]
HEIGHT, ARM = 60.0, 80.0  # of the bolt above the lower edge, of the load from the wall [mm]

mesh = qc.TriangleMesh.load(Path(__file__).parent / "meshes" / "bolted_angle.msh")
mesh = mesh.with_arc("fillet", (20.0, 20.0), 10.0)
problem = qc.ContactProblem(
    mesh,
    qc.Material(young=2.1e5, poisson=0.3, plane="strain"),  # steel [MPa]
    [
        qc.Contact("wall", friction=FRICTION),
        qc.Traction("bolt", x=-BOLT / HEAD, y=0.0),
        qc.Traction("load", x=0.0, y=-LOAD / SHELF),
        qc.Traction("free", normal=0.0, tangential=0.0),
        qc.Traction("fillet", normal=0.0, tangential=0.0),
    ],
)
result = qc.solve(problem)
limit = qc.limit_load_factor(problem, ["load"])

wall = result.contacts["wall"]
centre = -(wall.weights @ (wall.y * wall.normal_stress)) / wall.normal_force
compare(
    [
        Known("normal force [N/mm]", wall.normal_force, BOLT, 1e-9, "force of the bolt"),
        Known("friction force [N/mm]", wall.tangential_force, LOAD, 1e-9, "load"),
        Known("centre of pressure y [mm]", centre, HEIGHT - ARM * LOAD / BOLT, 1e-8, "balance of moments"),
        Known("load factor, from below", limit.lower, FRICTION * BOLT / LOAD, 1e-6, "μB/F"),
        Known("load factor, from above", limit.upper, FRICTION * BOLT / LOAD, 1e-9, "μB/F"),
    ],
    result,
    Units(length="mm", stress="MPa"),
)
