"""XML as data from strangers: bounded in size, without entities or network, every element with its line."""

from __future__ import annotations

import math
import stat
from collections import Counter
from collections.abc import Iterable, Sequence, Set
from pathlib import Path
from typing import Any

from lxml import etree

from articulated.rig.errors import Place, RigError

LARGEST_FILE = 64 * 2**20
"""Larger files are refused unread [bytes]; the largest robot known to us has a quarter of a megabyte."""


def parse(text: bytes, source: str, kind: str = "URDF") -> etree._Element:
    """The root element of an XML document of this kind.

    Raises:
        RigError: it is too large, not well formed, or declares entities.
    """
    check_size(len(text), source, kind)
    # Entities stay unexpanded and are refused below: a few lines of them can grow to gigabytes.
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, remove_comments=True)
    try:
        root = etree.fromstring(text, parser)
    except etree.XMLSyntaxError as error:
        if "entit" in str(error).lower():
            raise RigError(source, error.lineno, "", "uses XML entities", "write their text out") from None
        raise RigError(source, error.lineno, "", f"is not well-formed XML: {error.msg}", "correct the file") from None
    except ValueError as error:
        raise RigError(source, None, "", f"is not an XML document: {error}", "correct the file") from None
    document: Any = root.getroottree().docinfo
    if document.system_url or (document.internalDTD is not None and list(document.internalDTD.iterentities())):
        raise RigError(source, None, "DOCTYPE", "declares entities or an external document type", "remove the DOCTYPE")
    return root


def check_size(size: int, source: str, kind: str = "URDF") -> None:
    """Refuse a document that is empty or too large."""
    if size == 0:
        raise RigError(source, None, "", "is empty", f"give {_a(kind)} document")
    if size > LARGEST_FILE:
        reason = f"has {size / 2**20:.0f} MiB; at most {LARGEST_FILE // 2**20} are read"
        raise RigError(source, None, "", reason, f"is this {_a(kind)}? Keep meshes in files of their own")


def read_file(path: Path, kind: str = "URDF") -> bytes:
    """The bytes of a file of this kind.

    Raises:
        RigError: there is no such file, or it cannot be read.
    """
    source = str(path)
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise RigError(source, None, "", "is a directory", f"name the {kind} file in it")
        if not stat.S_ISREG(status.st_mode):
            raise RigError(source, None, "", "is not a regular file", f"name {_a(kind)} file")
        check_size(status.st_size, source, kind)
        return path.read_bytes()
    except FileNotFoundError:
        hint = "; `articulated rigs` lists shipped rigs" if kind == "URDF" else ""
        raise RigError(source, None, "", "no such file", f"check the path{hint}") from None
    except OSError as error:
        raise RigError(source, None, "", f"cannot be read: {error.strerror or error}", "check the path") from None


class Node:
    """An XML element with the errors that speak of it."""

    def __init__(self, element: etree._Element, place: Place):
        self.element = element
        self.place = place

    @property
    def tag(self) -> str:
        return str(self.element.tag)

    def inner(self, element: etree._Element, name: str = "") -> Node:
        """A child of this node; errors speak of it by `name`, or as a part of what this node is."""
        label = name or f"{self.place.element}, <{element.tag}>".lstrip(", ")
        return Node(element, Place(self.place.source, label, element.sourceline))

    def children(self, tag: str) -> list[Node]:
        return [self.inner(child) for child in self.element.iterchildren(tag)]

    def child(self, tag: str) -> Node | None:
        """The only child with this tag, or None."""
        found = self.children(tag)
        if len(found) > 1:
            raise found[1].place.error(f"stands {len(found)} times", "keep one")
        return found[0] if found else None

    def need(self, tag: str) -> Node:
        """The only child with this tag."""
        if (found := self.child(tag)) is None:
            raise self.place.error(f"has no <{tag}>", "add it")
        return found

    def text(self, attribute: str) -> str | None:
        value = self.element.get(attribute)
        return None if value is None else value.strip()

    def need_text(self, attribute: str) -> str:
        value = self.text(attribute)
        if not value:
            raise self.place.error(f"has no {attribute}", f'add {attribute}="…"')
        return value

    def number(self, attribute: str, default: float | None = None) -> float:
        """A finite number."""
        if self.element.get(attribute) is None and default is not None:
            return default
        return self.numbers(attribute, 1)[0]

    def numbers(self, attribute: str, count: int, default: Sequence[float] | None = None) -> list[float]:
        """Finite numbers, separated by white space."""
        text = self.text(attribute)
        if text is None:
            if default is not None:
                return list(default)
            raise self.place.error(f"has no {attribute}", f'add {attribute}="…"')
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            raise self.place.error(f"{attribute} is {text!r}", f"give {_count(count)}, with a point for decimals") from None
        if len(values) != count:
            raise self.place.error(f"{attribute} is {text!r}", f"give {_count(count)}")
        if not all(math.isfinite(value) for value in values):
            raise self.place.error(f"{attribute} is {text!r}", "give finite numbers")
        return values


def check_expanded(root: Node, kind: str = "URDF") -> None:
    """Refuse a document that still holds macros.

    Raises:
        RigError: it does.
    """
    for element in root.element.iter(etree.Element):
        name = etree.QName(element)
        if "xacro" in (name.namespace or ""):
            tag = f"<xacro:{name.localname}>"
            raise root.inner(element, tag).place.error(f"is a macro, not {kind}", "expand the file with xacro first")


def count_strangers(nodes: Iterable[Node], meaningful: Set[str], others: Set[str]) -> Counter[str]:
    """How often what stands in these nodes is not meaningful, by tag; warns, once a tag, of what is not of others either."""
    strange: dict[str, Place] = {}
    counted: Counter[str] = Counter()
    for node in nodes:
        for element in node.element.iterchildren(etree.Element):
            tag = str(element.tag)
            if tag in meaningful:
                continue
            counted[tag] += 1
            if tag not in others:
                strange.setdefault(tag, node.inner(element).place)
    for tag, place in strange.items():
        place.warn(f"unknown element, ignored ({counted[tag]} in all)", "is its name spelt right?")
    return counted


def _a(kind: str) -> str:
    return f"{'an' if kind == 'SRDF' else 'a'} {kind}"


def _count(count: int) -> str:
    return "a number" if count == 1 else f"{count} numbers"
