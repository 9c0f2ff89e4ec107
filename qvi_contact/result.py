"""Public name of `qvi_contact.solution.result`."""

from qvi_contact.solution.result import ContactResult, Energies, PlateMotion, Resultant

__all__ = ["ContactResult", "Energies", "PlateMotion", "Resultant"]
