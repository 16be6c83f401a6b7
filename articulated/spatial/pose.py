"""Poses, and what they do to motions, forces and inertias, RBDA 2.8 and appendix A."""

from __future__ import annotations

from articulated.scalar import Scalar
from articulated.spatial.inertia import ArticulatedInertia, RigidInertia
from articulated.spatial.matrix import Mat3, Sym3
from articulated.spatial.motion import Force, Motion
from articulated.spatial.turns import Turns
from articulated.spatial.vector import Vec3


class Pose:
    """`X_AB`: where frame B stands in frame A, as the rotation `R` (B to A components) and B's origin `p` in A."""

    __slots__ = ("R", "p")

    def __init__(self, R: Mat3 | Turns, p: Vec3):
        self.R, self.p = R, p

    @staticmethod
    def identity() -> Pose:
        return Pose(Mat3.identity(), Vec3.zero())

    def __matmul__(self, X_BC: Pose) -> Pose:
        """X_AC = X_AB X_BC."""
        return Pose(self.R @ X_BC.R, self.p + self.R @ X_BC.p)

    def matrix(self) -> list[list[Scalar]]:
        """As a homogeneous matrix."""
        R = self.R.matrix() if isinstance(self.R, Turns) else self.R
        return [[*row, x] for row, x in zip(R.rows, self.p, strict=True)] + [[0.0, 0.0, 0.0, 1.0]]

    def inverse(self) -> Pose:
        """X_BA."""
        return Pose(self.R.T, -self.R.transpose_times(self.p))

    def transform_point(self, point: Vec3) -> Vec3:
        """A point of B, in A."""
        return self.p + self.R @ point

    def motion_to_child(self, v: Motion) -> Motion:
        """A motion in A, about A's origin, as seen in B about B's origin."""
        return Motion(
            self.R.transpose_times(v.angular),
            self.R.transpose_times(v.linear + v.angular.cross(self.p)),
        )

    def motion_to_parent(self, v: Motion) -> Motion:
        """A motion in B, about B's origin, as seen in A about A's origin."""
        angular = self.R @ v.angular
        return Motion(angular, self.R @ v.linear + self.p.cross(angular))

    def force_to_parent(self, f: Force) -> Force:
        """A force in B, about B's origin, as seen in A about A's origin."""
        linear = self.R @ f.linear
        return Force(self.R @ f.angular + self.p.cross(linear), linear)

    def force_to_child(self, f: Force) -> Force:
        """A force in A, about A's origin, as seen in B about B's origin."""
        return Force(
            self.R.transpose_times(f.angular - self.p.cross(f.linear)),
            self.R.transpose_times(f.linear),
        )

    def rigid_to_parent(self, inertia: RigidInertia) -> RigidInertia:
        """The inertia of a body, given in B, as seen in A, RBDA 2.66."""
        h = self.R @ inertia.h
        to_first = h + self.p * inertia.mass
        # J − r×h× − (h + m r)× r×, of which only the upper triangle is formed
        shift = Mat3.skew(self.p) @ Mat3.skew(h) + Mat3.skew(to_first) @ Mat3.skew(self.p)
        return RigidInertia(inertia.mass, to_first, self.R.conjugate_symmetric(inertia.J) - Sym3.upper(shift))

    def articulated_to_parent(self, inertia: ArticulatedInertia) -> ArticulatedInertia:
        """The articulated inertia of a body, given in B, as seen in A, RBDA 2.66 with a full M."""
        J, M = self.R.conjugate_symmetric(inertia.J), self.R.conjugate_symmetric(inertia.M)
        H = self.R.conjugate(inertia.H)
        r = Mat3.skew(self.p)
        H_shifted = H + r @ M.as_matrix()
        # J' = J − H r× + r× (H + r× M)ᵀ
        J_shifted = J - Sym3.upper(H @ r) + Sym3.upper(r.times_transpose(H_shifted))
        return ArticulatedInertia(J_shifted, H_shifted, M)
