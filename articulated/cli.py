"""The command line: `articulated info | simulate | check | rigs`."""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import articulated as art
from articulated.rig.joint import KINDS
from articulated.rig.load import find_rig, shipped_lines
from articulated.trajectory.files import ONE_STATE, check_exportable

OK, BAD_RESULT, BAD_INPUT, BAD_OUTPUT, INTERRUPTED = 0, 1, 2, 3, 130

_GRAVITY_HELP = "m/s² (default 0 0 -9.81)"
_EXIT_CODES = """exit codes:
  0    done, and the result is good
  1    done, but the result is not: the check disagrees, or the run's report did not pass (files are written all the same)
  2    the command, the rig or a value is wrong; nothing was done
  3    a file cannot be written
  130  interrupted"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns its exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    warnings.showwarning = _show_warning
    try:
        return options.command(options)
    except KeyboardInterrupt:
        print("articulated: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of our output, such as head, has seen enough
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (its loss is the point)
        return OK
    except OSError as error:
        print(f"articulated: {error}", file=sys.stderr)
        return BAD_OUTPUT
    except (ValueError, ImportError) as error:
        print(f"articulated: {error}", file=sys.stderr)
        return BAD_INPUT


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="articulated",
        description="Rigid-body dynamics of character rigs: URDF in, trajectory out.",
        epilog=_EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"articulated {art.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    info = _command(commands, "info", _info, "what is in a rig")
    _rig_options(info)
    info.add_argument("--links", action="store_true", help="list its links too")

    simulate = _command(commands, "simulate", _simulate, "run a rig and write its trajectory")
    _rig_options(simulate)
    _simulate_options(simulate)

    check = _command(commands, "check", _check, "compare every function of dynamics with Pinocchio, on random states")
    _rig_options(check)
    check.add_argument("--samples", type=_positive(int), default=20, help="how many states (default 20)")
    check.add_argument("--seed", type=int, default=0, help="of the random states (default 0)")

    export = _command(commands, "export", _export, "write a rig's dynamics as C99, for games and firmware")
    _rig_options(export)
    export.add_argument("-o", "--output", required=True, metavar="DIR", help="where to; made if need be")
    export.add_argument(
        "--function",
        action="append",
        metavar="NAME",
        help="may be given several times (default forward_dynamics, link_poses, step)",
    )
    export.add_argument("--single", action="store_true", help="float instead of double")
    export.add_argument("--gravity", type=float, nargs=3, default=art.GRAVITY, metavar=("X", "Y", "Z"), help=_GRAVITY_HELP)

    _command(commands, "rigs", _rigs, "list the rigs that come with articulated")
    return parser


def _command(commands, name: str, run: Callable[[argparse.Namespace], int], what: str) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=what, description=what.capitalize() + ".")
    parser.set_defaults(command=run)
    return parser


def _rig_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="a URDF file, a package:// address or a shipped rig's name")
    parser.add_argument("--root", choices=("fixed", "free", "planar"), default="fixed", help="how its root meets the world")
    parser.add_argument("--mesh-dir", action="append", default=[], metavar="DIR", help="where to look for meshes and packages")
    parser.add_argument("--srdf", metavar="FILE", help="an SRDF file: which links never touch each other")
    parser.add_argument("--repair-inertia", action="store_true", help="replace impossible inertias by the nearest possible")
    add = parser.add_argument
    add("--density", type=_positive(float), metavar="X", help="weigh links without an inertial by their shapes [kg/m³]")
    add("--total-mass", type=_positive(float), metavar="KG", help="scale all masses so that what moves weighs this")
    for what, unit in (("damping", "N m s/rad or N s/m"), ("friction", "N m or N"), ("armature", "kg m² or kg")):
        parser.add_argument(f"--{what}", type=float, metavar="X", help=f"give every joint this {what} [{unit}]")


def _simulate_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add(
        "-o",
        "--output",
        action="append",
        required=True,
        metavar="FILE",
        help=".npz, .csv, .bvh or .glb; may be given several times",
    )
    add("--duration", type=_positive(float), default=5.0, metavar="S", help="seconds (default 5)")
    add("--fps", type=_positive(float), default=60.0, help="frames a second (default 60)")
    add("--dt", type=_positive(float), default=0.002, metavar="S", help="longest step, seconds (default 0.002)")
    add("--integrator", choices=list(art.INTEGRATORS), help="default semi_implicit, or rk4 for what swings freely")
    add("--ground", action="store_true", help="let it touch the plane through the origin, across gravity")
    add("--friction-of-ground", type=_zero_or_more, default=0.9, metavar="MU", help="Coulomb's coefficient (default 0.9)")
    add("--collisions", action="store_true", help="let its links touch each other")
    add("--free-joints", action="store_true", help="do not enforce joint limits")
    add("--rtol", type=_positive(float), default=1e-6, help="relative tolerance of dopri5 (default 1e-6)")
    add("--gravity", type=float, nargs=3, default=art.GRAVITY, metavar=("X", "Y", "Z"), help=_GRAVITY_HELP)
    add("--pose", action="append", default=[], metavar="JOINT=VALUE[,VALUE…]", help="start there: rad or m, or 90deg")
    add("--velocity", action="append", default=[], metavar="JOINT=VALUE[,VALUE…]", help="start with it: rad/s or m/s")
    add("--random", type=_positive(int), metavar="N", help="start N states at random configurations within limits")
    add("--seed", type=int, default=0, help="of --random (default 0)")
    add("--quiet", action="store_true", help="print nothing but errors and warnings")


def _info(options: argparse.Namespace) -> int:
    rig = _load(options)
    print(f"{rig.name}: {rig.nv} degrees of freedom, {len(rig.bodies)} bodies, {rig.nlinks} links, {rig.mass:.4g} kg moving")
    if rig.joints:
        print(f"\n{'joint':<32} {'kind':<10} {'q':<7} {'v':<7} {'limits':<18} {'damping':>8} {'friction':>8} {'armature':>8}")
    for joint in rig.joints.values():
        follows = f"  = {joint.mimic.multiplier:g} {joint.mimic.joint} {joint.mimic.offset:+g}" if joint.mimic else ""
        print(
            f"{joint.name:<32} {joint.kind:<10} {_range(joint.q_slice):<7} {_range(joint.v_slice):<7} "
            f"{_limits(joint.limits):<18} {joint.damping:8.3g} {joint.friction:8.3g} {joint.armature:8.3g}{follows}"
        )
    if options.links:
        print(f"\n{'link':<32} {'index':>5} {'moves with':<32} {'kg':>8}")
        for link in rig.links.values():
            body = "(the world)" if link.body < 0 else rig.bodies[link.body].name
            print(f"{link.name:<32} {link.index:5d} {body:<32} {link.mass:8.4g}")
    if rig.loops:
        print(f"\n{'loop':<32} {'kind':<12} {'between':<32} {'and':<32}")
    for loop in rig.loops:
        print(f"{loop.name:<32} {loop.kind:<12} {loop.link_a or '(the world)':<32} {loop.link_b or '(the world)':<32}")
    if rig.ignored:
        print("\nnot used: " + ", ".join(f"{tag} ×{count}" for tag, count in rig.ignored.items()))
    return OK


def _simulate(options: argparse.Namespace) -> int:
    for path in options.output:
        check_exportable(path, options.random or 1)
    rig = _load(options)
    q0 = rig.random(options.seed, options.random) if options.random else rig.neutral()
    v0 = np.zeros(rig.nv)
    _assign(rig, q0, options.pose, "--pose", lambda joint: joint.q_slice)
    _assign(rig, v0, options.velocity, "--velocity", lambda joint: joint.v_slice)
    if rig.loops:
        q0 = art.assemble(rig, q_guess=q0, hold=[pose.partition("=")[0] for pose in options.pose])
    simulation = art.Simulation(
        rig,
        dt=options.dt,
        gravity=options.gravity,
        ground=_ground(options),
        limits=not options.free_joints,
        collisions=options.collisions,
        integrator=options.integrator,
        rtol=options.rtol,
        atol=options.rtol * 1e-3,
    )
    began = time.perf_counter()
    trajectory = simulation.run(q0, v0, options.duration, options.fps, progress=not options.quiet)
    if not options.quiet:
        print(f"{rig.name}: {len(trajectory.time)} frames, {trajectory.time[-1]:g} s, in {time.perf_counter() - began:.1f} s")
        print(trajectory.report)
    for path in options.output:
        _write(trajectory, path)
        if not options.quiet:
            print(f"wrote {path}")
    return OK if trajectory.report else BAD_RESULT


def _ground(options: argparse.Namespace) -> art.Ground | None:
    if not options.ground:
        return None
    up = [-x for x in options.gravity] if any(options.gravity) else (0.0, 0.0, 1.0)
    return art.Ground(art.Plane((up[0], up[1], up[2])), friction=options.friction_of_ground)


def _write(trajectory: art.Trajectory, path: str) -> None:
    suffix = Path(path).suffix.lower()
    one = trajectory.state(0) if suffix in ONE_STATE and trajectory.outcome.shape == (1,) else trajectory
    try:
        one.save(path) if suffix == ".npz" else one.export(path)
    except (OSError, ValueError) as error:
        # what took long to compute is not thrown away because a disk is full, or a format cannot hold it
        rescue = Path(tempfile.mkdtemp(prefix="articulated-")) / (Path(path).stem + ".npz")
        trajectory.save(rescue)
        kind = type(error) if isinstance(error, OSError) else OSError
        raise kind(f"{error}; the trajectory is in {rescue} instead") from None


def _check(options: argparse.Namespace) -> int:
    from articulated.crosscheck import PinocchioModel, compare

    rig = _load(options)
    given = (options.density, options.total_mass, options.damping, options.friction, options.armature)
    changed = options.repair_inertia or any(value is not None for value in given)
    extended = any(joint.kind in ("ball", "universal") for joint in rig.joints.values())
    if changed or extended or rig.nv == 0:
        reference, how = PinocchioModel.from_rig(rig), "built joint by joint from the rig"
    else:
        text = find_rig(options.rig, [Path(directory) for directory in options.mesh_dir]).read_text()
        reference, how = PinocchioModel.from_urdf(rig, text), "read from the same file by its own reader"
    print(f"{rig.name}, {rig.nv} degrees of freedom, against Pinocchio ({how}), {options.samples} random states\n")
    print(f"{'function':<28} {'largest relative error':>22} {'allowed':>9}")
    comparisons = compare(reference, options.samples, options.seed)
    for one in comparisons:
        print(f"{one.function:<28} {one.error:22.1e} {one.tolerance:9.1e}{'' if one.agrees else '  <- DISAGREES'}")
    agree = all(one.agrees for one in comparisons)
    print(f"\n{'all agree' if agree else 'DISAGREEMENT'}")
    return OK if agree else BAD_RESULT


def _export(options: argparse.Namespace) -> int:
    rig = _load(options)
    for path in art.export_c(rig, options.output, options.function, gravity=options.gravity, single=options.single):
        print(f"wrote {path}")
    return OK


def _rigs(options: argparse.Namespace) -> int:
    about = shipped_lines()
    for name, path in art.shipped_rigs().items():
        rig = art.load(path)
        what = f"{about[name]}   " if name in about else ""
        print(f"{name:<16} {rig.nv:3d} degrees of freedom, {rig.nlinks:3d} links   {what}{path}")
    return OK


def _load(options: argparse.Namespace) -> art.Rig:
    rig = art.load(
        options.rig,
        options.root,
        mesh_dirs=options.mesh_dir,
        srdf=options.srdf,
        repair_inertia=options.repair_inertia,
        density=options.density,
        total_mass=options.total_mass,
    )
    given = {what: getattr(options, what) for what in ("damping", "friction", "armature")}
    return rig.with_joints(**{what: value for what, value in given.items() if value is not None})


def _assign(rig: art.Rig, values: np.ndarray, given: Sequence[str], option: str, part: Callable[[art.Joint], slice]) -> None:
    for text in given:
        name, equals, words = text.partition("=")
        if not equals or name not in rig.joints:
            known = ", ".join(rig.joints) or "none"
            raise ValueError(f"{option} {text!r}: expected JOINT=VALUE with a moving joint of rig {rig.name!r}: {known}")
        joint = rig.joints[name]
        if joint.mimic:
            raise ValueError(f"{option} {text!r}: joint {name!r} follows joint {joint.mimic.joint!r}; set that one")
        numbers = [_number(word, f"{option} {text!r}") for word in words.split(",")]
        where = part(joint)
        if len(numbers) != where.stop - where.start:
            raise ValueError(
                f"{option} {text!r}: expected {where.stop - where.start} values ({joint.kind}), got {len(numbers)}"
            )
        if option == "--pose" and KINDS[joint.kind].nq > KINDS[joint.kind].nv:
            norm = math.hypot(*numbers[-4:])
            if abs(norm - 1.0) > 1e-2:
                raise ValueError(f"{option} {text!r}: the quaternion (x, y, z, w) has norm {norm:g}; expected 1")
            numbers[-4:] = [x / norm for x in numbers[-4:]]
        values[..., where] = numbers


def _number(word: str, where: str) -> float:
    text, degrees = word.strip().removesuffix("deg"), word.strip().endswith("deg")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{where}: {word!r} is not a number; write radians or metres, or 90deg")
    return math.radians(value) if degrees else value


def _positive(kind: Callable[[str], float]) -> Callable[[str], float]:
    def parse(text: str) -> float:
        value = kind(text)
        if not (math.isfinite(value) and value > 0):
            raise argparse.ArgumentTypeError(f"{text!r} is not a positive number")
        return value

    parse.__name__ = kind.__name__
    return parse


def _zero_or_more(text: str) -> float:
    value = float(text)
    if not (math.isfinite(value) and value >= 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number, zero or more")
    return value


def _range(part: slice) -> str:
    if part.start == part.stop:
        return "-"
    return str(part.start) if part.stop == part.start + 1 else f"{part.start}–{part.stop - 1}"


def _limits(limits: art.Limits) -> str:
    if math.isinf(limits.lower) and math.isinf(limits.upper):
        return "-"
    return f"{limits.lower:.4g} … {limits.upper:.4g}"


def _show_warning(message, category, filename, lineno, file=None, line=None) -> None:
    print(f"articulated: warning: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
