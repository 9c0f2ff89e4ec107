"""A `FrictionQVI`, and its solution if there is one, as one NumPy archive (.npz).

    format, version                  "qvi_contact.FrictionQVI", 1
    f, N, n0, …, bilateral           fields of `FrictionQVI`; matrix X by columns: X_data, X_indices, X_indptr, X_shape
    traces_rows, …_interpolation     `TractionFactor`, if there are any
    solution_z, …                    vectors of `QVISolution`; solution_record: its words and numbers as JSON

All data of (D2) are kept to the last bit. Data that only code can express are lost: `root` and `load`, which evaluate
the energy without the rounding inside K (so on fine meshes the certificate of the problem as read is looser),
`structure` and `places`, which only speed up factorisations, and the history of a solution. Nothing is pickled: reading
a file never runs code. A solution is certified again, on the problem as read, and is no longer "solved" if that fails.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from qvi_contact.basics.writing import open_regular, read_arrays, replacing
from solvers.basics.status import Status
from solvers.basics.types import Sparse
from solvers.certificate.certificate import certify
from solvers.errors import InputError
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import by_columns
from solvers.inequality.traces import TractionFactor
from solvers.solution import QVISolution

FORMAT = "qvi_contact.FrictionQVI"
VERSION = 1

_KIND = "an .npz file written by save_qvi"
_MATRICES = ("K", "N", "T", "A")
_TRACES = ("rows", "interpolation")
_VECTORS = ("f", "n0", "t0", "mu", "W", "b", "cohesion", "cap", "bilateral")
_SOLUTION = ("z", "normal_multiplier", "tangential_multiplier", "equality_multiplier", "threshold")
_WORDS = ("method", "inner", "message", "form", "factorisation")

Arrays = dict[str, Any]


def save_qvi(path: str | Path, qvi: FrictionQVI, solution: QVISolution | None = None) -> None:
    """Write a problem, and a solution of it.

    Raises
    ------
    InputError
        If the file cannot be written, or the solution is one of another problem.

    """
    if not isinstance(qvi, FrictionQVI):
        raise InputError("qvi", type(qvi).__name__, "give a FrictionQVI")
    arrays = _arrays(qvi)
    if solution is not None:
        other = arrays if solution.problem is qvi else _arrays(solution.problem)
        if arrays.keys() != other.keys() or not all(np.array_equal(arrays[name], other[name]) for name in arrays):
            raise InputError("solution", "of another problem", "give the solution of this one")
        arrays |= {f"solution_{name}": getattr(solution, name) for name in _SOLUTION}
        if solution.farkas is not None:
            arrays |= {"solution_farkas_G": solution.farkas[0], "solution_farkas_A": solution.farkas[1]}
        record = {name: getattr(solution, name) for name in _WORDS} | {
            "status": solution.status.value, "tolerance": solution.certificate.tolerance,
            "iterations": solution.iterations, "timings": dict(solution.timings), "versions": dict(solution.versions),
            "corrections": list(solution.corrections),
        }  # fmt: skip
        arrays["solution_record"] = np.array(json.dumps(record, sort_keys=True))
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def load_qvi(path: str | Path) -> tuple[FrictionQVI, QVISolution | None]:
    """Read what `save_qvi` wrote: the problem, and its solution or None.

    Raises
    ------
    InputError
        If the file cannot be read, is of another format or version, or its data are no valid problem.

    """
    try:
        with open_regular(path) as stream:
            arrays: Arrays = read_arrays("file", str(path), stream)
        found, version = str(arrays.get("format", "no format")), arrays.get("version", np.array(0)).item()
        if found != FORMAT:
            raise InputError("file", f"{found} in {Path(path).name}", f"give {_KIND}")
        if version != VERSION:
            remedy = f"give version {VERSION}, or take a newer program"
            raise InputError("file", f"version {version} of {Path(path).name}", remedy)
        fields = {name: _matrix(arrays, name) for name in _MATRICES} | {name: arrays[name] for name in _VECTORS}
        if "traces_rows_data" in arrays:
            fields["traces"] = TractionFactor(*(_matrix(arrays, f"traces_{name}") for name in _TRACES))
        qvi = FrictionQVI.from_arrays(**fields)
        return qvi, _read_solution(qvi, arrays) if "solution_record" in arrays else None
    except InputError:
        raise
    except Exception as error:  # zip, zlib, NumPy and SciPy do not document their exceptions for broken bytes
        reason = getattr(error, "strerror", None) or " ".join(str(error).split()) or type(error).__name__
        raise InputError("file", str(path), f"cannot be read ({reason}): give {_KIND}") from error


def parts_of(name: str, matrix: Sparse) -> Arrays:
    """The arrays of a matrix in compressed columns, with names that begin with the matrix's name."""
    parts = {"data": matrix.data, "indices": matrix.indices, "indptr": matrix.indptr, "shape": np.array(matrix.shape)}
    return {f"{name}_{part}": value for part, value in parts.items()}


def _matrix(arrays: Arrays, name: str) -> Sparse:
    data, indices, indptr, shape = (arrays[f"{name}_{part}"] for part in ("data", "indices", "indptr", "shape"))
    matrix: Sparse = csc_array((data, indices, indptr), tuple(shape.tolist()))
    matrix.check_format(full_check=True)
    return matrix


def _arrays(qvi: FrictionQVI) -> Arrays:
    matrices = {name: getattr(qvi, name) for name in _MATRICES}
    if qvi.traces is not None:
        matrices |= {f"traces_{name}": by_columns(getattr(qvi.traces, name)) for name in _TRACES}
    arrays = {"format": np.array(FORMAT), "version": np.array(VERSION)}
    arrays |= {name: getattr(qvi, name) for name in _VECTORS}
    for name, matrix in matrices.items():
        arrays |= parts_of(name, matrix)
    return arrays


def _read_solution(qvi: FrictionQVI, arrays: Arrays) -> QVISolution:
    """The solution in the arrays, with a certificate computed on the problem as read."""
    record = json.loads(str(arrays["solution_record"]))
    z, m_N, m_T, nu, threshold = (arrays[f"solution_{name}"] for name in _SOLUTION)
    certificate = certify(qvi, z, m_N, m_T, nu, record["tolerance"])
    status, message = Status(record["status"]), str(record["message"])
    if status is Status.SOLVED and not certificate.passed:
        status, message = Status.INACCURATE, f"as read from the file: {certificate.summary()}."
    farkas = (arrays["solution_farkas_G"], arrays["solution_farkas_A"]) if "solution_farkas_G" in arrays else None
    return QVISolution(
        qvi, status, z, m_N, m_T, nu, threshold, certificate, (), int(record["iterations"]), dict(record["timings"]),
        str(record["method"]), str(record["inner"]), message, dict(record["versions"]), farkas, str(record["form"]),
        str(record["factorisation"]), tuple(record["corrections"]),
    )  # fmt: skip
