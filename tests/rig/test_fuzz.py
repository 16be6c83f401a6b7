"""Whatever a file holds, loading it ends in a rig or in a RigError: never in another error, and never in a rig that is not one."""

from __future__ import annotations

import random
import re

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import articulated as art

TEXT = {name: path.read_text() for name, path in art.shipped_rigs().items()}
TOKENS = [
    "",
    "0",
    "-1",
    "nan",
    "inf",
    "1e308",
    "1e29",
    "1e-29",
    "1e-320",
    "x",
    "<",
    "</joint>",
    "<mimic joint='hinge'/>",
    "fixed",
    "ball",
    "\0",
    "é",
    "∞",
]


def loads_or_is_refused(text: str, root: str) -> None:
    try:
        rig = art.load(text, root)
    except art.RigError:
        return
    assert np.isfinite(rig.mass)
    assert rig.neutral().shape == (rig.nq,)
    assert np.isfinite(rig.random(0)).all()
    assert len(rig.q_names) == rig.nq
    art.load(rig.to_urdf(), root)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(sorted(TEXT)), st.randoms(use_true_random=False), st.sampled_from(["fixed", "free", "planar"]))
def test_one_value_exchanged(name, rng: random.Random, root):
    values = list(re.finditer(r'(?<==")[^"]*(?=")', TEXT[name]))
    at = rng.choice(values)
    text = TEXT[name][: at.start()] + rng.choice(TOKENS) + TEXT[name][at.end() :]
    loads_or_is_refused(text, root)


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(sorted(TEXT)), st.randoms(use_true_random=False))
def test_one_line_lost_or_doubled(name, rng: random.Random):
    lines = TEXT[name].splitlines()
    at = rng.randrange(len(lines))
    lines[at : at + 1] = rng.choice([[], [lines[at]] * 2, lines[at : at + 5] * 2])
    loads_or_is_refused("\n".join(lines), "free")


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(sorted(TEXT)), st.integers(0, 10_000), st.text(max_size=5))
def test_a_piece_put_in_anywhere(name, at, piece):
    loads_or_is_refused(TEXT[name][:at] + piece + TEXT[name][at:], "fixed")


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=200))
def test_any_bytes(data):
    try:
        art.load(data)
    except art.RigError:
        pass
    else:
        raise AssertionError("noise made a rig")
