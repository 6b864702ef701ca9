"""The machine: one core for this process, and proof that it kept to it."""

from __future__ import annotations

import os
import platform
import resource
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import psutil

from modt.errors import MisuseError

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
LIBRARIES = ("modt", "numpy", "scipy", "onnxruntime", "psutil", "pyyaml")


def confine(core: int | None) -> int | None:
    """Keep this process and every thread it will ever start on one core.

    Call it before NumPy, SciPy or ONNX Runtime is imported: they size their thread pools as they load.

    Args:
        core: number of the core; None leaves the affinity alone and only forbids helper threads.

    Returns:
        The core.

    Raises:
        MisuseError: the core is not there for this process.
    """
    for variable in THREAD_VARIABLES:
        os.environ[variable] = "1"
    if core is None:
        return None
    allowed = sorted(os.sched_getaffinity(0))
    if core not in allowed:
        listed = ", ".join(map(str, allowed))
        raise MisuseError(f"core {core}", "not available to this process", f"use one of {listed}, or --core none")
    if allowed != [core]:
        try:
            os.sched_setaffinity(0, {core})
        except PermissionError:
            raise MisuseError(f"core {core}", "affinity may not be changed", "set CPUAffinity= in the unit") from None
    return core


def last_core() -> int:
    """The last core this process may use: the one least likely to serve interrupts."""
    return max(os.sched_getaffinity(0))


@dataclass(frozen=True, slots=True)
class ThreadReport:
    """What the threads of this process did and where.

    Attributes:
        threads: how many there are.
        cores: those that any thread may run on.
        main_cpu_s: CPU time of the control loop's thread [s].
        others_cpu_s: CPU time of all other threads together [s].
    """

    threads: int
    cores: tuple[int, ...]
    main_cpu_s: float
    others_cpu_s: float


def thread_report() -> ThreadReport:
    """Look at every thread of this process, as the kernel accounts for it."""
    process = psutil.Process()
    used = {t.id: t.user_time + t.system_time for t in process.threads()}
    cores: set[int] = set()
    for thread in used:
        try:
            cores |= os.sched_getaffinity(thread)
        except ProcessLookupError:  # it ended meanwhile
            continue
    main = used.get(process.pid, 0.0)
    return ThreadReport(len(used), tuple(sorted(cores)), main, sum(used.values()) - main)


def keep_freed_pages() -> None:
    """Make the C library reuse the memory of one sweep for the next.

    glibc returns large blocks to the kernel when they are freed, and every sweep would pay for fresh pages. After a
    block of almost 32 MB is freed once (untouched, at no cost), glibc keeps them.
    """
    bytes(31 << 20)


def peak_rss_mb() -> float:
    """Largest resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def description() -> dict[str, object]:
    """The machine and its clock policy, for the record."""
    cpu = Path("/sys/devices/system/cpu/cpu0/cpufreq")
    return {
        "machine": platform.machine(),
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "memory_mb": psutil.virtual_memory().total // 2**20,
        "system": f"{platform.system()} {platform.release()}",
        "governor": _first_line(cpu / "scaling_governor"),
        "frequency_khz": _first_line(cpu / "scaling_cur_freq"),
    }


def versions() -> dict[str, str]:
    """Versions of Python and of every library that takes part."""
    found = {"python": platform.python_version()}
    for library in LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            found[library] = "not installed as a package"
    return found


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    fields = dict(line.split(":", 1) for line in lines if ":" in line)
    named = {key.strip(): value.strip() for key, value in fields.items()}
    return named.get("model name") or named.get("Model") or platform.processor() or "unknown"


def _first_line(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii").strip()
    except OSError:
        return "unavailable"
