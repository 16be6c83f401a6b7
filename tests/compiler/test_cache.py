"""The cache on disk survives whatever happens to it, and nobody notices."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import articulated as art
from articulated.compiler import cache, kernels

SCRIPT = """
import numpy as np, articulated as art
rig = art.load("cartpole")
q = np.array([[0.1, 0.2], [0.3, 0.4]])
print(art.forward_dynamics(rig, q, q, q).tobytes().hex())
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("ARTICULATED_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def run() -> bytes:
    """Compile and run, or load and run, in a rig of its own."""
    rig = art.load("cartpole")
    q = np.array([[0.1, 0.2], [0.3, 0.4]])
    return art.forward_dynamics(rig, q, q, q).tobytes()


@pytest.fixture
def built(monkeypatch):
    """Counts how often something is compiled."""
    counted = []
    build = kernels._build
    monkeypatch.setattr(kernels, "_build", lambda *given: counted.append(1) or build(*given))
    return counted


def test_the_second_time_is_from_disk(folder, built):
    assert run() == run()
    assert len(built) == 1
    assert [path.suffix for path in folder.iterdir()] == [".kernel"]


@pytest.mark.parametrize("damage", ["truncated", "empty", "flipped", "header", "other key"])
def test_a_damaged_entry_is_built_anew(folder, built, damage):
    good = run()
    (path,) = folder.iterdir()
    data = bytearray(path.read_bytes())
    if damage == "truncated":
        data = data[: len(data) // 2]
    elif damage == "empty":
        data = bytearray()
    elif damage == "flipped":
        data[-len(data) // 3] ^= 4
    elif damage == "header":
        data[130] ^= 1
    else:  # what another processor or version made, under our name
        payload = bytes(data[128:])
        data = bytearray(cache._seal("0" * 64, payload) + payload)
    path.write_bytes(data)
    assert run() == good
    assert len(built) == 2
    run()
    assert len(built) == 2  # and is whole again


def test_every_flipped_bit_is_noticed(folder):
    run()
    (path,) = folder.iterdir()
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    for where in [*range(140), *rng.integers(0, len(data), 100)]:
        spoilt = bytearray(data)
        spoilt[where] ^= 1 << rng.integers(8)
        path.write_bytes(spoilt)
        assert cache.get(path.stem) is None


def test_another_machine_has_other_entries(folder, monkeypatch, built):
    from articulated.compiler.machine import _levels

    first = run()
    other = next((name for name in _levels() if name != next(iter(_levels()))), None)
    if other is None:
        pytest.skip("this processor has one level of vector instructions")
    monkeypatch.setenv("ARTICULATED_SIMD", other)
    assert run() == first
    assert len(built) == 2
    assert len(list(folder.iterdir())) == 2


def test_another_version_has_other_entries(folder, monkeypatch, built):
    run()
    monkeypatch.setattr(kernels, "_SOURCE", b"another version")
    run()
    assert len(built) == 2


@pytest.mark.parametrize("where", ["/proc/nowhere", "/dev/null", "/dev/null/below"])
def test_a_directory_that_cannot_be_had(monkeypatch, where, built):
    monkeypatch.setenv("ARTICULATED_CACHE", where)
    assert run() == run()
    assert len(built) == 2


def test_a_read_only_directory(folder, monkeypatch, built):
    import tempfile

    run()

    def refuse(*given, **options):
        raise PermissionError(13, "Permission denied")

    # root may write anywhere, so the refusal is made up
    monkeypatch.setattr(tempfile, "mkstemp", refuse)
    monkeypatch.setattr(os, "utime", refuse)
    assert run() == run()
    assert len(built) == 1


def test_a_full_disk(folder, monkeypatch, built):
    def refuse(*given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    run()
    assert list(folder.iterdir()) == []


def test_switched_off(monkeypatch, tmp_path, built):
    monkeypatch.setenv("ARTICULATED_CACHE", "off")
    monkeypatch.setenv("HOME", str(tmp_path))
    run()
    run()
    assert len(built) == 2
    assert list(tmp_path.iterdir()) == []


def test_old_entries_go_first(folder, monkeypatch):
    run()
    (path,) = folder.iterdir()
    size = path.stat().st_size
    for k in range(5):
        copy = folder / f"{k}.kernel"
        copy.write_bytes(b"x" * size)
        os.utime(copy, (k, k))
    (folder / "forgotten.part").write_bytes(b"")
    os.utime(folder / "forgotten.part", (0, 0))
    monkeypatch.setattr(cache, "_LIMIT", 3 * size)
    cache._prune(folder)
    assert {entry.name for entry in folder.iterdir()} == {path.name, "4.kernel", "3.kernel"}


def environment(folder) -> dict[str, str]:
    return {**os.environ, "ARTICULATED_CACHE": str(folder)}


def test_processes_that_compile_the_same_at_once(folder):
    crowd = [
        subprocess.Popen([sys.executable, "-c", SCRIPT], env=environment(folder), stdout=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    answers = {process.communicate()[0] for process in crowd}
    assert [process.returncode for process in crowd] == [0] * 4
    assert answers == {run().hex() + "\n"}
    assert len(list(folder.iterdir())) == 1


def test_killed_while_writing(folder, built):
    """A process that dies halfway through a write leaves nothing that anybody takes for an entry."""
    slow = SCRIPT.replace(
        "rig =",
        """
import os, time
from articulated.compiler import cache
class Slow:
    def __init__(self, file): self.file = file
    def __enter__(self): return self
    def __exit__(self, *_): self.file.close()
    def write(self, data):
        self.file.write(data[: len(data) // 2]); self.file.flush()
        print("halfway", flush=True); time.sleep(60)
fdopen = os.fdopen
os.fdopen = lambda *given: Slow(fdopen(*given))
rig =""",
    )
    with subprocess.Popen([sys.executable, "-c", slow], env=environment(folder), stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "halfway\n"
        process.send_signal(signal.SIGKILL)
    assert [path.suffix for path in folder.iterdir()] == [".part"]
    run()
    run()
    assert len(built) == 1
    (unfinished,) = folder.glob("*.part")
    os.utime(unfinished, (time.time() - 7200,) * 2)
    cache._prune(folder)
    assert not list(folder.glob("*.part"))
