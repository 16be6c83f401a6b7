"""The same rig in Pinocchio, and every function of dynamics compared with it: for tests, and for your own rigs.

Pinocchio counts joints in another order, keeps a continuous angle as (cos, sin) and gives followers coordinates of their own;
`PinocchioModel` converts all that in one place. Needs the extra `check` (`pip install articulated[check]`).

Source of the reference: Carpentier et al. 2019, "The Pinocchio C++ library".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from articulated.dynamics import functions as art
from articulated.dynamics.boundary import GRAVITY
from articulated.extras import need
from articulated.rig import Link, Rig

Array = np.ndarray

TOLERANCE = 1e-10
"""Largest relative error that counts as agreement."""

WELL_CONDITIONED = 1e5
"""Above this condition of the mass matrix, errors of accelerations are divided by how much larger it is: at this one, rounding
errors, some 1e-15, grow to the tolerance."""


class PinocchioModel:
    """A Pinocchio model of a rig, and the conversions between its coordinates and ours.

    Attributes:
        rig, model: the two.
        G: Pinocchio's velocity is G v, shape (model.nv, rig.nv); our generalized force is Gᵀ times Pinocchio's.
    """

    def __init__(self, rig: Rig, model: Any):
        """Pair a rig with a model whose joints have the same names; followers are independent joints in the model."""
        self.rig, self.model = rig, model
        self.model.gravity.linear = np.array(GRAVITY)
        self.G = np.zeros((model.nv, rig.nv))
        for name, joint in rig.joints.items():
            rows = slice(model.idx_vs[self._id(name)], model.idx_vs[self._id(name)] + model.nvs[self._id(name)])
            owner = rig.joints[joint.mimic.joint] if joint.mimic else joint
            self.G[rows, owner.v_slice] = np.eye(owner.nv) * (joint.mimic.multiplier if joint.mimic else 1.0)

    @cached_property
    def data(self) -> Any:
        """Pinocchio's working memory; it grows with the cube of nv."""
        return self.model.createData()

    @staticmethod
    def from_urdf(rig: Rig, text: str) -> PinocchioModel:
        """Read the URDF that the rig came from with Pinocchio's own reader."""
        pin = need("pinocchio", "check")
        roots = {"fixed": None, "free": pin.JointModelFreeFlyer, "planar": pin.JointModelPlanar}
        root = roots[rig.root]
        model = pin.buildModelFromXML(text) if root is None else pin.buildModelFromXML(text, root())
        return PinocchioModel(rig, model)

    @staticmethod
    def from_rig(rig: Rig) -> PinocchioModel:
        """Build the model joint by joint and link by link, from what the rig says of them."""
        pin = need("pinocchio", "check")
        model = pin.Model()
        ids, frames = {-1: 0}, {-1: np.eye(4)}  # of each body: Pinocchio's joint, and the joint's frame in the body's
        joint_of_body = {joint.body: joint for joint in rig.joints.values()}
        for i, body in enumerate(rig.bodies):
            joint = joint_of_body[i]
            # Pinocchio's joint frame is the child link's, but for planar joints, whose plane is always its x-y plane
            frames[i] = np.eye(4) if joint.kind == "planar" else rig.links[body.name].pose
            place = np.linalg.inv(frames[body.parent]) @ (body.pose @ frames[i])
            ids[i] = model.addJoint(ids[body.parent], _joint_model(joint), _se3(place), joint.name)
        for link in rig.links.values():
            place = _se3(np.linalg.inv(frames[link.body]) @ link.pose)
            if link.body >= 0:
                model.appendBodyToJoint(ids[link.body], _inertia(link), place)
            model.addFrame(pin.Frame(link.name, ids[link.body], 0, place, pin.FrameType.BODY), False)
        return PinocchioModel(rig, model)

    def q(self, q: Array) -> Array:
        """Our configuration, shape (nq,), as Pinocchio's."""
        result = np.zeros(self.model.nq)
        for name, joint in self.rig.joints.items():
            index, kind = self._id(name), self.model.joints[self._id(name)].shortname()
            if joint.mimic:
                own = joint.mimic.multiplier * q[self.rig.joints[joint.mimic.joint].q_slice] + joint.mimic.offset
            else:
                own = q[joint.q_slice]
            if "RUB" in kind or "Unbounded" in kind:
                own = np.array([np.cos(own[0]), np.sin(own[0])])
            elif kind == "JointModelPlanar":
                own = np.array([own[0], own[1], np.cos(own[2]), np.sin(own[2])])
            start = self.model.idx_qs[index]
            result[start : start + self.model.nqs[index]] = own
        return result

    def v(self, v: Array) -> Array:
        """Our generalized velocity (or acceleration), shape (nv,), as Pinocchio's."""
        return self.G @ v

    def tau(self, tau: Array) -> Array:
        """Pinocchio's generalized force, shape (model.nv,), as ours."""
        return self.G.T @ tau

    def frame(self, link: str) -> int:
        """Pinocchio's frame of a link."""
        pin = need("pinocchio", "check")
        return self.model.getFrameId(link, pin.FrameType.BODY)

    def _id(self, joint: str) -> int:
        if not self.model.existJointName(joint):
            raise ValueError(f"the Pinocchio model has no joint {joint!r}, which rig {self.rig.name!r} has")
        return self.model.getJointId(joint)


@dataclass(frozen=True)
class Comparison:
    """How one function compares: its worst relative error over all states (of accelerations: scaled), and the error allowed."""

    function: str
    error: float
    tolerance: float

    @property
    def agrees(self) -> bool:
        return self.error <= self.tolerance  # False for NaN


def compare(reference: PinocchioModel, samples: int = 20, seed: int = 0) -> list[Comparison]:
    """Compare every function of dynamics on random states.

    Args:
        reference: the rig and its model.
        samples: how many states.
        seed: of the random states, wrenches and points.

    Returns:
        One comparison a function.
    """
    rig = reference.rig
    rng = np.random.default_rng(seed)
    s = _States(rig, rng, samples)
    condition = np.linalg.cond(art.mass_matrix(rig, s.q)) if rig.nv else np.ones(samples)
    amplified, one = np.maximum(condition / WELL_CONDITIONED, 1.0), np.ones(samples)
    return [
        Comparison(name, _worst(ours, theirs, amplified if "forward" in name else one), TOLERANCE)
        for name, ours, theirs in _pairs(reference, s)
    ]


class _States:
    def __init__(self, rig: Rig, rng: np.random.Generator, n: int):
        self.n = n
        self.q, self.q1 = rig.random(rng, n), rig.random(rng, n)
        for joint in rig.joints.values():
            if joint.kind == "planar":
                # ours is unwrapped: compare where Pinocchio's shortest way is the same. Its planar logarithm also drops
                # θ²/12 below some 1e-3 rad (4.1; integrating its answer misses q1 by 2e-9), so turns are larger than that
                angle = joint.q_slice.stop - 1
                self.q1[:, angle] = self.q[:, angle] + rng.choice([-1.0, 1.0], n) * rng.uniform(0.1, 3.0, n)
        self.v, self.a, self.tau = (rng.normal(size=(n, rig.nv)) for _ in range(3))
        self.external = rng.normal(size=(n, rig.nlinks, 6))
        self.link = list(rig.links.values())[rng.integers(rig.nlinks)]
        self.last = list(rig.links.values())[-1]
        self.point = rng.normal(size=3)


def _worst(ours: Array, theirs: Array, amplified: Array) -> float:
    """Worst difference, relative to the largest entry of the reference in the same state, over what this state amplifies."""
    n = len(ours)
    difference = np.abs(ours - theirs).reshape(n, -1)
    size = np.abs(theirs).reshape(n, -1)
    if not difference.shape[1]:
        return 0.0
    scale = np.maximum(size.max(axis=1), 1e-3 * max(size.max(), 1e-9))
    return float((difference.max(axis=1) / scale / amplified).max())


def _pairs(ref: PinocchioModel, s: _States) -> Iterator[tuple[str, Array, Array]]:
    pin = need("pinocchio", "check")
    rig, model, data = ref.rig, ref.model, ref.data
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    qs, vs = [ref.q(q) for q in s.q], [ref.v(v) for v in s.v]
    zero = np.zeros(model.nv)

    def every(one: Callable[[int], Array]) -> Array:
        return np.array([one(k) for k in range(s.n)])

    def wrenches(k: int) -> list:
        pin.framesForwardKinematics(model, data, qs[k])
        forces = [pin.Force.Zero() for _ in range(model.njoints)]
        for link in rig.links.values():
            frame = model.frames[ref.frame(link.name)]
            R = data.oMf[ref.frame(link.name)].rotation
            f = s.external[k, link.index]
            forces[frame.parentJoint] += frame.placement.act(pin.Force(R.T @ f[:3], R.T @ f[3:]))
        return forces

    def mass(k: int) -> Array:
        M = pin.crba(model, data, qs[k])
        M = np.triu(M) + np.triu(M, 1).T
        return ref.G.T @ M @ ref.G + np.diag(rig.armature)

    def forward(k: int, forces: list | None) -> Array:
        if any(joint.mimic for joint in rig.joints.values()) or np.any(rig.armature):
            bias = pin.rnea(model, data, qs[k], vs[k], zero, forces or [pin.Force.Zero()] * model.njoints)
            return np.linalg.solve(mass(k), s.tau[k] - ref.tau(bias))
        args = (model, data, qs[k], vs[k], ref.G @ s.tau[k], *([forces] if forces else []))
        return ref.G.T @ pin.aba(*args)

    def inverse(k: int, forces: list | None) -> Array:
        args = (model, data, qs[k], vs[k], ref.v(s.a[k]), *([forces] if forces else []))
        return ref.tau(pin.rnea(*args)) + rig.armature * s.a[k]

    yield "forward_dynamics", art.forward_dynamics(rig, s.q, s.v, s.tau), every(lambda k: forward(k, None))
    ours = art.forward_dynamics(rig, s.q, s.v, s.tau, s.external)
    yield "forward_dynamics, external", ours, every(lambda k: forward(k, wrenches(k)))
    yield "inverse_dynamics", art.inverse_dynamics(rig, s.q, s.v, s.a), every(lambda k: inverse(k, None))
    ours = art.inverse_dynamics(rig, s.q, s.v, s.a, s.external)
    yield "inverse_dynamics, external", ours, every(lambda k: inverse(k, wrenches(k)))
    yield "mass_matrix", art.mass_matrix(rig, s.q), every(mass)
    theirs = every(lambda k: ref.tau(pin.nonLinearEffects(model, data, qs[k], vs[k])))
    yield "bias_forces", art.bias_forces(rig, s.q, s.v), theirs
    theirs = every(lambda k: ref.tau(pin.computeGeneralizedGravity(model, data, qs[k])))
    yield "gravity_forces", art.gravity_forces(rig, s.q), theirs

    def poses(k: int) -> Array:
        pin.framesForwardKinematics(model, data, qs[k])
        return np.array([data.oMf[ref.frame(name)].homogeneous for name in rig.links])

    def twists(k: int) -> Array:
        pin.forwardKinematics(model, data, qs[k], vs[k])
        pin.updateFramePlacements(model, data)
        return np.array([pin.getFrameVelocity(model, data, ref.frame(name), world).vector for name in rig.links])

    def jacobian(k: int, link: str, point: Array | None) -> Array:
        frame = ref.frame(link)
        J = pin.computeFrameJacobian(model, data, qs[k], frame, world).reshape(6, -1)  # a vector, if it has one column
        if point is not None:  # v_point = v + ω × r
            pin.framesForwardKinematics(model, data, qs[k])
            J[:3] -= pin.skew(data.oMf[frame].rotation @ point) @ J[3:]
        return J @ ref.G

    yield "link_poses", art.link_poses(rig, s.q), every(poses)
    yield "link_velocities", art.link_velocities(rig, s.q, s.v), every(twists)
    yield "jacobian", art.jacobian(rig, s.q, s.last), every(lambda k: jacobian(k, s.last.name, None))
    theirs = every(lambda k: jacobian(k, s.link.name, s.point))
    yield "jacobian, point", art.jacobian(rig, s.q, s.link, s.point), theirs
    if rig.mass > 0.0:
        yield "center_of_mass", art.center_of_mass(rig, s.q), every(lambda k: pin.centerOfMass(model, data, qs[k]))
        theirs = every(lambda k: pin.computeCentroidalMomentum(model, data, qs[k], vs[k]).vector)
        yield "momentum", art.momentum(rig, s.q, s.v), theirs
    rotors = 0.5 * (s.v * s.v) @ rig.armature
    theirs = every(lambda k: pin.computeKineticEnergy(model, data, qs[k], vs[k])) + rotors
    yield "kinetic_energy", art.kinetic_energy(rig, s.q, s.v), theirs
    theirs = every(lambda k: pin.computePotentialEnergy(model, data, qs[k]))
    yield "potential_energy", art.potential_energy(rig, s.q), theirs
    theirs = every(lambda k: pin.integrate(model, qs[k], vs[k]))
    ours = art.integrate(rig, s.q, s.v)
    yield "integrate", _same_sign(rig, ref, ours, theirs), theirs
    theirs = every(lambda k: np.linalg.lstsq(ref.G, pin.difference(model, qs[k], ref.q(s.q1[k])), rcond=None)[0])
    yield "difference", _wrapped(ref, art.difference(rig, s.q, s.q1)), _wrapped(ref, theirs)


def _same_sign(rig: Rig, ref: PinocchioModel, ours: Array, theirs: Array) -> Array:
    """Our configurations in Pinocchio's coordinates, each quaternion with the sign that Pinocchio gave it."""
    converted = np.array([ref.q(q) for q in ours])
    for name, joint in rig.joints.items():
        if joint.kind in ("ball", "floating"):
            end = ref.model.idx_qs[ref.model.getJointId(name)] + (4 if joint.kind == "ball" else 7)
            quat = converted[:, end - 4 : end]
            quat *= np.sign((quat * theirs[:, end - 4 : end]).sum(axis=1, keepdims=True))
    return converted


def _wrapped(ref: PinocchioModel, dv: Array) -> Array:
    """Differences with those angles in [-π, π) that Pinocchio keeps as (cos, sin)."""
    dv = dv.copy()
    for name, joint in ref.rig.joints.items():
        kind = ref.model.joints[ref.model.getJointId(name)].shortname()
        if not joint.mimic and ("RUB" in kind or "Unbounded" in kind):
            dv[:, joint.v_slice] = (dv[:, joint.v_slice] + np.pi) % (2 * np.pi) - np.pi
    return dv


def _joint_model(joint) -> Any:
    pin = need("pinocchio", "check")
    models = {
        "revolute": lambda: pin.JointModelRevoluteUnaligned(joint.axis),
        "continuous": lambda: pin.JointModelRevoluteUnaligned(joint.axis),  # its angle is unwrapped too
        "prismatic": lambda: pin.JointModelPrismaticUnaligned(joint.axis),
        "universal": lambda: pin.JointModelUniversal(joint.axis, joint.axis2),
        "ball": pin.JointModelSpherical,
        "planar": pin.JointModelPlanar,
        "floating": pin.JointModelFreeFlyer,
    }
    return models[joint.kind]()


def _inertia(link: Link) -> Any:
    """By its ten parameters about the link's origin: Pinocchio's other constructors refuse links that the rig only warns of."""
    pin = need("pinocchio", "check")
    m, c = link.mass, link.center
    if m == 0.0:  # these divide by the mass
        return pin.Inertia(m, c, link.inertia)
    I = link.inertia + m * (c @ c * np.eye(3) - np.outer(c, c))
    return pin.Inertia.FromDynamicParameters(np.array([m, *(m * c), I[0, 0], I[0, 1], I[1, 1], I[0, 2], I[1, 2], I[2, 2]]))


def _se3(pose: Array) -> Any:
    pin = need("pinocchio", "check")
    return pin.SE3(pose[:3, :3].copy(), pose[:3, 3].copy())
