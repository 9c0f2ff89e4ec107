"""How far bounds, and errors, can be trusted."""

from enum import StrEnum


class Certainty(StrEnum):
    """The text says it."""

    ESTIMATE = "estimate"
    GUARANTEED = "guaranteed"
