"""Checks a proof that a body carries its loads times a factor: ``python check_proof.py FILE``.

It needs nothing but Python's standard library, and all of its arithmetic is exact. The file states a body of straight
triangles, each cut into three parts at its barycentre; an Airy function by the Bernstein ordinates of degree p on every
part; loads, strengths and contact laws. With the potential φ of the body force the stresses of a part are

    σ_xx = Φ_yy + φ,   σ_yy = Φ_xx + φ,   σ_xy = −Φ_xy,

in equilibrium whatever Φ is. They carry the loads if (1) tractions agree across every edge between two parts, (2) they
are the prescribed ones, (3) every Bernstein ordinate of the stress is in the cones of the strength, and (4) those of
tractions on contacts, with one degree more, keep the contact law: at every point stresses are convex combinations of
their ordinates.
"""

import json
import sys
from collections.abc import Iterator
from fractions import Fraction
from itertools import product
from typing import Any


def check(proof: dict[str, Any]) -> tuple[Fraction, dict[str, int]]:
    """The factor that is proved, and how much of what was checked; `ValueError` says what does not hold."""
    factor = Fraction(proof["factor"])
    laws = [[{key: _numbers(value) for key, value in cone.items()} for cone in law] for law in proof["strengths"]]
    tractions: dict[Any, list[Any]] = {}
    counted = {"parts": 0, "inner edges": 0, "cones": 0, "loads": 0, "contact edges": 0}
    for t, names, ends, stress in _parts(proof, factor):
        counted["parts"] += 1
        law = proof["strength_of"][t]
        for at, value in stress.values():
            for cone in [] if law is None else laws[law]:
                _demand(_inside(value, at, cone), f"a stress of triangle {t} is beyond its strength")
                counted["cones"] += 1
        for edge, side in _sides_of(names, ends, stress):
            tractions.setdefault(edge, []).append(side)
    counted["inner edges"] = sum(_agree(edge, sides) for edge, sides in tractions.items())
    for load in proof["loads"]:
        sides, flipped = _at(tractions, load["edge"])
        _demand(len(sides) == 1, f"edge {load['edge']} is loaded and not on the boundary")
        given = [Fraction(a) + factor * Fraction(b) for a, b in zip(load["dead"], load["live"], strict=True)]
        have = [sides[0][1] * _dot(_numbers(load["direction"]), value) for value in sides[0][0]]
        _demand(have == (given[::-1] if flipped else given), f"the traction on edge {load['edge']} is not the load")
        counted["loads"] += 1
    for contact in proof["contacts"]:
        for edge in contact["edges"]:
            (found, _, normal), *_ = _at(tractions, edge)[0]
            for value in _elevated(found):
                _demand(_admissible(contact, value, normal), f"contact {contact['name']!r} is beyond its law")
            counted["contact edges"] += 1
    return factor, counted


def _parts(proof: dict[str, Any], factor: Fraction) -> Iterator[tuple[int, list[Any], list[Any], dict[Any, Any]]]:
    """Triangle, names of corners, corners, and ordinates of stress with their places, of every part."""
    p = proof["degree"]
    number = {alpha: i for i, alpha in enumerate(_exponents(p))}
    vertices = [_numbers(point) for point in proof["vertices"]]
    dead, live = (_numbers(proof["potential"][kind]) for kind in ("dead", "live"))
    potential = [a + factor * b for a, b in zip(dead, live, strict=True)]
    for t, (corners, airy) in enumerate(zip(proof["triangles"], proof["airy"], strict=True)):
        points = [vertices[v] for v in corners]
        centre = [sum((q[i] for q in points), Fraction(0)) / 3 for i in (0, 1)]
        for part, (a, b) in zip(airy, ((1, 2), (0, 2), (0, 1)), strict=True):
            c, ends = _numbers(part), [points[a], points[b], centre]
            _demand(len(c) == len(number), f"triangle {t} has another degree")
            det = _cross(_less(ends[1], ends[0]), _less(ends[2], ends[0]))
            _demand(det != 0, f"triangle {t} has no area")
            slopes = [_turned(_less(ends[(i + 2) % 3], ends[(i + 1) % 3]), det) for i in range(3)]
            stress = {}
            for alpha in _exponents(p - 2):
                xx = yy = xy = Fraction(0)
                for i, j in product(range(3), repeat=2):
                    value = p * (p - 1) * c[number[tuple(alpha[n] + (n == i) + (n == j) for n in range(3))]]
                    xx += value * slopes[i][0] * slopes[j][0]
                    yy += value * slopes[i][1] * slopes[j][1]
                    xy += value * slopes[i][0] * slopes[j][1]
                at = [sum((Fraction(alpha[n], p - 2) * ends[n][i] for n in range(3)), Fraction(0)) for i in (0, 1)]
                phi = potential[0] + potential[1] * at[0] + potential[2] * at[1]
                stress[alpha] = at, (yy + phi, xx + phi, -xy)
            yield t, [corners[a], corners[b], f"centre {t}"], ends, stress


def _sides_of(names: list[Any], ends: list[Any], stress: dict[Any, Any]) -> Iterator[tuple[Any, Any]]:
    """Tractions along the sides of a part, for a normal as long as the side; whether it points out; the normal."""
    k = max(alpha[0] for alpha in stress)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        first, second = sorted((i, j), key=lambda n: str(names[n]))
        along = _less(ends[second], ends[first])
        normal = (along[1], -along[0])
        outward = 1 if _dot(normal, _less(ends[first], ends[3 - i - j])) > 0 else -1
        found = []
        for m in range(k + 1):
            _, s = stress[tuple((k - m) * (n == first) + m * (n == second) for n in range(3))]
            found.append((s[0] * normal[0] + s[2] * normal[1], s[2] * normal[0] + s[1] * normal[1]))
        yield (str(names[first]), str(names[second])), (found, outward, normal)


def _agree(edge: Any, sides: list[Any]) -> bool:
    """Whether an edge lies between two parts, with the same tractions on both sides."""
    _demand(len(sides) <= 2, f"edge {edge} has more than two sides")
    if len(sides) == 2:
        _demand(sides[0][0] == sides[1][0], f"tractions across edge {edge} differ")
        _demand(sides[0][1] != sides[1][1], f"triangles overlap at edge {edge}")
    return len(sides) == 2


def _elevated(values: list[Any]) -> list[Any]:
    """The ordinates of the same polynomials with one degree more; where these keep a law, all points do."""
    k = len(values)
    ends = [values[0], *values, values[-1]]
    return [tuple((m * a + (k - m) * b) / k for a, b in zip(ends[m], ends[m + 1], strict=True)) for m in range(k + 1)]


def _admissible(contact: dict[str, Any], traction: Any, normal: Any) -> bool:
    """σ_N ≤ 0 (unless bilateral) and |σ_T| ≤ min(c − μ σ_N, t_max), all times the length squared."""
    square, n, t = _dot(normal, normal), _dot(normal, traction), abs(_cross(normal, traction))
    mu, c, cap = Fraction(contact["friction"]), Fraction(contact["cohesion"]), contact["shear_limit"]
    bilateral = contact["law"] == "bilateral"
    bound = c * square - (0 if bilateral else mu * n)
    return (bilateral or n <= 0) and t <= bound and (cap is None or t <= Fraction(cap) * square)


def _inside(stress: Any, at: Any, cone: dict[str, Any]) -> bool:
    """gamma2 S² + (σ_xx − σ_yy)² + 4 σ_xy² ≤ (f a − β S)², or ≤ f2 a² where that is given; a is affine in (x, y)."""
    total, a = stress[0] + stress[1], cone["a"][0] + cone["a"][1] * at[0] + cone["a"][2] * at[1]
    radius = (stress[0] - stress[1]) ** 2 + 4 * stress[2] ** 2
    if "f2" in cone:
        return bool(a >= 0 and radius + cone["gamma2"] * total**2 <= cone["f2"] * a**2)
    limit = cone["f"] * a - cone["beta"] * total
    return bool(limit >= 0 and radius <= limit**2)


def _at(tractions: dict[Any, list[Any]], edge: list[int]) -> tuple[list[Any], bool]:
    """What the parts at an edge have, and whether they count it from its second end."""
    first, second = sorted(map(str, edge))
    _demand((first, second) in tractions, f"there is no edge {edge}")
    return tractions[first, second], [first, second] != list(map(str, edge))


def _exponents(degree: int) -> list[tuple[int, ...]]:
    return [(i, j, degree - i - j) for i in range(degree, -1, -1) for j in range(degree - i, -1, -1)]


def _numbers(value: Any) -> Any:
    return [Fraction(each) for each in value] if isinstance(value, list) else Fraction(value)


def _less(u: Any, v: Any) -> Any:
    return (u[0] - v[0], u[1] - v[1])


def _dot(u: Any, v: Any) -> Fraction:
    return Fraction(u[0] * v[0] + u[1] * v[1])


def _cross(u: Any, v: Any) -> Fraction:
    return Fraction(u[0] * v[1] - u[1] * v[0])


def _turned(u: Any, det: Fraction) -> Any:
    """The gradient of a barycentric coordinate from the opposite side."""
    return (-u[1] / det, u[0] / det)


def _demand(holds: bool, otherwise: str) -> None:
    if not holds:
        raise ValueError(otherwise)


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        proved, numbers = check(json.load(file))
    print(f"proved: the loads times {proved} ≈ {float(proved):.12g} are carried")
    print(", ".join(f"{count} {name}" for name, count in numbers.items()))
