"""Parts of a job: each is done once, whoever does it. Kernels here are Python functions, called from the crew's machine code."""

from __future__ import annotations

import ctypes
import threading
import time
from collections import Counter

import numpy as np
import pytest

import articulated as art
from articulated.compiler.threads import Crew, crew, default_threads

KERNEL = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 3)


@pytest.fixture(scope="module")
def four():
    return Crew(most=4)


def run(crew: Crew, work, batch: int, size: int, threads: int, scratch: int = 100) -> int:
    """Do a job whose kernel is `work(scratch, begin, end)`."""
    kernel = KERNEL(lambda table, scratch, begin, end, tile: work(scratch, begin, end))
    job = crew.take(ctypes.cast(kernel, ctypes.c_void_p).value, scratch, batch, size, 1, threads)
    assert job is not None
    try:
        return crew.run(job)
    finally:
        crew.done()


@pytest.mark.parametrize("threads", [1, 2, 4, 100])
@pytest.mark.parametrize(("batch", "size"), [(1, 1), (7, 2), (8, 2), (100, 3), (5, 9)])
def test_each_state_is_done_once(four, threads, batch, size):
    for _ in range(20):
        seen = Counter()

        def work(scratch, begin, end, seen=seen):
            seen.update(range(begin, end))
            return 1 << (begin // size % 30)

        flags = run(four, work, batch, size, threads)
        assert seen == Counter(range(batch))
        assert flags == sum(1 << k for k in range(min(30, -(-batch // size))))


def test_others_help(four):
    """Four parts that wait for each other need four threads, and each has memory of its own."""
    all_four = threading.Barrier(4, timeout=30)
    scratch = set()

    def work(own, begin, end):
        scratch.add(own)
        all_four.wait()
        return 0

    run(four, work, 4, 1, 4, scratch=1000)
    assert len(scratch) == 4
    assert all(own % 64 == 0 for own in scratch)
    assert min(np.diff(sorted(scratch))) >= 1000


def test_a_thread_that_is_held_up_takes_fewer(four):
    taken = Counter()

    def work(scratch, begin, end):
        taken[scratch] += 1
        time.sleep(0.2 if len(taken) == 2 and taken[scratch] == 1 else 0.002)
        return 0

    run(four, work, 30, 1, 2)
    assert sorted(taken.values()) in ([1, 29], [2, 28], [30])


def test_jobs_in_quick_succession(four):
    """A thread that comes after its job is done does no harm to the next one."""
    for k in range(3000):
        count = []
        run(four, lambda scratch, begin, end, count=count: count.append(begin) or 0, 1 + k % 5, 1, 1 + k % 4)
        assert sorted(count) == list(range(1 + k % 5))
        if k % 500 == 0:
            time.sleep(0.01)  # long enough for all to go to sleep


def test_one_job_at_a_time(rng):
    """Whoever finds the crew at work does without."""
    rig = art.load("buggy", root="free")
    states = rig.random(rng, 3000), *rng.normal(size=(2, 3000, rig.nv))
    expected = art.forward_dynamics(rig, *states, threads=1)
    job = crew.take(0, 0, 1, 1, 1, 1)
    assert job is not None
    try:
        assert crew.take(0, 0, 1, 1, 1, 1) is None
        assert art.forward_dynamics(rig, *states, threads=2).tobytes() == expected.tobytes()
        assert art.forward_dynamics(rig, *states[:2], tau=states[2], threads=2).tobytes() == expected.tobytes()
    finally:
        crew.done()

    answers = []
    callers = [
        threading.Thread(target=lambda: answers.extend(art.forward_dynamics(rig, *states, threads=2) for _ in range(20)))
        for _ in range(4)
    ]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert len(answers) == 80
    assert {answer.tobytes() for answer in answers} == {expected.tobytes()}


@pytest.mark.parametrize("given", ["0", "-1", "two", "1.5"])
def test_the_environment_is_looked_at(monkeypatch, given):
    monkeypatch.setenv("ARTICULATED_THREADS", given)
    with pytest.raises(ValueError, match=f"ARTICULATED_THREADS is '{given}'; expected a positive integer"):
        default_threads()
