"""Ready-made problems, with the data of their sources as defaults."""

from typing import Literal

import numpy as np

from qvi_contact.checks import Field, FloatArray
from qvi_contact.conditions import Condition, Contact, Symmetry, Traction
from qvi_contact.errors import InputError
from qvi_contact.exact import ExactState, problem_from_state, uniform
from qvi_contact.material import Material
from qvi_contact.mesh import RectilinearMesh
from qvi_contact.problem import ContactProblem


def compressed_plate(
    friction: Field,
    cells: tuple[int, int] = (2, 2),
    width: float = 1.0,
    height: float = 1.0,
    young: float = 2.09e5,
    poisson: float = 0.3,
    plane: Literal["stress", "strain"] = "stress",
    displacement: float = 1e-3,
    grading: float = 1.0,
) -> ContactProblem:
    """Quarter of a plate compressed between two rough rigid plates: Więckowski (1992), section 5.

    The body is [0, width] × [0, height] with symmetry on x = 0 and y = 0, the side x = width free, and the contact
    "plate" on y = height, pushed down by `displacement`. Without friction the answer is the uniform stress
    σ_yy = −E U/height in plane stress. The default units are MPa and a length of 1.

    Parameters
    ----------
    friction : float or function of (x, y)
        Coefficient of friction μ.
    cells : (int, int)
        Cells along x and y; the paper has (2, 2).
    width, height : float
        Size of the quarter [length].
    young, poisson, plane
        Material data, see `Material`.
    displacement : float
        Displacement U of the quarter's own top [length]; the paper prints it as the relative one.
    grading : float
        Ratio of each cell to the one before it, in both directions: below 1 the cells shrink towards the free corner.

    """
    mesh = RectilinearMesh.rectangle(cells, width, height, grading=grading)
    conditions: list[Condition] = [
        Symmetry("left"),
        Symmetry("bottom"),
        Traction("right", x=0.0, y=0.0),
        Contact("top", friction=friction, gap=-displacement, name="plate"),
    ]
    return ContactProblem(mesh, Material(young, poisson, plane), conditions)


def sliding_block(
    cells: tuple[int, int] = (3, 2),
    width: float = 2.0,
    height: float = 1.0,
    young: float = 1000.0,
    poisson: float = 0.3,
    plane: Literal["stress", "strain"] = "stress",
    friction: float = 0.3,
    pressure: float = 100.0,
    side_stress: float = -20.0,
    translation: float = 0.5,
    grading: float = 1.0,
) -> tuple[ContactProblem, ExactState]:
    """A block that slips on its whole base in a uniform stress state, with the exact answer.

    On [0, width] × [0, height] the stress is σ_xx = q, σ_yy = −p, σ_xy = μp. The base y = 0 is the contact "base" with
    g = w = 0; top and left side carry the tractions of the state; the right side gets its displacement
    u_x = γ y + U₀ + ε_xx (x − width), u_y = ε_yy y, with γ = c33 μp. The base slips by U₀ + ε_xx (x − width), and
    U₀ must be large enough to keep that positive.

    Raises
    ------
    InputError
        If `translation` leaves part of the base without slip.

    """
    material = Material(young, poisson, plane)
    strain = material.compliance @ np.array([side_stress, -pressure, friction * pressure])
    least = max(0.0, float(strain[0]) * width)
    if translation <= least:
        raise InputError("translation", translation, f"give more than {least:g}, or the base does not slip everywhere")

    def displacement(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.stack([strain[2] * y + translation + strain[0] * (x - width), strain[1] * y + 0 * x])

    stress = uniform(material, side_stress, -pressure, friction * pressure).stress
    state = ExactState(stress, displacement)
    mesh = RectilinearMesh.rectangle(cells, width, height, grading=grading)
    sides = {"bottom": "cc", "right": "uu", "top": "tt", "left": "tt"}
    base = Contact("bottom", friction=friction, name="base")
    return problem_from_state(state, mesh, material, sides, (base,)), state
