"""The public functions of rigs with closed loops. All take batches and `threads` as those in `dynamics.functions` do.

`loops` are `Loop`s, or None for those that the rig came with.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from articulated.dynamics.boundary import GRAVITY, Argument
from articulated.dynamics.calls import call
from articulated.dynamics.functions import inverse_dynamics
from articulated.dynamics.loops.closure import Closure, closures, sizes
from articulated.dynamics.loops.constrained import closed_state, constrained, jacobian_rows, rows_at, speeds, tied
from articulated.dynamics.mechanism import Mechanism
from articulated.rig import Rig
from articulated.rig.loop import Loop
from articulated.scalar import Scalar

Loops = Sequence[Loop] | None


def constrained_dynamics(
    rig: Rig,
    loops: Loops,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    external: ArrayLike | None = None,
    gravity: ArrayLike = GRAVITY,
    *,
    threads: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Joint accelerations of a rig with closed loops, and the loops' forces. RBDA ch. 8.

    Loops that repeat each other or are singular have forces all the same: the smallest that do it. Ones that contradict each
    other get accelerations as near to closed as can be, and huge forces.

    Args:
        rig, q, v, tau, external, gravity: as in `forward_dynamics`; the state should be closed, see `assemble`.
        loops: what closes the rig; None for its own. Not ropes, which are one-sided: simulate these.

    Returns:
        Generalized accelerations, shape (..., nv) [rad/s², m/s²], and a force for each row of each loop, shape (..., m)
        [N, N m]: on B's link, and its opposite on A's, along what `Loop.rows` names.

    Raises:
        ValueError: a loop does not fit the rig or is a rope; and as `forward_dynamics`.
    """
    some = two_sided(rig, loops)
    arguments = [*_state(rig, q, v), Argument("tau", tau, (rig.nv,))]
    arguments += [Argument("external", external, (rig.nlinks, 6), role="optional")]
    arguments += [Argument("gravity", gravity, (3,), role="gravity")]
    both = call(rig, _constrained_dynamics, arguments, (rig.nv + _rows(some),), None, threads, closures=some)
    return both[..., : rig.nv], both[..., rig.nv :]


def loop_gaps(rig: Rig, loops: Loops, q: ArrayLike, *, threads: int | None = None) -> np.ndarray:
    """How far each row of each loop is from closed; of a rope, how much it is too long, negative where slack.

    Args:
        rig, q: as in `forward_dynamics`.
        loops: which; None for the rig's own.

    Returns:
        Gaps, shape (..., m) [m, or 1 where directions of A and B are to be at right angles: about rad]; see `Loop.rows`.
    """
    return gaps(rig, closures(rig, own_loops(rig, loops)), q, threads)


def loop_jacobian(rig: Rig, loops: Loops, q: ArrayLike, *, threads: int | None = None) -> np.ndarray:
    """J, with J v the rate of `loop_gaps`, and Jᵀ f the generalized forces of loop forces f.

    Args:
        rig, q: as in `forward_dynamics`.
        loops: which; None for the rig's own.

    Returns:
        Jacobians, shape (..., m, nv).
    """
    return jacobians(rig, closures(rig, own_loops(rig, loops)), q, threads)


def project_velocity(rig: Rig, loops: Loops, q: ArrayLike, v: ArrayLike, *, threads: int | None = None) -> np.ndarray:
    """The velocity nearest to v, by kinetic energy, that keeps loops closed: what v becomes if they snap shut.

    Args:
        rig, q, v: as in `forward_dynamics`.
        loops: as in `constrained_dynamics`.

    Returns:
        Generalized velocities, shape (..., nv) [rad/s, m/s].
    """
    some = two_sided(rig, loops)
    return call(rig, _project_velocity, _state(rig, q, v), (rig.nv,), None, threads, closures=some)


def constrained_inverse_dynamics(
    rig: Rig,
    loops: Loops,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    actuated: Sequence[str] | None = None,
    external: ArrayLike | None = None,
    gravity: ArrayLike = GRAVITY,
    *,
    threads: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The least actuator forces that give a looped rig an acceleration, and the loops' forces: τ + Jᵀ f = M a + C.

    Where there are more actuators and loops than it takes, τ is the smallest that does it, then f.

    Args:
        rig, q, v, external, gravity: as in `inverse_dynamics`.
        loops: as in `constrained_dynamics`.
        a: generalized accelerations that keep the loops closed, shape (..., nv) [rad/s², m/s²].
        actuated: names of the joints that have actuators; None is all but a free or planar root's.

    Returns:
        Generalized forces, shape (..., nv) [N m, N], zero where nothing is actuated, and loop forces, shape (..., m) [N, N m].

    Raises:
        ValueError: a joint is unknown or follows another; and as `constrained_dynamics`.

    Warns:
        RuntimeWarning: these joints and loops cannot give the acceleration; what is returned comes nearest.
    """
    some = two_sided(rig, loops)
    driven = _driven(rig, actuated)
    needed = inverse_dynamics(rig, q, v, a, external, gravity, threads=threads).astype(float)
    J = np.broadcast_to(jacobians(rig, some, q, threads), (*needed.shape[:-1], _rows(some), rig.nv)).astype(float)
    held, pushed = np.swapaxes(J[..., :, ~driven], -1, -2), np.swapaxes(J[..., :, driven], -1, -2)
    # passive coordinates want held f = needed; what that leaves open of f goes to make τ small
    small = 1e-9 * np.abs(J).max(initial=1e-30)
    back = _inverse(held, small)
    free = np.eye(held.shape[-1]) - back @ held
    f = np.einsum("...ij,...j->...i", back, needed[..., ~driven])
    left = needed[..., driven] - np.einsum("...ij,...j->...i", pushed, f)
    f = f + np.einsum("...ij,...j->...i", free @ _inverse(pushed @ free, small), left)
    tau = np.zeros_like(needed)
    tau[..., driven] = needed[..., driven] - np.einsum("...ij,...j->...i", pushed, f)
    short = np.abs(needed - tau - np.einsum("...ji,...j->...i", J, f)).max(initial=0.0)
    if short > 1e-6 * (1.0 + np.abs(needed).max(initial=0.0)):
        warnings.warn(
            f"rig {rig.name!r}: the actuated joints and the loops cannot give this acceleration: {short:.3g} N m or N are"
            " missing; actuate more joints, or give an acceleration that the loops allow",
            RuntimeWarning,
            stacklevel=2,
        )
    return tau, f


def closed(rig: Rig, some: tuple[Closure, ...], q: np.ndarray, v: np.ndarray, threads: int | None) -> np.ndarray:
    """The nearest closed states, shape (..., nq + nv); see `constrained.closed_state`."""
    return call(rig, _closed, _state(rig, q, v), (rig.nq + rig.nv,), None, threads, closures=some)


def gaps(rig: Rig, some: tuple[Closure, ...], q: ArrayLike, threads: int | None) -> np.ndarray:
    """As `loop_gaps`."""
    return call(rig, _loop_gaps, [_q(rig, q)], (_rows(some),), None, threads, closures=some)


def jacobians(rig: Rig, some: tuple[Closure, ...], q: ArrayLike, threads: int | None) -> np.ndarray:
    """As `loop_jacobian`."""
    return call(rig, _loop_jacobian, [_q(rig, q)], (_rows(some), rig.nv), None, threads, closures=some)


def _inverse(A: np.ndarray, small: float) -> np.ndarray:
    """A⁺, singular values that are small counted as 0."""
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    inverse = np.where(sigma > small, 1.0 / np.maximum(sigma, small), 0.0)
    return np.swapaxes(Vt, -1, -2) @ (inverse[..., None] * np.swapaxes(U, -1, -2))


def two_sided(rig: Rig, loops: Loops) -> tuple[Closure, ...]:
    """Loops for functions that know equations only.

    Raises:
        ValueError: one does not fit the rig, or is a rope.
    """
    some = closures(rig, own_loops(rig, loops))
    for closure in some:
        if closure.one_sided:
            raise ValueError(
                f"loop {closure.name!r} is a rope, which only ever pulls; simulate it, or give it rope=False to have a rod"
            )
    return some


def own_loops(rig: Rig, loops: Loops) -> Sequence[Loop]:
    """Those given, or the rig's own."""
    if loops is None:
        return rig.loops
    if isinstance(loops, Loop):
        raise ValueError(f"loops is {loops}; expected a list of loops: [{loops.name!r}]")
    return loops


def _driven(rig: Rig, actuated: Sequence[str] | None) -> np.ndarray:
    driven = np.zeros(rig.nv, dtype=bool)
    if actuated is None:
        actuated = [j.name for j in rig.joints.values() if not (j.mimic or rig.is_root(j))]
    for name in [actuated] if isinstance(actuated, str) else actuated:
        if (joint := rig.joints.get(name)) is None:
            raise ValueError(f"actuated: rig {rig.name!r} has no moving joint {name!r}")
        if joint.mimic:
            raise ValueError(f"actuated: joint {name!r} follows {joint.mimic.joint!r}; actuate that one")
        driven[joint.v_slice] = True
    return driven


def _rows(some: Sequence[Closure]) -> int:
    return sum(sizes(some))


def _q(rig: Rig, q: ArrayLike) -> Argument:
    return Argument("q", q, (rig.nq,), role="q")


def _state(rig: Rig, q: ArrayLike, v: ArrayLike) -> list[Argument]:
    return [_q(rig, q), Argument("v", v, (rig.nv,))]


def _constrained_dynamics(m: Mechanism, q, v, tau, external, gravity, closures: Sequence[Closure]) -> list[Scalar]:
    result = constrained(m, closures, q, v, tau, gravity, external)
    return [*result.a, *result.forces]


def _loop_gaps(m: Mechanism, q, closures: Sequence[Closure]) -> list[Scalar]:
    return [line.gap for line in rows_at(m, closures, q)[1]]


def _loop_jacobian(m: Mechanism, q, closures: Sequence[Closure]) -> list[list[Scalar]]:
    return jacobian_rows(*rows_at(m, closures, q))


def _closed(m: Mechanism, q, v, closures: Sequence[Closure]) -> list[Scalar]:
    q, v = closed_state(m, closures, q, v)
    return [*q, *v]


def _project_velocity(m: Mechanism, q, v, closures: Sequence[Closure]) -> list[Scalar]:
    now, rows = rows_at(m, closures, q)
    dv = tied(now, rows, closures).corrected([-x for x in speeds(now, rows, v)], corrections=2)
    return [a + b for a, b in zip(v, now.out_of_world(dv), strict=True)]
