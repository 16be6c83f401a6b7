"""How hulls are made: of points, of many points, of meshes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from narrow_truths import CUBE, Rotation, apart

from articulated.simulation.contact.polyhedra import MOST_VERTICES, polyhedron, polyhedron_of_mesh, simplified


class TestPolyhedron:
    def test_box_of_many_points(self):
        """Points inside, on faces and on edges are left out; triangles in a plane are one face."""
        rng = np.random.default_rng(0)
        signs = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
        inner = rng.uniform(-1.0, 1.0, (300, 3))
        faces = inner.copy()
        faces[np.arange(300), np.arange(300) % 3] = np.sign(faces[np.arange(300), np.arange(300) % 3])
        faces += rng.normal(scale=1e-6, size=(300, 3))  # as in a file
        turn = Rotation.random(rng=rng)
        points = np.array([1.0, 2.0, 3.0]) + turn.apply(np.vstack([signs, inner, faces]) * [0.3, 0.2, 0.1])
        center, solid = polyhedron(points)
        assert center == pytest.approx([1.0, 2.0, 3.0], abs=1e-6)
        assert (len(solid.vertices), len(solid.faces), len(solid.edges)) == (8, 6, 12)
        assert np.sort([d for _, d in solid.faces]) == pytest.approx([0.1, 0.1, 0.2, 0.2, 0.3, 0.3], abs=2e-6)

    @pytest.mark.parametrize("n", [4, 8, 12, 30])
    def test_is_what_it_should_be(self, n):
        """Euler's formula; all vertices within all faces; its middle is that of its volume."""
        points = np.random.default_rng(n).normal(size=(n, 3))
        center, solid = polyhedron(points)
        V, N = np.array(solid.vertices), np.array([face[0] for face in solid.faces])
        beyond = V @ N.T - [face[1] for face in solid.faces]
        assert len(V) - len(solid.edges) + len(N) == 2
        assert np.linalg.norm(N, axis=1) == pytest.approx(1.0)
        assert beyond.max() == pytest.approx(0.0, abs=1e-9)
        assert (np.isclose(beyond, 0.0, atol=1e-9).sum(axis=0) >= 3).all()
        assert center == pytest.approx(trimesh.convex.convex_hull(points).center_mass, abs=1e-9)

    @pytest.mark.parametrize(
        ("vertices", "message"),
        [
            ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], r"vertices have shape \(3, 3\); expected \(n, 3\) with n of 4 or more"),
            (np.zeros((5, 2)), r"vertices have shape \(5, 2\)"),
            ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "vertices lie in a plane"),
            ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1e-8]], "vertices lie in a plane"),
            ([[0, 0, 0]] * 6, "vertices lie in a plane"),
            ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, np.nan]], r"a vertex is \(0.0, 0.0, nan\); expected finite numbers"),
        ],
    )
    def test_what_is_none(self, vertices, message):
        for function in (polyhedron, simplified):
            with pytest.raises(ValueError, match=message):
                function(vertices)

    def test_simplified(self):
        """Some of the vertices, and the largest distance of all from their hull, as a quadratic program has it."""
        points = np.random.default_rng(1).normal(size=(60, 3))
        points /= np.linalg.norm(points, axis=1)[:, None]
        lost = []
        for most in (6, 12, 20):
            chosen, far = simplified(points, most)
            assert len(chosen) == most
            assert {tuple(p) for p in chosen.tolist()} <= {tuple(p) for p in points.tolist()}
            assert far == pytest.approx(max(apart(p[None], chosen) for p in points), abs=1e-5)
            lost.append(far)
        assert lost == sorted(lost, reverse=True)
        assert lost[1] < 0.36
        assert lost[2] < 0.165

    def test_few_are_kept(self):
        chosen, far = simplified(np.array(CUBE.vertices), 8)
        assert (len(chosen), far) == (8, 0.0)
        with pytest.raises(ValueError, match="most is 3; expected 4 or more"):
            simplified(np.array(CUBE.vertices), 3)

    def test_mesh(self, tmp_path):
        path = tmp_path / "ball.stl"
        trimesh.creation.icosphere(subdivisions=3, radius=0.1).export(path)
        center, solid, lost = polyhedron_of_mesh(path, (1.0, 1.0, 2.0))
        assert len(solid.vertices) == MOST_VERTICES
        assert np.abs(center).max() < 0.04
        assert 0.01 < lost < 0.08
        assert max(math.hypot(*np.add(v, center)) for v in solid.vertices) <= 0.2 + 1e-6
        assert polyhedron_of_mesh(path, (1.0, 1.0, 2.0))[1] is solid
        trimesh.creation.box((0.2, 0.4, 0.6)).export(path)
        center, solid, lost = polyhedron_of_mesh(path)
        assert (len(solid.vertices), len(solid.faces), lost) == (8, 6, 0.0)

    def test_mesh_that_is_none(self, tmp_path):
        path = tmp_path / "flat.stl"
        trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]], process=False).export(path)
        with pytest.raises(ValueError, match=r"flat\.stl: vertices lie in a plane"):
            polyhedron_of_mesh(path)
        path = tmp_path / "none.shape"
        path.write_bytes(b"nothing")
        with pytest.raises(ValueError, match=r"none\.shape: this mesh cannot be read"):
            polyhedron_of_mesh(path)
