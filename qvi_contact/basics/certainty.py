"""How far bounds, and errors, can be trusted."""

from enum import StrEnum


class Certainty(StrEnum):
    """The text says it.

    That all of a contact sticks on a mesh does not prove that it sticks at all points of the exact solution: corners
    may slip on finer meshes.
    """

    ESTIMATE = "estimate"
    IF_STICKING = "guaranteed if all of the contact sticks"
    GUARANTEED = "guaranteed"
