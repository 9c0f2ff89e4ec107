"""Rigid pins that a user should look at: a centre where no pin can be, and a pin larger than its bore."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import FloatArray, evaluate
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem

_STEPS = 8  # of an edge, at whose ends distances are taken
_SAME = 1e-9  # share of a distance up to which two are one


def misplaced_pins(problem: ContactProblem) -> dict[str, tuple[float, float]]:
    """Names of contacts with a pin where the edge nearest to its centre faces away from it, and the centre [length].

    A pin is a plate whose gap is the distance from a disc around its pivot. At a corner that is nearest the normals of
    both its edges count together, which is right whichever way it turns.
    """
    return {pin.name: pin.centre for pin in _pins(problem) if pin.misplaced}


def pressed_pins(problem: ContactProblem) -> dict[str, float]:
    """Names of contacts with a pin larger than its bore, and the difference of the radii [length].

    The bore goes around more than half of the pin, and overlaps with it everywhere before anything is loaded. Its
    radius is the mean distance of its vertices from the pin's centre, which is right for chords of a circle too.
    """
    held = {pin.name: pin for pin in _pins(problem) if pin.enclosed and not pin.misplaced}
    return {name: pin.interference for name, pin in held.items() if pin.overlaps}


@dataclass(frozen=True, eq=False)
class _Pin:
    """A disc and the edges that it touches.

    Attributes
    ----------
    name : str
        Of the contact.
    centre : (float, float)
        Of the disc [length].
    arms : (n, q, 2) array
        From points of the edges to the centre [length].
    normals : (n, q, 2) array
        Of the edges there, out of the body.
    radius : float
        Of the disc [length].

    """

    name: str
    centre: tuple[float, float]
    arms: FloatArray
    normals: FloatArray
    radius: float

    @property
    def away(self) -> FloatArray:
        """Distances of the points from the centre, shape (n, q) [length]."""
        return np.asarray(np.hypot(self.arms[..., 0], self.arms[..., 1]))

    @property
    def misplaced(self) -> bool:
        """Whether what is nearest to the centre faces away from it."""
        nearest = self.away <= self.away.min() * (1.0 + _SAME)
        return bool((self.normals[nearest] * self.arms[nearest]).sum() < 0.0)

    @property
    def enclosed(self) -> bool:
        """Whether the edges go around more than half of the centre."""
        first, second = self.arms[:, :-1], self.arms[:, 1:]
        cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
        turns = np.abs(np.arctan2(cross, (first * second).sum(axis=-1)))  # edges may lie either way round
        return bool(turns.sum() > np.pi * (1.0 + _SAME))

    @property
    def overlaps(self) -> bool:
        """Whether all points are nearer to the centre than the disc's radius."""
        return bool((self.radius - self.away).min() > _SAME * self.radius)

    @property
    def interference(self) -> float:
        """Radius of the disc less the mean distance of the vertices from its centre [length]."""
        return self.radius - float(self.away[:, [0, -1]].mean())


def _pins(problem: ContactProblem) -> Iterator[_Pin]:
    """All plates of a problem whose gap is the distance from a disc."""
    for contact in problem.contacts:
        pin = None if contact.plate is None else _pin(problem, contact, contact.plate.pivot)
        if pin is not None:
            yield pin


def _pin(problem: ContactProblem, contact: Contact, centre: tuple[float, float]) -> _Pin | None:
    edges, t = problem.mesh.edges(contact.edges), np.linspace(0.0, 1.0, _STEPS + 1)
    x, y = problem.mesh.points_along(edges, t)
    arms = np.stack([centre[0] - x, centre[1] - y], axis=-1)
    away = np.hypot(arms[..., 0], arms[..., 1])
    radii = away - evaluate("Contact.gap", contact.gap, x, y)
    if not (np.ptp(radii) <= _SAME * away.max() and radii.min() > 0.0):
        return None
    return _Pin(contact.name, centre, arms, vectors_along(edges, edges.normal, t, turns=True), float(radii.mean()))
