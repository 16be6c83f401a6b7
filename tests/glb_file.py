"""A .glb read by hand, as the specification of glTF 2.0 says: an independent reader to test what is written."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

COMPONENTS = {5123: np.dtype("<u2"), 5125: np.dtype("<u4"), 5126: np.dtype("<f4")}
SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


class GlbFile:
    def __init__(self, path: Path):
        data = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        assert size % 4 == 0
        self.json = json.loads(data[20 : 20 + size])
        binary, kind = struct.unpack_from("<I4s", data, 20 + size)
        assert kind == b"BIN\0"
        assert 28 + size + binary == len(data)
        self.buffer = data[28 + size :]
        self.nodes = self.json["nodes"]
        (self.animation,) = self.json["animations"]
        self.parent = {child: k for k, node in enumerate(self.nodes) for child in node.get("children", [])}
        self.number = {node["name"]: k for k, node in enumerate(self.nodes)}

    def values(self, accessor: int) -> np.ndarray:
        about = self.json["accessors"][accessor]
        view = self.json["bufferViews"][about["bufferView"]]
        size = SIZES[about["type"]]
        start = view.get("byteOffset", 0) + about.get("byteOffset", 0)
        flat = np.frombuffer(self.buffer, COMPONENTS[about["componentType"]], about["count"] * size, start)
        return flat.reshape(-1, size) if size > 1 else flat

    @property
    def channels(self) -> dict[tuple[int, str], tuple[np.ndarray, np.ndarray]]:
        """Times and values of each node and path."""
        result = {}
        for channel in self.animation["channels"]:
            sampler = self.animation["samplers"][channel["sampler"]]
            assert sampler["interpolation"] == "LINEAR"
            key = (channel["target"]["node"], channel["target"]["path"])
            assert key not in result
            result[key] = (self.values(sampler["input"]), self.values(sampler["output"]))
        return result

    def worlds(self, frame: int) -> list[np.ndarray]:
        """Where each node stands in the scene at a keyframe, shape (4, 4)."""
        channels = self.channels
        result: dict[int, np.ndarray] = {}

        def world(k: int) -> np.ndarray:
            if k not in result:
                own = np.eye(4)
                parts = {part: self.nodes[k].get(part) for part in ("translation", "rotation", "scale")}
                parts |= {part: channels[k, part][1][frame] for part in parts if (k, part) in channels}
                if parts["rotation"] is not None:
                    own[:3, :3] = Rotation.from_quat(parts["rotation"]).as_matrix()
                if parts["scale"] is not None:
                    own[:3, :3] *= parts["scale"]
                if parts["translation"] is not None:
                    own[:3, 3] = parts["translation"]
                result[k] = world(self.parent[k]) @ own if k in self.parent else own
            return result[k]

        return [world(k) for k in range(len(self.nodes))]

    def points(self, node: int, frame: int = 0) -> np.ndarray:
        """All corners of a node's mesh, in the scene, shape (n, 3)."""
        X = self.worlds(frame)[node]
        primitives = self.json["meshes"][self.nodes[node]["mesh"]]["primitives"]
        own = np.vstack([self.values(primitive["attributes"]["POSITION"]) for primitive in primitives])
        return own @ X[:3, :3].T + X[:3, 3]
