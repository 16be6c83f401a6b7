"""Polyhedra as they are computed with: what is on which face is known, sizes may be scalars."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from articulated.scalar import Scalar, sqrt
from articulated.simulation.contact.narrow.placed import Block, Hull, Polyhedron
from articulated.spatial import Vec3

_SAME_PLANE = 2e-4
"""Corners that are nearer to a face's plane than this part of the polyhedron's size are the face's."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex polyhedron in its own axes about a point inside.

    Attributes:
        vertices: [m].
        faces: outward unit normals n and offsets d: inside, n · x ≤ d [m].
        rings: the corners of each face, counterclockwise seen from outside; all as many, if need be by telling the last again.
        edges: pairs of vertices.
        size: how far it reaches from where its axes start [m].
    """

    vertices: Sequence[Vec3]
    faces: Sequence[tuple[Vec3, Scalar]]
    rings: Sequence[Sequence[int]]
    edges: Sequence[tuple[int, int]]
    size: Scalar

    @staticmethod
    def of(shape: Hull | Block) -> Solid:
        """What a hull or a box is."""
        return _of_hull(shape.solid) if isinstance(shape, Hull) else _of_box(shape.half)


@lru_cache(maxsize=1024)
def _of_hull(polyhedron: Polyhedron) -> Solid:
    vertices = [Vec3(*vertex) for vertex in polyhedron.vertices]
    faces = [(Vec3(*normal), offset) for normal, offset in polyhedron.faces]
    size = max(math.hypot(*vertex) for vertex in polyhedron.vertices)
    return Solid(vertices, faces, _rings(vertices, faces, _SAME_PLANE * size), polyhedron.edges, size)


def _of_box(half: tuple[Scalar, Scalar, Scalar]) -> Solid:
    vertices = [Vec3(*(s * h for s, h in zip(signs, half, strict=True))) for signs in _SIGNS]
    faces = [(normal, half[k // 2]) for k, normal in enumerate(_NORMALS)]
    x, y, z = half
    return Solid(vertices, faces, _BOX_RINGS, _BOX_EDGES, sqrt(x * x + y * y + z * z))


def _rings(vertices: Sequence[Vec3], faces: Sequence[tuple[Vec3, float]], near: float) -> list[tuple[int, ...]]:
    found = []
    for n, offset in faces:
        corners = [i for i, vertex in enumerate(vertices) if n.dot(vertex) > offset - near]
        middle = Vec3(*(sum(vertices[i][k] for i in corners) / len(corners) for k in range(3)))
        u = n.cross(vertices[corners[0]] - middle)
        v = n.cross(u)
        angle = {i: math.atan2(v.dot(vertices[i] - middle), u.dot(vertices[i] - middle)) for i in corners}
        found.append(sorted(corners, key=angle.__getitem__))
    most = max(len(ring) for ring in found)
    return [(*ring, *ring[-1:] * (most - len(ring))) for ring in found]


_SIGNS = list(itertools.product((-1.0, 1.0), repeat=3))
_NORMALS = [Vec3(*(side * float(i == k) for i in range(3))) for k in range(3) for side in (1.0, -1.0)]
_BOX_RINGS = _rings([Vec3(*signs) for signs in _SIGNS], [(normal, 1.0) for normal in _NORMALS], 0.5)
_BOX_EDGES = [(i, i + step) for step in (1, 2, 4) for i in range(8) if not i & step]
