"""Motions as glTF 2.0 binary files, .glb: for browsers, Blender and game engines.

The nodes are the rig's tree: one for each link, in the frame of the link that it hangs from; shapes hang from links. What
moves is one animation of rotations and translations of the links that a joint moves. The topmost node turns z up into
glTF's y up, so that all below it stands where it stands in the world of the rig.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from articulated.dynamics.boundary import Argument, checked
from articulated.dynamics.functions import link_poses
from articulated.rig import Joint, Link, Rig
from articulated.rig.errors import Place
from articulated.rig.shapes import Box, Mesh, Shape
from articulated.trajectory.gltf_document import Document
from articulated.trajectory.surfaces import Color, Surface, can_be_drawn, surface_of, surfaces_in

PALETTE = ("#77AADD", "#EE8866", "#EEDD88", "#FFAABB", "#99DDFF", "#44BB99", "#BBCC33", "#AAAA00")
"""For shapes that have no colour, by how many joints there are to the world.

The "light" scheme of Tol, Colour Schemes, SRON/EPS/TN/09-002, 2021.
"""

STILL = "#DDDDDD"
"""For what does not move."""

_Y_UP = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))

_TURNS = ("revolute", "continuous", "universal", "ball", "planar", "floating")
_SLIDES = ("prismatic", "planar", "floating")

_SAME = 1e-7
"""Numbers [m, or of a unit quaternion] that differ by less are one in single precision."""


def write_glb(
    rig: Rig, time: ArrayLike, q: ArrayLike, path: str | os.PathLike[str], *, name: str = "", ground: bool = False
) -> None:
    """Write a motion as .glb: visual shapes, or collision shapes if there are none, and one animation from time 0 on.

    Args:
        rig: what moves.
        time: of each frame, increasing, shape (T,) [s].
        q: configurations, shape (T, nq).
        path: where to.
        name: of the animation; the rig's if there is none.
        ground: draw the plane z = 0, as far as the motion goes.

    Raises:
        ValueError: time or q have another shape, are empty, or not finite; time does not increase.
        ImportError: pygltflib is not installed; the error names the extra.
        OSError: the file cannot be written; nothing is left of it then.
    """
    from articulated.trajectory.files import written

    t, q = _frames(rig, time, q)
    document = Document("articulated")
    X = link_poses(rig, q)
    top = document.node(f"{rig.name} (z up)", rotation=list(_Y_UP))
    nodes, channels = _links(document, top, rig, X)
    _Painter(document, rig).paint(nodes)
    if ground:
        _ground(document, top, X)
    if not channels:  # nothing moves, for as long as it lasts
        channels = [(top, "rotation", np.tile(_Y_UP, (min(len(t), 2), 1)))]
    _warn_of_fast_turns(rig, q)
    document.animation(name or rig.name, t, channels)
    whole = document.bytes()
    with written(path, "wb") as file:
        file.write(whole)


def _frames(rig: Rig, time: ArrayLike, q: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Times from 0 on, and configurations with quaternions of unit length, in float64."""
    t, given = np.asarray(time, dtype=float), np.asarray(q)
    if given.ndim != 2 or given.shape[1] != rig.nq or t.shape != given.shape[:1]:
        raise ValueError(
            f"time has shape {t.shape} and q {given.shape}; expected (T,) and (T, {rig.nq}) for one motion of rig {rig.name!r}"
        )
    if not len(t):
        raise ValueError(f"time and q of rig {rig.name!r} are empty; expected one frame at least")
    if given.dtype.kind == "f" and not np.isfinite(given).all():
        frame, k = np.argwhere(~np.isfinite(given))[0].tolist()
        raise ValueError(
            f"q of frame {frame} (t = {t[frame]:g} s) has {given[frame, k]} for {rig.q_names[k]}: the run went astray; "
            "run it with a smaller dt, or write the frames before that"
        )
    q = checked(rig, Argument("q", given, (rig.nq,), role="q")).astype(float)
    for where in rig.quaternions.values():
        q[:, where] /= np.linalg.norm(q[:, where], axis=-1, keepdims=True)
    t = t - t[0]
    if not np.all(np.diff(t.astype(np.float32)) > 0.0) or not np.isfinite(t).all():
        raise ValueError("time does not increase from frame to frame in single precision; write fewer frames a second")
    return t, q


def _links(document: Document, top: int, rig: Rig, X: np.ndarray) -> tuple[dict[str, int], list[tuple[int, str, np.ndarray]]]:
    """Nodes of all links as in the first frame, and what moves them."""
    nodes: dict[str, int] = {}
    channels: list[tuple[int, str, np.ndarray]] = []
    for link in rig.links.values():
        joint = rig.joints.get(link.joint) or rig.fixed_joints.get(link.joint)
        above = rig.links.get(joint.parent) if joint else None
        rest = joint.pose if joint else np.eye(4)
        moves = _motions(joint, link, above, X) if isinstance(joint, Joint) else {}
        start = {"translation": rest[:3, 3], "rotation": Rotation.from_matrix(rest[:3, :3]).as_quat()}
        start |= {what: values[0] for what, values in moves.items()}
        nodes[link.name] = document.node(
            link.name,
            nodes[above.name] if above else top,
            **{what: value.tolist() for what, value in start.items()},
            extras={"joint": _about(joint)} if isinstance(joint, Joint) else {},
        )
        for what, values in moves.items():
            if np.abs(values - values[0]).max() > _SAME:
                channels.append((nodes[link.name], what, values))
    return nodes, channels


def _motions(joint: Joint, link: Link, above: Link | None, X: np.ndarray) -> dict[str, np.ndarray]:
    """Translations, shape (T, 3), and rotations, shape (T, 4), of a link in the one above, as far as its joint changes them."""
    result: dict[str, np.ndarray] = {}
    child, parent = X[:, link.index], X[:, above.index] if above else np.eye(4)
    back = np.swapaxes(parent[..., :3, :3], -1, -2)
    if joint.kind in _SLIDES:
        result["translation"] = (back @ (child[:, :3, 3] - parent[..., :3, 3])[..., None])[..., 0]
    if joint.kind in _TURNS:
        quat_xyzw = Rotation.from_matrix(back @ child[:, :3, :3]).as_quat()
        dots = np.sum(quat_xyzw[1:] * quat_xyzw[:-1], axis=-1)
        quat_xyzw[1:] *= np.where(np.cumsum(dots < 0.0) % 2, -1.0, 1.0)[:, None]  # the shorter way from frame to frame
        result["rotation"] = quat_xyzw
    return result


def _about(joint: Joint) -> dict[str, Any]:
    """A joint, for programs that read a node's extras; infinite limits are left out."""
    about: dict[str, Any] = {"name": joint.name, "kind": joint.kind, "axis": joint.axis.tolist()}
    if joint.axis2 is not None:
        about["axis2"] = joint.axis2.tolist()
    limits = {"lower": joint.limits.lower, "upper": joint.limits.upper}
    return about | {which: value for which, value in limits.items() if math.isfinite(value)}


class _Painter:
    """Hangs shapes from the nodes of links; each geometry is in the file once, and each mesh once in each colour."""

    def __init__(self, document: Document, rig: Rig):
        self.document, self.rig = document, rig
        self.parts: dict[Any, list[tuple[tuple[int, int, int], Color | None]]] = {}
        self.meshes: dict[Any, int] = {}
        self.missing: list[str] = []
        self.textured: list[str] = []

    def paint(self, nodes: dict[str, int]) -> None:
        links = self.rig.links.values()
        depth: list[int] = []
        for body in self.rig.bodies:
            depth.append(depth[body.parent] + 1 if body.parent >= 0 else 0)
        visuals = [shape for link in links for shape in link.visuals]
        looks = any(map(can_be_drawn, visuals))
        if not looks:
            self.missing.extend(_key(shape) for shape in visuals)
        for link in links:
            own = _color(PALETTE[depth[link.body] % len(PALETTE)] if link.body >= 0 else STILL)
            for k, shape in enumerate(link.visuals if looks else link.collisions):
                if parts := self._parts_of(shape, link):
                    colors = tuple(shape.color or color or own for _, color in parts)
                    self._hang(nodes[link.name], f"{link.name} {shape.name or 'shape'} {k}", shape, parts, colors)
        place = Place(self.rig.source or self.rig.name)
        if self.missing:
            names = ", ".join(dict.fromkeys(self.missing))
            place.warn(f"meshes that were not found are not drawn: {names}", "give load its mesh_dirs")
        if self.textured:
            place.warn(f"pictures on meshes are left out: {', '.join(self.textured)}", "each is drawn in one colour")

    def _hang(self, node: int, name: str, shape: Shape, parts: Sequence[Any], colors: tuple[Color, ...]) -> None:
        key = (_key(shape), colors)
        if key not in self.meshes:
            painted = [(triangles, color) for (triangles, _), color in zip(parts, colors, strict=True)]
            self.meshes[key] = self.document.mesh(name, painted)
        self.document.node(
            name,
            node,
            mesh=self.meshes[key],
            translation=shape.pose[:3, 3].tolist(),
            rotation=Rotation.from_matrix(shape.pose[:3, :3]).as_quat().tolist(),
            scale=list(map(float, shape.geometry.scale)) if isinstance(shape.geometry, Mesh) else None,
        )

    def _parts_of(self, shape: Shape, link: Link) -> list[tuple[tuple[int, int, int], Color | None]]:
        """Triangles in the file, with the colours that a mesh file gives; none, with a warning, of what cannot be read."""
        key = _key(shape)
        if key not in self.parts:
            self.parts[key] = [
                (self.document.triangles(s), s.color) for s in self._surfaces_of(shape, link) if len(s.triangles)
            ]
        return self.parts[key]

    def _surfaces_of(self, shape: Shape, link: Link) -> list[Surface]:
        mesh = shape.geometry
        if not isinstance(mesh, Mesh):
            return [surface_of(mesh)]
        if mesh.path is None:
            self.missing.append(mesh.filename)
            return []
        try:
            surfaces = surfaces_in(mesh.path)
        except ValueError as error:
            Place(self.rig.source or self.rig.name, f"link {link.name!r}").warn("a mesh is not drawn", str(error))
            return []
        if any(surface.textured for surface in surfaces):
            self.textured.append(mesh.filename)
        return surfaces


def _key(shape: Shape) -> Any:
    """What two shapes with the same triangles have in common."""
    if isinstance(shape.geometry, Mesh):
        return shape.geometry.path or shape.geometry.filename
    return shape.geometry


def _ground(document: Document, top: int, X: np.ndarray) -> None:
    """A thin plate under the motion, and some way around."""
    places = X[..., :2, 3].reshape(-1, 2) if X.size else np.zeros((1, 2))
    lowest, highest = places.min(axis=0) - 2.0, places.max(axis=0) + 2.0
    thickness = 0.01
    surface = surface_of(Box((*(highest - lowest).tolist(), thickness)))
    mesh = document.mesh("ground", [(document.triangles(surface), _color(STILL))])
    place = [*(0.5 * (lowest + highest)).tolist(), -0.5 * thickness]
    document.node("ground", top, mesh=mesh, translation=place)


def _warn_of_fast_turns(rig: Rig, q: np.ndarray) -> None:
    """Of joints that turn so far from frame to frame that they will be seen to turn the other way."""
    fast = []
    for joint in rig.joints.values():
        turns = q[:, joint.q_slice][:, 2:] if joint.kind == "planar" else q[:, joint.q_slice]
        if joint.nq == joint.nv and joint.kind != "prismatic" and turns.size and len(turns) > 1:
            most = math.degrees(np.abs(np.diff(turns, axis=0)).max())
            if most >= 180.0:
                fast.append(f"{joint.name} (by up to {most:.0f}°)")
    if fast:
        what = f"joints turn by half a turn or more from frame to frame: {', '.join(fast)}"
        Place(rig.source or rig.name).warn(what, "in a .glb they turn the shorter way: give more frames a second")


def _color(text: str) -> Color:
    r, g, b = (int(text[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return (r, g, b, 1.0)
