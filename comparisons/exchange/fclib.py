"""Local friction problems in the HDF5 layout of FCLIB, the Frictional Contact Library.

    /fclib_local/spacedim             2
    /fclib_local/W, V, R              a matrix each; V and R only with equations
        m, n, nzmax, nz               rows, columns, entries; −1: compressed columns
        p, i, x                       pointers, indices, values
    /fclib_local/vectors/q, mu, s     s only with equations
    /fclib_local/info/title, description, math_info
    /solution/u, r, l                 l only with equations
    /qvi_contact/weights              this project's: lengths that make forces tractions; other programs pass over it

Integers are 32 bit, numbers 64 bit, all with one dimension. Source: src/fclib.h of FrictionalContactLibrary/fclib, as
of 2018 (functions write_matrix, write_local_vectors, write_solution). The meaning of the arrays is that of
`local_problem`.

Siconos (`frictionContact_fclib_read`) reads W, q and mu and passes over V, R and s: for it write
`LocalProblem.penalised`.
"""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from comparisons.exchange.local import ContactState, LocalProblem
from qvi_contact.basics.writing import replacing
from solvers.basics.types import Matrix, Module, load
from solvers.errors import InputError

_MATH = (
    "Plane Coulomb friction u = W r + V l + q, V' r + R l + s = 0, R = 0 (V, R only if present; without them "
    "u = W r + q), order (N, T) per contact, r_N >= 0 compression, u_N >= 0 gap. Solutions need not be unique."
)


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
    try:
        h5py = load("h5py")
    except ImportError as error:
        raise InputError("h5py", "not installed", "python -m pip install h5py") from error
    sizes = {"u": len(problem.q), "r": len(problem.q), "l": len(problem.s)}
    states = {} if solution is None else dict(zip(sizes, solution, strict=True))
    for name, values in states.items():
        if np.shape(values) != (sizes[name],) or not np.isfinite(values).all():
            raise InputError(f"state/{name}", f"shape {np.shape(values)}", f"give {sizes[name]} finite numbers")
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
        if solution is not None:
            group = file.create_group("solution")
            for name, values in states.items():
                if len(values):
                    group[name] = values
        file.create_group("qvi_contact")["weights"] = problem.weights


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
