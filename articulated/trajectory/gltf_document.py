"""What a glTF file holds: numbers in one buffer, what describes them, and what is drawn with them; written by pygltflib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from articulated.extras import need
from articulated.trajectory.surfaces import Color, Surface

_VERTICES, _INDICES = 34962, 34963
"""What a buffer view is for, glTF 2.0, 5.11.5."""

_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_COMPONENTS = {np.dtype(np.uint16): 5123, np.dtype(np.uint32): 5125, np.dtype(np.float32): 5126}


class Document:
    """A glTF 2.0 document that grows. Each method adds one thing, and gives its number.

    Raises:
        ImportError: pygltflib is not installed; the error names the extra.
    """

    def __init__(self, generator: str):
        self._gltf: Any = need("pygltflib", "gltf")
        self._content = self._gltf.GLTF2(asset=self._gltf.Asset(version="2.0", generator=generator), scene=0)
        self._buffer = bytearray()
        self._materials: dict[Color, int] = {}

    def numbers(self, values: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        """An accessor of its own view of the buffer: values of shape (n,), (n, 3) or (n, 4)."""
        values = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
        self._buffer += bytes(-len(self._buffer) % 4)
        view = self._gltf.BufferView(buffer=0, byteOffset=len(self._buffer), byteLength=values.nbytes, target=target)
        self._buffer += values.tobytes()
        rows = values.reshape(len(values), -1)
        accessor = self._gltf.Accessor(
            bufferView=self._add("bufferViews", view),
            componentType=_COMPONENTS[values.dtype],
            count=len(rows),
            type=_TYPES[rows.shape[1]],
            min=rows.min(axis=0).tolist() if bounds else None,
            max=rows.max(axis=0).tolist() if bounds else None,
        )
        return self._add("accessors", accessor)

    def material(self, color: Color) -> int:
        """One that is neither metal nor mirror, of an sRGB colour; the same number for the same colour."""
        if color not in self._materials:
            pbr = self._gltf.PbrMetallicRoughness(
                baseColorFactor=[*(_linear(x) for x in color[:3]), color[3]], metallicFactor=0.0, roughnessFactor=0.7
            )
            mode = "OPAQUE" if color[3] >= 1.0 else "BLEND"
            material = self._gltf.Material(pbrMetallicRoughness=pbr, alphaMode=mode, emissiveFactor=None)
            self._materials[color] = self._add("materials", material)
        return self._materials[color]

    def triangles(self, surface: Surface) -> tuple[int, int, int]:
        """Its points, normals and corners, as accessors."""
        small = len(surface.points) < 0xFFFF
        return (
            self.numbers(surface.points, _VERTICES, bounds=True),
            self.numbers(surface.normals, _VERTICES),
            self.numbers(surface.triangles.reshape(-1).astype(np.uint16 if small else np.uint32), _INDICES),
        )

    def mesh(self, name: str, parts: Sequence[tuple[tuple[int, int, int], Color]]) -> int:
        """Triangles, as `triangles` numbers them, each with a colour."""
        primitives = [
            self._gltf.Primitive(
                attributes=self._gltf.Attributes(POSITION=points, NORMAL=normals),
                indices=corners,
                material=self.material(color),
            )
            for (points, normals, corners), color in parts
        ]
        return self._add("meshes", self._gltf.Mesh(name=name, primitives=primitives))

    def node(self, name: str, parent: int | None = None, **properties: Any) -> int:
        """A frame in its parent's, or in the scene: translation, rotation (xyzw), scale, mesh, extras."""
        number = self._add("nodes", self._gltf.Node(name=name, **properties))
        if parent is None:
            self._add("scenes", self._gltf.Scene(nodes=[number]))
        else:
            self._content.nodes[parent].children.append(number)
        return number

    def animation(self, name: str, time: np.ndarray, channels: Sequence[tuple[int, str, np.ndarray]]) -> int:
        """Translations or rotations of nodes at times, shape (T,), with straight lines and shortest turns between them."""
        animation = self._gltf.Animation(name=name)
        keys: dict[int, int] = {}
        for node, path, values in channels:
            if len(values) not in keys:
                some = time if len(values) == len(time) else time[[0, -1]]
                keys[len(values)] = self.numbers(some.astype(np.float32), bounds=True)
            sampler = self._gltf.AnimationSampler(
                input=keys[len(values)], interpolation="LINEAR", output=self.numbers(values.astype(np.float32))
            )
            animation.samplers.append(sampler)
            target = self._gltf.AnimationChannelTarget(node=node, path=path)
            animation.channels.append(self._gltf.AnimationChannel(sampler=len(animation.samplers) - 1, target=target))
        return self._add("animations", animation)

    def bytes(self) -> bytes:
        """The document as a binary file, .glb."""
        self._buffer += bytes(-len(self._buffer) % 4)
        self._content.buffers = [self._gltf.Buffer(byteLength=len(self._buffer))]
        self._content.set_binary_blob(bytes(self._buffer))
        return b"".join(self._content.save_to_bytes())

    def _add(self, what: str, thing: Any) -> int:
        things = getattr(self._content, what)
        things.append(thing)
        return len(things) - 1


def _linear(x: float) -> float:
    """Linear light of sRGB, IEC 61966-2-1."""
    x = min(max(x, 0.0), 1.0)
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4
