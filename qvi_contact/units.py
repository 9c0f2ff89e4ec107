"""Public name of `qvi_contact.basics.units`."""

from qvi_contact.basics.units import Units

__all__ = ["Units"]
