"""Steps on the configuration manifold over all sizes that a float has, near zero, near π and beyond a turn."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import articulated as art

COMPONENT = st.one_of(
    st.floats(-1.7, 1.7),
    st.sampled_from([0.0, -0.0, 1e-300, 1e-160, 1e-18, -1e-9, 1e-8, 1e-5, 0.0099999, 0.01, 0.0100001]),
)


def build() -> art.Rig:
    """One joint of each kind, in a row."""
    builder = art.RigBuilder("row")
    builder.link("link0")
    for k, kind in enumerate(["revolute", "prismatic", "universal", "ball", "planar", "floating"], start=1):
        builder.link(f"link{k}", 1.0, inertia=(1.0, 1.0, 1.0))
        axis2 = (0, 0, 1) if kind == "universal" else None
        builder.joint(f"joint{k}", kind, f"link{k - 1}", f"link{k}", axis=(0, 1, 0), axis2=axis2)
    return builder.build()


RIG = build()
START = RIG.random(0)


@settings(max_examples=300, deadline=None)
@given(st.lists(COMPONENT, min_size=RIG.nv, max_size=RIG.nv))
def test_difference_inverts_integrate(dv):
    dv = np.array(dv)
    q = art.integrate(RIG, START, dv)
    np.testing.assert_allclose(art.difference(RIG, START, q), dv, rtol=1e-9, atol=1e-14)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=RIG.nv, max_size=RIG.nv))
def test_any_step_stays_on_the_manifold(dv):
    q = art.integrate(RIG, START, dv)
    assert np.isfinite(q).all()
    for name in ("joint4", "joint6"):
        np.testing.assert_allclose(np.linalg.norm(q[RIG.joints[name].q_slice][-4:]), 1.0, rtol=1e-15)
    assert np.isfinite(art.difference(RIG, START, q)).all()


@settings(max_examples=100, deadline=None)
@given(st.lists(COMPONENT, min_size=RIG.nv, max_size=RIG.nv), st.integers(2, 7))
def test_a_step_in_pieces_is_the_step(dv, pieces):
    q = START
    for _ in range(pieces):
        q = art.integrate(RIG, q, np.array(dv) / pieces)
    whole = art.integrate(RIG, START, dv)
    np.testing.assert_allclose(art.difference(RIG, whole, q), 0.0, atol=1e-13)
