"""The norm of the friction operator R, proved or by finite elements, and how an error grows with it.

R takes displacements v of W, which vanish where displacements are prescribed, to W. On contacts with Coulomb friction
(Rv)_N = μ s v_T, s the share, and (Rv)_T = 0. On the others it has no normal part, and no tangential part where they
bear shear. Any such R with RR = 0 serves. For a norm r < 2, with

    α = 1 − r/2,   f = (4 + r²)/(4 − r²),

the residual ρ and the contact defect δ bound errors by F(ρ, δ) and what contacts miss by Σ ≤ ρ²/(4α) + δ.

Motions without strain that move contacts, which friction alone stops, have no R. What sticks of the contacts stops them
for all solutions whose stress is near enough to the computed one, see `Stopped`.

In `docs/theory.md`: (D26), (D28), (D30), (D39).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
from scipy.linalg import eigh, null_space, qr

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.bracket.proved_norms import proved_norm
from qvi_contact.bracket.share import Share
from qvi_contact.companion.solver import MOST, SINGULAR, BodyAtRest
from qvi_contact.companion.traces import DisplacementContact
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.problem.conditions import bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem

LARGEST: Final = 2.0
"""The norm s from which on nothing is bounded."""

UNHELD: Final = (
    "Friction alone holds a body along its contacts, and {}. Nothing is known of its errors: hold the body along a "
    "contact if there is a support in reality."
)
_DEGREE: Final = 3  # of displacements by which a norm is computed
_USEFUL: Final = 1.6  # norm up to which proved bounds are not many times as large as errors
_MOTIONS: Final = 3  # up to which every sense of each has a norm of its own
_PARTS: Final = (1.0, 0.5, 0.25, 0.125)  # of the friction that is left which are tried: the norm grows with it,
_NEARLY: Final = 0.75  # share of the largest reach that is enough
_ALIKE: Final = 1e-6  # of a motion's largest slip: edges that it moves alike
_STOPS: Final = 1e-6  # of the largest friction times slip: what stops a motion


def coercivity(s: float) -> float:
    """α = min a(e, e − Se)/|e|² = 1 − s/2, which is also min a(e, q)/|q|² for q = e − Se."""
    return 1.0 - s / 2.0


def amplification(s: float) -> float:
    """The factor f = max |e − Se| |e|/a(e, e − Se) = (4 + s²)/(4 − s²) of ρ, for 0 ≤ s < 2."""
    return (4.0 + s**2) / (4.0 - s**2)


def error_bound(residual: float, defect: float, s: float) -> float:
    """T2: F = ½ [fρ + √(f²ρ² + 4δ/α)], the larger root of x² = fρx + δ/α; infinite from s = 2 on."""
    if not s < LARGEST:
        return float("inf")
    grown = amplification(s) * residual
    return float(0.5 * (grown + np.hypot(grown, 2.0 * np.sqrt(defect / coercivity(s)))))


def defect_bound(residual: float, defect: float, s: float) -> float:
    """T2: Σ ≤ ρ²/(4α) + δ; infinite from s = 2 on."""
    return residual**2 / (4.0 * coercivity(s)) + defect if s < LARGEST else float("inf")


@dataclass(frozen=True)
class FrictionNorm:
    """A number that |R| does not exceed.

    Attributes
    ----------
    value : float
        The number; infinity where there is none.
    proved : bool
        Whether that is proved. Otherwise finite elements found it, on one mesh.
    reason : str
        Where it comes from, one sentence.
    stopped : Stopped or None
        The motions that friction alone stops, if there are any: R acts on displacements without them.

    """

    value: float
    proved: bool
    reason: str
    stopped: Stopped | None = None

    def work(self, problem: ContactProblem, shares: Mapping[str, Share], error: float, defect: float) -> float:
        """No less than ∫ (σ − τ) : ε(Re) for the R of other shares, by F and a bound of Σ; infinite without a norm.

        Where this norm is proved, that of R is, too.
        """
        if not any(share.values.any() for share in shares.values()):
            return 0.0
        if self.proved:
            return float(proved_norm(problem, shares)[0] * error**2)
        moved = 0.0 if self.stopped is None else self.stopped.work(shares, error, defect)
        return computed_norm(problem, shares, self.stopped) * error**2 + moved


def friction_norm(problem: ContactProblem, shares: Mapping[str, Share], unit: float = 1.0) -> FrictionNorm:
    """The least proved norm where there is one below 1.6, else that of finite elements; nothing is proved with arcs.

    Of several bodies it is the largest of the norms that each has alone. Weights of shares have the unit [stress].
    """
    value, bodies = proved_norm(problem, shares)
    if value < _USEFUL:
        return FrictionNorm(value, True, f"The norm of the friction operator is at most {value:.4g} on {bodies}.")
    value, stopped = computed_norm(problem, shares), None
    if value == np.inf:
        found = _ENERGIES[problem].stopped(problem, shares, unit)
        if isinstance(found, str):
            return FrictionNorm(np.inf, False, UNHELD.format(found))
        value, stopped = found.norm, found
    reason = f"The norm of the friction operator, {value:.3g}, was computed by finite elements, not proved."
    if np.isnan(value):
        return FrictionNorm(np.inf, False, "There are too many contact edges to compute the norm of friction.")
    if value >= LARGEST:
        reason = f"The bounds need a norm of the friction operator below 2. Here it is {value:.3g}."
    return FrictionNorm(value, False, reason, stopped)


def computed_norm(problem: ContactProblem, shares: Mapping[str, Share], stopped: Stopped | None = None) -> float:
    """The norm of the R whose images have the least energy, max |Rv|/|v|, among finite elements on the mesh.

    With x the slip on contacts with Coulomb friction, A x·x the least energy of displacements that slip by x, and
    D x·x that of those with the normal part μ s x and no other part on contacts that R must not have, the square is the
    largest λ of D x = λ A x, without the motions that friction stops; infinity where contacts can slip without strain,
    NaN where there are too many coefficients.
    """
    if problem not in _ENERGIES:
        _ENERGIES[problem] = _Energies.of(problem)
    return _ENERGIES[problem].norm(shares, None if stopped is None else stopped.others)


@dataclass(frozen=True, eq=False)
class Stopped:
    """Motions d_k without strain that friction alone stops, 1 ≤ k ≤ j.

    Each moves one group of edges by the slip 1, the others of the j groups not at all. With a part ω of the friction
    that is left where contacts stick, t_k is the mean of the slip of e = u − v over its group with the weight ω, and
    e₀ = e − Σ t_k d_k. For every solution with |σ − τ| < `reach`, and R for s + ω/B, with the senses of the t_k, in
    place of s,

        ∫ (σ − τ) : ε(e₀ − R e₀) + Σ |t_k| (M_k − |σ − τ||R d_k|) ≤ δ.                          (D39)
    """

    norm: float  # the largest norm of such R on displacements with means 0, for all senses
    others: FloatArray  # (n, n − j): basis of the slips with means 0
    motions: FloatArray  # (n, j): slips d_k
    masses: FloatArray  # (j,): M_k = ∫ ω ds over the group [energy per unit of displacement]
    images: FloatArray  # (j,): the largest |R d_k| for all senses [√energy per unit of displacement]
    energies: _Energies
    energy: float

    @property
    def reach(self) -> float:
        """S* = min M_k/|R d_k| [√energy]."""
        return float((self.masses / np.maximum(self.images, 1e-300)).min())

    def work(self, shares: Mapping[str, Share], error: float, defect: float) -> float:
        """No less than ∫ (σ − τ) : ε(Σ t_k R d_k) for the R of other shares, by F and δ + ρ²/(4α)."""
        sizes = self.energies.sizes(self.motions, shares) * np.sqrt(self.energy)
        return float(error * defect * (sizes / (self.masses - error * self.images)).max())


@dataclass(frozen=True, eq=False)
class _Energies:
    """Least energies of displacements by what they are on contacts with Coulomb friction."""

    traces: tuple[DisplacementContact, ...]  # the contacts, n coefficients
    # slips, presses, (n,) each: coefficients along and across contacts with Coulomb friction that can change
    slips: BoolArray
    presses: BoolArray
    # below, part: energies of given slips, and of given normal parts without tangential ones; empty where they are too
    # many
    below: FloatArray
    part: FloatArray
    unstrained: FloatArray  # basis of the slips without energy

    @classmethod
    def of(cls, problem: ContactProblem) -> _Energies:
        """By displacements on the mesh."""
        known = BodyAtRest.of(problem, _DEGREE)
        n, traces, none = known.contacts.count, known.contacts.traces, np.zeros((0, 0))
        coulomb, tied, rough = (
            np.repeat(np.array(chosen, dtype=bool), [line.count for line in traces])
            for chosen in zip(
                *((has_coulomb(c), c.law == "tied", bears_shear(c)) for c in problem.contacts), strict=True
            )
        )
        slips, presses, nowhere = coulomb & known.live[n:], coulomb & known.live[:n], np.zeros(n, dtype=bool)
        if len(known.live) > MOST:
            return cls(traces, slips, presses, none, none, none)
        below = known.least_energy(np.concatenate([nowhere, slips]), np.concatenate([tied, tied]))
        part = known.least_energy(np.concatenate([presses, nowhere]), np.concatenate([~presses, rough | tied]))
        values, vectors = np.linalg.eigh(below)
        return cls(traces, slips, presses, below, part, vectors[:, values <= SINGULAR * values[-1:]])

    def norm(self, shares: Mapping[str, Share], others: FloatArray | None = None) -> float:
        """The norm for shares s, of all slips or of those with a basis."""
        if not len(self.below):
            return float("nan") if self.slips.any() else 0.0
        if others is None and self.unstrained.shape[1]:
            return float("inf")
        return self._norm(self._image(shares), np.eye(len(self.below)) if others is None else others)

    def _norm(self, image: FloatArray, basis: FloatArray) -> float:
        """The norm on slips with a basis of what turns slips into normal parts."""
        if not image.any():
            return 0.0
        turned = image @ basis
        largest = eigh(turned.T @ self.part @ turned, basis.T @ self.below @ basis, eigvals_only=True)[-1]
        return float(np.sqrt(max(float(largest), 0.0)))

    def sizes(self, slips: FloatArray, shares: Mapping[str, Share]) -> FloatArray:
        """|Rv| of slips (n, j), dimensionless."""
        images = self._image(shares) @ slips
        return np.asarray(np.sqrt(np.maximum((images * (self.part @ images)).sum(axis=0), 0.0)))

    def _image(self, shares: Mapping[str, Share]) -> FloatArray:
        """Normal parts from slips, μ s x."""
        turned = np.zeros((len(self.slips),) * 2)
        for trace in self.traces:
            if trace.name in shares:
                share, p = shares[trace.name], trace.columns.shape[1] - 1
                nodes, back = bernstein.nodes(p), bernstein.from_values(p)
                factors = share.friction * share.at(nodes)
                blocks = np.einsum("ij,ej,jk,ek->eik", back, factors, bernstein.basis(p, nodes), trace.turned)
                columns = trace.start + trace.columns
                turned[columns[:, :, None], columns[:, None, :]] = blocks
        return turned[np.ix_(self.presses, self.slips)]

    def stopped(self, problem: ContactProblem, shares: Mapping[str, Share], unit: float) -> Stopped | str:
        """What stops the motions without strain, or why nothing does. Weights of shares have the unit [stress]."""
        scales, count, moved = Scales.of(problem), self.unstrained.shape[1], np.zeros(len(self.slips))
        motions = self.unstrained / np.abs(self.unstrained).max()
        moved[self.slips] = np.abs(motions).max(axis=1)
        moving = [each for each in self.traces if each.name in shares and moved[each.here].max() > _ALIKE]
        curved = [repr(trace.name) for trace in moving if trace.edges.curved]
        if curved:
            return f"it touches along the arcs of {' and '.join(curved)}"
        groups = self._groups(shares, unit / scales.stress)
        keys, means = (np.array(part) for part in zip(*((each.key, each.mean) for each in groups), strict=True))
        masses = (means * (motions @ keys.T).T).sum(axis=1) / np.maximum((keys**2).sum(axis=1), _ALIKE**2)
        _, size, order = qr((masses[:, None] * keys).T, pivoting=True)
        if len(keys) < count or not abs(size[count - 1, count - 1]) > _STOPS * abs(size[0, 0]):
            bears = {name: bool((share.room * share.weights).any()) for name, share in shares.items()}
            names = [repr(each.name) for each in moving if not bears[each.name]] or [repr(each.name) for each in moving]
            return f"no part of {' and '.join(names)} sticks that would stop it"
        chosen = order[:count]
        means, d = means[chosen], motions @ np.linalg.inv(keys[chosen])
        masses, others, image = np.diag(means @ d), null_space(means), self._image(shares)
        turned = [  # what friction left on each group turns into
            self._image(
                {name: replace(shares[name], values=way * shares[name].room) for name, way in groups[k].ways.items()}
            )
            for k in chosen
        ]

        def sizes(part: float) -> FloatArray:
            """The larger |R d_k| of both senses of d_k, dimensionless: the other groups it does not move."""
            both = ((image + sense * part * own) @ d[:, k] for k, own in enumerate(turned) for sense in (1.0, -1.0))
            found = [float(np.sqrt(max(v @ self.part @ v, 0.0))) for v in both]
            return np.maximum(found[::2], found[1::2])

        reaches = {part: float((part * masses / np.maximum(sizes(part), 1e-300)).min()) for part in _PARTS}
        part = min(part for part in _PARTS if reaches[part] >= _NEARLY * max(reaches.values()))
        if count <= _MOTIONS:
            senses = product((part, -part), repeat=count)
            norm = max(
                self._norm(image + sum(sense * own for sense, own in zip(each, turned, strict=True)), others)
                for each in senses
            )
        else:  # |Σ ± R_k v| ≤ √j (Σ |R_k v|²)^½
            work = sum(own.T @ self.part @ own for own in turned)
            largest = eigh(others.T @ work @ others, others.T @ self.below @ others, eigvals_only=True)[-1]
            norm = self._norm(image, others) + part * float(np.sqrt(count * largest))
        energy = scales.energy
        return Stopped(norm, others, d, part * energy * masses, np.sqrt(energy) * sizes(part), self, energy)

    def _groups(self, shares: Mapping[str, Share], unit: float) -> list[_Group]:
        """Edges that the motions without strain move alike, or against each other."""
        motions = np.zeros((len(self.slips), self.unstrained.shape[1]))
        motions[self.slips] = self.unstrained / np.abs(self.unstrained).max()
        found = list[_Group]()
        for trace in (trace for trace in self.traces if trace.name in shares):
            share, columns = shares[trace.name], trace.start + trace.columns
            products = bernstein.product_integrals(share.values.shape[1] - 1, columns.shape[1] - 1)
            means = np.zeros((len(columns), len(self.slips)))  # ∫ ω x_T ds on each edge
            works = unit * trace.lengths[:, None] * trace.turned * (share.room * share.weights @ products)
            np.add.at(means, (np.arange(len(columns))[:, None], columns), works)
            for edge, key in enumerate((trace.turned[..., None] * motions[columns]).mean(axis=1)):
                near = ((g, way) for g in found for way in (1, -1) if np.abs(key - way * g.key).max() < _ALIKE)
                group, way = next(near, (None, 1))
                if group is None:
                    group = _Group(key, np.zeros(int(self.slips.sum())), {})
                    found.append(group)
                own = group.ways.setdefault(trace.name, np.zeros((len(columns), 1)))
                own[edge] = way
                group.mean[:] += way * means[edge, self.slips]
        return found


@dataclass(frozen=True, eq=False)
class _Group:
    """Edges that motions move alike: that slip (j,), the functional ∫ ± ω x_T ds (n,), and ±1 on them, else 0."""

    key: FloatArray
    mean: FloatArray
    ways: dict[str, FloatArray]


_ENERGIES: WeakKeyDictionary[ContactProblem, _Energies] = WeakKeyDictionary()
"""Those of problems, as long as these are there: one bracket asks for several norms."""
