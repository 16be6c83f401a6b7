"""Two cylinders: side by side, across each other, stacked, one lying on the other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from narrow_truths import LEVEL, Rotation, euler, shape, sizes, stacked, there
from scipy.spatial import ConvexHull

from articulated.simulation.contact.narrow.axles import roller_roller


def lens(r, s, d):
    """Area that two discs have in common."""
    if d <= abs(r - s):
        return math.pi * min(r, s) ** 2
    x = (d * d + r * r - s * s) / (2.0 * d)
    half = math.sqrt(r * r - x * x)
    return r * r * math.atan2(half, x) + s * s * math.atan2(half, d - x) - d * half


class TestTwoCylinders:
    def two(self, size, center, rotation, other, turn=LEVEL):
        return roller_roller(shape("cylinder", size, center, rotation), shape("cylinder", other, [0.0, 0.0, 0.0], turn))

    @pytest.mark.parametrize("askew", [0.0, 1e-7, 1e-5])
    def test_side_by_side(self, askew):
        """They touch where the line of contact begins and where it ends."""
        touches = self.two((0.1, 0.2), [0.199, 0.0, 0.2], euler("xy", [askew, askew]), (0.1, 0.3))
        assert there(touches).sum() == 3
        assert sizes(touches)[:3] == pytest.approx(-1e-3, abs=1e-5)
        assert stacked(touches, "normal")[:3] == pytest.approx(np.broadcast_to([1.0, 0.0, 0.0], (3, 3)), abs=1e-4)
        assert np.sort(stacked(touches, "point")[1:3, 2]) == pytest.approx([0.0, 0.3], abs=1e-4)
        assert stacked(touches, "point")[0, 2] == pytest.approx(0.15, abs=0.1)

    @pytest.mark.parametrize("angle", [0.3, 1.0, 0.5 * np.pi])
    def test_crossed(self, angle):
        touches = self.two((0.1, 0.2), [0.14, 0.02, 0.03], euler("x", angle), (0.05, 0.3))
        assert sizes(touches)[0] == pytest.approx(-0.01, abs=1e-9)
        assert stacked(touches, "normal")[0] == pytest.approx([1.0, 0.0, 0.0])
        # a line through (0.02, 0.03) in the plane of y and z crosses the axis z
        assert stacked(touches, "point")[0] == pytest.approx([0.045, 0.0, 0.03 + 0.02 / math.tan(angle)], abs=1e-6)
        assert (sizes(touches)[1:] > -0.01 + 1e-4).all()

    @pytest.mark.parametrize("offset", [0.0, 0.05, 0.13])
    def test_stacked(self, offset):
        for size, other in (((0.1, 0.2), (0.15, 0.3)), ((0.15, 0.2), (0.1, 0.3)), ((0.1, 0.2), (0.1, 0.3))):
            touches = self.two(size, [offset, 0.0, 0.499], LEVEL, other)
            carry = sizes(touches) < 0.0
            if offset < max(size[0], other[0]) - 0.02 * (size[0] == other[0]):
                assert carry.sum() >= 3
            points = stacked(touches, "point")[carry]
            assert sizes(touches)[carry] == pytest.approx(-1e-3)
            assert (np.linalg.norm(points[:, :2], axis=1) < other[0] + 1e-6).all()
            assert (np.linalg.norm(points[:, :2] - [offset, 0.0], axis=1) < size[0] + 1e-6).all()
            assert ConvexHull(points[:, :2]).volume > 0.45 * lens(size[0], other[0], offset)

    def test_lying_on_a_standing_one(self):
        for a, b in (((0.1, 0.2), (0.1, 0.3)), ((0.1, 0.3), (0.1, 0.2))):
            up = a[1] == 0.3
            touches = self.two(
                a, [0.02, 0.0, 0.399], LEVEL if up else euler("x", 0.5 * np.pi), b, euler("x", 0.5 * np.pi) if up else LEVEL
            )
            carry = sizes(touches) < 0.0
            assert carry.sum() == 2
            points = stacked(touches, "point")[carry]
            assert np.sort(points[:, 1]) == pytest.approx([-math.sqrt(0.01 - 4e-4), math.sqrt(0.01 - 4e-4)], abs=1e-6)

    def test_order_does_not_matter(self):
        rng = np.random.default_rng(4)
        n = 300
        a = shape("cylinder", (0.1, 0.15), rng.normal(scale=0.17, size=(n, 3)), Rotation.random(n, rng))
        b = shape("cylinder", (0.15, 0.08), np.zeros((n, 3)), Rotation.random(n, rng))
        one, other = roller_roller(a, b), roller_roller(b, a)
        alike = np.isclose(sizes(one).min(axis=0), sizes(other).min(axis=0), atol=1e-6)
        assert alike.mean() > 0.95  # but for slots that hold other points of two rims
        first = (sizes(one)[0] < 100.0) & (sizes(other)[0] < 100.0) & alike
        cosine = np.einsum("ni,ni->n", stacked(one, "normal")[0], stacked(other, "normal")[0])
        assert np.mean(cosine[first] < -1.0 + 1e-6) > 0.97
