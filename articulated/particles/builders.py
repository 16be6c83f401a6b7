"""Ropes and cloth: where particles are, how heavy, and what acts between them, from what a material is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from articulated.particles.check import at_least_two, elements, in_range, numbers, positive, vector
from articulated.particles.forces.bending import Bending, hinge_weights
from articulated.particles.forces.force import Law
from articulated.particles.forces.springs import Springs

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class Fabric:
    """Particles that hang together, as `System` takes them.

    Attributes:
        x: where they are at rest, shape (n, 3) [m].
        mass: shape (n,) [kg].
        forces: what acts between them.
        triangles: between which of them there is cloth, shape (m, 3); none in a rope.
    """

    x: np.ndarray
    mass: np.ndarray
    forces: tuple[Law, ...]
    triangles: np.ndarray


def rope(
    start: Any,
    end: Any,
    particles: int,
    mass: float,
    stiffness: float,
    bending: float = 0.0,
    damping: float = 0.0,
) -> Fabric:
    """A straight rope; in a system of its own, or with others of as many particles, implicit steps solve it exactly.

    Args:
        start, end: shape (3,) [m].
        particles: how many, 2 or more.
        mass: of all of it [kg].
        stiffness: E A: the force that would make it twice as long [N].
        bending: E I: the couple that bends it, times the radius of the bend [N m²].
        damping: of stretching: the force at a strain rate of one [N s].

    Raises:
        ValueError: it has no length, or too few particles, or a number makes no sense.
    """
    a, b = vector("rope: start", start), vector("rope: end", end)
    count = at_least_two("rope: particles", particles)
    step = float(np.linalg.norm(b - a)) / (count - 1)
    if not step > 0.0:
        raise ValueError("rope: start and end are in one place; give it a length")
    forces = along_strands("rope", np.arange(count)[None], step, stiffness, bending, damping)
    masses = positive("rope: mass", mass) * shares(count)
    return Fabric(np.linspace(a, b, count), masses, tuple(forces), np.zeros((0, 3), dtype=np.int64))


def shares(count: int) -> np.ndarray:
    """Of a strand's mass, what each of so many particles has: the ends half."""
    parts = np.full(count, 1.0 / (count - 1))
    parts[[0, -1]] *= 0.5
    return parts


def along_strands(
    name: str, number: np.ndarray, step: float | np.ndarray, stiffness: float, bending: float, damping: float
) -> list[Law]:
    """What acts along strands of the particles `number`, shape (k, n), a `step` apart: one for all, or each its own, (k,)."""
    n = number.shape[1]
    stiffness, damping = positive(f"{name}: stiffness", stiffness), positive(f"{name}: damping", damping, zero=True)
    length = np.repeat(step, n - 1) if np.ndim(step) else step
    pairs = np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1)
    forces: list[Law] = [Springs(pairs, stiffness / length, damping / length, length)]
    if positive(f"{name}: bending", bending, zero=True) > 0.0 and n > 2:
        triples = np.stack([number[:, :-2], number[:, 1:-1], number[:, 2:]], axis=-1).reshape(-1, 3)
        stiff = bending / step**3
        forces.append(Bending(triples, np.repeat(stiff, n - 2) if np.ndim(step) else stiff))
    return forces


def grid_cloth(
    corner: Any,
    along: Any,
    across: Any,
    rows: int,
    columns: int,
    density: float,
    stretch: float,
    shear: float | None = None,
    bending: float = 0.0,
    damping: float = 0.0,
) -> Fabric:
    """A rectangle of cloth; particle r columns + c is in row r and column c.

    Args:
        corner: of the first particle, shape (3,) [m].
        along, across: from there to the ends of the first column and of the first row, shape (3,) [m].
        rows, columns: of particles, 2 or more each.
        density: mass of an area [kg/m²].
        stretch: of its threads: the force on a width that would make them twice as long [N/m].
        shear: the same of diagonals [N/m]; None is a tenth of that.
        bending: the couple on a width that bends it, times the radius of the bend [N m].
        damping: of all springs, as a part of their stiffness [s].

    Raises:
        ValueError: it has no area, or too few particles, or a number makes no sense.
    """
    origin, u, v = (vector(f"grid_cloth: {name}", x) for name, x in (("corner", corner), ("along", along), ("across", across)))
    r, c = at_least_two("grid_cloth: rows", rows), at_least_two("grid_cloth: columns", columns)
    if not np.linalg.norm(np.cross(u, v)) > 1e-9 * np.linalg.norm(u) * np.linalg.norm(v):
        raise ValueError("grid_cloth: along and across have one direction, or none; expected the sides of a rectangle")
    i, j = np.unravel_index(np.arange(r * c), (r, c))
    x = origin + np.outer(i / (r - 1), u) + np.outer(j / (c - 1), v)
    number = np.arange(r * c).reshape(r, c)
    a, b, d, e = (part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[:-1, 1:], number[1:, 1:]))
    odd = (np.add(*np.unravel_index(a, (r, c))) % 2).astype(bool)[:, None]  # diagonals alternate: cloth has no grain
    triangles = np.concatenate(
        [
            np.where(odd, np.stack([a, b, d], 1), np.stack([a, b, e], 1)),
            np.where(odd, np.stack([e, d, b], 1), np.stack([a, e, d], 1)),
        ]
    )
    stretch, damping = positive("grid_cloth: stretch", stretch), positive("grid_cloth: damping", damping, zero=True)
    shear = 0.1 * stretch if shear is None else positive("grid_cloth: shear", shear, zero=True)
    high, wide = float(np.linalg.norm(u)) / (r - 1), float(np.linalg.norm(v)) / (c - 1)
    down, over = (np.stack([p.ravel(), q.ravel()], 1) for p, q in ((number[:-1], number[1:]), (number[:, :-1], number[:, 1:])))
    diagonal = np.concatenate([np.stack([a, e], 1), np.stack([b, d], 1)])
    # threads at the border have half a width
    of_down = stretch * wide / high * np.where((down[:, 0] % c == 0) | (down[:, 0] % c == c - 1), 0.5, 1.0)
    of_over = stretch * high / wide * np.where((over[:, 0] < c) | (over[:, 0] >= (r - 1) * c), 0.5, 1.0)
    stiffness = np.concatenate([of_down, of_over, np.full(len(diagonal), shear)])
    springs = Springs(np.concatenate([down, over, diagonal]), stiffness, damping * stiffness)
    return _cloth(x, triangles, springs, density, bending, "grid_cloth")


def mesh_cloth(mesh: trimesh.Trimesh, density: float, stretch: float, bending: float = 0.0, damping: float = 0.0) -> Fabric:
    """Cloth in the shape of a mesh: a particle at each vertex, a spring along each edge.

    Args:
        mesh: triangles; vertices that no triangle has are left out.
        density: mass of an area [kg/m²].
        stretch: the force on a width that would make it twice as long [N/m]; it becomes narrower by a third of that.
        bending: the couple on a width that bends it, times the radius of the bend [N m]; its shape counts as flat.
        damping: of springs, as a part of their stiffness [s].

    Raises:
        ValueError: there are no triangles, one has no area, or a number makes no sense.
    """
    faces = elements("mesh_cloth: faces", mesh.faces, 3)
    if not len(faces):
        raise ValueError("mesh_cloth: the mesh has no triangles")
    x = numbers("mesh_cloth: vertices", mesh.vertices, (None, 3))
    in_range("mesh_cloth: faces", faces, len(x))
    used, faces = np.unique(faces, return_inverse=True)
    x, faces = x[used], faces.reshape(-1, 3)
    stretch, damping = positive("mesh_cloth: stretch", stretch), positive("mesh_cloth: damping", damping, zero=True)
    areas = _areas(x, faces, "mesh_cloth")
    sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, which = np.unique(sides, axis=0, return_inverse=True)
    length = np.linalg.norm(x[edges[:, 0]] - x[edges[:, 1]], axis=1)
    around = np.bincount(which.ravel(), np.tile(areas, 3), len(edges))  # so triangles of equal sides stretch as told
    stiffness = stretch * around / length**2
    return _cloth(x, faces, Springs(edges, stiffness, damping * stiffness), density, bending, "mesh_cloth")


def _cloth(x: np.ndarray, triangles: np.ndarray, springs: Springs, density: float, bending: float, name: str) -> Fabric:
    areas = _areas(x, triangles, name)
    mass = np.bincount(triangles.ravel(), np.repeat(positive(f"{name}: density", density) * areas / 3.0, 3), len(x))
    forces: list[Law] = [springs.bound(x, mass)]
    if positive(f"{name}: bending", bending, zero=True) > 0.0 and len(hinges := _hinges(triangles)):
        forces.append(Bending(hinges, bending, 0.0, hinge_weights(x, hinges)))
    return Fabric(x, mass, tuple(forces), triangles)


def _areas(x: np.ndarray, triangles: np.ndarray, name: str) -> np.ndarray:
    a, b, c = (x[triangles[:, k]] for k in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.maximum.reduce([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))])
    if (areas <= 1e-9 * longest).any():
        where = int(np.argmin(areas / np.maximum(longest, np.finfo(float).tiny)))
        raise ValueError(
            f"{name}: triangle {where}, of vertices {triangles[where].tolist()}, has no area; leave it out of the mesh"
        )
    return areas


def _hinges(triangles: np.ndarray) -> np.ndarray:
    """Of each edge of two triangles its ends, then the corners opposite to it."""
    sides = np.concatenate([triangles[:, [0, 1, 2]], triangles[:, [1, 2, 0]], triangles[:, [2, 0, 1]]])
    ends = np.sort(sides[:, :2], axis=1)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    first, second = order[:-1], order[1:]
    same = (ends[first] == ends[second]).all(axis=1)
    first, second = first[same], second[same]
    return np.stack([*ends[first].T, sides[first, 2], sides[second, 2]], axis=1)
