"""Streams: what a kernel writes, and what it leaves."""

import numpy as np
import pytest

from articulated.compiler.streams import Stream, planes, stream_kernel


@pytest.mark.parametrize("turns", [1, 3])
def test_what_is_fixed_stays(turns):
    stream = Stream("test", 1, 2, 2, lambda carried, fixed, n: [carried[0] + fixed[0] * fixed[1] * n[1], n[0] + n[1], n[1]])
    memory = planes([np.arange(70.0), np.full(70, 2.0), np.full(70, 3.0)])
    arrays = [(plane, plane.itemsize, 0, None) for plane in (*memory, np.array([0.0, 0.5]))]
    stream_kernel(stream, single=False)(arrays, memory.shape[1], 1, [turns], turns)
    assert np.array_equal(memory[:, :70], [np.arange(70.0) + 3.0 * turns, np.full(70, 2.0), np.full(70, 3.0)])
