"""Mechanisms: rigid motions of the blocks that prove how much of a load no stress whatever can carry."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.errors import SolveError
from qvi_contact.mechanism.program import Motion, Rigid
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.names import Named
from solvers.basics.types import PicklesFields

_CERTAIN: Final = 1e-8
"""Gain of work, relative to the work that drives and resists, below which nothing is claimed."""

_REACH: Final = 1e4
"""A proof must exclude all contact forces up to so many times the loads, whatever rounding left of the conditions."""

_MOVES: Final = 1e-6
"""Share of the largest motion from which on a contact opens or slips."""


@dataclass(frozen=True)
class RigidMotion:
    """A small motion u(x) of a rigid body.

    Attributes
    ----------
    x, y : float
        Translation of the centre [length].
    rotation : float
        Rotation, counterclockwise [rad].
    centre : (float, float)
        The point that the translation belongs to [length].

    """

    x: float
    y: float
    rotation: float
    centre: tuple[float, float]

    def at(self, points: FloatArray) -> FloatArray:
        """Displacements of points (..., 2) [length]."""
        arm = np.asarray(points) - self.centre
        turned = self.rotation * np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        return np.asarray(np.array([self.x, self.y]) + turned)


@dataclass(frozen=True)
class ContactMotion:
    """What a mechanism does at a contact.

    Attributes
    ----------
    opening, slip : float
        Largest speed of opening, and of sliding [length].

    """

    opening: float
    slip: float

    @property
    def slides(self) -> bool:
        """Whether the contact slips, with or without opening."""
        return self.slip > _MOVES

    @property
    def opens(self) -> bool:
        """Whether the contact opens anywhere."""
        return self.opening > _MOVES


@dataclass(frozen=True, eq=False)
class Mechanism(PicklesFields):
    """Small rigid motions of the blocks that the contact laws admit, the largest displacement being 1 [length].

    Friction counts as if slip had to open the contact by μ times as much (the associated law): for such a motion
    admissible tractions cannot resist by more than `resistance`. If the loads do more work than that, no stress in
    equilibrium with them keeps the contact laws, on any mesh.

    Attributes
    ----------
    blocks : (cells,) int array
        The block that each cell of the mesh belongs to.
    motions : tuple of RigidMotion
        One for each block.
    plates : mapping of str to RigidMotion
        Motions of plates driven by force, by the names of their contacts.
    works : mapping of str to float
        Work of each load by its name [stress × length²].
    resistance : float
        The most that cohesion and caps of friction can take up [stress × length²].
    contacts : mapping of str to ContactMotion
        What opens and what slips.
    violation : float
        Largest speed against a support or contact law [length]: rounding.

    """

    blocks: IntArray
    motions: tuple[RigidMotion, ...]
    plates: Mapping[str, RigidMotion]
    works: Mapping[str, float]
    resistance: float
    contacts: Mapping[str, ContactMotion]
    violation: float

    @property
    def work(self) -> float:
        """Work of all loads together [stress × length²]."""
        return sum(self.works.values())

    @property
    def overload(self) -> float:
        """Work of the loads that drive the mechanism, over what the other loads and the contacts can take up.

        Above 1 the loads cannot be carried: all that drive would have to be smaller by this factor, while the others
        stay. Loads count by their names, as driving if their work on this motion is positive: parts of one load, such
        as the shear on two ends that make a couple, want one name, or what one gains and another loses counts on both
        sides and brings the factor nearer to 1. It is not the inverse of `limit_load_factor`, where the loads to
        multiply are chosen. Infinity if nothing resists.
        """
        driving = sum(work for work in self.works.values() if work > 0.0)
        resisting = self.resistance + driving - self.work
        return driving / resisting if resisting > _CERTAIN * driving else math.inf

    @property
    def reason(self) -> str:
        """What gives way, as a sentence without its stop."""
        slides = [repr(name) for name, moved in self.contacts.items() if moved.slides]
        pulls = [repr(name) for name, moved in self.contacts.items() if moved.opens and not moved.slides]
        if slides:
            return f"The load exceeds what friction on {' and '.join(slides)} can carry"
        if pulls:
            return f"The load pulls or tips the body off {' and '.join(pulls)}, where tension is not carried"
        return "The load moves the body where no contact resists"


def find_mechanism(problem: ContactProblem) -> Mechanism | None:
    """The mechanism that proves that no stress carries the loads; None if there is none.

    It is the one on which the loads that drive do the most work for each unit of work that resists. None says that
    contact tractions exist that carry the loads on rigid blocks, up to 1e-8 of them; friction may still give way
    before, since Coulomb's slip is not associated.

    Raises
    ------
    InputError
        If a function among the data gives bad values.
    SolveError
        If the linear program is not solved, or not in time.

    """
    rigid = Rigid(problem)
    motion = rigid.strongest(list(rigid.works))
    return _mechanism(problem, rigid, motion) if motion is not None and _proves(rigid, motion) else None


def upper_bound(problem: ContactProblem, loads: Sequence[str]) -> tuple[float, Mechanism | None]:
    """The largest multiple of the named loads that a body of rigid blocks carries, and the mechanism of the limit.

    No stress of the body carries more, and none on any mesh. It is infinite, without a mechanism, if the loads can grow
    without limit, and minus infinity if a mechanism on which they do no work lets no multiple be carried.
    """
    rigid = Rigid(problem)
    named = [name for name in dict.fromkeys(loads) if name in rigid.works]
    others = [name for name in rigid.works if name not in named]
    against = rigid.strongest(others, named)
    if against is not None and _proves(rigid, against):
        return -math.inf, _mechanism(problem, rigid, against)
    motion = rigid.dearest(named, others)
    if motion is None:
        return math.inf, None
    if motion.violation > _CERTAIN:
        raise SolveError(
            f"limit load: the mechanism violates a contact law by {motion.violation:.1e}: leave out "
            "tiny blocks or edges"
        )
    driving = sum(motion.works[name] for name in named)
    resisting = motion.resistance - sum(motion.works[name] for name in others)
    return resisting / driving, _mechanism(problem, rigid, motion)


def _proves(rigid: Rigid, motion: Motion) -> bool:
    """Whether the loads do more work than rounding, or contact forces far beyond the loads, could explain."""
    gain = motion.driving - motion.resisting
    rounding = _CERTAIN * (motion.driving + motion.resisting)
    return gain > rounding + _REACH * motion.violation * rigid.size


def _mechanism(problem: ContactProblem, rigid: Rigid, motion: Motion) -> Mechanism:
    """In the user's terms, scaled to the largest displacement 1."""
    bodies, v = rigid.bodies, motion.v.reshape(-1, 3)
    moved = [
        RigidMotion(float(x), float(y), float(turn / size), (float(centre[0]), float(centre[1])))
        for (x, y, turn), size, centre in zip(v, bodies.size, bodies.centre, strict=True)
    ]
    corners = problem.mesh.vertices[problem.mesh.cells]
    largest = max(
        float(np.hypot(*np.moveaxis(moved[block].at(corners[bodies.of_cells == block]), -1, 0)).max())
        for block in range(bodies.blocks)
    )
    scale = 1.0 / (largest or float(np.abs(v).max()))  # plates alone may move
    moved = [RigidMotion(scale * m.x, scale * m.y, scale * m.rotation, m.centre) for m in moved]
    contacts = {}
    for contact in problem.contacts:
        chosen = [line for line in rigid.lines if line.contact is contact]
        opening = [float((line.opening(bodies) @ motion.v).max()) for line in chosen]
        slip = [line.slip(bodies, motion.v) for line in chosen]
        contacts[contact.name] = ContactMotion(scale * max(opening, default=0.0), scale * max(slip, default=0.0))
    plates = dict(zip(bodies.plates, moved[bodies.blocks :], strict=True))
    return Mechanism(
        bodies.of_cells,
        tuple(moved[: bodies.blocks]),
        MappingProxyType(Named("plates", "contacts with a plate or pin", plates)),
        MappingProxyType(Named("works", "loads", {name: scale * work for name, work in motion.works.items()})),
        scale * motion.resistance,
        MappingProxyType(Named("contacts", "contacts", contacts)),
        scale * motion.violation,
    )
