"""The exported C compiles without a warning, needs no library, and computes the same bits as machine code does."""

from __future__ import annotations

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
from random_trees import random_rig

import articulated as art
from articulated.dynamics.functions import programs

GCC = shutil.which("gcc")
pytestmark = pytest.mark.skipif(GCC is None, reason="gcc is not installed")
STRICT = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-ffp-contract=off"]
TARGETS = {"with fma": ["-mfma"], "without fma": []}


def built(rig, folder, functions, flags, single=False) -> ctypes.CDLL:
    header, source, _ = art.export_c(rig, folder, functions, single=single)
    library = folder / "rig.so"
    # -nostdlib with -z defs: nothing may be missing, not even libm
    command = [GCC, *STRICT, *flags, "-shared", "-fPIC", source, "-o", library, "-Wl,-z,defs", "-nodefaultlibs", "-lc"]
    subprocess.run(command, check=True, cwd=header.parent)
    return ctypes.CDLL(str(library))


def call(library, name, arrays, shape, dtype):
    result = np.empty(shape, dtype)
    getattr(library, name)(*(ctypes.c_void_p(a.ctypes.data) for a in (*arrays, result)))
    return result


def arguments(rig, program, rng, dtype):
    given = {"q": rig.random(rng), "q0": rig.random(rng), "q1": rig.random(rng)}
    return [given.get(a.name, rng.normal(size=a.shape)).astype(dtype) for a in program.arguments]


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("single", [False, True])
def test_bits(tmp_path, rng, target, single):
    rig = random_rig(3, mimic=True, armature=True, size=8)
    dtype = np.float32 if single else np.float64
    library = built(rig, tmp_path, list(programs(rig)), TARGETS[target], single)
    prefix = next(tmp_path.glob("*.h")).stem
    for name, program in programs(rig).items():
        for _ in range(5):
            arrays = arguments(rig, program, rng, dtype)
            ours = getattr(art, name)(rig, *(a[None] for a in arrays))[0]
            theirs = call(library, f"{prefix}_{name}", arrays, program.results[0].shape, dtype)
            assert theirs.tobytes() == ours.tobytes(), name


def test_step(tmp_path, rng):
    rig = art.load("ragdoll", root="free").with_joints(damping=0.5, friction=0.1)
    library = built(rig, tmp_path, ["step"], ["-mfma"])
    simulation = art.Simulation(rig, dt=0.001)
    state = simulation.reset(rig.random(rng), rng.normal(size=rig.nv))
    state = simulation.step(state)  # the exported step is one under way
    slack = state.memory[: np.count_nonzero(rig.friction)]
    for _ in range(20):
        tau, h = rng.normal(size=rig.nv), np.array(0.001)
        q, v, slack_next = np.empty(rig.nq), np.empty(rig.nv), np.empty(len(slack))
        arrays = state.q, state.v, slack, tau, h, q, v, slack_next
        library.ragdoll_step(*(ctypes.c_void_p(a.ctypes.data) for a in arrays))
        state, slack = simulation.step(state, tau), slack_next
        assert (q.tobytes(), v.tobytes()) == (state.q.tobytes(), state.v.tobytes())


def test_step_without_friction(tmp_path, rng):
    """Into joint limits and out again."""
    rig = art.load("ragdoll", root="free").with_joints(damping=0.5)
    library = built(rig, tmp_path, ["step"], ["-mfma"])
    simulation = art.Simulation(rig, dt=0.002)
    state = simulation.reset(rig.random(rng), 3.0 * rng.normal(size=rig.nv))
    state = simulation.step(state)  # the exported step is one under way
    for _ in range(100):
        tau, h = np.zeros(rig.nv), np.array(0.002)
        q, v = np.empty(rig.nq), np.empty(rig.nv)
        library.ragdoll_step(*(ctypes.c_void_p(a.ctypes.data) for a in (state.q, state.v, tau, h, q, v)))
        state = simulation.step(state, tau)
        assert (q.tobytes(), v.tobytes()) == (state.q.tobytes(), state.v.tobytes())
    assert state.memory[-1] > 110  # joints did meet their limits


@pytest.mark.parametrize("single", [False, True])
def test_arithmetic_without_hardware(tmp_path, rng, single):
    """fma and sqrt as computed where the target has neither, against the processor's."""
    from articulated.compiler.c_source import prelude

    text = prelude(single).replace("__SSE2__", "ART_NEVER").replace("__FMA__", "ART_NEVER")
    real = "float" if single else "double"
    text += f"void many_fma(const {real} *a, const {real} *b, const {real} *c, {real} *r, int n)\n"
    text += "{ for (int k = 0; k < n; ++k) r[k] = art_fma(a[k], b[k], c[k]); }\n"
    text += f"void many_sqrt(const {real} *a, {real} *r, int n) {{ for (int k = 0; k < n; ++k) r[k] = art_sqrt(a[k]); }}\n"
    hard = f"void hard_fma(const {real} *a, const {real} *b, const {real} *c, {real} *r, int n)\n"
    hard += f"{{ for (int k = 0; k < n; ++k) r[k] = __builtin_fma{'f' if single else ''}(a[k], b[k], c[k]); }}\n"
    (tmp_path / "soft.c").write_text(text)
    (tmp_path / "hard.c").write_text(hard)
    library = tmp_path / "arithmetic.so"
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-mfma", "-shared", "-fPIC"]
    subprocess.run([GCC, *flags, "soft.c", "hard.c", "-o", library], check=True, cwd=tmp_path)
    functions = ctypes.CDLL(str(library))
    n, dtype = 400_000, np.float32 if single else np.float64
    reach = 12 if single else 100
    a, b, c = (rng.normal(size=(3, n)) * 10.0 ** rng.integers(-reach, reach, (3, n))).astype(dtype)
    c[: n // 2] = -(a * b)[: n // 2] * (1 + np.finfo(dtype).eps * rng.integers(-3, 4, n // 2)).astype(dtype)  # cancellation
    c[-100:] = 0.0
    soft, exact = np.empty((2, n), dtype)
    functions.many_fma(*(ctypes.c_void_p(x.ctypes.data) for x in (a, b, c, soft)), n)
    functions.hard_fma(*(ctypes.c_void_p(x.ctypes.data) for x in (a, b, c, exact)), n)
    np.testing.assert_array_equal(soft, exact)
    x = np.concatenate([np.abs(a[: n - 6]), np.array([0.0, 4.0, np.inf, np.nan, -1.0, 2.0**-140], dtype)])
    functions.many_sqrt(ctypes.c_void_p(x.ctypes.data), ctypes.c_void_p(soft.ctypes.data), n)
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(soft, np.sqrt(x))


def test_the_example_runs(tmp_path):
    rig = art.load("cartpole")
    art.export_c(rig, tmp_path)
    subprocess.run([GCC, "-std=c99", "-O2", "example.c", "cartpole.c", "-o", "example"], check=True, cwd=tmp_path)
    printed = subprocess.run(["./example"], check=True, cwd=tmp_path, capture_output=True, text=True).stdout
    expected = art.forward_dynamics(rig, rig.neutral(), np.zeros(2), np.zeros(2))
    assert [float(line) for line in printed.split()] == expected.tolist()


def test_what_cannot_be_exported_is_refused(tmp_path):
    rig = art.load("cartpole")
    with pytest.raises(ValueError, match="function 'jacobian' cannot be exported; expected some of forward_dynamics, "):
        art.export_c(rig, tmp_path / "new", ["jacobian"])
    assert not (tmp_path / "new").exists()
    with pytest.raises(ValueError, match=r"gravity has shape \(2,\); expected \(..., 3\)"):
        art.export_c(rig, tmp_path, gravity=(0.0, 1.0))
