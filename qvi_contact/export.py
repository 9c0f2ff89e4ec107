"""Public name of `qvi_contact.files.export`, which writes results."""

from qvi_contact.files.export import (
    field_arrays,
    summary,
    write_collapse_vtu,
    write_contacts_vtu,
    write_json,
    write_npz,
    write_vtu,
)

__all__ = [
    "field_arrays", "summary", "write_collapse_vtu", "write_contacts_vtu", "write_json", "write_npz", "write_vtu",
]  # fmt: skip
