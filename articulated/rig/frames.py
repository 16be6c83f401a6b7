"""Numeric poses, for describing a rig (the moving ones are over scalars, in `spatial`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from articulated.rig.errors import Place

_NOISE = 1e-14


def pose_of(
    place: Place, xyz: np.ndarray, rpy: Sequence[float] | None = None, quat_xyzw: Sequence[float] | None = None
) -> np.ndarray:
    """The pose, shape (4, 4), of a frame at `xyz` turned by roll, pitch, yaw about fixed axes, or by a quaternion."""
    if rpy is not None and quat_xyzw is not None:
        raise place.error("gives both rpy and quat_xyzw", "give one of them")
    pose = np.eye(4)
    pose[:3, 3] = xyz
    if quat_xyzw is not None:
        quat = np.array(quat_xyzw, dtype=float)
        if quat.shape != (4,) or not np.isfinite(quat).all() or abs(np.linalg.norm(quat) - 1.0) > 1e-3:
            raise place.error(f"quat_xyzw is {quat.tolist()}", "give a unit quaternion, scalar last")
        pose[:3, :3] = _rotation_of_quaternion(quat / np.linalg.norm(quat))
    elif rpy is not None:
        angles = np.array(rpy, dtype=float)
        if angles.shape != (3,):
            raise place.error(f"rpy has shape {angles.shape}", "give roll, pitch and yaw")
        pose[:3, :3] = _rotation_of_rpy(*angles)
    return snapped(pose)


def is_pose(matrix: np.ndarray) -> bool:
    """Whether a matrix, shape (4, 4), is a rotation and a translation."""
    R = matrix[:3, :3]
    upright = np.abs(R @ R.T - np.eye(3)).max() <= 1e-9 and np.linalg.det(R) >= 0.0
    return bool(upright and np.all(matrix[3] == (0.0, 0.0, 0.0, 1.0)))


def inverse(pose: np.ndarray) -> np.ndarray:
    """The inverse of a pose, shape (4, 4)."""
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result


def rotation_with_z_along(axis: np.ndarray) -> np.ndarray:
    """A rotation whose third column is this direction; made of zeros and ones where that is possible."""
    z = snapped(axis / np.linalg.norm(axis))
    if z[2] == 1.0:
        return np.eye(3)
    helper = np.eye(3)[np.argmin(np.abs(z))]
    x = helper - z * (z @ helper)
    x /= np.linalg.norm(x)
    return snapped(np.column_stack([x, np.cross(z, x), z]))


def snapped(values: np.ndarray) -> np.ndarray:
    """The same with rounding noise about 0, 1 and -1 removed, so that the compiler can fold these numbers."""
    result = np.array(values)
    for exact in (0.0, 1.0, -1.0):
        result[np.abs(result - exact) < _NOISE] = exact
    return result


def _rotation_of_rpy(roll: float, pitch: float, yaw: float) -> np.ndarray:
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _rotation_of_quaternion(quat_xyzw: np.ndarray) -> np.ndarray:
    x, y, z, w = quat_xyzw
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
