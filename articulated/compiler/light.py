"""One state with as little overhead as Python allows: the kernel itself is a Python function.

Its code takes numpy arrays as CPython hands them to any function written in C, and looks at their headers (see
`Lowering.light`). What these headers are made of is part of numpy's binary interface; it is checked once, on an array.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from articulated.compiler.kernels import Kernel, headers_are_as_expected

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
    if not address or not headers_are_as_expected():
        return None
    context = (ctypes.c_int64 * 4).from_address(kernel.address("context"))
    context[:] = [id(np.ndarray), id(np.dtype(np.float64)), id(True), id(False)]
    method = _Method(kernel.name.encode(), address, _FASTCALL, None)
    owner = (kernel, method)  # the function keeps alive what it is made of
    make = ctypes.pythonapi.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    return make(ctypes.addressof(method), owner, None)
