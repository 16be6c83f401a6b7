"""Rigs of one body: what is thrown, carried, stacked or stood upon."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

from articulated.rig.builder import RigBuilder
from articulated.rig.mass import mass_properties
from articulated.rig.mesh import is_mesh
from articulated.rig.rig import Rig
from articulated.rig.shapes import Geometry, Hollow, Shape, parts_of, shape_of

LINK = "body"
"""The one link of a loose body."""

Part = Geometry | Hollow | Shape | str | os.PathLike[str]


def loose_body(
    geometry: Part | Sequence[Part],
    mass: float | None = None,
    density: float = 1000.0,
    *,
    name: str | None = None,
    root: str = "free",
) -> Rig:
    """A rig of one link, to be composed with others.

        scene = art.compose(robot, ball=art.loose_body(art.Sphere(0.1), 0.4), cave=art.loose_body("cave.stl", root="fixed"))
        scene.links["ball/body"], scene.joints["ball/root_joint"].q_slice

    The link, "body", has the shapes as collisions and as visuals, and the `mass_properties` of all of them together.

    Args:
        geometry: a Sphere, Box, Cylinder, Capsule or Mesh, a Shape, or the path of a mesh file; or a sequence of these. A
            Hollow weighs what its wall does, and touches and looks as its outside.
        mass: of all of it [kg]; None is density times volume. Scenery has none, whatever is given.
        density: [kg/m³], if no mass is given.
        name: of the rig; None is the geometry's kind: "sphere", "box", "cylinder", "capsule" or "mesh", or "body" of several.
        root: "free", "planar" (in the world's x-y plane), or "fixed" for scenery, which needs no mass and no closed mesh.

    Returns:
        The rig. Its configuration is the link's pose (see `Joint`), empty for scenery.

    Raises:
        ValueError: as `mass_properties` says, or `root` is none of these.
    """
    parts = parts_of(geometry)
    if any(is_mesh(part) for part in parts):
        raise ValueError("a Trimesh has no file that a rig could name; export it to one and give its path")
    shapes = [shape_of(part) for part in parts]
    weighed, shapes = shapes, [_outside(shape) for shape in shapes]
    kind = type(shapes[0].geometry).__name__.lower() if len(shapes) == 1 else LINK
    builder = RigBuilder(kind if name is None else name)
    if root == "fixed":
        builder.link(LINK, collisions=shapes, visuals=shapes)
        return builder.build(root)
    if mass == 0.0:
        raise ValueError("mass is 0; expected a positive number of kilograms for what moves: give one, or root='fixed'")
    solid = mass_properties(weighed, density, mass=mass)
    builder.link(LINK, solid.mass, solid.center, solid.inertia, shapes, shapes)
    return builder.build(root)


def _outside(shape: Shape) -> Shape:
    return replace(shape, geometry=shape.geometry.geometry) if isinstance(shape.geometry, Hollow) else shape
