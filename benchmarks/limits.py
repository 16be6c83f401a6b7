"""What the core can do at most, and what work takes: fused multiply-adds, and bytes moved to and from memory."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence

import numpy as np
from timing import median, timed, turns

_WEIGHTS = {"fma": 2, "fms": 2, "fnma": 2, "add": 1, "sub": 1, "mul": 1, "div": 1, "sqrt": 1}


def flops(nodes: Iterable[Sequence]) -> int:
    """Floating-point operations of a compiled program, a fused multiply-add as two."""
    return sum(_WEIGHTS.get(node[0], 0) for node in nodes)


def peak() -> float:
    """A loop of nothing but fused multiply-adds of float64; float32 has twice as many [flop/s]."""
    from articulated.compiler.machine import machine

    on = machine()
    lanes, chains = on.register // 8, 12
    V = f"<{lanes} x double>"
    phis = [f"  %a{k} = phi {V} [ zeroinitializer, %entry ], [ %b{k}, %loop ]" for k in range(chains)]
    work = [f"  %b{k} = call {V} @llvm.fma.v{lanes}f64({V} %x, {V} %x, {V} %a{k})" for k in range(chains)]
    sums = [f"  %s{k + 1} = fadd {V} {'%b0' if k == 0 else f'%s{k}'}, %b{k + 1}" for k in range(chains - 1)]
    text = f"""
define void @work(i64 %n, ptr %p) {{
entry:
  %x = load {V}, ptr %p, align 8
  br label %loop
loop:
  %k = phi i64 [ 0, %entry ], [ %next, %loop ]
{chr(10).join(phis + work)}
  %next = add i64 %k, 1
  %more = icmp slt i64 %next, %n
  br i1 %more, label %loop, label %end
end:
{chr(10).join(sums)}
  store {V} %s{chains - 1}, ptr %p, align 8
  ret void
}}
declare {V} @llvm.fma.v{lanes}f64({V}, {V}, {V})
"""
    engine = on.load([on.object_code(text)])
    work_function = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_void_p)(engine.get_function_address("work"))
    numbers, count = np.zeros(lanes), 200_000
    taken = turns({"peak": timed(lambda: work_function(count, numbers.ctypes.data))})
    return 2.0 * lanes * chains * count / median(taken, "peak")


def bandwidth() -> float:
    """Copying an array that no cache holds: bytes read and bytes written [B/s]."""
    source = np.ones(1 << 25)
    target = np.empty_like(source)
    taken = turns({"copy": timed(lambda: np.copyto(target, source), 0.0)}, 7)
    return 2.0 * source.nbytes / median(taken, "copy")
