"""Falling and lying, beside MuJoCo on the same rig with the same points of contact."""

from __future__ import annotations

import dataclasses
import os

import numpy as np
from peers import Rollout, mjcf
from rigs import robot
from timing import median, ratio, timed, turns

import articulated as art

DT = 0.002
FRICTION = 0.8
BATCH = 4096


def points(name: str, rig: art.Rig) -> list[art.ContactPoint]:
    """12 of Solo12, 20 of G1: feet, and what else it falls on."""
    root = next(iter(rig.links))

    def at(joint: str, *p: float) -> art.ContactPoint:
        return art.ContactPoint(rig.joints[joint].child if joint else root, p)

    if name == "Solo12":
        feet = [at(f"{leg}_KFE", 0.0, 0.008 if leg[1] == "L" else -0.008, -0.16) for leg in ("FL", "FR", "HL", "HR")]
        return feet + [at("", x, y, z) for x in (-0.2, 0.2) for y in (-0.11, 0.11) for z in (-0.03, 0.03)]
    chosen = []
    for side, s in (("left", 1.0), ("right", -1.0)):
        chosen += [
            at(f"{side}_ankle_roll_joint", x, y, -0.03)
            for x, y in ((-0.05, 0.025), (-0.05, -0.025), (0.12, 0.03), (0.12, -0.03))
        ]
        chosen += [at(f"{side}_knee_joint", 0.04, 0.0, 0.0), at(f"{side}_elbow_joint", -0.02, 0.03 * s, -0.02)]
        chosen += [at(f"{side}_wrist_yaw_joint", 0.14, 0.003 * s, 0.0)]
    torso = ((0.0, 0.0, 0.5), (-0.08, 0.12, 0.25), (-0.08, -0.12, 0.25), (0.1, 0.0, 0.22))
    return [*chosen, *(at("waist_pitch_joint", *p) for p in torso), at("", -0.09, 0.0, -0.05), at("", 0.08, 0.0, -0.05)]


def gains(name: str, rig: art.Rig) -> tuple[float, float, np.ndarray]:
    """Stiffness and damping of all joints, and the posture that they hold to."""
    target = rig.neutral()
    if name == "Solo12":
        target[7:] = np.tile([0.0, 0.7, -1.4], 4)
        return 3.0, 0.05, target
    target[7:][[0, 6, 3, 9, 4, 10]] = [-0.3, -0.3, 0.6, 0.6, -0.3, -0.3]
    return 30.0, 1.0, target


def falling(name: str, rig: art.Rig, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Any orientation, a few centimetres to decimetres above the ground."""
    rng, chosen = np.random.default_rng(0), points(name, rig)
    target = gains(name, rig)[2]
    q = np.tile(target, (count, 1))
    q[:, 7:] = np.clip(q[:, 7:] + 0.4 * rng.normal(size=(count, rig.nv - 6)), rig.lower[6:], rig.upper[6:])
    q[:, 3:7] = rng.normal(size=(count, 4))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    X = art.link_poses(rig, q)
    z = [(X[:, rig.links[p.link].index] @ [*p.position, 1.0])[:, 2] for p in chosen]
    q[:, 2] = rng.uniform(0.02, 0.3, count) - np.min(z, axis=0)
    v = rng.normal(size=(count, rig.nv))
    v[:, :3] *= 0.5
    v[:, 3:6] *= 2.0
    return q, v


class MuJoCo(Rollout):
    """With drives."""

    def __init__(self, name: str, rig: art.Rig, q: np.ndarray, v: np.ndarray):
        p, d, target = gains(name, rig)
        chosen = points(name, rig)

        def spheres(body: int) -> str:
            result = ""
            for point in chosen:
                link = rig.links[point.link]
                if link.body == body:
                    place = link.pose[:3, :3] @ point.position + link.pose[:3, 3]
                    where = " ".join(map(repr, place.tolist()))
                    result += f'<geom type="sphere" size="0.001" pos="{where}" contype="1" conaffinity="0" condim="3" friction="{FRICTION} 0 0"/>'
            return result

        def drive(joint: str) -> str:
            return f'damping="{d}" stiffness="{p}" springref="{float(target[rig.joints[joint].q_slice][0])!r}"'

        floor = f'<geom type="plane" size="50 50 1" contype="0" conaffinity="1" condim="3" friction="{FRICTION} 0 0"/>'
        option = f'<option timestep="{DT}" integrator="implicitfast"/>'
        super().__init__(mjcf(rig, spheres, drive, floor, option), rig, q, v)


def contact(native: bool) -> None:
    """One second of falling, then a quarter of a second at rest (five seconds later); dt 2 ms, one thread, against
    mujoco.rollout on one thread, 64 states of it; nanoseconds a step. Residuals are the worst of all steps: of ours, in m/s.
    """
    print(
        "| rig, points | format | falling | at rest | MuJoCo falling | at rest | ratio falling | at rest | residual | steps that missed 1e-4 |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in ("Solo12", "G1"):
        rig = robot(name)
        p, d, target = gains(name, rig)
        free = np.zeros(6)
        drives = art.PD(np.r_[free, np.full(rig.nv - 6, p)], np.r_[free, np.full(rig.nv - 6, d)])
        ground, chosen = art.Ground(friction=FRICTION), points(name, rig)
        q, v = falling(name, rig, BATCH)
        peer = MuJoCo(name, rig, q[:64], v[:64])
        lying = MuJoCo(name, rig, q[:64], v[:64])
        lying.state = lying.run(2500)
        for dtype in (np.float64, np.float32):
            simulation = art.Simulation(
                rig, dt=DT, ground=ground, contact_points=chosen, limits=False, actuation=drives, threads=1
            )
            second, quarter, five = (dataclasses.replace(simulation, substeps=n) for n in (500, 125, 2500))
            start, held = simulation.reset(q.astype(dtype), v.astype(dtype)), target.astype(dtype)
            end = second.step(start, held)
            rest = five.step(start, held)
            taken = turns(
                {
                    "falling": timed(lambda: second.step(start, held)),
                    "peer falling": timed(lambda: peer.run(500)),
                    "rest": timed(lambda: quarter.step(rest, held)),
                    "peer rest": timed(lambda: lying.run(125)),
                },
                count=5,
            )
            ns = [
                1e9 * median(taken, who) / steps / states
                for who, steps, states in (
                    ("falling", 500, BATCH),
                    ("rest", 125, BATCH),
                    ("peer falling", 500, 64),
                    ("peer rest", 125, 64),
                )
            ]
            ratios = [ratio(taken, f"peer {who}", who) * (BATCH / 64) for who in ("falling", "rest")]
            missed = end.motion()[:, simulation._world.layout.stance.failures].sum() / (500 * BATCH)
            print(
                f"| {name}, {len(chosen)} | {np.dtype(dtype).name} | {ns[0]:.0f} | {ns[1]:.0f} | {ns[2]:.0f} | {ns[3]:.0f}"
                f" | {ratios[0]:.1f} | {ratios[1]:.1f} | {simulation.residual(end).max():.1e} | {missed:.1e} |",
                flush=True,
            )


def stepping(native: bool) -> None:
    """G1 with 20 points falling, 4,096 states in float32, a step of 2 ms at a time, or a second at once: steps a second."""
    print("| threads | Simulation.step each 2 ms | a second at once |")
    print("|---|---|---|")
    rig = robot("G1")
    p, d, target = gains("G1", rig)
    free = np.zeros(6)
    drives = art.PD(np.r_[free, np.full(rig.nv - 6, p)], np.r_[free, np.full(rig.nv - 6, d)])
    q, v = (x.astype(np.float32) for x in falling("G1", rig, BATCH))
    held = target.astype(np.float32)
    os.sched_setaffinity(0, range(os.cpu_count() or 1))
    for threads in (1, 2):
        simulation = art.Simulation(
            rig,
            dt=DT,
            ground=art.Ground(friction=FRICTION),
            contact_points=points("G1", rig),
            limits=False,
            actuation=drives,
            threads=threads,
        )
        second = dataclasses.replace(simulation, substeps=500)
        start = simulation.reset(q, v)

        def step_by_step(simulation=simulation, start=start) -> None:
            state = start
            for _ in range(250):
                state = simulation.step(state, held)

        taken = turns({"steps": timed(step_by_step), "at once": timed(lambda: second.step(start, held))}, count=3)
        rates = 250 * BATCH / median(taken, "steps"), 500 * BATCH / median(taken, "at once")
        print(f"| {threads} | {rates[0] / 1e6:.2f} million | {rates[1] / 1e6:.2f} million |", flush=True)


def contact_growth(native: bool) -> None:
    """A falling chain on hinges, each link with a point of contact, or 24 links and more points: nanoseconds a step and state."""
    print("| links | points | first call [s] | ns a step | ns a step and point |")
    print("|---|---|---|---|---|")
    for links, count in ((6, 6), (12, 12), (24, 24), (48, 48), (24, 12), (24, 48)):
        builder = art.RigBuilder("chain")
        for k in range(links):
            builder.link(f"l{k}", 0.2, (0.05, 0.0, 0.0), np.diag([1e-4, 5e-4, 5e-4]))
            if k:
                builder.joint(f"j{k}", "revolute", f"l{k - 1}", f"l{k}", xyz=(0.1, 0, 0), axis=((0, 1, 0), (0, 0, 1))[k % 2])
        rig = builder.build("free").with_joints(damping=0.05)
        chosen = [art.ContactPoint(f"l{k % links}", (0.05 + 0.02 * (k // links), 0.0, 0.0), 0.02) for k in range(count)]
        simulation = art.Simulation(rig, dt=DT, ground=True, contact_points=chosen, threads=1, substeps=250)
        q = rig.random(0, 512)
        q[:, 7:] *= 0.2
        q[:, 2] = 0.3
        first = timed(lambda: simulation.step(simulation.reset(q)), 0.0)()
        taken = turns({"run": timed(lambda: simulation.step(simulation.reset(q)))}, count=3)
        ns = 1e9 * median(taken, "run") / 250 / 512
        print(f"| {links} | {count} | {first:.1f} | {ns:.0f} | {ns / count:.0f} |", flush=True)
