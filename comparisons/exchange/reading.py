"""A file of `comparisons.exchange` solved and judged: our certificate beside Siconos' error measure."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparisons.exchange import (
    ContactState,
    LocalProblem,
    load_qvi,
    local_problem,
    read_fclib,
    siconos_error,
    solve_local,
    state_of,
)
from solvers.certificate.certificate import Certificate
from solvers.errors import InputError
from solvers.solve import solve_qvi


@dataclass(frozen=True)
class Judgement:
    """What a state is worth.

    Attributes
    ----------
    label : what it is: "solution", "guess 1", … of the file, or "solved here"
    certificate : the certificate's line
    accuracy : the tolerance at which the certificate would pass
    siconos_error : in the units of the file; None where FCLIB has no form for the problem
    siconos_error_dimensionless : the same in the problem's own units

    """

    label: str
    certificate: str
    accuracy: float
    siconos_error: float | None
    siconos_error_dimensionless: float | None


@dataclass(frozen=True)
class Report:
    """What a file holds, and how solving it went.

    Attributes
    ----------
    file, kind, title : name, "NumPy archive" or "FCLIB", and title
    contacts, unknowns, equations : sizes
    judgements : states of the file first, the one found here last
    status, message : of the solve here
    note : why Siconos' measure is missing, else empty

    """

    file: str
    kind: str
    title: str
    contacts: int
    unknowns: int
    equations: int
    judgements: tuple[Judgement, ...]
    status: str
    message: str
    note: str = ""

    def lines(self) -> list[str]:
        """Readable lines."""
        title = f", “{self.title}”" if self.title else ""
        head = f"{self.file}: {self.kind}{title}, {self.contacts} contact points, {self.unknowns} unknowns, "
        lines = [f"{head}{self.equations} equations"]
        for judgement in self.judgements:
            lines.append(f"  {judgement.label}: {judgement.certificate}")
            if judgement.siconos_error is not None:
                own = f"{judgement.siconos_error_dimensionless:.1e} with dimensionless u and r"
                lines.append(f"    Siconos error {judgement.siconos_error:.1e}, {own}")
        lines += [f"  {self.note}"] if self.note else []
        return [*lines, f"status: {self.message}"]


def solve_file(path: str, options: dict[str, Any]) -> Report:
    """Read an ``.npz`` archive or an FCLIB file, solve it, and judge what it holds and what was found.

    Raises
    ------
    InputError
        If the file is no such file, or an option of `solve_qvi` is wrong.

    """
    return _archive(path, options) if Path(path).suffix.lower() == ".npz" else _fclib(path, options)


def _fclib(path: str, options: dict[str, Any]) -> Report:
    held = read_fclib(path)
    problem, tolerance = held.problem, options.get("tolerance", 1e-8)
    known = {"solution": held.solution} if held.solution else {}
    known |= {f"guess {number}": guess for number, guess in enumerate(held.guesses, 1)}
    judgements = [_judged(label, problem, state, problem.certify(state, tolerance)) for label, state in known.items()]
    state, solution = solve_local(problem, **options)
    judgements.append(_judged("solved here", problem, state, solution.certificate))
    sizes = (problem.contacts, len(problem.q), len(problem.s))
    return Report(path, "FCLIB", held.title, *sizes, tuple(judgements), solution.status.value, solution.message)


def _archive(path: str, options: dict[str, Any]) -> Report:
    qvi, known = load_qvi(path)
    problem, note = None, ""
    try:
        problem = local_problem(qvi)
    except InputError as error:
        note = f"no Siconos error: {error.field} has no place in FCLIB"
    solution = solve_qvi(qvi, **options)
    found = {"solved here": solution} if known is None else {"solution": known, "solved here": solution}
    judgements = tuple(
        _judged(label, problem, None if problem is None else state_of(problem, each), each.certificate)
        for label, each in found.items()
    )
    sizes = (qvi.m, qvi.n, qvi.p)
    return Report(path, "NumPy archive", "", *sizes, judgements, solution.status.value, solution.message, note)


def _judged(
    label: str, problem: LocalProblem | None, state: ContactState | None, certificate: Certificate
) -> Judgement:
    """A state, with Siconos' measure where FCLIB has a form for its problem."""
    errors: tuple[float | None, float | None] = (None, None)
    if problem is not None and state is not None:
        own, own_state = problem.dimensionless(state)
        errors = siconos_error(problem, state.r, state.lam), siconos_error(own, own_state.r, own_state.lam)
    return Judgement(label, certificate.summary(), certificate.accuracy, *errors)
