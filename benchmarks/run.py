"""Prints the tables of benchmarks/README.md.

    pip install -e '.[benchmark]'   # and g++ and libeigen3-dev for native Pinocchio
    python benchmarks/run.py        # or with the names of some tables; --no-native leaves native Pinocchio out

Contenders take turns in one run on one core (native Pinocchio in a process of its own on the same core); a turn lasts at least
30 ms; what is printed are medians, and medians of ratios turn by turn.
"""

from __future__ import annotations

import argparse
import inspect
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import limits
import numpy as np
from contact import contact, contact_growth, stepping
from loops import loop_growth, loops
from pairs import pairs_of_bodies, two_ragdolls
from particles import particles
from peers import Native, Pinocchio, mujoco_forward
from rigs import ROBOTS, chain, robot
from timing import at_once, median, pin_to_one_core, ratio, setting, timed, turns

import articulated as art
from articulated.compiler import Tape, compiled
from articulated.compiler.schedule import schedule
from articulated.dynamics.functions import programs

STATES = 4096


def states(rig: art.Rig, count: int, dtype=np.float64) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    return [x.astype(dtype) for x in (rig.random(rng, count), *rng.normal(size=(2, count, rig.nv)))]


def flops(rig: art.Rig, function: str) -> int:
    """Floating-point operations of the compiled program."""
    tape = Tape(programs(rig)[function], False)
    return limits.flops(schedule(tape.graph, tape.outputs, None, 8).operations())


def throughput(native: bool) -> None:
    """`forward_dynamics` on 4096 states, float64, one thread."""
    most = limits.peak()
    print(f"\nThis core does at most {most * 1e-9:.0f} GF/s. Nanoseconds per state:\n")
    print("| rig | dof | articulated | of the peak | `abaInParallel` | ratio | Pinocchio, native | ratio |")
    print("|---|---|---|---|---|---|---|---|")
    for name in ROBOTS:
        rig = robot(name)
        q, v, tau = states(rig, STATES)
        theirs = Pinocchio(rig, q, v, tau)
        contenders = {"ours": timed(lambda: art.forward_dynamics(rig, q, v, tau, threads=1))}
        contenders["pinocchio"] = theirs.batch["forward_dynamics"]
        if native:
            contenders["native"] = scaled(Native(theirs.model, STATES).contender("forward_dynamics"))
        taken = turns(contenders)
        ns = {who: median(taken, who) / STATES * 1e9 for who in contenders}
        share = flops(rig, "forward_dynamics") / ns["ours"] / most * 1e9
        last = f"{ns['native']:.0f} | {ratio(taken, 'native', 'ours'):.1f}" if native else "- | -"
        print(
            f"| {name} | {rig.nv} | {ns['ours']:.1f} | {share:.0%} | {ns['pinocchio']:.0f} | "
            f"{ratio(taken, 'pinocchio', 'ours'):.1f} | {last} |",
            flush=True,
        )


def scaled(measure: Callable[[], float], states: int = STATES) -> Callable[[], float]:
    """A contender that says how long it takes for a state."""
    return lambda: states * measure()


def functions(native: bool) -> None:
    """Other functions of G1, float64, one thread. `mass_matrix` writes 9.8 KB for each state: its own cost is seen where the
    result stays in the cache, and where memory is given (`out=`) that need not be fetched from the system first. "Filled" is
    what it takes to set the same array to a constant. Native Pinocchio's `crba` leaves the upper half of one matrix behind;
    "kept" is with the whole matrix copied to where the state's result belongs.
    """
    rig = robot("G1")
    process = Native(Pinocchio(rig, *states(rig, 1)).model, STATES) if native else None
    print(
        "\nNanoseconds per state:\n\n| function | states | articulated | filled | Pinocchio | ratio | native | ratio | kept | ratio |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for function, count, given in (
        (art.inverse_dynamics, STATES, False),
        (art.mass_matrix, STATES, False),
        (art.mass_matrix, STATES, True),
        (art.mass_matrix, 512, True),
    ):
        print(_function_row(rig, process, function, count, given), flush=True)


def _function_row(rig: art.Rig, process: Native | None, function: Callable[..., np.ndarray], count: int, given: bool) -> str:
    name = function.__name__
    q, v, tau = states(rig, count)
    arguments = (q,) if name == "mass_matrix" else (q, v, tau)
    result = function(rig, *arguments)
    out = result.copy() if given else None
    contenders = {
        "ours": timed(lambda: function(rig, *arguments, out=out, threads=1)),
        "filled": timed(lambda: (np.empty_like(result) if out is None else out).fill(1.5)),
    }
    theirs = Pinocchio(rig, q, v, tau).batch
    if name in theirs:
        contenders["pinocchio"] = theirs[name]
    if process is not None:
        contenders["native"] = scaled(process.contender(name), count)
        if name == "mass_matrix":
            contenders["kept"] = scaled(process.contender("mass_matrix, kept"), count)
    taken = turns(contenders)
    ns = {who: median(taken, who) / count * 1e9 for who in contenders}
    cells = [name + (", `out=`" if given else ""), str(count), f"{ns['ours']:.0f}", f"{ns['filled']:.0f}"]
    for who in ("pinocchio", "native", "kept"):
        cells += [f"{ns[who]:.0f}", f"{ratio(taken, who, 'ours'):.1f}"] if who in taken else ["-", "-"]
    return f"| {' | '.join(cells)} |"


def formats(native: bool) -> None:
    """`forward_dynamics` in float32 against float64, 4096 states, one thread; and on two threads against one, not pinned.

    "At most" is what the machine gives at that time: two callers at once, each on one thread with a batch of half the size.
    """
    print("\n| rig | float32 over float64 | two threads, 4096 states | at most | two threads, 65536 states | at most |")
    print("|---|---|---|---|---|---|")
    pinned = os.sched_getaffinity(0)
    for name in ROBOTS:
        rig = robot(name)
        double, single = states(rig, STATES), states(rig, STATES, np.float32)
        one = turns(
            {
                "double": timed(lambda: art.forward_dynamics(rig, *double, threads=1)),
                "single": timed(lambda: art.forward_dynamics(rig, *single, threads=1)),
            }
        )
        os.sched_setaffinity(0, ALL_CORES)
        cells = [f"{ratio(one, 'double', 'single'):.2f}"]
        for count in (STATES, 16 * STATES):
            many = states(rig, count)
            halves = [[x[part] for x in many] for part in (slice(count // 2), slice(count // 2, count))]
            both = turns(
                {
                    "one": timed(lambda: art.forward_dynamics(rig, *many, threads=1)),
                    "two": timed(lambda: art.forward_dynamics(rig, *many, threads=2)),
                    "halves": at_once([lambda half=half: art.forward_dynamics(rig, *half, threads=1) for half in halves]),
                },
                count=41,
            )
            cells += [f"{ratio(both, 'one', 'two'):.2f}", f"{ratio(both, 'one', 'halves'):.2f}"]
        os.sched_setaffinity(0, pinned)
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


def single(native: bool) -> None:
    """One state from Python: `forward_dynamics(rig, q, v, tau)` against `pin.aba` and `mujoco.mj_forward`.

    Of our time, "code" is the machine code for one state, as it takes for 1000 states one after the other; "arrays" adds what it
    takes to call it from Python for one state and to look at the arrays, the result's memory being there already. The last column
    is a call for a batch of eight states.
    """
    heads = (
        "rig",
        "code",
        "arrays",
        "articulated",
        "`pin.aba`",
        "ours over theirs",
        "`mj_forward`",
        "ours over theirs",
        "eight states",
    )
    print(f"\nMicroseconds a call:\n\n| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for name in ROBOTS:
        rig = robot(name)
        many, eight = states(rig, 1000), states(rig, 8)
        one = [x[0].copy() for x in many]
        result, results = art.forward_dynamics(rig, *one), np.empty((1000, rig.nv))
        kernel = compiled(programs(rig)["forward_dynamics"], single=False, lanes=1)
        light = kernel.light()
        assert light is not None
        table = [(x, x.strides[0], 0, None) for x in (*many, results)]
        contenders = {
            "code": timed(lambda: kernel(table, 1000, threads=1)),
            "arrays": timed(lambda: light(*one, result)),
            "ours": timed(lambda: art.forward_dynamics(rig, *one)),
            "eight": timed(lambda: art.forward_dynamics(rig, *eight)),
            "aba": Pinocchio(rig, *many).single(),
            "mujoco": mujoco_forward(rig, *one),
        }
        taken = turns(contenders)
        us = {who: median(taken, who) * 1e6 for who in contenders}
        us["code"] /= 1000
        cells = " | ".join(f"{us[who]:.2f}" for who in ("code", "arrays", "ours", "aba"))
        cells += f" | {ratio(taken, 'ours', 'aba'):.2f} | {us['mujoco']:.2f} | {ratio(taken, 'ours', 'mujoco'):.2f} | {us['eight']:.2f}"
        print(f"| {name} | {cells} |", flush=True)


_TO_COMPILE = """
import sys, time, warnings
sys.path.insert(0, {folder!r})
import numpy as np
from rigs import chain, robot
import articulated as art
rig = {rig}
q, v = np.tile(rig.neutral(), (64, 1)), np.zeros((64, rig.nv))
art.mass_matrix(chain(1), np.zeros((2, 1)))  # LLVM itself is loaded
began = time.perf_counter()
art.forward_dynamics(rig, q, v, v)
print(time.perf_counter() - began)
"""


def compiling(native: bool) -> None:
    """From the first call of `forward_dynamics` on a batch to its result: compiled from nothing, and from the disk cache."""
    print("\nSeconds:\n\n| rig | from nothing | per link | from the cache |\n|---|---|---|---|")
    folder = os.path.dirname(os.path.abspath(__file__))
    for name, rig in {"G1": "robot('G1')", **{f"chain of {n}": f"chain({n})" for n in (100, 200, 400, 800)}}.items():
        fresh, kept = [], []
        for _ in range(3):
            with tempfile.TemporaryDirectory() as cache:
                for list_ in (fresh, kept):
                    code, env = _TO_COMPILE.format(folder=folder, rig=rig), {**os.environ, "ARTICULATED_CACHE": cache}
                    output = subprocess.run([sys.executable, "-c", code], env=env, check=True, capture_output=True, text=True)
                    list_.append(float(output.stdout))
        links = int(name.split()[-1]) if name.startswith("chain") else 35
        cells = f"{np.median(fresh):.2f} | {np.median(fresh) / links:.4f} | {np.median(kept):.3f}"
        print(f"| {name} | {cells} |", flush=True)


def growth(native: bool) -> None:
    """Chains of hinges: nanoseconds per degree of freedom and state, one thread, 1024 states.

    One `pin.Data` takes 56 nv³ bytes: 12 GB for 600 links, 29 GB for 800. Where there is less memory, Pinocchio is left out.
    """
    print("\n| links | articulated | `abaInParallel` | ratio |\n|---|---|---|---|")
    free = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES")
    for links in (10, 20, 50, 100, 200, 400, 600, 800):
        rig = chain(links)
        arrays = states(rig, 1024)
        contenders = {"ours": timed(lambda rig=rig, arrays=arrays: art.forward_dynamics(rig, *arrays, threads=1))}
        if fits := 56 * links**3 < 0.9 * free:
            contenders["pinocchio"] = Pinocchio(rig, *arrays).batch["forward_dynamics"]
        taken = turns(contenders, 7)
        ns = {who: median(taken, who) / 1024 / links * 1e9 for who in contenders}
        theirs = f"{ns['pinocchio']:.0f} | {ratio(taken, 'pinocchio', 'ours'):.1f}" if fits else "- | -"
        print(f"| {links} | {ns['ours']:.1f} | {theirs} |", flush=True)


def simulation(native: bool) -> None:
    """A step of `Simulation.run`, semi-implicit, 4096 states from neutral falling freely, against `forward_dynamics`; one thread."""
    print("\nNanoseconds per state:\n\n| rig | forward_dynamics | a step | ratio |\n|---|---|---|---|")
    for name in ("UR5", "G1", "human"):
        rig = robot(name)
        q, v, tau = states(rig, STATES)
        run = art.Simulation(rig, dt=0.001, threads=1)
        steps = 32
        contenders = {
            "dynamics": timed(lambda: art.forward_dynamics(rig, q, v, tau, threads=1)),
            "run": timed(lambda: run.run(q, duration=0.032, fps=1 / 0.032)),
        }
        taken = turns(contenders)
        taken["step"] = [seconds / steps for seconds in taken["run"]]
        ns = [median(taken, who) / STATES * 1e9 for who in ("dynamics", "step")]
        print(f"| {name} | {ns[0]:.1f} | {ns[1]:.1f} | {ratio(taken, 'step', 'dynamics'):.2f} |", flush=True)


_STARTED = """
import time
began = time.perf_counter()
import numpy as np
numpy = time.perf_counter()
import articulated as art
imported = time.perf_counter()
rig = art.load("package://example-robot-data/robots/g1_description/urdf/g1_29dof_rev_1_0.urdf", "free")
loaded = time.perf_counter()
a = art.forward_dynamics(rig, rig.neutral(), np.zeros(rig.nv), np.zeros(rig.nv))
done = time.perf_counter()
print(numpy - began, imported - numpy, loaded - imported, done - loaded)
"""


def starting(native: bool) -> None:
    """A new process with a warm cache: seconds until G1's first `forward_dynamics` is there."""
    rows = []
    for _ in range(9):
        output = subprocess.run([sys.executable, "-W", "ignore", "-c", _STARTED], check=True, capture_output=True, text=True)
        rows.append([float(x) for x in output.stdout.split()])
    cells = " | ".join(f"{x:.3f}" for x in np.median(rows[1:], axis=0))
    print("\n| numpy | `import articulated` | `load` | `forward_dynamics` |\n|---|---|---|---|")
    print(f"| {cells} |")


TABLES = {
    "throughput": throughput,
    "functions": functions,
    "formats": formats,
    "single": single,
    "compiling": compiling,
    "growth": growth,
    "simulation": simulation,
    "starting": starting,
    "contact": contact,
    "stepping": stepping,
    "contact_growth": contact_growth,
    "loops": loops,
    "loop_growth": loop_growth,
    "pairs": pairs_of_bodies,
    "two_ragdolls": two_ragdolls,
    "particles": particles,
}
ALL_CORES = os.sched_getaffinity(0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"default: all of {', '.join(TABLES)}")
    parser.add_argument("--no-native", action="store_true")
    options = parser.parse_args()
    unknown = set(options.tables) - set(TABLES)
    if unknown:
        parser.error(f"unknown table {', '.join(unknown)}; expected some of {', '.join(TABLES)}")
    pin_to_one_core()
    print(f"{time.strftime('%Y-%m-%d')}, {setting()}", flush=True)
    for name in options.tables or TABLES:
        print(f"\n## {name}\n\n{inspect.getdoc(TABLES[name])}")
        TABLES[name](not options.no_native)


if __name__ == "__main__":
    main()
