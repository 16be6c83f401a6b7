"""Cloth of n x n particles that hangs by two corners: springs along threads, across squares, and over two squares.

Steps are semi-implicit. All take any springs: who uses that they lie in a grid would do other work. Springs are sorted by their
first particle. Tried for numba and slower: each particle gathering from its twelve neighbours, in registers of 512 bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from contenders import Contender, of_arrays, of_system, taichi_for
from scipy.sparse import coo_array

import articulated.particles as ap

H, MASS, G, DRAG, SPACING = 2e-4, 1e-3, -9.81, 1e-4, 0.02
STIFFNESS, DAMPING = (200.0, 100.0, 40.0), (0.02, 0.01, 0.005)
"""Of threads, of diagonals, and against bending."""
STEPS = 10
TILE = 32


@dataclass(frozen=True)
class Cloth:
    """What all are given.

    Attributes:
        x, v: shape (n, 3) [m, m/s].
        inverse: of masses, shape (n,); zero for what is pinned.
        pairs: shape (m, 2).
        springs: stiffness, damping and rest length, shape (3, m).
        dtype: what contenders compute in.
    """

    x: np.ndarray
    v: np.ndarray
    inverse: np.ndarray
    pairs: np.ndarray
    springs: np.ndarray
    dtype: Any

    def system(self) -> ap.System:
        k, d, rest = self.springs.astype(float)
        forces = [ap.Gravity((0.0, 0.0, G)), ap.Drag(DRAG), ap.Springs(self.pairs, k, d, rest)]
        return ap.System(self.x, self.v, MASS, forces, pinned=self.inverse == 0.0)


def cloth(side: int, dtype: Any) -> Cloth:
    """A little stretched and crumpled."""
    rng, number = np.random.default_rng(0), np.arange(side * side).reshape(side, side)
    pairs, kinds = [], []
    for down, over, kind in ((0, 1, 0), (1, 0, 0), (1, 1, 1), (1, -1, 1), (0, 2, 2), (2, 0, 2)):
        some = number[: side - down, max(0, -over) : side - max(0, over)]
        other = number[down:, max(0, over) : side + min(0, over)]
        pairs.append(np.stack([some.ravel(), other.ravel()], axis=1))
        kinds.append(np.full(some.size, kind))
    joined, kind = np.concatenate(pairs), np.concatenate(kinds)
    order = np.argsort(joined[:, 0], kind="stable")
    joined, kind = joined[order], kind[order]
    flat = np.stack([number % side, number // side, 0 * number], axis=-1).reshape(-1, 3) * SPACING
    rest = np.linalg.norm(flat[joined[:, 0]] - flat[joined[:, 1]], axis=1)
    x, v = 1.001 * flat + rng.normal(size=flat.shape) * (0.0, 0.0, 1e-3), rng.normal(0.0, 0.01, flat.shape)
    inverse = np.full(len(x), 1.0 / MASS)
    inverse[[0, side - 1]], v[[0, side - 1]] = 0.0, 0.0
    springs = np.stack([np.take(STIFFNESS, kind), np.take(DAMPING, kind), rest])
    return Cloth(x.astype(dtype), v.astype(dtype), inverse.astype(dtype), joined, springs.astype(dtype), dtype)


def ours(given: Cloth) -> Contender:
    """`System.step`."""
    system = given.system()
    return of_system(system, lambda: system.step(H, "semi_implicit", steps=STEPS, threads=1))


def of_numpy(given: Cloth) -> Contender:
    """Forces added up by `np.add.at`."""
    (i, j), total = given.pairs.T, np.empty_like(given.x)

    def add_up(f: np.ndarray) -> np.ndarray:
        total[:] = 0.0
        np.add.at(total, i, f)
        np.subtract.at(total, j, f)
        return total

    return _in_numpy(given, lambda x: x[i] - x[j], add_up)


def of_scipy(given: Cloth) -> Contender:
    """Differences and sums by products with the incidence matrix."""
    (m, _), n = given.pairs.shape, len(given.x)
    number, signs = np.repeat(np.arange(m), 2), np.tile([1.0, -1.0], m).astype(given.dtype)
    incidence = coo_array((signs, (number, given.pairs.ravel())), shape=(m, n)).tocsr()
    transpose = incidence.T.tocsr()
    return _in_numpy(given, lambda x: incidence @ x, lambda f: transpose @ f)


def _in_numpy(given: Cloth, differences: Any, add_up: Any) -> Contender:
    x, v, (k, d, rest) = given.x.copy(), given.v.copy(), given.springs
    weight = (np.array([0.0, 0.0, G * MASS]) * (given.inverse > 0.0)[:, None]).astype(given.dtype)
    gain = given.dtype(H) * given.inverse[:, None]

    def step() -> None:
        for _ in range(STEPS):
            dx, dv = differences(x), differences(v)
            length = np.sqrt(np.einsum("ij,ij->i", dx, dx))
            f = -(k * (length - rest) + d * np.einsum("ij,ij->i", dx, dv) / length) / length
            v[:] += gain * (weight - DRAG * v + add_up(dx * f[:, None]))
            x[:] += H * v

    return of_arrays(x, v, step)


def numba_scattered(given: Cloth) -> Contender:
    """Rows of four numbers; a particle's sum stays in registers while springs that begin at it are gone through."""
    import numba

    real, n = given.dtype, len(given.x)
    h, weight, drag, one = real(H), real(G * MASS), real(DRAG), real(1.0)
    begins = np.searchsorted(given.pairs[:, 0], np.arange(n + 1)).astype(np.int32)
    seconds = given.pairs[:, 1].astype(np.uint32)
    x, v, f = np.zeros((3, n, 4), real)

    @numba.njit(fastmath=True, error_model="numpy")
    def advance(x, v, f, inverse, begins, seconds, stiffness, damping, rest, steps):
        for _ in range(steps):
            f[:] = 0.0
            for i in range(len(x)):
                px, py, pz, pu, pv, pw = x[i, 0], x[i, 1], x[i, 2], v[i, 0], v[i, 1], v[i, 2]
                fx, fy, fz = f[i, 0] - drag * pu, f[i, 1] - drag * pv, f[i, 2] - drag * pw + weight
                for s in range(begins[i], begins[i + 1]):
                    j = seconds[s]
                    dx, dy, dz = px - x[j, 0], py - x[j, 1], pz - x[j, 2]
                    along = dx * (pu - v[j, 0]) + dy * (pv - v[j, 1]) + dz * (pw - v[j, 2])
                    length = math.sqrt(dx * dx + dy * dy + dz * dz)
                    turn = one / length
                    pull = -(stiffness[s] * (length - rest[s]) + damping[s] * along * turn) * turn
                    fx, fy, fz = fx + pull * dx, fy + pull * dy, fz + pull * dz
                    f[j, 0] -= pull * dx
                    f[j, 1] -= pull * dy
                    f[j, 2] -= pull * dz
                f[i, 0], f[i, 1], f[i, 2] = fx, fy, fz
            for i in range(len(x)):
                for c in range(3):
                    v[i, c] += h * inverse[i] * f[i, c]
                    x[i, c] += h * v[i, c]

    return of_arrays(x, v, lambda: advance(x, v, f, given.inverse, begins, seconds, *given.springs, STEPS))


def numba_tiled(given: Cloth) -> Contender:
    """Springs in tiles of 32: differences are gathered into planes, laws fill registers of 512 bits, forces are scattered."""
    import numba

    real, (n, m), T = given.dtype, (len(given.x), len(given.pairs)), TILE
    h, weight, drag, one = real(H), real(G * MASS), real(DRAG), real(1.0)
    room = -(-m // T) * T
    pairs = np.full((room, 2), (n, n + 1))
    pairs[:m] = given.pairs
    i, j = np.ascontiguousarray(pairs.T.astype(np.uint32))
    springs = np.zeros((3, room), real)
    springs[:, :m] = given.springs
    state, f, inverse = np.zeros((n + 2, 8), real), np.zeros((n + 2, 4), real), np.append(given.inverse, np.zeros(2, real))
    state[n + 1, 0] = 1.0  # what fills up tiles is between two particles of its own

    @numba.njit(fastmath=True, error_model="numpy")
    def advance(state, f, inverse, first, second, stiffness, damping, rest, steps):
        seen, done = np.zeros(6 * T, inverse.dtype), np.zeros(3 * T, inverse.dtype)
        for _ in range(steps):
            for p in range(len(state)):
                f[p, 0], f[p, 1], f[p, 2] = -drag * state[p, 4], -drag * state[p, 5], weight - drag * state[p, 6]
            for t in range(0, len(first), T):
                for s in range(T):
                    a, b = first[t + s], second[t + s]
                    for c in range(3):
                        seen[c * T + s] = state[a, c] - state[b, c]
                        seen[(3 + c) * T + s] = state[a, 4 + c] - state[b, 4 + c]
                ks, kd, r = stiffness[t : t + T], damping[t : t + T], rest[t : t + T]
                for s in range(T):
                    dx, dy, dz = seen[s], seen[T + s], seen[2 * T + s]
                    along = dx * seen[3 * T + s] + dy * seen[4 * T + s] + dz * seen[5 * T + s]
                    length = math.sqrt(dx * dx + dy * dy + dz * dz)
                    turn = one / length
                    pull = -(ks[s] * (length - r[s]) + kd[s] * along * turn) * turn
                    done[s], done[T + s], done[2 * T + s] = pull * dx, pull * dy, pull * dz
                for s in range(T):
                    a, b = first[t + s], second[t + s]
                    for c in range(3):
                        f[a, c] += done[c * T + s]
                        f[b, c] -= done[c * T + s]
            for p in range(len(state)):
                for c in range(3):
                    state[p, 4 + c] += h * inverse[p] * f[p, c]
                    state[p, c] += h * state[p, 4 + c]

    contender = of_arrays(state, state[:, 4:], lambda: advance(state, f, inverse, i, j, *springs, STEPS))
    return Contender(contender.start, contender.step, lambda: tuple(part[:n] for part in contender.state()))


def of_warp(given: Cloth) -> Contender:
    """A kernel for springs, which adds to sums in memory, and one for particles; launches recorded."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    real, vector = (wp.float32, wp.vec3f) if given.dtype is np.float32 else (wp.float64, wp.vec3d)
    h, drag, weight = real(H), real(DRAG), vector(0.0, 0.0, G * MASS)

    def pull(x, v, f, pairs, stiffness, damping, rest):
        s = wp.tid()
        i = pairs[s, 0]
        j = pairs[s, 1]
        d = x[i] - x[j]
        length = wp.length(d)
        u = d / length
        force = u * (-(stiffness[s] * (length - rest[s]) + damping[s] * wp.dot(v[i] - v[j], u)))
        wp.atomic_add(f, i, force)
        wp.atomic_sub(f, j, force)

    def advance(x, v, f, inverse):
        i = wp.tid()
        v[i] = v[i] + (f[i] + weight - v[i] * drag) * (h * inverse[i])
        x[i] = x[i] + v[i] * h
        f[i] = vector()

    rows, numbers = wp.array(dtype=vector), wp.array(dtype=real)
    springs = {"pairs": wp.array2d(dtype=int), **dict.fromkeys(("stiffness", "damping", "rest"), numbers)}
    pull.__annotations__ = {**dict.fromkeys("xvf", rows), **springs}
    advance.__annotations__ = {**dict.fromkeys("xvf", rows), "inverse": numbers}
    x, v, f = (wp.zeros(len(given.x), dtype=vector, device="cpu") for _ in range(3))
    constants = [wp.array(c, dtype=real, device="cpu") for c in (*given.springs, given.inverse)]
    pairs = wp.array(given.pairs.astype(np.int32), dtype=int, device="cpu")
    kernels = [wp.kernel(function, enable_backward=False, module="unique") for function in (pull, advance)]
    launches = [
        wp.launch(kernels[0], len(given.pairs), [x, v, f, pairs, *constants[:3]], device="cpu", record_cmd=True),
        wp.launch(kernels[1], len(given.x), [x, v, f, constants[3]], device="cpu", record_cmd=True),
    ]
    f.zero_()

    def step() -> None:
        for _ in range(STEPS):
            for launch in launches:
                launch.launch()

    return of_arrays(x.numpy(), v.numpy(), step)


def of_taichi(given: Cloth) -> Contender:
    """One kernel: a loop over springs, which adds to sums in memory, and one over particles."""
    ti = taichi_for(given.dtype)
    real, n, m = (ti.f32 if given.dtype is np.float32 else ti.f64), len(given.x), len(given.pairs)
    x, v, f = (ti.Vector.field(3, real, n) for _ in range(3))
    pairs, inverse = ti.Vector.field(2, ti.i32, m), ti.field(real, n)
    stiffness, damping, rest = fields = [ti.field(real, m) for _ in range(3)]

    def advance():
        for s in pairs:
            i, j = pairs[s][0], pairs[s][1]
            d = x[i] - x[j]
            length = d.norm()
            u = d / length
            force = u * -(stiffness[s] * (length - rest[s]) + damping[s] * (v[i] - v[j]).dot(u))
            f[i] += force
            f[j] -= force
        for i in x:
            v[i] += (f[i] - DRAG * v[i] + ti.Vector([0.0, 0.0, G * MASS])) * (H * inverse[i])
            x[i] += H * v[i]
            f[i] = ti.Vector([0.0, 0.0, 0.0])

    kernel = ti.kernel(advance)
    pairs.from_numpy(given.pairs.astype(np.int32))
    for field, values in zip((inverse, *fields), (given.inverse, *given.springs), strict=True):
        field.from_numpy(values)

    def start(x0: np.ndarray, v0: np.ndarray) -> None:
        x.from_numpy(x0)
        v.from_numpy(v0)

    def step() -> None:
        for _ in range(STEPS):
            kernel()

    return Contender(start, step, lambda: (x.to_numpy(), v.to_numpy()))


CONTENDERS = {
    "System.step": ours,
    "numba, scattering": numba_scattered,
    "numba, in tiles": numba_tiled,
    "Warp": of_warp,
    "Taichi": of_taichi,
    "SciPy": of_scipy,
    "numpy": of_numpy,
}
