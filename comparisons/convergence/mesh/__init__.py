"""Convergence in the mesh: degrees of triangles on equal, graded and adaptive meshes, and the paper's element."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "problems": ("PROBLEMS", "exponent"),
        "report": ("cost", "fitted_order", "meshes_of", "report", "values_of"),
        "study": ("PAPER", "TOLERANCE", "run", "study"),
    },
)
