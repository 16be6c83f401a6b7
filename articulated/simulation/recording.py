"""From frames to a trajectory."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from articulated.dynamics.functions import kinetic_energy, potential_energy
from articulated.dynamics.loops.functions import gaps
from articulated.rig.errors import RigWarning
from articulated.simulation.contact.sensing import contact_geometry, contact_links, contact_others
from articulated.simulation.implicit.energy import solved_kinetic_energy
from articulated.simulation.rollout import Rollout
from articulated.trajectory import Cloud, Outcome, Trajectory

_OVERLAP = 2e-3
"""What starts so deep in something else is told [m]."""
_LARGEST = 1e15
"""A state with larger numbers than this has diverged: an angle has no sine any more that means anything."""


def trajectory_of(
    rollout: Rollout, arrays: Sequence[np.ndarray], tau: np.ndarray, fps: float, particles: np.ndarray | None = None
) -> Trajectory:
    """The trajectory of a rollout that has ended.

    Args:
        rollout: which.
        arrays: what was recorded, as it lists.
        tau: generalized forces of the control, shape (..., T, nv).
        fps: frames a second.
        particles: x, then v of those that the rig carries, shape (..., T, n, 6).
    """
    world, rig = rollout.world, rollout.rig
    q, v, work = (array.astype(float, copy=False) for array in arrays[:3])
    # a state that overflowed, or whose energy would, has none; this is said once, below
    with np.errstate(invalid="ignore"):
        finite = np.asarray((np.abs(q) < _LARGEST).all(axis=-1) & (np.abs(v) < _LARGEST).all(axis=-1))
    sound_q = np.where(finite[..., None], q, rig.neutral())
    sound_v = np.where(finite[..., None], v, 0.0)
    shown = dict(zip(rollout.shown, arrays[3:], strict=True))
    if "before" in shown and rig.nv:
        solved_v = sound_v + np.where(finite[..., None], shown.get("carry", 0.0), 0.0)
        kinetic = solved_kinetic_energy(rig, sound_q, solved_v, shown["before"][..., 0].astype(float, copy=False))
    else:
        kinetic = kinetic_energy(rig, sound_q, sound_v)
    kinetic = np.where(finite, kinetic, np.nan)
    potential = np.where(finite, potential_energy(rig, sound_q, world.gravity), np.nan)
    outcome = np.where(finite.all(axis=-1), np.int8(Outcome.COMPLETED), np.int8(Outcome.DIVERGED))
    times = rollout.plan.times
    if (reached := rollout.reached()) is not None:
        t, failed = reached
        stopped = np.where(failed, np.int8(Outcome.STEP_TOO_SMALL), np.int8(Outcome.STEP_LIMIT))
        outcome = np.where(t >= times.end, outcome, stopped)
    settings: dict[str, str | float | int] = {"integrator": world.integrator, "dt": times.h, "substeps": rollout.plan.substeps}
    if world.integrator == "dopri5":
        settings |= {"rtol": times.rtol, "atol": times.atol}
    scene = world.scene
    geometry = contact_geometry(scene, sound_q)
    shapes = (("contact_forces", scene.touches), ("pair_forces", len(scene.pairs)))
    pushes = [shown.get(name, np.zeros((*q.shape[:-1], 3 * n))).reshape(*q.shape[:-1], n, 3) for name, n in shapes]
    if rollout.solves:
        settings["tolerance"] = float(world.numbers[..., -1].min())
    if (efforts := shown.get("efforts")) is not None and scene.drives is not None:
        tau = tau.copy()
        tau[..., list(scene.drives.coordinates)] = efforts
    trajectory = Trajectory(
        rig=rig,
        time=np.arange(q.shape[-2]) / fps,
        q=q,
        v=v,
        tau=tau,
        kinetic_energy=kinetic,
        potential_energy=potential,
        work=work,
        outcome=np.asarray(outcome),
        settings=settings,
        contact_links=contact_links(scene),
        contact_others=contact_others(scene),
        contact_points=geometry[..., :3],
        contact_normals=geometry[..., 3:6],
        contact_gaps=geometry[..., 6],
        contact_forces=np.concatenate(pushes, axis=-2).astype(float, copy=False),
        loop_rows=tuple(scene.rows),
        loop_gaps=gaps(rig, (*scene.loops, *scene.ropes), sound_q, None),
        loop_forces=shown.get("loop_forces", np.zeros((*q.shape[:-1], 0))).astype(float, copy=False),
        residual=rollout.residual(),
        particles=_cloud(rollout, particles, fps),
    )
    _warn_of_overlaps(trajectory)
    for outcome, count in trajectory.report.outcomes.items():
        if outcome is not Outcome.COMPLETED:
            text = f"{count} of {trajectory.outcome.size} states of rig {rig.name!r}: {outcome.label}; {outcome.remedy}"
            warnings.warn(text, RuntimeWarning, stacklevel=4)
    return trajectory


def _cloud(rollout: Rollout, particles: np.ndarray | None, fps: float) -> Cloud | None:
    freight = rollout.world.freight
    if freight is None or particles is None:
        return None
    x, v, time = particles[..., :3].copy(), particles[..., 3:].copy(), np.arange(particles.shape[-3]) / fps
    return Cloud(time, x, v, freight.energy(time, x, v), freight.segments, freight.triangles)


def _warn_of_overlaps(run: Trajectory) -> None:
    """Tell which bodies start in each other."""
    first = np.where([bool(name) for name in run.contact_others], run.contact_gaps[..., 0, :], np.inf)
    deep = first < -_OVERLAP
    if deep.any():
        worst = np.unravel_index(int(np.argmin(first)), first.shape)
        names = f"{run.contact_links[worst[-1]]!r} and {run.contact_others[worst[-1]]!r}"
        text = (
            f"{int(deep.any(axis=-1).sum())} of {run.outcome.size} states of rig {run.rig.name!r} start with bodies in each"
            f" other, {names} by {-1e3 * first[worst]:.3g} mm; they are pushed apart slowly: move them, or exclude the pair"
        )
        warnings.warn(text, RigWarning, stacklevel=5)
