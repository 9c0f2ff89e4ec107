"""Initial strain: what temperature, shrinkage and prestress strain a body without stress, or stress without strain.

With α ΔT of `Material.expansion` and the temperature, the shrinkage s and the prestress σ_p, a free piece of material
strains by e = α ΔT − s in all directions of space, and the law of the body is

    c σ = ε(u) − ε⁰,      σ = C ε(u) + σ⁰,      σ⁰ = −C ε⁰ = σ_p − E e/(1 − ν) I      in plane stress,
                                                     = σ_p − E e/(1 − 2ν) I     in plane strain,

where ε⁰ = (1 + ν) e I, as the body is held along z. σ⁰ is the stress of a body that is held everywhere. It is what the
package computes with: the energies are

    J*(σ) = ½ ∫ cσ:σ dx + ∫ ε⁰:σ dx − …,      J(v) = ½ ∫ (ε(v) − ε⁰) : C : (ε(v) − ε⁰) dx − …
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate
from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from qvi_contact.problem.problem import ContactProblem


def is_strained(problem: ContactProblem) -> bool:
    """Whether a part of the body has an initial strain, be it constant."""
    return any(
        material.prestress is not None
        or _acts(material.shrinkage)
        or (material.expansion != 0.0 and _acts(_temperature(problem, number)))
        for number, material in enumerate(problem.materials)
    )


def varies(problem: ContactProblem) -> bool:
    """Whether a part of it is a function of position."""
    fields = [problem.temperature, *(region.temperature for region in problem.regions)]
    for material in problem.materials:
        fields += [material.shrinkage, *(material.prestress or ())]
    return any(callable(field) for field in fields)


def stress_at_rest(problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """σ⁰ = −C ε⁰ (xx, yy, xy) at points of cells (k,), from coordinates (k, …) [length] to (k, …, 3) [stress].

    Raises
    ------
    InputError
        If a field gives bad values.

    """
    found, numbers = np.zeros((*np.shape(x), 3)), problem.cell_materials[cells]
    for number in np.unique(numbers).tolist():
        material, here = problem.materials[number], numbers == number
        place = x[here], y[here]
        swelling = _swelling(problem, number, *place)
        if swelling.any():
            nu = material.poisson
            modulus = material.young / (1.0 - (2.0 * nu if material.plane == "strain" else nu))
            found[here, ..., :2] -= modulus * swelling[..., None]
        for component, field in enumerate(material.prestress or ()):
            found[here, ..., component] += evaluate("Material.prestress", field, *place)
    return found


def stress_along_z(
    problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray, stress: FloatArray
) -> FloatArray:
    """σ_zz (k, …) of stresses (k, …, 3) at such points: 0 in plane stress, else ν (σ_xx + σ_yy) + what is held along z.

    That is −E e, and −ν times the prestress in the plane, which has no part along z.
    """
    found, numbers = np.zeros(np.shape(x)), problem.cell_materials[cells]
    for number in np.unique(numbers).tolist():
        material, here = problem.materials[number], numbers == number
        if material.plane == "strain":
            swelling = _swelling(problem, number, x[here], y[here])
            found[here] = material.poisson * stress[here, ..., :2].sum(axis=-1) - material.young * swelling
            for field in (material.prestress or ())[:2]:
                found[here] -= material.poisson * evaluate("Material.prestress", field, x[here], y[here])
    return found


def check_compressible(problem: ContactProblem) -> None:
    """`InputError` for an initial strain of an incompressible material, which no stress can take back."""
    if is_strained(problem) and any(problem.materials[n].incompressible for n in np.unique(problem.cell_materials)):
        remedy = "temperature, shrinkage and prestress need a compressible material: take a number below 0.5"
        raise InputError("Material.poisson", 0.5, remedy)


def _temperature(problem: ContactProblem, number: int) -> Field:
    """That of the part with this number in `ContactProblem.materials`."""
    own = problem.regions[number - 1].temperature if number else None
    return problem.temperature if own is None else own


def _acts(field: Field) -> bool:
    return callable(field) or field != 0.0


def _swelling(problem: ContactProblem, number: int, x: FloatArray, y: FloatArray) -> FloatArray:
    """The strain e = α ΔT − s of a free piece of the part with this number."""
    material, temperature = problem.materials[number], _temperature(problem, number)
    found = -evaluate("Material.shrinkage", material.shrinkage, x, y)
    if material.expansion != 0.0 and _acts(temperature):
        found += material.expansion * evaluate("ContactProblem.temperature", temperature, x, y)
    return found
