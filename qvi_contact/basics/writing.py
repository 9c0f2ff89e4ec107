"""Files that are either there whole or not there at all, and HTML pages that load nothing."""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from qvi_contact.basics.files import check_writable, given_path, identity, replacing, unwritable
from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from jinja2 import Template

__all__ = [
    "check_suffix", "check_writable", "given_path", "identity", "page_template", "replacing", "writable_folder",
    "write_text",
]  # fmt: skip


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def check_suffix(option: str, path: str | Path, suffix: str) -> None:
    """Refuse a file name that does not end in `suffix`."""
    if Path(path).suffix.lower() != suffix:
        raise InputError(option, str(path), f"give a file name that ends in {suffix}")


def writable_folder(path: str | Path, field: str = "output") -> Path:
    """Make the folder if it is missing, and find out before any work is done whether it can be written.

    Raises
    ------
    InputError
        If it cannot, or is a file; about `field`, the option that named it.

    """
    folder = given_path(field, path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileExistsError as error:
        raise InputError(field, str(path), "is a file, not a folder: give another place") from error
    except (OSError, ValueError) as error:  # ValueError: a name no folder can have
        raise unwritable(folder, error, field) from error
    return folder


def page_template(package: str) -> "Template":
    """The template ``page.html`` of a package, which extends ``frame.html`` of this one.

    The frame has the head, the style that pages share and the package's own ``page.css``, and the blocks "title",
    "body" and "script".
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, "."), PackageLoader("qvi_contact.basics", ".")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html")
