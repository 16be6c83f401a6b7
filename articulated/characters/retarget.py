"""A motion of one figure, done by another.

What is kept is how each part of the body has turned since rest, then where hands and feet are, for the size of its legs and
arms. Turns first, joint by joint from the root outwards; then Gauss-Newton steps with both, damped as by Levenberg 1944.

After M. Gleicher, "Retargetting motion to new characters", SIGGRAPH 1998. Differs: each frame by itself, from turns that
are smooth in time, so that no constraint over frames is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from articulated.characters.ground import lowest
from articulated.characters.parts import Role, roles
from articulated.characters.reaching import within_limits
from articulated.dynamics.functions import integrate, jacobian, link_poses
from articulated.rig import Joint, Rig
from articulated.rig.errors import Place, did_you_mean
from articulated.trajectory import Motion

_CHAINS = {
    "pelvis": ("torso", "abdomen", "neck", "head"),
    "abdomen": ("torso", "neck", "head"),
    "torso": ("neck", "head"),
    "collar": ("upper_arm",),
    "upper_arm": ("forearm",),
    "forearm": ("hand",),
    "thigh": ("shin",),
    "shin": ("foot",),
}
"""Towards which part the bone of each part points; of others there is no telling."""

_NEAR = 10.0
"""What a metre weighs against a radian."""
_FAR = 0.05
"""Hands and feet that are farther from their places are told [m]."""


def retarget(motion: Motion, rig: Rig, names: Mapping[str, str] | str = "auto", *, iterations: int = 30) -> Motion:
    """The same motion by another rig.

        person = art.person()
        walk = art.retarget(walk, person)

    Limits of joints of one or two axes are kept; those of ball joints are not: see `audit`. The whole is so high
    that the lowest foot is as low as the lowest one of the source.

    Args:
        motion: of any rig.
        rig: the other one; with a free root, if it is to go anywhere.
        names: for each link of the other rig, the link of the motion's rig that it is to move like; "auto": those whose names
            mean the same part of the body.
        iterations: at most.

    Returns:
        The motion, as many frames. A `RigWarning` tells of hands and feet that are more than 5 cm from where they should be.

    Raises:
        ValueError: a link is unknown, or no names mean the same.
    """
    pairs = _pairs(motion.rig, rig, names)
    source, target = _Figure.of(motion.rig, pairs.values()), _Figure.of(rig, pairs)
    wanted = _turns(source, target, motion.q, pairs)
    scale = target.reach("thigh") / source.reach("thigh") if target.reach("thigh") and source.reach("thigh") else 1.0
    q = _first(target, wanted)
    root = next((joint for joint in rig.joints.values() if rig.is_root(joint) and joint.kind == "floating"), None)
    before, X = link_poses(motion.rig, motion.q), link_poses(rig, q)
    if root is not None:
        q[:, root.q_slice.start : root.q_slice.start + 3] += scale * source.middle(before) - target.middle(X)
        X = link_poses(rig, q)
    places = _places(source, target, before, X, scale)
    q, left = _solved(target, q, wanted, places, iterations)
    if places and left.max() > _FAR:
        name, frame = list(places)[int(left.max(axis=1).argmax())], int(left.max(axis=0).argmax())
        where = Place(f"rig {rig.name!r}", f"link {name!r}")
        where.warn(
            f"is {left.max():.3g} m from its place in frame {frame}, {left.mean():.2g} m on average", "it cannot reach it"
        )
    if root is not None:
        q[:, root.q_slice.start + 2] += _lowest_foot(source, motion.q) - _lowest_foot(target, q)
    return Motion(rig, q, motion.fps, motion.name)


def _pairs(source: Rig, target: Rig, names: Mapping[str, str] | str) -> dict[str, str]:
    """Links of the target, and those of the source, in the order of the target's tree."""
    if isinstance(names, str):
        if names != "auto":
            raise ValueError(f"names is {names!r}; expected 'auto', or for links of {target.name!r} those of {source.name!r}")
        one, two = _links_by_role(source), _links_by_role(target)
        names = {link: one[role] for role, link in two.items() if role in one}
        if len(names) < 3:
            raise ValueError(
                f"the names of rigs {source.name!r} and {target.name!r} have {len(names)} parts in common; give names"
            )
    for mine, (name, rig) in {
        str(n): (n, r) for pair in names.items() for n, r in zip(pair, (target, source), strict=True)
    }.items():
        if name not in rig.links:
            raise ValueError(f"rig {rig.name!r} has no link {mine!r}{did_you_mean(mine, rig.links)}")
    return {name: names[name] for name in target.links if name in names}


def _links_by_role(rig: Rig) -> dict[Role, str]:
    """The first link of each part; the torso is the last of the spine, if none is called so."""
    found = roles(rig.links)
    result: dict[Role, str] = {}
    for name, role in found.items():
        if role.part not in ("finger", "toe", "collar"):
            result.setdefault(role, name)
    spine = [name for name, role in found.items() if role == Role("abdomen", "")]
    if Role("torso", "") not in result and spine:
        result[Role("torso", "")] = spine[-1]
        if len(spine) == 1:
            del result[Role("abdomen", "")]
    return result


@dataclass(frozen=True, eq=False)
class _Figure:
    """A rig at rest, and what is known of its links.

    Attributes:
        rig: the rig.
        names: of the links that are matched.
        rest: poses of links at neutral, shape (nlinks, 4, 4).
        roles: which part of the body each link is, if its name tells.
        links: the link that each part is.
    """

    rig: Rig
    names: list[str]
    rest: np.ndarray
    roles: dict[str, Role]
    links: dict[Role, str]

    @staticmethod
    def of(rig: Rig, names: Iterable[str]) -> _Figure:
        return _Figure(rig, list(names), link_poses(rig, rig.neutral()), roles(rig.links), _links_by_role(rig))

    def at(self, name: str) -> np.ndarray:
        """Where a link is at rest, shape (3,)."""
        return self.rest[self.rig.links[name].index, :3, 3]

    def bone(self, name: str) -> np.ndarray | None:
        """The direction of its bone at rest, if a part follows that tells."""
        role = self.roles.get(name)
        if role is None:
            return None
        for part in _CHAINS.get(role.part, ()):
            if (end := self.links.get(Role(part, role.side))) is not None and end != name:
                along = self.at(end) - self.at(name)
                size = np.linalg.norm(along)
                return along / size if size > 1e-6 else None
        return None

    def reach(self, part: str) -> float:
        """How long the limb is that begins with this part: of both sides, on average; 0 if it has none."""
        lengths = []
        for side in ("left", "right"):
            chain, length = part, 0.0
            while (then := _CHAINS.get(chain, (None,))[0]) and {Role(chain, side), Role(then, side)} <= self.links.keys():
                length += float(np.linalg.norm(self.at(self.links[Role(then, side)]) - self.at(self.links[Role(chain, side)])))
                chain = then
            lengths.append(length)
        return float(np.mean(lengths))

    def middle(self, X: np.ndarray) -> np.ndarray:
        """Midway between the hips, or the root, shape (T, 3)."""
        hips = [self.links[role] for side in ("left", "right") if (role := Role("thigh", side)) in self.links]
        names = hips if len(hips) == 2 else [next(iter(self.rig.links))]
        return np.mean([X[:, self.rig.links[name].index, :3, 3] for name in names], axis=0)


def _turns(source: _Figure, target: _Figure, q: np.ndarray, pairs: Mapping[str, str]) -> dict[str, Rotation]:
    """How each link is to stand in the world: turned since rest as the other has, from where its bone points the same way."""
    X = link_poses(source.rig, q)
    wanted, align = {}, {}
    for mine, other in pairs.items():
        index = source.rig.links[other].index
        turned = Rotation.from_matrix(X[:, index, :3, :3]) * Rotation.from_matrix(source.rest[index, :3, :3]).inv()
        one, two = source.bone(other), target.bone(mine)
        role = target.roles.get(mine)
        if one is not None and two is not None and role is not None and role.side:
            align[mine] = _shortest(two, one)
        elif role is not None and role.part == "hand" and (arm := target.links.get(Role("forearm", role.side))) in align:
            align[mine] = align[arm]
        own = Rotation.from_matrix(target.rest[target.rig.links[mine].index, :3, :3])
        wanted[mine] = turned * align.get(mine, Rotation.identity()) * own
    return wanted


def _shortest(a: np.ndarray, b: np.ndarray) -> Rotation:
    """The least turn that takes one direction to another."""
    axis, c = np.cross(a, b), float(a @ b)
    s = float(np.linalg.norm(axis))
    if s < 1e-9:
        return Rotation.identity() if c > 0.0 else Rotation.from_rotvec(np.pi * np.cross(a, np.eye(3)[np.argmin(np.abs(a))]))
    return Rotation.from_rotvec(axis / s * np.arctan2(s, c))


def _first(target: _Figure, wanted: Mapping[str, Rotation]) -> np.ndarray:
    """Joint by joint from the root: ball joints as wanted, hinges as near to that as they can turn."""
    rig, frames = target.rig, len(next(iter(wanted.values())))
    q, R = np.tile(rig.neutral(), (frames, 1)), {}
    for name, link in rig.links.items():
        joint = rig.joints.get(link.joint)
        if joint is None:
            fixed = rig.fixed_joints.get(link.joint)
            base = Rotation.identity(frames) if fixed is None else R[fixed.parent] * Rotation.from_matrix(fixed.pose[:3, :3])
            R[name] = base
            continue
        base = R.get(joint.parent, Rotation.identity(frames)) * Rotation.from_matrix(joint.pose[:3, :3])
        turn = Rotation.identity(frames)
        if name in wanted and not joint.mimic:
            turn = _turn(joint, base.inv() * wanted[name], q)
        R[name] = base * turn
    return q


def _turn(joint: Joint, wanted: Rotation, q: np.ndarray) -> Rotation:
    """Turn a joint, in its own frame, as far as it can; q is written to."""
    if joint.kind in ("ball", "floating"):
        q[:, joint.q_slice.stop - 4 : joint.q_slice.stop] = wanted.as_quat()
        return wanted
    if joint.kind not in ("revolute", "continuous"):
        return Rotation.identity(len(q))
    quat = wanted.as_quat()
    angle = 2.0 * np.arctan2(quat[:, :3] @ joint.axis, quat[:, 3])
    angle = np.clip(np.unwrap((angle + np.pi) % (2.0 * np.pi) - np.pi), joint.limits.lower, joint.limits.upper)
    q[:, joint.q_slice] = angle[:, None]
    return Rotation.from_rotvec(angle[:, None] * joint.axis)


def _places(source: _Figure, target: _Figure, before: np.ndarray, X: np.ndarray, scale: float) -> dict[str, np.ndarray]:
    """Where hands and feet are to be, from shoulder or hip, for the length of the limb."""
    found = {}
    for part, begin in (("foot", "thigh"), ("hand", "upper_arm")):
        one, two = source.reach(begin), target.reach(begin)
        for side in ("left", "right"):
            ends, starts = Role(part, side), Role(begin, side)
            if not (one and two and {ends, starts} <= source.links.keys() and {ends, starts} <= target.links.keys()):
                continue
            if target.links[ends] not in target.names:
                continue
            end, start = (before[:, source.rig.links[source.links[role]].index, :3, 3] for role in (ends, starts))
            if part == "foot":
                found[target.links[ends]] = scale * (end - source.middle(before)) + target.middle(X)
            else:
                mine = X[:, target.rig.links[target.links[starts]].index, :3, 3]
                found[target.links[ends]] = mine + (end - start) * (two / one)
    return found


def _solved(
    target: _Figure, q: np.ndarray, wanted: Mapping[str, Rotation], places: Mapping[str, np.ndarray], iterations: int
) -> tuple[np.ndarray, np.ndarray]:
    """Configurations, and how far each hand and foot is from its place, shape (n, T) [m]."""
    rig = target.rig
    roots = [joint for joint in rig.joints.values() if rig.is_root(joint)]
    moves = np.ones(rig.nv)
    for joint in roots:
        moves[joint.v_slice] = 0.0
    links = [name for name in wanted if rig.links[name].body >= 0]
    held = np.full(len(q), 1e-3)
    error = _errors(rig, q, links, wanted, places)
    for _ in range(iterations):
        rows = [jacobian(rig, q, name) for name in links]
        J = np.concatenate(
            [*(row[:, 3:] for row in rows), *(_NEAR * rows[links.index(name)][:, :3] for name in places)], axis=1
        )
        J = J * moves
        H = np.swapaxes(J, -1, -2) @ J + held[:, None, None] * np.eye(rig.nv)
        dv = np.linalg.solve(H, np.swapaxes(J, -1, -2) @ error[..., None])[..., 0] * moves
        tried = within_limits(rig, integrate(rig, q, dv))
        after = _errors(rig, tried, links, wanted, places)
        better = (after**2).sum(axis=-1) <= (error**2).sum(axis=-1)
        q, error = np.where(better[:, None], tried, q), np.where(better[:, None], after, error)
        held = np.clip(np.where(better, 0.3 * held, 10.0 * held), 1e-6, 1e6)
        if np.abs(dv[better]).max(initial=0.0) < 1e-5:
            break
    far = error[:, 3 * len(links) :].reshape(len(q), -1, 3) / _NEAR
    return q, np.linalg.norm(far, axis=-1).T


def _errors(
    rig: Rig, q: np.ndarray, links: list[str], wanted: Mapping[str, Rotation], places: Mapping[str, np.ndarray]
) -> np.ndarray:
    X = link_poses(rig, q)
    parts = [(wanted[n] * Rotation.from_matrix(X[:, rig.links[n].index, :3, :3]).inv()).as_rotvec() for n in links]
    parts += [_NEAR * (place - X[:, rig.links[name].index, :3, 3]) for name, place in places.items()]
    return np.concatenate(parts, axis=-1)


def _lowest_foot(figure: _Figure, q: np.ndarray) -> float:
    """Of all frames [m]; 0 if no foot has a shape."""
    feet = [figure.rig.links[name].index for name, role in figure.roles.items() if role.part in ("foot", "toe")]
    low = lowest(figure.rig, q)[:, feet].min(initial=np.inf)
    return float(low) if np.isfinite(low) else 0.0
