"""Local friction problems in the HDF5 layout of FCLIB, the Frictional Contact Library.

    /fclib_local/spacedim             2
    /fclib_local/W, V, R              a matrix each; V and R only with equations
        m, n, nzmax, nz               rows, columns, entries; −1 compressed columns, −2 compressed rows, ≥ 0 triplets
        p, i, x                       pointers (triplets: columns), indices, values
    /fclib_local/vectors/q, mu, s     s only with equations
    /fclib_local/info/title, description, math_info
    /solution/u, r, l                 l only with equations
    /guesses                          starting points of others, which are passed over
    /qvi_contact/weights              this project's: lengths that make forces tractions; other programs pass over it

Integers are 32 bit, numbers 64 bit, all with one dimension. Source: src/fclib.h of FrictionalContactLibrary/fclib, as
of 2018 (functions write_matrix, write_local_vectors, write_solution, fclib_write_guesses). Triplets are those of
CSparse, to which FCLIB casts them: i rows, p columns. The meaning of the arrays is that of `local_problem`.

Siconos (`frictionContact_fclib_read`) reads W, q and mu and passes over V, R and s: for it write
`LocalProblem.penalised`.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array

from comparisons.exchange.archive import unreadable
from comparisons.exchange.local import LARGEST, ContactState, LocalProblem, finite
from qvi_contact.basics.writing import LARGEST as LARGEST_CONTENT
from qvi_contact.basics.writing import replacing
from solvers.basics.types import Matrix, Module, Sparse, SparseRows, Vector, load
from solvers.errors import InputError

_KIND = "an FCLIB file (HDF5, .hdf5), or an archive (.npz)"
_OWN = "qvi_contact"
_MATH = (
    "Plane Coulomb friction u = W r + V l + q, V' r + R l + s = 0, R = 0 (V, R only if present; without them "
    "u = W r + q), order (N, T) per contact, r_N >= 0 compression, u_N >= 0 gap. Solutions need not be unique."
)


@dataclass(frozen=True, eq=False)
class FCLIBFile:
    """What an FCLIB file holds.

    Attributes
    ----------
    problem : LocalProblem
    solution : ContactState or None
    title, description : str, empty if missing

    """

    problem: LocalProblem
    solution: ContactState | None = None
    title: str = ""
    description: str = ""


def write_fclib(
    path: str | Path,
    problem: LocalProblem,
    solution: ContactState | None = None,
    title: str = "",
    description: str = "",
) -> None:
    """Write a local problem, with a solution if there is one.

    Raises
    ------
    InputError
        If the file cannot be written, a state has a wrong shape or is not finite, or h5py is not installed.

    """
    h5py = _h5py()
    state = None if solution is None else _checked(problem, solution, "state")
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        local = file.create_group("fclib_local")
        _integers(local, "spacedim", [2])
        _write_matrix(local.create_group("W"), problem.W)
        vectors = local.create_group("vectors")
        vectors["q"], vectors["mu"] = problem.q, problem.mu
        if len(problem.s):
            _write_matrix(local.create_group("V"), problem.V)
            _write_matrix(local.create_group("R"), np.zeros((len(problem.s), len(problem.s))))
            vectors["s"] = problem.s
        info = local.create_group("info")
        for name, text in (("title", title), ("description", description), ("math_info", _MATH)):
            _write_text(h5py, info, name, text)
        if state is not None:
            group = file.create_group("solution")
            group["u"], group["r"] = state.u, state.r
            if len(state.lam):
                group["l"] = state.lam
        file.create_group(_OWN)["weights"] = problem.weights


def read_fclib(path: str | Path) -> FCLIBFile:
    """Read a local problem in the plane.

    Matrices may be stored by columns, rows or triplets; W may be singular (see `LocalProblem`).

    Raises
    ------
    InputError
        If the file cannot be read, has another layout, is three-dimensional or a global problem, or holds NaN, wrong
        shapes, or what `LocalProblem` refuses; or if h5py is not installed.

    """
    h5py = _h5py()
    with _reporting(path), Path(path).open("rb") as stream, h5py.File(stream, "r") as file:
        if "fclib_local" not in file:
            found = "a global problem" if "fclib_global" in file else "no /fclib_local"
            raise InputError("file", f"{found} in {Path(path).name}", "give a local problem, group /fclib_local")
        local = file["fclib_local"]
        dimension = _integer(local, "spacedim")
        if dimension != 2:
            raise InputError("fclib_local/spacedim", dimension, "give a problem in the plane: 2, not 3, dimensions")
        problem = _read_problem(local, file.get(f"{_OWN}/weights"))
        solution = None
        if (group := file.get("solution")) is not None:
            lam = _vector(group, "l") if len(problem.s) else np.zeros(0)
            solution = _checked(problem, ContactState(_vector(group, "u"), _vector(group, "r"), lam), "solution")
        texts = [_read_text(local, f"info/{name}") for name in ("title", "description")]
    return FCLIBFile(problem, solution, *texts)


@contextmanager
def _reporting(path: str | Path) -> Iterator[None]:
    """What the HDF5 library says about a broken file, as one `InputError`."""
    try:
        yield
    except InputError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, MemoryError) as error:
        raise unreadable(path, error, _KIND) from error


def _h5py() -> Module:
    try:
        return load("h5py")
    except ImportError as error:
        raise InputError("h5py", "not installed", "python -m pip install h5py") from error


def _integers(group: Any, name: str, values: Any) -> None:
    group.create_dataset(name, data=np.asarray(values, dtype=np.int32))


def _write_matrix(group: Any, matrix: Matrix) -> None:
    """By compressed columns; the stored entries are those that are not zero, and the diagonal of a zero matrix."""
    sparse = csc_array(matrix)
    if sparse.nnz == 0:  # some readers cannot take an empty array
        places = np.arange(min(matrix.shape))
        sparse = csc_array((np.zeros(len(places)), (places, places)), matrix.shape)
    sparse.sort_indices()
    header = {"nzmax": sparse.nnz, "m": matrix.shape[0], "n": matrix.shape[1], "nz": -1}
    for name, value in header.items():
        _integers(group, name, [value])
    _integers(group, "p", sparse.indptr)
    _integers(group, "i", sparse.indices)
    group["x"] = sparse.data


def _write_text(h5py: Module, group: Any, name: str, text: str) -> None:
    """A scalar string with a terminating zero, as C programs expect."""
    content = text.encode("utf-8")
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(len(content) + 1)
    kind.set_strpad(h5py.h5t.STR_NULLTERM)
    kind.set_cset(h5py.h5t.CSET_UTF8)
    place = h5py.h5d.create(group.id, name.encode(), kind, h5py.h5s.create(h5py.h5s.SCALAR))
    buffer = np.array(content, dtype=f"S{len(content) + 1}")
    place.write(h5py.h5s.ALL, h5py.h5s.ALL, buffer, mtype=kind)


def _read_problem(local: Any, weights: Any) -> LocalProblem:
    """The data of /fclib_local; `LocalProblem` checks the rest."""
    q, mu = _vector(local, "vectors/q"), _vector(local, "vectors/mu")
    W = _read_matrix(local, "W")
    lengths = None if weights is None else _numbers(weights, f"{_OWN}/weights")
    if ("V" in local) != ("R" in local):
        raise InputError("fclib_local", "one of V and R", "give both, or none")
    if "V" not in local:
        return LocalProblem(W, q, mu, weights=lengths)  # type: ignore[arg-type]  # None stands for ones
    if _read_matrix(local, "R").any():
        raise InputError("fclib_local/R", "other than zero", "give equations V' r + s = 0 alone")
    return LocalProblem(W, q, mu, _read_matrix(local, "V"), _vector(local, "vectors/s"), lengths)  # type: ignore[arg-type]


def _read_matrix(local: Any, name: str) -> Matrix:
    """A dense matrix from its group."""
    field = f"fclib_local/{name}"
    group = _item(local, name)
    m, n, nz = (_integer(group, key) for key in ("m", "n", "nz"))
    if not (0 <= m <= LARGEST and 0 <= n <= LARGEST):
        raise InputError(field, f"{m} × {n}", f"give a matrix of at most {LARGEST} rows and columns")
    p, i = _indices(group, "p"), _indices(group, "i")
    x = _vector(group, "x")
    try:
        if nz >= 0:
            matrix: Sparse | SparseRows = csc_array((x[:nz], (i[:nz], p[:nz])), (m, n))
        elif nz in (-1, -2):
            kind = csc_array if nz == -1 else csr_array
            matrix = kind((x, i, p), (m, n))
            matrix.check_format(full_check=True)
        else:
            raise InputError(f"{field}/nz", nz, "give −1 (columns), −2 (rows), or the number of triplets")
    except (ValueError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(field, str(error), "give m, n, nz, p, i and x that belong together") from error
    return np.asarray(matrix.toarray(), dtype=np.float64)


def _checked(problem: LocalProblem, state: ContactState, field: str) -> ContactState:
    """A state of finite numbers and the right shapes."""
    sizes = (len(problem.q), len(problem.q), len(problem.s))
    for name, values, size in zip(("u", "r", "l"), state, sizes, strict=True):
        if np.shape(values) != (size,):
            raise InputError(f"{field}/{name}", f"shape {np.shape(values)}", f"give shape ({size},)")
    return ContactState(*(finite(field, np.asarray(values)) for values in state))


def _read_text(group: Any, name: str) -> str:
    """A string, empty if missing."""
    value = _content(group[name], name) if name in group else b""
    value = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
    return value.decode("utf-8", "replace").rstrip("\0") if isinstance(value, bytes) else str(value)


def _item(group: Any, name: str) -> Any:
    if name not in group:
        raise InputError("file", f"no {group.name.rstrip('/')}/{name}", "give a file in FCLIB's layout")
    return group[name]


def _numbers(dataset: Any, field: str) -> Vector:
    return np.atleast_1d(finite(field, np.asarray(_content(dataset, field)))).ravel()


def _content(dataset: Any, field: str) -> Any:
    """What a dataset holds, unless it is more than a limit: a short file can hold gigabytes of zeros."""
    size = int(getattr(dataset, "nbytes", 0))
    if size > LARGEST_CONTENT:
        raise InputError(
            field, f"{size} bytes", f"give at most {LARGEST_CONTENT} bytes: the problem is too large to read"
        )
    return dataset[()]


def _vector(group: Any, name: str) -> Vector:
    return _numbers(_item(group, name), f"{group.name}/{name}")


def _indices(group: Any, name: str) -> np.ndarray:
    values = _vector(group, name)
    if (values != np.round(values)).any() or np.abs(values).max(initial=0.0) > np.iinfo(np.int32).max:
        raise InputError(f"{group.name}/{name}", "fractions", "give 32 bit whole numbers")
    return values.astype(np.int32)


def _integer(group: Any, name: str) -> int:
    values = _indices(group, name)
    if values.shape != (1,):
        raise InputError(f"{group.name}/{name}", f"shape {values.shape}", "give one whole number")
    return int(values[0])
