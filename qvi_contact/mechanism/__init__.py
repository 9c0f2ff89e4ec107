"""Proofs for the body, not for a mesh: which loads no stress at all can carry.

Elastic blocks in contact carry every load that rigid blocks would carry, as only the contacts limit tractions. So the
rigid motions decide, three numbers per block. A small linear program finds them, whatever the mesh.

| module      | contents                                               |
|-------------|--------------------------------------------------------|
| `bodies`    | blocks, plates driven by force, work of loads; lines   |
|             | of contact, and the motions that their laws admit      |
| `mechanism` | proofs, bounds of load factors; the linear programs    |
"""

from qvi_contact.mechanism.mechanism import ContactMotion, Mechanism, find_mechanism, upper_bound
from qvi_contact.problem.conditions import RigidMotion
from solvers.basics.front import front

__all__ = ["ContactMotion", "Mechanism", "RigidMotion", "find_mechanism", "upper_bound"]

__getattr__ = front(__name__)
