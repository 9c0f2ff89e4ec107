"""Public name of `solvers.certificate.measures`."""

from solvers.certificate.measures import MEASURES, Measure

__all__ = ["MEASURES", "Measure"]
