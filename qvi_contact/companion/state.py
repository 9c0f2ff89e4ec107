"""What the displacement model finds: a displacement that meets all conditions, its contacts, its energy's parts."""

from dataclasses import dataclass

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.companion.dual import Contacts


@dataclass(frozen=True)
class CompanionParts:
    """Parts of the energy J(v) = strain − load + friction, a unit of thickness [stress × length²].

    Attributes
    ----------
    strain : float
        ½ ∫ ε:C:ε.
    load : float
        ∫ b·v + ∫_{Γσ} T·v + Σ F·q, q the motions of plates under the forces F.
    friction : float
        Σ ∫ s |v_T − w| ds ≥ 0 for given bounds; under the contacts' own laws Σ W_i s_i |c_i − w_i|, no less than that.

    """

    strain: float
    load: float
    friction: float


@dataclass(frozen=True, eq=False)
class CompanionContact:
    """One contact in the displacement model; arrays over the n Bernstein coefficients of its trace.

    Coefficients come in order along the line: by x, and by y where x is the same. Several lines of one contact mix if
    they overlap in x.

    A quantity at a coefficient is no value at a point: a displacement is the coefficient itself, a traction the mean
    weighted by B_i. Coefficients whose displacement supports prescribe carry no traction here; it is the support's.

    Attributes
    ----------
    name : str
        Name of the contact.
    x, y : (n,) arrays
        The coefficients' own points, i/p along each edge [length].
    weights : (n,) array
        ∫ B_i ds [length].
    normal_stress, tangential_stress : (n,) arrays
        Mean tractions [stress], signs as in `ContactLine`, the pressure of a fluid included.
    friction_bound : (n,) array
        Bound of |tangential_stress| [stress]; infinity if tied.
    gap : (n,) array
        g − v_N ≥ 0 [length].
    slip : (n,) array
        v_T − w [length].
    state : (n,) int array
        `ContactState`.
    senses : (n,) array
        ±1, in which sense a tangential stress counts for the force, see `turning_senses`.

    """

    name: str
    x: FloatArray
    y: FloatArray
    weights: FloatArray
    normal_stress: FloatArray
    tangential_stress: FloatArray
    friction_bound: FloatArray
    gap: FloatArray
    slip: FloatArray
    state: IntArray
    senses: FloatArray

    @property
    def normal_force(self) -> float:
        """−∫ σ_N ds, ≥ 0 if unilateral [stress × length]."""
        return -float(self.weights @ self.normal_stress)

    @property
    def tangential_force(self) -> float:
        """∫ ± σ_T ds, force on the body along the contact, as that of `ContactLine` [stress × length]."""
        return float(self.weights @ (self.senses * self.tangential_stress))


@dataclass(frozen=True, eq=False)
class CompanionState:
    """A displacement that meets all conditions, dimensionless.

    Attributes
    ----------
    contacts : Contacts
        The contacts; arrays over their n coefficients.
    v : (size,) array
        Degrees of freedom.
    c : (2 n,) array
        Relative displacements, normal ones first.
    plates : (q,) array
        Motions of plates.
    tractions : (2 n,) array
        τ.
    live : (2 n,) bool array
        Where there is a force, see `DualProblem`; elsewhere τ is zero.
    bound : (n,) array
        Bound of |τ_T|.
    load : (size,) array
        Load vector.
    reasons : tuple of str
        Conditions that could not be met.

    """

    contacts: Contacts
    v: FloatArray
    c: FloatArray
    plates: FloatArray
    tractions: FloatArray
    live: BoolArray
    bound: FloatArray
    load: FloatArray
    reasons: tuple[str, ...]
