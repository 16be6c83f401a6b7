"""Bodies without joints: load them with root="free"."""

from __future__ import annotations

import articulated as art
from makers import maker


def ball() -> art.RigBuilder:
    """A football, to be loaded with a free root: bounces, rolls and spins"""
    b = maker.Maker("ball")
    b.part("ball", 0.43, [maker.ball(0.11, color=maker.RED)], hollow=True)
    return b


def box() -> art.RigBuilder:
    """A wooden crate, to be loaded with a free root: slides, tips and tumbles"""
    b = maker.Maker("box")
    b.part("box", 8.0, [maker.box((0.5, 0.4, 0.3), color=maker.WOOD)])
    return b
