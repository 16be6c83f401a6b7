"""Plain arguments with as little overhead as Python allows: the kernel itself is a Python function.

Its code takes numpy arrays as CPython hands them to any function written in C, and looks at their headers: it refuses whatever
is not a plain array of the expected shape, for one state or for a batch. What these headers are made of is part of numpy's
binary interface: data, number of axes, shape, strides, base, type. It is checked once, on an array.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable
from functools import cache

import numpy as np

from articulated.compiler.ir import Format, Text
from articulated.compiler.program import Program
from articulated.compiler.threads import SHARE, TABLE

STACK = 256 << 10
"""Bytes of scratch that the function may take from the stack."""
_OBJECT = object.__basicsize__
"""Bytes of a Python object before what is its own."""
_FASTCALL = 0x80
_WORD = ctypes.c_int64
_PYTHON = ctypes.pythonapi


def light_text(program: Program, f: Format, scratch: int, tile: int) -> str:
    """`light(self, args, nargs)`, a Python function in C: takes numpy arrays, returns whether all went well.

    With one lane it is for one state, and else for a batch, with a job (see `Crew.take`) or None as last argument.
    """
    text = Text(f)
    arrays = (*program.arguments, *program.results)
    batch = f.lanes > 1

    def demand(a: str, b: int | str, comparison: str = "eq i64") -> None:
        accepted = text.label()
        text.branch(text.let(f"icmp {comparison} {a}, {b}"), accepted, "refuse")
        text.begin(accepted)

    text.do(f"%table = alloca [{4 * len(arrays)} x i64]")
    text.do(f"%scratch = alloca [{scratch * tile} x i8], align 64")
    demand("%nargs", len(arrays) + batch)
    array_type, number_type = text.word("@context", 0), text.word("@context", 1)
    states = "1"
    for a, array in enumerate(arrays):
        given = text.word("%args", a, "ptr")
        header = text.at(given, _OBJECT)
        demand(text.word(text.at(given, _OBJECT - 8)), array_type)
        demand(text.word(header, 5), number_type)
        demand(text.load(text.at(header, 8), "i32", 4), len(array.shape) + batch, "eq i32")
        shape, strides = text.word(header, 2, "ptr"), text.word(header, 3, "ptr")
        step = f.bytes * array.size
        if batch:
            count = text.word(shape)
            if a == 0:
                states = count
                demand(states, 0, "sgt i64")
            demand(count, states)
            demand(text.word(strides), step)
        for k, n in enumerate(array.shape, start=batch):
            step //= max(n, 1)
            demand(text.word(shape, k), n)
            demand(text.word(strides, k), step)
        data = text.word(header)
        demand(text.integer("and", data, f.bytes - 1), 0)
        for k, x in enumerate((data, f.bytes * array.size, 0, 0)):
            text.keep(x, text.entry("%table", 4 * a + k))
    call = f"call i64 @kernel(ptr %table, ptr %scratch, i64 0, i64 {states}, i64 {tile})"
    demand(_unlocked(text, call, text.word("%args", len(arrays))) if batch else text.let(call), 0)
    accepted = text.block
    text.go("return")
    text.begin("refuse")
    text.go("return")
    text.begin("return")
    answer = text.word("@context", text.let(f"phi i64 [ 2, %{accepted} ], [ 3, %refuse ]"), "ptr")
    if sys.version_info < (3, 12):  # later, True and False count no references
        text.keep(text.integer("add", text.word(answer), 1), answer)
    function = text.function("ptr", "light", "ptr %self, ptr %args, i64 %nargs", answer, linkage="")
    return f"@context = global [7 x i64] zeroinitializer\n{function}"


def _unlocked(text: Text, call: str, job: str) -> str:
    """The flags of a batch's kernel, or of a job, if one is given; meanwhile other threads of Python may run."""
    alone = text.let(f"icmp eq i64 {job}, {text.word('@context', 6)}")
    thread = text.let(f"call ptr {text.word('@context', 4, 'ptr')}()")
    text.branch(alone, "alone", "share")
    text.begin("alone")
    own = text.let(call)
    text.go("called")
    text.begin("share")
    job = text.word(text.at(text.let(f"inttoptr i64 {job} to ptr"), _OBJECT), 0, "ptr")
    text.do(f"store ptr %table, ptr {text.entry(job, TABLE)}")
    shared = text.let(f"call i64 {text.word(job, SHARE, 'ptr')}(ptr {job})")
    text.go("called")
    text.begin("called")
    flags = text.let(f"phi i64 [ {own}, %alone ], [ {shared}, %share ]")
    text.do(f"call void {text.word('@context', 5, 'ptr')}(ptr {thread})")
    return flags


class _Method(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = [
        ("name", ctypes.c_char_p),
        ("function", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    ]


def light_function(name: str, f: Format, address_in: Callable[[str], int], owner: object) -> Callable[..., bool] | None:
    """The function of a kernel: takes arguments and results, says whether it could do it; None if there is none.

    Args:
        name: for people.
        f: the kernel's.
        address_in: finds a name in its code.
        owner: keeps the code alive.
    """
    address = address_in("light")
    if not address or not headers_are_as_expected():
        return None
    number = np.dtype(np.float32 if f.single else np.float64)
    others = (ctypes.cast(x, ctypes.c_void_p).value for x in (_PYTHON.PyEval_SaveThread, _PYTHON.PyEval_RestoreThread))
    context = (_WORD * 7).from_address(address_in("context"))
    context[:] = [id(np.ndarray), id(number), id(True), id(False), *others, id(None)]
    method = _Method(name.encode(), address, _FASTCALL, None)
    parts = (owner, method)  # the function keeps alive what it is made of
    make = _PYTHON.PyCFunction_NewEx
    make.restype, make.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p]
    return make(ctypes.addressof(method), parts, None)


def address_of(array: np.ndarray) -> int:
    """Where an array's numbers begin."""
    if headers_are_as_expected():  # the quick way
        return _WORD.from_address(id(array) + _OBJECT).value
    return array.__array_interface__["data"][0]


@cache
def headers_are_as_expected() -> bool:
    """Whether numpy arrays begin as they do by numpy's binary interface."""
    if sys.implementation.name != "cpython" or ctypes.sizeof(ctypes.c_void_p) != 8:
        return False
    array = np.zeros((3, 5))
    word = (_WORD * 6).from_address(id(array) + _OBJECT)
    shape, strides = ((_WORD * 2).from_address(word[k]) for k in (2, 3))
    return (
        (word[0], word[1] & 0xFFFFFFFF, word[5]) == (array.__array_interface__["data"][0], 2, id(array.dtype))
        and (tuple(shape), tuple(strides)) == ((3, 5), (40, 8))
        and _WORD.from_address(id(array) + _OBJECT - 8).value == id(np.ndarray)
    )
