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
from functools import cache, cached_property
from typing import Any

import numpy as np

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
        self._busy = threading.Lock()
        self._most = (most or os.cpu_count() or 1) - 1
        self._threads: list[threading.Thread] = []
        self._words = (ctypes.c_int64 * len(_WORDS))(_CLOSED)
        self._job = np.ctypeslib.as_array(self._words)
        self._scratch = np.empty(0, np.uint8)

    def take(self, kernel: int, scratch_bytes: int, batch: int, size: int, tile: int, threads: int) -> np.ndarray | None:
        """A job for so many threads, to be `run` and in any case to be `done` with; None if the crew has one already.

        Args:
            kernel: address of a kernel's function; the job still wants its `TABLE`.
            scratch_bytes: what a thread needs.
            batch, size: number of states, and how many make a part.
            tile: see `lowering`.
            threads: how many, this one among them.
        """
        if not self._busy.acquire(blocking=False):
            return None
        words = self._words
        try:
            helpers = self._enlisted(min(threads - 1, self._most))
            each = -(-scratch_bytes // 64) * 64
            room = (len(self._threads) + 2) * each  # for all: one that was called for an earlier job may just be coming
            if self._scratch.size < room:
                self._scratch = np.empty(room, np.uint8)
            scratch = -(-self._scratch.ctypes.data // 64) * 64
            while words[_PLACE["inside"]]:  # one is just leaving
                pass
            words[4:13] = kernel, 0, scratch, each, batch, size, -(-batch // size), tile, helpers
        except BaseException:
            self._busy.release()
            raise
        return self._job

    def run(self, job: np.ndarray) -> int:
        """Do a job; what the kernel's calls returned, bits together."""
        return self._code.share(job.ctypes.data)

    def done(self) -> None:
        """Nothing more is wanted of the job."""
        self._busy.release()

    def _enlisted(self, wanted: int) -> int:
        """See that so many threads wait for jobs."""
        words, code = self._words, self._code
        if not words[SHARE]:
            functions = (_PYTHON.PyThread_acquire_lock, _PYTHON.PyThread_release_lock, _PYTHON.PyThread_acquire_lock_timed)
            acquire, release, nap = (ctypes.cast(function, ctypes.c_void_p).value for function in functions)
            self._locks, self._asleep = ((ctypes.c_int64 * max(1, self._most))() for _ in range(2))
            arrays = ctypes.addressof(self._locks), ctypes.addressof(self._asleep)
            words[13:20] = code.share_address, *arrays, acquire, release, nap, _held_lock()
        for number in range(len(self._threads), wanted):
            self._locks[number] = lock = _held_lock()
            arguments = ctypes.addressof(words), lock, number + 1
            self._threads.append(threading.Thread(target=code.serve, args=arguments, name=f"articulated-{number}", daemon=True))
            self._threads[-1].start()
        return wanted

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
    """What the threads run."""

    def __init__(self):
        from articulated.compiler.machine import machine

        on = machine()
        rest = "@llvm.aarch64.hint(i32 1)" if on.name == "neon" else "@llvm.x86.sse2.pause()"
        text = _TEXT.replace("@rest@", f"call void {rest}") + f"declare void {rest.replace(' 1', '')}\n"
        for name, place in _PLACE.items():
            text = text.replace(f"@{name}@", f"getelementptr i64, ptr %job, i64 {place}")
        self._engine = on.load([on.object_code(text)])
        self.share_address: int = self._engine.get_function_address("share")
        self.share = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)(self.share_address)
        serve: Any = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)
        self.serve = serve(self._engine.get_function_address("serve"))


_TEXT = f"""
; take parts until there are none
define internal void @work(ptr %job, i64 %number) {{
start:
  %next = @next@
  %at_parts = @parts@
  br label %claim
claim:
  %part = atomicrmw add ptr %next, i64 1 seq_cst
  %parts = load i64, ptr %at_parts
  %some = icmp slt i64 %part, %parts
  br i1 %some, label %do, label %leave
do:
  %at_size = @size@
  %size = load i64, ptr %at_size
  %begin = mul i64 %part, %size
  %ahead = add i64 %begin, %size
  %at_end = @end@
  %last = load i64, ptr %at_end
  %end = call i64 @llvm.smin.i64(i64 %ahead, i64 %last)
  %at_scratch = @scratch@
  %scratch = load ptr, ptr %at_scratch
  %at_bytes = @scratch_bytes@
  %bytes = load i64, ptr %at_bytes
  %offset = mul i64 %bytes, %number
  %own = getelementptr i8, ptr %scratch, i64 %offset
  %at_table = @table@
  %table = load ptr, ptr %at_table
  %at_tile = @tile@
  %tile = load i64, ptr %at_tile
  %at_kernel = @kernel@
  %kernel = load ptr, ptr %at_kernel
  %raised = call i64 %kernel(ptr %table, ptr %own, i64 %begin, i64 %end, i64 %tile)
  %flags = @flags@
  %before = atomicrmw or ptr %flags, i64 %raised seq_cst
  %finished = @finished@
  %count = atomicrmw add ptr %finished, i64 1 seq_cst
  br label %claim
leave:
  ret void
}}

; whether there is something to do for a helper
define internal i1 @wanted(ptr %job, i64 %number) {{
start:
  %next = @next@
  %at_parts = @parts@
  %at_helpers = @helpers@
  %part = load atomic i64, ptr %next seq_cst, align 8
  %parts = load atomic i64, ptr %at_parts seq_cst, align 8
  %helpers = load atomic i64, ptr %at_helpers seq_cst, align 8
  %some = icmp slt i64 %part, %parts
  %called = icmp sle i64 %number, %helpers
  %both = and i1 %some, %called
  ret i1 %both
}}

; what a helper does all its life
define void @serve(ptr %job, ptr %lock, i64 %number) {{
start:
  %inside = @inside@
  %at_acquire = @acquire@
  %at_sleepers = @asleep@
  %sleepers = load ptr, ptr %at_sleepers
  %k = sub i64 %number, 1
  %asleep = getelementptr i64, ptr %sleepers, i64 %k
  br label %look
look:
  %looks = phi i64 [ 0, %start ], [ 0, %enter ], [ %looks.next, %look.on ]
  %open = call i1 @wanted(ptr %job, i64 %number)
  br i1 %open, label %enter, label %look.on
look.on:
  @rest@
  %looks.next = add i64 %looks, 1
  %alert = icmp slt i64 %looks, {_ALERT}
  br i1 %alert, label %look, label %sleep
sleep:
  store atomic i64 1, ptr %asleep seq_cst, align 8
  %late = call i1 @wanted(ptr %job, i64 %number)
  br i1 %late, label %stay, label %wait
stay:
  %was = atomicrmw xchg ptr %asleep, i64 0 seq_cst
  %alone = icmp eq i64 %was, 1
  br i1 %alone, label %enter, label %wait
wait:
  %acquire = load ptr, ptr %at_acquire
  %acquired = call i32 %acquire(ptr %lock, i32 1)
  br label %enter
enter:
  %entering = atomicrmw add ptr %inside, i64 1 seq_cst
  call void @work(ptr %job, i64 %number)
  %leaving = atomicrmw sub ptr %inside, i64 1 seq_cst
  br label %look
}}

; do a job with the others
define i64 @share(ptr %job) {{
start:
  %flags = @flags@
  %finished = @finished@
  %next = @next@
  store i64 0, ptr %flags
  store i64 0, ptr %finished
  store atomic i64 0, ptr %next seq_cst, align 8
  %at_release = @release@
  %release = load ptr, ptr %at_release
  %at_locks = @locks@
  %locks = load ptr, ptr %at_locks
  %at_sleepers = @asleep@
  %sleepers = load ptr, ptr %at_sleepers
  %at_helpers = @helpers@
  %helpers = load i64, ptr %at_helpers
  br label %wake
wake:
  %k = phi i64 [ 0, %start ], [ %k.next, %awake ]
  %more = icmp slt i64 %k, %helpers
  br i1 %more, label %one, label %help
one:
  %asleep = getelementptr i64, ptr %sleepers, i64 %k
  %was = atomicrmw xchg ptr %asleep, i64 0 seq_cst
  %sleeps = icmp eq i64 %was, 1
  br i1 %sleeps, label %rouse, label %awake
rouse:
  %at_lock = getelementptr i64, ptr %locks, i64 %k
  %lock = load ptr, ptr %at_lock
  call void %release(ptr %lock)
  br label %awake
awake:
  %k.next = add i64 %k, 1
  br label %wake
help:
  call void @work(ptr %job, i64 0)
  %at_parts = @parts@
  %parts = load i64, ptr %at_parts
  br label %wait
wait:
  %spins = phi i64 [ 0, %help ], [ %spins.next, %wait.on ], [ 0, %sleep ]
  %count = load atomic i64, ptr %finished seq_cst, align 8
  %done = icmp eq i64 %count, %parts
  br i1 %done, label %close, label %wait.on
wait.on:
  @rest@
  %spins.next = add i64 %spins, 1
  %patient = icmp slt i64 %spins, {_ALERT}
  br i1 %patient, label %wait, label %sleep
sleep:
  %at_nap = @nap@
  %nap = load ptr, ptr %at_nap
  %at_never = @never@
  %never = load ptr, ptr %at_never
  %waited = call i32 %nap(ptr %never, i64 50, i32 0)
  br label %wait
close:
  store atomic i64 {_CLOSED}, ptr %next seq_cst, align 8
  %result = load i64, ptr %flags
  ret i64 %result
}}

declare i64 @llvm.smin.i64(i64, i64)
"""
