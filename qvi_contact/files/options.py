"""Options of `qvi_contact.solve` and `qvi_contact.refine` that problem files and the command line may give."""

from dataclasses import dataclass
from typing import Any, Literal

from qvi_contact.errors import InputError


def law_of_rows(contact_rows: Any) -> Any:
    """Where the contact law holds, by the name that version 0.1 had for its rows; others as they are."""
    return {"bernstein": "edges", "gauss": "points"}.get(str(contact_rows), contact_rows)


@dataclass(frozen=True, kw_only=True)
class SolveOptions:
    """Defaults for `qvi_contact.solve`; all but the first eight are options of a method.

    Parameters
    ----------
    degree : int, optional
        Degree of the element, 3 to 12; 4 by default: `degree = 5`.
    law_on : str, optional
        Where the contact law holds: on whole edges, or at points. edges by default; points where friction varies
        along an edge, and on bilateral contacts with friction: `law_on = "points"`.
    method : str, optional
        condensed (by default), fixed-point, pivoting or uzawa: `method = "fixed-point"`.
    inner : str, optional
        Inner solver of the fixed point, see `qvi-contact methods`; qp:clarabel by default: `inner =
        "direct:clarabel"`.
    tolerance : float, optional
        Accuracy that the certificate must confirm; 1e-8 by default: `tolerance = 1e-9`.
    factorisation : str, optional
        Sparse factorisation, see `qvi-contact methods`; auto by default: `factorisation = "superlu"`.
    threads : int, optional
        Threads of the linear algebra; one for small problems by default, else all cores: `threads = 2`.
    time_limit : float, optional
        Seconds for everything; no limit by default: `time_limit = 60.0`.
    gap : float, optional
        Condensed: complementarity at the end, relative; 1e-14 by default: `gap = 1e-12`.
    system : str, optional
        Condensed: Newton's matrices, auto (by default), dense or sparse: `system = "sparse"`.
    variant : str, optional
        Fixed point: anderson (by default), damped or plain: `variant = "damped"`.
    damping : float, optional
        Fixed point: damping or mixing, above 0, at most 1; 0.5 by default: `damping = 0.2`.
    memory : int, optional
        Fixed point: earlier iterations that anderson uses; 5 by default: `memory = 10`.
    max_iterations : int, optional
        Iterations at most; each method has its own default: `max_iterations = 200`.
    inner_tolerance : float, optional
        Fixed point: tolerance of the inner solver: `inner_tolerance = 1e-12`.
    patience : int, optional
        Fixed point: iterations without progress before it counts as stalled; 15 by default: `patience = 30`.
    form : str, optional
        Fixed point: unknowns of the inner problems, auto (by default), full or condensed: `form = "full"`.
    rule : str, optional
        Uzawa: accumulating (by default) or printed, as in the paper: `rule = "printed"`.
    omega_T : float, optional
        Uzawa: step of the tangential multiplier; 0.01 by default: `omega_T = 0.001`.
    omega_N : float, optional
        Uzawa: step of the normal multiplier; from the matrix by default: `omega_N = 0.5`.
    step_decay : float, optional
        Uzawa: iterations in which the step halves; it does not shrink by default: `step_decay = 200.0`.
    decay : str, optional
        Uzawa: geometric (by default) or harmonic: `decay = "harmonic"`.
    iterations : int, optional
        Uzawa: do exactly so many, without any test: `iterations = 30`.

    """

    degree: int | None = None
    law_on: Literal["edges", "points"] | None = None
    method: str | None = None
    inner: str | None = None
    tolerance: float | None = None
    factorisation: str | None = None
    threads: int | None = None
    time_limit: float | None = None
    gap: float | None = None
    system: str | None = None
    variant: str | None = None
    damping: float | None = None
    memory: int | None = None
    max_iterations: int | None = None
    inner_tolerance: float | None = None
    patience: int | None = None
    form: str | None = None
    rule: str | None = None
    omega_T: float | None = None  # noqa: N815  # the name of the option
    omega_N: float | None = None  # noqa: N815  # the name of the option
    step_decay: float | None = None
    decay: str | None = None
    iterations: int | None = None

    @staticmethod
    def given(data: Any) -> Any:
        """Files of version 0.1 could name the element, of which there is one now, and the law's `contact_rows`."""
        if not isinstance(data, dict):
            return data
        if data.get("element", "hct") != "hct":
            remedy = "rectangles (bfs) are gone: leave this key out, then grids are cut into triangles"
            raise InputError("element", data["element"], remedy)
        given = {name: value for name, value in data.items() if name not in ("element", "contact_rows")}
        if "contact_rows" in data and "law_on" not in data:
            given["law_on"] = law_of_rows(data["contact_rows"])
        return given


@dataclass(frozen=True, kw_only=True)
class RefineOptions:
    """Defaults for `qvi_contact.refine`, beside those for `qvi_contact.solve`.

    Parameters
    ----------
    target : float, optional
        Relative error asked for; 1e-3 by default: `target = 1e-4`.
    quantity : str, optional
        energy (by default) or dissipation; the force of a contact, NAME.normal_force or NAME.tangential_force, its
        NAME.largest_pressure or NAME.slip(x, y) at a point; of a plate or pin its force or motion, NAME.force_x,
        force_y, moment, x, y or rotation; a stress at a point, xx(x, y), yy, xy, von_mises, first or second; or its
        extreme along a named edge, EDGES.largest_von_mises, EDGES.smallest_second: `quantity = "base.normal_force"`.
    max_unknowns : int, optional
        Largest number of unknowns; 20000 by default: `max_unknowns = 50_000`.
    max_rounds : int, optional
        Largest number of rounds; 60 by default: `max_rounds = 10`.
    guaranteed : bool, optional
        For the force of a contact with Coulomb friction: refine until its guaranteed bounds are within the target.
        By default an estimate is enough: `guaranteed = true`.

    """

    target: float | None = None
    quantity: str | None = None
    max_unknowns: int | None = None
    max_rounds: int | None = None
    guaranteed: bool | None = None
