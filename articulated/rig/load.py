"""Rigs from files, from text and by the names of the shipped ones."""

from __future__ import annotations

import os
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path

from articulated.rig.builder import RigBuilder
from articulated.rig.errors import Place, RigError
from articulated.rig.rig import Rig

_HERE = Path(__file__).resolve().parent.parent
_SHIPPED = (_HERE / "urdf", _HERE.parent / "urdf")  # in a wheel, in a checkout


def load(
    source: str | bytes | os.PathLike[str],
    root: str = "fixed",
    *,
    mesh_dirs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    repair_inertia: bool = False,
) -> Rig:
    """A rig from URDF.

    Args:
        source: a path, a package:// address, the name of a shipped rig (see `shipped_rigs`), or URDF text itself.
        root: how the root link meets the world: "fixed", "free" (6 dof) or "planar" (3 dof).
        mesh_dirs: where to look for mesh files and packages, beside the usual places. Dynamics need no meshes.
        repair_inertia: replace an inertia that no mass could have by the nearest that one could.

    Returns:
        The rig.

    Raises:
        RigError: the source cannot be read, or is not a rig that can move; it says where and what to do.
        ValueError: `root` is none of these.
    """
    directories = [mesh_dirs] if isinstance(mesh_dirs, (str, os.PathLike)) else list(mesh_dirs)
    return read(source, [Path(directory) for directory in directories]).build(root, repair_inertia=repair_inertia)


def read(source: str | bytes | os.PathLike[str], mesh_dirs: Sequence[Path] = ()) -> RigBuilder:
    """The links and joints of a source, before they are put together; see `load`."""
    from articulated.rig.urdf.reader import read_urdf
    from articulated.rig.urdf.xml import read_file

    if isinstance(source, (bytes, bytearray)):
        return read_urdf(bytes(source), "<text>", None, mesh_dirs)
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return read_urdf(source.lstrip("\ufeff \t\r\n").encode(), "<text>", None, mesh_dirs)
    path = find_rig(source, mesh_dirs)
    return read_urdf(read_file(path), str(path), path.parent, mesh_dirs)


def find_rig(source: str | os.PathLike[str], mesh_dirs: Sequence[Path] = ()) -> Path:
    """The file that a path, a package:// address or the name of a shipped rig means."""
    from articulated.rig.urdf import files

    name = os.fspath(source)
    if not isinstance(name, str) or not name or "\0" in name:
        raise RigError(repr(source), None, "", "is not a path", "give a path, URDF text or a shipped rig's name")
    if name.startswith("package://"):
        path = files.find(name, None, mesh_dirs, Place(name))
        if path is None:
            raise RigError(name, None, "", "is in no known package", "set ROS_PACKAGE_PATH or give mesh_dirs")
        return path
    if not os.path.exists(name):
        shipped = shipped_rigs()
        if name in shipped:
            return shipped[name]
        if close := get_close_matches(name, shipped, n=1):
            raise RigError(name, None, "", "no such file", f"did you mean the shipped rig {close[0]!r}?")
    return Path(name)


def shipped_rigs() -> dict[str, Path]:
    """The rigs that come with the project: their URDF files by name."""
    for directory in _SHIPPED:
        if found := {path.stem: path for path in sorted(directory.glob("*.urdf"))}:
            return found
    return {}
