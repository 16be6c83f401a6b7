"""Inverse kinematics: the configuration nearest to one given in which links are where they are wanted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from articulated.dynamics.boundary import Argument, checked, find_link
from articulated.dynamics.functions import integrate, jacobian, link_poses
from articulated.rig import Rig
from articulated.rig.errors import did_you_mean

_SMALL = 1e-12


class Reached(NamedTuple):
    """What `reach` found.

    Attributes:
        q: configurations, shape (..., nq).
        distance: of the farthest link from its place, shape (...) [m].
        angle: likewise of orientations, shape (...) [rad]; 0 where none was wanted.
    """

    q: np.ndarray
    distance: np.ndarray
    angle: np.ndarray


def reach(
    rig: Rig,
    q: ArrayLike,
    targets: Mapping[str, ArrayLike],
    *,
    joints: Iterable[str] | None = None,
    damping: float = 1e-2,
    iterations: int = 100,
) -> Reached:
    """Bring links to places, by damped Gauss-Newton steps (Levenberg 1944); limits of single coordinates are kept.

        q = art.reach(rig, q, {"left_hand": (0.4, 0.2, 1.1), "head": pose}).q

    Args:
        rig: the rig.
        q: where to start, shape (..., nq).
        targets: for each link a point for its origin, shape (..., 3), or a pose, shape (..., 4, 4), in the world.
        joints: those that may move; None is all but the root's.
        damping: how much steps are held back where links hardly move [m or rad].
        iterations: at most.

    Returns:
        Configurations, and how far links still are from their places.

    Raises:
        ValueError: a link or joint is unknown, or an array does not fit.
    """
    q = np.asarray(checked(rig, Argument("q", q, (rig.nq,), role="q")), dtype=float)
    wanted = {find_link(rig, name).name: _target(name, given) for name, given in targets.items()}
    if not wanted:
        raise ValueError("targets names no link; expected one at least")
    batch = np.broadcast_shapes(q.shape[:-1], *(t.shape[: -2 if t.shape[-1] == 4 else -1] for t in wanted.values()))
    q = np.broadcast_to(q, (*batch, rig.nq)).copy()
    moves, held = _moving(rig, joints), np.full(batch, damping * damping)
    error = _errors(rig, q, wanted)
    for _ in range(iterations):
        J = np.concatenate([_rows(rig, q, name, t) for name, t in wanted.items()], axis=-2) * moves
        H = np.swapaxes(J, -1, -2) @ J + held[..., None, None] * np.eye(rig.nv)
        dv = np.linalg.solve(H, np.swapaxes(J, -1, -2) @ error[..., None])[..., 0] * moves
        tried = within_limits(rig, integrate(rig, q, dv))
        after = _errors(rig, tried, wanted)
        better = (after**2).sum(axis=-1) <= (error**2).sum(axis=-1)
        q, error = np.where(better[..., None], tried, q), np.where(better[..., None], after, error)
        held = np.clip(np.where(better, 0.3 * held, 10.0 * held), 1e-12, 1e6)
        if (np.abs(dv).max(axis=-1) < 1e-11).all() or (np.abs(error).max(axis=-1) < _SMALL).all():
            break
    distance, angle, at = np.zeros(batch), np.zeros(batch), 0
    for t in wanted.values():
        distance = np.maximum(distance, np.linalg.norm(error[..., at : at + 3], axis=-1))
        at += 3
        if t.shape[-1] == 4:
            angle = np.maximum(angle, np.linalg.norm(error[..., at : at + 3], axis=-1))
            at += 3
    return Reached(q, distance, angle)


def path_of(rig: Rig, link: str) -> list[str]:
    """The joints that move a link, but for the root's, root first."""
    names, at = [], rig.links[link].body
    by_body = {joint.body: joint for joint in rig.joints.values()}
    while at >= 0:
        if not rig.is_root(by_body[at]):
            names.append(by_body[at].name)
        at = rig.bodies[at].parent
    return names[::-1]


def _target(name: str, given: ArrayLike) -> np.ndarray:
    array = np.asarray(given, dtype=float)
    if array.ndim == 0 or (array.shape[-1] != 3 and array.shape[-2:] != (4, 4)) or not np.isfinite(array).all():
        raise ValueError(f"target of {name!r} has shape {array.shape}; expected a finite point (..., 3) or pose (..., 4, 4)")
    return array


def _moving(rig: Rig, joints: Iterable[str] | None) -> np.ndarray:
    moves = np.zeros(rig.nv)
    for name in [n for n, j in rig.joints.items() if not rig.is_root(j)] if joints is None else joints:
        if name not in rig.joints:
            raise ValueError(f"rig {rig.name!r} has no moving joint {name!r}{did_you_mean(name, rig.joints)}")
        moves[rig.joints[name].v_slice] = 1.0
    return moves


def _rows(rig: Rig, q: np.ndarray, name: str, target: np.ndarray) -> np.ndarray:
    J = jacobian(rig, q, name)
    return J if target.shape[-1] == 4 else J[..., :3, :]


def _errors(rig: Rig, q: np.ndarray, targets: Mapping[str, np.ndarray]) -> np.ndarray:
    X, parts = link_poses(rig, q), []
    for name, target in targets.items():
        here = X[..., rig.links[name].index, :, :]
        place = target[..., :3, 3] if target.shape[-1] == 4 else target
        parts.append(place - here[..., :3, 3])
        if target.shape[-1] == 4:
            turn = target[..., :3, :3] @ np.swapaxes(here[..., :3, :3], -1, -2)
            parts.append(Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(*turn.shape[:-2], 3))
    return np.concatenate([np.broadcast_to(part, (*q.shape[:-1], 3)) for part in parts], axis=-1)


def within_limits(rig: Rig, q: np.ndarray) -> np.ndarray:
    """Configurations with joints of one or two coordinates brought back within their limits, in place."""
    for joint in rig.joints.values():
        if not joint.mimic and joint.nq <= 2:
            q[..., joint.q_slice] = np.clip(q[..., joint.q_slice], joint.limits.lower, joint.limits.upper)
    return q
