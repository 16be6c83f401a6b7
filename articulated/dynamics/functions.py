"""The public functions of dynamics; a long file because it is a list.

All take arrays whose leading axes are a batch of states, shape (..., n), and broadcast these axes. They compute in float64,
or in float32 if every array that they are given is float32. Every one of them also takes:

    out: an array for the result, of its shape and type; it is returned.
    threads: how many threads may share a batch; None is as many as there are cores. Interpreted runs take one.

And every one raises ValueError if an array does not fit the rig, is not finite or does not broadcast, or if a quaternion in q
is not of unit length; and warns (RuntimeWarning) if a result is not finite.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from articulated.compiler import Program
from articulated.dynamics import configuration, energy, kinematics, passive
from articulated.dynamics import forward_dynamics as aba
from articulated.dynamics import inverse_dynamics as rnea
from articulated.dynamics import jacobian as point_jacobian
from articulated.dynamics import mass_matrix as crba
from articulated.dynamics import momentum as total_momentum
from articulated.dynamics.boundary import GRAVITY, Argument, find_link
from articulated.dynamics.calls import call, program
from articulated.dynamics.light import light_path
from articulated.dynamics.mechanism import Mechanism
from articulated.rig import Link, Rig
from articulated.scalar import Scalar


@light_path
def forward_dynamics(
    rig: Rig,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    external: ArrayLike | None = None,
    gravity: ArrayLike = GRAVITY,
    *,
    joint_forces: bool = False,
    out: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """Joint accelerations by the articulated-body algorithm. RBDA table 7.1, p. 132.

    Args:
        rig: the rig.
        q: configurations, shape (..., nq) [rad, m or unit quaternion xyzw].
        v: generalized velocities, shape (..., nv) [rad/s, m/s].
        tau: generalized forces, shape (..., nv) [N m, N].
        external: wrenches on links, (force, couple) in the world at the link origin, shape (..., nlinks, 6) [N, N m].
        gravity: acceleration of free fall, in the world, shape (..., 3) [m/s²].
        joint_forces: whether the joints' own damping and dry friction act too; see `passive_forces`.

    Returns:
        Generalized accelerations, shape (..., nv) [rad/s², m/s²].
    """
    arguments = [_q(rig, q), _v(rig, v), _v(rig, tau, "tau"), _external(rig, external), _gravity(gravity)]
    return call(rig, _forward_dynamics, arguments, (rig.nv,), out, threads, joint_forces=joint_forces)


@light_path
def inverse_dynamics(
    rig: Rig,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    external: ArrayLike | None = None,
    gravity: ArrayLike = GRAVITY,
    *,
    out: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """The generalized forces that give an acceleration, by the recursive Newton-Euler algorithm. RBDA table 5.1, p. 96.

    Args:
        rig, q, v, external, gravity: as in `forward_dynamics`.
        a: generalized accelerations, shape (..., nv) [rad/s², m/s²].

    Returns:
        Generalized forces, shape (..., nv) [N m, N]. Damping and dry friction are not among them.
    """
    arguments = [_q(rig, q), _v(rig, v), _v(rig, a, "a"), _external(rig, external), _gravity(gravity)]
    return call(rig, _inverse_dynamics, arguments, (rig.nv,), out, threads)


@light_path
def bias_forces(
    rig: Rig,
    q: ArrayLike,
    v: ArrayLike,
    external: ArrayLike | None = None,
    gravity: ArrayLike = GRAVITY,
    *,
    out: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """C in M a + C = τ: weight, Coriolis and centrifugal forces, less external ones. RBDA 3.3 and table 5.1 with a = 0.

    Args:
        rig, q, v, external, gravity: as in `forward_dynamics`.

    Returns:
        Generalized forces, shape (..., nv) [N m, N].
    """
    arguments = [_q(rig, q), _v(rig, v), _external(rig, external), _gravity(gravity)]
    return call(rig, _bias_forces, arguments, (rig.nv,), out, threads)


@light_path
def gravity_forces(
    rig: Rig,
    q: ArrayLike,
    gravity: ArrayLike = GRAVITY,
    *,
    out: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """The generalized forces that hold a rig still against its weight: the gradient of `potential_energy`.

    Args:
        rig, q, gravity: as in `forward_dynamics`.

    Returns:
        Generalized forces, shape (..., nv) [N m, N].
    """
    return call(rig, _gravity_forces, [_q(rig, q), _gravity(gravity)], (rig.nv,), out, threads)


@light_path
def mass_matrix(rig: Rig, q: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None) -> np.ndarray:
    """The mass matrix, armature included, by the composite-rigid-body algorithm. RBDA table 6.2, p. 108.

    Args:
        rig, q: as in `forward_dynamics`.

    Returns:
        Symmetric matrices, shape (..., nv, nv) [kg m², kg m, kg].
    """
    return call(rig, crba.mass_matrix, [_q(rig, q)], (rig.nv, rig.nv), out, threads)


@light_path
def link_poses(rig: Rig, q: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None) -> np.ndarray:
    """Where the links are: homogeneous matrices X_WL, link to world.

    Args:
        rig, q: as in `forward_dynamics`.

    Returns:
        Matrices, shape (..., nlinks, 4, 4) [translations in m]; `rig.links[name].index` is a link's place in them.
    """
    shape = (rig.nlinks, 4, 4)
    return call(rig, kinematics.link_poses, [_q(rig, q)], shape, out, threads)


@light_path
def link_velocities(
    rig: Rig, q: ArrayLike, v: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None
) -> np.ndarray:
    """How the links move: twists (linear, angular) in the world, the linear part at the link origin.

    Args:
        rig, q, v: as in `forward_dynamics`.

    Returns:
        Twists, shape (..., nlinks, 6) [m/s, rad/s].
    """
    return call(rig, kinematics.link_velocities, [_q(rig, q), _v(rig, v)], (rig.nlinks, 6), out, threads)


def jacobian(
    rig: Rig,
    q: ArrayLike,
    link: str | int | Link,
    point: ArrayLike | None = None,
    *,
    out: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """J, with J v the twist (linear, angular) in the world of a point of a link.

    Args:
        rig, q: as in `forward_dynamics`.
        link: the link, its name or its index.
        point: in the link's frame, shape (..., 3) [m]; None is its origin.

    Returns:
        Jacobians, shape (..., 6, nv) [m or 1, per coordinate].
    """
    arguments = [_q(rig, q), Argument("point", point, (3,), role="optional")]
    return call(rig, _jacobian, arguments, (6, rig.nv), out, threads, link=find_link(rig, link).index)


@light_path
def center_of_mass(rig: Rig, q: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None) -> np.ndarray:
    """The centre of mass of all that moves, in the world.

    Args:
        rig, q: as in `forward_dynamics`.

    Returns:
        Points, shape (..., 3) [m].

    Raises:
        ValueError: nothing moves; and as all functions here.
    """
    _needs_mass(rig)
    return call(rig, total_momentum.center_of_mass, [_q(rig, q)], (3,), out, threads)


@light_path
def momentum(rig: Rig, q: ArrayLike, v: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None) -> np.ndarray:
    """Linear momentum, then angular momentum about the centre of mass, of all that moves, in the world.

    Args:
        rig, q, v: as in `forward_dynamics`.

    Returns:
        Momenta, shape (..., 6) [N s, N m s].

    Raises:
        ValueError: nothing moves; and as all functions here.
    """
    _needs_mass(rig)
    return call(rig, total_momentum.momentum, [_q(rig, q), _v(rig, v)], (6,), out, threads)


@light_path
def kinetic_energy(
    rig: Rig, q: ArrayLike, v: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None
) -> np.ndarray:
    """½ vᵀ M v, armature included.

    Args:
        rig, q, v: as in `forward_dynamics`.

    Returns:
        Energies, shape (...) [J].
    """
    return call(rig, energy.kinetic_energy, [_q(rig, q), _v(rig, v)], (), out, threads)


@light_path
def potential_energy(
    rig: Rig,
    q: ArrayLike,
    gravity: ArrayLike = GRAVITY,
    *,
    out: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """The energy of weight, zero where all that moves is at the world's origin.

    Args:
        rig, q, gravity: as in `forward_dynamics`.

    Returns:
        Energies, shape (...) [J].
    """
    return call(rig, energy.potential_energy, [_q(rig, q), _gravity(gravity)], (), out, threads)


@light_path
def integrate(
    rig: Rig, q: ArrayLike, dv: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None
) -> np.ndarray:
    """q ⊕ dv: where a rig is after unit time at a constant generalized velocity, by the exponential map of each joint.

    Args:
        rig, q: as in `forward_dynamics`.
        dv: generalized velocity times time, shape (..., nv) [rad, m].

    Returns:
        Configurations, shape (..., nq).
    """
    return call(rig, configuration.integrate, [_q(rig, q), _v(rig, dv, "dv")], (rig.nq,), out, threads)


@light_path
def difference(
    rig: Rig, q0: ArrayLike, q1: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None
) -> np.ndarray:
    """The smallest dv with q0 ⊕ dv = q1, by the logarithm of each joint; the inverse of `integrate`.

    Angles are unwrapped and differ by what they differ, which may be more than a turn; orientations differ by π at most.

    Args:
        rig: the rig.
        q0, q1: configurations, shape (..., nq) [rad, m or unit quaternion xyzw].

    Returns:
        Differences, shape (..., nv) [rad, m].
    """
    return call(rig, configuration.difference, [_q(rig, q0, "q0"), _q(rig, q1, "q1")], (rig.nv,), out, threads)


@light_path
def passive_forces(rig: Rig, v: ArrayLike, *, out: np.ndarray | None = None, threads: int | None = None) -> np.ndarray:
    """The forces that the joints' own damping and dry friction exert: −damping v − friction v / √(v² + ε²).

    Dry friction is smoothed about ε = 0.01 rad/s or m/s.

    Args:
        rig, v: as in `forward_dynamics`.

    Returns:
        Generalized forces, shape (..., nv) [N m, N].
    """
    return call(rig, passive.passive_forces, [_v(rig, v)], (rig.nv,), out, threads)


def point_wrench(
    rig: Rig,
    q: ArrayLike,
    link: str | int | Link,
    force: ArrayLike,
    point: ArrayLike | None = None,
    couple: ArrayLike = (0.0, 0.0, 0.0),
    *,
    out: np.ndarray | None = None,
    threads: int | None = None,
) -> np.ndarray:
    """A force at any point of any link, as the `external` of other functions; add several to have them act together.

    Args:
        rig, q: as in `forward_dynamics`.
        link: the link, its name or its index.
        force: in the world, shape (..., 3) [N].
        point: where it acts, in the link's frame, shape (..., 3) [m]; None is its origin.
        couple: beside it, in the world, shape (..., 3) [N m].

    Returns:
        Wrenches (force, couple) in the world at the link origins, shape (..., nlinks, 6), zero but for this link's.
    """
    vectors = [
        Argument("force", force, (3,)),
        Argument("point", point, (3,), role="optional"),
        Argument("couple", couple, (3,)),
    ]
    arguments = [_q(rig, q), *vectors]
    return call(rig, kinematics.point_wrench, arguments, (rig.nlinks, 6), out, threads, link=find_link(rig, link).index)


def programs(rig: Rig, gravity: Sequence[float] = GRAVITY) -> dict[str, Program]:
    """What each function compiles to for one state, with nothing but its required arguments."""
    q, v, tau, a, dv = (Argument(name, (), shape) for name, shape in _shapes(rig).items())
    q0, q1 = q._replace(name="q0"), q._replace(name="q1")
    none = Argument("external", None, ())
    fall = Argument("gravity", gravity, (3,), role="constant")
    nq, nv, n = (rig.nq,), (rig.nv,), rig.nlinks
    table = [
        program(rig, _forward_dynamics, [q, v, tau, none, fall], nv, joint_forces=False),
        program(rig, _inverse_dynamics, [q, v, a, none, fall], nv),
        program(rig, _bias_forces, [q, v, none, fall], nv),
        program(rig, _gravity_forces, [q, fall], nv),
        program(rig, crba.mass_matrix, [q], nv + nv),
        program(rig, kinematics.link_poses, [q], (n, 4, 4)),
        program(rig, kinematics.link_velocities, [q, v], (n, 6)),
        program(rig, energy.kinetic_energy, [q, v], ()),
        program(rig, energy.potential_energy, [q, fall], ()),
        program(rig, configuration.integrate, [q, dv], nq),
        program(rig, configuration.difference, [q0, q1], nv),
        program(rig, passive.passive_forces, [v], nv),
    ]
    if rig.mass > 0.0:
        table.append(program(rig, total_momentum.center_of_mass, [q], (3,)))
        table.append(program(rig, total_momentum.momentum, [q, v], (6,)))
    return {one.name: one for one in table}


def _shapes(rig: Rig) -> dict[str, tuple[int, ...]]:
    return {"q": (rig.nq,), **dict.fromkeys(("v", "tau", "a", "dv"), (rig.nv,))}


def _forward_dynamics(m: Mechanism, q, v, tau, external, gravity, joint_forces: bool) -> list[Scalar]:
    if joint_forces:
        tau = [a + b for a, b in zip(tau, passive.passive_forces(m, v), strict=True)]
    return aba.forward_dynamics(m, q, v, tau, gravity, external)


def _inverse_dynamics(m: Mechanism, q, v, a, external, gravity) -> list[Scalar]:
    return rnea.inverse_dynamics(m, q, v, a, gravity, external)


def _bias_forces(m: Mechanism, q, v, external, gravity) -> list[Scalar]:
    return rnea.inverse_dynamics(m, q, v, None, gravity, external)


def _gravity_forces(m: Mechanism, q, gravity) -> list[Scalar]:
    return rnea.inverse_dynamics(m, q, None, None, gravity)


def _jacobian(m: Mechanism, q, point, link: int) -> list[list[Scalar]]:
    return point_jacobian.jacobian(m, q, link, point if point is not None else (0.0, 0.0, 0.0))


def _q(rig: Rig, value: ArrayLike, name: str = "q") -> Argument:
    return Argument(name, value, (rig.nq,), role="q")


def _v(rig: Rig, value: ArrayLike, name: str = "v") -> Argument:
    return Argument(name, value, (rig.nv,))


def _external(rig: Rig, value: ArrayLike | None) -> Argument:
    return Argument("external", value, (rig.nlinks, 6), role="optional")


def _gravity(value: ArrayLike | Sequence[float]) -> Argument:
    return Argument("gravity", value, (3,), role="gravity")


def _needs_mass(rig: Rig) -> None:
    if not rig.mass > 0.0:
        raise ValueError(f"nothing of rig {rig.name!r} moves, so it has no centre of mass; load it with root='free'")
