"""One argument of a plain problem replaced by what it must not be."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from comparisons.wild.bodies import Dice
from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    TriangleMesh,
)

_PLAIN: Final[Mapping[str, Any]] = MappingProxyType({
    "x": [0.0, 1.0, 2.0], "y": [0.0, 0.5, 1.0, 2.0], "active": None,
    "edges.name": "part", "edges.place": ((0.0, 0.0), (1.0, 0.0)),
    "joint.name": "joint", "joint.place": ((0.0, 0.5), (2.0, 0.5)),
    "young": 1000.0, "poisson": 0.3, "plane": "stress",
    "contact.edges": "part", "contact.friction": 0.3, "contact.gap": 0.0, "contact.offset": 0.0, "contact.name": "",
    "contact.cohesion": 0.0, "contact.shear_limit": 5.0, "contact.law": "unilateral", "contact.plate": None,
    "traction.edges": "right", "traction.x": -1.0, "traction.y": 0.0, "traction.name": "",
    "displacement.edges": "rest", "displacement.x": 0.0, "displacement.y": 0.0,
    "symmetry.edges": "left", "potential": 0.0, "region.x": (0.0, 1.0), "region.material": Material(500.0, 0.2),
    "force_x": None, "force_y": -3.0, "moment": 0.0, "pivot": (1.0, 2.0),
    "regions": None, "conditions": None, "mesh": None,
})  # fmt: skip
"""Argument → what is right."""

_NUMBERS: Final[tuple[Any, ...]] = (
    float("nan"), float("inf"), -float("inf"), np.nan * 1j, 1.0 + 1.0j, 1.0 + 0.0j, np.complex64(2.0), "1", "", b"1",
    True, 10**400, [], [1.0], (1.0, 2.0), {}, np.array([1.0, 2.0]), np.array([[1.0]]), np.array("1"), object(), len,
    np.datetime64("2020-01-01"),
)  # fmt: skip
_TEXTS: Final[tuple[Any, ...]] = (
    None, 3, 2.5, True, b"bottom", ["bottom"], ("bottom",), {"bottom"}, np.array(["bottom", "top"]), np.array("bottom"),
    np.array([1.0, 2.0]), "nowhere", "bottom\x00", "bottom ", object(),
)  # fmt: skip
_LINES: Final[tuple[Any, ...]] = (
    None, 3.0, "012", [0.0], [], [0.0, 0.0], [1.0, 0.0], [0.0, float("nan"), 1.0], [0.0, float("inf")],
    [0.0, 1.0 + 1.0j], np.array([0.0, 1.0], dtype=complex), [[0.0, 1.0], [2.0, 3.0]], ["a", "b"], [0.0, None],
    [0.0, 10**400], {0.0: 1.0}, object(), [0.0, [1.0, 2.0]], np.array(["0", "x"]),
)  # fmt: skip
_MASKS: Final[tuple[Any, ...]] = (
    3, "mask", [True], np.ones((2, 2), dtype=bool), np.ones((3, 2)), np.zeros((3, 2), dtype=bool),
    np.ones((3, 2), dtype=complex), [[True, True], [True]], np.full((3, 2), "x"), np.full((3, 2), None), object(),
    np.array([[1, 0], [0, 0], [0, 1]], dtype=bool), np.array([[1, 0], [1, 1], [0, 1]], dtype=int),
)  # fmt: skip
_PAIRS: Final[tuple[Any, ...]] = (
    3.0, "ab", (1.0,), (1.0, 2.0, 3.0), (float("nan"), 1.0), (1.0j, 0.0), ("0", "1"), np.array([0.0, 1.0j]), object(),
    [[0.0], [1.0]], (0.0, None),
)  # fmt: skip
_PLACES: Final[tuple[Any, ...]] = (
    None, 3.0, "bottom", (0.0, 1.0), ((0.0, 0.0),), ((0.0, 0.0), (0.3, 0.0)), ((0.0, 0.0), (7.0, 0.0)),
    ((0.0, float("nan")), (1.0, 0.0)), ((0.0, 0.0), (0.0, 0.0)), ((0.3, 0.3), (0.6, 0.6)), object(), lambda _, __: None,
    lambda x, _: x > 99.0, lambda x: x,
)  # fmt: skip
_THINGS: Final[tuple[Any, ...]] = (
    3, "text", [3], ["text"], np.array([1.0, 2.0]), object(), {"a": 1}, [None], 1.0j, len,
)  # fmt: skip


def _raising(_: Any, __: Any) -> Any:
    message = "two\nlines"
    raise RuntimeError(message)


def _endless(x: Any, y: Any) -> Any:
    return _endless(x, y)


_FUNCTIONS: Final[tuple[Callable[..., Any], ...]] = (
    lambda x, _: np.full_like(x, np.nan), lambda x, _: x * np.inf, lambda x, y: x + 1j * y,
    lambda x, _: np.zeros((*np.shape(x), 2)), lambda x: x, lambda _, __: "1.0 and more", lambda _, __: None, _raising,
    _endless,
)  # fmt: skip
"""NaN, infinite, complex, of a wrong shape, of one argument, a text, nothing, an exception, no end."""

_FIELDS: Final = (*_NUMBERS[:-2], *_FUNCTIONS)

_BAD: Final[Mapping[str, tuple[Any, ...]]] = MappingProxyType({
    "x": _LINES, "y": _LINES, "active": _MASKS, "edges.name": (*_TEXTS[:11], "top", "", object()),
    "edges.place": _PLACES, "joint.name": (*_TEXTS[:11], "part", "top", ""), "joint.place": _PLACES,
    "young": (*_NUMBERS, None, 0.0, -1.0, 5e-324, 1e308 * 1e10), "poisson": (*_NUMBERS, None, -1.0, 0.6, -3.0),
    "plane": _TEXTS, "contact.edges": _TEXTS, "contact.friction": (*_FIELDS, None, -0.1),
    "contact.gap": (*_FIELDS, None), "contact.offset": (*_FIELDS, None), "contact.name": _TEXTS[:11],
    "contact.cohesion": (*_FIELDS, None, -1.0), "contact.shear_limit": (*_FIELDS, -1.0), "contact.law": _TEXTS,
    "contact.plate": _THINGS, "traction.edges": _TEXTS, "traction.x": (*_FIELDS, None), "traction.y": (*_FIELDS, None),
    "traction.name": _TEXTS[:11], "displacement.edges": _TEXTS, "displacement.x": _FIELDS, "displacement.y": _FIELDS,
    "symmetry.edges": _TEXTS, "potential": (*_FIELDS, None), "region.x": (*_PAIRS, (1.0, 0.0), (0.0, 0.3)),
    "region.material": _THINGS, "force_x": _NUMBERS, "force_y": _NUMBERS, "moment": _NUMBERS, "pivot": (*_PAIRS, None),
    "regions": _THINGS, "conditions": (*_THINGS, []), "mesh": _THINGS,
})  # fmt: skip
"""Argument → what is wrong there, in whatever problem."""

_SETTINGS: Final[Mapping[str, tuple[Any, ...]]] = MappingProxyType({
    "tolerance": (*_NUMBERS, None, 0.0, 1.0, -1e-8), "method": (*_TEXTS[1:], ""), "inner": (*_TEXTS[1:], "qp:", "qp:x"),
    "factorisation": (*_TEXTS, ""), "threads": (*_NUMBERS, 0, -1, 1.5), "initial": (*_NUMBERS[:-2], _LINES[-4]),
    "max_iterations": (*_NUMBERS, None, 0, -1, 1.5), "damping": (*_NUMBERS, None, 0.0, 2.0), "gap": (*_NUMBERS, None),
    "unknown": _THINGS,
})  # fmt: skip
"""Keyword argument of `solve` → what is wrong there."""


def nonsense(dice: Dice) -> tuple[ContactProblem, dict[str, Any], str]:
    """A problem, settings of `solve`, and which of their arguments is wrong; raises where the problem refuses it."""
    place = dice.pick((*_BAD, *_SETTINGS))
    value = dice.pick(_BAD[place] if place in _BAD else _SETTINGS[place])
    if place in _SETTINGS:
        return _problem(dict(_PLAIN)), {place: value}, f"{place} = {value!r}"
    return _problem({**_PLAIN, place: value}), {}, f"{place} = {value!r}"


def _problem(given: dict[str, Any]) -> ContactProblem:
    """A plate pressed down on a part of its bottom, with a joint and a region, of these arguments."""

    def of(part: str) -> dict[str, Any]:
        """The arguments of one part by their names."""
        return {name.removeprefix(f"{part}."): value for name, value in given.items() if name.startswith(f"{part}.")}

    edges = {given["edges.name"]: given["edges.place"], "rest": ((1.0, 0.0), (2.0, 0.0))}
    joints, regions = {given["joint.name"]: given["joint.place"]}, {"half": (given["region.x"], None)}
    mesh = TriangleMesh.grid(given["x"], given["y"], given["active"], edges=edges, joints=joints, regions=regions)
    plate = RigidPlate(given["force_x"], given["force_y"], given["moment"], given["pivot"])
    conditions: Any = [
        Contact(**of("contact")), Contact("joint", 0.5), Contact("top", 0.2, plate=plate),
        Displacement(**of("displacement")), Traction(**of("traction")), Symmetry(**of("symmetry")),
    ]  # fmt: skip
    material = Material(given["young"], given["poisson"], given["plane"])
    made = {"mesh": mesh, "conditions": conditions, "regions": [Region(given["region.material"], name="half")]}
    made |= {name: given[name] for name in made if given[name] is not None}
    return ContactProblem(material=material, body_potential=given["potential"], **made)
