"""Links that are solids, and joints between them, where they stand in the world when nothing is bent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

import articulated as art

Point = Sequence[float] | np.ndarray

_DIGITS = 6
"""Of inertias: a file is to be read by people too."""


class Maker(art.RigBuilder):
    """Adds links that are solids. All link frames are parallel to the world's where every joint is at zero.

    Attributes:
        places: where each link's frame is then, shape (3,) [m].
    """

    def __init__(self, name: str):
        super().__init__(name)
        self.places: dict[str, np.ndarray] = {}

    def part(
        self,
        name: str,
        mass: float,
        solid: Sequence[art.Shape],
        kind: str = "root",
        parent: str = "",
        at: Point = (0.0, 0.0, 0.0),
        *,
        joint: str = "",
        touches: Sequence[art.Shape] | None = None,
        looks: Sequence[art.Shape] = (),
        hollow: bool = False,
        **rest: Any,
    ) -> None:
        """Add a link and the joint that it hangs by.

        Args:
            name: of the link.
            mass: [kg].
            solid: what weighs this, in the world's frame.
            kind, parent: of the joint; the root has none.
            at: where joint and link frame are, in the world, shape (3,) [m].
            joint: its name; that of the link if none is given.
            touches: its collision shapes, if not the solid.
            looks: visual shapes besides the solid.
            hollow: whether the solid is a thin shell.
            rest: of `RigBuilder.joint`.
        """
        origin = self.places[name] = np.array(at, dtype=float)
        weighed = [moved(shape, -origin) for shape in solid]
        body = art.mass_properties([art.Hollow(s.geometry) for s in weighed] if hollow else weighed, mass=mass)
        self.link(
            name,
            mass,
            np.round(body.center, _DIGITS) + 0.0,
            short(body.inertia),
            [plain(moved(shape, -origin)) for shape in (solid if touches is None else touches)],
            [*weighed, *(moved(shape, -origin) for shape in looks)],
        )
        if kind != "root":
            self.joint(joint or name, kind, parent, name, xyz=self.offset(parent, at), **rest)

    def offset(self, link: str, point: Point) -> np.ndarray:
        """A point of the world in a link's frame, where every joint is at zero, shape (3,) [m]."""
        return np.round(np.array(point, dtype=float) - self.places[link], 9) + 0.0

    def close(self, name: str, kind: str, a: str, b: str, point: Point, **axes: Any) -> None:
        """Close a loop between two links at a point of the world."""
        self.loop(art.Loop(kind, a, self.offset(a, point), b, self.offset(b, point), name=name, **axes))


def short(inertia: np.ndarray) -> np.ndarray:
    """An inertia with few digits."""
    digits = _DIGITS - 1 - math.floor(math.log10(np.abs(inertia).max()))
    return np.round(inertia, digits) + 0.0


def moved(shape: art.Shape, by: Point) -> art.Shape:
    pose = shape.pose.copy()
    pose[:3, 3] = np.round(pose[:3, 3] + by, 9) + 0.0
    return art.Shape(shape.geometry, pose, shape.name, shape.color)


def plain(shape: art.Shape) -> art.Shape:
    return art.Shape(shape.geometry, shape.pose)


def pose(center: Point = (0.0, 0.0, 0.0), along: Point = (0.0, 0.0, 1.0)) -> np.ndarray:
    """A pose at a point with z along a direction, and y as near to the world's y as can be."""
    z = np.array(along, dtype=float)
    z /= np.linalg.norm(z)
    beside = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 0.99 else np.array([0.0, 0.0, 1.0])
    x = np.cross(beside, z)
    x /= np.linalg.norm(x)
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = np.column_stack([x, np.cross(z, x), z]), center
    return X


Color = tuple[float, float, float, float] | None


def box(size: Sequence[float], center: Point = (0.0, 0.0, 0.0), color: Color = None, along: Point = (0, 0, 1)) -> art.Shape:
    return art.Shape(art.Box((size[0], size[1], size[2])), pose(center, along), color=color)


def ball(radius: float, center: Point = (0.0, 0.0, 0.0), color: Color = None) -> art.Shape:
    return art.Shape(art.Sphere(radius), pose(center), color=color)


def rod(start: Point, end: Point, radius: float, color: Color = None) -> art.Shape:
    """A capsule whose half balls are about two points."""
    geometry, X = _between(art.Capsule, start, end, radius)
    return art.Shape(geometry, X, color=color)


def tube(start: Point, end: Point, radius: float, color: Color = None) -> art.Shape:
    """A cylinder between two points."""
    geometry, X = _between(art.Cylinder, start, end, radius)
    return art.Shape(geometry, X, color=color)


def disc(radius: float, width: float, center: Point, color: Color = None) -> art.Shape:
    """A wheel that turns about y."""
    return art.Shape(art.Cylinder(radius, width), pose(center, (0.0, 1.0, 0.0)), color=color)


def _between(kind: Any, start: Point, end: Point, radius: float) -> tuple[Any, np.ndarray]:
    a, b = np.array(start, dtype=float), np.array(end, dtype=float)
    return kind(radius, round(float(np.linalg.norm(b - a)), _DIGITS)), pose(np.round(0.5 * (a + b), 9), b - a)


def meeting(a: Point, radius_a: float, b: Point, radius_b: float, side: float) -> np.ndarray:
    """Where two circles in a plane meet, to the left (1) or right (-1) of the way from a to b, shape (2,), to a micrometre."""
    a, b = np.array(a, dtype=float), np.array(b, dtype=float)
    d = np.linalg.norm(b - a)
    along = (d * d + radius_a**2 - radius_b**2) / (2.0 * d)
    u = (b - a) / d
    return np.round(a + along * u + side * math.sqrt(radius_a**2 - along**2) * np.array([-u[1], u[0]]), 6)


DARK, STEEL, RUBBER = (0.25, 0.27, 0.3, 1.0), (0.62, 0.65, 0.68, 1.0), (0.13, 0.13, 0.14, 1.0)
BLUE, RED, YELLOW = (0.16, 0.38, 0.6, 1.0), (0.75, 0.22, 0.17, 1.0), (0.93, 0.69, 0.13, 1.0)
SKIN, WOOD = (0.87, 0.68, 0.55, 1.0), (0.72, 0.53, 0.33, 1.0)
"""Colours of parts."""
