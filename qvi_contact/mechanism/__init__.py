"""Claims for the body rather than for a mesh: which loads no stress whatever can carry.

A body of blocks, pressed together by contacts that limit tractions and nothing else, carries every load that its blocks
would carry if they were rigid. So three numbers a block decide: a small linear program, exact on any mesh.

| module      | contents                                             |
|-------------|------------------------------------------------------|
| `bodies`    | blocks, plates driven by force, work of loads; lines |
|             | of contact, and what their laws admit                |
| `mechanism` | proof, and bound of a load factor; linear programs   |
"""

from qvi_contact.mechanism.mechanism import ContactMotion, Mechanism, find_mechanism, upper_bound
from qvi_contact.problem.conditions import RigidMotion
from solvers.basics.front import front

__all__ = ["ContactMotion", "Mechanism", "RigidMotion", "find_mechanism", "upper_bound"]

__getattr__ = front(__name__)
