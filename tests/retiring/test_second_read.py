"""Claims read again by someone else: guarantees, certificates and files against brute force and forged data."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Symmetry, Traction, solve
from qvi_contact.companion import solve_companion
from qvi_contact.export import write_npz
from qvi_contact.files.archive import Archive, digest
from qvi_contact.gallery import compressed_plate
from qvi_contact.verification import verify_file

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # claims about grids, cones on them, and companions on the same cells

STRICT = "strict-direct:clarabel"


def pressed(mesh, **contact):
    """The paper's plate, on another mesh and with another law on its top."""
    plate = compressed_plate(0.0, (4, 4))
    top = Contact("top", **{"friction": 0.0, "gap": -1e-3, "name": "plate", **contact})
    return replace(plate, mesh=mesh, conditions=[*plate.conditions[:3], top])


def quarter(cells=4):
    return RectilinearMesh.rectangle((cells, cells))


class TestGuaranteedUpperBound:
    """`CompanionResult.reasons` is empty only if no admissible stress has more energy."""

    @pytest.mark.parametrize("field", ["cohesion", "shear_limit"])
    def test_bound_that_quadrature_misses(self, field):
        def bump(x, y):
            return np.where((x > 0.81) & (x < 0.815), 2000.0, 0.0) + 0.0 * y

        law = {"cohesion": bump} if field == "cohesion" else {"cohesion": 2000.0, "shear_limit": bump}
        lines = np.array([0, 0.4, 0.7, 0.8, 0.81, 0.815, 0.825, 0.9, 1])
        aligned = RectilinearMesh(lines, np.array([0, 0.3, 0.6, 0.8, 0.9, 0.97, 1.0]))
        lower = -solve(pressed(aligned, **law), inner=STRICT).energies.complementary  # the bump is two constants here
        companion = solve_companion(pressed(quarter(), **law))
        assert companion.energy < lower  # no upper bound, so there has to be a reason
        assert len(companion.reasons) == 1


@pytest.fixture(scope="module")
def arrays(tmp_path_factory):
    """A stored result far from the origin."""
    mesh = quarter(3)
    path = tmp_path_factory.mktemp("far") / "far.npz"
    conditions = [
        Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0),
        Contact("top", friction=0.1, gap=-1e-3, name="plate"),
    ]  # fmt: skip
    far = RectilinearMesh(mesh.x + 1e7, mesh.y)
    write_npz(path, solve(ContactProblem(far, Material(2.09e5, 0.3), conditions)))
    assert verify_file(path).passed
    return Archive(path).arrays


def forged(tmp_path, arrays, **changes):
    entries = {**arrays, **{name: np.asarray(value) for name, value in changes.items()}}
    entries["digest"] = np.array(digest(entries))
    np.savez(tmp_path / "forged.npz", **entries)
    return tmp_path / "forged.npz"
