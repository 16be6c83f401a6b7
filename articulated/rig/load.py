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
    srdf: str | bytes | os.PathLike[str] | None = None,
    density: float | None = None,
    total_mass: float | None = None,
    repair_mesh: str | None = "hull",
) -> Rig:
    """A rig from URDF.

    Args:
        source: a path, a package:// address, the name of a shipped rig (see `shipped_rigs`), or URDF text itself.
        root: how the root link meets the world: "fixed", "free" (6 dof) or "planar" (3 dof).
        mesh_dirs: where to look for mesh files and packages, beside the usual places. Dynamics need no meshes.
        repair_inertia: replace an inertia that no mass could have by the nearest that one could.
        srdf: path or text of an SRDF, whose pairs of links may not collide either; see `Rig.disabled_collisions`.
        density: of links that have collision shapes but no <inertial> [kg/m³]: they get that of these shapes, and a
            `RigWarning` names them. Links without collision shapes stay mere frames, and an <inertial> is kept.
        total_mass: of everything that moves [kg]: all masses and inertias are multiplied alike to make it so; see
            `RigBuilder.build`.
        repair_mesh: what a collision mesh that bounds no solid weighs, if it has to; see `mass_properties`.

    Returns:
        The rig.

    Raises:
        RigError: the source cannot be read, or is not a rig that can move; it says where and what to do.
        ValueError: `root` is none of these, or the density or the mass is not a positive number.
    """
    directories = [mesh_dirs] if isinstance(mesh_dirs, (str, os.PathLike)) else list(mesh_dirs)
    builder = read(source, [Path(directory) for directory in directories])
    if srdf is not None:
        _add_srdf(srdf, builder, [Path(directory) for directory in directories])
    return builder.build(root, repair_inertia=repair_inertia, density=density, total_mass=total_mass, repair_mesh=repair_mesh)


def read(source: str | bytes | os.PathLike[str], mesh_dirs: Sequence[Path] = ()) -> RigBuilder:
    """The links and joints of a source, before they are put together; see `load`."""
    from articulated.rig.urdf.reader import read_urdf
    from articulated.rig.urdf.xml import read_file

    if (text := _text(source)) is not None:
        return read_urdf(text, "<text>", None, mesh_dirs)
    path = find_rig(source, mesh_dirs)  # type: ignore[arg-type]
    return read_urdf(read_file(path), str(path), path.parent, mesh_dirs)


def _add_srdf(source: str | bytes | os.PathLike[str], builder: RigBuilder, mesh_dirs: Sequence[Path]) -> None:
    from articulated.rig.urdf.srdf import read_srdf
    from articulated.rig.urdf.xml import read_file

    if (text := _text(source)) is not None:
        read_srdf(text, "<srdf>", builder)
        return
    path = _find(source, mesh_dirs, "give a path or SRDF text")  # type: ignore[arg-type]
    read_srdf(read_file(path, "SRDF"), str(path), builder)


def _text(source: str | bytes | os.PathLike[str]) -> bytes | None:
    """The document, if a source is one and not the name of a file."""
    if isinstance(source, (bytes, bytearray)):
        return bytes(source)
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return source.lstrip("\ufeff \t\r\n").encode()
    return None


def find_rig(source: str | os.PathLike[str], mesh_dirs: Sequence[Path] = ()) -> Path:
    """The file that a path, a package:// address or the name of a shipped rig means."""
    path = _find(source, mesh_dirs, "give a path, URDF text or a shipped rig's name")
    if not os.path.exists(path):
        name, shipped = os.fspath(source), shipped_rigs()
        if name in shipped:
            return shipped[name]
        if close := get_close_matches(name, shipped, n=1):
            raise RigError(name, None, "", "no such file", f"did you mean the shipped rig {close[0]!r}?")
    return path


def _find(source: str | os.PathLike[str], mesh_dirs: Sequence[Path], remedy: str) -> Path:
    """The file that a path or a package:// address means."""
    from articulated.rig.urdf import files

    name = os.fspath(source)
    if not isinstance(name, str) or not name or "\0" in name:
        raise RigError(repr(source), None, "", "is not a path", remedy)
    if name.startswith("package://"):
        path = files.find(name, None, mesh_dirs, Place(name))
        if path is None:
            raise RigError(name, None, "", "is in no known package", "set ROS_PACKAGE_PATH or give mesh_dirs")
        return path
    return Path(name)


def shipped_rigs() -> dict[str, Path]:
    """The rigs that come with the project: their URDF files by name."""
    for directory in _SHIPPED:
        if found := {path.stem: path for path in sorted(directory.glob("*.urdf"))}:
            return found
    return {}


def shipped_lines() -> dict[str, str]:
    """What each shipped rig shows, a line by name, as `rigs.txt` beside them says; of one that it leaves out nothing is known."""
    lines = {}
    for path in list(shipped_rigs().values())[:1]:
        about = path.parent / "rigs.txt"
        for line in about.read_text(encoding="utf-8").splitlines() if about.is_file() else ():
            name, colon, what = line.partition(":")
            if colon and what.strip():
                lines[name.strip()] = what.strip()
    return lines
