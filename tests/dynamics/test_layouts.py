"""However numbers lie in memory, the result is that of a plain copy of them; and `out` gets it, even where it is an input too."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import articulated as art
from articulated.dynamics.functions import programs
from articulated.dynamics.light import lights

RIG = art.load("buggy", root="free")


@pytest.fixture
def plain(rng):
    return RIG.random(rng, 21), *rng.normal(size=(2, 21, RIG.nv))


LAYOUTS = {
    "every other row": lambda x: np.repeat(x, 2, axis=0)[::2],
    "backwards": lambda x: x[::-1].copy()[::-1],
    "columns of a wider array": lambda x: np.pad(x, ((0, 0), (3, 5)))[:, 3:-5],
    "Fortran order": np.asfortranarray,
    "every other column": lambda x: np.repeat(x, 2, axis=1)[:, ::2],
    "not aligned": lambda x: np.frombuffer(b"\0" + x.tobytes(), dtype=np.uint8)[1:].view(np.float64).reshape(x.shape),
    "other byte order": lambda x: x.astype(x.dtype.newbyteorder()),
    "lists": lambda x: x.tolist(),
    "a subclass": lambda x: x.view(np.recarray),
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("count", [1, 3, 21])
def test_layouts(plain, layout, count):
    plain = [x[:count] for x in plain]
    expected = art.forward_dynamics(RIG, *plain)
    odd = [LAYOUTS[layout](x) for x in plain]
    assert art.forward_dynamics(RIG, *odd).tobytes() == expected.tobytes()
    assert art.forward_dynamics(RIG, odd[0], plain[1], odd[2]).tobytes() == expected.tobytes()
    one = [x[0] if isinstance(x, np.ndarray) else np.array(x[0]) for x in odd]
    assert art.forward_dynamics(RIG, *one).tobytes() == expected[0].tobytes()


def test_broadcasting(plain):
    q, v, tau = plain
    expected = art.forward_dynamics(RIG, q, np.tile(v[0], (21, 1)), tau)
    assert art.forward_dynamics(RIG, q, v[0], tau).tobytes() == expected.tobytes()
    assert art.forward_dynamics(RIG, q, v[:1], tau).tobytes() == expected.tobytes()
    grid = art.forward_dynamics(RIG, q[:, None], v[None, :5], tau[0])
    assert grid.shape == (21, 5, RIG.nv)
    for i, j in ((0, 0), (20, 4), (7, 2)):
        assert grid[i, j].tobytes() == art.forward_dynamics(RIG, q[i], v[j], tau[0]).tobytes()
    turned = art.forward_dynamics(RIG, q[:20].reshape(4, 5, -1).transpose(1, 0, 2), v[0], tau[0])
    assert turned[3, 2].tobytes() == art.forward_dynamics(RIG, q[13], v[0], tau[0]).tobytes()


@pytest.mark.parametrize("count", [1, 3, 21])
def test_nothing_beyond_the_result_is_written(plain, count):
    q, v, tau = (x[:count] for x in plain)
    for dtype in (np.float64, np.float32):
        arrays = [x.astype(dtype) for x in (q, v, tau)]
        around = np.full((count + 2, RIG.nv), 7.0, dtype)
        art.forward_dynamics(RIG, *arrays, out=around[1:-1])
        assert (around[[0, -1]] == 7.0).all()
        assert around[1:-1].tobytes() == art.forward_dynamics(RIG, *arrays).tobytes()


def test_nothing_beyond_an_argument_is_read(plain):
    """Arguments at the very end of a page behind which there is nothing."""
    import ctypes
    import mmap

    libc = ctypes.CDLL(None, use_errno=True)
    if not hasattr(libc, "mprotect"):
        pytest.skip("no mprotect")
    page = mmap.PAGESIZE

    def at_the_edge(x: np.ndarray) -> np.ndarray:
        pages = -(-x.nbytes // page)
        memory = mmap.mmap(-1, (pages + 1) * page)
        whole = np.frombuffer(memory, dtype=np.uint8)
        assert libc.mprotect(ctypes.c_void_p(whole.ctypes.data + pages * page), page, 0) == 0
        edge = whole[pages * page - x.nbytes : pages * page].view(x.dtype).reshape(x.shape)
        edge[...] = x
        return edge

    for count in (1, 2, 3, 7, 8, 9, 21):
        for dtype in (np.float64, np.float32):
            arrays = [x[:count].astype(dtype) for x in plain]
            edges = [at_the_edge(x) for x in arrays]
            assert art.forward_dynamics(RIG, *edges).tobytes() == art.forward_dynamics(RIG, *arrays).tobytes()
            if count == 1:
                alone = art.forward_dynamics(RIG, *(x[0] for x in edges))
                assert alone.tobytes() == art.forward_dynamics(RIG, *arrays)[0].tobytes()


def test_in_place(plain):
    q, v, tau = plain
    expected = art.integrate(RIG, q, v)
    assert art.integrate(RIG, q, v, out=q) is q
    assert q.tobytes() == expected.tobytes()
    a = art.forward_dynamics(RIG, q, v, tau)
    art.forward_dynamics(RIG, q[1:], v[1:], tau[1:], out=tau[:-1])
    assert tau[:-1].tobytes() == a[1:].tobytes()


def test_in_place_and_refused(plain):
    """What is refused leaves an `out` that is an input as it was."""
    q, v, _ = plain
    before, v[3, 1] = q.copy(), np.nan
    with pytest.raises(ValueError, match=r"dv\[3, 1\] is nan"):
        art.integrate(RIG, q, v, out=q)
    assert q.tobytes() == before.tobytes()


def test_numbers_that_nothing_comes_of_must_be_finite_too(plain):
    q, v, tau = plain
    q[5, 0] = np.inf  # where a free rig is does not matter to its acceleration
    with pytest.raises(ValueError, match=r"q\[5, 0\] is inf \(root_joint.x\)"):
        art.forward_dynamics(RIG, q, v, tau)
    for _ in range(3):
        art.forward_dynamics(RIG, *(x[0] for x in plain))
    with pytest.raises(ValueError, match=r"q\[0\] is inf"):
        art.forward_dynamics(RIG, *(x[5] for x in plain))


def test_quaternions_are_looked_at_in_compiled_code(plain):
    q, v, tau = plain
    q[4, 3:7] *= 1.0 + 5e-7
    art.forward_dynamics(RIG, q, v, tau)
    q[4, 3:7] *= 1.0 + 1e-6
    with pytest.raises(ValueError, match=r"the quaternion of joint 'root_joint' has norm 1.00000 in state \[4\]|has norm"):
        art.forward_dynamics(RIG, q, v, tau)


def test_the_light_path_takes_plain_states_only(plain):
    """The same answers and errors from the function for one state, whatever it is given."""
    rig = art.load("buggy", root="free")
    q, v, tau = (x[0].copy() for x in plain)
    first = art.forward_dynamics(rig, q, v, tau)
    assert art.forward_dynamics(rig, q, v, tau).tobytes() == first.tobytes()  # this one by the light path
    assert art.forward_dynamics(rig, q.tolist(), v, tau).tobytes() == first.tobytes()
    assert art.forward_dynamics(rig, q, v, tau, None, art.GRAVITY).tobytes() == first.tobytes()
    assert art.forward_dynamics(rig, q, v, tau=tau).tobytes() == first.tobytes()
    assert art.forward_dynamics(rig, q.astype(np.float32), v, tau).dtype == np.float64
    assert art.forward_dynamics(rig, q[None], v, tau).shape == (1, rig.nv)
    for bad in ((q, v), (q, v, tau[:-1]), (v, v, tau), (q, v, None), (q, v, "tau"), (q * np.nan, v, tau), (2 * q, v, tau)):
        with pytest.raises((TypeError, ValueError)):
            art.forward_dynamics(rig, *bad)
    with pytest.raises(TypeError):
        art.forward_dynamics()


def test_every_function_has_its_light_path(rng):
    rig = art.load("buggy", root="free")
    functions = programs(rig)
    assert set(functions) == set(lights)
    for name, one in functions.items():
        state = [rig.random(rng) if a.name.startswith("q") else rng.normal(size=a.shape) for a in one.arguments]
        expected = getattr(art, name)(rig, *state)
        light = lights[name][id(rig)]
        result = np.empty(light.shape)
        assert light.one(*state, result)
        assert result.tobytes() == expected.tobytes()
        assert not light.one(*state, result[None])
        for dtype in (np.float64, np.float32):
            states = [np.stack([x, x, x]).astype(dtype) for x in state]
            expected = getattr(art, name)(rig, *states)
            result = np.zeros_like(expected)
            run, _ = light.many[result.dtype.char]
            assert run(*states, result, None)
            assert result.tobytes() == expected.tobytes()
            for unusual in (result[:2], result[..., None], result.astype("g")):
                assert not run(*states, unusual, None)
            assert not run(*states, result)
            assert not run(*states[1:], result, None)


def test_more_arguments_go_the_usual_way(rng):
    """What a light path gets beside its arrays is none of a user's arguments."""
    rig = art.load("cartpole")
    q = rig.random(rng, 3)
    up = np.array([0.0, 0.0, 1.6])
    for _ in range(2):
        assert np.array_equal(art.potential_energy(rig, q, -up), -art.potential_energy(rig, q, up))
        assert art.potential_energy(rig, q).shape == (3,)
        with pytest.raises(TypeError):
            art.mass_matrix(rig, q, np.zeros((3, 2, 2)))
        assert art.mass_matrix(rig, q).shape == (3, 2, 2)


def test_rigs_come_and_go(rng):
    """Code lives as long as it is used, and no longer than its rig."""
    import gc

    before = len(lights["forward_dynamics"])
    for k in range(20):
        rig = art.load("cartpole").with_joints(damping=0.1 * k)
        q, v = rig.random(rng, 5), rng.normal(size=(5, 2))
        many = art.forward_dynamics(rig, q, v, v, joint_forces=True)
        for _ in range(2):
            assert art.forward_dynamics(rig, q[0], v[0], v[0], joint_forces=True).tobytes() == many[0].tobytes()
            art.forward_dynamics(rig, q[0], v[0], v[0])
        del rig
    gc.collect()
    assert len(lights["forward_dynamics"]) == before


def test_a_long_compilation_shows_a_bar_and_a_short_one_nothing(tmp_path):
    """On a terminal; a pipe sees nothing at all."""
    import fcntl
    import pty
    import struct
    import termios

    script = "import articulated.compiler.kernels as k; k._PATIENCE = {}; import numpy as np, articulated as art\n"
    script += (
        "rig = art.load('ragdoll', 'free'); q = rig.neutral(); art.forward_dynamics(rig, q, np.zeros(rig.nv), np.zeros(rig.nv))"
    )
    for patience, expected in (("0.0", True), ("60.0", False)):
        ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        environment = {**os.environ, "ARTICULATED_CACHE": "off"}
        done = subprocess.run([sys.executable, "-c", script.format(patience)], env=environment, stdout=theirs, stderr=theirs)
        os.close(theirs)
        shown = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:
                break
            if not part:
                break
            shown += part
        os.close(ours)
        assert done.returncode == 0
        assert (b"compiling forward_dynamics" in shown) is expected
        assert expected or not shown
