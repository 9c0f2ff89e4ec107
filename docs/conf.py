"""How the site is built: ``python -m sphinx -W --keep-going -n -b html docs <folder>``, see CONTRIBUTING.md."""

import sys
from pathlib import Path

import qvi_contact

sys.path[:0] = [str(Path(__file__).parent / "_ext")]

project = "qvi_contact"
author = "the authors of qvi_contact"
version = release = qvi_contact.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_click",
    "docstrings",
    "repository",
]
exclude_patterns = ["_ext"]
root_doc = "index"
language = "en"

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
highlight_language = "text"  # indented blocks are formulas and output

html_theme = "furo"
html_title = "qvi_contact"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_theme_options: dict[str, list[str]] = {"top_of_page_buttons": []}
pygments_style = "friendly"
smartquotes = False  # two hyphens are an option, not a dash

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
_ALIASES = ["Field", "Law", "LawOn", "Plane", "Quantity"]  # of qvi_contact.types
autodoc_type_aliases = {name: name for name in _ALIASES}
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 80

nitpicky = True
nitpick_ignore_regex = [
    # types of other libraries, whose pages are not read: nothing is loaded from the network
    (r"py:.*", r"(numpy|np|scipy|matplotlib|pandas|click|collections|dataclasses|pathlib|typing|types|enum)(\..*)?"),
    (
        r"py:.*",
        r"(Any|Array|ArrayLike|FloatArray|IntArray|Axes|Console|DataFrame|Series|PolyCollection|TriMesh|Figure|IO|Module|NDArray|Protocol|Self)",
    ),
    (r"py:.*", r"(str|int|float|bool|None|object|tuple|list|dict|Path|Mapping|Sequence|Callable|Iterable|Iterator)"),
    (r"py:.*", "|".join(_ALIASES)),  # in a table of api/problem.md
    # parts that nobody outside needs
    (r"py:class", r"qvi_contact\.(units\.Rounding|mesh\.curves\.MeshParts|plots\.style\.Labels)"),
    (r"py:class", r"(ContactRows|EdgeRule|Key|Name|Parameter|PlateRows|Root|Scales|Side|Spot|StressSpace|Supports)"),
    (r"py:class", r"qvi_contact\.(discretization|element|basics\.schema|files\.problem_file)\.(\w+\.)?\w+"),
    (
        r"py:class",
        r"qvi_contact\.(problem\.problem\.Prescribed|problem\.conditions\.Pin|problem\.material\.YieldCone|solution\.contact_line\.ContactPath)",
    ),
    (r"py:class", r"qvi_contact\.companion\.((body|elasticity|space)\.\w+|model\.CompanionState)"),
    (
        r"py:class",
        r"qvi_contact\.(bracket\.(norms\.Stopped|share\.Body)|mesh\.(edges|topology)\.\w+)",
    ),
    (r"py:class", r"solvers\.inequality\.(body|contact|problem)\.\w+"),
    (
        r"py:class",
        r"solvers\.(factorisation\.\w+\.(MultifrontalLU|RefactorisedByPardiso)|solution\.Attempt|basics\.types\.Kept)",
    ),
]
