"""Public name of the exact states of `qvi_contact.gallery`."""

from qvi_contact.gallery.exact import ExactState, cantilever, gravity_column, problem_from_state, pure_bending, uniform

__all__ = ["ExactState", "cantilever", "gravity_column", "problem_from_state", "pure_bending", "uniform"]
