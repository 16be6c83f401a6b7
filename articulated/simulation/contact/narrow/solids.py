"""Polyhedra as they are computed with: what touches them is found without asking which vertex is on which face.

A polyhedron is nothing but numbers, and may be filled up with more that make no difference. So machine code for one is code for
any other that has no more vertices, faces, corners of a face and edges.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from articulated.scalar import Scalar, sqrt
from articulated.spatial import Vec3

_SAME_PLANE = 2e-4
"""Corners that are nearer to a face's plane than this part of the polyhedron's size are the face's."""


@dataclass(frozen=True)
class Polyhedron:
    """A convex polyhedron, in its own axes about a point inside.

    Attributes:
        vertices: [m].
        faces: outward unit normals n and offsets d: inside, n · x ≤ d [m].
        edges: pairs of vertices.
    """

    vertices: tuple[tuple[float, float, float], ...]
    faces: tuple[tuple[tuple[float, float, float], float], ...]
    edges: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Face:
    """A face of a polyhedron: inside, n · x ≤ d.

    Attributes:
        n, d: outward unit normal, and how far out the plane is [m].
        ring: corners, counterclockwise seen from outside; of all faces as many, if need be by telling the last again.
        holds: of each vertex: 1 if it is one of the corners, else 0.
    """

    n: Vec3
    d: Scalar
    ring: Sequence[Vec3]
    holds: Sequence[Scalar]


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex polyhedron in its own axes about a point inside.

    Attributes:
        vertices: [m]; points inside may be among them.
        faces: some may be told twice.
        edges: pairs of vertices; some may be told twice.
        size: how far it reaches from where its axes start [m].
    """

    vertices: Sequence[Vec3]
    faces: Sequence[Face]
    edges: Sequence[tuple[Vec3, Vec3]]
    size: Scalar

    @staticmethod
    @lru_cache(maxsize=1024)
    def of(polyhedron: Polyhedron) -> Solid:
        """What a polyhedron is."""
        vertices = [Vec3(*vertex) for vertex in polyhedron.vertices]
        planes = [(Vec3(*normal), offset) for normal, offset in polyhedron.faces]
        size = max(math.hypot(*vertex) for vertex in polyhedron.vertices)
        return _solid(vertices, planes, _rings(vertices, planes, _SAME_PLANE * size), polyhedron.edges, size)

    @staticmethod
    def of_box(half: tuple[Scalar, Scalar, Scalar]) -> Solid:
        """A box is one, about its middle; given are half its lengths."""
        vertices = [Vec3(*(s * h for s, h in zip(signs, half, strict=True))) for signs in _SIGNS]
        planes = [(normal, half[k // 2]) for k, normal in enumerate(_NORMALS)]
        x, y, z = half
        return _solid(vertices, planes, _BOX_RINGS, _BOX_EDGES, sqrt(x * x + y * y + z * z))

    @property
    def counts(self) -> tuple[int, int, int, int]:
        """Of vertices, faces, corners of a face, and edges."""
        return len(self.vertices), len(self.faces), len(self.faces[0].ring), len(self.edges)

    def filled(self, counts: tuple[int, int, int, int]) -> Solid:
        """The same polyhedron with so many, which are no fewer; what is added makes no difference to anything."""
        vertices, faces, corners, edges = counts
        full = [
            replace(face, ring=_filled(face.ring, corners, face.ring[-1]), holds=_filled(face.holds, vertices, 0.0))
            for face in self.faces
        ]
        return Solid(
            _filled(self.vertices, vertices, Vec3.zero()),
            _filled(full, faces, full[-1]),
            _filled(self.edges, edges, self.edges[-1]),
            self.size,
        )


def _filled(some: Sequence[Any], count: int, more: Any) -> list[Any]:
    return [*some, *[more] * (count - len(some))]


def _solid(
    vertices: Sequence[Vec3],
    planes: Sequence[tuple[Vec3, Scalar]],
    rings: Sequence[Sequence[int]],
    edges: Sequence[tuple[int, int]],
    size: Scalar,
) -> Solid:
    faces = []
    for (n, d), ring in zip(planes, rings, strict=True):
        holds = [1.0 if i in ring else 0.0 for i in range(len(vertices))]
        faces.append(Face(n, d, [vertices[i] for i in ring], holds))
    return Solid(vertices, faces, [(vertices[i], vertices[j]) for i, j in edges], size)


def _rings(vertices: Sequence[Vec3], planes: Sequence[tuple[Vec3, float]], near: float) -> list[tuple[int, ...]]:
    found = []
    for n, d in planes:
        corners = [i for i, vertex in enumerate(vertices) if n.dot(vertex) > d - near]
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
