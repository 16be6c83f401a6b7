"""Random falls by the thousand: nothing diverges, nothing gains energy, all comes to rest and stays there.

FALLS=4096 pytest tests/simulation/test_falls.py runs as many of each rig (default 64).
"""

from __future__ import annotations

import dataclasses
import os

import numpy as np
import pytest
from contact_rigs import rig_of
from pair_rigs import crumpled, put, within_limits

import articulated as art

COUNT = int(os.environ.get("FALLS", "64"))


def points(rig: art.Rig) -> list[art.ContactPoint]:
    """At the ends of links: where their joints and those of their children are, and beyond the last."""
    result = []
    for link in rig.links.values():
        if link.body < 0 or link.mass == 0.0:
            continue
        ends = [joint.pose[:3, 3] for joint in rig.joints.values() if joint.parent == link.name]
        ends = ends or [2.0 * link.center if np.linalg.norm(link.center) > 0.01 else np.array([0.0, 0.0, -0.03])]
        mean = np.mean(ends, axis=0)
        result.append(art.ContactPoint(link.name, tuple(mean.tolist()), 0.01))
    most = 24
    if len(result) > most:
        result = [result[k] for k in np.linspace(0, len(result) - 1, most).astype(int)]
    root = next(iter(rig.links.values())).name
    box = [art.ContactPoint(root, (x, y, z), 0.0) for x in (-0.08, 0.08) for y in (-0.08, 0.08) for z in (-0.05, 0.05)]
    return result + box


def falling(rig: art.Rig, contact_points, count: int, rng) -> tuple[np.ndarray, np.ndarray]:
    q = rig.random(rng, count)
    X = art.link_poses(rig, q)
    z = np.array([(X[:, rig.links[p.link].index] @ [*p.position, 1.0])[:, 2] - p.radius for p in contact_points])
    q[:, 2] += rng.uniform(0.02, 0.5, count) - z.min(axis=0)
    v = rng.normal(size=(count, rig.nv))
    v[:, 3:6] *= 2.0
    v[:, 6:] *= min(1.0, 10.0 / rig.nv)  # what hangs at the end of thirty links does not spin faster than that of three
    return q, v


@pytest.mark.sweep
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("dt", [0.002, 0.004])
@pytest.mark.parametrize("name", ["g1", "solo12", "human", "chain"])
def test_falls(name, dt):
    damping, friction = {"g1": (1.0, 4.0), "solo12": (0.02, 0.05), "human": (1.0, 4.0), "chain": (0.02, 0.01)}[name]
    rig = rig_of(name).with_joints(damping=damping, friction=friction)
    rng = np.random.default_rng(0)
    contact_points = points(rig)
    simulation = art.Simulation(rig, dt=dt, ground=art.Ground(friction=0.8), contact_points=contact_points)
    q, v = falling(rig, contact_points, COUNT, rng)
    run = simulation.run(q, v, 5.0, 50)
    assert (run.outcome == art.Outcome.COMPLETED).all()
    rise = (run.energy - np.minimum.accumulate(run.energy, axis=1)).max(axis=1)
    lost = run.energy[:, 0] - run.energy.min(axis=1)
    speed = np.abs(run.v[:, -5:]).max(axis=(1, 2))
    deepest = -run.contact_gaps[:, -5:].min(axis=(1, 2))
    print(
        f"{name} dt {dt}: rise {(rise / lost).max():.2%} of what was lost, rest within {speed.max():.1e} ({np.mean(speed < 1e-3):.2%} below 1 mm/s),"
        f" penetration {deepest.max() * 1e3:.2f} mm, residual {run.residual.max():.1e}"
    )
    assert (
        np.mean(run.residual < 1e-4) > 0.999
    )  # every step of a fall is solved; of a thousand falls, one in some may end close
    assert run.residual.max() < 1e-3
    assert (rise < 0.01 * lost).all()
    assert deepest.max() < 1e-3
    assert np.quantile(speed, 0.95) < 1e-3
    # the rest is still on its way down: it topples, or rocks
    end = dataclasses.replace(simulation, substeps=round(20.0 / dt)).step(simulation.reset(q, v))
    assert np.mean(np.abs(end.v).max(axis=1) < 1e-3) > 0.999


@pytest.mark.sweep
@pytest.mark.timeout(1200)
def test_ragdolls_crumple_on_themselves():
    """Nothing passes through anything, at up to ten metres a second and more: all pairs that can touch, limits, ground."""
    rng, rests, deepest, rises = np.random.default_rng(0), [], [], []
    rig, _ = crumpled(rng, 1)
    simulation = art.Simulation(rig, ground=True, collisions=True)
    for first in range(0, COUNT, 64):
        q = np.concatenate([apart(simulation, within_limits(rig, crumpled(rng, 128)[1]), rng) for _ in range(4)])
        q = q[: min(64, COUNT - first)]
        v = rng.normal(size=(len(q), rig.nv))
        v[:, 3:6] *= 2.0
        run = simulation.run(q, v, 5.0, 100)
        assert (run.outcome == art.Outcome.COMPLETED).all()
        between = np.array([other != "" for other in run.contact_others])
        depth = -run.contact_gaps[..., between].min(axis=-1)
        deepest += depth.max(axis=1).tolist()
        rests += depth[:, -20:].max(axis=1).tolist()
        rise = (run.energy - np.minimum.accumulate(run.energy, axis=1)).max(axis=1)
        rises += (rise / (run.energy[:, 0] - run.energy.min(axis=1))).tolist()
    print(f"deepest {max(deepest) * 1e3:.1f} mm, at rest {max(rests) * 1e3:.2f} mm, rise {max(rises):.2e} of what was lost")
    assert len(deepest) == COUNT
    assert max(deepest) < 0.02
    assert max(rests) < 0.005
    assert max(rises) < 2e-3


def apart(simulation, q, rng):
    """Those of some configurations in which nothing is in anything, above the ground."""
    put(simulation.rig, q, 0, (0.0, 0.0, 0.0))
    contacts = simulation.contacts(simulation.reset(q))
    gaps, between = np.array(contacts.gaps), np.array([other != "" for other in contacts.others])
    q[:, 2] += rng.uniform(0.02, 0.5, len(q)) - gaps[:, ~between].min(axis=1)
    return q[gaps[:, between].min(axis=1) > -1e-3]
