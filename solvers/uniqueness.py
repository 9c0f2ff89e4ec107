"""Public name of `solvers.certificate.uniqueness`."""

from solvers.certificate.uniqueness import UniquenessBound, uniqueness_bound

__all__ = ["UniquenessBound", "uniqueness_bound"]
