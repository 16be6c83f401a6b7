"""What every kind of joint can do, over scalars. One kind a file; a joint has no state, only q and v that it is given."""

from __future__ import annotations

from collections.abc import Sequence

from articulated.scalar import Scalar
from articulated.spatial import Motion, Pose


class JointModel:
    """A kind of joint, in body frames: its frame and its body's coincide when q is neutral.

    Here are the defaults, for a joint whose q is a vector (q̇ = v) and whose directions of motion are fixed in its body.
    """

    def pose(self, q: Sequence[Scalar]) -> Pose:
        """The body in the joint frame, RBDA X_J, 4.4."""
        raise NotImplementedError

    def subspace(self, q: Sequence[Scalar]) -> list[Motion]:
        """S, one motion a velocity coordinate, in the body, RBDA 3.33."""
        raise NotImplementedError

    def velocity_product(self, q: Sequence[Scalar], v: Sequence[Scalar]) -> Motion | None:
        """c_J = Ṡ v as seen in the body, RBDA 4.4; None where it is always zero."""
        return None

    def rate(self, q: Sequence[Scalar], v: Sequence[Scalar]) -> list[Scalar]:
        """q̇."""
        return list(v)

    def integrate(self, q: Sequence[Scalar], dv: Sequence[Scalar]) -> list[Scalar]:
        """Where q is after unit time at the constant velocity dv: q ⊕ dv."""
        return [a + b for a, b in zip(q, dv, strict=True)]

    def difference(self, q0: Sequence[Scalar], q1: Sequence[Scalar]) -> list[Scalar]:
        """The smallest dv with q0 ⊕ dv = q1."""
        return [b - a for a, b in zip(q0, q1, strict=True)]

    def bracket(self, a: Sequence[Scalar], b: Sequence[Scalar]) -> list[Scalar]:
        """[a, b], the bracket of the group that q moves on: zero where it commutes."""
        return [0.0] * len(a)
