"""Triangles of shapes: closed, seen from outside, near what they stand for, with normals as smooth as the shape is."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

import articulated as art
from articulated.trajectory.surfaces import AROUND, creased, surface_of

SHAPES = {
    "box": (art.Box((0.3, 0.5, 0.7)), 0.3 * 0.5 * 0.7),
    "sphere": (art.Sphere(0.4), 4.0 / 3.0 * math.pi * 0.4**3),
    "cylinder": (art.Cylinder(0.2, 0.9), math.pi * 0.2**2 * 0.9),
    "capsule": (art.Capsule(0.2, 0.9), math.pi * 0.2**2 * (0.9 + 4.0 / 3.0 * 0.2)),
    "a capsule that is a ball": (art.Capsule(0.2, 0.0), 4.0 / 3.0 * math.pi * 0.2**3),
}


@pytest.fixture(params=SHAPES)
def shape(request):
    geometry, volume = SHAPES[request.param]
    return geometry, volume, surface_of(geometry)


class TestPlainShapes:
    def test_are_closed(self, shape):
        _, _, surface = shape
        _, place = np.unique(surface.points.round(6), axis=0, return_inverse=True)
        faces = place.reshape(-1)[surface.triangles]
        edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        assert not np.any(edges[:, 0] == edges[:, 1])  # none without area
        there, back = (set(map(tuple, some.tolist())) for some in (edges, edges[:, ::-1]))
        assert there == back
        assert len(there) == len(edges)

    def test_volume(self, shape):
        _, volume, surface = shape
        ours = np.linalg.det(surface.points[surface.triangles].astype(float)).sum() / 6.0
        sides = math.sin(2.0 * math.pi / AROUND) * AROUND / (2.0 * math.pi)  # of a polygon in its circle, 0.6 % less
        assert sides**3 * volume < ours < volume * (1.0 + 1e-6)

    def test_normals_point_where_triangles_do(self, shape):
        _, _, surface = shape
        corners = surface.points[surface.triangles].astype(float)
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        cosines = np.einsum("mi,mki->mk", across, surface.normals[surface.triangles])
        assert cosines.min() > math.cos(2.0 * math.pi / AROUND)
        np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1.0, atol=1e-6)

    def test_a_ball_is_smooth(self):
        surface = surface_of(art.Sphere(0.4))
        np.testing.assert_allclose(surface.points, 0.4 * surface.normals, atol=1e-7)

    def test_a_capsule_is_smooth(self):
        surface = surface_of(art.Capsule(0.2, 0.9))
        axis = np.zeros_like(surface.points)
        axis[:, 2] = np.clip(surface.points[:, 2], -0.45, 0.45)
        np.testing.assert_allclose(surface.points - axis, 0.2 * surface.normals, atol=1e-7)

    def test_bounds(self):
        for geometry, size in [
            (art.Box((0.3, 0.5, 0.7)), (0.3, 0.5, 0.7)),
            (art.Cylinder(0.2, 0.9), (0.4, 0.4, 0.9)),
            (art.Capsule(0.2, 0.9), (0.4, 0.4, 1.3)),
        ]:
            np.testing.assert_allclose(np.ptp(surface_of(geometry).points, axis=0), size, atol=1e-6)

    def test_nothing_of_a_line(self):
        assert len(surface_of(art.Capsule(0.0, 1.0)).triangles) == 0


class TestMeshes:
    def test_a_brick_has_sharp_edges(self):
        surface = creased(trimesh.creation.box((1, 2, 3)).triangles)
        assert len(surface.points) == 24
        np.testing.assert_allclose(np.abs(surface.normals).max(axis=1), 1.0, atol=1e-6)

    def test_a_ball_is_smooth(self):
        ball = trimesh.creation.icosphere(subdivisions=3)
        surface = creased(ball.triangles)
        assert len(surface.points) == len(ball.vertices)
        np.testing.assert_allclose(surface.normals, surface.points, atol=0.02)

    def test_a_drum_is_smooth_around_and_sharp_at_its_rims(self):
        surface = creased(trimesh.creation.cylinder(0.5, 1.0, sections=32).triangles)
        flat = np.abs(surface.normals[:, 2])
        assert np.all((flat < 1e-6) | (flat > 1.0 - 1e-6))
        round_ = flat < 0.5
        np.testing.assert_allclose(surface.normals[round_, :2], 2.0 * surface.points[round_, :2], atol=0.05)

    def test_both_sides_of_a_sheet(self):
        one = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
        surface = creased(np.vstack([one, one[:, ::-1]]))
        np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1.0)
        assert len(surface.points) == 6

    def test_pages_of_a_book_open_all_around(self):
        """Their normals cancel along the back, where those of any one page have to do."""
        angle = math.radians(20.0) * np.arange(18)
        up, out = np.array([0.0, 0.0, 1.0]), np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
        surface = creased(np.stack([np.zeros_like(out), np.broadcast_to(up, out.shape), out], axis=1))
        pages = np.cross(up, out)
        assert np.max(surface.normals @ pages.T, axis=1).min() > 0.9999

    def test_what_has_no_area_is_left_out(self):
        line = np.array([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 0], [0, 0, math.nan], [1, 0, 0]]])
        assert len(creased(line).triangles) == 0
