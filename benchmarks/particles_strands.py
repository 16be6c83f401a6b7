"""A thousand strands of thirty particles that hang from their first: springs and weight, one linearised implicit Euler step.

Its equations have 3x3 blocks next to the diagonal only, and are solved exactly, from tip to root and back. All linearise where
ours does, at x + h v and v.

symbol   meaning
K        block of the spring to the particle before
D, r     block and right-hand side of a particle, with what those nearer to the tip hand down
y, T     D⁻¹ r, D⁻¹ K: its change is y + T times that of the particle before
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from contenders import Contender, of_arrays, of_system

import articulated.particles as ap
from articulated.compiler.scans import _Work
from articulated.particles.strands import bound_to

H, MASS, G, LENGTH = 5e-3, 1e-3, -9.81, 0.01
STIFFNESS, DAMPING = 100.0, 0.01
STRANDS, PARTICLES = 1000, 30


def problem(dtype: Any) -> tuple[np.ndarray, np.ndarray]:
    """Strands one after the other, a little crumpled, shape (n, 3)."""
    rng, number = np.random.default_rng(0), np.arange(PARTICLES)
    roots = np.stack([rng.uniform(-1, 1, STRANDS), rng.uniform(-1, 1, STRANDS), np.ones(STRANDS)], axis=1)
    x = roots[:, None] + LENGTH * number[:, None] * (0.8, 0.0, -0.6)
    x[:, 1:] += rng.normal(0.0, 0.05 * LENGTH, (STRANDS, PARTICLES - 1, 3))
    return x.reshape(-1, 3).astype(dtype), np.zeros((STRANDS * PARTICLES, 3), dtype)


def system(x: np.ndarray, v: np.ndarray) -> ap.System:
    number = np.arange(len(x)).reshape(STRANDS, PARTICLES)
    pairs = np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1)
    forces = [ap.Gravity((0.0, 0.0, G)), ap.Springs(pairs, STIFFNESS, DAMPING, LENGTH)]
    return ap.System(x, v, MASS, forces, pinned=number[:, 0])


def ours(x: np.ndarray, v: np.ndarray) -> Contender:
    """`System.step`."""
    strands, method = system(x, v), ap.ImplicitEuler(turns=1)
    return of_system(strands, lambda: strands.step(H, method))


def operations() -> list[tuple]:
    """What our kernel does in a step of a particle."""
    work = _Work.of(bound_to(system(*problem(float)), "step").strands.scan, False)
    return [one.nodes[i] for one in (work.inward[-1], work.outward) for i in one.order()]


def of_numpy(x: np.ndarray, v: np.ndarray) -> Contender:
    """All strands at once, particle by particle."""
    x, v = x.copy(), v.copy()
    X, V, real = x.reshape(STRANDS, PARTICLES, 3), v.reshape(STRANDS, PARTICLES, 3), x.dtype.type
    h, k, d, rest, mass, unit = real(H), real(STIFFNESS), real(DAMPING), real(LENGTH), real(MASS), np.eye(3, dtype=real)

    def step() -> None:
        there = X + h * V
        dx, dv = np.diff(there, axis=1), np.diff(V, axis=1)
        length = np.sqrt((dx * dx).sum(axis=-1))
        u = dx / length[..., None]
        f = h * u * (-(k * (length - rest) + d * (u * dv).sum(axis=-1)))[..., None]
        across = h * h * k * np.maximum(1.0 - rest / length, 0.0)
        K = across[..., None, None] * unit + (h * h * k - across + h * d)[..., None, None] * (u[..., :, None] * u[..., None, :])
        y, T = [None] * (PARTICLES - 1), [None] * (PARTICLES - 1)
        D, r = np.zeros((STRANDS, 3, 3), real), np.zeros((STRANDS, 3), real)
        for i in reversed(range(PARTICLES - 1)):
            D, r = D + K[:, i] + mass * unit, r + f[:, i]
            r[:, 2] += h * mass * real(G)
            solved = np.linalg.solve(D, np.concatenate([K[:, i], r[..., None]], axis=-1))
            T[i], y[i] = solved[..., :3], solved[..., 3]
            D, r = K[:, i] - K[:, i] @ T[i], -f[:, i] + (K[:, i] @ y[i][..., None])[..., 0]
        change = np.zeros((STRANDS, 3), real)
        for i in range(PARTICLES - 1):
            change = y[i] + (T[i] @ change[..., None])[..., 0]
            V[:, i + 1] += change
        X[:] += h * V

    return of_arrays(x, v, step)


def numba_laws(real: Any) -> tuple[Any, Any]:
    """What a particle hands down to the one before, and how it moves once that one does, over scalars."""
    import numba

    h, k, d, rest, mass, weight = map(real, (H, STIFFNESS, DAMPING, LENGTH, MASS, H * MASS * G))
    zero, one = real(0.0), real(1.0)

    def eliminated(dx, dy, dz, du, dv, dw, Dxx, Dxy, Dxz, Dyy, Dyz, Dzz, rx, ry, rz):
        dx, dy, dz = dx + h * du, dy + h * dv, dz + h * dw
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        turn = one / length
        x, y, z = turn * dx, turn * dy, turn * dz
        pull = -h * (k * (length - rest) + d * (x * du + y * dv + z * dw))
        a = h * h * k * max(one - rest * turn, zero)
        b = h * h * k - a + h * d
        bx, by, bz = b * x, b * y, b * z
        Kxx, Kxy, Kxz, Kyy, Kyz, Kzz = a + bx * x, bx * y, bx * z, a + by * y, by * z, a + bz * z
        Dxx, Dxy, Dxz, Dyy, Dyz, Dzz = Dxx + Kxx + mass, Dxy + Kxy, Dxz + Kxz, Dyy + Kyy + mass, Dyz + Kyz, Dzz + Kzz + mass
        rx, ry, rz = rx + pull * x, ry + pull * y, rz + pull * z + weight
        # D⁻¹ by cofactors
        Ixx, Ixy, Ixz = Dyy * Dzz - Dyz * Dyz, Dxz * Dyz - Dxy * Dzz, Dxy * Dyz - Dxz * Dyy
        over = one / (Dxx * Ixx + Dxy * Ixy + Dxz * Ixz)
        Ixx, Ixy, Ixz = Ixx * over, Ixy * over, Ixz * over
        Iyy, Iyz, Izz = (Dxx * Dzz - Dxz * Dxz) * over, (Dxy * Dxz - Dxx * Dyz) * over, (Dxx * Dyy - Dxy * Dxy) * over
        yx, yy, yz = Ixx * rx + Ixy * ry + Ixz * rz, Ixy * rx + Iyy * ry + Iyz * rz, Ixz * rx + Iyz * ry + Izz * rz
        Txx, Txy, Txz = Ixx * Kxx + Ixy * Kxy + Ixz * Kxz, Ixx * Kxy + Ixy * Kyy + Ixz * Kyz, Ixx * Kxz + Ixy * Kyz + Ixz * Kzz
        Tyx, Tyy, Tyz = Ixy * Kxx + Iyy * Kxy + Iyz * Kxz, Ixy * Kxy + Iyy * Kyy + Iyz * Kyz, Ixy * Kxz + Iyy * Kyz + Iyz * Kzz
        Tzx, Tzy, Tzz = Ixz * Kxx + Iyz * Kxy + Izz * Kxz, Ixz * Kxy + Iyz * Kyy + Izz * Kyz, Ixz * Kxz + Iyz * Kyz + Izz * Kzz
        Dxx, Dxy, Dxz = (
            Kxx - Kxx * Txx - Kxy * Tyx - Kxz * Tzx,
            Kxy - Kxx * Txy - Kxy * Tyy - Kxz * Tzy,
            Kxz - Kxx * Txz - Kxy * Tyz - Kxz * Tzz,
        )
        Dyy, Dyz, Dzz = (
            Kyy - Kxy * Txy - Kyy * Tyy - Kyz * Tzy,
            Kyz - Kxy * Txz - Kyy * Tyz - Kyz * Tzz,
            Kzz - Kxz * Txz - Kyz * Tyz - Kzz * Tzz,
        )
        rx = Kxx * yx + Kxy * yy + Kxz * yz - pull * x
        ry = Kxy * yx + Kyy * yy + Kyz * yz - pull * y
        rz = Kxz * yx + Kyz * yy + Kzz * yz - pull * z
        return yx, yy, yz, Txx, Txy, Txz, Tyx, Tyy, Tyz, Tzx, Tzy, Tzz, Dxx, Dxy, Dxz, Dyy, Dyz, Dzz, rx, ry, rz

    def moved(yx, yy, yz, Txx, Txy, Txz, Tyx, Tyy, Tyz, Tzx, Tzy, Tzz, x, y, z):
        return (
            yx + Txx * x + Txy * y + Txz * z,
            yy + Tyx * x + Tyy * y + Tyz * z,
            yz + Tzx * x + Tzy * y + Tzz * z,
        )

    return tuple(numba.njit(law, fastmath=True, error_model="numpy", forceinline=True) for law in (eliminated, moved))


def numba_strand_by_strand(x: np.ndarray, v: np.ndarray) -> Contender:
    """What is handed down stays in registers."""
    import numba

    real = x.dtype.type
    eliminated, moved = numba_laws(real)
    h, zero, n = real(H), real(0.0), PARTICLES
    x, v = x.copy(), v.copy()

    @numba.njit(fastmath=True, error_model="numpy")
    def advance(x, v, work):
        for first in range(0, len(x), n):
            Dxx = Dxy = Dxz = Dyy = Dyz = Dzz = rx = ry = rz = zero
            for i in range(n - 1, 0, -1):
                p, q, o = first + i, first + i - 1, work[i]
                (o[0], o[1], o[2], o[3], o[4], o[5], o[6], o[7], o[8], o[9], o[10], o[11],
                 Dxx, Dxy, Dxz, Dyy, Dyz, Dzz, rx, ry, rz) = eliminated(
                    x[p, 0] - x[q, 0], x[p, 1] - x[q, 1], x[p, 2] - x[q, 2],
                    v[p, 0] - v[q, 0], v[p, 1] - v[q, 1], v[p, 2] - v[q, 2],
                    Dxx, Dxy, Dxz, Dyy, Dyz, Dzz, rx, ry, rz,
                )  # fmt: skip
            a = b = c = zero
            for i in range(1, n):
                p, o = first + i, work[i]
                a, b, c = moved(o[0], o[1], o[2], o[3], o[4], o[5], o[6], o[7], o[8], o[9], o[10], o[11], a, b, c)
                v[p, 0] += a
                v[p, 1] += b
                v[p, 2] += c
                x[p, 0] += h * v[p, 0]
                x[p, 1] += h * v[p, 1]
                x[p, 2] += h * v[p, 2]

    work = np.zeros((PARTICLES, 12), real)
    return of_arrays(x, v, lambda: advance(x, v, work))


def numba_side_by_side(x: np.ndarray, v: np.ndarray) -> Contender:
    """As many strands as fill a register of 512 bits, their numbers side by side; what is known of a particle is in
    one array, in which loops see that nothing overlaps."""
    import numba

    real = x.dtype.type
    eliminated, moved = numba_laws(real)
    h, zero, n, L = real(H), real(0.0), PARTICLES, 64 // x.dtype.itemsize

    @numba.njit(fastmath=True, error_model="numpy")
    def advance(memory, work):
        here = np.empty(27 * L, work.dtype)  # of a particle: differences, what is handed down to it and by it, y and T
        for t in range(memory.shape[0] // (n * 6 * L)):
            tile, way = memory[t * n * 6 * L : (t + 1) * n * 6 * L], work[: 3 * L]
            here[:], way[:] = zero, zero
            for i in range(n - 1, 0, -1):
                p, q = tile[i * 6 * L : (i + 1) * 6 * L], tile[(i - 1) * 6 * L : i * 6 * L]
                for k in range(6 * L):
                    here[k] = p[k] - q[k]
                for k in range(L):
                    a, b = 6 * L + k, 15 * L + k
                    (here[b], here[b + L], here[b + 2 * L], here[b + 3 * L], here[b + 4 * L], here[b + 5 * L],
                     here[b + 6 * L], here[b + 7 * L], here[b + 8 * L], here[b + 9 * L], here[b + 10 * L], here[b + 11 * L],
                     here[a], here[a + L], here[a + 2 * L], here[a + 3 * L], here[a + 4 * L], here[a + 5 * L],
                     here[a + 6 * L], here[a + 7 * L], here[a + 8 * L]) = eliminated(
                        here[k], here[L + k], here[2 * L + k], here[3 * L + k], here[4 * L + k], here[5 * L + k],
                        here[a], here[a + L], here[a + 2 * L], here[a + 3 * L], here[a + 4 * L], here[a + 5 * L],
                        here[a + 6 * L], here[a + 7 * L], here[a + 8 * L],
                    )  # fmt: skip
                o = work[i * 12 * L : (i + 1) * 12 * L]
                for k in range(12 * L):
                    o[k] = here[15 * L + k]
            for i in range(1, n):
                p, o = tile[i * 6 * L : (i + 1) * 6 * L], work[i * 12 * L : (i + 1) * 12 * L]
                for k in range(L):
                    a, b, c = moved(
                        o[k], o[L + k], o[2 * L + k], o[3 * L + k], o[4 * L + k], o[5 * L + k], o[6 * L + k], o[7 * L + k],
                        o[8 * L + k], o[9 * L + k], o[10 * L + k], o[11 * L + k], way[k], way[L + k], way[2 * L + k],
                    )  # fmt: skip
                    way[k], way[L + k], way[2 * L + k] = a, b, c
                    a, b, c = p[3 * L + k] + a, p[4 * L + k] + b, p[5 * L + k] + c
                    p[3 * L + k], p[4 * L + k], p[5 * L + k] = a, b, c
                    p[k] += h * a
                    p[L + k] += h * b
                    p[2 * L + k] += h * c

    tiles = -(-STRANDS // L)
    memory, work = np.zeros(tiles * n * 6 * L, real), np.zeros(12 * n * L, real)
    rows = memory.reshape(tiles, n, 6, L)

    def start(x: np.ndarray, v: np.ndarray) -> None:
        both = np.concatenate([x, v], axis=1).reshape(STRANDS, n, 6)
        both = np.concatenate([both, both[: tiles * L - STRANDS]])
        rows[:] = both.reshape(tiles, L, n, 6).transpose(0, 2, 3, 1)

    def state() -> tuple[np.ndarray, np.ndarray]:
        both = rows.transpose(0, 3, 1, 2).reshape(-1, n, 6)[:STRANDS].reshape(-1, 6)
        return both[:, :3], both[:, 3:]

    return Contender(start, lambda: advance(memory, work), state)


CONTENDERS = {
    "System.step": ours,
    "numba, side by side": numba_side_by_side,
    "numba, strand by strand": numba_strand_by_strand,
    "numpy": of_numpy,
}
