"""Trajectories in files: everything comes back, nothing is half written, damage is told of."""

from __future__ import annotations

import csv
import errno
import json
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

import articulated as art
from articulated.trajectory import files


@pytest.fixture(scope="module")
def run() -> art.Trajectory:
    rig = art.load("buggy", "free")
    q0 = rig.random(0, (2,))
    return art.Simulation(rig, dt=0.01).run(q0, duration=0.2, fps=20, control=np.ones(rig.nv))


class TestNpz:
    def test_everything_comes_back(self, run, tmp_path):
        run.save(tmp_path / "fall.npz")
        again = art.Trajectory.load(tmp_path / "fall.npz")
        for name in ("time", "q", "v", "tau", "kinetic_energy", "potential_energy", "work", "outcome"):
            np.testing.assert_array_equal(getattr(again, name), getattr(run, name))
        assert again.settings == run.settings
        assert str(again.report) == str(run.report)
        assert (again.rig.name, again.rig.root) == ("buggy", "free")
        assert list(again.rig.joints) == list(run.rig.joints)
        assert repr(again) == "Trajectory('buggy', 5 frames, 0.2 s, states (2,))"

    def test_numpy_reads_it(self, run, tmp_path):
        run.save(str(tmp_path / "fall.npz"))
        with np.load(tmp_path / "fall.npz") as data:
            np.testing.assert_array_equal(data["q"], run.q)
            assert "<robot" in str(data["rig"])

    def test_rig_with_missing_meshes_is_not_warned_of_again(self, tmp_path, recwarn):
        text = '<robot name="m"><link name="a"><visual><geometry><mesh filename="x.stl"/></geometry></visual></link></robot>'
        with pytest.warns(art.RigWarning):
            rig = art.load(text)
        art.simulate(rig, 0.1).save(tmp_path / "m.npz")
        recwarn.clear()
        art.Trajectory.load(tmp_path / "m.npz")
        assert not recwarn.list

    def test_other_names_are_refused(self, run, tmp_path):
        with pytest.raises(ValueError, match=r"fall.txt' does not end in .npz; use export for other formats"):
            run.save(tmp_path / "fall.txt")

    def test_no_such_file(self, tmp_path):
        with pytest.raises(FileNotFoundError):
            art.Trajectory.load(tmp_path / "none.npz")

    @pytest.mark.parametrize("damage", ["truncated", "empty", "noise", "flipped"])
    def test_damage(self, run, tmp_path, damage):
        path = tmp_path / "fall.npz"
        run.save(path)
        data = bytearray(path.read_bytes())
        middle = len(data) // 2
        if damage == "flipped":
            data[middle : middle + 64] = bytes(255 - byte for byte in data[middle : middle + 64])
        path.write_bytes({"truncated": data[:middle], "empty": b"", "noise": os.urandom(1000), "flipped": data}[damage])
        with pytest.raises(ValueError, match=r"fall.npz is (not a trajectory|damaged)"):
            art.Trajectory.load(path)

    def test_another_npz(self, tmp_path):
        np.savez(tmp_path / "other.npz", x=np.arange(3))
        with pytest.raises(ValueError, match=r"other.npz is not a trajectory, or is damaged \(KeyError: .*about"):
            art.Trajectory.load(tmp_path / "other.npz")

    def test_pickles_are_not_run(self, tmp_path):
        np.savez(tmp_path / "evil.npz", about=np.array([{}], dtype=object))
        with pytest.raises(ValueError, match="pickle"):
            art.Trajectory.load(tmp_path / "evil.npz")

    def test_a_later_format(self, run, tmp_path):
        run.save(tmp_path / "a.npz")
        with np.load(tmp_path / "a.npz") as data:
            content = dict(data)
        content["about"] = json.dumps({"format": 99, "root": "free", "settings": {}})
        np.savez(tmp_path / "b.npz", **content)
        with pytest.raises(ValueError, match="has format 99; this version reads up to 5: update articulated"):
            art.Trajectory.load(tmp_path / "b.npz")

    def test_shapes_that_do_not_fit_the_rig(self, run, tmp_path):
        run.save(tmp_path / "a.npz")
        with np.load(tmp_path / "a.npz") as data:
            content = dict(data)
        content["q"] = content["q"][..., :-1]
        np.savez(tmp_path / "b.npz", **content)
        with pytest.raises(ValueError, match=r"b.npz is damaged: q has shape"):
            art.Trajectory.load(tmp_path / "b.npz")


class TestCsv:
    def test_one_state(self, run, tmp_path):
        run.state(1).export(tmp_path / "fall.csv")
        with open(tmp_path / "fall.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == 5
        column = run.rig.joints["front_left_steering"].q_slice.start
        assert [float(row["q.front_left_steering"]) for row in rows] == run.q[1, :, column].tolist()
        assert [float(row["v.root_joint.vz"]) for row in rows] == run.v[1, :, 2].tolist()
        assert [float(row["tau.rear_left_axle"]) for row in rows] == [1.0] * 5
        energy = [float(row["kinetic_energy"]) + float(row["potential_energy"]) for row in rows]
        np.testing.assert_array_equal(energy, run.energy[1])

    def test_a_batch_has_a_column_for_the_state(self, run, tmp_path):
        run.export(tmp_path / "fall.csv")
        table = np.genfromtxt(tmp_path / "fall.csv", delimiter=",", names=True)
        assert table["state0"].tolist() == [0.0] * 5 + [1.0] * 5
        np.testing.assert_array_equal(table["time"], np.tile(run.time, 2))

    def test_names_with_commas(self, tmp_path):
        builder = art.RigBuilder("odd")
        builder.link("a")
        builder.link("b", 1.0, inertia=(1, 1, 1))
        builder.joint('knee, "left"', "revolute", "a", "b")
        art.simulate(builder.build(), 0.1).export(tmp_path / "odd.csv")
        with open(tmp_path / "odd.csv", newline="") as file:
            assert next(csv.reader(file))[:3] == ["time", 'q.knee, "left"', 'v.knee, "left"']

    def test_unknown_format(self, run, tmp_path):
        with pytest.raises(ValueError, match=r"unknown format '.xyz'; known are .bvh, .csv, .glb and save's .npz"):
            run.export(tmp_path / "fall.xyz")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


class TestWriting:
    def test_no_such_directory(self, run, tmp_path):
        with pytest.raises(
            FileNotFoundError, match=r"cannot write .*fall.npz: No such file or directory; create its directory first"
        ):
            run.save(tmp_path / "none" / "fall.npz")

    def test_a_directory_in_the_way(self, run, tmp_path):
        (tmp_path / "fall.npz").mkdir()
        with pytest.raises(IsADirectoryError, match=r"cannot write .*fall.npz: it is a directory"):
            run.save(tmp_path / "fall.npz")

    def test_a_file_for_a_directory(self, run, tmp_path):
        (tmp_path / "file").touch()
        with pytest.raises(NotADirectoryError, match=r"cannot write .*: Not a directory"):
            run.export(tmp_path / "file" / "fall.csv")

    @pytest.mark.parametrize(
        "write", [lambda run, path: run.save(path / "fall.npz"), lambda run, path: run.export(path / "fall.csv")]
    )
    def test_disk_full_leaves_the_old_file(self, run, tmp_path, monkeypatch, write):
        write(run, tmp_path)
        before = {name: (tmp_path / name).read_bytes() for name in names(tmp_path)}

        def full(*_):
            raise OSError(errno.ENOSPC, "No space left on device")

        monkeypatch.setattr(files.os, "fsync", full)
        with pytest.raises(OSError, match=r"cannot write .*fall\.\w+: No space left on device"):
            write(run, tmp_path)
        assert {name: (tmp_path / name).read_bytes() for name in names(tmp_path)} == before

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
    def test_a_disk_that_is_full(self, run, tmp_path, monkeypatch):
        """The system's own full device, where every write fails."""

        def mkstemp(**_):
            return os.open("/dev/full", os.O_WRONLY), str(tmp_path / "part")

        monkeypatch.setattr(files.tempfile, "mkstemp", mkstemp)
        with pytest.raises(OSError, match=r"cannot write .*fall.csv: No space left on device"):
            run.export(tmp_path / "fall.csv")
        assert names(tmp_path) == []

    def test_an_error_in_between_leaves_nothing(self, tmp_path):
        def failing():
            with files.written(tmp_path / "fall.csv", "w") as file:
                file.write("half")
                raise RuntimeError("power cut")

        with pytest.raises(RuntimeError, match="power cut"):
            failing()
        assert names(tmp_path) == []

    def test_permissions_are_the_usual_ones(self, run, tmp_path):
        run.save(tmp_path / "fall.npz")
        (tmp_path / "plain").touch()
        assert (tmp_path / "fall.npz").stat().st_mode == (tmp_path / "plain").stat().st_mode

    def test_check_writable(self, tmp_path):
        files.check_writable(tmp_path / "new.npz")
        assert names(tmp_path) == []
        with pytest.raises(FileNotFoundError, match="create its directory first"):
            files.check_writable(tmp_path / "none" / "new.npz")

    def test_archives_are_whole(self, run, tmp_path):
        run.save(tmp_path / "fall.npz")
        assert zipfile.ZipFile(tmp_path / "fall.npz").testzip() is None
