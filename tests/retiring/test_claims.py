"""How claimed and computed numbers are compared, and tractions with those prescribed."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Traction, solve
from qvi_contact.verification.claims import (
    compared,
    recompute,
    rediscretized,
)

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # claims about grid lines


def test_coordinates_count_from_the_corner_of_the_body():
    mesh = RectilinearMesh.rectangle((3, 2))
    free = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=-1.0)]
    for origin in (0.0, -1e6):
        body = RectilinearMesh(mesh.x + origin, mesh.y)
        result = solve(ContactProblem(body, Material(1e3, 0.3), [Contact("bottom", 0.5), *free]))
        found = recompute(result, rediscretized(result), 1e-8)
        for name in ("x_lines", "gauss_x", "bottom.x"):
            right = found.fields[name]
            assert dict(compared(found.fields | {name: np.nextafter(right, np.inf)}, found))[name] < 1e-8
            assert dict(compared(found.fields | {name: right + 1e-6}, found))[name] > 1e-7
