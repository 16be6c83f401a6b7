"""A ragdoll that falls on itself, beside others on the same rig with the same pairs."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from peers import Rollout, mjcf
from timing import median, ratio, timed, turns

import articulated as art

DT = 0.002
FRICTION = 0.8
BATCH, PEERS = 2048, 64
SIDES = ("left", "right")
ROUND = {"torso": (0.13, 0.2, "z"), "pelvis": (0.09, 0.12, "y"), "hand": (0.03, 0.09, "y"), "foot": (0.04, 0.17, "x")}
"""Capsules in place of the shipped ragdoll's boxes: radius, length, and the axis along it."""


def ragdoll() -> art.Rig:
    """The shipped ragdoll, of 15 capsules."""
    rig = art.load("ragdoll", root="free")
    links = {}
    for name, link in rig.links.items():
        radius, length, axis = ROUND.get(name.split("_")[-1], (0.0, 0.0, ""))
        shapes = link.collisions
        if axis:
            pose = shapes[0].pose.copy()
            turn = {"x": [2, 0, 1], "y": [1, 2, 0], "z": [0, 1, 2]}[axis]
            pose[:3, :3] = pose[:3, :3] @ np.eye(3)[:, turn]
            shapes = (art.Shape(art.Capsule(radius, length), pose),)
        links[name] = dataclasses.replace(link, collisions=shapes)
    return dataclasses.replace(rig, links=links)


def points(rig: art.Rig) -> list[art.ContactPoint]:
    """20 that it falls on: head, torso, pelvis, elbows, wrists, hands, knees, heels and toes."""
    at = [("head", (0.0, 0.0, 0.19), 0.09), ("head", (0.0, 0.0, 0.09), 0.09)]
    at += [("torso", (0.0, y, z), 0.13) for y in (-0.06, 0.06) for z in (0.13, 0.33)]
    at += [("pelvis", (0.0, y, 0.0), 0.09) for y in (-0.06, 0.06)]
    for side, s in zip(SIDES, (1.0, -1.0), strict=True):
        at += [(f"{side}_forearm", (0.0, 0.0, 0.0), 0.045), (f"{side}_hand", (0.0, 0.12 * s, 0.0), 0.03)]
        at += [(f"{side}_shin", (0.0, 0.0, 0.0), 0.06), (f"{side}_shin", (0.0, 0.0, -0.2), 0.05)]
        at += [(f"{side}_foot", (x, 0.0, -0.04), 0.03) for x in (-0.04, 0.15)]
    return [art.ContactPoint(*point) for point in at]


def pairs() -> list[tuple[str, str]]:
    """39, those that meet most first."""
    both = [("left", "right"), ("right", "left")]
    found = [(f"{s}_forearm", "torso") for s in SIDES]
    found += [(f"{s}_forearm", f"{t}_thigh") for s in SIDES for t in SIDES]
    found += [(f"left_{part}", f"right_{part}") for part in ("forearm", "thigh", "shin", "hand")]
    found += [(f"{s}_forearm", part) for s in SIDES for part in ("head", "pelvis")]
    found += [(f"{s}_forearm", f"{t}_shin") for s in SIDES for t in SIDES]
    found += [(f"{s}_hand", part) for s in SIDES for part in ("torso", "head", "left_thigh", "right_thigh")]
    found += [(f"{s}_{a}", f"{t}_{b}") for a, b in (("thigh", "shin"), ("foot", "shin")) for s, t in both]
    found += [(f"{s}_upper_arm", f"{t}_{part}") for s, t in both for part in ("forearm", "hand")]
    found += [(f"{s}_upper_arm", "head") for s in SIDES]
    return [*found, *((f"{s}_shin", "torso") for s in SIDES), ("left_foot", "right_foot")]


def falling(rig: art.Rig, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Any orientation, limbs anywhere within their limits, a few centimetres to decimetres above the ground."""
    rng = np.random.default_rng(0)
    q = rig.random(rng, count)
    for joint in rig.joints.values():
        if joint.kind == "ball":
            turn = 0.5 * rng.normal(size=(count, 3))
            angle = np.linalg.norm(turn, axis=1, keepdims=True)
            q[:, joint.q_slice] = np.c_[np.sin(0.5 * angle) * turn / angle, np.cos(0.5 * angle)]
    X = art.link_poses(rig, q)
    z = [(X[:, rig.links[p.link].index] @ [*p.position, 1.0])[:, 2] - p.radius for p in points(rig)]
    q[:, 2] += rng.uniform(0.02, 0.3, count) - np.min(z, axis=0)
    v = rng.normal(size=(count, rig.nv))
    v[:, 3:6] *= 2.0
    return q, v


class MuJoCo(Rollout):
    """With pairs."""

    def __init__(self, rig: art.Rig, some: list[tuple[str, str]], q: np.ndarray, v: np.ndarray):
        def place(pose: np.ndarray, p=(0.0, 0.0, 0.0)) -> str:
            x, (a, b) = pose[:3, :3] @ p + pose[:3, 3], pose[:3, :2].T
            return f'pos="{" ".join(map(repr, x.tolist()))}" xyaxes="{" ".join(map(repr, [*a.tolist(), *b.tolist()]))}"'

        def geoms(body: int) -> str:
            result = ""
            for link in (link for link in rig.links.values() if link.body == body):
                for shape in link.collisions:
                    size = f"{shape.geometry.radius} {0.5 * shape.geometry.length}"
                    where = place(link.pose @ shape.pose)
                    result += f'<geom name="{link.name}" type="capsule" size="{size}" {where} contype="0" conaffinity="0"/>'
                for p in (p for p in points(rig) if p.link == link.name):
                    where = place(link.pose, p.position)
                    result += f'<geom type="sphere" size="{p.radius}" {where} contype="1" conaffinity="0" condim="3" friction="{FRICTION} 0 0"/>'
            return result

        def joint(name: str) -> str:
            k = rig.joints[name].v_slice.start
            return f'damping="{rig.damping[k]}" armature="{rig.armature[k]}"'

        floor = f'<geom type="plane" size="50 50 1" contype="0" conaffinity="1" condim="3" friction="{FRICTION} 0 0"/>'
        option = f'<option timestep="{DT}" integrator="implicitfast"/>'
        friction = f'condim="3" friction="{FRICTION} {FRICTION} 0 0 0"'
        contact = "".join(f'<pair geom1="{a}" geom2="{b}" {friction}/>' for a, b in some)
        text = mjcf(rig, geoms, joint, floor, option).replace("</mujoco>", f"<contact>{contact}</contact></mujoco>")
        super().__init__(text, rig, q, v)


def write(rig: art.Rig, file: Path) -> None:
    """What `engines.py` reads."""
    from scipy.spatial.transform import Rotation

    def at(pose: np.ndarray) -> list[list[float]]:
        return [pose[:3, 3].tolist(), Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()]

    bodies = []
    for body in rig.bodies:
        (shape,) = rig.links[body.name].collisions
        geometry, kind = shape.geometry, rig.joints[body.joint].kind
        sizes = {"mass": body.mass, "center": body.center.tolist(), "radius": geometry.radius, "length": geometry.length}
        places = {"parent": body.parent, "kind": kind, "at": at(body.pose), "capsule_at": at(shape.pose)}
        bodies.append(places | sizes)
    turns = Rotation.random(PEERS, rng=0).as_quat().tolist()

    def geom(k: int) -> str:
        place = bodies[k]["capsule_at"]
        position, (x, y, z, w) = place
        size = f'size="{bodies[k]["radius"]} {0.5 * bodies[k]["length"]}"'
        where = f'pos="{" ".join(map(repr, position))}" quat="{w!r} {x!r} {y!r} {z!r}"'
        return f'<geom type="capsule" {size} {where} friction="{FRICTION} 0 0"/>'

    text = mjcf(rig, geom, lambda name: f'damping="{rig.damping[rig.joints[name].v_slice.start]}"', option="<option/>")
    file.write_text(json.dumps({"dt": DT, "bodies": bodies, "turns": turns, "mjcf": text}))


def engines(rig: art.Rig) -> None:
    """PyBullet and Rapier, by the interpreter that BENCHMARK_ENGINES names; without it they are left out."""
    if not (python := os.environ.get("BENCHMARK_ENGINES")):
        print("\nPyBullet and Rapier are left out: BENCHMARK_ENGINES names no interpreter that has them.")
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ragdoll.json"
        write(rig, file)
        script = Path(__file__).with_name("engines.py")
        found = subprocess.run([python, str(script), str(file)], capture_output=True, text=True, check=True).stdout
    print("\n| engine, all pairs but neighbours | ns a step |\n|---|---|")
    for line in found.splitlines():
        name, said = line.split("\t")
        print(f"| {name} | {said if said.startswith('left') else f'{1e9 * float(said):.0f}'} |")


def pairs_of_bodies(native: bool) -> None:
    """The ragdoll as 15 capsules (36 dof, joint limits off) with 20 points of contact and some of its pairs, falling on the ground
    and on itself: 1.5 s, dt 2 ms, one thread, against mujoco.rollout on one thread with the same points and pairs, 64 states of
    it; nanoseconds a step. "Over ground" is what the step takes over that without pairs. Residuals are the worst of all steps.
    """
    print("| pairs | format | ns a step | over ground | MuJoCo | ratio | residual [m/s] | compiled in [s] |")
    print("|---|---|---|---|---|---|---|---|")
    rig, steps = ragdoll(), 750
    q, v = falling(rig, BATCH)
    settings = {"dt": DT, "substeps": steps, "limits": False, "contact_points": points(rig), "threads": 1}
    chosen = {0: [], 10: pairs()[:10], 39: pairs()}
    for dtype in (np.float64, np.float32):
        simulations, starts, contenders, firsts = {}, {}, {}, {}
        for n, some in chosen.items():
            collisions = art.Collisions(friction=FRICTION, pairs=some) if some else None
            simulation = art.Simulation(rig, ground=art.Ground(friction=FRICTION), collisions=collisions, **settings)
            simulations[n], starts[n] = simulation, simulation.reset(q.astype(dtype), v.astype(dtype))
            contenders[f"ours {n}"] = timed(lambda s=simulation, start=starts[n]: s.step(start))
            peer = MuJoCo(rig, some, q[:PEERS], v[:PEERS])
            contenders[f"peer {n}"] = timed(lambda peer=peer: peer.run(steps))
            firsts[n] = timed(lambda s=simulation, start=starts[n]: s.step(start), 0.0)()
        taken = turns(contenders, count=5)
        for n, simulation in simulations.items():
            ours = 1e9 * median(taken, f"ours {n}") / steps / BATCH
            theirs = 1e9 * median(taken, f"peer {n}") / steps / PEERS
            over, times = ratio(taken, f"ours {n}", "ours 0"), ratio(taken, f"peer {n}", f"ours {n}") * BATCH / PEERS
            residual = simulation.residual(simulation.step(starts[n])).max()
            print(
                f"| {n} | {np.dtype(dtype).name} | {ours:.0f} | {over:.2f} | {theirs:.0f} | {times:.1f} | {residual:.1e} | {firsts[n]:.1f} |",
                flush=True,
            )
    engines(rig)


def two_ragdolls(native: bool) -> None:
    """One ragdoll as in `pairs`; two side by side that do not know of each other; and two that fall on each other: 81 more pairs,
    of nine parts of the one with nine of the other. float64, one thread, nanoseconds a step of all of them.
    """
    print("| ragdolls | pairs | ns a step | over one | compiled in [s] |")
    print("|---|---|---|---|---|")
    one, steps, count = ragdoll(), 750, 512
    q, v = falling(one, 2 * count)
    two = art.compose(left=one, right=one)
    both, speeds = np.concatenate([q[:count], q[count:]], axis=1), np.concatenate([v[:count], v[count:]], axis=1)
    both[:, one.nq] += 0.3
    own = [(f"{side}/{a}", f"{side}/{b}") for side in SIDES for a, b in pairs()]
    parts = ["torso", *(f"{s}_{part}" for s in SIDES for part in ("forearm", "hand", "thigh", "shin"))]
    across = [(f"left/{a}", f"right/{b}") for a in parts for b in parts]
    scenes = {
        "one": (one, pairs(), q[:count], v[:count]),
        "two apart": (two, own, both, speeds),
        "two together": (two, own + across, both, speeds),
    }
    contenders, firsts = {}, {}
    for name, (rig, some, at, moving) in scenes.items():
        named = points(one)
        if rig is two:
            named = [dataclasses.replace(p, link=f"{side}/{p.link}") for side in SIDES for p in named]
        settings = {"dt": DT, "substeps": steps, "limits": False, "contact_points": named, "threads": 1}
        collisions = art.Collisions(friction=FRICTION, pairs=some)
        simulation = art.Simulation(rig, ground=art.Ground(friction=FRICTION), collisions=collisions, **settings)
        start = simulation.reset(at, moving)
        firsts[name] = timed(lambda s=simulation, start=start: s.step(start), 0.0)()
        contenders[name] = timed(lambda s=simulation, start=start: s.step(start))
    taken = turns(contenders, count=5)
    for name, (_, some, *_) in scenes.items():
        ns, over = 1e9 * median(taken, name) / steps / count, ratio(taken, name, "one")
        print(f"| {name} | {len(some)} | {ns:.0f} | {over:.2f} | {firsts[name]:.0f} |", flush=True)
