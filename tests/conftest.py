from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

import articulated as art

sys.path.insert(0, str(Path(__file__).parent))


def example_robots() -> Path:
    """The folder with the robots of the example-robot-data wheel."""
    for entry in sys.path:
        folder = Path(entry) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
        if folder.is_dir():
            return folder
    raise RuntimeError("example-robot-data is not installed: pip install 'articulated[test]'")


ROBOTS = sorted(str(path.relative_to(example_robots())) for path in example_robots().rglob("*.urdf"))


@pytest.fixture(scope="session")
def robots() -> Path:
    return example_robots()


@pytest.fixture(scope="session")
def double_pendulum() -> art.Rig:
    """Two skew bodies on ball joints, in three dimensions."""
    builder = art.RigBuilder("double pendulum")
    builder.link("base")
    builder.link("upper", 1.0, (0.1, 0.0, -0.5), (0.10, 0.12, 0.04))
    builder.link("lower", 0.7, (0.0, 0.1, -0.4), (0.05, 0.06, 0.02))
    builder.joint("shoulder", "ball", "base", "upper")
    builder.joint("elbow", "ball", "upper", "lower", xyz=(0.0, 0.0, -1.0))
    return builder.build()


@pytest.fixture
def interpreted(monkeypatch):
    """Long sweeps look at algorithms; test_compiled.py holds compiled results against these. COMPILED=1 compiles them all."""
    if not os.environ.get("COMPILED"):
        monkeypatch.setenv("ARTICULATED_INTERPRET", "1")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)
