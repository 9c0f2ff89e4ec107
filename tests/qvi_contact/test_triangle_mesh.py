"""Meshes of triangles: what is accepted and refused, names, refinement."""

import re
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, InputError, Material, Region, Symmetry, Traction, solve
from qvi_contact.gallery import compressed_plate, fan
from qvi_contact.mesh import Curve, TriangleMesh, edges_on_segment, fitted
from qvi_contact.mesh.selection import crossing
from tests.qvi_contact.builders import area, half_disc, quarter
from tests.qvi_contact.test_triangles import oblique, turned

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
HALVES = [(0, 1, 2), (0, 2, 3)]


def square(**more):
    return TriangleMesh(SQUARE, HALVES, **more)


def l_shape():
    active = np.kron([[1, 1], [1, 0]], np.ones((2, 2))) > 0.0
    x = np.linspace(0.0, 2.0, 5)
    mesh = TriangleMesh.grid(x, x, active, edges={"notch": ((1, 1), (2, 1))}, joints={"seam": ((0, 0.5), (2, 0.5))})
    return mesh.with_region("foot", lambda _, y: y < 0.5)


class TestTopology:
    """Edges and who shares them."""

    def test_edges_of_a_square(self):
        topology = square().topology
        assert topology.ends.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]
        assert topology.boundary.tolist() == [True, False, True, True, True]
        assert topology.cells.tolist() == [[0, -1], [0, 1], [1, -1], [0, -1], [1, -1]]
        assert topology.of_cells.tolist() == [[3, 1, 0], [4, 2, 1]]
        other_sense = TriangleMesh(SQUARE, [(2, 1, 0), (0, 2, 3)])
        assert (other_sense.cells == square().cells).all()
        assert other_sense.with_region("steel", [0]).with_joint("seam", [(0, 2)]).topology is other_sense.topology
        assert repr(square().part([0])) == "<TriangleMesh: 1 triangle with 3 vertices, body of 1 × 1>"

    def test_outlines_run_around_the_body_and_its_holes(self):
        mesh = TriangleMesh.grid(np.arange(4.0), np.arange(4.0), np.arange(9).reshape(3, 3) != 4)
        outer, inner = mesh.outlines
        assert (len(outer), len(inner)) == (12, 4)
        for line in (outer, inner):
            ends = mesh.topology.ends[line]
            assert all(set(one) & set(two) for one, two in zip(ends, np.roll(ends, -1, axis=0), strict=True))
        x, y = mesh.points_along(mesh.boundary, np.array([0.5]))
        assert (mesh.hole_edges == (np.maximum(np.abs(x - 1.5), np.abs(y - 1.5)) < 0.6)[:, 0]).all()


class TestRefusals:
    """What is no mesh, and names that do not fit."""

    @pytest.mark.parametrize(
        ("vertices", "cells", "told"),
        [([*SQUARE, (0.5, 0.5)], HALVES, "belongs to no triangle"),
         ([*SQUARE, (2.0, 2.0)], [*HALVES, (0, 2, 4)], "has no area"),
         ([*SQUARE, (2.0, 0.0)], [*HALVES, (0, 2, 4)], r"more than two triangles.*\(0.5, 0.5\)"),
         (SQUARE, [(0, 1, 2), (0, 1, 3)], "overlap"),
         ([*SQUARE, (2, 0), (3, 0), (2, 1)], [*HALVES, (4, 5, 6)], "this many pieces"),
         ([*SQUARE, (2, 1), (2, 2)], [*HALVES, (2, 4, 5)], "connects two parts"),
         ([*SQUARE, (1, 0), (1, 1), (2, 0)], [*HALVES, (4, 5, 6)], "Coherence Mesh"),
         ([*SQUARE, (0.3, 1), (0.6, 1), (0.5, 2)], [*HALVES, (4, 5, 6)], r"\(0.3, 1\).*do not match"),
         (1e6 * np.array([*SQUARE, (1, 1 + 1e-11)]), [(0, 1, 2), (0, 3, 4)], "in the same place"),
         ([*SQUARE, (2, 0), (1.0, 0.5)], [*HALVES, (1, 4, 5)], r"\(1, 0.5\).*lies inside the edge"),
         ([(0, 0), (1, 0), (np.nan, 1)], [(0, 1, 2)], "no finite"),
         (1e99 * np.array(SQUARE), HALVES, "at most 1e\\+60"), (SQUARE, [(0, 1, 4)], "0 to 3"),
         (SQUARE, [(0, 1, 2.5)], "whole numbers"), (SQUARE, [(0, 1, 1), (0, 2, 3)], "has no area"),
         (SQUARE[:2], [(0, 1, 1)], "shape"), ("abc", HALVES, "numbers")],
    )  # fmt: skip
    def test_no_mesh(self, vertices, cells, told):
        with pytest.raises(InputError, match=told) as caught:
            TriangleMesh(vertices, cells)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("is_curved", [True, False])
    @pytest.mark.parametrize("gap", [1e-9, 1e-5, 0.1, -0.1, -0.3])
    def test_a_strip_that_winds_around_itself(self, gap, is_curved):
        """Along spirals r = a + (w + gap) θ/2π: chords cross in thin gaps, circles (gap −w) lie on each other."""

        def spiral(a):
            return lambda t: (a + (0.3 + gap) * t / (2 * np.pi))[:, None] * np.column_stack([np.cos(t), np.sin(t)])

        angles, edges = np.linspace(0.0, 3.8 * np.pi, 38), np.arange(37)[:, None] + [0, 1]
        vertices = np.concatenate([spiral(a)(angles) for a in (1.0, 1.3)])
        cells = np.concatenate([np.append(edges, edges[:, :1] + 38, 1), np.append(edges + 38, edges[:, 1:], 1)])
        arcs = [fitted("curve", spiral(1.0 + 0.3 * k), 0.0, angles[-1], edges + 38 * k, vertices) for k in (0, 1)]
        is_flat, told = gap > (0.0 if is_curved else 0.05), "inside the" if is_curved and gap == -0.3 else "overlaps"
        with nullcontext() if is_flat else pytest.raises(InputError, match=told):
            TriangleMesh(vertices, cells, {}, {}, arcs if is_curved else [])

    @pytest.mark.parametrize("depth", [1e-9, 1e-4, 0.1, -1e-9, -1e-4, -0.1])
    @pytest.mark.parametrize("half_turn", [0.0, np.arcsin(0.95 / 2.0)])
    def test_circles_that_are_nearer_than_their_radii_cross(self, depth, half_turn):
        """A circle of radius 1, and above it one of radius 2 or a line; turned, far from the origin."""
        above = 1.0 - depth + (2.0 - 2.0 * np.cos(half_turn))
        ends = [[(np.sin(0.6), np.cos(0.6)), (-np.sin(0.6), np.cos(0.6))], [(-0.95, above), (0.95, above)]]
        ends = np.add(turned(ends, 37.0), (30.0, -20.0))
        assert len(crossing(ends, np.array([0.6, half_turn]))) == (depth > 0.0)

    @pytest.mark.parametrize(("k", "turn", "tilt"), [(0.0, 0.05, 0.0), (0.9, 0.3, 0.0), (0.0, 0.1, 1e-4)])
    def test_bodies_tangent_where_their_joint_ends(self, k, turn, tilt):
        """A circle of radius 1 on a line or a circle of curvature k, with six digits; tilted, they cross beyond 0."""
        s, c = np.sin([turn, 1.05 * k * turn]), 1.0 - np.cos([turn, 1.05 * k * turn])
        below = turned((s[1] / k, c[1] / k) if k else (1.05 * turn, 0.0), np.degrees(tilt))
        points = [(-1.0, 0.0), (0.0, 0.0), (0.0, 1.0), (0.0, -1.0), (s[0], c[0]), below]
        cells, bends = [(0, 1, 2), (0, 1, 3), (1, 4, 2), (1, 5, 3)], [[0.0, turn / 2.0], [0.0, 1.05 * k * turn / 2.0]]
        for angle in range(0, 360, 20):
            arcs = [Curve(np.array([[1, 4], [1, 5]]), np.array(bends))]
            with pytest.raises(InputError, match="overlaps") if tilt else nullcontext():
                TriangleMesh(np.round(turned(points, angle), 6), cells, {}, {}, arcs)

    @staticmethod
    def two(vertices, cells, moved):
        """A square of 2 × 2 cells, and right of it another mesh with its corner moved from (1, 0)."""
        one, second = TriangleMesh.rectangle((2, 2)), np.add(vertices, (1.0, 0.0)) + moved
        both = np.concatenate([one.cells, np.asarray(cells) + len(one.vertices)])
        return np.concatenate([one.vertices, second]), both

    @pytest.mark.parametrize(
        ("rows", "moved", "told"),
        [(2, (0.0, 0.0), [r"\(1, 0\)", "merge them", "Contact"]),
         (3, (0.0, 0.0), [r"\(1, 0\.", "do not match", "common nodes"]),
         (1, (0.0, 0.0), [r"\(1, 0.5\)", "do not match", "join"]),
         (2, (0.0, 0.25), [r"\(1, 0.25\)", "do not match"]),
         (2, (0.01, 0.0), ["0.01 apart", r"\(1.005, ", "has that gap", "olerance"]),
         (2, (1e-8, 0.0), ["1e-08 apart", "olerance"]), (2, (5.0, 0.0), ["5 apart", "give one piece"])],
    )  # fmt: skip
    def test_two_meshes_that_are_no_body(self, rows, moved, told):
        """Their place and what to do: merge nodes, mesh together, or a joint with a gap."""
        right = TriangleMesh.rectangle((1, rows))
        with pytest.raises(InputError) as caught:
            TriangleMesh(*self.two(right.vertices, right.cells, moved))
        assert not [words for words in told if not re.search(words, str(caught.value))], str(caught.value)

    @pytest.mark.parametrize(
        ("sets", "told"),
        [({"top": [(1, 3)]}, "no edge of the mesh"), ({"top": [(2, 7)]}, "no edge of the mesh"),
         ({"top": [(2, 3), (0, 2)]}, "partly on the boundary"), ({"": [(2, 3)]}, "non-empty"),
         ({"top": np.zeros((0, 2), dtype=int)}, "one or more")],
    )  # fmt: skip
    def test_wrong_edge_sets(self, sets, told):
        with pytest.raises(InputError, match=told):
            square(edge_sets=sets)

    def test_unknown_and_repeated_names(self):
        mesh = square(edge_sets={"top": [(2, 3)]})
        for told, call, *given in (
            ("top", mesh.edge_set, "bottom"), ("exists already", mesh.with_edges, "top", lambda _, y: y < 0.1),
            ("no edge of the mesh", mesh.part, [0], {"low": np.array([[1, 3]])}),
            ("no boundary edge", mesh.with_edges, "low", lambda _, y: y < -1.0),
            ("no interior edge", mesh.with_joint, "low", [(0, 1)]),
            ("booleans", mesh.with_edges, "low", lambda _, y: y),
            *(("0 to 1", mesh.with_region, "steel", cells) for cells in ([2], [-1], [])),
            ("real numbers", mesh.with_region, "steel", np.ma.array([0, 1], mask=[0, 1])),
        ):  # fmt: skip
            with pytest.raises(InputError, match=told):
                call(*given)


class TestLocate:
    """Points in triangles."""

    def test_points_are_found_in_the_triangle_that_holds_them(self):
        mesh, rng = TriangleMesh.rectangle((5, 4)).graded([(1.0, 1.0)], 12), np.random.default_rng(0)
        points = rng.random((300, 2))
        cells = mesh.locate(points)
        assert (mesh.reference(cells, points) >= -1e-9).all()
        assert (mesh.locate([(1.1, 0.5), (-1e-6, 0.5)]) == -1).all()
        assert mesh.locate([(np.nan, 0.5), (0.5, np.inf), *points[:1]]).tolist() == [-1, -1, cells[0]]

    def test_points_on_edges_belong_to_the_triangle_of_lowest_number_and_needles_are_found_too(self):
        mesh = TriangleMesh.rectangle((5, 4))
        inner = np.flatnonzero(~mesh.topology.boundary)
        assert (mesh.locate(mesh.midpoints[inner]) == mesh.topology.cells[inner].min(axis=1)).all()
        mesh = TriangleMesh.rectangle((40, 1), 1.0, 100.0)
        points = np.random.default_rng(1).random((50, 2)) * (1.0, 100.0)
        assert (mesh.reference(mesh.locate(points), points) >= -1e-9).all()


class TestRefined:
    """Names after bisection."""

    @pytest.mark.parametrize("marked", [None, [0], [3, 7], "mask"])
    def test_names_cover_the_same_lines(self, marked):
        mesh = l_shape()
        marked = np.arange(len(mesh.cells)) % 5 == 0 if isinstance(marked, str) else marked
        fine = mesh.refined(marked)
        assert len(fine.cells) > len(mesh.cells)
        assert (fine.edge_names, fine.joint_names) == (mesh.edge_names, mesh.joint_names)
        for name in (*mesh.edge_names, *mesh.joint_names):
            assert fine.edges(name).length.sum() == pytest.approx(mesh.edges(name).length.sum(), rel=1e-12)
        assert fine.corners[fine.regions["foot"]].mean(axis=1)[:, 1].max() < 0.5
        assert area(fine) == pytest.approx(area(mesh))
        assert np.isin(fine.parents(mesh)[fine.regions["foot"]], mesh.regions["foot"]).all()

    def test_numbers_do_not_choose_one_of_equal_sides(self):
        """Sectors of a disc, which have two longest ones. Angles become no smaller than half of the smallest one."""
        mesh, found = half_disc().mesh, []
        for order in (np.arange(14), np.random.default_rng(0).permutation(14)):
            fine = bare = TriangleMesh(mesh.vertices[order], np.argsort(order)[mesh.cells])
            for _ in range(8):
                fine = fine.refined(fine.locate(mesh.corners[0].mean(axis=0)[None]))
            middles = (each.corners.mean(axis=1) for each in (fine, bare.graded([(0.0, 0.0)], 2, ratio=0.3)))
            found.append(np.concatenate([np.sort_complex(each @ [1.0, 1j]) for each in middles]))
        assert found[0] == pytest.approx(found[1])
        a, b, c = (np.concatenate([mesh.corners, fine.corners]) @ [1.0, 1j]).T
        angles = np.abs(np.angle([(b - a) / (c - a), (c - b) / (a - b), (a - c) / (b - c)])).min(axis=0)
        assert angles.min() > 0.5 * angles[: len(mesh.cells)].min()

    def test_grading_halves_the_triangles_at_a_point(self):
        mesh = TriangleMesh.rectangle((2, 2))
        for depth in (0, 1, 6):
            assert mesh.graded([(1.0, 1.0)], depth).finest.min() == pytest.approx(0.5**depth / 2.0)
        both = mesh.graded([(1.0, 1.0), (0.3, 1.0)], [3, 5])
        assert both.finest[both.vertices @ (1, 1) == 2.0] == pytest.approx(0.5**4)

    def test_layers_end_at_powers_of_the_ratio(self):
        mesh = l_shape()
        fine = mesh.graded([(1.0, 1.0), (0.0, 0.0)], [4, 2], ratio=0.2)
        for place, depth in (((1.0, 1.0), 4), ((0.0, 0.0), 2)):
            sizes = []
            for each in (mesh, fine):
                own = each.corners[(each.corners == place).all(axis=2).any(axis=1)] - place
                sizes.append(np.abs(own).max(axis=(1, 2)))
            assert sizes[1] == pytest.approx(sizes[0] * 0.2**depth)
        assert area(fine) == pytest.approx(area(mesh))
        assert fine.edges("notch").length.sum() == pytest.approx(1.0)
        feet = [each.corners[each.region("foot")].max(axis=(0, 1)) for each in (mesh, fine)]
        assert feet[1] == pytest.approx(feet[0])

    def test_layers_of_a_turned_body_are_turned_layers(self):
        """Two sides of equal length are halved here: rounding must not choose one."""
        body = fan([np.array(SQUARE)], closed=True, centre=(0.5, 0.5))
        first, *others = (
            oblique(body, angle).graded(turned([(0.5, 0.5)], angle), 2, ratio=0.2).cells for angle in range(0, 50, 10)
        )
        assert all(np.array_equal(first, other) for other in others)

    def test_layers_begin_at_vertices_without_arcs(self):
        with pytest.raises(InputError, match="vertices"):
            square().graded([(0.123, 0.4)], 1, ratio=0.2)
        ring = quarter(1, 2)
        with pytest.raises(InputError, match="arc"):
            ring.graded([ring.vertices[ring.edges("inner").first[0]]], 1, ratio=0.2)

    def test_layers_follow_the_singular_stress_of_a_corner(self):
        """The force of the plate that sticks, of which other codes say 214.367658387 ± 2e-7 (`comparisons.settled`)."""
        errors = []
        for layers in (1, 2, 3, 4):
            mesh = TriangleMesh.grid([0.0, 1.0], [0.0, 1.0]).graded([(1.0, 1.0)], layers, ratio=0.15)
            result = solve(replace(compressed_plate(1.0), mesh=mesh), degree=9)
            errors.append(abs(result.resultant("plate").y / 214.367658387 + 1.0))
        assert errors[-1] < 2e-8  # with 378 unknowns
        assert (np.divide(errors[1:], errors[:-1]) < 0.3).all()

    @pytest.mark.parametrize("angle", [0.3, np.pi])
    def test_fans_are_as_narrow_as_asked_for_and_shorter_than_the_triangles(self, angle):
        mesh = l_shape()
        (vertex,) = np.flatnonzero((mesh.vertices == (1.0, 1.0)).all(axis=1))
        fan = mesh.fanned(np.array([vertex]), angle)
        own = fan.corners[(fan.cells == vertex).any(axis=1)]
        arms = own[(own != (1.0, 1.0)).any(axis=2)].reshape(-1, 2, 2) - 1.0
        one, other = (arms[:, k, 0] + 1j * arms[:, k, 1] for k in (0, 1))
        turns = np.abs(np.angle(other / one))
        assert turns.max() <= angle * (1.0 + 1e-9)
        assert turns.sum() == pytest.approx(1.5 * np.pi)  # around a corner that turns inwards
        assert np.abs([one, other]).max() <= 0.25 * np.sqrt(2.0) * (1.0 + 1e-12)
        assert area(fan) == pytest.approx(area(mesh))
        assert fan.edges("notch").length.sum() == pytest.approx(1.0)
        assert fan.region("foot").size >= mesh.region("foot").size

    def test_grading_says_how_deep_it_goes(self):
        """The depth that the message names is the largest one that works."""
        mesh = TriangleMesh.rectangle((3, 2))
        with pytest.raises(InputError, match="depth") as refused:
            mesh.graded([(0.3, 0.0)], 60)
        deepest = int(re.search(r"at most (\d+)", refused.value.remedy)[1])
        assert mesh.graded([(0.3, 0.0)], deepest).finest.min() > 0.0
        with pytest.raises(InputError):
            mesh.graded([(0.3, 0.0)], deepest + 1)


class TestEdges:
    """Normals, tangents and cells of edges as contacts want them."""

    def test_the_boundary_faces_outward(self):
        edges = (mesh := l_shape()).boundary
        middle = np.column_stack([part[:, 0] for part in mesh.points_along(edges, np.array([0.5]))])
        assert (mesh.locate(middle + 1e-3 * edges.normal) == -1).all()
        assert (mesh.locate(middle - 1e-3 * edges.normal) == edges.cells[:, 0]).all()
        assert (edges.cells[:, 1] == -1).all()

    def test_tangents_point_to_the_right_or_upward_whatever_rounding_says(self):
        mesh = TriangleMesh(turned(l_shape().vertices, 20.0), l_shape().cells)
        for edges in (mesh.boundary, mesh.interior, l_shape().boundary, l_shape().interior):
            assert ((edges.tangent[:, 0] > 1e-12) | (edges.tangent[:, 1] == 1.0)).all()
        along = mesh.vertices[mesh.boundary.second] - mesh.vertices[mesh.boundary.first]
        assert along == pytest.approx(mesh.boundary.tangent * mesh.boundary.length[:, None])
        for tilt in (1e-13, 1e-7):  # of coordinates in files
            vertices = [(0, 0), (1, 0), (1 - tilt, 1), (1 + tilt, 2), (0, 2)]
            mesh = TriangleMesh(vertices, [(0, 1, 2), (0, 2, 3), (0, 3, 4)])
            upright = np.abs(mesh.boundary.tangent[:, 0]) < 1e-6
            assert upright.sum() == 3
            assert (mesh.boundary.tangent[upright, 1] > 0.0).all()

    def test_inner_edges_lie_between_a_lower_or_left_triangle_and_another(self):
        mesh = l_shape()
        centres, edges = mesh.corners.mean(axis=1), mesh.interior
        step = centres[edges.cells[:, 1]] - centres[edges.cells[:, 0]]
        assert ((step * edges.normal).sum(axis=1) > 0.0).all()
        assert ((edges.normal[:, 1] > 1e-12) | (edges.normal[:, 0] == 1.0)).all()

    def test_edge_sets_are_indices_into_boundary_and_interior(self):
        mesh = l_shape()
        taken = [(name, mesh.boundary.take(mesh.edge_set(name))) for name in mesh.edge_names]
        for name, edges in [*taken, ("seam", mesh.interior.take(mesh.joint_set("seam")))]:
            assert (np.sort(np.column_stack([edges.first, edges.second])) == mesh.pairs(name)).all()
            assert (mesh.edges(name).first == edges.first).all()
        with pytest.raises(InputError, match="joint"):
            mesh.joint_set("top")

    def test_all_triangles_around_a_point(self):
        mesh = TriangleMesh.rectangle((2, 2))
        points = np.array([[0.5, 0.5], [0.3, 0.1], [0.25, 0.25], [2.0, 0.0], [0.0, 0.0]])
        point, cell = mesh.around(points)
        assert np.bincount(point, minlength=5).tolist() == [8, 1, 2, 0, 2]
        assert (mesh.reference(cell, points[point]) > -1e-12).all()
        assert mesh.reference(cell, points[point]) @ np.ones(3) == pytest.approx(1.0)


def test_points_of_edges_are_found_although_coordinates_are_rounded():
    """Of a small block in coordinates of a map."""
    block = oblique(TriangleMesh.rectangle((3, 2), 0.2, 0.1), 17.0)
    block = replace(block, vertices=block.vertices + np.array([5e5, 4.2e6]))
    for edges, count in ((block.boundary, 1), (block.interior, 2)):
        first, second = block.vertices[edges.first], block.vertices[edges.second]
        points = np.concatenate([first + t * (second - first) for t in np.linspace(0.1, 0.9, 9)])
        assert (np.bincount(block.around(points)[0], minlength=len(points)) == count).all()


def test_regions_and_segments_are_told_apart_in_the_smallest_triangles():
    """Beside a border and a corner, however often their triangles are halved."""
    mesh = TriangleMesh.rectangle((2, 2)).graded([(0.5, 0.5), (0.0, 0.0)], 30)
    assert mesh.finest.min() < 1e-8
    free = [Traction(side, x=0.0, y=0.0) for side in mesh.edge_names]
    problem = ContactProblem(mesh, Material(1.0, 0.3), free, regions=[Region(Material(2.0, 0.3), y=(0.5, 1.0))])
    assert (problem.cell_materials == (mesh.corners.mean(axis=1)[:, 1] > 0.5)).all()
    for lean in (0.0, 2.0, -2.0):  # corners of 90°, 27° and 153°
        leaning = TriangleMesh(mesh.vertices @ [[1.0, 0.0], [lean, 1.0]], mesh.cells, mesh.edge_sets)
        base = edges_on_segment(leaning.vertices, mesh.topology, (0.0, 0.0), (1.0, 0.0))
        assert (leaning.with_edges("base", base).pairs("base") == mesh.pairs("bottom")).all()


class TestJoined:
    """Bodies meshed apart, whose nodes do not match on the line between them."""

    def below(self, cells=(3, 2)):
        return TriangleMesh.rectangle(cells, 2.0, 1.0).with_edges("foot", lambda _, y: y == 0.0)

    def above(self, cells, width=2.0, left=0.0):
        return TriangleMesh.rectangle(cells, width, 0.5, origin=(left, 1.0))

    def test_both_sides_get_the_nodes_of_either(self):
        above = self.above((4, 3), 1.6, 0.2).with_region("block", lambda x, _: x > 0.0)
        mesh = TriangleMesh.joined("seam", [self.below(), above])
        x = np.unique(mesh.vertices[mesh.pairs("seam")][..., 0])
        assert x == pytest.approx([0.2, 0.6, 2.0 / 3.0, 1.0, 4.0 / 3.0, 1.4, 1.8])
        assert mesh.edges("seam").length.sum() == pytest.approx(1.6)
        assert mesh.edges("top").length.sum() == pytest.approx(1.6 + 0.4)  # of both bodies, without what is the seam
        assert mesh.edges("foot").length.sum() == pytest.approx(2.0)
        assert area(mesh) == pytest.approx(2.8)
        assert area(mesh.part(mesh.regions["block"])) == pytest.approx(0.8)

    def test_three_bodies_in_a_corner_and_nodes_that_match(self):
        blocks = [self.above((2, 2), 1.0), self.above((3, 3), 1.0, 1.0)]
        for across in (4, 3):  # the corner is a node of all three bodies, or lies inside an edge of one
            mesh = TriangleMesh.joined("seam", [self.below((across, 2)), *blocks])
            assert mesh.edges("seam").length.sum() == pytest.approx(2.5)
        same = TriangleMesh.joined("seam", [self.below((4, 2)), self.above((4, 2))])
        assert (len(same.cells), len(same.pairs("seam"))) == (32, 4)

    @pytest.mark.parametrize(("rounding", "place"), [(1e-9, 0.0), (1e-7, 0.0), (0.0, 1e7)])
    def test_bodies_whose_data_are_rounded_are_joined_along_all_of_the_line(self, rounding, place):
        turn, rng = np.array([[0.8, 0.6], [-0.6, 0.8]]), np.random.default_rng(0)
        for _ in range(4):
            meshes = list[TriangleMesh]()
            for each in (self.below((5, 2)), self.above((7, 3), 1.6, 0.2)):
                vertices = (each.vertices + place) @ turn + rng.normal(0.0, rounding, each.vertices.shape)
                meshes.append(TriangleMesh(vertices, each.cells))
            mesh = TriangleMesh.joined("seam", meshes)
            assert mesh.edges("seam").length.sum() == pytest.approx(1.6, abs=1e-6)
            assert len(mesh.outlines) == 1

    def test_bodies_that_meet_at_some_of_their_vertices_are_refused(self):
        above = self.above((4, 2))
        vertices = above.vertices.copy()
        vertices[2, 1] += 1e-5
        with pytest.raises(InputError, match="apart around"):
            TriangleMesh.joined("seam", [self.below((1, 2)), TriangleMesh(vertices, above.cells)])

    def test_what_cannot_be_joined(self):
        apart = TriangleMesh.rectangle((2, 2), 1.0, 1.0, origin=(0.0, 1.5))
        for meshes in ([self.below(), apart], [self.below(), "mesh"], []):
            with pytest.raises(InputError, match="no pieces" if apart in meshes else "list of TriangleMesh"):
                TriangleMesh.joined("seam", meshes)
        with pytest.raises(InputError, match="exists already"):
            TriangleMesh.joined("foot", [self.below(), self.above((2, 2))])

    def test_in_a_mesh_file(self, tmp_path):
        """A triangle without area is told and not left out."""
        meshio, one, other = pytest.importorskip("meshio"), self.below(), self.above((4, 3))
        points = np.pad(np.concatenate([one.vertices, other.vertices]), [(0, 0), (0, 1)])
        cells = np.concatenate([[[0, 0, 1]], one.cells, other.cells + len(one.vertices)])
        for name, own, join, told in (("a.vtk", cells, "seam", "no area"), ("b.vtk", cells[1:], None, "do not.*join")):
            meshio.write(tmp_path / name, meshio.Mesh(points, [("triangle", own)]))
            with pytest.raises(InputError, match=told):
                TriangleMesh.load(tmp_path / name, join)
        assert TriangleMesh.load(tmp_path / "b.vtk", "seam").joint_names == ("seam",)


class TestJoinedAlongArcs:
    """Rings meshed apart, whose chords overlap where their arcs are one."""

    def ring(self, radii, angles, names, axes=(1.0, 1.0), digits=16):
        lines = [radius * np.column_stack([axes[0] * np.cos(angles), axes[1] * np.sin(angles)]) for radius in radii]
        mesh = fan(lines, closed=False)
        sets = {names.get(name, name): pairs for name, pairs in mesh.edge_sets.items()}
        mesh = TriangleMesh(mesh.vertices.round(digits), mesh.cells, sets)
        for name, radius in zip(names.values(), (radii[0], radii[-1]), strict=True):

            def curve(t, radius=radius):
                return radius * np.column_stack([axes[0] * np.cos(t), axes[1] * np.sin(t)])

            circle = axes[0] == axes[1]
            mesh = mesh.with_arc(name, (0, 0), radius) if circle else mesh.with_curve(name, curve, 0.0, 2.0 * np.pi)
        return mesh

    def rings(self, axes=(1.0, 1.0)):
        """Two of them; of the nodes on the common arc one is the same."""
        uneven = np.array([0.0, 0.3, 0.55, 0.8, 1.2, np.pi / 2.0])
        inner = self.ring([1.0, 1.5, 2.0], uneven, {"inner": "bore", "outer": "shaft"}, axes)
        outer = self.ring([2.0, 3.0], np.append(np.linspace(0.0, 0.8, 3), [1.25, np.pi / 2.0]),
                          {"inner": "hub", "outer": "rim"}, axes)  # fmt: skip
        return [inner, outer]

    @pytest.mark.parametrize("axes", [(1.0, 1.0), (1.3, 1.0)])
    def test_both_sides_follow_the_same_arc(self, axes):
        inner, outer = self.rings(axes)
        mesh = TriangleMesh.joined("fit", [outer, inner])
        line = mesh.edges("fit")
        assert len(line.length) == 7
        for name in ("shaft", "hub"):
            whole = (inner if name == "shaft" else outer).edges(name).length.sum()
            assert line.length.sum() == pytest.approx(whole, rel=1e-11)
        x, y = mesh.points_along(line, np.linspace(0.0, 1.0, 7))
        assert np.hypot(x / axes[0], y / axes[1]) == pytest.approx(2.0, rel=1e-10)

    @pytest.mark.parametrize("axes", [(1.0, 1.0), (1.3, 1.0)])
    def test_a_uniform_pressure(self, axes):
        """Exact on straight lines, on arcs as good as the degree is."""
        mesh = TriangleMesh.joined("fit", self.rings(axes))
        loads = [Traction(name, normal=-3.0, tangential=0.0) for name in ("bore", "rim")]
        conditions = [Symmetry("start"), Symmetry("end"), *loads, Contact("fit", friction=0.4)]
        result = solve(ContactProblem(mesh, Material(100.0, 0.3), conditions), degree=7)
        line, (_, _, stress) = result.contacts["fit"], result.gauss_stress()
        assert result.status == "solved"
        assert line.normal_stress == pytest.approx(-3.0, rel=1e-5)
        assert stress.reshape(-1, 3) == pytest.approx(np.tile([-3.0, -3.0, 0.0], (stress.size // 3, 1)), abs=3e-5)

    def test_nodes_of_few_digits(self):
        """They are off their circle by a share of its radius, which is a larger one of a short edge."""
        angles = np.linspace(0.0, np.pi / 2.0, 24), np.linspace(0.0, np.pi / 2.0, 8)
        inner = self.ring([1.0, 2.0], angles[0], {"inner": "bore", "outer": "shaft"}, digits=6)
        outer = self.ring([2.0, 3.0], angles[1], {"inner": "hub", "outer": "rim"}, digits=6)
        assert len(TriangleMesh.joined("fit", [inner, outer]).edges("fit").length) == 23 + 7 - 1

    def test_chords_are_not_joined(self):
        inner, outer = (TriangleMesh(mesh.vertices, mesh.cells, mesh.edge_sets) for mesh in self.rings())
        with pytest.raises(InputError, match="join"):
            TriangleMesh.joined("fit", [inner, outer])
