"""The processor: which instructions to compile for, and from LLVM IR to code in memory."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import llvmlite
import llvmlite.binding as llvm

llvm.initialize_native_target()
llvm.initialize_native_asmprinter()


@dataclass(frozen=True)
class Machine:
    """A level of vector instructions of this processor.

    Attributes:
        name: "avx512", "avx2", "sse2" or "neon".
        register: bytes of a vector register.
        cpu, features: as LLVM knows them.
    """

    name: str
    register: int
    cpu: str
    features: str

    @cached_property
    def identity(self) -> bytes:
        """All that decides which code comes of a program: code of one identity runs on no other."""
        python = (sys.implementation.cache_tag, object.__basicsize__)
        versions = (llvmlite.__version__, llvm.llvm_version_info, llvm.get_default_triple())
        return repr((*python, *versions, self.name, self.cpu, self.features)).encode()

    def _target(self) -> llvm.TargetMachine:
        # a new one each time: an execution engine owns the one that it is given, and frees it
        target = llvm.Target.from_default_triple()
        return target.create_target_machine(cpu=self.cpu, features=self.features, opt=2, reloc="pic", codemodel="small")

    def object_code(self, text: str) -> bytes:
        """Compile a module."""
        module = llvm.parse_assembly(text)
        module.triple = llvm.get_default_triple()
        return self._target().emit_object(module)

    def assembly(self, text: str) -> str:
        """The module in assembly language, for people."""
        return self._target().emit_assembly(llvm.parse_assembly(text))

    def load(self, objects: Sequence[bytes]) -> llvm.ExecutionEngine:
        """Object code in memory, ready to run for as long as what is returned lives."""
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), self._target())
        for code in objects:
            engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        return engine


def machine() -> Machine:
    """This processor, at the level that ARTICULATED_SIMD asks for (default: its best).

    Raises:
        ValueError: the processor has no such level.
    """
    levels = _levels()
    name = os.environ.get("ARTICULATED_SIMD") or next(iter(levels))
    if name not in levels:
        raise ValueError(f"ARTICULATED_SIMD is {name!r}; this processor has {', '.join(levels)}")
    return levels[name]


@cache
def _levels() -> dict[str, Machine]:
    """The levels of this processor, the best first; lower ones use nothing of those above them."""
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features()
    host = (cpu, features.flatten())
    if llvm.get_default_triple().split("-")[0] not in ("x86_64", "amd64"):
        return {"neon": Machine("neon", 16, *host)}
    levels = {}
    if features.get("avx512f") and features.get("avx512dq"):
        levels["avx512"] = Machine("avx512", 64, *host)
    if features.get("avx2") and features.get("fma"):
        levels["avx2"] = Machine("avx2", 32, *(("x86-64-v3", "") if levels else host))
    levels["sse2"] = Machine("sse2", 16, *(("x86-64", "") if levels else host))
    return levels
