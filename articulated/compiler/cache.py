"""Compiled code on disk. What is read is checked, what is written appears whole or not at all, no failure is anyone's trouble.

An entry is a file: the key and a checksum of what follows, then a header in JSON, then object code. One that is damaged, or of
another key, counts as missing and is written anew. ARTICULATED_CACHE names the directory; "off" means none.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

_LIMIT = 512 << 20
"""Bytes that the directory may hold; the entries used least recently go first."""
_ABANDONED = 3600.0
"""Age at which an unfinished file belongs to nobody [s]."""


def directory() -> Path | None:
    """Where entries are kept; None for nowhere."""
    given = os.environ.get("ARTICULATED_CACHE")
    if given == "off":
        return None
    if given:
        return Path(given)
    from platformdirs import user_cache_path

    return user_cache_path("articulated", appauthor=False)


def get(key: str) -> tuple[dict[str, Any], bytes] | None:
    """The header and code of an entry, if there is a sound one."""
    if (where := directory()) is None:
        return None
    path = where / f"{key}.kernel"
    try:
        data = path.read_bytes()
        start, payload = data[:128], data[128:]
        if start != _seal(key, payload):
            return None
        size = int.from_bytes(payload[:8], "little")
        entry = json.loads(payload[8 : 8 + size]), payload[8 + size :]
    except (OSError, ValueError):
        return None
    with suppress(OSError):
        os.utime(path)
    return entry


def put(key: str, header: dict[str, Any], code: bytes) -> None:
    """Keep an entry, if the disk lets us."""
    if (where := directory()) is None:
        return
    text = json.dumps(header).encode()
    payload = len(text).to_bytes(8, "little") + text + code
    try:
        where.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(suffix=".part", dir=where)
    except OSError:
        return
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(_seal(key, payload) + payload)
        os.replace(name, where / f"{key}.kernel")
    except OSError:
        with suppress(OSError):
            os.unlink(name)
    _prune(where)


def _seal(key: str, payload: bytes) -> bytes:
    return (key + hashlib.sha256(key.encode() + payload).hexdigest()).encode()


def _prune(where: Path) -> None:
    """Remove what others left unfinished, and old entries beyond the limit."""
    with suppress(OSError), os.scandir(where) as entries:
        files = [(entry.stat(), entry.path) for entry in entries if entry.name.endswith((".kernel", ".part"))]
        files.sort(key=lambda file: file[0].st_mtime, reverse=True)
        total = 0
        for stat, path in files:
            total += stat.st_size
            abandoned = path.endswith(".part") and time.time() - stat.st_mtime > _ABANDONED
            if abandoned or (total > _LIMIT and path.endswith(".kernel")):
                with suppress(OSError):
                    os.unlink(path)
