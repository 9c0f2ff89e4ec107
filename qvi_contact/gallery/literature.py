"""Ready-made problems, with the data of their sources as defaults."""

from typing import Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, finite_number, positive_number
from qvi_contact.errors import InputError
from qvi_contact.gallery.exact import ExactState, problem_from_state, uniform
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, Contact, Symmetry, Traction
from qvi_contact.problem.material import Material, Plane
from qvi_contact.problem.problem import ContactProblem

SSNV128_DISPLACEMENTS: Final = (
    ("A", 0.0, 2.86e-5),
    ("B", 1.25e-3, 2.72e-5),
    ("C", 5.0e-3, 2.28e-5),
    ("D", 7.5e-3, 1.98e-5),
    ("E", 11.25e-3, 1.5e-5),
)
"""Published answer to `ssnv128`: point, x [m], u_x(x, 0) [m], means over several codes with a tolerance of 5 %.

Point E has two digits in the manual. Refined meshes of this package and of biquadratic displacement elements settle
on 2.860, 2.723, 2.287, 1.981 and 1.541e-5 m: the published value is 2.7 % low at E and within 0.3 % elsewhere.
"""


_BLOCK_SIDES: Final = {"bottom": "cc", "right": "uu", "top": "tt", "left": "tt"}


def compressed_plate(
    friction: Field,
    cells: tuple[int, int] = (2, 2),
    width: float = 1.0,
    height: float = 1.0,
    young: float = 2.09e5,
    poisson: float = 0.3,
    plane: Plane = "stress",
    displacement: float = 1e-3,
    grading: float = 1.0,
) -> ContactProblem:
    """Quarter of a plate compressed between two rough rigid plates: Więckowski (1992), section 5.

    The body is [0, width] × [0, height] with symmetry on x = 0 and y = 0, the side x = width free, and the contact
    "plate" on y = height, pushed down by `displacement`. Without friction the answer is the uniform stress
    σ_yy = −E U/height in plane stress. The default units are MPa and a length of 1.

    Cells are those of `TriangleMesh.rectangle`; the paper, which has rectangles, takes (2, 2). With a `grading` below 1
    they shrink towards the free corner. The `displacement` U is that of the quarter's own top; the paper prints it as
    the relative one.
    """
    mesh = TriangleMesh.rectangle(cells, width, height, grading=grading)
    conditions: list[Condition] = [
        Symmetry("left"),
        Symmetry("bottom"),
        Traction("right", x=0.0, y=0.0),
        Contact("top", friction=friction, gap=-finite_number("displacement", displacement), name="plate"),
    ]
    return ContactProblem(mesh, Material(young, poisson, plane), conditions)


def sliding_block(
    cells: tuple[int, int] = (3, 2), plane: Plane = "stress", translation: float = 0.5, grading: float = 1.0
) -> tuple[ContactProblem, ExactState]:
    """A block that slips on its whole base in a uniform stress state, with the exact answer.

    On [0, 2] × [0, 1] the stress is σ_xx = −20, σ_yy = −p = −100, σ_xy = μp, with μ = 0.3, E = 1000, ν = 0.3. The base
    y = 0 is the contact "base" with g = w = 0; top and left side carry the tractions of the state; the right side gets
    its displacement u_x = γ y + U₀ + ε_xx (x − 2), u_y = ε_yy y, with γ = c33 μp. The base slips by U₀ + ε_xx (x − 2),
    and the `translation` U₀ must be large enough to keep that positive.

    Raises
    ------
    InputError
        If `translation` leaves part of the base without slip.

    """
    width, friction, pressure, side_stress = 2.0, 0.3, 100.0, -20.0
    material = Material(1000.0, 0.3, plane)
    strain = material.compliance @ np.array([side_stress, -pressure, friction * pressure])
    least = max(0.0, float(strain[0]) * width)
    if translation <= least:
        raise InputError("translation", translation, f"give more than {least:g}, or the base does not slip everywhere")

    def displacement(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.stack([strain[2] * y + translation + strain[0] * (x - width), strain[1] * y + 0 * x])

    stress = uniform(material, side_stress, -pressure, friction * pressure).stress
    state = ExactState(stress, displacement)
    mesh = TriangleMesh.rectangle(cells, width, 1.0, grading=grading)
    base = Contact("bottom", friction=friction, name="base")
    return problem_from_state(state, mesh, material, _BLOCK_SIDES, (base,)), state


def ssnv128(cells: tuple[int, int] = (32, 32), friction: Field = 1.0) -> ContactProblem:
    """A square plate pressed against a rigid plane that opens, slips and sticks: Code_Aster's test SSNV128.

    The body is [0, 0.04 m]² in plane strain with E = 1.3e11 Pa, ν = 0.2. A pressure of 5e7 Pa acts on the top and one
    of 15e7 Pa on x = 0; the side x = 0.04 m is a line of symmetry. The base y = 0 is the contact "base" with μ = 1.
    The pressures push the body to the right, friction pulls it back: σ_T < 0, and u_T > 0 where it slips.

    From the left, the base is open for x < 3.28 mm, slips up to 29.84 mm and sticks beyond. Balance gives the normal
    force 2.0e6 N/m; biquadratic displacement elements settle on these zones, a tangential force of −1.40535e6 N/m and
    a pressure of 8.388e7 Pa at x = 0.04 m. The published displacements are in `SSNV128_DISPLACEMENTS`. Without
    friction the stress is uniform and u_x(0) = 4.061538e-5 m.

    Source: Code_Aster, Manuel de validation V6.04.128, "SSNV128 - Plaque avec contact et frottement sur un plan
    rigide"; proposed by GRECO. Small displacements are assumed here. Units: Pa, m.
    """
    mesh = TriangleMesh.rectangle(cells, 0.04, 0.04)
    conditions: list[Condition] = [
        Contact("bottom", friction=friction, name="base"),
        Symmetry("right"),
        Traction("top", x=0.0, y=-5e7),
        Traction("left", x=15e7, y=0.0),
    ]
    return ContactProblem(mesh, Material(1.3e11, 0.2, "strain"), conditions)


def stick_slip_block(
    cells: tuple[int, int] = (4, 3),
    transition: float = 1.0,
    plane: Plane = "stress",
    pressure_drop: float = 0.0,
    shear: float = 30.0,
    slip: float = 0.02,
    rotation: float = 0.0,
    lift: float = 0.0,
    grading: float = 1.0,
) -> tuple[ContactProblem, ExactState]:
    """A block whose curved base sticks for x < x_t and slips beyond, with the exact answer.

    On [0, 2] × [0, 1], with E = 1000, ν = 0.3 and p = 100, the stress function is Φ = −p x²/2 + a x³ y +
    k (x⁴ − 3x²y²)/12, with a = `shear`/12 and k = `pressure_drop`/4, as σ_T is `shear` at x = 2 and the pressure loses
    `pressure_drop` up to there:

        σ_xx = −k x²/2,    σ_yy = −p + 6a x y + k (x² − y²/2),    σ_xy = −3a x² + k x y.

    With the compliance c (see `Material`; c33 = 2 (c11 − c12)), `rotation` c₀ and `lift` d, which move body and
    obstacle together, the displacement is

        u_x = c12 (3a x² y − p x) − c11 a y³ + k ((2 c12 − c11) x³ − 3 c12 x y²)/6 + c₀ y
        u_y = c11 (3a x y² − p y) − (c33 + c12) a x³ + k ((2 c11 − c12) x² y/2 − c11 y³/6) − c₀ x + d.

    The base y = 0 with outward normal −y is the contact "base". There σ_N = −p + k x², σ_T = −σ_xy = 3a x² ≥ 0, and in
    plane stress with k = 0 u_T = ν p x/E, u_y = −(2+ν) a x³/E − c₀ x + d. The obstacle touches everywhere, g = u_N =
    −u_y, and friction and offset are

        μ = 3a max(x, x_t)²/(p − k x²),    w = u_T + A max(x − x_t, 0)²,

    so that left of the `transition` x_t the bound 3a x_t² exceeds σ_T and nothing slips, and right of it σ_T is at the
    bound and u_T − w = −A (x − x_t)², opposite in sign to σ_T, and −`slip` at x = 2. Bound and slip are continuous in
    x_t and leave it with different rates, so that every other point is clearly in one state. The side x = 0 is free,
    the top carries the tractions of the state, the right side its displacement.

    Elements of degree 4 contain Φ. As friction varies, the law holds at Gauss points; they integrate the data, so that
    the discrete solution is the exact stress on every mesh, even if x_t is inside an edge. Only the slip, which is
    projected on polynomials, depends on the mesh.
    """
    width, pressure = 2.0, 100.0
    for name, value in (("shear", shear), ("slip", slip)):
        positive_number(name, value)
    if not 0.0 < finite_number("transition", transition) < width:
        raise InputError("transition", transition, f"give a number between 0 and the width {width:g}")
    if finite_number("pressure_drop", pressure_drop) >= pressure:
        raise InputError("pressure_drop", pressure_drop, f"give less than the pressure {pressure:g}")
    material, p, k, a = Material(1000.0, 0.3, plane), pressure, pressure_drop / width**2, shear / (3 * width**2)
    (c11, c12, _), c33 = material.compliance[0], material.compliance[2, 2]

    def stress(x: FloatArray, y: FloatArray) -> FloatArray:
        xx = -k * x**2 / 2 + 0 * y
        yy = -p + 6 * a * x * y + k * (x**2 - y**2 / 2)
        return np.stack([xx, yy, -3 * a * x**2 + k * x * y])

    def displacement(x: FloatArray, y: FloatArray) -> FloatArray:
        along = c12 * (3 * a * x**2 * y - p * x) - c11 * a * y**3 + rotation * y
        across = c11 * (3 * a * x * y**2 - p * y) - (c33 + c12) * a * x**3 - rotation * x + lift
        along = along + k * ((2 * c12 - c11) * x**3 - 3 * c12 * x * y**2) / 6
        return np.stack([along, across + k * ((2 * c11 - c12) * x**2 * y / 2 - c11 * y**3 / 6)])

    def bound_over_pressure(x: FloatArray, y: FloatArray) -> FloatArray:
        bound = shear * (np.maximum(x, transition) / width) ** 2
        return np.asarray(bound / (pressure - pressure_drop * (x / width) ** 2) + 0 * y)

    def offset(x: FloatArray, y: FloatArray) -> FloatArray:
        beyond = np.maximum(x - transition, 0.0) / (width - transition)
        return np.asarray(displacement(x, y)[0] + slip * beyond**2)

    state, mesh = ExactState(stress, displacement), TriangleMesh.rectangle(cells, width, 1.0, grading=grading)
    base = Contact("bottom", bound_over_pressure, lambda x, y: -displacement(x, y)[1], offset, "base")
    return problem_from_state(state, mesh, material, _BLOCK_SIDES, (base,)), state
