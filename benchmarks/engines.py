"""The falling ragdoll of `pairs.py` in engines whose wheels may want an environment of their own: PyBullet and Rapier.

    python benchmarks/engines.py RAGDOLL      # as `pairs.py` runs it, with the interpreter named in BENCHMARK_ENGINES

RAGDOLL is what `pairs.write` wrote. In both engines all capsules but neighbours may touch, and the ground; joints have no limits.
Prints a line for each engine: its name and version, and seconds that a step of one ragdoll takes.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from typing import Any

WORLDS, STEPS = 64, 750


def pybullet(ragdoll: dict[str, Any]) -> float:
    """Reduced coordinates (createMultiBody), one world after the other."""
    import pybullet as p

    total = 0.0
    for turn in ragdoll["turns"][:WORLDS]:
        p.connect(p.DIRECT)
        p.setTimeStep(ragdoll["dt"])
        p.setGravity(0.0, 0.0, -9.81)
        p.createMultiBody(0.0, p.createCollisionShape(p.GEOM_PLANE))
        shapes, places = [], {}
        for n, body in enumerate(ragdoll["bodies"]):
            position, rotation = body["capsule_at"]
            shapes.append(
                p.createCollisionShape(
                    p.GEOM_CAPSULE,
                    radius=body["radius"],
                    height=body["length"],
                    collisionFramePosition=position,
                    collisionFrameOrientation=rotation,
                )
            )
            places[n] = body["at"]
        links = ragdoll["bodies"][1:]
        kinds = {"ball": p.JOINT_SPHERICAL, "universal": p.JOINT_SPHERICAL, "revolute": p.JOINT_REVOLUTE}
        body = p.createMultiBody(
            baseMass=ragdoll["bodies"][0]["mass"],
            baseCollisionShapeIndex=shapes[0],
            basePosition=[0.0, 0.0, 1.3],
            baseOrientation=turn,
            linkMasses=[link["mass"] for link in links],
            linkCollisionShapeIndices=shapes[1:],
            linkVisualShapeIndices=[-1] * len(links),
            linkPositions=[link["at"][0] for link in links],
            linkOrientations=[link["at"][1] for link in links],
            linkInertialFramePositions=[link["center"] for link in links],
            linkInertialFrameOrientations=[[0.0, 0.0, 0.0, 1.0]] * len(links),
            linkParentIndices=[link["parent"] for link in links],  # 0 is the base
            linkJointTypes=[kinds[link["kind"]] for link in links],
            linkJointAxis=[[0.0, 0.0, 1.0]] * len(links),
            flags=p.URDF_USE_SELF_COLLISION | p.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT,
        )
        for k, link in enumerate(links):
            p.changeDynamics(body, k, lateralFriction=0.8, jointDamping=2.0)
            if link["kind"] == "revolute":
                p.setJointMotorControl2(body, k, p.VELOCITY_CONTROL, force=0.0)
            else:
                p.setJointMotorControlMultiDof(
                    body, k, p.POSITION_CONTROL, targetPosition=[0.0, 0.0, 0.0, 1.0], positionGain=0.0, force=[0.0] * 3
                )
        began = time.perf_counter()
        for _ in range(STEPS):
            p.stepSimulation()
        total += time.perf_counter() - began
        height = p.getBasePositionAndOrientation(body)[0][2]
        assert 0.0 < height < 0.6, height  # it lies on the ground
        p.disconnect()
    return total / min(WORLDS, len(ragdoll["turns"])) / STEPS


def rapier3d(ragdoll: dict[str, Any]) -> float:
    """Reduced coordinates (multibody joints), read from MJCF; one thread."""
    import rapier3d as r
    from rapier3d.loaders import mjcf

    total = 0.0
    for turn in ragdoll["turns"][:WORLDS]:
        world = r.PhysicsWorld(gravity=(0.0, 0.0, -9.81))
        world.set_num_threads(1)
        world.integration_parameters.dt = ragdoll["dt"]
        floor = r.Collider.cuboid(50.0, 50.0, 1.0)
        world.colliders.insert(floor.translation((0.0, 0.0, -1.0)).friction(0.8).build())
        robot, _ = mjcf.MjcfRobot.from_str(ragdoll["mjcf"], mjcf.MjcfLoaderOptions(enable_joint_collisions=False))
        robot.append_transform(r.Isometry3((0.0, 0.0, 1.3), turn))
        handles = robot.insert_using_multibody_joints(
            world.rigid_bodies, world.colliders, world.multibody_joints, world.impulse_joints
        )
        began = time.perf_counter()
        for _ in range(STEPS):
            world.step()
        total += time.perf_counter() - began
        bodies = [world.rigid_bodies[handle.body] for handle in handles.bodies if handle is not None]
        moving = [body for body in bodies if body.mass > 1.0]
        heights = [body.translation.z for body in moving]
        assert len(moving) > 10
        assert -0.1 < min(heights) <= max(heights) < 0.8, heights  # it lies on the ground
    return total / min(WORLDS, len(ragdoll["turns"])) / STEPS


def main() -> None:
    with open(sys.argv[1]) as file:
        ragdoll = json.load(file)
    for engine in (pybullet, rapier3d):
        try:
            print(f"{engine.__name__} {version(engine.__name__)}\t{engine(ragdoll)!r}", flush=True)
        except ImportError as error:
            print(f"{engine.__name__}\tleft out: {error}", flush=True)


if __name__ == "__main__":
    main()
