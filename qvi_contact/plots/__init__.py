"""Pictures of problems and results; they need the extra ``plot`` (matplotlib).

`axes` are axes of matplotlib, in units of length where they show the body; `units` are the names of units in labels.
Functions whose names end in `_figure` return a figure of matplotlib, which `save_figure` writes.

The functions need no screen, keep no state and leave matplotlib's settings unchanged. Colours are safe for colour-blind
readers, and nothing depends on colour alone.
"""

from qvi_contact.plots.body import Drawn, Scales, draw_body
from qvi_contact.plots.figures import draw_mechanism, history_figure, limit_figure, problem_figure, result_figure
from qvi_contact.plots.problem import draw_problem
from qvi_contact.plots.style import save_figure
from qvi_contact.plots.tractions import contact_tractions
from solvers.basics.front import front

__all__ = [
    "Drawn", "Scales", "contact_tractions", "draw_body", "draw_mechanism", "draw_problem", "history_figure",
    "limit_figure", "problem_figure", "result_figure", "save_figure",
]  # fmt: skip

__getattr__ = front(__name__)
