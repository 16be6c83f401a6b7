"""The others, doing the same work on the same rig."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from timing import timed

import articulated as art
from articulated.crosscheck import PinocchioModel

Contender = Callable[[], float]


class Pinocchio:
    """Pinocchio on one thread, by its Python module: loops over a batch in C++, or one state at a time."""

    def __init__(self, rig: art.Rig, q: np.ndarray, v: np.ndarray, tau: np.ndarray):
        self.model = PinocchioModel.from_rig(rig).model
        pool = pin.ModelPool(self.model, 1)
        Q, V, T = (np.asfortranarray(x.T) for x in (q, v, tau))
        A = np.zeros_like(V, order="F")
        self._one = [np.ascontiguousarray(x[0]) for x in (q, v, tau)]
        self.batch: dict[str, Contender] = {
            "forward_dynamics": timed(lambda: pin.abaInParallel(1, pool, Q, V, T, A)),
            "inverse_dynamics": timed(lambda: pin.rneaInParallel(1, pool, Q, V, T, A)),
        }

    def single(self) -> Contender:
        """`pin.aba` for one state."""
        model, data, one = self.model, self.model.createData(), self._one
        return timed(lambda: pin.aba(model, data, *one))


class Native:
    """Pinocchio's C++ built for this processor, in a process of its own that takes turns with ours."""

    def __init__(self, model: pin.Model, states: int):
        program = build_native()
        with tempfile.NamedTemporaryFile("w", suffix=".model", delete=False) as file:
            file.write(dump(model))
        self._process = subprocess.Popen(
            [program, file.name, str(states)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline().strip() == "ready"

    def contender(self, function: str) -> Contender:
        """A function of it, in seconds per state."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        stdin, stdout = self._process.stdin, self._process.stdout

        def measure() -> float:
            stdin.write(f"{function}\n")
            return float(stdout.readline().split()[0]) * 1e-9

        return measure


def build_native() -> Path:
    """Compile the C++ program, once for each version of it; needs g++ and Eigen's headers (Debian: libeigen3-dev)."""
    source = Path(__file__).with_name("pinocchio_native.cpp")
    include = next(p for p in (Path(entry) / "cmeel.prefix" / "include" for entry in sys.path) if (p / "pinocchio").is_dir())
    key = hashlib.sha256(source.read_bytes() + pin.__version__.encode()).hexdigest()[:16]
    program = Path(tempfile.gettempdir()) / f"pinocchio_native_{key}"
    if not program.exists():
        if shutil.which("g++") is None:
            raise RuntimeError("g++ is not installed; leave out native Pinocchio with --no-native")
        print("compiling native Pinocchio, some minutes …", file=sys.stderr)
        limits = [
            "-DBOOST_MPL_LIMIT_LIST_SIZE=30",
            "-DBOOST_FUSION_INVOKE_MAX_ARITY=10",
            "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
            "-DNDEBUG",
            "-w",
        ]
        folders = ["-I", str(include), "-I", "/usr/include/eigen3", "-I", str(include / "eigen3")]
        part = program.with_suffix(".part")
        subprocess.run(
            ["g++", "-std=c++17", "-O3", "-march=native", *limits, *folders, str(source), "-o", str(part)], check=True
        )
        part.rename(program)
    return program


def dump(model: pin.Model) -> str:
    """A model as `pinocchio_native.cpp` reads it."""
    kinds = {f"JointModel{kind}": kind for kind in ("RX", "RY", "RZ", "PX", "PY", "PZ")}
    kinds |= {"JointModelFreeFlyer": "free", "JointModelRevoluteUnaligned": "R", "JointModelPrismaticUnaligned": "P"}
    lines = [str(model.njoints - 1)]
    for k in range(1, model.njoints):
        joint, placement, inertia = model.joints[k], model.jointPlacements[k], model.inertias[k]
        name = joint.shortname()
        axis = joint.extract().axis if name.endswith("Unaligned") else np.zeros(3)
        numbers = [
            *axis,
            *placement.rotation.ravel(),
            *placement.translation,
            inertia.mass,
            *inertia.lever,
            *inertia.inertia.ravel(),
        ]
        lines.append(" ".join([kinds[name], str(model.parents[k]), *(repr(float(x)) for x in numbers)]))
    return "\n".join(lines)


def mujoco_forward(rig: art.Rig, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> Contender:
    """MuJoCo's mj_forward on the same rig, contacts and limits off, called from Python for one state."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(mjcf(rig))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qfrc_applied[:] = mujoco_configuration(rig, q), v, tau
    return timed(lambda: mujoco.mj_forward(model, data))


class Rollout:
    """mujoco.rollout on one thread, default Newton solver, pyramidal cones: of a model with a free root, and some states."""

    def __init__(self, text: str, rig: art.Rig, q: np.ndarray, v: np.ndarray):
        import mujoco
        from mujoco import rollout

        self.model = mujoco.MjModel.from_xml_string(text)
        self.data, self.rollout = mujoco.MjData(self.model), rollout
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        self.state = np.zeros((len(q), mujoco.mj_stateSize(self.model, full)))
        for row, configuration, velocity in zip(self.state, q, v, strict=True):
            mujoco.mj_resetData(self.model, self.data)
            self.data.qpos[:], self.data.qvel[:] = mujoco_configuration(rig, configuration), velocity
            self.data.qvel[:3] = art.link_poses(rig, configuration)[0, :3, :3] @ velocity[:3]
            mujoco.mj_getState(self.model, self.data, row, full)

    def run(self, steps: int) -> np.ndarray:
        return self.rollout.rollout(self.model, self.data, self.state, nstep=steps)[0][:, -1]


def mujoco_configuration(rig: art.Rig, q: np.ndarray) -> np.ndarray:
    """q with quaternions scalar first, as MuJoCo has them."""
    q = q.copy()
    for where in rig.quaternions.values():
        q[where] = np.roll(q[where], 1)
    return q


def mjcf(
    rig: art.Rig,
    on_body: Callable[[int], str] = lambda i: "",
    on_joint: Callable[[str], str] = lambda name: "",
    world: str = "",
    option: str | None = None,
) -> str:
    """A rig as MuJoCo's XML, body by body, with what else is to stand in it."""
    children: dict[int, list[int]] = {}
    for i, body in enumerate(rig.bodies):
        children.setdefault(body.parent, []).append(i)

    def vector(x) -> str:
        return " ".join(repr(float(y)) for y in x)

    def element(i: int) -> str:
        body = rig.bodies[i]
        joint = rig.joints[body.joint]
        xyaxes = np.concatenate([body.pose[:3, 0], body.pose[:3, 1]])
        I = body.inertia
        full = (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
        if joint.kind == "floating":
            moving = "<freejoint/>"
        elif joint.kind == "ball":
            moving = f'<joint type="ball" {on_joint(joint.name)}/>'
        else:
            axes = ["1 0 0", "0 0 1"] if joint.kind == "universal" else ["0 0 1"]
            kind = "slide" if joint.kind == "prismatic" else "hinge"
            moving = "".join(f'<joint type="{kind}" axis="{axis}" {on_joint(joint.name)}/>' for axis in axes)
        inside = "".join(element(k) for k in children.get(i, []))
        return (
            f'<body pos="{vector(body.pose[:3, 3])}" xyaxes="{vector(xyaxes)}">{moving}'
            f'<inertial pos="{vector(body.center)}" mass="{body.mass!r}" fullinertia="{vector(full)}"/>{on_body(i)}{inside}</body>'
        )

    roots = "".join(element(i) for i in children.get(-1, []))
    flags = '<flag contact="disable" constraint="disable"/>'
    compiler = '<compiler balanceinertia="true" boundmass="1e-9" boundinertia="1e-12"/>'
    option = f"<option>{flags}</option>" if option is None else option
    return f"<mujoco>{compiler}{option}<worldbody>{world}{roots}</worldbody></mujoco>"
