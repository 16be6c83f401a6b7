"""A BVH file as text: checked line by line, and brought to the form that every reader understands.

Readers disagree on what is not of that form, or read it as something else without a word: joints with fewer or more than three
channels, braces on the line of a name, names with blanks. Here all that is told apart, and what is wrong is said with its line.

Meredith and Maddock 2001, "Motion capture file formats explained" (the format has no specification of its own).
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from articulated.rig.errors import Place

_CHANNEL = re.compile(r"([xyz])(position|rotation)", re.IGNORECASE)
_LONGEST = 100_000_000
"""Bytes of a file that is read."""


@dataclass
class Node:
    """A joint of the file, or an end site, while it is read.

    Attributes:
        name: "" of an end site.
        parent: index among all nodes; -1 of the root.
        line: where it is named.
        offset: from its parent, in the file's unit; empty until it was read.
        channels: "Xposition" and so on, in the order of the file.
    """

    name: str
    parent: int
    line: int
    offset: tuple[float, ...] = ()
    channels: list[str] = field(default_factory=list)

    @property
    def order(self) -> str:
        """The axes of its turns, and then those about which it never turns: three letters."""
        own = [c[0] for c in self.channels if c.endswith("rotation")]
        return "".join([*own, *(axis for axis in "XYZ" if axis not in own)])


@dataclass(frozen=True, eq=False)
class Document:
    """What a file says.

    Attributes:
        source: its path.
        nodes: joints and end sites, parents first, in the order of the file.
        frame_time: [s].
        values: of channels, in the order of the nodes, shape (frames, channels); degrees and units of the file, may be NaN.
        lines: of each frame, in the file.
    """

    source: str
    nodes: tuple[Node, ...]
    frame_time: float
    values: np.ndarray
    lines: tuple[int, ...]

    @property
    def joints(self) -> list[Node]:
        return [node for node in self.nodes if node.name]

    def columns(self, joint: Node) -> dict[str, int]:
        """Where the channels of a joint stand, by name."""
        at = 0
        for node in self.nodes:
            if node is joint:
                break
            at += len(node.channels)
        return {name: at + k for k, name in enumerate(joint.channels)}

    def normal_text(self) -> str:
        """The same as every reader takes it: a root of six channels, positions first, and joints of three turns.

        Where turns are missing they are zero. Positions of other joints than the root are left out: `steady` has seen to them.
        """
        text = ["HIERARCHY"]
        self._write(0, 0, text)
        table = []
        for k, joint in enumerate(self.joints):
            at = self.columns(joint)
            wanted = [] if k else [f"{axis}position" for axis in "XYZ"]
            wanted += [f"{axis}rotation" for axis in joint.order]
            table += [self.values[:, at[name]] if name in at else np.zeros(len(self.values)) for name in wanted]
        text += ["MOTION", f"Frames: {len(self.values)}", f"Frame Time: {self.frame_time!r}"]
        text += [" ".join(map(repr, row)) for row in np.column_stack(table).tolist()]
        return "\n".join(text) + "\n"

    def _write(self, index: int, depth: int, text: list[str]) -> None:
        node, tabs = self.nodes[index], "\t" * depth
        text += [tabs + (f"{'JOINT' if depth else 'ROOT'} {node.name}" if node.name else "End Site"), tabs + "{"]
        text.append(f"{tabs}\tOFFSET {' '.join(map(repr, node.offset))}")
        if node.name:
            positions = "" if depth else "Xposition Yposition Zposition "
            turns = " ".join(f"{axis}rotation" for axis in node.order)
            text.append(f"{tabs}\tCHANNELS {3 if depth else 6} {positions}{turns}")
        for child, other in enumerate(self.nodes):
            if other.parent == index:
                self._write(child, depth + 1, text)
        text.append(tabs + "}")


def steady(document: Document) -> Document:
    """The same with the positions that joints other than the root have as offsets of these.

    Raises:
        RigError: a joint slides, which no joint of a skeleton does.
    """
    size = max(1.0, max(abs(x) for node in document.nodes for x in node.offset))
    nodes = list(document.nodes)
    for k, joint in enumerate(nodes):
        positions = {name[0]: at for name, at in document.columns(joint).items() if name.endswith("position")}
        if joint.parent < 0 or not positions:
            continue
        place = Place(document.source, f"joint {joint.name!r}", joint.line)
        values = document.values[:, list(positions.values())]
        moved = float(np.ptp(values, axis=0).max())
        if moved > 1e-5 * size:
            raise place.error(f"slides by {moved:g} in the file's unit", "only the root may: export without bone translation")
        own = dict(zip(positions, values[0].tolist(), strict=True))
        offset = tuple(own.get(axis, x) for axis, x in zip("XYZ", joint.offset, strict=True))
        if max(abs(x) for x in own.values()) > 1e-5 * size:  # zeros add nothing to the offset
            if np.abs(np.subtract(offset, joint.offset)).max() > 1e-4 * size:
                place.warn(f"its position channels hold {list(offset)}, not its OFFSET", "they take its place")
            nodes[k] = replace(joint, offset=offset)
    return replace(document, nodes=tuple(nodes))


def read_document(path: str | os.PathLike[str]) -> Document:
    """Read a file.

    Raises:
        RigError: it is no BVH file, or is damaged; says where, and what to do.
        FileNotFoundError: there is none.
        OSError: it cannot be read.
    """
    name = os.fspath(path)
    place = Place(name)
    if not Path(path).is_file():
        raise FileNotFoundError(f"{name}: no such file; give the path of a BVH file")
    if Path(path).stat().st_size > _LONGEST:
        raise place.error(f"has more than {_LONGEST // 1_000_000} MB", "cut the clip into parts")
    try:
        text = Path(path).read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError:
        text = Path(path).read_bytes().decode("latin-1")
    if not text.split(None, 1)[:1] or text.split(None, 1)[0].upper() != "HIERARCHY":
        raise place.error("does not begin with HIERARCHY", "give a BVH file")
    return _Reader(name, text.splitlines()).document()


class _Reader:
    """Goes through the lines of a file once."""

    def __init__(self, source: str, lines: list[str]):
        self.source = source
        self.lines: Iterator[tuple[int, str]] = ((k, s.strip()) for k, s in enumerate(lines, 1) if s.strip())
        self.line = 0
        self.nodes: list[Node] = []

    def document(self) -> Document:
        self._hierarchy()
        frames, frame_time = self._header()
        values, lines = self._frames(frames)
        return Document(self.source, tuple(self.nodes), frame_time, values, lines)

    def error(self, reason: str, remedy: str, element: str = "", line: int | None = None):
        return Place(self.source, element, line or self.line).error(reason, remedy)

    def _next(self, wanted: str) -> str:
        for line, text in self.lines:
            self.line = line
            return text
        raise self.error(f"the file ends where {wanted} should follow", "it was cut off: get it whole")

    def _hierarchy(self) -> None:
        open_nodes: list[int] = []
        self._next("HIERARCHY")
        while True:
            text = self._next("the MOTION section" if self.nodes and not open_nodes else "the rest of the hierarchy")
            word = text.split()[0].upper()
            if word == "MOTION":
                if open_nodes:
                    raise self.error("MOTION comes before the last '}'", "close every joint", self._of(open_nodes[-1]))
                break
            if word in ("ROOT", "JOINT", "END"):
                self._open(word, text, open_nodes)
            elif word == "{":
                continue
            elif word == "}":
                if not open_nodes:
                    raise self.error("'}' closes nothing", "remove it")
                self._check(open_nodes.pop())
            elif word == "OFFSET" and open_nodes:
                self.nodes[open_nodes[-1]].offset = self._offset(text, open_nodes[-1])
            elif word == "CHANNELS" and open_nodes:
                self.nodes[open_nodes[-1]].channels = self._channels(text, open_nodes[-1])
            else:
                raise self.error(
                    f"{text[:40]!r} has no meaning here", "a hierarchy has ROOT, JOINT, End Site, OFFSET, CHANNELS"
                )
        if not self.nodes:
            raise self.error("the hierarchy is empty", "it needs a ROOT")

    def _open(self, word: str, text: str, open_nodes: list[int]) -> None:
        body = text.rstrip("{").split()
        name = "" if word == "END" else "_".join(body[1:])
        if word == "ROOT" and self.nodes:
            raise self.error("a second ROOT", "give a file of one figure", f"joint {name!r}")
        if word != "ROOT" and not open_nodes:
            raise self.error(f"{body[0]} stands outside of the ROOT", "put it between the root's braces", f"joint {name!r}")
        if word != "END":
            if not name:
                raise self.error(f"{body[0]} has no name", "name it")
            if (same := next((node for node in self.nodes if node.name == name), None)) is not None:
                raise self.error(f"another joint, of line {same.line}, has this name", "rename one", f"joint {name!r}")
        self.nodes.append(Node(name, open_nodes[-1] if open_nodes else -1, self.line))
        open_nodes.append(len(self.nodes) - 1)

    def _of(self, index: int) -> str:
        node = self.nodes[index]
        return f"joint {node.name!r}" if node.name else f"end site of {self.nodes[node.parent].name!r}"

    def _check(self, index: int) -> None:
        node = self.nodes[index]
        if not node.offset:
            raise self.error("has no OFFSET", "give three numbers", self._of(index), node.line)

    def _offset(self, text: str, index: int) -> tuple[float, ...]:
        numbers = self._numbers(text.split()[1:], self._of(index))
        if len(numbers) != 3 or not np.isfinite(numbers).all():
            raise self.error(f"OFFSET is {' '.join(text.split()[1:])}", "give three finite numbers", self._of(index))
        return tuple(numbers)

    def _channels(self, text: str, index: int) -> list[str]:
        where, (count, *names) = self._of(index), text.split()[1:] or ["nothing"]
        if not self.nodes[index].name:
            raise self.error("an end site has CHANNELS", "make it a JOINT, or remove them", where)
        if not count.isdigit() or int(count) != len(names):
            raise self.error(f"CHANNELS says {count} and names {len(names)}", "make these agree", where)
        for name in names:
            if not _CHANNEL.fullmatch(name):
                raise self.error(f"unknown channel {name!r}", "use Xposition … Zrotation", where)
        result = [name[0].upper() + name[1:].lower() for name in names]
        if len(set(result)) < len(result):
            raise self.error(f"CHANNELS names one twice: {' '.join(names)}", "each axis turns or slides once", where)
        return result

    def _numbers(self, words: list[str], element: str) -> list[float]:
        try:
            return [float(word) for word in words]
        except ValueError as error:
            raise self.error(str(error), "give numbers", element) from None

    def _header(self) -> tuple[int, float]:
        text = self._next("Frames:")
        count = text.split(":")[-1].strip()
        if not text.upper().startswith("FRAMES:") or not count.isdigit():
            raise self.error(f"{text[:40]!r} is not 'Frames: N'", "MOTION is followed by how many frames there are")
        if int(count) < 1:
            raise self.error("there are no frames", "give a clip of two at least")
        text = self._next("Frame Time:")
        if not re.match(r"frame\s+time:", text, re.IGNORECASE):
            raise self.error(f"{text[:40]!r} is not 'Frame Time: s'", "Frames is followed by the seconds of each")
        seconds = self._numbers([text.split(":")[1].strip()], "")[0]
        if not 0.0 < seconds < np.inf:
            raise self.error(f"frame time is {seconds:g}", "give a positive number of seconds")
        return int(count), seconds

    def _frames(self, count: int) -> tuple[np.ndarray, tuple[int, ...]]:
        width = sum(len(node.channels) for node in self.nodes)
        rows, lines = [], []
        for line, text in self.lines:
            self.line = line
            numbers = self._numbers(text.split(), f"frame {len(rows)}")
            if len(numbers) != width:
                raise self.error(
                    f"has {len(numbers)} values; the hierarchy has {width} channels",
                    "it was cut off, or belongs to another hierarchy",
                    f"frame {len(rows)}",
                )
            rows.append(numbers)
            lines.append(self.line)
        if len(rows) != count:
            raise self.error(f"there are {len(rows)} frames; 'Frames:' says {count}", "it was cut off: get it whole")
        return np.array(rows, dtype=float).reshape(count, width), tuple(lines)
