"""Springs along contacts: beds and compliant joints, whose energy belongs to the stress on the edge.

A contact with stiffnesses k_N and k_T has a layer of springs between the body and the obstacle. The law holds for what
is left of u after the springs, u_N + σ_N'/k_N and u_T + σ_T/k_T, and the complementary energy has

    ½ ∫ σ_N'²/k_N + σ_T²/k_T ds = ½ |S u + s|²

more, with rows of S for the Gauss points of the edges, over the degrees of freedom u of Φ.

In `docs/theory.md`: (D35).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, evaluate
from qvi_contact.discretization.loads import ContactRows, EdgePoints, physical, potential_at
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.space import StressSpace
from qvi_contact.problem.problem import ContactProblem

_LEAST = 1e-300  # of a stiffness


@dataclass(frozen=True, eq=False)
class Springs:
    """The rows of all springs, dimensionless.

    Attributes
    ----------
    rows : (r, N) sparse array
        S.
    constant : (r,) array
        s, of body forces and fluids.
    places : (r, 2) array
        Where they are.

    """

    rows: sparse.csr_array
    constant: FloatArray
    places: FloatArray

    @property
    def key(self) -> tuple[bytes, bytes]:
        """What tells S from that of other springs."""
        return self.rows.data.tobytes(), self.rows.indices.tobytes()

    @classmethod
    def of(
        cls, problem: ContactProblem, space: StressSpace, scales: Scales, contacts: Sequence[ContactRows]
    ) -> Springs | None:
        """Those of the contacts of a problem; None if all are rigid."""
        parts = []
        for rows, contact in zip(contacts, problem.contacts, strict=True):
            if contact.normal_stiffness is None and contact.tangential_stiffness is None:
                continue
            points = EdgePoints(space, rows.points.edges, space.degree + 1)
            x, y = physical(problem, scales, points.coordinates)
            table = space.trace_rows([points.edges], points.reference).matrix(space.size)
            count = len(points.weights)
            given = {"normal_stiffness": contact.normal_stiffness, "tangential_stiffness": contact.tangential_stiffness}
            for half, (name, field) in enumerate(given.items()):
                if field is not None:
                    stiffness = evaluate(f"Contact.{name}", field, x, y, minimum=_LEAST)
                    roots = np.sqrt(points.weights / (stiffness * scales.compliance * scales.length))
                    own = np.zeros(count)
                    if half == 0:
                        pressure = evaluate("Contact.pore_pressure", contact.pore_pressure, x, y, minimum=0.0)
                        own = potential_at(problem, scales, points.coordinates) + pressure / scales.stress
                    chosen = table[half * count : (half + 1) * count]
                    parts.append((sparse.diags_array(roots) @ chosen, roots * own, points.coordinates))
        if not parts:
            return None
        rows_of, constants, places = zip(*parts, strict=True)
        return cls(sparse.csr_array(sparse.vstack(rows_of)), np.concatenate(constants), np.concatenate(places))
