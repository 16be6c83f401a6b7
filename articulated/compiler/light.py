"""One state with as little overhead as Python allows: the kernel itself is a Python function.

Its code takes numpy arrays as CPython hands them to any function written in C, and looks at their headers (see
`Lowering.light`). What these headers are made of is part of numpy's binary interface; it is checked once, on an array.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np

from articulated.compiler.kernels import Kernel
from articulated.compiler.lowering import OBJECT

_FASTCALL = 0x80


class _Method(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    ]


def light_function(kernel: Kernel) -> Callable[..., bool] | None:
    """The function of a kernel with one lane: takes its arguments and results, says whether it could; None if there is none."""
    address = kernel.address("light")
    if not address or not _headers_are_as_expected():
        return None
    context = (ctypes.c_int64 * 4).from_address(kernel.address("context"))
    context[:] = [id(np.ndarray), id(np.dtype(np.float64)), id(True), id(False)]
    method = _Method(kernel.name.encode(), address, _FASTCALL, None)
    owner = (kernel, method)  # the function keeps alive what it is made of
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    return make(ctypes.addressof(method), owner, None)


@cache
def _headers_are_as_expected() -> bool:
    try:
        import sys

        if sys.implementation.name != "cpython" or ctypes.sizeof(ctypes.c_void_p) != 8:
            return False
        array = np.zeros((3, 5))
        word = (ctypes.c_int64 * 6).from_address(id(array) + OBJECT)
        shape, strides = ((ctypes.c_int64 * 2).from_address(word[k]) for k in (2, 3))
        return (
            word[0] == array.ctypes.data
            and word[1] & 0xFFFFFFFF == 2
            and tuple(shape) == (3, 5)
            and tuple(strides) == (40, 8)
            and word[5] == id(array.dtype)
            and ctypes.c_int64.from_address(id(array) + OBJECT - 8).value == id(np.ndarray)
        )
    except (ValueError, AttributeError):
        return False
