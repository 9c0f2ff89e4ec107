"""Pictures of problems and results, drawn on axes the caller gives; needs the extra ``plot`` (matplotlib).

`axes` are those of matplotlib, in units of length where they show the body; `units` are the names of units in labels.
What ends in `_figure` returns a figure of matplotlib, which `save_figure` writes.

Nothing here needs a screen, keeps state or changes matplotlib's settings. Colours are safe for colour-blind readers,
and nothing depends on colour alone.
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
