"""Threads that share a batch.

It is cut into more parts than there are threads, and whoever is free takes the next: so one that wakes up late, or is held up,
takes fewer.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable
from functools import cache
from queue import SimpleQueue


def default_threads() -> int:
    """ARTICULATED_THREADS, or as many as there are cores for us."""
    given = os.environ.get("ARTICULATED_THREADS")
    if given:
        if not given.isdecimal() or int(given) < 1:
            raise ValueError(f"ARTICULATED_THREADS is {given!r}; expected a positive integer")
        return int(given)
    return _cores()


def shared(work: Callable[[int], int], parts: int, threads: int) -> int:
    """Call `work` for each part, on so many threads, this one among them; what the calls returned, bits together."""
    job = _Job(work, parts)
    _crew.give(job, min(threads, os.cpu_count() or 1) - 1)
    return job.finished()


class _Job:
    """What is left of a job, and what has come of the rest; it keeps alive whatever is worked on."""

    def __init__(self, work: Callable[[int], int], parts: int):
        self.work, self.parts = work, parts
        self.left = deque(range(parts))
        self.done: SimpleQueue[int | Exception] = SimpleQueue()

    def help(self) -> None:
        """Take parts until there are none."""
        while True:
            try:
                part = self.left.popleft()
            except IndexError:
                return
            try:
                self.done.put(self.work(part))
            except Exception as error:
                self.done.put(error)

    def finished(self) -> int:
        """Help, wait for the others, and put together what came of it."""
        flags = 0
        try:
            self.help()
            for _ in range(self.parts):
                answer = self.done.get()
                if isinstance(answer, Exception):
                    raise answer
                flags |= answer
        finally:
            self.left.clear()
        return flags


class _Crew:
    """Threads that wait for jobs, as many as were ever wanted."""

    def __init__(self):
        self._jobs: SimpleQueue[_Job] = SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._lock = threading.Lock()

    def give(self, job: _Job, threads: int) -> None:
        """Let so many threads help with a job."""
        with self._lock:
            for number in range(len(self._threads), threads):
                self._threads.append(threading.Thread(target=self._work, name=f"articulated-{number}", daemon=True))
                self._threads[-1].start()
        for _ in range(threads):
            self._jobs.put(job)

    def _work(self) -> None:
        while True:
            self._jobs.get().help()


_crew = _Crew()


@cache
def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_crew.__init__)  # threads do not survive a fork
