"""Results with large friction say that there may be other solutions; others do not."""

from functools import partial

import pytest

from qvi_contact import solve
from qvi_contact.gallery import compressed_plate, masonry_wall, ssnv128
from solvers import Status

ORDINARY = {
    "plate": partial(compressed_plate, 0.2, (2, 2)),
    "wall": partial(masonry_wall, 3, 3, ()),
    "SSNV128": partial(ssnv128, (4, 4)),
    "frictionless": partial(compressed_plate, 0.0, (2, 2)),
}


def suspects(result):
    """Remarks that lead to other solutions."""
    return [remark for remark in result.remarks if "several solutions" in remark]


@pytest.mark.parametrize("friction", [3.0, 5.0])
def test_large_friction_leads_to_the_search_for_others(friction):
    found = suspects(solve(ssnv128((4, 4), friction)))
    assert len(found) == 1
    assert "other_solutions" in found[0]


@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_friction_is_no_reason(name):
    result = solve(ORDINARY[name]())
    assert result.status is Status.SOLVED
    assert not suspects(result)
