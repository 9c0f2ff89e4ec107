"""Checks proofs of bounds of a limit load: ``python check_proof.py FILE``.

The script needs nothing but Python's standard library, and all of its arithmetic is exact. The file states a body of
straight triangles that do not overlap, loads, strengths and contact laws. Triangles are joined by pairs of vertices
that they share; an edge of one triangle without a load or contact is held. Tractions on edges are multiplied by the
length of the edge. Conditions on polynomials on triangles and edges are checked at their Bernstein ordinates: the
values of a polynomial are convex combinations of these.

**The lower factor.** Stresses in equilibrium with the body force b, div σ + b = 0, carry the loads times "factor" if
tractions agree across every edge and with prescribed tractions, if the resultants on a plate are its forces and its
moment about the pivot, and if all ordinates of stress and of tractions on contacts are admissible.

**The upper factor.** Velocities v are zero where no traction is prescribed, and jump on contacts only. They dissipate
at most D = Σ |triangle| mean π(ε) + Σ mean π([v]) for every admissible stress. A plate moves as a rigid body, in
directions in which forces are given. In equilibrium the loads have the power P_dead + α P_live ≤ D. So no stress
carries more than α = (D − P_dead)/P_live; if P_live = 0 and D < P_dead, no stress carries any α.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from itertools import product
from math import comb, inf
from operator import mul
from typing import Any

FORMAT = 2

PLAIN = {"about", "multiplied", "missing", "name", "law", "triangles", "strength_of", "edge", "edges", "degree"}
"""Entries that are names and whole numbers."""


def check(proof: dict[str, Any]) -> tuple[Fraction | None, Fraction | float | None, Counter[str]]:
    """The factors below and above that are proved, None for a side that is not in the file, and the numbers of checks.

    The factor above is −inf if no multiple is carried. `ValueError` says which condition does not hold.
    """
    demand(proof["format"] == FORMAT, f"the file has format {proof['format']}, not {FORMAT}: write it once more")
    demand("stress" in proof or "flow" in proof, "the file has neither stresses nor velocities")
    proof, counted = exact(proof), Counter[str]()
    names = [contact["name"] for contact in proof["contacts"]]
    demand(len({*names}) == len(names), "two contacts have one name")
    vectors = [*proof["vertices"], *(d for load in proof["loads"] for d, _ in load["along"])]
    vectors += [contact["pivot"] for contact in proof["contacts"]]
    demand(all(len(each) == 2 for each in vectors), "a vertex, direction or pivot has not two coordinates")
    demand(all(gamma2 >= 0 for cones in proof["strengths"] for _, _, gamma2 in cones), "a strength has a negative γ²")
    demand_plane(proof)
    lower = carried(proof, counted) if "stress" in proof else None
    upper = exceeded(proof, counted) if "flow" in proof else None
    demand(lower is None or upper is None or lower <= upper, "the factors contradict each other")
    return lower, upper, +counted


def carried(proof: dict[str, Any], counted: Counter[str]) -> Fraction:
    """The load factor that the stresses (σ_xx, σ_yy, σ_xy) carry."""
    factor, resultants = proof["stress"]["factor"], dict[str, list[Any]]()
    b_x, b_y = at_factor(proof["body_force"], factor)
    for t, cones, _, slopes, stress in triangles(proof, proof["stress"]):
        for (xx_x, _), (_, yy_y), (xy_x, xy_y) in gradient(stress, slopes):
            demand(xx_x + xy_y + b_x == 0 == xy_x + yy_y + b_y, f"triangle {t} is not in equilibrium")
        for cone in cones:
            forms = [stress, *divided(stress, slopes)] if cone == [0, 1, 0] else [stress]
            is_within = any(all(within(cone, each) for each in form.values()) for form in forms)
            demand(is_within, f"a stress of triangle {t} is beyond its strength")
            counted["stresses in cones"] += len(stress)
    for edge, n, both, contact, pressure, loads in edges(proof, proof["stress"]):
        values, *other = [[(xx * n[0] + xy * n[1], xy * n[0] + yy * n[1]) for xx, yy, xy in side] for side in both]
        demand(other in ([], [values]), f"tractions across edge {edge} differ")
        counted["edges with tractions"] += 1
        counted["held edges with tractions"] += not contact and [given for _, given in loads] == [None, None]
        for d, given in loads:
            have = [dot(d, value) for value in values]
            demand(given is None or have == at_factor(given, factor), f"the traction on edge {edge} is not the load")
            counted["loads carried"] += given is not None
        if contact:
            effective = [(x + q * n[0], y + q * n[1]) for (x, y), q in zip(values, pressure, strict=True)]
            demand(admissible(contact, effective, n), f"contact {contact['name']!r} is beyond its law")
            counted["contact edges within their law"] += 1
            (x, y), (r_x, r_y) = zip(*values, strict=True), zip(*arms(proof, contact, edge), strict=True)
            resultant = mean(x), mean(y), mean(times(r_x, y)) - mean(times(r_y, x))
            resultants.setdefault(contact["name"], []).append(resultant)
    for contact in proof["contacts"]:
        for given, *parts in zip(contact["forces"], *resultants[contact["name"]], strict=True):
            told = f"tractions on the plate of contact {contact['name']!r} are not its forces"
            demand(given is None or [sum(parts)] == at_factor(given, factor), told)
            counted["resultants of plates"] += given is not None
    return Fraction(factor)


def exceeded(proof: dict[str, Any], counted: Counter[str]) -> Fraction | float:
    """The load factor that by the flow no stress exceeds."""
    flow, spent, powers = proof["flow"], Fraction(0), list[Any]()
    for contact in proof["contacts"]:
        told = f"the plate of contact {contact['name']!r} moves where no force is given"
        for given, part in zip(contact["forces"], flow["plates"][contact["name"]], strict=True):
            powers.append(power(given, [part], told))
    for (t, cones, area, slopes, v), rates in zip(triangles(proof, flow), flow["rates"], strict=True):
        for ((u_x, u_y), (v_x, v_y)), shares in zip(gradient(v, slopes), rates, strict=True):
            spent += area / len(rates) * dissipated(t, [u_x + v_y, u_x - v_y, u_y + v_x], cones, shares)
            counted["strain rates"] += 1
        drawn = [mean(along) for along in zip(*v.values(), strict=True)]
        powers.append([area * dot(force, drawn) for force in proof["body_force"]])
    for edge, n, (values, *other), contact, pressure, loads in edges(proof, flow):
        if contact:
            x, y, turn = flow["plates"][contact["name"]]
            ends = [(x - turn * r_y, y + turn * r_x) for r_x, r_y in arms(proof, contact, edge)]
            plate = zip(*(times(part, [1] * (len(values) - 1)) for part in zip(*ends, strict=True)), strict=True)
            jumps = [less(v, beyond) for v, beyond in zip(values, other[0] if other else plate, strict=True)]
            openings = [-dot(n, jump) for jump in jumps]
            spent += mean([slid(contact, w, abs(cross(n, jump))) for w, jump in zip(openings, jumps, strict=True)])
            powers.append([mean(times(pressure, openings)), 0])
            counted["contact edges that move"] += 1
        else:
            demand(other in ([], [values]), f"velocities across edge {edge} differ")
        for d, given in loads:
            along = [dot(d, value) / dot(d, d) for value in values]
            powers.append(power(given, along, f"edge {edge} moves where no traction is prescribed"))
        counted["edges with velocities"] += 1
        counted["held edges at rest"] += not contact and [given for _, given in loads] == [None, None]
    dead, live = map(sum, zip(*powers, strict=True))
    demand(live > 0 or (live == 0 and spent < dead), "the flow has no power of the loads")
    return (spent - dead) / live if live > 0 else -inf


def demand_plane(proof: dict[str, Any]) -> None:
    """`ValueError` if triangles overlap: two layers would carry twice the load of a plane body.

    Two triangles whose boxes overlap have no inner point in common if a line along an edge of one separates them.
    """
    reached = list[Any]()  # triangles that begin farther left and end farther right, with their ranges of y
    for corners in sorted(sorted(proof["vertices"][n] for n in names) for names in proof["triangles"]):
        low, _, high = sorted(y for _, y in corners)
        reached = [each for each in reached if each[0][2][0] > corners[0][0]]
        for other, lower, upper in reached:
            is_apart = lower >= high or low >= upper or separates(corners, other) or separates(other, corners)
            demand(is_apart, f"triangles overlap at ({', '.join(map(str, corners[0]))})")
        reached.append((corners, low, high))


def separates(triangle: list[Any], other: list[Any]) -> bool:
    """Whether the line along an edge of a triangle has the other triangle on its other side."""
    a, b, c = triangle
    return any(
        all(cross(less(q, p), less(r, p)) * cross(less(q, p), less(corner, p)) <= 0 for corner in other)
        for p, q, r in ((a, b, c), (b, c, a), (c, a, b))
    )


def triangles(proof: dict[str, Any], field: dict[str, Any]) -> Iterator[tuple[int, Any, Fraction, Any, dict[Any, Any]]]:
    """Number, cones, area, gradients of barycentric coordinates, and ordinates of a field, of every triangle."""
    demand(bool(proof["triangles"]), "the body has no triangles")
    demand(field["degree"] > 0, "a degree is not positive")
    counts = {len(each) for each in (proof["triangles"], proof["strength_of"], field["ordinates"])}
    demand(len(counts) == 1, "there are not as many strengths, or lists of ordinates, as triangles")
    for t, (names, values) in enumerate(zip(proof["triangles"], field["ordinates"], strict=True)):
        demand(len(values) == comb(field["degree"] + 2, 2), f"triangle {t} has not the ordinates of its degree")
        demand(min(*names, proof["strength_of"][t]) >= 0, f"triangle {t} has a negative number")
        a, b, c = (proof["vertices"][n] for n in names)
        twice = cross(less(b, a), less(c, a))
        demand(twice != 0, f"triangle {t} has no area")
        slopes = [(-y / twice, x / twice) for x, y in (less(c, b), less(a, c), less(b, a))]
        ordinates = dict(zip(exponents(field["degree"]), map(tuple, values), strict=True))
        yield t, proof["strengths"][proof["strength_of"][t]], abs(twice) / 2, slopes, ordinates


def edges(proof: dict[str, Any], field: dict[str, Any]) -> Iterator[tuple[Any, Any, Any, Any, Any, Any]]:
    """By edge from left to right: normal out of its first triangle, as long as the edge, and ordinates of both sides.

    Then its contact, the pressure in it, and two directions with the loads along them.
    """
    loaded: list[Any] = [(load["edge"], (None, None, load["along"])) for load in proof["loads"]]
    for contact in proof["contacts"]:
        loaded += [(edge, (contact, p, ())) for edge, p in zip(contact["edges"], contact["pressures"], strict=True)]
    loads_of, edges_found = {tuple(edge): each for edge, each in loaded}, dict[Any, list[Any]]()
    for (t, _, area, slopes, values), opposite in product(triangles(proof, field), range(3)):
        names, points = proof["triangles"][t], proof["vertices"]
        low, high = sorted({0, 1, 2} - {opposite}, key=lambda n: points[names[n]])
        along = sorted((alpha[high], alpha) for alpha in values if alpha[opposite] == 0)
        normal = tuple(-2 * area * part for part in slopes[opposite])
        edges_found.setdefault((names[low], names[high]), []).append((normal, [values[alpha] for _, alpha in along]))
    demand(len(loads_of) == len(loaded), "an edge has more than one load or contact")
    demand(loads_of.keys() <= edges_found.keys(), "there are loads or contacts where there is no edge")
    for edge, both in edges_found.items():
        (n, *others), sides = zip(*both, strict=True)
        demand(others in ([], [less((0, 0), n)]), f"triangles overlap at edge {edge}")
        support: Any = () if others else (((1, 0), None), ((0, 1), None))
        contact, pressure, loads = loads_of.get(edge, (None, None, support))
        demand(not others or not (loads or (contact and any(contact["forces"]))), f"edge {edge} is inside the body")
        along = [d for d, _ in loads]
        across = contact or others or (len(along) == 2 and dot(*along) == 0 < min(dot(d, d) for d in along))
        demand(bool(across), f"edge {edge} has not two loads along directions at a right angle")
        yield edge, n, sides, contact, pressure, loads


def arms(proof: dict[str, Any], contact: dict[str, Any], edge: Any) -> list[Any]:
    """The vectors from the pivot of a plate to the ends of an edge."""
    return [less(proof["vertices"][end], contact["pivot"]) for end in edge]


def power(given: Any, along: list[Any], told: str) -> list[Fraction]:
    """The powers of fixed and of multiplied forces along a direction; without forces (None) nothing may move."""
    demand(given is not None or not any(along), told)
    dead, live = given if given is not None else ([0], [0])
    return [mean(times(force, along)) for force in (dead, live)]


def law(contact: dict[str, Any]) -> tuple[Any, ...]:
    """Friction μ, cohesion c and cap t_max of a contact; a tied contact has no cap."""
    mu, c, cap = contact["friction"], contact["cohesion"], contact["shear_limit"]
    demand(min(mu, c, cap or 0) >= 0, f"contact {contact['name']!r} has a negative strength")
    demand(contact["law"] in ("unilateral", "bilateral", "tied"), f"contact {contact['name']!r} has an unknown law")
    return mu, c, inf if cap is None or contact["law"] == "tied" else cap


def within(cone: list[Any], stress: tuple[Any, ...]) -> bool:
    """Whether a stress is in the cone |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S, S = σ_xx + σ_yy."""
    (a, beta, gamma2), (xx, yy, xy) = cone, stress
    limit, square = a - beta * (xx + yy), (xx - yy) ** 2 + 4 * xy**2 + gamma2 * (xx + yy) ** 2
    return bool(limit >= 0 and square <= limit**2)


def divided(stress: dict[Any, Any], slopes: Any) -> Iterator[dict[Any, Any]]:
    """Ordinates of (σ_nn/λ², σ_tt, σ_nt/λ) for sides λ = 0 with the normal n = ∇λ, where these are polynomials.

    They bear no tension if and only if σ bears none inside the triangle: σ is D σ' D with the matrix D = diag(λ, 1).
    """
    for corner, (x, y) in enumerate(slopes):
        n, t = (x, y), (-y, x)
        parts = [{alpha: u[0] * v[0] * xx + u[1] * v[1] * yy + (u[0] * v[1] + u[1] * v[0]) * xy
                  for alpha, (xx, yy, xy) in stress.items()} for u, v in ((n, n), (t, t), (n, t))]  # fmt: skip
        if any(part[alpha] for part, k in zip(parts, (2, 0, 1), strict=True) for alpha in stress if alpha[corner] < k):
            continue
        nn, tt, nt = parts
        parts = [quotient(quotient(nn, corner), corner), tt, quotient(nt, corner)]
        yield {alpha: tuple(part[alpha] for part in parts) for alpha in stress}


def quotient(values: dict[Any, Any], corner: int) -> dict[Any, Any]:
    """Ordinates of f, written in the same degree, from those of λ f; λ is the barycentric coordinate of the corner."""
    quotients = dict(values)
    for alpha, i in product(values, {0, 1, 2} - {corner}):
        if alpha[i]:
            neighbour = tuple(alpha[n] + (n == corner) - (n == i) for n in range(3))
            quotients[alpha] = quotients[alpha] + Fraction(alpha[i], alpha[corner] + 1) * values[neighbour]
    return quotients


def admissible(contact: dict[str, Any], tractions: list[Any], normal: Any) -> bool:
    """|σ_T| ≤ min(c + μ p, t_max), p = −σ_N ≥ 0; on all of a bilateral edge p may be σ_N ≥ 0 instead, or count as 0.

    Any traction is admissible on a tied contact. It is enough to check ordinates of the polynomials of one degree more.
    """
    (mu, c, cap), square = law(contact), dot(normal, normal)
    n, t = (times([along(normal, each) for each in tractions], [1, 1]) for along in (dot, cross))
    return contact["law"] == "tied" or any(
        all(s * x <= 0 and abs(y) <= min(c * square - s * mu * x, cap * square) for x, y in zip(n, t, strict=True))
        for s in ((1, -1, 0) if contact["law"] == "bilateral" else (1,))
    )


def slid(contact: dict[str, Any], w: Fraction, t: Fraction) -> Fraction:
    """π of the opening w and slip t, the largest σ_N' w + |σ_T| t. Slip that dilates costs c, other slip t_max."""
    (mu, c, cap), parts = law(contact), contact["law"] == "unilateral"
    dilatant = min(t, w / mu if parts else Fraction(0)) if mu > 0 or contact["law"] == "tied" else t
    fits = (w >= 0 if parts else w == 0) and (dilatant == t or cap < inf)
    demand(fits, f"contact {contact['name']!r} cannot move like this")
    return Fraction(min(c, cap) * dilatant + (cap * (t - dilatant) if dilatant < t else 0))


def dissipated(t: int, strain: list[Any], cones: list[Any], shares: list[Any]) -> Fraction:
    """An upper bound of π of a strain rate (tr ε, ε_xx − ε_yy, 2 ε_xy). The first cone takes the rest of the shares.

    A cone dissipates at most a s/2 on its share (tr, d), if |(ρ, d)| ≤ s and tr = β s + γ ρ.
    """
    others, spent = [share for _, *share in shares[1:]], Fraction(0)
    first = [whole - sum(parts) for whole, *parts in zip(strain, *others, strict=True)]
    demand(bool(cones) or not any(strain), f"triangle {t} cannot flow like this")
    for (a, beta, gamma2), (s, *_), (trace, *d) in zip(cones, shares, [first, *others][: len(cones)], strict=True):
        square = s**2 - dot(d, d)
        flows = s >= 0 and square >= 0 and (trace - beta * s) ** 2 <= gamma2 * square
        demand(flows, f"triangle {t} cannot flow like this")
        spent += a * s / 2
    return spent


def gradient(values: dict[Any, Any], slopes: Any) -> list[list[tuple[Fraction, Fraction]]]:
    """Ordinates of the derivatives along x and y of every component."""
    degree, derivatives = sum(next(iter(values))), []
    for alpha in exponents(degree - 1):
        neighbours = [values[tuple(alpha[n] + (n == i) for n in range(3))] for i in range(3)]
        d_x, d_y = ([degree * sum(map(mul, component, axis)) for component in zip(*neighbours, strict=True)]
                    for axis in zip(*slopes, strict=True))  # fmt: skip
        derivatives.append(list(zip(d_x, d_y, strict=True)))
    return derivatives


def exponents(degree: int) -> list[tuple[int, int, int]]:
    """Exponents of the ordinates of a triangle, in their order."""
    return [(i, j, degree - i - j) for i in range(degree, -1, -1) for j in range(degree - i, -1, -1)]


def times(first: Sequence[Any], second: Sequence[Any]) -> list[Fraction]:
    """Ordinates of the product of two polynomials on an edge."""
    p, q = len(first) - 1, len(second) - 1
    product_ordinates = [Fraction(0)] * (p + q + 1)
    for i, j in ((i, j) for i in range(p + 1) for j in range(q + 1)):
        product_ordinates[i + j] += Fraction(comb(p, i) * comb(q, j), comb(p + q, i + j)) * first[i] * second[j]
    return product_ordinates


def mean(values: Sequence[Any]) -> Fraction:
    """The mean of a polynomial with given ordinates."""
    return sum(values, Fraction(0)) / len(values)


def at_factor(given: Any, factor: Fraction) -> list[Fraction]:
    """Fixed loads plus a multiple of the others."""
    demand(len({*map(len, given)}) == 1, "a load that stays and the one that is multiplied have not as many ordinates")
    return [dead + factor * live for dead, live in zip(*given, strict=True)]


def told(content: bytes) -> tuple[str, int]:
    """The text about a file with this content, and the exit status: 1 if a condition fails, 2 if it is no proof."""
    try:
        *proved, counted = check(parsed(content.decode()))
    except (
        LookupError, TypeError, AttributeError, ArithmeticError, UnicodeError, RecursionError, json.JSONDecodeError,
    ) as error:  # fmt: skip
        return f"no proof file of format {FORMAT} ({type(error).__name__} {error})", 2
    except ValueError as error:
        return f"not proved: {error}", 1
    checked = ", ".join(f"{count} {name}" for name, count in counted.items())
    return "\n".join([*sentences(*proved), f"checked: {checked}"]), 0


def parsed(text: str) -> Any:
    """The content of a file, decimals as fractions; `ValueError` if an entry is there twice."""

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        demand(len(dict(pairs)) == len(pairs), f"the file has an entry twice: {', '.join(key for key, _ in pairs)}")
        return dict(pairs)

    return json.loads(text, object_pairs_hook=once, parse_float=Fraction)


def exact(value: Any, *, named: bool = False) -> Any:
    """Numbers, and texts of numbers, as fractions; entries of `PLAIN` unchanged, unless their keys are names."""
    if isinstance(value, dict):
        return {key: each if key in PLAIN and not named else exact(each, named=key == "plates")
                for key, each in value.items()}  # fmt: skip
    if isinstance(value, list):
        return [exact(each) for each in value]
    return value if value is None else Fraction(value)


def less(u: Any, v: Any) -> Any:
    """U − v."""
    return (u[0] - v[0], u[1] - v[1])


def dot(u: Any, v: Any) -> Any:
    """U·v."""
    return u[0] * v[0] + u[1] * v[1]


def cross(u: Any, v: Any) -> Any:
    """U × v."""
    return u[0] * v[1] - u[1] * v[0]


def demand(holds: bool, otherwise: str) -> None:
    """`ValueError` with the text `otherwise` unless the condition holds."""
    if not holds:
        raise ValueError(otherwise)


def sentences(lower: Fraction | float | None, upper: Fraction | float | None) -> list[str]:
    """The proved factors in words, rounded to the safe side."""
    found = []
    if isinstance(lower, Fraction):
        found.append(f"proved: the loads times {rounded(lower, ROUND_FLOOR)} are carried")
    if isinstance(upper, Fraction):
        found.append(f"proved: no stress carries the loads times more than {rounded(upper, ROUND_CEILING)}")
    return [*found, "proved: no stress carries any multiple of the loads"] if upper == -inf else found


def rounded(value: Fraction, towards: str) -> Decimal:
    """A fraction as a decimal of twelve digits."""
    return Context(12, towards).divide(Decimal(value.numerator), Decimal(value.denominator))


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as file:
        text, status = told(file.read())
    print(text, file=sys.stderr if status == 2 else sys.stdout)
    sys.exit(status)
