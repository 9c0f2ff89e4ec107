"""Several solutions of one discrete problem, and which of them displacements on the same mesh confirm.

For large friction the discrete problem may have several certified solutions. They are compared with the displacement
model on the same mesh, under the same friction law, by the energy of what the strains differ, see `other_solutions`.
The one with the smallest difference comes first. Displacements may have several solutions too: the comparison is an
indication of the branch, and no proof.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.parts import CellFields, bulk
from qvi_contact.companion.result import CompanionResult
from qvi_contact.companion.solver import solve_companion
from qvi_contact.errors import InputError
from qvi_contact.solution.result import ContactResult
from solvers import Status
from solvers.solution import WHAT_TO_DO
from solvers.solve import followed_solutions, traction_difference


@dataclass(frozen=True, eq=False)
class Branches:
    """Certified solutions of one discrete problem.

    Attributes
    ----------
    results : tuple of ContactResult
        All that were found, the one nearest to the displacement model first. If there are several, a remark of each
        says so.
    distances : tuple of float
        d of each, see `other_solutions`; NaN without a displacement model.
    companion : CompanionResult or None
        The displacement model; None if there is nothing to choose from, or it cannot represent the problem.
    message : str
        What was found, one or more sentences.

    """

    results: tuple[ContactResult, ...]
    distances: tuple[float, ...]
    companion: CompanionResult | None
    message: str

    @property
    def preferred(self) -> ContactResult:
        """The result nearest to the displacement model; the one given, if there is none to compare with."""
        return self.results[0]


def other_solutions(result: ContactResult, *, time_limit: float | None = None) -> Branches:
    """Look for other solutions of the discrete problem of a result, and prefer the one that displacements confirm.

    Friction is followed to its value from 0.4, 0.6, 0.85 and 1.3 times that, in 3 to 20 steps. That takes about as
    long as ten to thirty solves, and up to a hundred where the steps do not start near each other. Only certified
    states count. If there are several, the displacement model is solved on the same mesh, and the results are sorted by

        d² = ½ ∫ (cσ − ε(v)) : C : (cσ − ε(v)) dx / U,

    U the largest strain energy of the solutions. A v that is a rigid motion confirms one without stress.

    That no other solution was found does not prove that there is none.

    Parameters
    ----------
    result : ContactResult
        Solved.
    time_limit : float, optional
        Seconds for following the friction.

    Returns
    -------
    Branches
        At least with the result given.

    Raises
    ------
    InputError
        If the result is not solved, or belongs to a step of a history.

    """
    if not isinstance(result, ContactResult) or result.status is not Status.SOLVED:
        raise InputError("result", result, "give a result whose status is solved")
    known = result.discretization
    if any(rows.slip.any() for rows in known.contacts):
        remedy = "give the result of one solve, with the earlier slip in `offset`"
        raise InputError("result", "a step of a history, after earlier slip", remedy)
    found = followed_solutions(result.solution, time_limit=time_limit)
    if len(found) == 1:
        return Branches((result,), (np.nan,), None, "No other solution was found by following the friction.")
    results = [ContactResult(result.discretization, solution) for solution in found]
    companion, unknown = None, "No displacement model on this mesh confirms one of them"
    try:
        model = solve_companion(result.problem)
        companion = model if model.status is Status.SOLVED else None
        unknown = f"{unknown}: {model.message}"
    except InputError as error:
        unknown = f"{unknown}: {error}."
    distances, largest = np.full(len(results), np.nan), max(each.energies.strain for each in results)
    for i, each in enumerate(results if companion is not None else ()):
        assert companion is not None
        fields = CellFields.of(each.discretization, each.dofs, companion.degree)
        strain: FloatArray = companion.cell_strain(*fields.t[:, -2:].T)
        distances[i] = np.sqrt(bulk(fields, each.problem.compliances, strain).sum() / largest)
    order = np.argsort(distances, kind="stable")  # as they are, without a companion
    results, distances = [results[i] for i in order], distances[order]
    message = f"{_several(results)} {unknown}"
    if companion is not None:
        shares = ", ".join(f"{100.0 * distance:.3g} %" for distance in distances)
        message = (
            f"{_several(results)} Their strains differ from those of the displacement model on the same mesh by "
            f"{shares} of the largest, in the energy norm."
        )
    told = []
    for i, each in enumerate(results):  # in place of what its own solve had suspected
        place = f" This one is {'the' if i == 0 else 'not the'} nearest." if companion is not None else ""
        solution = replace(each.solution, remarks=(f"{message}{place} {WHAT_TO_DO}",))
        told.append(ContactResult(result.discretization, solution))
    return Branches(tuple(told), tuple(distances.tolist()), companion, message)


def _several(results: list[ContactResult]) -> str:
    """How many solutions there are, and how far their tractions and forces differ."""
    tractions = max(traction_difference(one.solution, other.solution) for one, other in combinations(results, 2))
    ranges = []
    for name in results[0].contacts:
        forces = [result.contacts[name].tangential_force for result in results]
        ranges.append(f"{min(forces):.5g} to {max(forces):.5g} [stress × length] on {name!r}")
    return (
        f"The discrete problem has several solutions: {len(results)} certified ones were found. Their contact "
        f"tractions differ by up to {100.0 * tractions:.2g} % of the largest. The tangential force is "
        f"{' and '.join(ranges)}."
    )
