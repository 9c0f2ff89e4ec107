"""GetFEM: the plate by its own contact brick, the loaded pin in its language of forms.

**The plate**, displacements Q_p, contact stresses one degree below, GetFEM's own contact brick and Newton. The brick is
`add_integral_contact_with_rigid_obstacle_brick`, option 1: the augmented Lagrangian of Alart and Curnier in its
non-symmetric form, with Coulomb friction. The augmentation parameter is Young's modulus, r = E, Newton's method stops
at 10⁻⁸, integration is of order 2p. P is the integral of the contact stress. Source: GetFEM's documentation, "Small
sliding contact with friction bricks".

**The pin**, displacements P_p on triangles with edges of degree 2, tractions one degree below. The equations are those
of `with_ngsolve`, by GetFEM's Newton method. Both bodies are one mesh; each has displacements of its own, whose traces
along the hole are the same from either side of it. Stresses in MPa, lengths in mm.

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


TOLERANCE_PIN: Final = 1e-11
"""Of GetFEM's Newton method for the pin; equations of the contact are lengths, and small beside forces."""

ACCEPTED_PIN: Final = 1e-11
"""Largest residual of a solution of the pin."""

_NEWTON_STEPS_PIN: Final = 50
_FIRST: Final = 0.1  # mm that the pin is moved by before the first step, so that it touches
_STIFF: Final = 10.0  # ρ over E of the sheet by the radius
_SHEET, _PIN, _HOLE, _LOAD, _SHEET_AXIS, _PIN_AXIS, _WALL = range(1, 8)  # regions


def pin(case: dict[str, Any], degree: int = 2) -> Callable[[], dict[str, Any]]:
    """What solves the pin of a case (see `comparisons.peers.pin.plain_pin`)."""
    return PinModel(case, degree).solve


class PinModel:
    """A model; `solve` starts from zero each time."""

    def __init__(self, case: dict[str, Any], degree: int) -> None:
        self._gf: Any = import_module("getfem")
        self._np: Any = import_module("numpy")
        self._case, self._degree = case, degree
        self._mesh = self._made()
        self._integration = self._gf.MeshIm(self._mesh, self._gf.Integ("IM_TRIANGLE(10)"))
        self._model = self._gf.Model("real")
        self._parts: list[Any] = []  # a model does not keep what it refers to
        self._sheet = self._add_displacements("sheet", _SHEET, {_WALL: (0, 1), _SHEET_AXIS: (1,)})
        self._pin = self._add_displacements("pin", _PIN, {_PIN_AXIS: (1,), _LOAD: (1,)})
        for name in ("pressure", "shear"):
            whole = self._gf.MeshFem(self._mesh, 1)
            whole.set_classical_fem(degree - 1)
            self._add_field(name, whole, whole.basic_dof_on_region(_HOLE))
        self._add_bodies()
        self._add_contact()

    def solve(self) -> dict[str, Any]:
        """Solve from zero: what `comparisons.peers.pin.MEASURED` names, unknowns, steps, residual, status."""
        model, np = self._model, self._np
        for name in ("sheet", "pin", "pressure", "shear"):
            model.set_variable(name, 0.0 * model.variable(name))
        model.set_variable("pin", np.where(self._pin[2] == 0, _FIRST, 0.0))
        iterations, _ = model.solve("max_res", TOLERANCE_PIN, "max_iter", _NEWTON_STEPS_PIN)
        model.assembly("build_rhs")
        residual = float(np.linalg.norm(model.rhs())) / self._case["force"]
        solved = residual <= ACCEPTED_PIN  # NaN is not
        return {
            "status": "solved" if solved else "not converged",
            "message": "" if solved else f"residual {residual:.1e} after {int(iterations)} Newton steps",
            **self._measured(),
            "unknowns": int(model.nbdof()),
            "iterations": int(iterations),
            "residual": residual,
            "version": str(getattr(self._gf, "__version__", "unknown")),
        }

    def _measured(self) -> dict[str, float]:
        """As `with_ngsolve` does it."""
        x, y, component = self._sheet
        place = int(self._np.hypot(x - self._case["radius"], y + component).argmin())
        return {
            "moved": float(self._model.variable("sheet")[place]),
            "normal": -self._integral("pressure", _HOLE),
            "shear": self._integral("shear", _HOLE),
            "carried": -self._integral("(pressure*X(1)-shear*X(2))/Norm(X)", _HOLE),
        }

    def _integral(self, expression: str, region: int) -> float:
        return float(self._gf.asm_generic(self._integration, 0, expression, region, self._model))

    def _made(self) -> Any:
        """The mesh with edges of degree 2, those on arcs bent, and its regions."""
        gf, np, case = self._gf, self._np, self._case
        vertices, cells = np.asarray(case["vertices"]), np.asarray(case["cells"])
        radii = {tuple(sorted(pair)): radius for name, radius in case["arcs"].items() for pair in case["sides"][name]}

        def middle(a: int, b: int) -> Any:
            found = (vertices[a] + vertices[b]) / 2.0
            radius = radii.get((min(a, b), max(a, b)))
            return found if radius is None else found * (radius / np.hypot(*found))

        mesh, shape = gf.Mesh("empty", 2), gf.GeoTrans("GT_PK(2,2)")
        for a, b, c in cells.tolist():
            points = [vertices[a], middle(a, b), vertices[b], middle(a, c), middle(b, c), vertices[c]]
            mesh.add_convex(shape, np.array(points).T)
        inside = np.asarray(case["pin"])
        faces = {True: np.flatnonzero(inside), False: np.flatnonzero(~inside)}
        for region, body in ((_SHEET, False), (_PIN, True)):
            mesh.set_region(region, np.vstack([faces[body], np.full(len(faces[body]), -1)]))
        named = ((_HOLE, "hole", True), (_LOAD, "load", True), (_SHEET_AXIS, "axis", False), (_PIN_AXIS, "axis", True),
                 (_WALL, "wall", False))  # fmt: skip
        for region, name, body in named:
            mesh.set_region(region, self._faces(cells, case["sides"][name], faces[body]))
        return mesh

    def _faces(self, cells: Any, pairs: Any, allowed: Any) -> Any:
        """Cells and their faces at these edges; face k is opposite to vertex k."""
        wanted = {tuple(sorted(pair)) for pair in pairs}
        found = [
            (cell, opposite)
            for cell in allowed.tolist()
            for opposite in range(3)
            if tuple(sorted(int(cells[cell, k]) for k in range(3) if k != opposite)) in wanted
        ]
        return self._np.array(found).T

    def _add_displacements(self, name: str, region: int, held: dict[int, tuple[int, ...]]) -> Any:
        """Displacements of a body without those that sides hold; places and components (3, n) of what is left."""
        np, whole = self._np, self._gf.MeshFem(self._mesh, 2)
        whole.set_classical_fem(self._degree)
        free = np.unique(whole.basic_dof_on_region(region))
        for side, components in held.items():
            there = whole.basic_dof_on_region(side)
            free = np.setdiff1d(free, there[np.isin(there % 2, components)])
        self._add_field(name, whole, free)
        return np.vstack([whole.basic_dof_nodes()[:, free], free % 2])

    def _add_field(self, name: str, whole: Any, chosen: Any) -> None:
        self._parts += [whole, self._gf.MeshFem("partial", whole, self._np.unique(chosen))]
        self._model.add_fem_variable(name, self._parts[-1])

    def _add_bodies(self) -> None:
        """Elasticity in plane strain, and the load."""
        model, case, poisson = self._model, self._case, self._case["poisson"]
        for body, region in (("sheet", _SHEET), ("pin", _PIN)):
            young = case["young"][body]
            lame = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
            model.add_initialized_data(f"lame_{body}", [lame])
            model.add_initialized_data(f"shear_{body}", [young / (2.0 * (1.0 + poisson))])
            stress = f"lame_{body}*Trace(Grad_{body})*Id(2)+2*shear_{body}*Sym(Grad_{body})"
            model.add_linear_term(self._integration, f"({stress}):Grad_Test_{body}", region)
        model.add_linear_term(self._integration, f"{-case['traction']!r}*Test_pin(1)", _LOAD)

    def _add_contact(self) -> None:
        model, case = self._model, self._case
        model.add_initialized_data("rho", [_STIFF * case["young"]["sheet"] / case["radius"]])
        model.add_initialized_data("friction", [case["friction"]])
        normal, along = ("X(1)/Norm(X)", "X(2)/Norm(X)"), ("(-X(2)/Norm(X))", "X(1)/Norm(X)")

        def apart(direction: tuple[str, str], test: str = "") -> str:
            parts = (f"({test}pin({k})-{test}sheet({k}))*{each}" for k, each in enumerate(direction, start=1))
            return f"({'+'.join(parts)})"

        pushed = f"neg_part(pressure-rho*{apart(normal)})"  # ≥ 0
        tried, bound = f"(shear-rho*{apart(along)})", f"friction*{pushed}"
        rubbed = f"({tried}-pos_part({tried}-{bound})+neg_part({tried}+{bound}))"  # cut off at ± the bound
        form = f"-pressure*{apart(normal, 'Test_')}-shear*{apart(along, 'Test_')}"
        form += f"-((pressure+{pushed})*Test_pressure+(shear-{rubbed})*Test_shear)/rho"
        model.add_nonlinear_term(self._integration, form, _HOLE)
