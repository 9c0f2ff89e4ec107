"""What the displacement model cannot do yet, said before anything is computed."""

import numpy as np

from qvi_contact.errors import InputError
from qvi_contact.problem.problem import ContactProblem

_ONLY_STRESS = "the displacement companion, and the bracket that needs it,"


def check_scope(problem: ContactProblem) -> None:
    """`InputError` for a problem that displacements of this room do not model.

    An incompressible material has no stiffness: displacements would have to keep every area.
    """
    if any(problem.materials[number].incompressible for number in np.unique(problem.cell_materials)):
        remedy = (
            f"{_ONLY_STRESS} have no displacements for incompressible materials: take a number below 0.5, or leave "
            "them out, and judge the result by its certificate and a finer mesh"
        )
        raise InputError("Material.poisson", 0.5, remedy)
