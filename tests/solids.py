"""Solids that several tests weigh, where they stand, and when two weigh the same."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import articulated as art
from articulated.rig.frames import rotation_with_z_along

BOX = art.Box((0.2, 0.3, 0.5))


def pose(direction=(0.0, 0.0, 1.0), at=(0.0, 0.0, 0.0)) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation_with_z_along(np.array(direction, dtype=float)), at
    return X


def random_pose(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    X = np.eye(4)
    X[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    X[:3, 3] = rng.normal(size=3)
    return X


def same(one: art.MassProperties, other: art.MassProperties, rtol=1e-12) -> None:
    size = np.sqrt(np.trace(other.inertia) / other.mass)
    assert one.mass == pytest.approx(other.mass, rel=rtol)
    np.testing.assert_allclose(one.center, other.center, atol=rtol * size)
    np.testing.assert_allclose(one.inertia, other.inertia, atol=rtol * np.trace(other.inertia))


def without(mesh: trimesh.Trimesh, *faces: int) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, np.delete(mesh.faces, faces, axis=0), process=False)
