"""Ropes and cloth stretch, bend and weigh as the materials that they are made of, however many particles they have."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay

from articulated import particles as ap

G = 9.81


def hung(fabric, pinned, h=0.05, steps=60, **more):
    system = ap.System(
        fabric.x, None, fabric.mass, [*fabric.forces, ap.Gravity(), ap.Drag(0.05 * fabric.mass.sum())], pinned=pinned
    )
    for _ in range(steps):
        system.step(h, ap.ImplicitEuler(**more))
    return system


@pytest.mark.parametrize("particles", [5, 17])
def test_a_rope_stretches_by_its_own_weight(particles):
    """By ρ g L²/(2 E A), as springs and lumps do exactly."""
    rope = ap.rope((0, 0, 0), (0, 0, -2.0), particles, mass=0.3, stiffness=50.0)
    assert rope.mass.sum() == pytest.approx(0.3)
    system = hung(rope, [0], steps=150)
    assert -system.x[-1, 2] - 2.0 == pytest.approx(0.3 * G * 2.0 / (2 * 50.0), rel=1e-6)


@pytest.mark.parametrize("particles", [9, 33])
def test_a_clamped_rod_sags_by_its_own_weight(particles):
    """By ρ g L⁴/(8 E I) at its end."""
    rod = ap.rope((0, 0, 0), (1.0, 0, 0), particles, mass=0.1, stiffness=1e4, bending=5.0)
    system = hung(rod, [0, 1], h=0.5, steps=200)
    free = 1.0 - 1.0 / (particles - 1)
    sag = 0.1 * G * free**4 / (8 * 5.0)
    assert -system.x[-1, 2] == pytest.approx(sag, rel=5.0 / particles)


@pytest.mark.parametrize(("rows", "columns"), [(4, 3), (9, 7)])
def test_cloth_stretches_under_a_load(rows, columns):
    """Strain is the force on a width over its stiffness, where nothing shears."""
    cloth = ap.grid_cloth((0, 0, 0), (0, 0, -1.0), (0.5, 0, 0), rows, columns, density=0.2, stretch=1000.0, shear=0.0)
    assert cloth.mass.sum() == pytest.approx(0.2 * 0.5)
    last = np.arange((rows - 1) * columns, rows * columns)
    share = np.where(np.isin(last, last[[0, -1]]), 0.5, 1.0) / (columns - 1)
    load = np.zeros((rows * columns, 3))
    load[last, 2] = -20.0 * share
    forces = [*cloth.forces, ap.OwnForce(lambda t, x, v, mass: load), ap.Drag(0.1)]
    system = ap.System(cloth.x, None, cloth.mass, forces, pinned=np.arange(columns))
    for _ in range(60):
        system.step(0.1, "implicit_euler")
    np.testing.assert_allclose(-system.x[last, 2] - 1.0, 20.0 / 0.5 / 1000.0, rtol=1e-3)


@pytest.mark.parametrize("axis", [0, 1])
def test_rolled_cloth_has_the_energy_of_a_sheet(axis):
    """B κ²/2 an area, but for the half cells at its ends."""
    radius, n = 5.0, 40
    for sheet in (ap.grid_cloth((0, 0, 0), (1, 0, 0), (0, 1, 0), n, n, 1.0, 1.0, bending=0.7), triangular(n)):
        along = sheet.x[:, axis] / radius
        rolled = sheet.x.copy()
        rolled[:, axis], rolled[:, 2] = radius * np.sin(along), radius * (1 - np.cos(along))
        area = np.ptp(sheet.x[:, 0]) * np.ptp(sheet.x[:, 1])
        assert sheet.forces[1].energy(0.0, rolled, sheet.mass) == pytest.approx(0.5 * 0.7 / radius**2 * area, rel=0.06)


def triangular(n):
    """A sheet of triangles of equal sides."""
    i, j = np.unravel_index(np.arange(n * n), (n, n))
    x = np.stack([(i + 0.5 * (j % 2)) / n, j * math.sqrt(0.75) / n, 0.0 * i], axis=1)
    faces = Delaunay(x[:, :2]).simplices
    inner = np.ptp(i[faces], axis=1) < 2  # at the border there are slivers
    return ap.mesh_cloth(trimesh.Trimesh(x, faces[inner]), 1.0, 1.0, 0.7)


def test_a_mesh_is_cloth():
    ball = trimesh.creation.icosphere(2, 0.2)
    cloth = ap.mesh_cloth(ball, density=0.3, stretch=200.0, bending=1e-4, damping=1e-3)
    assert cloth.mass.sum() == pytest.approx(0.3 * ball.area)
    springs, bending = cloth.forces
    assert len(springs.pairs) == len(ball.edges_unique)
    assert len(bending.groups) == len(ball.face_adjacency)
    assert not np.abs(springs.force(0.0, cloth.x, 0 * cloth.x, cloth.mass)).max() > 1e-12
    # stretched both ways, a membrane with Poisson's ratio 1/3 has E ε²/(1 − 1/3) an area
    energy = springs.energy(0.0, 1.01 * cloth.x, cloth.mass)
    assert energy == pytest.approx(1.5 * 200.0 * 1e-4 * ball.area, rel=1e-6)


def test_vertices_without_triangles_are_left_out():
    mesh = trimesh.Trimesh([(0, 0, 0), (9, 9, 9), (1, 0, 0), (0, 1, 0)], [(0, 2, 3)], process=False)
    cloth = ap.mesh_cloth(mesh, 1.0, 1.0)
    assert len(cloth.x) == 3
    np.testing.assert_array_equal(cloth.triangles, [(0, 1, 2)])
    assert ap.System(cloth.x, None, cloth.mass, cloth.forces).energy() < 1e-30


def test_a_rope_is_a_chain():
    assert (
        ap.System((rope := ap.rope((0, 0, 0), (1, 0, 0), 9, 1.0, 1e3, 0.1)).x, None, rope.mass, rope.forces).chains is not None
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ap.rope((0, 0, 0), (0, 0, 0), 5, 1.0, 1.0), r"rope: start and end are in one place; give it a length"),
        (lambda: ap.rope((0, 0, 0), (1, 0, 0), 1, 1.0, 1.0), r"rope: particles is 1; expected a whole number, 2 or more"),
        (lambda: ap.rope((0, 0, 0), (1, 0, 0), 5, 0.0, 1.0), r"rope: mass is 0; expected a number above zero"),
        (lambda: ap.rope((0, 0, 0), (1, 0, 0), 5, 1.0, -1.0), r"rope: stiffness is -1; expected a number above zero"),
        (
            lambda: ap.grid_cloth((0, 0, 0), (1, 0, 0), (2, 0, 0), 3, 3, 1.0, 1.0),
            r"grid_cloth: along and across have one direction",
        ),
        (
            lambda: ap.grid_cloth((0, 0, 0), (1, 0, 0), (0, 1, 0), 3, 1, 1.0, 1.0),
            r"grid_cloth: columns is 1; expected a whole number",
        ),
        (lambda: ap.grid_cloth((0, 0, 0), (1, 0, 0), (0, 1, 0), 3, 3, np.nan, 1.0), r"grid_cloth: density is nan"),
        (
            lambda: ap.mesh_cloth(trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)], process=False), 1.0, 1.0),
            r"mesh_cloth: triangle 0, of vertices \[0, 1, 2\], has no area; leave it out of the mesh",
        ),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(ValueError, match=message):
        make()
