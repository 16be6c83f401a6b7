"""Trajectories in files. Whatever is written appears whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from articulated.extras import need
from articulated.rig import Rig, RigWarning
from articulated.rig import load as load_rig
from articulated.rig.errors import Place
from articulated.trajectory.bvh import write_bvh
from articulated.trajectory.cloud import Cloud
from articulated.trajectory.gltf import write_glb
from articulated.trajectory.motion import Motion
from articulated.trajectory.trajectory import PER_STATE, Trajectory

FORMAT = 5
"""Version of the .npz layout."""

_ARRAYS = ("time", *PER_STATE)
_PARTICLES = "particles_"
"""What names of their arrays begin with."""
_NAMES = ("contact_links", "contact_others", "loop_rows")


def save(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """See `Trajectory.save`."""
    if Path(path).suffix != ".npz":
        raise ValueError(f"{os.fspath(path)!r} does not end in .npz; use export for other formats")
    about = {"format": FORMAT, "root": trajectory.rig.root, "settings": trajectory.settings}
    about |= {name: list(getattr(trajectory, name)) for name in _NAMES}
    arrays = {name: getattr(trajectory, name) for name in _ARRAYS}
    if trajectory.particles is not None:
        arrays |= {_PARTICLES + name: array for name, array in trajectory.particles.arrays().items() if name != "time"}
    with written(path, "wb") as file:
        np.savez_compressed(file, about=json.dumps(about), rig=trajectory.rig.to_urdf(), **arrays)


def load(path: str | os.PathLike[str]) -> Trajectory:
    """See `Trajectory.load`."""
    name = os.fspath(path)
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
            about = json.loads(str(data["about"]))
            later, root, settings = about["format"] > FORMAT, about["root"], about["settings"]
            content = {key: data[key] for key in ("rig", *(name for name in _ARRAYS if name in data))}
            particles = {key.removeprefix(_PARTICLES): data[key] for key in data if key.startswith(_PARTICLES)}
            names = {name: tuple(map(str, about.get(name, ()))) for name in _NAMES}
        if not later:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RigWarning)  # all was said when the rig was first loaded
                rig = load_rig(str(content["rig"]), root)
    except FileNotFoundError:
        raise
    except (OSError, EOFError, KeyError, AttributeError, TypeError, ValueError, zipfile.BadZipFile, zlib.error) as error:
        raise ValueError(f"{name} is not a trajectory, or is damaged ({type(error).__name__}: {error})") from None
    if later:
        raise ValueError(f"{name} has format {about['format']}; this version reads up to {FORMAT}: update articulated")
    try:
        if not names["contact_others"]:  # before format 4 all was ground
            names["contact_others"] = ("",) * len(names["contact_links"])
        arrays = _complete(content, rig, len(names["contact_links"]), len(names["loop_rows"]))
        cloud = Cloud.of({"time": arrays["time"], **particles}) if particles else None
    except KeyError as error:
        raise ValueError(f"{name} is not a trajectory, or is damaged (no {error})") from None
    except ValueError as error:
        raise ValueError(f"{name} is damaged: {error}") from None
    return Trajectory(rig=rig, settings=settings, particles=cloud, **names, **arrays)  # type: ignore[arg-type]


def _complete(content: dict[str, np.ndarray], rig: Rig, contacts: int, rows: int) -> dict[str, np.ndarray]:
    """The arrays of a file, with what earlier formats did not have yet."""
    arrays = {"time": content["time"]}
    batch = content["outcome"].shape
    sizes = {"T": len(content["time"]), "nq": rig.nq, "nv": rig.nv, "n": contacts, "m": rows, "3": 3}
    for name, shape in PER_STATE.items():
        wanted = (*batch, *(sizes[axis] for axis in shape.split()))
        absent = name.startswith(("contact_", "loop_")) or name == "residual"
        arrays[name] = content[name] if name in content or not absent else np.zeros(wanted)
        if arrays[name].shape != wanted:
            raise ValueError(f"{name} has shape {arrays[name].shape}")
    return arrays


def export(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """See `Trajectory.export`."""
    suffix = Path(path).suffix.lower()
    if suffix not in EXPORTERS:
        raise ValueError(f"{os.fspath(path)!r}: unknown format {suffix!r}; known are {', '.join(EXPORTERS)} and save's .npz")
    EXPORTERS[suffix](trajectory, path)


def export_motion(motion: Motion, path: str | os.PathLike[str]) -> None:
    """See `Motion.export`."""
    suffix = Path(path).suffix.lower()
    if suffix not in MOTION_EXPORTERS:
        raise ValueError(f"{os.fspath(path)!r}: unknown format {suffix!r}; known are {', '.join(MOTION_EXPORTERS)}")
    MOTION_EXPORTERS[suffix](motion, path)


def write_motion_csv(motion: Motion, path: str | os.PathLike[str]) -> None:
    """One row a frame: time and q in columns named after the joints."""
    with written(path, "w") as file:
        file.write(",".join(_quoted(name) for name in ("time", *(f"q.{name}" for name in motion.rig.q_names))) + "\n")
        rows = np.hstack([motion.time[:, None], motion.q])
        file.writelines(",".join(map(repr, row)) + "\n" for row in rows.tolist())


def write_motion_npz(motion: Motion, path: str | os.PathLike[str]) -> None:
    """q, fps, name and the rig as URDF."""
    with written(path, "wb") as file:
        numbers = {"q": motion.q, "fps": motion.fps, "name": motion.name}
        np.savez_compressed(file, rig=motion.rig.to_urdf(), root=motion.rig.root, **numbers)


def write_csv(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """One row a frame: time, q, v, tau and energies in columns named after the joints; first the state, if there is a batch."""
    rig, batch = trajectory.rig, trajectory.outcome.shape
    names = [
        *(f"state{axis}" for axis in range(len(batch))),
        "time",
        *(f"q.{name}" for name in rig.q_names),
        *(f"v.{name}" for name in rig.v_names),
        *(f"tau.{name}" for name in rig.v_names),
        "kinetic_energy",
        "potential_energy",
        "work",
    ]
    with written(path, "w") as file:
        file.write(",".join(_quoted(name) for name in names) + "\n")
        for state in np.ndindex(batch):
            energies = (trajectory.kinetic_energy, trajectory.potential_energy, trajectory.work)
            columns = [trajectory.time[:, None], trajectory.q[state], trajectory.v[state], trajectory.tau[state]]
            rows = np.hstack([*columns, *(energy[state][:, None] for energy in energies)])
            prefix = "".join(f"{k}," for k in state)
            file.writelines(prefix + ",".join(map(repr, row)) + "\n" for row in rows.tolist())


def write_trajectory_glb(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """See `write_glb`; of one state, and without its particles."""
    if trajectory.outcome.ndim:
        k = ", ".join("0" * trajectory.outcome.ndim)
        states = f"a batch {trajectory.outcome.shape}"
        raise ValueError(f"{os.fspath(path)}: {states} is no one motion; write one of its states: run.state({k}).export(…)")
    if trajectory.particles is not None:
        count = trajectory.particles.x.shape[-2]
        Place(os.fspath(path)).warn(f"the {count} particles of this trajectory are left out", "save's .npz holds them")
    write_glb(trajectory.rig, trajectory.time, trajectory.q, path)


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\n\r') else name


EXPORTERS: dict[str, Callable[[Trajectory, str | os.PathLike[str]], None]] = {
    ".bvh": lambda trajectory, path: write_bvh(trajectory.motion(), path),
    ".csv": write_csv,
    ".glb": write_trajectory_glb,
}
MOTION_EXPORTERS: dict[str, Callable[[Motion, str | os.PathLike[str]], None]] = {
    ".bvh": write_bvh,
    ".csv": write_motion_csv,
    ".glb": lambda motion, path: write_glb(motion.rig, motion.time, motion.q, path, name=motion.name),
    ".npz": write_motion_npz,
}
ONE_STATE = {".bvh": ("pybvh", "mocap"), ".glb": ("pygltflib", "gltf")}
"""Formats that hold one state, with the module that writes them and its extra."""


@contextlib.contextmanager
def written(path: str | os.PathLike[str], mode: str) -> Iterator[IO[Any]]:
    """A file that takes its name only once everything is in it and on the disk.

    Raises:
        OSError: it cannot be written; says which file and why, and leaves nothing behind.
    """
    target = Path(path)
    temporary = None
    try:
        if target.is_dir():
            raise IsADirectoryError(f"cannot write {target}: it is a directory")
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
        with os.fdopen(handle, mode) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, _default_mode())
        os.replace(temporary, target)
        temporary = None
    except OSError as error:
        raise _said_of(target, error) from error
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                os.unlink(temporary)


def check_exportable(path: str | os.PathLike[str], states: int = 1) -> None:
    """Find out now, not after an hour's run, whether so many states can be written to a file of this name.

    Raises:
        ValueError: the format is unknown, or holds one state only.
        ImportError: what writes it is not installed.
        OSError: the file cannot be written.
    """
    name, suffix = os.fspath(path), Path(path).suffix.lower()
    if suffix != ".npz" and suffix not in EXPORTERS:
        *known, last = (".npz", *EXPORTERS)
        raise ValueError(f"{name!r}: unknown format; give a name that ends in {', '.join(known)} or {last}")
    if suffix in ONE_STATE:
        need(*ONE_STATE[suffix])
        if states > 1:
            raise ValueError(f"{name!r} holds one state, not {states}; write .npz, and export one: Trajectory.load(…).state(0)")
    check_writable(path)


def check_writable(path: str | os.PathLike[str]) -> None:
    """Find out now, not after an hour's run, whether a file can be written.

    Raises:
        OSError: it cannot; says which file and why.
    """
    target = Path(path)
    try:
        if target.is_dir():
            raise IsADirectoryError(f"cannot write {target}: it is a directory")
        with tempfile.TemporaryFile(dir=target.parent):
            pass
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(f"cannot write {target}: it is write-protected")
    except OSError as error:
        raise _said_of(target, error) from error


def _said_of(target: Path, error: OSError) -> OSError:
    """The error, in words that name the file that was wanted and not a temporary one."""
    if error.strerror is None:  # ours already
        return error
    hint = "; create its directory first" if isinstance(error, FileNotFoundError) else ""
    return type(error)(f"cannot write {target}: {error.strerror}{hint}")


def _default_mode() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
