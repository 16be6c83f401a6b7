"""The problem of a step built from mass matrices and Jacobians, and solved densely: nothing of it is the engine's own."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation

import articulated as art
from articulated.simulation.implicit.newton import BOUNDED
from articulated.simulation.implicit.problem import FASTEST_SAG
from articulated.simulation.implicit.terms import NEAR_RIGID, SIGMA, SLIP_SPEED


class Dense:
    """A step of one state of free rigs on the plane z = 0, for balls on links; and, with pairs, for what touches what else.

    `pairs` are (link, link or None, radius of the first, of the second, w): how round they are, and how much velocity an impulse
    gives; `touches` tells, for q, the gap, the normal and the point of each. Radius nan: a corner, a face.
    """

    def __init__(self, rig, points, material, h, kp, kd, target, limit, stops, before=0.0, pairs=(), touches=None):
        self.rig, self.points, self.material, self.h = rig, points, material, h
        self.before = before  # length of the last step, 0 if there was none
        self.kp, self.kd, self.target, self.limit, self.stops = kp, kd, target, limit, stops
        self.links, self.pairs, self.touches = list(rig.links.values()), pairs, touches
        q = rig.neutral()
        Minv = np.linalg.inv(art.mass_matrix(rig, q))
        self.w_joint = np.diag(Minv)
        J = [art.jacobian(rig, q, p.link, p.position)[:3] for p in points]
        self.w = np.array([np.linalg.norm(np.diag(j @ Minv @ j.T)) / np.sqrt(3.0) for j in J] + [pair[4] for pair in pairs])

    def earlier(self, q, v):
        """Configuration and velocities as the step before began; a free root's velocity stays the same in the world."""
        q_old, v_old = art.integrate(self.rig, q, -self.before * v), v.copy()
        X_old, X = (art.link_poses(self.rig, x) for x in (q_old, q))
        for joint in self.rig.joints.values():
            if joint.kind == "floating":
                k, s = self.rig.links[joint.child].index, joint.v_slice.start
                v_old[s : s + 3] = X_old[k, :3, :3].T @ X[k, :3, :3] @ v[s : s + 3]
        return q_old, v_old

    def momenta(self, q, v):
        """Σ Jᵀ (momentum of each link as it was before the last step, and what gravity adds)."""
        rig, h = self.rig, self.h
        q_old, v_old = self.earlier(q, v)
        X_old, V_old = art.link_poses(rig, q_old), art.link_velocities(rig, q_old, v_old)
        total, bodies = rig.armature * v, {}
        for link in self.links:
            if link.mass > 0.0 and link.body >= 0:
                bodies.setdefault(link.body, []).append(link)
        for parts in bodies.values():  # links that move as one: their common centre moves straight, their common spin stays
            at = [
                (link.mass, X_old[link.index, :3, :3], X_old[link.index, :3, :3] @ link.center + X_old[link.index, :3, 3])
                for link in parts
            ]
            mass = sum(m for m, _, _ in at)
            center = sum(m * c for m, _, c in at) / mass
            inertia = np.zeros((3, 3))
            for link, (m, R_WL, c) in zip(parts, at, strict=True):
                inertia += R_WL @ link.inertia @ R_WL.T + m * (
                    (c - center) @ (c - center) * np.eye(3) - np.outer(c - center, c - center)
                )
            first = parts[0]
            lin, ang = V_old[first.index].reshape(2, 3)
            momentum = mass * (lin + np.cross(ang, center - X_old[first.index, :3, 3]) + h * np.array(art.GRAVITY))
            point = X_old[first.index, :3, :3].T @ (center - X_old[first.index, :3, 3])
            total = total + art.jacobian(rig, q, first.name, point).T @ np.concatenate([momentum, inertia @ ang])
        return total

    def strayed(self, q, v):
        """How far a point of a link, given in its axes, strayed from a straight way in the step before: a function."""
        q_old, v_old = self.earlier(q, v)
        X_old, X, V_old = (
            art.link_poses(self.rig, q_old),
            art.link_poses(self.rig, q),
            art.link_velocities(self.rig, q_old, v_old),
        )

        def of(link, p):
            k = self.rig.links[link].index
            speed = V_old[k, :3] + np.cross(V_old[k, 3:], X_old[k, :3, :3] @ p)
            now, old = (Y[k, :3, :3] @ p + Y[k, :3, 3] for Y in (X, X_old))
            return now - old - self.before * speed

        return of

    def sites(self, q, v):
        """Of each contact the Jacobian along two tangents and the normal, the gap, and its sag."""
        X, strayed = art.link_poses(self.rig, q), self.strayed(q, v)

        def local(link, x):
            T = X[self.rig.links[link].index]
            return T[:3, :3].T @ (x - T[:3, 3])

        J, phi, sag = [], [], []
        for p in self.points:
            T = X[self.rig.links[p.link].index]
            center = T[:3, :3] @ p.position + T[:3, 3]
            J.append(art.jacobian(self.rig, q, p.link, local(p.link, center - [0.0, 0.0, p.radius]))[:3])
            phi.append(center[2] - p.radius)
            sag.append(strayed(p.link, np.array(p.position))[2])
        for (a, b, round_a, round_b, _), (gap, n, x) in zip(self.pairs, self.touches(q) if self.pairs else (), strict=True):
            E = np.linalg.svd(n[None])[2][[1, 2, 0]]
            E[2] = n
            row, stray = np.zeros((3, self.rig.nv)), np.zeros(3)
            for link, radius, sign in ((a, round_a, 1.0), (b, round_b, -1.0)):
                if link is not None:
                    row += sign * (E @ art.jacobian(self.rig, q, link, local(link, x))[:3])
                    stray += sign * strayed(link, local(link, x + sign * n * (0.5 * gap + radius)))
            J.append(row)
            phi.append(gap)
            sag.append(n @ stray)
        return np.array(J), np.array(phi), np.array(sag)

    def build(self, q, v):
        rig, h = self.rig, self.h
        self.A = art.mass_matrix(rig, q) + np.diag(h * rig.damping)
        self.p = self.momenta(q, v)
        e = art.difference(rig, q, self.target)
        self.c, self.b = h * self.kp * e, h * (self.kd + h * self.kp)
        if self.limit is None:
            self.A, self.p = self.A + np.diag(self.b), self.p + self.c
        self.J, self.phi, sag = self.sites(q, v)
        mass = np.minimum(h * h * self.material.stiffness, NEAR_RIGID / self.w)
        sag, d = np.maximum(sag, -FASTEST_SAG * self.before), self.material.dissipation
        self.hinges = -(self.phi + sag) * mass / h, mass, np.full(len(mass), d), 1.0 - d * sag / h
        self.room = None
        if self.stops is not None:
            at = {
                s: k
                for j in rig.joints.values()
                if j.nq == j.nv
                for s, k in zip(range(j.v_slice.start, j.v_slice.stop), range(j.q_slice.start, j.q_slice.stop), strict=True)
            }
            some = [s for s in at if np.isfinite(rig.lower[s]) or np.isfinite(rig.upper[s])]
            where = [at[s] for s in some]
            rows = [*np.eye(rig.nv)[some], *-np.eye(rig.nv)[some]]
            gaps = [*(q[where] - rig.lower[some]), *(rig.upper[some] - q[where])]
            felt = [*self.w_joint[some], *self.w_joint[some]]
            for joint in rig.joints.values():
                if joint.kind == "ball" and joint.limits.upper < np.pi:
                    turn = Rotation.from_quat(q[joint.q_slice]).as_rotvec()
                    row = np.zeros(rig.nv)
                    row[joint.v_slice] = -turn / np.linalg.norm(turn)
                    rows.append(row)
                    gaps.append(joint.limits.upper - np.linalg.norm(turn))
                    felt.append(self.w_joint[joint.v_slice].mean())
            mass = np.minimum(h * h * self.stops.stiffness, NEAR_RIGID) / np.array(felt)
            self.room = np.array(rows), (-np.array(gaps) * mass / h, mass, np.full(len(rows), self.stops.dissipation), 1.0)
        u = self.J @ v
        self.cone = self.material.friction * self.push(self.hinges, u[:, 2])[0]

    @staticmethod
    def push(hinge, u):
        a, b, d, one = hinge
        s, c = np.maximum(a - b * u, 0.0), np.maximum(one - d * u, 0.0)
        return s * c, b * c * (s > 0.0) + d * s * (c > 0.0)

    def terms(self, v, theta):
        """Σ Jᵀ g and Σ Jᵀ G J."""
        u = self.J @ v
        n, slope = self.push(self.hinges, u[:, 2])
        width = np.maximum(SIGMA * self.w * self.cone, SLIP_SPEED)
        size = np.linalg.norm(u[:, :2], axis=1)
        s = self.cone / np.maximum(size, width)
        t = u[:, :2] / np.maximum(size, 1e-300)[:, None]
        self.g = np.concatenate([s[:, None] * u[:, :2], -n[:, None]], axis=1)
        self.G = np.zeros((len(u), 3, 3))
        self.G[:, :2, :2] = s[:, None, None] * (
            np.eye(2) - theta * (size > width)[:, None, None] * t[:, :, None] * t[:, None, :]
        )
        self.G[:, 2, 2] = slope
        g, H = np.einsum("cij,ci->j", self.J, self.g), np.einsum("cia,cij,cjb->ab", self.J, self.G, self.J)
        if self.room is not None:
            rows, hinges = self.room
            push, slope = self.push(hinges, rows @ v)
            g -= rows.T @ push
            H += rows.T @ np.diag(slope) @ rows
        if self.limit is not None:
            most, wanted = self.limit * self.h, self.c - self.b * v
            free = np.abs(wanted) <= most
            g -= np.clip(wanted, -most, most)
            H += np.diag(np.where(free, self.b, (1.0 - theta) * self.b * most / np.where(free, 1.0, np.abs(wanted))))
        dry = self.rig.friction > 0.0
        most, size = self.h * self.rig.friction, np.abs(v)
        s = most / np.maximum(size, SLIP_SPEED)
        g += np.where(dry, s * v, 0.0)
        H += np.diag(np.where(dry, np.where(size > SLIP_SPEED, (1.0 - theta) * s, s), 0.0))
        return g, H

    def gradient(self, v):
        return self.A @ v - self.p + self.terms(v, 1.0)[0]

    def solve(self, q, v, sweeps=BOUNDED, cones=None):
        """The velocity at the end of the step, by Newton's method with an exact line search, after some bounded sweeps.

        These find the friction cones, unless they are given.
        """
        self.build(q, v)
        self.cone = self.cone if cones is None else cones
        for _ in range(min(sweeps, BOUNDED) if cones is None else 0):
            g, H = self.terms(v, 0.0)
            u, g_c, G_c = self.J @ v, self.g.copy(), self.G.copy()
            v = np.linalg.solve(self.A + H, self.p - g + H @ v)
            y = g_c + np.einsum("cij,cj->ci", G_c, self.J @ v - u)
            a, b, *_ = self.hinges
            un = (self.J @ v)[:, 2]
            stopping = np.where(self.push(self.hinges, un)[0] > 0.0, (a / b - un) / (1.0 / b + self.w), 0.0)
            self.cone = self.material.friction * np.where(y[:, 2] < 0.0, -y[:, 2], stopping)
        for _ in range(200):
            r = self.gradient(v)
            H = self.A + self.terms(v, 1.0)[1]
            step = -np.linalg.solve(H, r)
            if -(r @ step) < 1e-26 * max(v @ self.A @ v, 1e-6):
                return v
            low, high, alpha = 0.0, 1.0, 1.0
            if self.gradient(v + step) @ step > 0.0:
                for _ in range(60):
                    alpha = 0.5 * (low + high)
                    low, high = (alpha, high) if self.gradient(v + alpha * step) @ step < 0.0 else (low, alpha)
            v = v + alpha * step
        return v


def near_ground(rig, points, count, rng, reach=0.4, speed=1.0):
    """Random states in which the lowest point is within some millimetres of the ground."""
    q = rig.random(rng, count)
    neutral = rig.neutral()
    for joint in rig.joints.values():
        if joint.nq == 1:  # near its middle
            part = q[:, joint.q_slice]
            q[:, joint.q_slice] = np.clip(
                neutral[joint.q_slice] + reach * rng.normal(size=part.shape), joint.limits.lower, joint.limits.upper
            )
    X = art.link_poses(rig, q)
    z = np.array([(X[:, rig.links[p.link].index] @ [*p.position, 1.0])[:, 2] for p in points])
    q[:, 2] -= z.min(axis=0) - rng.uniform(-0.004, 0.001, count)
    v = speed * rng.normal(size=(count, rig.nv))
    v[:, 3:6] *= 2.0
    return q, v


def under_way(simulation, state):
    """The same states, as if a step had led to them."""
    memory = state.memory.copy()
    memory[..., simulation._world.layout.stance.before - (simulation.rig.nq + simulation.rig.nv + 1)] = simulation.dt
    return dataclasses.replace(state, memory=memory)
