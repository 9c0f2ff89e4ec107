"""What certifies the results behind a row."""

from dataclasses import dataclass

import numpy as np

from qvi_contact import ContactResult
from qvi_contact.companion import CompanionResult
from qvi_contact.limit.load_factor import LimitLoad
from solvers import QVISolution, Status
from solvers.certificate.feasibility import is_farkas

GAP = 1e-7
"""Largest relative gap between a limit load and its dual bound, and largest violation of the laws at it."""


@dataclass(frozen=True)
class Proof:
    """Whether something certifies a number, and what.

    Attributes
    ----------
    passed : bool
        Without it the row fails, however small its error.
    text : str
        What it is, in a few words.

    """

    passed: bool
    text: str


def certified(*results: ContactResult) -> Proof:
    """The certificates of results that must all be solved."""
    failed = [result.status.value for result in results if not _solved(result.solution)]
    return Proof(not failed and bool(results), ", ".join(["failed", *failed]) if failed else "certificate")


def certified_algebra(solution: QVISolution) -> Proof:
    """The certificate of an algebraic solution."""
    passed = _solved(solution)
    return Proof(passed, "certificate" if passed else f"failed, {solution.status.value}")


def certified_companion(companion: CompanionResult, *, guaranteed: bool = False) -> Proof:
    """The certificate of a displacement model, and if asked that its energy is an upper bound."""
    if not (companion.status is Status.SOLVED and companion.certificate.passed):
        return Proof(passed=False, text=f"failed, {companion.status.value}")
    if guaranteed and companion.reasons:
        return Proof(passed=False, text=f"failed, {companion.reasons[0]}")
    return Proof(passed=True, text="certificate, bound guaranteed" if guaranteed else "certificate")


def infeasible(*results: ContactResult) -> Proof:
    """Mechanisms that prove that nothing carries the load; multipliers (Farkas) for the mesh are checked again too."""
    passed = all(_is_impossible(result) for result in results) and bool(results)
    return Proof(passed, "mechanism, Farkas proof" if passed else "failed, no proof")


def bounded(*limits: LimitLoad) -> Proof:
    """Dual bounds that close on the limit loads of a mesh, which lie below those of mechanisms."""
    passed = all(_closes(limit) for limit in limits) and bool(limits)
    return Proof(passed, "dual bound" if passed else "failed, bounds apart")


def both(*proofs: Proof) -> Proof:
    """All of several proofs."""
    texts = dict.fromkeys(text for proof in proofs for text in proof.text.split(", "))
    return Proof(all(proof.passed for proof in proofs) and bool(proofs), ", ".join(texts))


def by_hand(passed: bool, text: str) -> Proof:
    """A proof computed for the row itself, where the result is that there is none."""
    return Proof(bool(passed), text if passed else f"failed: {text}")


def _solved(solution: QVISolution) -> bool:
    return solution.status is Status.SOLVED and solution.certificate.passed


def _is_impossible(result: ContactResult) -> bool:
    proof = result.solution.farkas
    proved = proof is not None and is_farkas(result.solution.problem, *proof)
    return result.mechanism is not None and result.mechanism.overload > 1.0 and proved


def _closes(limit: LimitLoad) -> bool:
    if not np.isfinite(limit.lower):
        return False
    below = limit.lower <= limit.upper + GAP * (1.0 + abs(limit.lower))
    return below and limit.bound - limit.lower <= GAP * (1.0 + abs(limit.lower)) and limit.violation <= GAP
