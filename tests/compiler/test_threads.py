"""Parts of a job: each is done once, whoever does it, and what goes wrong in one is told."""

from __future__ import annotations

import threading
import time

import pytest

from articulated.compiler import threads
from articulated.compiler.threads import default_threads, shared


@pytest.fixture(autouse=True)
def four_cores(monkeypatch):
    monkeypatch.setattr(threads.os, "cpu_count", lambda: 4)


def test_each_part_is_done_once():
    done = []
    assert shared(lambda part: done.append(part) or 1 << part, 10, 3) == (1 << 10) - 1
    assert sorted(done) == list(range(10))


def test_others_help():
    """Two parts that wait for each other need two threads."""
    both = threading.Barrier(2, timeout=30)
    assert shared(lambda part: both.wait() and 0, 2, 2) == 0


def test_a_thread_that_is_held_up_takes_fewer():
    taken = {}

    def work(part: int) -> int:
        name = threading.current_thread().name
        taken[name] = taken.get(name, 0) + 1
        time.sleep(0.2 if taken[name] == 1 and name != "MainThread" else 0.001)
        return 0

    shared(work, 20, 2)
    assert taken["MainThread"] >= 15


@pytest.mark.parametrize("bad", range(4))
def test_errors_are_told(bad):
    def work(part: int) -> int:
        if part == bad:
            raise MemoryError(f"part {part}")
        return 0

    with pytest.raises(MemoryError, match=f"part {bad}"):
        shared(work, 4, 2)
    assert shared(lambda part: 1, 4, 2) == 1


def test_an_interrupt_stops_what_has_not_begun():
    done = []

    def work(part: int) -> int:
        if threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt
        time.sleep(0.01)
        done.append(part)
        return 0

    with pytest.raises(KeyboardInterrupt):
        shared(work, 1000, 2)
    time.sleep(0.1)
    assert len(done) < 20


@pytest.mark.parametrize("given", ["0", "-1", "two", "1.5"])
def test_the_environment_is_looked_at(monkeypatch, given):
    monkeypatch.setenv("ARTICULATED_THREADS", given)
    with pytest.raises(ValueError, match=f"ARTICULATED_THREADS is '{given}'; expected a positive integer"):
        default_threads()
