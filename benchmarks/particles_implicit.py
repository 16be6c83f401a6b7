"""The cloth of `particles_cloth` with one linearised implicit Euler step (Baraff and Witkin, 1998): 30 iterations of conjugate
gradients, preconditioned by 3x3 blocks of the diagonal, whatever is left then.

All linearise where ours does, at x + h v and v, with blocks a I + b u uᵀ of springs that never pull them apart.
"""

from __future__ import annotations

import math

import numpy as np
from contenders import Contender, of_arrays, of_system
from particles_cloth import DRAG, MASS, Cloth, G
from scipy.sparse import bsr_array, coo_array

import articulated.particles as ap

H = 5e-3
ITERATIONS = 30


def ours_implicit_cloth(given: Cloth) -> Contender:
    """`System.step`."""
    system, method = given.system(), ap.ImplicitEuler(turns=1, iterations=ITERATIONS)
    return of_system(system, lambda: system.step(H, method))


def of_scipy(given: Cloth) -> Contender:
    """A matrix of 3x3 blocks in a pattern made once, its numbers by numpy, products by SciPy."""
    real, n, m = given.dtype, len(given.x), len(given.pairs)
    (i, j), (k, d, rest), free = given.pairs.T, given.springs, given.inverse > 0.0
    number, signs = np.repeat(np.arange(m), 2), np.tile([1.0, -1.0], m).astype(real)
    incidence = coo_array((signs, (number, given.pairs.ravel())), shape=(m, n)).tocsr()
    add_up, add_both = incidence.T.tocsr(), abs(incidence).T.tocsr()
    rows, columns = np.r_[i, j, np.arange(n)], np.r_[j, i, np.arange(n)]
    order = np.lexsort((columns, rows))
    starts = np.searchsorted(rows[order], np.arange(n + 1))
    between = (free[i] & free[j])[:, None, None]
    x, v, unit = given.x.copy(), given.v.copy(), np.eye(3, dtype=real)
    h, mass = real(H), np.where(free, real(MASS), real(0.0))[:, None]

    def step() -> None:
        there = x + h * v
        dx, dv = incidence @ there, incidence @ v
        length = np.sqrt(np.einsum("ij,ij->i", dx, dx))
        u = dx / length[:, None]
        across = h * h * k * np.maximum(1.0 - rest / length, 0.0)
        blocks = across[:, None, None] * unit
        blocks += (h * h * k - across + h * d)[:, None, None] * (u[:, :, None] * u[:, None, :])
        f = -(k * (length - rest) + d * np.einsum("ij,ij->i", u, dv))
        b = h * (add_up @ (u * f[:, None]) - real(DRAG) * v)
        b[:, 2] += h * real(G) * mass[:, 0]
        b[~free] = 0.0
        diagonal = (add_both @ blocks.reshape(m, 9)).reshape(n, 3, 3) + (mass + h * real(DRAG))[:, :, None] * unit
        diagonal[~free] = unit
        data = np.concatenate([-blocks * between, -blocks * between, diagonal])[order]
        matrix = bsr_array((data, columns[order], starts), shape=(3 * n, 3 * n))
        v[:] += _solved(matrix, b, np.linalg.inv(diagonal))
        x[:] += h * v

    return of_arrays(x, v, step)


def _solved(matrix: bsr_array, b: np.ndarray, inverses: np.ndarray) -> np.ndarray:
    x, r = np.zeros_like(b), b
    p = z = np.einsum("nij,nj->ni", inverses, r)
    rz = np.vdot(r, z)
    for _ in range(ITERATIONS):
        product = (matrix @ p.ravel()).reshape(-1, 3)
        alpha = rz / np.vdot(p, product)
        x, r = x + alpha * p, r - alpha * product
        z = np.einsum("nij,nj->ni", inverses, r)
        rz, before = np.vdot(r, z), rz
        p = z + (rz / before) * p
    return x


def of_numba(given: Cloth) -> Contender:
    """No matrix: four numbers of each spring, a and w = √b u; rows of four, springs in the order of their first particle."""
    import numba

    real, n, m = given.dtype, len(given.x), len(given.pairs)
    fast = {"fastmath": True, "error_model": "numpy"}
    h, drag, weight, mass, zero, one = map(real, (H, DRAG, G * MASS, MASS, 0.0, 1.0))
    begins = np.searchsorted(given.pairs[:, 0], np.arange(n + 1)).astype(np.int32)
    seconds = given.pairs[:, 1].astype(np.uint32)
    x, v, r, z, p, product, change = np.zeros((7, n, 4), real)
    blocks, springs = np.zeros((n, 6), real), np.zeros((m, 4), real)

    @numba.njit(**fast)
    def linearised(x, v, r, blocks, springs, inverse, begins, seconds, stiffness, damping, rest):
        r[:], blocks[:] = zero, zero
        for i in range(len(x)):
            for s in range(begins[i], begins[i + 1]):
                j = seconds[s]
                du, dv, dw = v[i, 0] - v[j, 0], v[i, 1] - v[j, 1], v[i, 2] - v[j, 2]
                dx, dy, dz = x[i, 0] - x[j, 0] + h * du, x[i, 1] - x[j, 1] + h * dv, x[i, 2] - x[j, 2] + h * dw
                length = math.sqrt(dx * dx + dy * dy + dz * dz)
                turn = one / length
                along = h * h * stiffness[s]
                a = along * max(one - rest[s] * turn, zero)
                pull = -h * turn * (stiffness[s] * (length - rest[s]) + damping[s] * turn * (dx * du + dy * dv + dz * dw))
                root = math.sqrt(along - a + h * damping[s]) * turn
                wx, wy, wz = root * dx, root * dy, root * dz
                springs[s, 0], springs[s, 1], springs[s, 2], springs[s, 3] = a, wx, wy, wz
                r[i, 0] += pull * dx
                r[i, 1] += pull * dy
                r[i, 2] += pull * dz
                r[j, 0] -= pull * dx
                r[j, 1] -= pull * dy
                r[j, 2] -= pull * dz
                for e in (i, np.int64(j)):
                    blocks[e, 0] += a + wx * wx
                    blocks[e, 1] += wx * wy
                    blocks[e, 2] += wx * wz
                    blocks[e, 3] += a + wy * wy
                    blocks[e, 4] += wy * wz
                    blocks[e, 5] += a + wz * wz
        for i in range(len(x)):
            if inverse[i] == zero:
                r[i] = zero
                blocks[i] = zero
                continue
            for c in range(3):
                r[i, c] -= h * drag * v[i, c]
            r[i, 2] += h * weight
            own = mass + h * drag
            a, b, c, d, e, f = blocks[i]
            a, d, f = a + own, d + own, f + own
            A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
            over = one / (a * A + b * B + c * C)
            blocks[i, 0], blocks[i, 1], blocks[i, 2] = A * over, B * over, C * over
            blocks[i, 3], blocks[i, 4], blocks[i, 5] = (a * f - c * c) * over, (b * c - a * e) * over, (a * d - b * b) * over

    @numba.njit(**fast)
    def multiplied(product, p, springs, inverse, begins, seconds):
        own, total = mass + h * drag, zero
        product[:] = zero
        for i in range(len(p)):
            x, y, z = p[i, 0], p[i, 1], p[i, 2]
            sx, sy, sz = product[i, 0] + own * x, product[i, 1] + own * y, product[i, 2] + own * z
            for s in range(begins[i], begins[i + 1]):
                j = seconds[s]
                a, wx, wy, wz = springs[s, 0], springs[s, 1], springs[s, 2], springs[s, 3]
                dx, dy, dz = x - p[j, 0], y - p[j, 1], z - p[j, 2]
                t = wx * dx + wy * dy + wz * dz
                dx, dy, dz = a * dx + t * wx, a * dy + t * wy, a * dz + t * wz
                sx, sy, sz = sx + dx, sy + dy, sz + dz
                product[j, 0] -= dx
                product[j, 1] -= dy
                product[j, 2] -= dz
            if inverse[i] == zero:
                sx = sy = sz = zero
            product[i, 0], product[i, 1], product[i, 2] = sx, sy, sz
            total += x * sx + y * sy + z * sz
        return total

    @numba.njit(**fast)
    def preconditioned(z, r, blocks):
        total = zero
        for i in range(len(z)):
            a, b, c, d, e, f = blocks[i, 0], blocks[i, 1], blocks[i, 2], blocks[i, 3], blocks[i, 4], blocks[i, 5]
            x, y, w = r[i, 0], r[i, 1], r[i, 2]
            z[i, 0], z[i, 1], z[i, 2] = a * x + b * y + c * w, b * x + d * y + e * w, c * x + e * y + f * w
            total += x * z[i, 0] + y * z[i, 1] + w * z[i, 2]
        return total

    @numba.njit(**fast)
    def advance(x, v, r, z, p, product, change, blocks, springs, inverse, begins, seconds, stiffness, damping, rest):
        linearised(x, v, r, blocks, springs, inverse, begins, seconds, stiffness, damping, rest)
        change[:] = zero
        rz = preconditioned(z, r, blocks)
        p[:] = z
        for _ in range(ITERATIONS):
            alpha = rz / multiplied(product, p, springs, inverse, begins, seconds)
            for i in range(len(x)):
                for c in range(4):
                    change[i, c] += alpha * p[i, c]
                    r[i, c] -= alpha * product[i, c]
            before = rz
            rz = preconditioned(z, r, blocks)
            beta = rz / before
            for i in range(len(x)):
                for c in range(4):
                    p[i, c] = z[i, c] + beta * p[i, c]
        for i in range(len(x)):
            for c in range(4):
                v[i, c] += change[i, c]
                x[i, c] += h * v[i, c]

    arrays = (x, v, r, z, p, product, change, blocks, springs, given.inverse, begins, seconds, *given.springs)
    return of_arrays(x, v, lambda: advance(*arrays))


CONTENDERS = {"System.step": ours_implicit_cloth, "numba": of_numba, "SciPy": of_scipy}
