"""Threads that share a batch, in machine code from waking up to going to sleep.

A batch is cut into more parts than there are threads, and whoever is free takes the next: so one that wakes up late, or is held
up, takes fewer. The one who asks takes part, and waits for the last part to be done.

A thread without a job looks out for the next one for a while (`_ALERT`) before it goes to sleep on a lock: waking it takes some
50 µs, and then it may find itself on the processor of the one who woke it.

A job is an array of integers that the threads have in common (`_WORDS`). Nobody writes a new one while a thread is inside; and
as long as none is open, `next` is so large that a thread which wakes up late finds nothing to do.
"""

from __future__ import annotations

import ctypes
import os
import threading
import time
from functools import cache, cached_property, partial
from typing import Any

import numpy as np

from articulated.compiler.ir import ATTRIBUTES, Format, Text

_WORDS = (
    *("next", "finished", "inside", "flags"),  # changed by all
    *("kernel", "table", "scratch", "scratch_bytes", "end", "size", "parts", "tile", "helpers"),  # what is to be done
    *("share", "locks", "asleep", "acquire", "release", "nap", "never"),  # the crew's own
)
_PLACE = {name: place for place, name in enumerate(_WORDS)}
SHARE, TABLE = _PLACE["share"], _PLACE["table"]
_CLOSED = 1 << 62
_ALERT = 5000
"""How often a thread without a job looks for one before it goes to sleep: for some 100 µs."""

_PYTHON = ctypes.pythonapi
_PYTHON.PyThread_allocate_lock.restype = ctypes.c_void_p
_PYTHON.PyThread_acquire_lock.argtypes = [ctypes.c_void_p, ctypes.c_int]


def default_threads() -> int:
    """ARTICULATED_THREADS, or as many as there are cores for us."""
    given = os.environ.get("ARTICULATED_THREADS")
    if given:
        if not given.isdecimal() or int(given) < 1:
            raise ValueError(f"ARTICULATED_THREADS is {given!r}; expected a positive integer")
        return int(given)
    return _cores()


@cache
def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Crew:
    """Threads that wait for jobs, as many as were ever wanted."""

    def __init__(self, most: int | None = None):
        self._free = [None]  # taken away while there is a job
        self.done = partial(self._free.append, None)
        self._most = (most or os.cpu_count() or 1) - 1
        self._threads: list[threading.Thread] = []
        self._words = (ctypes.c_int64 * len(_WORDS))(_CLOSED)
        self._job = np.ctypeslib.as_array(self._words)
        self._scratch, self._line = np.empty(0, np.uint8), 0  # memory, and where in it a line begins

    def take(self, kernel: int, scratch_bytes: int, batch: int, size: int, tile: int, threads: int) -> np.ndarray | None:
        """A job for so many threads, to be `run`, and in any case to be `done()` with; None if the crew has one already.

        Args:
            kernel: address of a kernel's function; the job still wants its `TABLE`.
            scratch_bytes: what a thread needs.
            batch, size: number of states, and how many make a part.
            tile: see `lowering`.
            threads: how many, this one among them.
        """
        try:
            del self._free[0]
        except IndexError:
            return None
        try:
            words = self._words
            helpers = self._enlisted(min(threads - 1, self._most))
            each = -(-scratch_bytes // 64) * 64
            room = (len(self._threads) + 2) * each  # for all: one that was called for an earlier job may just be coming
            if self._scratch.size < room:
                self._scratch = np.empty(room, np.uint8)
                self._line = -(-self._scratch.ctypes.data // 64) * 64
            while words[_PLACE["inside"]]:  # one is just leaving
                time.sleep(20e-6)
            words[4:13] = kernel, 0, self._line, each, batch, size, -(-batch // size), tile, helpers
        except BaseException:
            self.done()
            raise
        return self._job

    def run(self, job: np.ndarray) -> int:
        """Do a job; what the kernel's calls returned, bits together."""
        return self._code.share(job.ctypes.data)

    def _enlisted(self, wanted: int) -> int:
        """See that so many threads wait for jobs; how many do."""
        words = self._words
        if not words[SHARE]:
            functions = (_PYTHON.PyThread_acquire_lock, _PYTHON.PyThread_release_lock, _PYTHON.PyThread_acquire_lock_timed)
            acquire, release, nap = (ctypes.cast(function, ctypes.c_void_p).value for function in functions)
            self._locks, self._asleep = ((ctypes.c_int64 * max(1, self._most))() for _ in range(2))
            arrays = ctypes.addressof(self._locks), ctypes.addressof(self._asleep)
            words[13:20] = self._code.share_address, *arrays, acquire, release, nap, _held_lock()
        for number in range(len(self._threads), wanted):
            self._locks[number] = _held_lock()
            self._threads.append(threading.Thread(target=self._serve, args=[number], name=f"articulated-{number}", daemon=True))
            try:
                self._threads[-1].start()
            except RuntimeError:  # no more threads, or Python is about to end
                del self._threads[-1]
                return number
        return wanted

    def _serve(self, number: int) -> None:
        self._code.serve(ctypes.addressof(self._words), self._locks[number], number + 1)

    @cached_property
    def _code(self) -> _Code:
        return _Code()


def _held_lock() -> int:
    """Address of a lock that must be released before anybody can have it."""
    lock = _PYTHON.PyThread_allocate_lock()
    _PYTHON.PyThread_acquire_lock(lock, 1)
    return lock


crew = Crew()

if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=crew.__init__)  # threads do not survive a fork


class _Code:
    """What the threads run: `share(job)`, which does a job with the others, and `serve(job, lock, number)`, a helper's life."""

    def __init__(self):
        from articulated.compiler.machine import machine

        on = machine()
        rest = "@llvm.aarch64.hint(i32 1)" if on.name == "neon" else "@llvm.x86.sse2.pause()"
        functions = _work(), _wanted(), _serve(f"call void {rest}"), _share(f"call void {rest}")
        declared = f"declare void {rest.replace(' 1', '')}", "declare i64 @llvm.smin.i64(i64, i64)"
        self._engine = on.load([on.object_code("\n".join([*functions, *declared, f"attributes #0 = {{ {ATTRIBUTES} }}"]))])
        self.share_address: int = self._engine.get_function_address("share")
        self.share = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)(self.share_address)
        serve: Any = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)
        self.serve = serve(self._engine.get_function_address("serve"))


class _Text(Text):
    """A function of a job."""

    def __init__(self):
        super().__init__(Format(1, single=False))

    def at_word(self, name: str) -> str:
        return self.entry("%job", _PLACE[name])

    def get(self, name: str, kind: str = "i64") -> str:
        return self.let(f"load {kind}, ptr {self.at_word(name)}")

    def now(self, name: str) -> str:
        """A word that others may be changing."""
        return self.let(f"load atomic i64, ptr {self.at_word(name)} seq_cst, align 8")

    def count(self, operation: str, name: str, by: int | str) -> str:
        """Change a word at once; what it was."""
        return self.let(f"atomicrmw {operation} ptr {self.at_word(name)}, i64 {by} seq_cst")

    def publish(self, name: str, x: int) -> None:
        self.do(f"store atomic i64 {x}, ptr {self.at_word(name)} seq_cst, align 8")


def _work() -> str:
    """Take parts until there are none."""
    text = _Text()
    text.go("claim")
    text.begin("claim")
    part = text.count("add", "next", 1)
    text.branch(text.let(f"icmp slt i64 {part}, {text.get('parts')}"), "do", "leave")
    text.begin("do")
    size = text.get("size")
    begin = text.integer("mul", part, size)
    end = text.integer("smin", text.integer("add", begin, size), text.get("end"))
    scratch = text.at(text.get("scratch", "ptr"), text.integer("mul", text.get("scratch_bytes"), "%number"))
    given = f"ptr {text.get('table', 'ptr')}, ptr {scratch}, i64 {begin}, i64 {end}, i64 {text.get('tile')}"
    text.count("or", "flags", text.let(f"call i64 {text.get('kernel', 'ptr')}({given})"))
    text.count("add", "finished", 1)
    text.go("claim")
    text.begin("leave")
    return text.function("void", "work", "ptr %job, i64 %number")


def _wanted() -> str:
    """Whether there is something to do for a helper."""
    text = _Text()
    some = text.let(f"icmp slt i64 {text.now('next')}, {text.now('parts')}")
    called = text.let(f"icmp sle i64 %number, {text.now('helpers')}")
    return text.function("i1", "wanted", "ptr %job, i64 %number", text.let(f"and i1 {some}, {called}"))


def _serve(rest: str) -> str:
    """Look out for a job, or sleep until woken; work; and so on."""
    text = _Text()
    asleep = text.entry(text.get("asleep", "ptr"), text.integer("sub", "%number", 1))
    text.go("again")
    text.begin("again")
    with text.loop(_ALERT):
        text.branch(text.let("call i1 @wanted(ptr %job, i64 %number)"), "enter", "rest")
        text.begin("rest")
        text.do(rest)
    text.do(f"store atomic i64 1, ptr {asleep} seq_cst, align 8")
    text.branch(text.let("call i1 @wanted(ptr %job, i64 %number)"), "stay", "sleep")
    text.begin("stay")  # unless somebody is waking it already
    text.branch(text.let(f"icmp eq i64 {text.let(f'atomicrmw xchg ptr {asleep}, i64 0 seq_cst')}, 1"), "enter", "sleep")
    text.begin("sleep")
    text.let(f"call i32 {text.get('acquire', 'ptr')}(ptr %lock, i32 1)")
    text.go("enter")
    text.begin("enter")
    text.count("add", "inside", 1)
    text.do("call void @work(ptr %job, i64 %number)")
    text.count("sub", "inside", 1)
    text.go("again")
    text.begin("never")
    return text.function("void", "serve", "ptr %job, ptr %lock, i64 %number", linkage="")


def _share(rest: str) -> str:
    """Open the job, wake who sleeps, work, wait for the last part, and close it."""
    text = _Text()
    text.publish("flags", 0)
    text.publish("finished", 0)
    text.publish("next", 0)
    locks, asleep = text.get("locks", "ptr"), text.get("asleep", "ptr")
    with text.loop(text.get("helpers")) as turn:
        was = text.let(f"atomicrmw xchg ptr {text.entry(asleep, turn.k)}, i64 0 seq_cst")
        text.branch(text.let(f"icmp eq i64 {was}, 1"), "rouse", "awake")
        text.begin("rouse")
        text.do(f"call void {text.get('release', 'ptr')}(ptr {text.word(locks, turn.k, 'ptr')})")
        text.go("awake")
        text.begin("awake")
    text.do("call void @work(ptr %job, i64 0)")
    parts = text.get("parts")
    text.go("wait")
    text.begin("wait")
    with text.loop(_ALERT):
        text.branch(text.let(f"icmp eq i64 {text.now('finished')}, {parts}"), "close", "rest")
        text.begin("rest")
        text.do(rest)
    text.let(f"call i32 {text.get('nap', 'ptr')}(ptr {text.get('never', 'ptr')}, i64 50, i32 0)")
    text.go("wait")
    text.begin("close")
    text.publish("next", _CLOSED)
    return text.function("i64", "share", "ptr %job", text.get("flags"), linkage="")
