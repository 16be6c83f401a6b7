"""A rig as C, as SD/FAST had it: functions of its dynamics as source that needs nothing else."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from articulated.compiler import Array, Program, Tape
from articulated.compiler.c_source import declaration, definition, identifier, prelude
from articulated.dynamics.boundary import GRAVITY, Argument, checked
from articulated.dynamics.functions import programs
from articulated.rig import Rig
from articulated.rig.errors import Place
from articulated.scalar import Nested, rebuilt
from articulated.simulation.describe import described
from articulated.simulation.forces import Forces
from articulated.simulation.implicit.stance import Standing, unmoved
from articulated.simulation.implicit.step import semi_implicit_step
from articulated.trajectory.files import written

_TOLERANCE = 1e-4
"""Of the step's solver [m/s]: a Simulation's."""


def export_c(
    rig: Rig,
    directory: str | os.PathLike[str],
    functions: Sequence[str] | None = None,
    *,
    gravity: Sequence[float] = GRAVITY,
    single: bool = False,
) -> list[Path]:
    """Write a rig's dynamics as C99: a header, a source, and an example that uses them.

    The functions take and give plain arrays, as their namesakes here take and give one state, and allocate nothing. `step` is a
    step of the semi-implicit method, with joint limits: from q, v, tau and h to q and v, which a step as long has led to (so a
    motion that does not start from rest starts a little differently here). If joints have dry friction, it also takes and gives
    `slack`, zeros at first: how far each of them has given way while it held. They compute what their namesakes here compute to
    the last bit, if the compiler does not contract products and sums on its own (`-std=c99`, or `-ffp-contract=off`).

    Args:
        rig: the rig.
        directory: where to, made if need be.
        functions: which ones, of the public functions of dynamics and "step"; None is forward_dynamics, link_poses and step.
        gravity: acceleration of free fall, in the world, shape (3,) [m/s²]; a constant of what is written.
        single: float instead of double.

    Returns:
        The files written: header, source, example.

    Raises:
        ValueError: a function is unknown, or gravity is not three finite numbers.
        OSError: a file cannot be written.
    """
    fall = checked(rig, Argument("gravity", gravity, (3,)))
    if fall.shape != (3,):
        raise ValueError(f"gravity has shape {fall.shape}; expected (3,)")
    constant = tuple(fall.tolist())
    known = {**programs(rig, constant), "step": _step(rig, constant)}
    chosen = list(dict.fromkeys(functions if functions is not None else ("forward_dynamics", "link_poses", "step")))
    for name in chosen:
        if name not in known:
            raise ValueError(f"function {name!r} cannot be exported; expected some of {', '.join(known)}")
    prefix = identifier(rig.name)
    texts = {
        f"{prefix}.h": _header(rig, prefix, [known[name] for name in chosen], single),
        f"{prefix}.c": _source(prefix, [known[name] for name in chosen], single),
        "example.c": _example(rig, prefix, known[chosen[0]], single) if chosen else "int main(void) { return 0; }\n",
    }
    if rig.loops:
        names = ", ".join(repr(loop.name) for loop in rig.loops)
        Place(rig.name).warn(f"loops {names} are not part of what is exported", "it moves as an open tree there")
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        with written(folder / name, "w") as file:
            file.write(text)
    return [folder / name for name in texts]


def _step(rig: Rig, gravity: tuple[float, ...]) -> Program:
    scene, like, numbers = described(rig, None, None, True, None, _TOLERANCE, ())
    rubs = len(unmoved(scene).slack)

    def write(tape: Tape, q: Nested, v: Nested, *rest: Nested) -> list[Nested]:
        slack, (tau, h, values) = rest[:-3], rest[-3:]
        given = rebuilt(like, iter(values))
        stance = replace(unmoved(scene), before=h, slack=[x for part in slack for x in part])
        end = semi_implicit_step(Standing(q, v, 0.0, stance), Forces(scene, tau, None, gravity, given), h)
        return [end.q, end.v, end.stance.slack][: 3 if rubs else 2]

    arguments = [Array("q", (rig.nq,)), Array("v", (rig.nv,)), Array("slack", (rubs,)), Array("tau", (rig.nv,)), Array("h")]
    arguments.append(Array("numbers", numbers.shape))
    results = [Array("q_next", (rig.nq,)), Array("v_next", (rig.nv,)), Array("slack_next", (rubs,))]
    if not rubs:
        arguments, results = [a for a in arguments if a.name != "slack"], results[:2]
    return Program("step", b"", tuple(arguments), tuple(results), write, constants={"numbers": numbers.tolist()})


def _header(rig: Rig, prefix: str, chosen: Sequence[Program], single: bool) -> str:
    guard = f"{prefix.upper()}_H"
    joints = "\n".join(
        f" *   {joint.name}: {joint.kind}, q[{_range(joint.q_slice)}], v[{_range(joint.v_slice)}]"
        for joint in rig.joints.values()
        if not joint.mimic
    ).replace("*/", "* /")
    lines = [
        f"/* Dynamics of the rig '{rig.name.replace('*/', '* /')}', written by articulated.",
        " *",
        " * SI units; quaternions are xyzw. Joints:",
        joints,
        " */",
        f"#ifndef {guard}",
        f"#define {guard}",
        "#ifdef __cplusplus",
        'extern "C" {',
        "#endif",
        "",
        f"enum {{ {prefix.upper()}_NQ = {rig.nq}, {prefix.upper()}_NV = {rig.nv}, {prefix.upper()}_NLINKS = {rig.nlinks} }};",
        "",
        *(f"{declaration(program, prefix, single)};" for program in chosen),
        "",
        "#ifdef __cplusplus",
        "}",
        "#endif",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def _range(part: slice) -> str:
    return f"{part.start}" if part.stop == part.start + 1 else f"{part.start}..{part.stop - 1}"


def _source(prefix: str, chosen: Sequence[Program], single: bool) -> str:
    start = f'/* Compile with -std=c99 or -ffp-contract=off for the bits that articulated has. */\n#include "{prefix}.h"\n'
    return "\n".join([start + prelude(single), *(definition(program, prefix, single) for program in chosen)])


def _example(rig: Rig, prefix: str, program: Program, single: bool) -> str:
    real = "float" if single else "double"
    values = {"q": rig.neutral(), "q0": rig.neutral(), "q1": rig.neutral(), "h": np.array([0.001])}
    lines = []
    given = [array for array in program.arguments if array.name not in program.constants]
    for array in given:
        numbers = values.get(array.name, np.zeros(max(1, array.size)))
        lines.append(f"    {real} {array.name}[] = {{{', '.join(repr(float(x)) for x in np.atleast_1d(numbers))}}};")
    last = program.results[-1]
    for array in program.results:
        lines.append(f"    {real} {array.name}[{max(1, array.size)}];")
    names = ", ".join(array.name for array in (*given, *program.results))
    return f"""/* cc -std=c99 -O2 example.c {prefix}.c -o example && ./example */
#include <stdio.h>
#include "{prefix}.h"

int main(void)
{{
{chr(10).join(lines)}
    int k;
    {prefix}_{program.name}({names});
    for (k = 0; k < {last.size}; ++k)
        printf("%.17g\\n", (double){last.name}[k]);
    return 0;
}}
"""
