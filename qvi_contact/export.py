"""Public name of what writes results, `qvi_contact.files.export`."""

from qvi_contact.files.export import (
    airy_units,
    field_arrays,
    summary,
    write_contacts_vtu,
    write_json,
    write_npz,
    write_vtu,
)

__all__ = ["airy_units", "field_arrays", "summary", "write_contacts_vtu", "write_json", "write_npz", "write_vtu"]
