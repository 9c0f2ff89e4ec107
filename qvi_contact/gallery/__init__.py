"""Ready-made problems: of the literature, with exact solutions, and of many blocks."""

from qvi_contact.gallery.benchmarks import *
from qvi_contact.gallery.exact import *
