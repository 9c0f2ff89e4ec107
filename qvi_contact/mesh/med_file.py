"""Files of MED, which are HDF5: the groups that make a mesh, copied for meshio after a look at all that they claim.

Links to other places and datasets whose values lie in other files are refused. Fields do not reach meshio.
"""

from pathlib import Path
from typing import Any, Final

from qvi_contact.errors import InputError
from solvers.basics.types import load

_NEEDED: Final = ("ENS_MAA", "FAS")
_MOST_OBJECTS: Final = 100_000
_DEEPEST: Final = 20
"""Groups inside each other; MED needs 6, and a group may lie inside itself."""


def copy_needed(path: Path, copy: Path, largest: int) -> None:
    """Copy meshes and their families, of at most `largest` bytes unfolded.

    Raises
    ------
    ImportError
        If h5py is missing.
    InputError
        If the file refers to others, or holds more than the limit.
    ValueError
        If it is broken, or claims more than it holds.

    """
    h5py = load("h5py")
    with h5py.File(path, "r") as given:
        _check(h5py, str(path), given, largest)
        with h5py.File(copy, "w") as kept:
            for name in _NEEDED:
                if name in given:
                    given.copy(name, kept)


def _check(h5py: Any, path: str, given: Any, largest: int) -> None:
    """Look at every object on every way to it, as meshio reads what has several names several times."""
    total, items, claimed, count = 0, 0, 0, 0
    places = [(given, name, 1) for name in given if name in _NEEDED]
    while places:
        group, name, depth = places.pop()
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise InputError("mesh", path, f"holds a link {name!r} to another place: save the mesh as one file")
        item, count = group[name], count + 1
        if isinstance(item, h5py.Group):
            places += [(item, below, depth + 1) for below in item]
        elif isinstance(item, h5py.Dataset):
            if item.external or item.is_virtual:
                raise InputError("mesh", path, f"keeps {name!r} in another file: save the mesh as one file")
            if item.dtype.hasobject:
                raise ValueError(f"{name!r} has entries without a size")
            total, items = total + int(item.nbytes), items + int(item.size or 0)
        if total > largest:
            raise InputError("mesh", path, f"unfolds to more than {largest} bytes, the limit: give a coarser mesh")
        if count > _MOST_OBJECTS or depth > _DEEPEST:
            remedy = f"holds more than {_MOST_OBJECTS} objects, or {_DEEPEST} inside each other: give a simpler mesh"
            raise InputError("mesh", path, remedy)
        claimed = max(claimed, int(item.attrs.get("NBR", 0)))
    if claimed > items:
        raise ValueError(f"it claims {claimed} entries where it holds {items}")
