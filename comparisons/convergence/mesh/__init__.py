"""Convergence in the mesh: forces, energies, contact tractions, and the ends of contact and stick zones."""

from solvers.basics.front import front

__getattr__ = front(
    __name__,
    {
        "corner": ("exponent",),
        "errors": ("Overview", "meshes_of"),
        "measures": ("spacing", "values_of"),
        "orders": ("advantage", "cost", "fitted_order", "orders_of", "successive_orders"),
        "problems": ("Expected", "FORCE", "PROBLEMS", "TRACTIONS", "towards"),
        "report": ("failures", "tables_of"),
        "study": ("TOLERANCE", "run"),
        "tractions": ("Tractions", "difference", "size"),
        "zones": ("LINE", "POINT", "ROOT", "zone_ends"),
    },
)
