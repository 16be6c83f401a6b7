"""Elementary functions over scalars: a float, a numpy array (one value per state) or a traced expression.

The algorithms of this project are written once, over scalars, and never branch on a value: a choice is a `where`.
A float goes to `math`, an array to numpy, anything else is asked for a method of the same name.
A float outside a function's domain gives NaN, as numpy does, so that a state that diverged stays data.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, reduce
from typing import Any

import numpy as np

Scalar = Any
"""A float, a numpy array or a traced expression; see the module's first lines."""

_NUMPY = (np.ndarray, np.generic)


def _elementary(name: str, of_float: Callable[[Any], float]) -> Callable[..., Scalar]:
    of_array = getattr(np, name)

    def function(x: Scalar) -> Scalar:
        if isinstance(x, (float, int)) and not isinstance(x, np.generic):
            try:
                return of_float(x)
            except (ValueError, OverflowError):
                return math.nan
        if isinstance(x, _NUMPY):
            return of_array(x)
        return getattr(x, name)()

    function.__name__ = name
    function.__doc__ = f"{name}(x), elementwise."
    return function


sin = _elementary("sin", math.sin)
cos = _elementary("cos", math.cos)
sqrt = _elementary("sqrt", math.sqrt)
exp = _elementary("exp", math.exp)
log = _elementary("log", math.log)
absolute = _elementary("absolute", abs)


def atan2(y: Scalar, x: Scalar) -> Scalar:
    """The angle of the point (x, y) [rad], in [-π, π]."""
    for operand in (y, x):
        if not isinstance(operand, (float, int, *_NUMPY)):
            return operand.atan2(y, x)
    if isinstance(y, np.ndarray) or isinstance(x, np.ndarray):
        return np.arctan2(y, x)
    return math.atan2(y, x)


def reciprocal(x: Scalar) -> Scalar:
    """1/x; of the float 0 it is infinite, as of an array's."""
    if isinstance(x, float) and x == 0.0:
        return math.copysign(math.inf, x)
    return 1.0 / x


def where(condition: Scalar, a: Scalar, b: Scalar) -> Scalar:
    """`a` where the condition holds, else `b`. Both are evaluated: keep each free of a division by zero."""
    if isinstance(condition, (bool, np.bool_)):
        return a if condition else b
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    return condition.where(a, b)


def given(condition: Scalar, value: Callable[[], Nested], otherwise: Nested) -> Nested:
    """As `where`, of all that `value` returns; machine code skips the work behind it where no state of a group needs it."""
    if isinstance(condition, (bool, np.bool_)):
        return value() if condition else otherwise
    if isinstance(condition, np.ndarray):
        pairs = zip(flatten(value()), flatten(otherwise), strict=True)
        return rebuilt(otherwise, iter([np.where(condition, a, b) for a, b in pairs]))
    return condition.given(value, otherwise)


def either(condition: Scalar, a: Nested, b: Nested) -> Nested:
    """As `where`, of two things of one structure."""
    return rebuilt(b, iter([where(condition, x, y) for x, y in zip(flatten(a), flatten(b), strict=True)]))


def minimum(a: Scalar, b: Scalar) -> Scalar:
    """The smaller of two scalars."""
    return where(a < b, a, b)


def maximum(a: Scalar, b: Scalar) -> Scalar:
    """The larger of two scalars."""
    return where(a > b, a, b)


def least(values: Sequence[Scalar]) -> Scalar:
    """The smallest of some scalars."""
    return reduce(minimum, values)


def greatest(values: Sequence[Scalar]) -> Scalar:
    """The largest of some scalars."""
    return reduce(maximum, values)


def nearest(x: Scalar) -> Scalar:
    """The integer nearest to x, the even one of two."""
    if isinstance(x, _NUMPY):
        return np.rint(x)
    if isinstance(x, (float, int)):
        return float(round(x)) if math.isfinite(x) else x
    return x.nearest()


def lookup(table: Any, k: Scalar) -> Scalar:
    """Entry k of a table that all states share: a numpy array, shape (n,), or what a tape calls one.

    What is no index takes the nearest that is one; what is not a number takes the first.
    """
    k = where(k > 0.0, k, 0.0)
    k = where(k < len(table) - 1.0, k, len(table) - 1.0)
    if isinstance(k, _NUMPY):
        return table[k.astype(np.intp)]
    if isinstance(k, (float, int)):
        return float(table[int(k)])
    return table.entry(k)


def unfolded(x: Scalar, among: Iterable[Scalar]) -> Scalar:
    """A scalar that no compiler simplifies anything with: what it meets has the bits that it has beside any variable.

    `among` holds some of the scalars that it will meet, of which one at least is no constant.
    """
    return next((scalar.unfolded(x) for scalar in among if hasattr(scalar, "unfolded")), x)


def as_written(value: Callable[[], Nested], among: Iterable[Scalar]) -> Nested:
    """What `value` returns; a compiler keeps the order in which its operations are written, which is one that suits registers.

    `among` holds some of the scalars that it computes with, of which one at least is no constant. It has no branches.
    """
    tracer = next((scalar.as_written for scalar in among if hasattr(scalar, "as_written")), None)
    return value() if tracer is None else tracer(value)


def rounding(x: Scalar) -> float:
    """The distance from 1 to the next number of the precision in which `x` is computed."""
    if isinstance(x, _NUMPY) and x.dtype == np.float32:
        return float(np.finfo(np.float32).eps)
    return float(np.finfo(np.float64).eps) if isinstance(x, (float, int, *_NUMPY)) else x.rounding


def is_zero(x: Scalar) -> bool:
    """Whether `x` is the constant 0, known before any state is: a question about the program, not about a value."""
    return isinstance(x, (float, int)) and x == 0


Nested = Any
"""A scalar, or a list, tuple or dataclass of them, nested to any depth."""


def flatten(nested: Nested) -> list[Scalar]:
    """The scalars of a nested structure, in order; None holds none."""
    result: list[Scalar] = []
    _gather(nested, result)
    return result


def _gather(nested: Nested, result: list[Scalar]) -> None:
    kind = type(nested)
    if kind is float:
        result.append(nested)
    elif kind is list or kind is tuple:
        for part in nested:
            _gather(part, result)
    elif names := _parts(kind):
        for name in names:
            _gather(getattr(nested, name), result)
    elif nested is not None:
        result.append(nested)


def rebuilt(like: Nested, scalars: Iterator[Scalar]) -> Nested:
    """A structure like the one given, of other scalars."""
    kind = type(like)
    if kind is list or kind is tuple:
        return kind([rebuilt(part, scalars) for part in like])
    if names := _parts(kind):
        return kind(*[rebuilt(getattr(like, name), scalars) for name in names])
    return None if like is None else next(scalars)


@cache
def _parts(kind: type) -> tuple[str, ...]:
    """The names of what a dataclass is made of, in the order in which it takes them; of anything else, none."""
    return tuple(part.name for part in fields(kind)) if is_dataclass(kind) else ()


UNDEFINED = math.nan
"""In place of what nobody will look at."""


def each(rows: Sequence[Nested], body: Callable[[Nested], Nested]) -> list[Nested]:
    """What `body` makes of each of some rows of one structure: machine code has it once, and goes from row to row.

    So work on many things of a kind takes as much code as on one. Nothing is known of a row while the body is compiled: what
    is a constant in all rows but not the same in all is a variable in it. What is `given` under a mask, or else `UNDEFINED`, is
    not even written where no state of a group needs it.
    """
    flat = [flatten(row) for row in rows]
    others = [x for row in flat for x in row if type(x) is not float]
    for x in others:
        if hasattr(x, "graph"):
            return x.each(rows, body)
    arrays = [x for x in others if isinstance(x, np.ndarray)]
    if not arrays or len(rows) == 1:
        return [body(row) for row in rows]
    shape, dtype = np.broadcast_shapes(*(x.shape for x in arrays)), np.result_type(*arrays)

    def stacked(column: Sequence[Scalar]) -> Scalar:
        if all(x is column[0] for x in column):
            return column[0]
        if not any(isinstance(x, np.ndarray) for x in column):
            return np.array(column, dtype).reshape(-1, *[1] * len(shape))
        result = np.empty((len(column), *shape), dtype)
        for r, x in enumerate(column):
            result[r] = x
        return result

    made = body(rebuilt(rows[0], iter([stacked(column) for column in zip(*flat, strict=True)])))
    count = len(rows)
    parts = [np.broadcast_to(x, (count, *shape)) if isinstance(x, np.ndarray) else [x] * count for x in flatten(made)]
    return [rebuilt(made, iter([part[r] for part in parts])) for r in range(count)]


def fold(rows: Sequence[Nested], body: Callable[[Nested, Nested], Nested], carry: Nested) -> Nested:
    """What `carry` becomes when `body` takes it together with each of some rows of one structure: a loop as that of `each`."""
    for x in flatten(rows):
        if hasattr(x, "graph"):
            return x.fold(rows, body, carry)
    for row in rows:
        carry = body(carry, row)
    return carry


def repeat(
    count: Any,
    body: Callable[[Nested], Nested],
    carry: Nested,
    until: Callable[[Nested], Scalar] | None = None,
) -> Nested:
    """What `carry` becomes when `body` is applied to it `count` times: a loop that a compiler can see.

    Args:
        count: a number, or what a tape calls one (`Tape.parameter`).
        body: from what is carried to what is carried on; of one structure, and with no memory of its own.
        carry: what the first turn starts from.
        until: a state for which this mask holds takes no more turns; asked before each, the loop ends once it holds for all.
    """
    for x in flatten(carry):
        if hasattr(x, "graph"):
            return x.repeat(count, body, carry, until)
    for _ in range(count):
        if until is None:
            carry = body(carry)
            continue
        done = until(carry)
        if np.all(done):
            break
        new = [where(done, a, b) for a, b in zip(flatten(carry), flatten(body(carry)), strict=True)]
        carry = rebuilt(carry, iter(new))
    return carry
