"""What of a rig touches other things: its collision shapes, as convex pieces."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np

from articulated.dynamics.mechanism import WORLD, Mechanism
from articulated.dynamics.tree import Tree
from articulated.rig import Box, Capsule, Cylinder, Link, Mesh, Rig, Shape, Sphere
from articulated.rig.errors import RigWarning
from articulated.rig.mesh import found_mesh
from articulated.simulation.contact.narrow.placed import Block, Hull, Placed, Rod, Roller
from articulated.simulation.contact.narrow.solids import Polyhedron, Solid
from articulated.simulation.contact.polyhedra import polyhedron_of_mesh
from articulated.spatial import Mat3, Pose, Vec3

SCENERY = -1
"""The link of what stands in the world without being part of a rig."""

_SHALLOW = 1e-3
"""What a mesh's hull may lose before it is told, as a part of its size."""


@dataclass(frozen=True)
class Piece:
    """A convex shape on a link.

    Attributes:
        link: its index, or `SCENERY`.
        kind: "rod", "block", "roller" or "hull".
        size: radius and half length of a rod (None: a ball) or a roller; half the lengths of a block; a hull's polyhedron.
        pose: of its own axes in its link, or in the world, as rows of a 3 by 4 matrix.
    """

    link: int
    kind: str
    size: tuple[float, ...] | Polyhedron
    pose: tuple[tuple[float, ...], ...]

    @property
    def reach(self) -> float:
        """The radius of the ball about its middle that holds it [m]."""
        if isinstance(self.size, Polyhedron):
            return max(math.hypot(*vertex) for vertex in self.size.vertices)
        if self.kind == "block":
            return math.hypot(*self.size)
        radius, *half = self.size
        return math.hypot(radius, *half) if self.kind == "roller" else radius + sum(half)

    @property
    def round(self) -> float:
        """How far its surface is from what turns without moving it: a rod's radius [m]."""
        return self.size[0] if self.kind == "rod" and not isinstance(self.size, Polyhedron) else 0.0

    @property
    def corners(self) -> np.ndarray:
        """Points that stand for its surface, in its own axes, shape (n, 3) [m]."""
        if isinstance(self.size, Polyhedron):
            return np.array(self.size.vertices)
        if self.kind == "block":
            signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
            return signs * self.size
        radius, *half = self.size
        ends = np.array([[0.0, 0.0, z] for z in (half[0], -half[0])] if half else [[0.0, 0.0, 0.0]])
        if self.kind == "rod":
            return ends
        rim = [[radius * math.cos(a), radius * math.sin(a), 0.0] for a in np.linspace(0.0, 2.0 * math.pi, 5)[:4]]
        return (ends[:, None] + np.array(rim)).reshape(-1, 3)

    def body(self, m: Mechanism) -> int:
        """The body that it is part of."""
        return WORLD if self.link == SCENERY else m.links[self.link][0]


def pieces_of(rig: Rig) -> list[Piece]:
    """Of all links that have collision shapes, in their order."""
    return [piece for link in rig.links.values() for shape in link.collisions for piece in piece_of(link, shape)]


def piece_of(link: Link | None, shape: Shape) -> list[Piece]:
    """The piece of a shape on a link, or in the world; none if it is a mesh that was not found."""
    geometry, pose, size = shape.geometry, shape.pose, None
    index = SCENERY if link is None else link.index
    if isinstance(geometry, Sphere):
        kind, size = "rod", (geometry.radius,)
    elif isinstance(geometry, Capsule):
        kind, size = "rod", (geometry.radius, 0.5 * geometry.length) if geometry.length > 0.0 else (geometry.radius,)
    elif isinstance(geometry, Box):
        kind, size = "block", tuple(0.5 * float(x) for x in geometry.size)
    elif isinstance(geometry, Cylinder):
        kind, size = "roller", (geometry.radius, 0.5 * geometry.length)
    else:
        return _hull(index, link, geometry, pose)
    return [Piece(index, kind, size, _rows(pose))]


def place(now: Tree, piece: Piece) -> Placed:
    """A piece where it stands, about O."""
    return placed(piece, *stand(now, piece))


def stand(now: Tree, piece: Piece) -> tuple[Mat3, Vec3]:
    """The rotation of a piece's own axes, and their origin about O."""
    body, X_BS = WORLD, _pose(piece.pose)
    if piece.link != SCENERY:
        body, X_BL = now.mechanism.links[piece.link]
        X_BS = X_BL @ X_BS
    X_OS = now.X[body] @ X_BS if body != WORLD else Pose(X_BS.R, X_BS.p - now.origin)
    return Mat3.identity() @ X_OS.R, X_OS.p


def placed(piece: Piece, R: Mat3, center: Vec3) -> Placed:
    """A piece that stands so."""
    if isinstance(piece.size, Polyhedron):
        return Hull(center, R, Solid.of(piece.size))
    if piece.kind == "block":
        x, y, z = piece.size
        return Block(center, R, (x, y, z))
    radius, *half = piece.size
    if piece.kind == "roller":
        return Roller(center, R.column(2), radius, half[0])
    return Rod(center, R.column(2) * half[0] if half else None, radius)


def _hull(index: int, link: Link | None, mesh: Mesh, pose: np.ndarray) -> list[Piece]:
    where = "of scenery" if link is None else f"of link {link.name!r}"
    if (path := found_mesh(mesh, where)) is None:
        return []
    center, solid, lost = polyhedron_of_mesh(path, mesh.scale)
    if lost > _SHALLOW * max(math.hypot(*vertex) for vertex in solid.vertices):
        corners = len(solid.vertices)
        text = f"mesh {mesh.filename!r} {where} touches as a hull of {corners} vertices, up to {1e3 * lost:.2g} mm within it"
        warnings.warn(text, RigWarning, stacklevel=2)
    moved = pose.copy()
    moved[:3, 3] += pose[:3, :3] @ np.array(center)
    return [Piece(index, "hull", solid, _rows(moved))]


def _rows(pose: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple((row + 0.0).tolist()) for row in np.asarray(pose, dtype=float)[:3])


def _pose(rows: tuple[tuple[float, ...], ...]) -> Pose:
    return Pose(Mat3.of([row[:3] for row in rows]), Vec3.of([row[3] for row in rows]))
