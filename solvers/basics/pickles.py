"""What is pickled of objects that remember what they have computed."""

from dataclasses import fields
from typing import Any


class Stated:
    """A dataclass of which pickles and deep copies hold the fields alone.

    What was computed from them, such as a factorisation inside a library's memory, is computed again when it is needed.
    """

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]  # see above
