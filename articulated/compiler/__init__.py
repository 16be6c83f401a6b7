"""Algorithms that are written over scalars, run on numpy arrays: compiled to machine code, or interpreted."""

from articulated.compiler.interpreter import as_scalars, evaluate, interpreting
from articulated.compiler.kernels import Kernel, compiled, kernels_of
from articulated.compiler.lowering import CHECK_FAILED, NOT_FINITE_IN, NOT_FINITE_OUT
from articulated.compiler.program import Array, Program, Rows, Tape
from articulated.compiler.threads import crew

__all__ = [
    "CHECK_FAILED",
    "NOT_FINITE_IN",
    "NOT_FINITE_OUT",
    "Array",
    "Kernel",
    "Program",
    "Rows",
    "Tape",
    "as_scalars",
    "compiled",
    "crew",
    "evaluate",
    "interpreting",
    "kernels_of",
]
