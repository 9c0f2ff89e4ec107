"""Bodies with holes and joints, problems with another friction, solved results and their differences."""

import copy
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import tomli_w
from hypothesis import strategies as st
from scipy.special import comb

from qvi_contact import Contact, ContactProblem, Displacement, Material, Region, Traction, TriangleMesh, solve
from qvi_contact.companion import solve_companions
from qvi_contact.discretization import Discretization, split_points
from qvi_contact.solution import stress_in_cells
from solvers import Status

INNER, OUTER, NU = 1.0, 2.0, 0.3
A = INNER**2 / (OUTER**2 - INNER**2)
WIDENED = A * INNER * ((1.0 - NU) + (1.0 + NU) * OUTER**2 / INNER**2)  # u_r inside, for unit pressure and modulus


def quarter(radial, around, *, arcs=True):
    """A quarter of a ring, cut into triangles."""
    r, angle = np.meshgrid(np.linspace(INNER, OUTER, radial + 1), np.linspace(0.0, np.pi / 2.0, around + 1))
    vertices = np.column_stack([(r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()])
    vertices[np.abs(vertices) < 1e-14] = 0.0
    number = np.arange(len(vertices)).reshape(r.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    cells = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))])
    lines = {"inner": number[:, 0], "outer": number[:, -1], "bottom": number[0], "left": number[-1]}
    mesh = TriangleMesh(vertices, cells, {name: np.column_stack([line[:-1], line[1:]]) for name, line in lines.items()})
    return mesh.with_arc("inner", (0.0, 0.0), INNER).with_arc("outer", (0.0, 0.0), OUTER) if arcs else mesh


def polygon(count, layers, inner=1.0, outer=2.0):
    """A ring between two regular polygons, with the edge sets "hole" and "outside"."""
    angle, radius = 2.0 * np.pi * np.arange(count) / count, np.geomspace(inner, outer, layers + 1)
    vertices = (radius[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])).reshape(-1, 2)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(layers), np.arange(count), indexing="ij"))
    a, b = i * count + j, i * count + (j + 1) % count
    cells = np.concatenate([np.column_stack([a, b, b + count]), np.column_stack([a, a + count, b + count])])
    middle = (inner + outer) / 2.0
    mesh = TriangleMesh(vertices, cells).with_edges("hole", lambda x, y: np.hypot(x, y) < middle)
    return mesh.with_edges("outside", lambda x, y: np.hypot(x, y) > middle)


def area(mesh):
    """The area of all triangles with straight edges."""
    return np.abs(np.linalg.det(np.diff(mesh.corners, axis=1))).sum() / 2.0


def holed(divisions, places, low, high):
    """A rectangle with unit holes at these places, on cells of 1/divisions."""
    lines = [np.linspace(a, b, round((b - a) * divisions) + 1) for a, b in zip(low, high, strict=True)]
    x, y = np.meshgrid(*[(line[1:] + line[:-1]) / 2.0 for line in lines])
    body = np.ones(x.shape, dtype=bool)
    for a, b in places:
        body &= np.maximum(np.abs(x - a), np.abs(y - b)) > 0.5
    return TriangleMesh.grid(*lines, body)


def with_line(mesh, name, direction, at, start=-np.inf, stop=np.inf):
    """The mesh with a joint along y = at ("horizontal") or x = at ("vertical"), between two places on it."""
    if direction == "horizontal":
        return mesh.with_joint(name, lambda x, y: np.isclose(y, at) & (x > start) & (x < stop))
    return mesh.with_joint(name, lambda x, y: np.isclose(x, at) & (y > start) & (y < stop))


def with_friction(known: Discretization, friction: float) -> Discretization:
    """The discretisation with another friction, which shares matrices and factorisation, to save time."""
    conditions = [
        replace(each, friction=friction) if isinstance(each, Contact) else each for each in known.problem.conditions
    ]
    return known.with_data(replace(known.problem, conditions=conditions))


def bernstein(degree, t):
    """Values (n, degree + 1) of the Bernstein polynomials at t (n,)."""
    i, t = np.arange(degree + 1), np.asarray(t)[:, None]
    return comb(degree, i) * t**i * (1.0 - t) ** (degree - i)


def solved(problem, tolerance=1e-9, **options):
    """The result of a problem that must be solved."""
    result = solve(problem, tolerance=tolerance, **options)
    assert result.status is Status.SOLVED, result.message
    return result


def companion_of(problem, bounds=None, **options):
    """The companion of a problem, for these friction bounds; it must be solved."""
    (found,) = solve_companions(problem, [bounds], **options)
    assert found.status is Status.SOLVED, found.message
    return found


def difference(one, other):
    """Largest difference of the stresses at the Gauss points of all cells, relative."""
    first, second = one.gauss_stress()[2], other.gauss_stress()[2]
    return np.abs(first - second).max() / np.abs(first).max()


def told(ending):
    """The output of a command that must succeed."""
    status, out, err = ending
    assert (status, err) == (0, "")
    return out


def refused(ending, *words):
    """Assert that a command failed with status 2 and one line of error with these words."""
    status, out, err = ending
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert err.startswith("qvi-contact: ")
    assert [word for word in words if word not in err] == []


PROBLEMS = Path(__file__).parent / "problems"
RICH = (PROBLEMS / "rich.toml").read_text(encoding="utf-8")
TRIANGLES = (PROBLEMS / "triangles.toml").read_text(encoding="utf-8")

PRINTED = "aZ09_-.,:;!?#$%&*+/\\|~^<>=()[]{}'\"`@§½²₂Ⅷµμßéåπσ→∞≤€中あ한אع☃😀𝒙"
"""Letters, digits, punctuation and symbols of one to four bytes, including all special characters of TOML."""
LETTERS = PRINTED + " \t\n\r\0\x1b\x7f\x85\xa0\xad\u0301\u200b\u200f\u2028\u3000\ue000\ufeff\uffff"
"""`PRINTED`, spaces, line ends, control and invisible characters; a few, as hypothesis takes seconds to list all."""

numbers = st.floats(allow_nan=True) | st.integers() | st.sampled_from([0, -1, 1e-320, 1e308, 2**70, -0.0, 1e59])
words = st.text(LETTERS, max_size=12) | st.sampled_from(
    ["t", "x /", "1/0", "x**99999", "().__class__", "open('f')", "top", "joint", "roof", "lambda: 1", "9" * 300]
)
lists = st.lists(numbers | words, max_size=3)
junk = numbers | words | st.booleans() | lists | st.dictionaries(words, numbers, max_size=2)


def places(value, path=()):
    """Paths of all values in nested tables and lists."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield (*path, key)
        yield from places(item, (*path, key))


@st.composite
def mutated(draw, whole=RICH):
    """The file with one to three errors, as bytes."""
    data = copy.deepcopy(tomllib.loads(whole))
    for _ in range(draw(st.integers(1, 3))):
        _break(draw, data)
    text = _as_toml(data).encode("utf-8", "replace")
    how = draw(st.sampled_from(["whole"] * 8 + ["cut", "bytes"]))
    at = draw(st.integers(0, len(text)))
    return {"whole": text, "cut": text[:at], "bytes": text[:at] + draw(st.binary(max_size=8)) + text[at:]}[how]


def _as_toml(data):
    try:
        return tomli_w.dumps(data)
    except (TypeError, ValueError):
        return "version = 1"


def _break(draw, data):
    """Delete, replace or rename one value, double a table, or add a key."""
    path = draw(st.sampled_from(list(places(data)) or [()]))
    if not path:
        return
    parent = data
    for key in path[:-1]:
        parent = parent[key]
    kind = draw(st.sampled_from(["delete", "replace", "replace", "scale", "rename", "double", "add"]))
    value = parent[path[-1]]
    if kind == "delete":
        del parent[path[-1]]
    elif kind == "scale" and isinstance(value, (int, float)) and not isinstance(value, bool):
        parent[path[-1]] = value * draw(st.sampled_from([-1, 2, 0.5, 1e12, 1e-12, 0]))
    elif kind == "rename" and isinstance(parent, dict):
        parent[str(path[-1])[:-1] + draw(st.sampled_from("abz "))] = parent.pop(path[-1])
    elif kind == "double" and isinstance(parent, list):
        parent.append(copy.deepcopy(value))
    elif kind == "add" and isinstance(value, dict):
        value[draw(words)] = draw(junk)
    else:
        parent[path[-1]] = draw(junk)


def half_disc(friction=0.3, push=(2e-3, -2e-3)):
    """A half disc of radius 1 as a polygon, its flat side on a rough plane in full contact, its crown displaced."""
    angle = np.linspace(0.0, np.pi, 13)
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.vstack([[0.0, 0.0], rim])
    cells = np.column_stack([np.zeros(12, dtype=int), np.arange(1, 13), np.arange(2, 14)])
    mesh = TriangleMesh(vertices, cells)
    mesh = mesh.with_edges("base", lambda _, y: y < 1e-9).with_edges("crown", lambda _, y: y > 0.9)
    mesh = mesh.with_edges("flank", lambda _, y: (y >= 1e-9) & (y <= 0.9))
    crown = Displacement("crown", x=push[0], y=push[1])
    conditions = [Contact("base", friction, name="base"), crown, Traction("flank", x=0.0, y=0.0)]
    return ContactProblem(mesh, Material(1000.0, 0.3, "strain"), conditions)


def half_discs(friction=0.3, push=(6e-3, -2e-3), below=1000.0):
    """Two such half discs on each other, that below held at its foot, of a Young's modulus of its own."""
    above = half_disc().mesh
    shared = above.vertices[:, 1] < 1e-9
    other = np.where(shared, np.arange(len(shared)), len(shared) - 1 + np.cumsum(~shared))
    vertices = np.vstack([above.vertices, (above.vertices * [1.0, -1.0])[~shared]])
    mesh = TriangleMesh(vertices, np.vstack([above.cells, other[above.cells]]))
    mesh = mesh.with_joint("seam", lambda _, y: np.abs(y) < 1e-9).with_region("lower", lambda _, y: y < 0.0)
    mesh = mesh.with_edges("crown", lambda _, y: y > 0.9).with_edges("foot", lambda _, y: y < -0.9)
    mesh = mesh.with_edges("flank", lambda _, y: np.abs(y) <= 0.9)
    held = [Displacement("crown", x=push[0], y=push[1]), Displacement("foot", x=0.0, y=0.0)]
    stiff, soft = Material(1000.0, 0.3, "strain"), Material(below, 0.3, "strain")
    conditions = [Contact("seam", friction), *held, Traction("flank", x=0.0, y=0.0)]
    return ContactProblem(mesh, stiff, conditions, regions=[Region(soft, name="lower")])


def sheared_layer(friction=0.2, drag=5e-3):
    """A layer 4 × 1 pressed on rough ground by its top, which moves to the side; its ends are free."""
    held = [Contact("bottom", friction, name="base"), Displacement("top", x=drag, y=-2e-3)]
    mesh = TriangleMesh.rectangle((4, 1), 4.0, 1.0)
    free = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    return ContactProblem(mesh, Material(1000.0, 0.2), [*held, *free])


def energy_apart(one, other):
    """|σ − τ| in the energy norm, of stresses of any degrees on meshes of one body, at points of the finer one."""
    coarse, fine = sorted(
        (one, other), key=lambda result: (result.problem.mesh.cell_count, result.discretization.space.degree)
    )

    def stress_of(result, cells, t):
        known = result.discretization
        points, stress = stress_in_cells(known, result.dofs, cells, t)
        return result.problem.mesh.origin + known.scales.length * points, stress * known.scales.stress

    t, w = split_points(5)
    places, stress = stress_of(fine, np.arange(fine.problem.mesh.cell_count), t)
    mesh, points, space = coarse.problem.mesh, places.reshape(-1, 2), fine.discretization.space
    point, cell = mesh.around(points)
    cell = cell[np.unique(point, return_index=True)[1]]
    apart = stress - stress_of(coarse, cell, mesh.reference(cell, points)[:, None])[1].reshape(stress.shape)
    weights = space.cell_measures(t, w) * fine.discretization.scales.length**2
    return float(np.sqrt(np.einsum("cg,cgk,ckl,cgl->", weights, apart, fine.problem.compliances, apart)))


def same(first, second):
    """Whether two problems are the same, conditions up to the order of their kinds."""
    a, b = first.mesh, second.mesh
    bodies = a.same_as(b) and list(a.edge_sets) == list(b.edge_sets) and list(a.regions) == list(b.regions)
    sets = all(np.array_equal(a.edge_sets[name], b.edge_sets[name]) for name in a.edge_sets)
    sets &= all(np.array_equal(a.regions[name], b.regions[name]) for name in a.regions)
    ordered = [sorted(p.conditions, key=lambda each: type(each).__name__) for p in (first, second)]
    rest = [(p.material, p.body_potential, p.temperature, p.regions) for p in (first, second)]
    return bodies and sets and ordered[0] == ordered[1] and rest[0] == rest[1]
