"""The Jacobian of a point of a link, RBDA 4.5 (there, of a body): one column for each coordinate on the way to the root."""

from __future__ import annotations

from collections.abc import Sequence

from articulated.dynamics.kinematics import placements, subspaces, world_poses
from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.scalar import Scalar
from articulated.spatial import Vec3


def jacobian(mechanism: Mechanism, q: Sequence[Scalar], link: int, point: Sequence[Scalar]) -> list[list[Scalar]]:
    """J, six rows (linear, angular) in the world: the velocity of `point`, given in the link's frame, is J v."""
    rows: list[list[Scalar]] = [[0.0] * mechanism.nv for _ in range(6)]
    body, X_BL = mechanism.links[link]
    if body == WORLD:
        return rows
    X_W, S = world_poses(mechanism, placements(mechanism, q)), subspaces(mechanism, q)
    p_W = X_W[body].transform_point(X_BL.transform_point(Vec3.of(point)))
    for i in mechanism.support(body):
        arm = X_W[i].R.transpose_times(p_W - X_W[i].p)
        for column, s in zip(S[i], mechanism.joints[i].v, strict=True):
            linear = X_W[i].R @ (column.linear + column.angular.cross(arm))
            angular = X_W[i].R @ column.angular
            for row, x in zip(rows, [*linear, *angular], strict=True):
                row[s] = row[s] + x
    return rows
