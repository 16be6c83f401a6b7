"""Where files are that a URDF names: relative paths, file:// and package:// addresses.

A package is looked for, in this order: in the directories that the caller names, among the parents of the URDF itself, in
ROS_PACKAGE_PATH, under share/ in AMENT_PREFIX_PATH, and where the robotics wheels of PyPI put their data.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import unquote

from articulated.rig.errors import Place


def find(reference: str, directory: Path | None, mesh_dirs: Sequence[Path], place: Place) -> Path | None:
    """The file that a reference means, or None if it is nowhere.

    Args:
        reference: as in the URDF.
        directory: where the URDF is, if it is a file.
        mesh_dirs: where else to look.
        place: the element that refers to it.

    Raises:
        RigError: a package:// reference leaves its package.
    """
    return next((path for path in _candidates(reference, directory, mesh_dirs, place) if path.is_file()), None)


def _candidates(reference: str, directory: Path | None, mesh_dirs: Sequence[Path], place: Place) -> Iterator[Path]:
    if reference.startswith("package://"):
        package, _, rest = unquote(reference.removeprefix("package://")).partition("/")
        if ".." in Path(rest).parts or ".." in Path(package).parts or Path(rest).is_absolute():
            raise place.error(f"{reference!r} leaves its package", "name a file inside the package")
        for root in _package_roots(package, directory, mesh_dirs):
            yield root / rest
        return
    if "://" in reference and not reference.startswith("file://"):
        return  # http:// and the like are never fetched
    path = Path(unquote(reference.removeprefix("file://")))
    if path.is_absolute():
        yield path
        return
    for root in [*([directory] if directory else []), *mesh_dirs]:
        yield root / path


def _package_roots(package: str, directory: Path | None, mesh_dirs: Sequence[Path]) -> Iterator[Path]:
    for root in mesh_dirs:
        yield root / package
        yield root
    if directory:
        yield from (parent for parent in [directory, *directory.parents] if parent.name == package)
        yield from (parent / package for parent in directory.parents)
    for root in _paths("ROS_PACKAGE_PATH"):
        yield root / package
        if root.name == package:
            yield root
    for prefix in _paths("AMENT_PREFIX_PATH"):
        yield prefix / "share" / package
    for entry in sys.path:
        yield Path(entry) / "cmeel.prefix" / "share" / package


def _paths(variable: str) -> list[Path]:
    return [Path(entry) for entry in os.environ.get(variable, "").split(os.pathsep) if entry]
