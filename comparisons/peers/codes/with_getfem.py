"""GetFEM: the plate by its own contact brick.

Displacements Q_p, contact stresses one degree below, GetFEM's own contact brick and Newton. The brick is
`add_integral_contact_with_rigid_obstacle_brick`, option 1: the augmented Lagrangian of Alart and Curnier in its
non-symmetric form, with Coulomb friction. The augmentation parameter is Young's modulus, r = E, Newton's method stops
at 10⁻⁸, integration is of order 2p. P is the integral of the contact stress. Source: GetFEM's documentation, "Small
sliding contact with friction bricks".

Nothing of this project is imported here, so that a Python without this project can run it (see `process`). GetFEM is
imported when a problem is built.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

TOLERANCE: Final = 1e-8
"""Tolerance of GetFEM's Newton method."""

ACCEPTED: Final = 1e-8
"""Largest residual of a solution: norm of all equations' residuals over the force."""

_NEWTON_STEPS: Final = 100
_LEFT, _BOTTOM, _TOP = 1, 2, 3  # regions


class MergedNodesError(ValueError):
    """GetFEM merges nodes that are different."""


def plate(case: dict[str, Any], degree: int = 2) -> Callable[[], dict[str, Any]]:
    """A function that solves the plate of a case (see `study.plate`), from zero at each call."""
    gf: Any = import_module("getfem")
    np: Any = import_module("numpy")
    mesh = gf.Mesh("cartesian", *(np.array(line) for line in case["lines"]))
    faces = mesh.outer_faces()
    normals = mesh.normal_of_faces(faces)
    for region, chosen in ((_LEFT, normals[0] < -0.5), (_BOTTOM, normals[1] < -0.5), (_TOP, normals[1] > 0.5)):
        mesh.set_region(region, faces[:, chosen])
    displacements = gf.MeshFem(mesh, 2)
    displacements.set_classical_fem(degree)
    # GetFEM compares distances of nodes with the size of the cell: in cells some hundred times longer than wide it
    # merges neighbours, and the mesh is no longer conforming
    columns, rows = (len(line) - 1 for line in case["lines"])
    wanted, found = 2 * (degree * columns + 1) * (degree * rows + 1), int(displacements.nbdof())
    if found != wanted:
        raise MergedNodesError(f"GetFEM merges nodes of cells this long: {found} of {wanted} displacements are left")
    # exact for the elasticity; more points change P by 1e-4, but converge to the same value
    integration, model = gf.MeshIm(mesh, 2 * degree), gf.Model("real")
    model.add_fem_variable("u", displacements)
    # plane stress, with both lines of symmetry
    young, poisson = case["young"], case["poisson"]
    model.add_initialized_data("lame", [young * poisson / (1.0 - poisson**2)])
    model.add_initialized_data("shear", [young / (2.0 * (1.0 + poisson))])
    model.add_isotropic_linearized_elasticity_brick(integration, "u", "lame", "shear")
    for side in (_LEFT, _BOTTOM):
        model.add_normal_Dirichlet_condition_with_multipliers(integration, "u", degree, side)
    # the rigid plate y ≥ height − U, as signed distance
    tractions, distances = gf.MeshFem(mesh, 2), gf.MeshFem(mesh, 1)
    tractions.set_classical_fem(degree - 1)
    distances.set_classical_fem(1)
    on_top = gf.MeshFem("partial", tractions, tractions.dof_on_region(_TOP))
    level = case["lines"][1][-1] - case["displacement"]
    model.add_fem_variable("traction", on_top)
    model.add_initialized_fem_data("distance", distances, distances.eval(f"{level!r} - y"))
    model.add_initialized_data("r", [young])
    model.add_initialized_data("friction", [case["friction"]])
    model.add_integral_contact_with_rigid_obstacle_brick(
        integration, "u", "traction", "distance", "r", "friction", _TOP, 1
    )
    kept = mesh, displacements, tractions, distances, on_top  # the model holds no references to these

    def solve() -> dict[str, Any]:
        assert kept
        model.set_variable("u", 0.0 * model.variable("u"))
        model.set_variable("traction", 0.0 * model.variable("traction"))
        iterations, _ = model.solve("max_res", TOLERANCE, "max_iter", _NEWTON_STEPS)
        half_force = -float(gf.asm_generic(integration, 0, "traction(2)", _TOP, model))
        model.assembly("build_rhs")
        residual = float(np.linalg.norm(model.rhs())) / abs(half_force)
        solved = residual <= ACCEPTED  # NaN is not
        return {
            "status": "solved" if solved else "not converged",
            "message": "" if solved else f"residual {residual:.1e} after {int(iterations)} Newton steps",
            "half_force": half_force, "unknowns": int(model.nbdof()), "iterations": int(iterations),
            "residual": residual, "version": str(getattr(gf, "__version__", "unknown")),
        }  # fmt: skip

    return solve
