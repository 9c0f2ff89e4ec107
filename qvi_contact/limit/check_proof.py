"""Checks proofs of what a body carries and of what it does not: ``python check_proof.py FILE``.

It needs nothing but Python's standard library, and all of its arithmetic is exact. The file states a body of straight
triangles, loads, strengths and contact laws; each triangle is cut into three parts at its barycentre. What is said of
polynomials on parts and edges is said of their Bernstein ordinates: a polynomial is a convex combination of these.

**What is carried.** An Airy function Φ of degree p has the stresses σ_xx = Φ_yy + φ, σ_yy = Φ_xx + φ, σ_xy = −Φ_xy with
the potential φ of the body force, in equilibrium whatever Φ is. They carry the loads times "factor" if tractions agree
across every edge, are the prescribed ones, have on a plate its forces and its moment about the pivot as resultants, and
all ordinates of stress and of tractions on contacts are admissible.

**What is not.** Velocities v that are zero where no traction is prescribed, and jump on contacts only, dissipate at
most D = Σ |part| mean π(ε) + Σ mean π([v]) for every admissible stress. A plate moves as a rigid body, where forces are
given. In equilibrium the loads have the power P_dead + α P_live ≤ D. So no stress carries more than
α = (D − P_dead)/P_live; and none carries any α if P_live = 0 and D < P_dead. Roots are rational numbers from above.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product
from math import comb, inf, isqrt
from typing import Any, NamedTuple


def check(proof: dict[str, Any]) -> tuple[Fraction | None, Fraction | float | None, Counter[str]]:
    """Factors below and above that are proved, None where the file does not speak of one, and how much was checked.

    The factor above is −inf if no multiple is carried. `ValueError` says what does not hold.
    """
    proof = {**proof, "strengths": [[_exact(cone) for cone in law] for law in proof["strengths"]]}
    proof["potential"], counted = _exact(proof["potential"]), Counter[str]()
    lower = _carried(proof, counted) if "airy" in proof else None
    upper = _exceeded(proof, counted) if "flow" in proof else None
    _demand(lower is None or upper is None or lower <= upper, "the factors contradict each other")
    return lower, upper, counted


class Side(NamedTuple):
    """A side of a part."""

    values: list[Any]  # ordinates along it
    normal: Any  # as long as the side
    out: int  # 1 if the normal points out, −1 if in
    start: Any

    def arms(self, plate: dict[str, Any], count: int) -> list[Any]:
        """From the pivot of a plate to places along the side, as many as are counted."""
        x, y = _less(self.start, plate["pivot"])
        shares = [Fraction(m, count - 1) for m in range(count)]
        return [(x - share * self.normal[1], y + share * self.normal[0]) for share in shares]


def _carried(proof: dict[str, Any], counted: Counter[str]) -> Fraction:
    """The factor of the loads that the Airy function carries."""
    factor, p, tractions = Fraction(proof["factor"]), proof["degree"], dict[Any, list[Side]]()
    phi = [a + factor * b for a, b in zip(proof["potential"]["dead"], proof["potential"]["live"], strict=True)]
    for t, names, ends, slopes, c in _parts(proof, proof["airy"], p):
        stress = {}
        for alpha in _exponents(p - 2):
            h = [[Fraction(0)] * 2 for _ in range(2)]  # second derivatives
            for i, j, (x, y) in product(range(3), range(3), ((0, 0), (0, 1), (1, 1))):
                value = p * (p - 1) * c[tuple(alpha[n] + (n == i) + (n == j) for n in range(3))]
                h[x][y] += value * slopes[i][x] * slopes[j][y]
            at = [sum((Fraction(alpha[n], p - 2) * ends[n][i] for n in range(3)), Fraction(0)) for i in (0, 1)]
            stress[alpha] = s = (h[1][1] + _affine(phi, at), h[0][0] + _affine(phi, at), -h[0][1])
            for cone in _cones(proof, t):
                _demand(_inside(s, _affine(cone["a"], at), cone), f"a stress of triangle {t} is beyond its strength")
                counted["stresses in cones"] += 1
        for edge, side in _sides(names, ends, stress):
            n, values = side.normal, side.values
            values = [(s[0] * n[0] + s[2] * n[1], s[2] * n[0] + s[1] * n[1]) for s in values]
            tractions.setdefault(edge, []).append(side._replace(values=values))
    for edge, sides in tractions.items():
        _demand(_alone(edge, sides) or sides[0].values == sides[1].values, f"tractions across edge {edge} differ")
        counted["edges with tractions"] += 1
    for edge, loads in _loads(proof).items():
        side, *more = tractions[edge]
        for d, dead, live in loads:
            given = [a + factor * b for a, b in zip(dead, live, strict=True)]
            have = [side.out * _dot(d, value) for value in side.values]
            _demand(not more and have == given, f"the traction on edge {edge} is not the load")
            counted["loads carried"] += 1
    _on_contacts(proof, factor, tractions, counted)
    return factor


def _on_contacts(proof: dict[str, Any], factor: Fraction, tractions: dict[Any, list[Side]], counted: Counter[str]
                 ) -> None:  # fmt: skip
    """Tractions keep the laws of contacts, and are the forces of plates."""
    for edge, (contact, pressure) in _contacts(proof).items():
        values, n = tractions[edge][0][:2]
        pressure = pressure or [Fraction(0)] * len(values)
        effective = [(s[0] + q * n[0], s[1] + q * n[1]) for s, q in zip(values, pressure, strict=True)]
        beyond = f"contact {contact['name']!r} is beyond its law"
        _demand(_admissible(contact, _elevated(effective), n), beyond)
        counted["contact edges within their law"] += 1
    for contact in proof["contacts"]:
        if "plate" in contact:
            on_edges = [tractions[_key(edge)] for edge in contact["edges"]]
            counted["resultants of plates"] += _driven(contact, factor, on_edges)


def _driven(contact: dict[str, Any], factor: Fraction, sides: list[list[Side]]) -> int:
    """How many resultants of tractions on a plate, two forces and the moment about its pivot, are prescribed."""
    plate, have = _exact(contact["plate"]), [Fraction(0)] * 3
    for side, *more in sides:
        _demand(not more, "a plate is inside the body")
        (r_x, r_y), (x, y) = zip(*side.arms(plate, 2), strict=True), zip(*side.values, strict=True)
        parts = (sum(x) / len(x), sum(y) / len(y), _product(r_x, y) - _product(r_y, x))
        have = [whole + side.out * part for whole, part in zip(have, parts, strict=True)]
    given = [(n, plate["dead"][n] + factor * plate["live"][n]) for n in range(3) if plate["dead"][n] is not None]
    told = f"tractions on the plate of contact {contact['name']!r} are not its forces"
    _demand(all(have[n] == force for n, force in given), told)
    return len(given)


def _exceeded(proof: dict[str, Any], counted: Counter[str]) -> Fraction | float:
    """The factor that the flow proves no stress to exceed."""
    flow, spent, power = proof["flow"], Fraction(0), _powers_of_plates(proof)
    velocities, loads, contacts = dict[Any, list[Side]](), _loads(proof), _contacts(proof)
    degree = flow["degree"]
    for t, names, ends, slopes, v in _parts(proof, flow["velocities"], degree):
        area = abs(_cross(_less(ends[1], ends[0]), _less(ends[2], ends[0]))) / 2
        for alpha in _exponents(degree - 1):
            near = [v[tuple(alpha[n] + (n == i) for n in range(3))] for i in range(3)]
            g = [[sum(degree * near[n][x] * slopes[n][y] for n in range(3)) for y in (0, 1)] for x in (0, 1)]
            strain = [g[0][0] + g[1][1], g[0][0] - g[1][1], g[0][1] + g[1][0]]
            rate = _dissipated(strain, _cones(proof, t), flow["shares"].get(str(counted["strain rates"])), ends)
            _demand(rate < inf, f"triangle {t} cannot flow like this")
            spent += area * Fraction(rate) / len(_exponents(degree - 1))
            counted["strain rates"] += 1
        for kind, phi in proof["potential"].items():
            power[kind] -= area * sum(_dot(phi[1:], value) for value in v.values()) / len(v)
        for edge, side in _sides(names, ends, v):
            velocities.setdefault(edge, []).append(side)
    _demand({*loads, *contacts} <= velocities.keys(), "there are loads or contacts where there is no edge")
    for edge, sides in velocities.items():
        alone, (values, normal, out, _) = _alone(edge, sides), sides[0]
        if edge in contacts:
            contact, pressure = contacts[edge]
            jumps = list(map(_less, values, _beyond(contact, flow, *sides)))
            openings = [-out * _dot(normal, jump) for jump in jumps]
            for w, jump in zip(openings, jumps, strict=True):
                spent += _slid(contact, w, abs(_cross(normal, jump))) / len(values)
            power["dead"] += _product(pressure, openings) if pressure else 0
            counted["contact edges that move"] += 1
        elif alone:
            for kind, value in _powers(edge, values, loads.get(edge, [])):
                power[kind] += value
        else:
            _demand(values == sides[1].values, f"velocities across edge {edge} differ")
        counted["edges with velocities"] += 1
    least = spent - power["dead"]
    _demand(power["live"] > 0 or (power["live"] == 0 and least < 0), "the flow has no power of the loads")
    return least / power["live"] if power["live"] > 0 else -inf


def _powers_of_plates(proof: dict[str, Any]) -> dict[str, Fraction]:
    """The power of forces on plates, which move in their components only."""
    found = {"dead": Fraction(0), "live": Fraction(0)}
    for contact in proof["contacts"]:
        if "plate" in contact:
            plate, motion = _exact([contact["plate"], proof["flow"]["plates"][contact["name"]]])
            for dead, live, part in zip(plate["dead"], plate["live"], motion, strict=True):
                told = f"the plate of contact {contact['name']!r} moves where no force is given"
                _demand(dead is not None or part == 0, told)
                found["dead"] += (dead or 0) * part
                found["live"] += (live or 0) * part
    return found


def _beyond(contact: dict[str, Any], flow: dict[str, Any], side: Side, *other: Side) -> list[Any]:
    """Velocities of what a contact is with: another body, an obstacle at rest, or a plate that forces drive."""
    if "plate" not in contact:
        return other[0].values if other else [(0, 0)] * len(side.values)
    _demand(not other, "a plate is inside the body")
    plate, (x, y, turn) = _exact([contact["plate"], flow["plates"][contact["name"]]])
    return [(x - turn * r_y, y + turn * r_x) for r_x, r_y in side.arms(plate, len(side.values))]


def _powers(edge: Any, velocities: list[Any], loads: list[tuple[Any, Any, Any]]) -> Iterator[tuple[str, Fraction]]:
    """The power of the loads on an edge, along which v must be zero in the directions without a load."""
    _demand(len(loads) < 2 or (len(loads) == 2 and _dot(loads[0][0], loads[1][0]) == 0), f"edge {edge} is overloaded")
    for v in velocities:
        rest = v
        for d, _, _ in loads:
            rest = _less(rest, [_dot(d, v) * each / _dot(d, d) for each in d])
        _demand(_dot(rest, rest) == 0, f"edge {edge} moves where no traction is prescribed")
    for d, dead, live in loads:
        along = [_dot(d, v) / _dot(d, d) for v in velocities]
        for kind, values in (("dead", dead), ("live", live)):
            yield kind, _product(values, along)


def _parts(proof: dict[str, Any], values: Any, degree: int) -> Iterator[tuple[int, Any, Any, Any, dict[Any, Any]]]:
    """Triangle, names of corners, corners, gradients of barycentric coordinates, and ordinates, of every part."""
    vertices = _exact(proof["vertices"])
    for t, (corners, of_triangle) in enumerate(zip(proof["triangles"], values, strict=True)):
        points = [vertices[v] for v in corners]
        centre = [sum((q[i] for q in points), Fraction(0)) / 3 for i in (0, 1)]
        for part, (a, b) in zip(of_triangle, ((1, 2), (0, 2), (0, 1)), strict=True):
            ends = [points[a], points[b], centre]
            det = _cross(_less(ends[1], ends[0]), _less(ends[2], ends[0]))
            _demand(det != 0, f"triangle {t} has no area")
            opposite = [_less(ends[(i + 2) % 3], ends[(i + 1) % 3]) for i in range(3)]
            slopes = [(-u[1] / det, u[0] / det) for u in opposite]
            ordinates = dict(zip(_exponents(degree), _exact(part), strict=True))
            yield t, [corners[a], corners[b], f"centre {t}"], ends, slopes, ordinates


def _sides(names: list[Any], ends: list[Any], values: dict[Any, Any]) -> Iterator[tuple[Any, Side]]:
    """The sides of a part with their names."""
    k = max(alpha[0] for alpha in values)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        first, second = sorted((i, j), key=lambda n: str(names[n]))
        along = _less(ends[second], ends[first])
        normal = (along[1], -along[0])
        out = 1 if _dot(normal, _less(ends[first], ends[3 - i - j])) > 0 else -1
        at = [tuple((k - m) * (n == first) + m * (n == second) for n in range(3)) for m in range(k + 1)]
        yield _key([names[first], names[second]]), Side([values[alpha] for alpha in at], normal, out, ends[first])


def _alone(edge: Any, sides: list[Side]) -> bool:
    """Whether an edge is on the boundary; else it has parts on both sides."""
    _demand(len(sides) == 1 or (len(sides) == 2 and sides[0].out != sides[1].out), f"triangles overlap at edge {edge}")
    return len(sides) == 1


def _key(edge: Any) -> tuple[str, ...]:
    return tuple(sorted(map(str, edge)))


def _cones(proof: dict[str, Any], t: int) -> list[dict[str, Any]]:
    """The cones of the strength of a triangle; none if it is rigid, and carries any stress."""
    law = proof["strength_of"][t]
    return [] if law is None else list(proof["strengths"][law])


def _contacts(proof: dict[str, Any]) -> dict[Any, tuple[dict[str, Any], list[Any]]]:
    """By edges: the contact, and ordinates of the pressure of a fluid in it, if there is one."""
    return {
        _key(edge): (contact, _along(edge, pressure))
        for contact in proof["contacts"]
        for edge, pressure in zip(
            contact["edges"], contact.get("pressures") or [[]] * len(contact["edges"]), strict=True
        )
    }


def _loads(proof: dict[str, Any]) -> dict[Any, list[tuple[Any, Any, Any]]]:
    """By edges: d, and ordinates of d·σn that stay and that are multiplied, n outward and as long as the edge."""
    found: dict[Any, list[tuple[Any, Any, Any]]] = {}
    for load in proof["loads"]:
        dead, live = (_along(load["edge"], load[kind]) for kind in ("dead", "live"))
        found.setdefault(_key(load["edge"]), []).append((_exact(load["direction"]), dead, live))
    return found


def _along(edge: Any, ordinates: Any) -> list[Any]:
    """Ordinates in the order in which `_sides` has the ends of an edge."""
    return list(_exact(ordinates)[:: 1 if tuple(map(str, edge)) == _key(edge) else -1])


def _elevated(values: list[Any]) -> list[Any]:
    """The ordinates of the same polynomials with one degree more; where these keep a law, all points do."""
    k = len(values)
    ends = [values[0], *values, values[-1]]
    return [tuple((m * a + (k - m) * b) / k for a, b in zip(ends[m], ends[m + 1], strict=True)) for m in range(k + 1)]


def _product(first: Sequence[Any], second: Sequence[Any]) -> Fraction:
    """∫ of the product of two polynomials on [0, 1]."""
    p, q = len(first) - 1, len(second) - 1
    parts = [Fraction(comb(p, i) * comb(q, j), comb(p + q, i + j)) * a * b
             for i, a in enumerate(first) for j, b in enumerate(second)]  # fmt: skip
    return sum(parts, Fraction(0)) / (p + q + 1)


def _law(contact: dict[str, Any]) -> tuple[bool, Fraction, Fraction, Fraction | float]:
    cap = contact["shear_limit"]
    mu, c = Fraction(contact["friction"]), Fraction(contact["cohesion"])
    return contact["law"] != "unilateral", mu, c, inf if cap is None else Fraction(cap)


def _admissible(contact: dict[str, Any], tractions: list[Any], normal: Any) -> bool:
    """|σ_T| ≤ min(c + μ p, t_max) with p = −σ_N ≥ 0; if bilateral p may be σ_N, too, or count as 0, on a whole edge.

    What is tied carries all.
    """
    bilateral, mu, c, cap = _law(contact)
    square = _dot(normal, normal)
    n, t = ([product(normal, each) for each in tractions] for product in (_dot, _cross))
    return contact["law"] == "tied" or any(
        all(
            sign * x <= 0 and abs(y) <= min(c * square - sign * mu * x, cap * square) for x, y in zip(n, t, strict=True)
        )
        for sign in ((1, -1, 0) if bilateral else (1,))
    )


def _slid(contact: dict[str, Any], w: Fraction, t: Fraction) -> Fraction:
    """π of the opening w and slip t: the most that −σ_N' w + |σ_T| t can be."""
    bilateral, mu, c, cap = _law(contact)
    stuck = (contact["law"] == "tied" and t != 0) or (mu > 0 and cap == inf and (t != 0 if bilateral else w < mu * t))
    _demand(not stuck and (w == 0 if bilateral else w >= 0), f"contact {contact['name']!r} cannot move like this")
    if mu == 0 or cap == inf:
        return Fraction(min(c, cap) * t if t else 0)
    dilatant = Fraction(0) if bilateral else min(t, w / mu)
    return Fraction(cap * t - max(cap - c, 0) * dilatant)


def _inside(stress: Any, a: Fraction, cone: dict[str, Any]) -> bool:
    """gamma2 S² + (σ_xx − σ_yy)² + 4 σ_xy² ≤ (f a − β S)², or ≤ f2 a² where that is given, with S = σ_xx + σ_yy."""
    total, radius = stress[0] + stress[1], (stress[0] - stress[1]) ** 2 + 4 * stress[2] ** 2
    if "f2" in cone:
        return bool(a >= 0 and radius + cone["gamma2"] * total**2 <= cone["f2"] * a**2)
    limit = cone["f"] * a - cone["beta"] * total
    return bool(limit >= 0 and radius <= limit**2)


def _dissipated(strain: list[Any], cones: list[Any], shares: Any, ends: list[Any]) -> Fraction | float:
    """π of a strain rate (tr ε, ε_xx − ε_yy, 2 ε_xy), or a little more: in one of the cones, or shared by all."""
    if shares is None:
        return min([inf if any(strain) else 0, *(_rate(strain, cone, ends) for cone in cones)])
    shares = _exact(shares)  # that of the cone which is left out is the rest
    rest = [whole - sum(each[i] for each in shares if each) for i, whole in enumerate(strain)]
    return sum(_rate(share or rest, cone, ends) for share, cone in zip(shares, cones, strict=True))


def _rate(strain: list[Any], cone: dict[str, Any], ends: list[Any]) -> Fraction | float:
    """The same in one cone; inf if there is no bound."""
    trace, d2 = strain[0], strain[1] ** 2 + strain[2] ** 2
    a = max(_affine(cone["a"], at) for at in ends)
    if "f2" in cone and cone["gamma2"] > 0:
        return a * _root(cone["f2"] * (d2 + trace**2 / cone["gamma2"])) / 2
    if "f2" in cone or cone["beta"] == 0:
        return a * _root(d2 * (cone["f2"] if "f2" in cone else cone["f"] ** 2)) / 2 if trace == 0 else inf
    s = trace / cone["beta"]
    return cone["f"] * a * s / 2 if s >= 0 and s**2 >= d2 else inf


def _root(x: Fraction) -> Fraction:
    """A number not below √x."""
    return Fraction(isqrt(x.numerator * 4**128 // x.denominator) + 1, 2**128) if x else x


def _affine(parts: Any, at: Any) -> Fraction:
    return Fraction(parts[0] + parts[1] * at[0] + parts[2] * at[1])


def _exponents(degree: int) -> list[tuple[int, ...]]:
    return [(i, j, degree - i - j) for i in range(degree, -1, -1) for j in range(degree - i, -1, -1)]


def _exact(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _exact(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_exact(each) for each in value]
    return None if value is None else Fraction(value)


def _less(u: Any, v: Any) -> Any:
    return (u[0] - v[0], u[1] - v[1])


def _dot(u: Any, v: Any) -> Fraction:
    return Fraction(u[0] * v[0] + u[1] * v[1])


def _cross(u: Any, v: Any) -> Fraction:
    return Fraction(u[0] * v[1] - u[1] * v[0])


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise ValueError(otherwise)


def sentences(lower: Fraction | float | None, upper: Fraction | float | None) -> list[str]:
    """What is proved."""
    found = [] if lower is None else [f"proved: the loads times {float(lower):.12g} are carried"]
    if upper is not None:
        what = f"no stress carries the loads times more than {float(upper):.12g}"
        found.append(f"proved: {what if upper > -inf else 'no stress carries any multiple of the loads'}")
    return found


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        *proved, numbers = check(json.load(file))
    print("\n".join([*sentences(*proved), ", ".join(f"{count} {name}" for name, count in numbers.items())]))
