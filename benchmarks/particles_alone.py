"""Particles that do not act on each other: a wind that turns, drag, and a ground that they bounce off and rub along.

Steps are semi-implicit. The work is written once for Warp, Taichi and numba, in `laws`, with what `collisions` of ours does
for a plane at z = 0: impacts at their time within the step, friction, and rest. numpy has it once more, on those that meet the
ground. Warp and Taichi meet the ground in a branch, ours where any particle of a register does, numba in all lanes: as is fastest for each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from contenders import Contender, of_system, taichi_for

import articulated.particles as ap
from articulated.compiler.straight import Straight
from articulated.compiler.streams import planes, stream_kernel
from articulated.particles import alone
from articulated.scalar import Scalar
from articulated.spatial import Vec3

H, G, DRAG = 1e-3, -9.81, 0.5
BLOW, SHEAR, SWIRL = 1.5, 0.3, 2.0
"""The wind is (BLOW + SHEAR z − q y, q x, 0) with q = SWIRL/(1 + x² + y²)."""
RESTITUTION, FRICTION = 0.6, 0.3
NEAR, LIFT, TINY = 1e-9, 1e-10, 1e-30
TILE = 64


def problem(count: int, dtype: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and reciprocals of masses that a format can hold."""
    rng = np.random.default_rng(0)
    x = rng.uniform((-2, -2, 0), (2, 2, 1), (count, 3))
    return x.astype(dtype), rng.normal(size=(count, 3)).astype(dtype), rng.uniform(0.5, 2.0, count).astype(dtype)


def wind(t: Scalar, x: Vec3) -> Vec3:
    q = SWIRL / (1.0 + x.x * x.x + x.y * x.y)
    return Vec3(BLOW + SHEAR * x.z - q * x.y, q * x.x, 0.0)


def system(x: np.ndarray, v: np.ndarray, inverse: np.ndarray) -> ap.System:
    return ap.System(
        x,
        v,
        1.0 / inverse,
        forces=[ap.Gravity((0.0, 0.0, G)), ap.Drag(DRAG, wind=wind)],
        colliders=[ap.Plane(restitution=RESTITUTION, friction=FRICTION)],
    )


def ours(x: np.ndarray, v: np.ndarray, inverse: np.ndarray, steps: int) -> Contender:
    """`System.step`."""
    particles = system(x, v, inverse)
    return of_system(particles, lambda: particles.step(H, "semi_implicit", steps=steps, threads=1))


def our_kernel(x: np.ndarray, v: np.ndarray, inverse: np.ndarray, steps: int) -> Contender:
    """Its machine code alone, on planes that stay where they are, as peers keep them; float64 or float32."""
    particles = system(x, v, inverse)
    kernel = stream_kernel(alone._stream(particles, "semi_implicit", 0), particles.single)
    memory = planes([*x.T, *v.T, particles.mass, inverse], x.dtype)
    arrays = [(plane, plane.itemsize, 0, None) for plane in (*memory, np.array([0.0, H], x.dtype))]
    return _of_planes(memory, len(x), lambda: kernel(arrays, memory.shape[1], 1, [steps], steps))


def operations() -> list[tuple]:
    """What our kernel does in a step of a particle that meets nothing."""
    stream = alone._stream(system(*problem(8, float)), "semi_implicit", 0)
    straight = Straight.of(lambda x: stream.turn(x[:6], x[6:8], x[8:]), 10, False)
    return [straight.nodes[i] for i in straight.order() if i not in straight.plan.guards]


def laws(real: Callable[[float], Any], root: Callable[[Any], Any]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Accelerations of a particle, and where a step ends that meets the ground, in a format's numbers."""
    h, g, drag, blow, shear, swirl = map(real, (H, G, DRAG, BLOW, SHEAR, SWIRL))
    restitution, friction, near, lift, tiny = map(real, (RESTITUTION, FRICTION, NEAR, LIFT, TINY))
    zero, half, one, two = map(real, (0.0, 0.5, 1.0, 2.0))

    def accelerations(x, y, z, u, v, w, inverse):
        rate = drag * inverse
        q = swirl / (one + x * x + y * y)
        return rate * (blow + shear * z - q * y - u), rate * (q * x - v), g - rate * w

    def grounded(x, y, z, u, v, w, ax, ay, az):
        way = h * (w + h * az)
        falls = z > near
        s = min((z - lift if falls else zero) / (-way if falls else one), one)
        rest = (one - s) * h
        x1, y1, z1 = x + s * h * (u + h * ax), y + s * h * (v + h * ay), z + s * way
        u1, v1, w1 = u + s * h * ax, v + s * h * ay, w + s * h * az
        late = half * h * az if z - z1 > near else zero
        incoming = max(-(w1 + late), zero)
        rubs = max(one - friction * (one + restitution) * incoming / root(max(u1 * u1 + v1 * v1, tiny)), zero)
        u1, v1 = rubs * u1, rubs * v1
        leaving = restitution * incoming
        stays = two * leaving <= -az * rest
        u2, v2 = u1 + ax * rest, v1 + ay * rest
        slides = max(one + friction * az * rest / root(max(u2 * u2 + v2 * v2, tiny)), zero)
        slides = slides if stays else one
        u2, v2 = slides * u2, slides * v2
        z2 = z1 if stays else z1 + (leaving + half * az * rest) * rest
        w2 = zero if stays else leaving + az * rest - late
        return x1 + half * rest * (u1 + u2), y1 + half * rest * (v1 + v2), z2 if z2 >= zero else lift, u2, v2, w2

    return accelerations, grounded


def of_numpy(x: np.ndarray, v: np.ndarray, inverse: np.ndarray, steps: int) -> Contender:
    """One step after the other; those that meet the ground are picked out."""
    memory = np.ascontiguousarray(np.concatenate([x, v], axis=1).T)
    X, V = memory[:3], memory[3:]
    rate = x.dtype.type(DRAG) * inverse

    def step() -> None:
        for _ in range(steps):
            q = SWIRL / (1.0 + X[0] * X[0] + X[1] * X[1])
            a = -rate * V
            a[0] += rate * (BLOW + SHEAR * X[2] - q * X[1])
            a[1] += rate * (q * X[0])
            a[2] += G
            way = H * (V[2] + H * a[2])
            (some,) = np.nonzero((X[2] + way <= NEAR) & (way < NEAR))
            met = _grounded(X[:, some], V[:, some], a[:, some])
            np.add(V, H * a, out=V)
            np.add(X, H * V, out=X)
            X[:, some], V[:, some] = met

    return _of_planes(memory, len(x), step)


def _grounded(x: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`laws`' `grounded` on arrays, shape (3, k)."""
    way, falls = H * (v + H * a), x[2] > NEAR
    s = np.minimum(np.where(falls, x[2] - LIFT, 0.0) / np.where(falls, -way[2], 1.0), 1.0)
    rest, at, speed = (1.0 - s) * H, x + s * way, v + s * H * a
    late = np.where(x[2] - at[2] > NEAR, 0.5 * H * a[2], 0.0)
    incoming = np.maximum(-(speed[2] + late), 0.0)
    along = _slowed(speed[:2], FRICTION * (1.0 + RESTITUTION) * incoming)
    leaving = RESTITUTION * incoming
    stays, drift = 2.0 * leaving <= -a[2] * rest, along + a[:2] * rest
    after = np.where(stays, _slowed(drift, -FRICTION * a[2] * rest), drift)
    z = np.where(stays, at[2], at[2] + (leaving + 0.5 * a[2] * rest) * rest)
    w = np.where(stays, 0.0, leaving + a[2] * rest - late)
    return np.stack([*(at[:2] + 0.5 * rest * (along + after)), np.where(z < 0.0, LIFT, z)]), np.stack([*after, w])


def _slowed(v: np.ndarray, by: np.ndarray) -> np.ndarray:
    return v * np.maximum(1.0 - by / np.sqrt(np.maximum((v * v).sum(axis=0), TINY)), 0.0)


def of_numba(x: np.ndarray, v: np.ndarray, inverse: np.ndarray, steps: int) -> Contender:
    """Tiles of 64 particles, in each the seven numbers of all its particles one after the other: loops over them have a known
    length and cannot overlap, so that LLVM fills registers of 512 bits. All steps of a tile are taken in the first cache.
    """
    import numba

    fast = {"fastmath": True, "error_model": "numpy"}
    real = x.dtype.type
    accelerations, grounded = (numba.njit(law, forceinline=True, **fast) for law in laws(real, math.sqrt))
    h, near, T = real(H), real(NEAR), TILE

    @numba.njit(**fast)
    def advance(memory, steps):
        for t in range(len(memory) // (7 * T)):
            tile = memory[t * 7 * T : (t + 1) * 7 * T]
            for _ in range(steps):
                for i in range(T):
                    x, y, z = tile[i], tile[T + i], tile[2 * T + i]
                    u, v, w = tile[3 * T + i], tile[4 * T + i], tile[5 * T + i]
                    ax, ay, az = accelerations(x, y, z, u, v, w, tile[6 * T + i])
                    x2, y2, z2, u2, v2, w2 = grounded(x, y, z, u, v, w, ax, ay, az)
                    u, v, w = u + h * ax, v + h * ay, w + h * az
                    hits = (z + h * w <= near) & (h * w < near)
                    tile[i] = x2 if hits else x + h * u
                    tile[T + i] = y2 if hits else y + h * v
                    tile[2 * T + i] = z2 if hits else z + h * w
                    tile[3 * T + i] = u2 if hits else u
                    tile[4 * T + i] = v2 if hits else v
                    tile[5 * T + i] = w2 if hits else w

    count = -(-len(x) // TILE)
    memory = np.ones(7 * TILE * count, x.dtype)
    tiles = memory.reshape(count, 7, TILE)

    def start(x: np.ndarray, v: np.ndarray) -> None:
        rows = np.ones((7, count * TILE), real)
        rows[:, : len(x)] = [*x.T, *v.T, inverse]
        tiles[:] = rows.reshape(7, count, TILE).transpose(1, 0, 2)

    def state() -> tuple[np.ndarray, np.ndarray]:
        rows = tiles.transpose(1, 0, 2).reshape(7, -1)[:6, : len(x)]
        return rows[:3].T, rows[3:].T

    return Contender(start, lambda: advance(memory, steps), state)


def of_warp(x: np.ndarray, v: np.ndarray, inverse: np.ndarray, steps: int) -> Contender:
    """One kernel for all steps, its launch recorded; a plane for each number."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    real = wp.float32 if x.dtype == np.float32 else wp.float64

    def typed(law: Callable[..., Any]) -> Any:
        law.__annotations__ = dict.fromkeys(law.__code__.co_varnames[: law.__code__.co_argcount], real)
        return wp.func(law)

    accelerations, grounded = map(typed, laws(real, wp.sqrt))
    h, near = real(H), real(NEAR)

    def advance(X, Y, Z, U, V, W, M, steps):
        i = wp.tid()
        x = X[i]
        y = Y[i]
        z = Z[i]
        u = U[i]
        v = V[i]
        w = W[i]
        for _ in range(steps):
            ax, ay, az = accelerations(x, y, z, u, v, w, M[i])
            way = h * (w + h * az)
            if z + way <= near and way < near:
                x, y, z, u, v, w = grounded(x, y, z, u, v, w, ax, ay, az)
            else:
                u = u + h * ax
                v = v + h * ay
                w = w + h * az
                x = x + h * u
                y = y + h * v
                z = z + way
        X[i] = x
        Y[i] = y
        Z[i] = z
        U[i] = u
        V[i] = v
        W[i] = w

    advance.__annotations__ = {**dict.fromkeys("XYZUVWM", wp.array(dtype=real)), "steps": int}
    kernel = wp.kernel(advance, enable_backward=False, module="unique")
    arrays = [wp.array(np.ascontiguousarray(c), dtype=real, device="cpu") for c in (*x.T, *v.T, inverse)]
    launch = wp.launch(kernel, dim=len(x), inputs=[*arrays, steps], device="cpu", record_cmd=True)
    return _of_planes([a.numpy() for a in arrays], len(x), launch.launch)


def of_taichi(x: np.ndarray, v: np.ndarray, inverse: np.ndarray, steps: int) -> Contender:
    """One kernel for all steps; a field for each number, the numbers of neighbours side by side."""
    ti = taichi_for(x.dtype)
    real = ti.f32 if x.dtype == np.float32 else ti.f64
    accelerations, grounded = (ti.func(law) for law in laws(float, ti.sqrt))
    fields = [ti.field(real, len(x)) for _ in range(7)]
    X, Y, Z, U, V, W, M = fields

    def advance(steps):
        for i in X:
            x, y, z, u, v, w = X[i], Y[i], Z[i], U[i], V[i], W[i]
            for _ in range(steps):
                ax, ay, az = accelerations(x, y, z, u, v, w, M[i])
                way = H * (w + H * az)
                if z + way <= NEAR and way < NEAR:
                    x, y, z, u, v, w = grounded(x, y, z, u, v, w, ax, ay, az)
                else:
                    u += H * ax
                    v += H * ay
                    w += H * az
                    x += H * u
                    y += H * v
                    z += way
            X[i], Y[i], Z[i], U[i], V[i], W[i] = x, y, z, u, v, w

    advance.__annotations__ = {"steps": ti.i32}
    kernel = ti.kernel(advance)
    M.from_numpy(inverse)

    def start(x: np.ndarray, v: np.ndarray) -> None:
        for field, column in zip(fields, (*x.T, *v.T), strict=False):
            field.from_numpy(np.ascontiguousarray(column))

    def state() -> tuple[np.ndarray, np.ndarray]:
        columns = np.stack([field.to_numpy() for field in fields], axis=1)
        return columns[:, :3], columns[:, 3:6]

    return Contender(start, lambda: kernel(steps), state)


def _of_planes(memory: Sequence[np.ndarray], count: int, step: Callable[[], object]) -> Contender:
    """One whose six numbers of a particle are each in an array of its own."""

    def start(x: np.ndarray, v: np.ndarray) -> None:
        for plane, column in zip(memory, (*x.T, *v.T), strict=False):
            plane[:count] = column

    def state() -> tuple[np.ndarray, np.ndarray]:
        columns = np.stack([plane[:count] for plane in memory[:6]], axis=1)
        return columns[:, :3], columns[:, 3:]

    return Contender(start, step, state)


CONTENDERS = {
    "System.step": ours,
    "our kernel": our_kernel,
    "numba": of_numba,
    "Warp": of_warp,
    "Taichi": of_taichi,
    "numpy": of_numpy,
}
PEERS = ["numba", "Warp", "Taichi", "numpy"]
