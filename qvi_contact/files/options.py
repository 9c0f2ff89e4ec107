"""Options of `qvi_contact.solve` and `qvi_contact.refine` that problem files and the command line may give."""

from dataclasses import dataclass
from typing import Annotated, Any

from qvi_contact.basics.schema import Inline
from qvi_contact.errors import InputError
from qvi_contact.solution.settings import Settings
from solvers.settings import CondensedOptions, FixedPointOptions, UzawaOptions


def law_of_rows(contact_rows: Any) -> Any:
    """Where the contact law holds, by the name that version 0.1 had for its rows; others as they are."""
    return {"bernstein": "edges", "gauss": "points"}.get(str(contact_rows), contact_rows)


_OF_ALL = ("max_iterations", "initial", "callback")  # methods


@dataclass(frozen=True, kw_only=True)
class SolveOptions:
    """Defaults for `qvi_contact.solve`: its settings, and the options of the methods."""

    settings: Annotated[Any, Inline(Settings, ("verbose", "throw", "callback", "initial", "options"))] = None
    condensed: Annotated[Any, Inline(CondensedOptions, _OF_ALL)] = None
    fixed_point: Annotated[Any, Inline(FixedPointOptions, (*_OF_ALL, "inner_options"))] = None
    uzawa: Annotated[Any, Inline(UzawaOptions, _OF_ALL)] = None
    max_iterations: int | None = None
    """Iterations at most; each method has its own default: `max_iterations = 200`."""

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
