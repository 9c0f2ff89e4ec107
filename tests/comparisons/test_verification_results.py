"""Pictures of results in the manual: what was computed lies on what is known, and axes have their units."""

import numpy as np
import pytest

from comparisons.verification.chapters import benchmarks, examples, limits
from comparisons.verification.exhibits import EXHIBITS, conservation, figure
from comparisons.verification.proof import Proof
from comparisons.verification.row import absolute, crash
from comparisons.verification.study import as_record

PAIRS = {
    "rings": ([(0, 0)], 4e-3),
    "press-fit": ([(0, 0), (1, 1)], 0.02),
    "cylinder-in-bore": ([(0, 0)], 0.03),
    "sliding-corner": ([(0, 0), (1, 1)], 0.02),
    "cylinder-on-block": ([(0, 0)], 0.06),
    "half-discs": ([(0, 0), (1, 1)], 0.09),
    "slip-torque": ([(0, 0)], 1e-4),
    "wedge": ([(0, 0), (1, 0)], 1e-5),
}
"""Which of our curves lies on which known one, and how far off it may be over the largest, on coarse meshes."""


def departure(ours, known, logarithmic):
    """Largest distance of our points from the line through known ones, over its largest value."""
    power = np.log if logarithmic else np.asarray
    inside = (ours.x >= known.x.min()) & (ours.x <= known.x.max()) & (ours.x < 0.98 * known.x.max())
    line = np.interp(power(ours.x[inside]), power(known.x), power(known.y))
    expected = np.exp(line) if logarithmic else line
    scale = expected if logarithmic else np.abs(known.y).max()
    return float(np.abs((ours.y[inside] - expected) / scale).max())


@pytest.mark.parametrize("name", PAIRS)
def test_what_was_computed_lies_on_what_is_known(name):
    graph, (pairs, tolerance) = EXHIBITS[name].graph(True), PAIRS[name]
    for ours, known in pairs:
        assert departure(graph.ours[ours], graph.known[known], graph.logarithmic) < tolerance
    assert graph.x.endswith("]")
    assert graph.y.endswith("]")


def test_every_benchmark_has_both_pictures():
    """But for the conservation of forces, which is about the others."""
    own = {*benchmarks.PROBLEMS, "wedge", "oblique-block", "examples/gravity_dam"} - {"conservation"}
    assert own == set(EXHIBITS)
    assert own <= {*benchmarks.PROBLEMS, *limits.PROBLEMS, *examples.PROBLEMS}


def test_a_picture_is_narrow_and_tells_curves_by_more_than_colour():
    drawn = figure(EXHIBITS["wedge"].graph(True))
    assert drawn.get_size_inches()[0] * 96.0 * 0.85 <= 348.0  # of 390 pixels, less margins and frame
    lines = drawn.axes[0].get_lines()
    assert len({(line.get_marker(), line.get_linestyle()) for line in lines}) == len(lines) == 3


def test_balance_is_drawn_of_the_rows():
    """Rounding far to the left of errors; without rows nothing breaks."""
    proof = Proof(passed=True, text="by hand")
    rows = [
        absolute(f"dam, {model}: the same", value, 0.0, 1.0, "equilibrium", proof)
        for model, value in (("stresses", 1e-16), ("displacements", 1e-3))
    ]
    for chosen, places in ((rows, [[1e-16], [1e-3]]), ([crash("conservation", "no")], [[], []])):
        problem = {"name": "conservation", "rows": [as_record(row) for row in chosen]}
        lines = conservation({"chapters": [{"problems": [problem]}]}).axes[0].get_lines()
        assert [line.get_xdata().tolist() if len(line.get_xdata()) else [] for line in lines] == places
