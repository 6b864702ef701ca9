"""The compiled passes in this process."""

from __future__ import annotations

import ctypes
import platform
from pathlib import Path

from modt.native import build

X86_64_V3_FLAGS = frozenset(["avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"])


class NotAvailableError(Exception):
    """The compiled passes cannot be used; the message says why and what helps."""


def instructions(cpu_info: str) -> str:
    """Best set of instructions of a processor, given /proc/cpuinfo."""
    flags = next((line.partition(":")[2].split() for line in cpu_info.splitlines() if line.startswith("flags")), [])
    return build.X86_64_V3 if frozenset(flags) >= X86_64_V3_FLAGS else build.BASELINE


def load(folder: Path = build.FOLDER, cpu_info: Path = Path("/proc/cpuinfo")) -> tuple[ctypes.CDLL, str]:
    """The library for this processor, and its set of instructions.

    Raises:
        NotAvailableError: there is none, or it is made of other sources.
    """
    machine, remedy = platform.machine(), "install modt again where a C compiler is"
    try:
        kind = instructions(cpu_info.read_text(errors="replace")) if machine == "x86_64" else build.BASELINE
    except OSError:
        kind = build.BASELINE
    path = folder / build.library_name(kind)
    if not path.is_file():
        raise NotAvailableError(f"not compiled for {machine}; {remedy}")
    try:
        library = ctypes.CDLL(str(path))
        library.modt_sources.restype = ctypes.c_char_p
        sources = library.modt_sources().decode()
    except (OSError, AttributeError) as error:
        raise NotAvailableError(f"{path.name} cannot be loaded ({error}); {remedy}") from None
    if sources != build.source_hash():
        raise NotAvailableError(f"{path.name} is compiled from other sources; {remedy}")
    return library, kind
