"""Gains from how quick and how damped a joint is to be."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from articulated.characters.reaching import path_of
from articulated.dynamics.boundary import find_link
from articulated.dynamics.functions import jacobian, link_poses, mass_matrix
from articulated.rig import Rig
from articulated.rig.errors import did_you_mean
from articulated.simulation import PD, RootHelp


def tuned(
    rig: Rig,
    frequency: float | Mapping[str, float],
    damping_ratio: float | Mapping[str, float] = 1.0,
    *,
    limit: float | Mapping[str, float] | ArrayLike | str = math.inf,
    feet: Sequence[str] = (),
    help: float | None = None,
    help_limit: tuple[float, float] = (math.inf, math.inf),
) -> PD:
    """Drives that answer like oscillators of a frequency: p = (2πf)² I, d = 2ζ (2πf) I.

        drives = art.tuned(rig, frequency=6.0, damping_ratio=1.0, limit="effort")

    I is what a joint moves, all beyond it rigid, where the rig is neutral: the diagonal of the mass matrix; of a ball joint the
    mean of its three. A joint between the root and a foot moves all that the foot carries, if that is more.

    Args:
        rig: the rig.
        frequency: f [Hz], for all joints but the root's, or by joint, the others having no drive.
        damping_ratio: ζ, likewise: 1 is critical; a joint that is not named has 1.
        limit: largest torques; see `PD`.
        feet: links that carry the rig, each its share.
        help: frequency of a helping hand at a free or planar root [Hz]; None for none.
        help_limit: its largest force and couple [N, N m].

    Raises:
        ValueError: a number is negative or not finite, a joint is unknown, or there is no root to help.
    """
    f, zeta = _by_joint(rig, "frequency", frequency, 0.0), _by_joint(rig, "damping_ratio", damping_ratio, 1.0)
    I = felt_inertia(rig, feet)
    omega = 2.0 * np.pi * f
    hand = None
    if help is not None:
        rate, ratio = 2.0 * math.pi * _number("help", help), 1.0
        roots = [joint for joint in rig.joints.values() if rig.is_root(joint)]
        if not roots:
            raise ValueError(f"rig {rig.name!r} has no free or planar root to be helped; leave help out, or load it with one")
        own = I[roots[0].v_slice]
        pair = float(own[0]), float(own[-1])
        stiffness, damping = (tuple(k * x for x in pair) for k in (rate * rate, 2.0 * ratio * rate))
        hand = RootHelp(stiffness, damping, help_limit)  # type: ignore[arg-type]
    return PD(omega * omega * I, 2.0 * zeta * omega * I, limit, hand)


def felt_inertia(rig: Rig, feet: Sequence[str] = ()) -> np.ndarray:
    """What each coordinate moves where the rig is neutral, the same in all directions of a joint, shape (nv,) [kg m² or kg]."""
    I = np.diag(mass_matrix(rig, rig.neutral())).copy()
    if feet:
        carried = _inertia_of_all(rig) - (I - rig.armature)
        for foot in feet:
            for name in path_of(rig, find_link(rig, foot).name):
                part = rig.joints[name].v_slice
                I[part] = np.maximum(I[part], carried[part] / len(feet))
    for joint in rig.joints.values():
        start, stop = joint.v_slice.start, joint.v_slice.stop
        split = {"ball": [(start, stop)], "floating": [(start, start + 3), (start + 3, stop)], "planar": [(start, start + 2)]}
        for first, last in [] if joint.mimic else split.get(joint.kind, []):
            I[first:last] = I[first:last].mean()
    return I


def _inertia_of_all(rig: Rig) -> np.ndarray:
    """Of the whole rig along each coordinate, were it one body that turned, or slid, with that coordinate, shape (nv,)."""
    q = rig.neutral()
    X = link_poses(rig, q)
    total = np.zeros(rig.nv)
    for joint in rig.joints.values():
        if joint.mimic:
            continue
        J = jacobian(rig, q, joint.child)[:, joint.v_slice]
        origin = X[rig.links[joint.child].index, :3, 3]
        for link in rig.links.values():
            R = X[link.index, :3, :3]
            lever = R @ link.center + X[link.index, :3, 3] - origin
            speed, spin = J[:3] + np.cross(J[3:].T, lever).T, R.T @ J[3:]
            total[joint.v_slice] += link.mass * (speed**2).sum(axis=0) + np.einsum("ik,ij,jk->k", spin, link.inertia, spin)
    return total


def _by_joint(rig: Rig, name: str, given: Any, default: float) -> np.ndarray:
    values = np.full(rig.nv, default)
    if not isinstance(given, Mapping):
        given = {joint.name: given for joint in rig.joints.values() if not joint.mimic and not rig.is_root(joint)}
    for joint, value in given.items():
        if joint not in rig.joints:
            raise ValueError(f"{name}: rig {rig.name!r} has no moving joint {joint!r}{did_you_mean(joint, rig.joints)}")
        values[rig.joints[joint].v_slice] = _number(name, value)
    return values


def _number(name: str, value: Any) -> float:
    if not isinstance(value, (int, float, np.number)) or not 0.0 <= value < math.inf:
        raise ValueError(f"{name} is {value!r}; expected a finite number, zero or more")
    return float(value)
