"""The bits of another processor: code for NEON, run by an emulator (Debian: gcc-aarch64-linux-gnu, qemu-user)."""

from __future__ import annotations

import shutil
import subprocess

import llvmlite.binding as llvm
import numpy as np
import pytest

import articulated as art
from articulated.compiler import Tape
from articulated.compiler.ir import Format
from articulated.compiler.lowering import Lowering
from articulated.compiler.schedule import schedule
from articulated.dynamics.functions import programs

pytestmark = pytest.mark.skipif(
    not (shutil.which("aarch64-linux-gnu-gcc") and shutil.which("qemu-aarch64")),
    reason="needs aarch64-linux-gnu-gcc and qemu-aarch64",
)

_HARNESS = """
#include <stdio.h>
#include <stdlib.h>

long kernel(long *table, void *scratch, long begin, long end, long tile);

int main(void)
{
    static NUMBER arrays[] = {VALUES}, result[STATES * NV];
    const long bytes = sizeof(NUMBER), nq = NQ * bytes, nv = NV * bytes;
    const long v = (long)arrays + STATES * nq, tau = v + STATES * nv;
    long table[] = {(long)arrays, nq, 0, 0, v, nv, 0, 0, tau, nv, 0, 0, (long)result, nv, 0, 0};
    if (kernel(table, aligned_alloc(64, SCRATCH), 0, STATES, 4) != 0)
        return 1;
    fwrite(result, sizeof result, 1, stdout);
    return 0;
}
"""


@pytest.mark.parametrize(("dtype", "lanes"), [(np.float64, 2), (np.float32, 4)])
def test_bits_on_neon(tmp_path, rng, dtype, lanes):
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple("aarch64-linux-gnu")
    rig, single, tile = art.load("ragdoll", root="free"), dtype == np.float32, 4
    program = programs(rig)["forward_dynamics"]
    tape = Tape(program, single)
    lowering = Lowering(schedule(tape.graph, tape.outputs, tape.check, lanes, range(3)), program, Format(lanes, single))
    files = []
    for k, text in enumerate(lowering.modules):
        module = llvm.parse_assembly(text)
        module.triple = "aarch64-linux-gnu"
        files.append(tmp_path / f"{k}.o")
        files[-1].write_bytes(target.create_target_machine(cpu="cortex-a76", opt=2, reloc="pic").emit_object(module))

    states = [x.astype(dtype) for x in (rig.random(rng, 7), *rng.normal(size=(2, 7, rig.nv)))]
    facts = {
        "NUMBER": "float" if single else "double",
        "VALUES": ", ".join(float(x).hex() for array in states for x in array.ravel()),
        "STATES": "7",
        "NQ": str(rig.nq),
        "NV": str(rig.nv),
        "SCRATCH": str(-(-lowering.scratch * tile // 64) * 64),
    }
    text = _HARNESS
    for word, value in facts.items():
        text = text.replace(word, value)
    (tmp_path / "main.c").write_text(text)
    program_file = tmp_path / "main"
    subprocess.run(["aarch64-linux-gnu-gcc", "-static", "-o", program_file, tmp_path / "main.c", *files], check=True)
    answer = subprocess.run(["qemu-aarch64", program_file], check=True, capture_output=True).stdout
    assert answer == art.forward_dynamics(rig, *states).tobytes()
