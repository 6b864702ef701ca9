"""Compilation of the C sources beside this file; used before modt is installed, so of the standard library alone."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
BASELINE = "baseline"
"""Instruction set of every machine of its kind."""
X86_64_V3 = "x86-64-v3"
"""Instruction set of most x86-64 processors since 2014, with AVX2."""
TIMEOUT_S = 300.0
"""Time limit of a compilation [s]."""
TARGETS = {
    "x86_64": "x86_64-linux-gnu.2.17",
    "aarch64": "aarch64-linux-gnu.2.17",
}
"""Machines for which `ziglang` compiles on any other. Nothing is linked, so glibc and musl are alike."""
FLAGS = (
    "-std=c99", "-O3", "-fPIC", "-shared", "-nostdlib", "-fvisibility=hidden", "-fno-math-errno",
    "-fno-trapping-math", "-ffp-contract=off", "-Wall", "-Wextra",
)  # fmt: skip
"""Options of the compiler. Contraction of products and sums is off, since the results equal NumPy's to the byte."""
CHECKED = ("-std=c99", "-O1", "-g", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-DMODT_CHECKED")
"""Options of a build whose assertions (PROVEN in kernels.h) are checked."""
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=undefined", "-fno-omit-frame-pointer")
"""Further options that stop such a build at memory errors and undefined behaviour."""


class NoCompilerError(Exception):
    """No C compiler, or one that fails; the message says which and why."""


def source_hash() -> str:
    """Hash of the C sources. Each library holds that of the sources it was built from."""
    content = b"".join(path.read_bytes() for path in sorted(FOLDER.glob("*.[ch]")))
    return hashlib.sha256(content).hexdigest()[:16]


def library_name(instructions: str) -> str:
    """File of the library for a set of instructions."""
    return f"kernels-{instructions}.so"


def compiler(target: str | None) -> list[str]:
    """Command of a C compiler for a machine of TARGETS, for this one if none is given.

    Raises:
        NoCompilerError: there is none.
    """
    if target is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", TARGETS[target]]
    named = os.environ.get("CC", "").split()
    for command in [named] if named else [["cc"], ["gcc"], ["clang"]]:
        if shutil.which(command[0]):
            return command
    raise NoCompilerError(f"no C compiler ({' '.join(named) or 'cc, gcc or clang'})")


def compile_library(out: Path, instructions: str, target: str | None = None, flags: tuple[str, ...] = FLAGS) -> None:
    """Write a shared library.

    Raises:
        NoCompilerError: there is no compiler, or it does not accept the sources.
    """
    command = [*compiler(target), *flags, f'-DMODT_SOURCES="{source_hash()}"']
    if instructions == X86_64_V3:
        command.append("-march=x86-64-v3" if target is None else "-mcpu=x86_64_v3")
        command.append("-mno-fma")  # GCC 12 contracts a difference beside a sum of products despite -ffp-contract
    sources = [path.name for path in sorted(FOLDER.glob("*.c"))]
    try:
        command += ["-o", str(out.resolve()), *sources]
        done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=FOLDER, timeout=TIMEOUT_S)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoCompilerError(f"{command[0]}: {error}") from None
    if done.returncode:
        raise NoCompilerError(f"{command[0]} fails: {done.stderr.strip()[-2000:]}")


def compile_all(folder: Path, target: str | None = None) -> list[Path]:
    """Libraries of every set of instructions that a machine can have.

    Raises:
        NoCompilerError: there is no compiler, or it does not accept the sources.
    """
    machine = target or platform.machine()
    kinds = [BASELINE, X86_64_V3] if machine == "x86_64" else [BASELINE]
    files = [folder / library_name(kind) for kind in kinds]
    for kind, path in zip(kinds, files, strict=True):
        compile_library(path, kind, target)
    return files
