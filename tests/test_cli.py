"""The command line: what it prints, what it writes, and its exit codes."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import articulated as art
from articulated import cli


@pytest.fixture
def command(capsys, tmp_path, monkeypatch):
    """Run a command in an empty folder: exit code, output, error output."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[int, str, str]:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
            try:
                code = cli.main(arguments)
            except SystemExit as stop:  # argparse's own
                code = int(stop.code or 0)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


class TestSimulate:
    def test_files(self, command):
        code, out, err = command(
            "simulate",
            "pendulum",
            "--duration",
            "0.5",
            "--fps",
            "10",
            "-o",
            "a.npz",
            "-o",
            "a.csv",
            "--pose",
            "shoulder=0,0.6,0,0.8",
        )
        assert (code, err) == (0, "")
        assert "pendulum: 6 frames, 0.5 s" in out
        assert "passed" in out
        assert "wrote a.npz\nwrote a.csv" in out
        run = art.Trajectory.load("a.npz")
        np.testing.assert_allclose(run.q[0], [0, 0.6, 0, 0.8, 0, 0, 0, 1])
        assert len(Path("a.csv").read_text().splitlines()) == 7

    def test_animation(self, command):
        code, _, err = command("simulate", "cartpole", "--duration", "0.1", "--dt", "0.0005", "--random", "1", "-o", "a.glb")
        assert (code, err) == (0, "")
        assert Path("a.glb").read_bytes().startswith(b"glTF")

    def test_an_animation_is_of_one_state(self, command, monkeypatch):
        monkeypatch.setattr(art.Simulation, "run", lambda *_: pytest.fail("ran all the same"))
        code, _, err = command("simulate", "cartpole", "--random", "3", "-o", "a.glb")
        assert code == cli.BAD_INPUT
        assert "'a.glb' holds one state, not 3; write .npz, and export one: Trajectory.load(…).state(0)" in err

    def test_an_animation_needs_its_writer_before_the_run(self, command, monkeypatch):
        monkeypatch.setattr(art.Simulation, "run", lambda *_: pytest.fail("ran all the same"))
        monkeypatch.setitem(sys.modules, "pygltflib", None)
        code, _, err = command("simulate", "cartpole", "-o", "a.glb")
        assert code == cli.BAD_INPUT
        assert "pip install 'articulated[gltf]'" in err

    def test_a_format_that_cannot_hold_it_does_not_lose_the_run(self, command):
        code, _, err = command("simulate", "cartpole", "--duration", "0.1", "-o", "a.bvh")
        assert code == cli.BAD_OUTPUT
        assert "joints slide slide, which BVH does not know" in err
        rescued = err.split("the trajectory is in ")[1].split(" instead")[0]
        assert art.Trajectory.load(rescued).rig.name == "cartpole"
        Path(rescued).unlink()

    def test_quiet(self, command):
        assert command("simulate", "cartpole", "--duration", "0.1", "-o", "a.npz", "--quiet") == (0, "", "")

    def test_degrees_velocity_and_damping(self, command):
        arguments = ["--pose", "hinge=90deg", "--velocity", "slide=0.5", "--damping", "0.3", "--duration", "0.1"]
        assert command("simulate", "cartpole", *arguments, "-o", "a.npz")[0] == 0
        run = art.Trajectory.load("a.npz")
        np.testing.assert_allclose(run.q[0], [0, np.pi / 2])
        np.testing.assert_allclose(run.v[0], [0.5, 0])
        assert run.rig.damping.tolist() == [0.3, 0.3]

    def test_collisions(self, command, tmp_path):
        """A pendulum that swings into another stays outside; unless an SRDF says that they never meet."""
        sphere = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
        inertial = '<inertial><origin xyz="0 0 -0.5"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
        ball = sphere.replace("<geometry>", '<origin xyz="0 0 -0.5"/><geometry>')
        links = "".join(f'<link name="{name}">{inertial}{ball}</link>' for name in ("a", "b"))
        joints = "".join(
            f'<joint name="{name}_joint" type="continuous"><parent link="base"/><child link="{name}"/>'
            f'<origin xyz="{x} 0 0"/><axis xyz="0 1 0"/></joint>'
            for name, x in (("a", 0.0), ("b", 0.3))
        )
        (tmp_path / "two.urdf").write_text(f'<robot name="two"><link name="base"/>{links}{joints}</robot>')
        disabled = '<robot name="two"><disable_collisions link1="a" link2="b" reason="Never"/></robot>'
        (tmp_path / "two.srdf").write_text(disabled)
        start = [
            "simulate",
            str(tmp_path / "two.urdf"),
            "--pose",
            "a_joint=90deg",
            "--duration",
            "1",
            "--dt",
            "0.001",
            "--quiet",
        ]
        nearest = {}
        for name, more in {
            "touch": ["--collisions"],
            "pass": [],
            "told": ["--collisions", "--srdf", str(tmp_path / "two.srdf")],
        }.items():
            assert command(*start, *more, "-o", f"{name}.npz")[0] == 0
            run = art.Trajectory.load(f"{name}.npz")
            centers = [np.array([x - 0.5 * np.sin(a), -0.5 * np.cos(a)]) for x, a in zip((0.0, 0.3), run.q.T, strict=True)]
            nearest[name] = np.linalg.norm(centers[0] - centers[1], axis=0).min()
        assert nearest["touch"] > 0.195
        assert max(nearest["pass"], nearest["told"]) < 0.15

    def test_random_starts_and_root(self, command):
        arguments = ["--random", "3", "--seed", "5", "--root", "free", "--duration", "0.1", "--integrator", "rk4"]
        assert command("simulate", "pendulum", *arguments, "-o", "a.npz")[0] == 0
        run = art.Trajectory.load("a.npz")
        np.testing.assert_array_equal(run.q[:, 0], run.rig.random(5, 3))
        assert run.settings["integrator"] == "rk4"

    def test_a_run_that_goes_wrong_is_written_and_has_an_exit_code(self, command):
        arguments = ["--velocity", "hinge=50", "--dt", "0.05", "--fps", "20", "--integrator", "euler"]
        code, out, _ = command("simulate", "cartpole", *arguments, "-o", "a.npz")
        assert code == cli.BAD_RESULT
        assert "NOT PASSED" in out
        assert Path("a.npz").exists()

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            (["--pose", "knee=1"], "--pose 'knee=1': expected JOINT=VALUE with a moving joint of rig 'cartpole': slide, hinge"),
            (["--pose", "hinge"], "--pose 'hinge': expected JOINT=VALUE"),
            (["--pose", "hinge=much"], "--pose 'hinge=much': 'much' is not a number; write radians or metres, or 90deg"),
            (["--pose", "hinge=1,2"], "--pose 'hinge=1,2': expected 1 values (continuous), got 2"),
            (["--velocity", "hinge=nan"], "'nan' is not a number"),
            (["--duration", "0.001"], "is shorter than one frame"),
            (["--damping", "-1"], "damping of joint 'slide' is -1.0"),
            (["-o", "fall.avi"], "'fall.avi': unknown format; give a name that ends in .npz, .bvh, .csv or .glb"),
        ],
    )
    def test_bad_values(self, command, arguments, message):
        code, out, err = command("simulate", "cartpole", "-o", "a.npz", *arguments)
        assert (code, out) == (cli.BAD_INPUT, "")
        assert err.startswith("articulated: ")
        assert message in err
        assert not list(Path().iterdir())

    def test_a_quaternion_must_be_near_unit_length(self, command):
        code, _, err = command("simulate", "pendulum", "-o", "a.npz", "--pose", "elbow=1,1,1,1")
        assert code == cli.BAD_INPUT
        assert "the quaternion (x, y, z, w) has norm 2; expected 1" in err

    def test_a_follower_cannot_be_posed(self, command):
        code, _, err = command("simulate", "buggy", "-o", "a.npz", "--pose", "front_right_steering=1")
        assert code == cli.BAD_INPUT
        assert "joint 'front_right_steering' follows joint 'front_left_steering'; set that one" in err

    def test_bad_options(self, command):
        for arguments in (
            ["--dt", "0"],
            ["--dt", "fast"],
            ["--duration", "inf"],
            ["--integrator", "magic"],
            ["--random", "0"],
            ["--gravity", "1"],
        ):
            code, _, err = command("simulate", "cartpole", "-o", "a.npz", *arguments)
            assert code == cli.BAD_INPUT
            assert arguments[0] in err

    def test_an_output_that_cannot_be_written_is_found_before_the_run(self, command, monkeypatch):
        monkeypatch.setattr(art.Simulation, "run", lambda *_: pytest.fail("ran all the same"))
        code, out, err = command("simulate", "cartpole", "-o", "none/a.npz")
        assert (code, out) == (cli.BAD_OUTPUT, "")
        assert "articulated: cannot write none/a.npz: No such file or directory; create its directory first" in err

    def test_a_full_disk_does_not_lose_the_run(self, command, monkeypatch):
        def full(self, path):
            raise OSError(f"cannot write {path}: No space left on device")

        monkeypatch.setattr(art.Trajectory, "export", full)
        code, _, err = command("simulate", "cartpole", "--duration", "0.1", "-o", "a.csv")
        assert code == cli.BAD_OUTPUT
        assert "No space left on device; the trajectory is in " in err
        rescued = err.split("the trajectory is in ")[1].split(" instead")[0]
        assert art.Trajectory.load(rescued).rig.name == "cartpole"
        Path(rescued).unlink()

    def test_interrupted(self, command, monkeypatch):
        def stop(*_, **__):
            raise KeyboardInterrupt

        monkeypatch.setattr(art.Simulation, "run", stop)
        code, _, err = command("simulate", "cartpole", "-o", "a.npz")
        assert (code, err) == (cli.INTERRUPTED, "articulated: interrupted\n")
        assert not list(Path().iterdir())


class TestCheck:
    def test_agrees(self, command):
        for arguments in (["ragdoll", "--root", "free"], ["buggy"], ["cartpole", "--armature", "0.2"]):
            code, out, err = command("check", *arguments, "--samples", "3")
            assert (code, err) == (0, "")
            assert out.count("\n") >= 18
            assert "forward_dynamics, external" in out
            assert out.endswith("all agree\n")

    def test_reads_the_same_file(self, command, robots):
        code, out, _ = command("check", str(robots / "ur_description/urdf/ur5_robot.urdf"), "--samples", "3")
        assert code == 0
        assert "read from the same file by its own reader" in out

    def test_disagreement_has_an_exit_code(self, command, monkeypatch):
        from articulated import crosscheck

        monkeypatch.setattr(crosscheck, "TOLERANCE", 1e-30)
        code, out, _ = command("check", "cartpole", "--samples", "3")
        assert code == cli.BAD_RESULT
        assert "<- DISAGREES" in out
        assert out.endswith("DISAGREEMENT\n")

    def test_without_pinocchio_the_extra_is_named(self, command, monkeypatch):
        monkeypatch.setitem(sys.modules, "pinocchio", None)
        code, _, err = command("check", "cartpole")
        assert code == cli.BAD_INPUT
        assert "install it with: pip install 'articulated[check]'" in err


class TestInfo:
    def test_joints(self, command):
        code, out, _ = command("info", "buggy", "--links")
        assert code == 0
        assert out.startswith("buggy: 9 degrees of freedom, 10 bodies, 11 links")
        assert "= 1 front_left_steering +0" in out
        assert "(the world)" in out

    def test_what_is_not_used_is_named(self, command, robots):
        _, out, _ = command("info", str(robots / "solo_description/robots/solo.urdf"))
        assert "not used: " in out or "gazebo" not in (robots / "solo_description/robots/solo.urdf").read_text()

    def test_rigs(self, command):
        code, out, _ = command("rigs")
        assert code == 0
        assert [line.split()[0] for line in out.splitlines()] == sorted(art.shipped_rigs())

    def test_bad_rig(self, command):
        Path("walker.urdf").write_text('<robot name="w"><link/></robot>')
        assert command("info", "walker.urdf") == (2, "", 'articulated: walker.urdf:1: <link>: has no name; add name="…"\n')

    def test_warnings_go_to_stderr(self, command):
        Path("m.urdf").write_text(
            '<robot name="m"><link name="a"><visual><geometry><mesh filename="x.stl"/></geometry></visual></link></robot>'
        )
        code, _, err = command("info", "m.urdf")
        assert code == 0
        assert err.startswith("articulated: warning: m.urdf:1: link 'a'")
        assert "mesh files not found: x.stl" in err

    def test_help_and_version(self, command):
        assert "exit codes:" in command("--help")[1]
        assert command("--version")[1] == f"articulated {art.__version__}\n"
        assert command()[0] == 2


def test_as_a_program(tmp_path):
    """Through the shell: exit codes arrive, and a reader that leaves early does no harm."""
    run = [sys.executable, "-m", "articulated"]
    assert subprocess.run([*run, "info", "nowhere.urdf"], capture_output=True).returncode == 2
    done = subprocess.run(
        f"'{sys.executable}' -m articulated info ragdoll --links | head -1", shell=True, capture_output=True, text=True
    )
    assert done.stdout.startswith("ragdoll: 30 degrees of freedom")
    assert done.stderr == ""
