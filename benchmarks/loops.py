"""What closed loops cost, and how that grows."""

from __future__ import annotations

import os
import time

import numpy as np
from contact import DT, FRICTION, falling, gains, points
from rigs import robot
from timing import median, ratio, timed, turns

import articulated as art

BATCH = 4096
STEPS, BEFORE = 10, 150


def hands_on_chest() -> tuple[art.Rig, list[art.Loop], np.ndarray, np.ndarray, art.PD, np.ndarray]:
    """G1 as in the contact benchmark, but both hands welded to the torso where its posture has them; states and drives."""
    rig = robot("G1")
    p, d, target = gains("G1", rig)
    q, v = falling("G1", rig, BATCH)
    for joint in rig.joints.values():
        if any(part in joint.name for part in ("shoulder", "elbow", "wrist")):
            q[:, joint.q_slice], v[:, joint.v_slice] = target[joint.q_slice], 0.0
    X, torso = art.link_poses(rig, target), rig.joints["waist_pitch_joint"].child
    loops = []
    for side in ("left", "right"):
        hand = rig.joints[f"{side}_wrist_yaw_joint"].child
        there = np.linalg.inv(X[rig.links[torso].index]) @ X[rig.links[hand].index]
        loops.append(art.Loop("weld", torso, there, hand, None, name=side))
    stiff = np.r_[np.zeros(6), np.ones(rig.nv - 6)]
    return rig, loops, q, v, art.PD(p * stiff, d * stiff), target


def loops(native: bool) -> None:
    """G1 with both hands welded to its torso: two loops, twelve rows. 4096 states, float64, one thread.

    A step of 2 ms with and without the loops, after 150 of them, nanoseconds per state; "falling" is as in `contact`, "default" is
    `Simulation(rig)` with its joint limits, "in flight" without.
    """
    rig, some, q, v, drives, target = hands_on_chest()
    ground = {"ground": art.Ground(friction=FRICTION), "contact_points": points("G1", rig)}
    scenes = {
        "falling": {**ground, "limits": False, "actuation": drives},
        "in flight": {"limits": False, "actuation": drives},
        "default": {},
        "in flight, rk4": {"limits": False, "integrator": "rk4"},
    }
    print("\n| | without | with loops | ratio | largest gap after |\n|---|---|---|---|---|")
    for name, settings in scenes.items():
        control = target if "actuation" in settings else None
        contenders, ends = {}, {}
        for label, ties in (("without", []), ("with", some)):
            simulation = art.Simulation(rig, dt=DT, loops=ties, threads=1, substeps=STEPS, **settings)
            state = simulation.reset(q, v)
            for _ in range(BEFORE // STEPS):
                state = simulation.step(state, control)
            ends[label] = state
            contenders[label] = timed(lambda s=simulation, x=state, c=control: s.step(x, c))
        taken = turns(contenders)
        ns = [1e9 * median(taken, label) / BATCH / STEPS for label in contenders]
        gap = np.abs(art.loop_gaps(rig, some, ends["with"].q)).max()
        print(f"| {name} | {ns[0]:.0f} | {ns[1]:.0f} | {ratio(taken, 'with', 'without'):.2f} | {gap:.0e} |")


def many(n: int) -> art.Rig:
    """n crank-rockers side by side, each a loop of its own."""
    builder = art.RigBuilder(f"{n} crank-rockers")
    builder.link("base")
    for k in range(n):
        for name, length in (("crank", 0.3), ("coupler", 0.9), ("rocker", 0.7)):
            builder.link(f"{name}{k}", 1.0, (length / 2, 0, 0), (1e-3, length**2 / 12, length**2 / 12))
        builder.joint(f"j1{k}", "continuous", "base", f"crank{k}", xyz=(0, k, 0), axis=(0, -1, 0))
        builder.joint(f"j2{k}", "continuous", f"crank{k}", f"coupler{k}", xyz=(0.3, 0, 0), axis=(0, -1, 0))
        builder.joint(f"j3{k}", "continuous", "base", f"rocker{k}", xyz=(1, k, 0), axis=(0, -1, 0))
        ends = f"coupler{k}", (0.9, 0, 0), f"rocker{k}", (0.7, 0, 0)
        builder.loop(art.Loop("hinge", *ends, axis=(0, 1, 0), name=f"tip{k}"))
    return builder.build()


def loop_growth(native: bool) -> None:
    """Independent loops, five rows each: crank-rockers side by side; and A02's, each of which shares a rod with the next.

    `constrained_dynamics` on 4096 states, float64, one thread; nanoseconds per state and loop, and seconds to compile.
    """
    os.environ["ARTICULATED_CACHE"] = "off"
    print("\n| loops | side by side | to compile | sharing rods | to compile |\n|---|---|---|---|---|")
    for n in (1, 2, 4, 8, 16, 32):
        cells = []
        for rig in (many(n), four_bars(n)):
            q, v = np.tile(rig.neutral(), (BATCH, 1)), np.zeros((BATCH, rig.nv))
            if rig.name.endswith("rockers"):
                q[:] = np.tile(art.assemble(many(1), None, [1.0, -0.4, 1.6]), n)
            began = time.perf_counter()
            art.constrained_dynamics(rig, None, q, v, v, threads=1)
            took = time.perf_counter() - began
            taken = turns({"it": timed(lambda r=rig, q=q, v=v: art.constrained_dynamics(r, None, q, v, v, threads=1))}, 7)
            cells += [f"{1e9 * median(taken, 'it') / BATCH / n:.0f}", f"{took:.1f}"]
        print(f"| {n} | {' | '.join(cells)} |")


def four_bars(n: int) -> art.Rig:
    """IFToMM A02."""
    builder = art.RigBuilder(f"{n} four bars")
    builder.link("base")
    for k in range(n + 1):
        builder.link(f"rod{k}", 1.0, (0, 0, 0.5), (1 / 12, 1 / 12, 0.0))
        builder.joint(f"pivot{k}", "continuous", "base", f"rod{k}", xyz=(k, 0, 0), axis=(0, 1, 0))
    for k in range(n):
        builder.link(f"bar{k}", 1.0, (0.5, 0, 0), (0.0, 1 / 12, 1 / 12))
        builder.joint(f"knee{k}", "continuous", f"rod{k}", f"bar{k}", xyz=(0, 0, 1), axis=(0, 1, 0))
        builder.loop(art.Loop("hinge", f"bar{k}", (1, 0, 0), f"rod{k + 1}", (0, 0, 1), axis=(0, 1, 0), name=f"loop{k}"))
    return builder.build()
