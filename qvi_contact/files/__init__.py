"""Files: problem files and their meshes, archives of results and of load steps."""

from solvers.basics.front import front

__getattr__ = front(__name__)
