"""What README shows in Python runs as it stands; its commands are run by .ci/run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

README = (Path(__file__).parent.parent / "README.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_python(block, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(block, "README.md", "exec"), {})


def test_there_are_blocks_and_commands():
    assert len(BLOCKS) == 9
    assert len(re.findall(r"```sh\n", README)) == 2


def test_files_that_it_names_exist():
    for path in re.findall(r"`((?:docs|tests|urdf|articulated)/[\w./-]+)`|\]\((docs/[^)]+)\)", README):
        assert (Path(__file__).parent.parent / (path[0] or path[1])).exists(), path
