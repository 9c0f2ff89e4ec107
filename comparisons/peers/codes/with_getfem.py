"""GetFEM: the plate by its own contact brick.

Displacements Q_p, contact stresses one degree below, GetFEM's own contact brick and Newton. The brick is
`add_integral_contact_with_rigid_obstacle_brick`, option 1: the augmented Lagrangian of Alart and Curnier in its
non-symmetric form, with Coulomb friction. The augmentation parameter is Young's modulus, r = E, Newton's method stops
at 10⁻⁸, integration is of order 2p. P is the integral of the contact stress. Source: GetFEM's documentation, "Small
sliding contact with friction bricks".

Nothing of this project is imported here, so that another Python than the project's may run it (see `process`). GetFEM
is loaded by what builds a problem, not before.
"""

from collections.abc import Callable
from importlib import import_module
from typing import Any, Final

TOLERANCE: Final = 1e-8
"""Of GetFEM's Newton method for the plate."""

ACCEPTED: Final = 1e-8
"""Largest residual of a solution of the plate: norm of all equations' residuals over the force."""

_NEWTON_STEPS: Final = 100
_LEFT, _BOTTOM, _TOP = 1, 2, 3  # regions


def plate(case: dict[str, Any], degree: int = 2) -> Callable[[], dict[str, Any]]:
    """What solves the plate of a case (see `study.plate`)."""
    return BrickPlate(case, degree).solve


class BrickPlate:
    """A model; `solve` starts from zero each time."""

    def __init__(self, case: dict[str, Any], degree: int) -> None:
        gf: Any = import_module("getfem")
        np: Any = import_module("numpy")
        self._gf, self._np, self._degree = gf, np, degree
        mesh = gf.Mesh("cartesian", *(np.array(line) for line in case["lines"]))
        self._name_sides(mesh)
        displacements = gf.MeshFem(mesh, 2)
        displacements.set_classical_fem(degree)
        _require_all_nodes(displacements, case, degree)
        # exact for the elasticity; more points change P by 1e-4 and settle on the same value
        self._integration = gf.MeshIm(mesh, 2 * degree)
        self._model = gf.Model("real")
        self._model.add_fem_variable("u", displacements)
        self._add_elasticity(case)
        self._kept = [mesh, displacements, *self._add_contact(mesh, case)]  # a model does not keep what it refers to

    def solve(self) -> dict[str, Any]:
        """Solve from zero: P/2, unknowns, Newton steps, residual, status."""
        model = self._model
        model.set_variable("u", 0.0 * model.variable("u"))
        model.set_variable("traction", 0.0 * model.variable("traction"))
        iterations, _ = model.solve("max_res", TOLERANCE, "max_iter", _NEWTON_STEPS)
        half_force = -float(self._gf.asm_generic(self._integration, 0, "traction(2)", _TOP, model))
        model.assembly("build_rhs")
        residual = float(self._np.linalg.norm(model.rhs())) / abs(half_force)
        solved = residual <= ACCEPTED  # NaN is not
        return {
            "status": "solved" if solved else "not converged",
            "message": "" if solved else f"residual {residual:.1e} after {int(iterations)} Newton steps",
            "half_force": half_force,
            "unknowns": int(model.nbdof()),
            "iterations": int(iterations),
            "residual": residual,
            "version": str(getattr(self._gf, "__version__", "unknown")),
        }

    def _name_sides(self, mesh: Any) -> None:
        faces = mesh.outer_faces()
        normals = mesh.normal_of_faces(faces)
        for region, chosen in ((_LEFT, normals[0] < -0.5), (_BOTTOM, normals[1] < -0.5), (_TOP, normals[1] > 0.5)):
            mesh.set_region(region, faces[:, chosen])

    def _add_elasticity(self, case: dict[str, Any]) -> None:
        """Plane stress, with both lines of symmetry."""
        young, poisson = case["young"], case["poisson"]
        self._model.add_initialized_data("lame", [young * poisson / (1.0 - poisson**2)])
        self._model.add_initialized_data("shear", [young / (2.0 * (1.0 + poisson))])
        self._model.add_isotropic_linearized_elasticity_brick(self._integration, "u", "lame", "shear")
        for side in (_LEFT, _BOTTOM):
            self._model.add_normal_Dirichlet_condition_with_multipliers(self._integration, "u", self._degree, side)

    def _add_contact(self, mesh: Any, case: dict[str, Any]) -> tuple[Any, ...]:
        """The rigid plate y ≥ height − U, as signed distance; returns what has to live as long as the model."""
        tractions, distances = self._gf.MeshFem(mesh, 2), self._gf.MeshFem(mesh, 1)
        tractions.set_classical_fem(self._degree - 1)
        distances.set_classical_fem(1)
        on_top = self._gf.MeshFem("partial", tractions, tractions.dof_on_region(_TOP))
        level = case["lines"][1][-1] - case["displacement"]
        self._model.add_fem_variable("traction", on_top)
        self._model.add_initialized_fem_data("distance", distances, distances.eval(f"{level!r} - y"))
        self._model.add_initialized_data("r", [case["young"]])
        self._model.add_initialized_data("friction", [case["friction"]])
        self._model.add_integral_contact_with_rigid_obstacle_brick(
            self._integration, "u", "traction", "distance", "r", "friction", _TOP, 1
        )
        return tractions, distances, on_top


class MergedNodesError(ValueError):
    """GetFEM takes nodes for one that are not."""


def _require_all_nodes(displacements: Any, case: dict[str, Any], degree: int) -> None:
    """Raise `MergedNodesError` unless each node has its own displacements.

    GetFEM tells nodes apart by distances relative to the cell: in cells some hundred times longer than wide it merges
    neighbours, and the mesh is not conforming any more.
    """
    columns, rows = (len(line) - 1 for line in case["lines"])
    wanted, found = 2 * (degree * columns + 1) * (degree * rows + 1), int(displacements.nbdof())
    if found != wanted:
        raise MergedNodesError(f"GetFEM merges nodes of cells this long: {found} of {wanted} displacements are left")
