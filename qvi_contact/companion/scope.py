"""What the displacement model cannot do yet, said before anything is computed."""

from qvi_contact.errors import InputError
from qvi_contact.problem.problem import ContactProblem

_ONLY_STRESS = "the displacement companion, and the bracket that needs it,"


def check_scope(problem: ContactProblem) -> None:
    """`InputError` for a problem that displacements of this room do not model.

    A fluid in a contact would press on the displacements as a load, which the bounds do not have.
    """
    for contact in problem.contacts:
        if contact.has_fluid:
            remedy = (
                f"{_ONLY_STRESS} do not model a fluid in a contact: leave them out, and judge the result by its "
                "certificate and a finer mesh"
            )
            raise InputError("Contact.pore_pressure", contact.name, remedy)
