"""Ready-made problems: of the literature, with exact solutions, and of many blocks."""

from typing import TYPE_CHECKING

from qvi_contact.gallery import benchmarks, exact
from qvi_contact.gallery.benchmarks import *
from qvi_contact.gallery.exact import *

if not TYPE_CHECKING:  # mypy reads lists of strings only
    __all__ = [*benchmarks.__all__, *exact.__all__]
