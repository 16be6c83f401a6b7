"""Whether a loop fits a rig."""

from __future__ import annotations

from collections.abc import Mapping

from articulated.rig.errors import did_you_mean
from articulated.rig.joint import KINDS
from articulated.rig.loop import Loop
from articulated.rig.rig import Rig


def check_loop(rig: Rig, loop: Loop) -> None:
    """Refuse a loop that does not fit a rig.

    Raises:
        ValueError: a link or joint is unknown, both ends are one rigid body, or a gear's joint has several coordinates.
    """
    if not isinstance(loop, Loop):
        raise ValueError(f"a loop is {loop!r}; expected an articulated.Loop")
    if loop.kind == "gear":
        for name in (loop.link_a, loop.link_b):
            joint = rig.joints.get(str(name))
            if joint is None:
                raise ValueError(f"{loop}: {_unknown(rig, 'moving joint', name, rig.joints)}")
            if KINDS[joint.kind].nv != 1:
                raise ValueError(f"{loop}: joint {name!r} is {joint.kind}; a gear joins joints of one coordinate")
        ends = [j.mimic.joint if (j := rig.joints[str(name)]).mimic else j.name for name in (loop.link_a, loop.link_b)]
        if ends[0] == ends[1]:
            raise ValueError(f"{loop}: both joints are the coordinate of {ends[0]!r}, which no gear can tie to itself")
        return
    bodies = []
    for name in (loop.link_a, loop.link_b):
        if is_world(rig, name):
            bodies.append(-1)
        elif (link := rig.links.get(str(name))) is not None:
            bodies.append(link.body)
        else:
            raise ValueError(f"{loop}: {_unknown(rig, 'link', name, rig.links)}; None is the world")
    if bodies[0] == bodies[1]:
        where = "the world, which does not move" if bodies[0] < 0 else "one rigid body: no joint moves one against the other"
        raise ValueError(f"{loop}: {loop.link_a!r} and {loop.link_b!r} are parts of {where}")


def is_world(rig: Rig, link: str | None) -> bool:
    """Whether the end of a loop is the world; a link of that name comes before it."""
    return link is None or (link == "world" and "world" not in rig.links)


def _unknown(rig: Rig, what: str, name: str | None, known: Mapping) -> str:
    return f"rig {rig.name!r} has no {what} {name!r}{did_you_mean(name, known)}"
