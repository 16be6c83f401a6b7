"""Cylinders against balls, capsules, boxes and each other: MuJoCo's distances."""

from __future__ import annotations

import numpy as np
import pytest
from narrow_truths import Pair, Rotation, sizes, stacked

from articulated.simulation.contact.narrow.rollers import rod_roller, roller_block, roller_roller


class TestAgainstMuJoCo:
    """Of the poses near touching few are not told as touching; what is apart is never told as overlapping."""

    def compare(self, function, first, second, width, seed=0, count=400):
        pytest.importorskip("mujoco")
        rng = np.random.default_rng(seed)
        pair = Pair(first, second)
        center, rotation, distance = pair.near(rng, count, width)
        touches = function(*pair.placed(center, rotation, Rotation.random(rng=rng), rng.normal(size=3)))
        normals = stacked(touches, "normal")
        assert np.linalg.norm(normals, axis=-1) == pytest.approx(1.0, abs=1e-9)
        assert np.isfinite(stacked(touches, "point")).all()
        return sizes(touches), distance

    @pytest.mark.parametrize("size", [(0.2, 0.1), (0.1, 0.3), (0.3, 0.02)])
    def test_ball(self, size):
        found, distance = self.compare(rod_roller, ("ball", (0.06,)), ("cylinder", size), 0.04)
        assert found[0] == pytest.approx(distance, abs=1e-6)

    @pytest.mark.parametrize(
        ("rod", "size"), [((0.05, 0.3), (0.2, 0.1)), ((0.05, 0.3), (0.1, 0.3)), ((0.02, 0.1), (0.3, 0.05))]
    )
    def test_capsule(self, rod, size):
        found, distance = self.compare(rod_roller, ("capsule", rod), ("cylinder", size), 0.9 * rod[0])
        assert np.quantile(np.abs(found[0] - distance), 0.99) < 1e-6
        assert np.abs(found[0] - distance).max() < 1e-4
        assert (found.min(axis=0) > distance - 1e-6).all()

    @pytest.mark.parametrize(
        ("size", "half"),
        [
            ((0.2, 0.1), (0.3, 0.2, 0.1)),
            ((0.1, 0.3), (0.2, 0.2, 0.2)),
            ((0.3, 0.05), (0.1, 0.1, 0.1)),
            ((0.05, 0.5), (0.2, 0.2, 0.2)),
            ((0.04, 0.1), (0.4, 0.3, 0.02)),
        ],
    )
    def test_box(self, size, half):
        found, distance = self.compare(roller_block, ("cylinder", size), ("box", half), 0.01)
        self.check(found, distance, told=0.98, near=0.001)

    @pytest.mark.parametrize(
        ("size", "other"),
        [((0.1, 0.15), (0.2, 0.05)), ((0.1, 0.3), (0.1, 0.3)), ((0.2, 0.03), (0.2, 0.03)), ((0.03, 0.3), (0.1, 0.1))],
    )
    def test_cylinder(self, size, other):
        found, distance = self.compare(roller_roller, ("cylinder", size), ("cylinder", other), 0.01)
        self.check(found, distance, told=0.98, near=0.003)

    def check(self, found, distance, told, near):
        gap, apart = found.min(axis=0), distance > 0.0
        assert (gap[apart] > -1e-3).all()
        assert np.mean(gap[apart] > 0.0) > 0.995
        assert np.mean(gap[~apart] < 0.0) > told
        assert np.mean(gap[apart] < 1.0) > 0.95  # contacts that have not happened yet are seen too
        seen = apart & (gap < 1.0)
        assert np.quantile(distance[seen] - gap[seen], 0.97) < near
        assert np.quantile(distance[seen] - gap[seen], 0.03) > -near
