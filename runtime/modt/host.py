"""The machine: pinning to one core, real-time priority, a check of all threads, and a description."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import metadata
from pathlib import Path

import psutil

from modt.errors import MisuseError

_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")
_MAX_HELPER_SHARE = 0.01
"""The process counts as single-threaded if other threads use at most this share of the CPU time of the loop."""
SWITCH_S = 0.0005
"""Time for which another thread may keep the interpreter from the loop [s]; Python's default is 5 ms."""
PRIORITY = 10
"""Real-time priority of the loop, of 1 to 99."""
_MCL_CURRENT = 1  # mlockall(2)
_MCL_FUTURE = 2
_MCL_ONFAULT = 4
_NICE = 23  # bit of CAP_SYS_NICE, capabilities(7)
_LIBRARIES = ("modt", "numpy", "scipy", "onnxruntime", "psutil", "pyyaml")


def pin_to_core(core: int | None) -> int | None:
    """Pin this process and its future threads to a core, None for any, and disable thread pools; returns the core.

    The kernel decides which cores are available: a process does not inherit the isolated ones, but may use them. Call
    it before NumPy, SciPy or ONNX Runtime is imported: they size their thread pools when imported.

    Raises:
        MisuseError: the core is not available to this process.
    """
    for variable in _THREAD_VARIABLES:
        os.environ[variable] = "1"
    if core is None:
        return None
    inherited = os.sched_getaffinity(0)
    if inherited == {core}:
        return core
    try:
        os.sched_setaffinity(0, {core})
    except PermissionError:
        raise MisuseError(f"core {core}", "affinity may not be changed", "set CPUAffinity= in the unit") from None
    except (OSError, OverflowError):
        listed = ", ".join(map(str, sorted(inherited)))
        raise MisuseError(
            f"core {core}", "not available to this process", f"use one of {listed}, or --core none"
        ) from None
    return core


def last_core() -> int:
    """The last core available to this process: the least likely to serve interrupts."""
    return max(os.sched_getaffinity(0))


def other_cores(core: int | None) -> frozenset[int] | None:
    """Cores that this process may use besides the one of the loop; None if there are none.

    Call it before `pin_to_core`.
    """
    others = frozenset(os.sched_getaffinity(0)) - {core}
    return others if core is not None and others else None


@contextmanager
def threads_on(cores: frozenset[int] | None) -> Iterator[None]:
    """Context in which new threads run on these cores, while this thread stays on its own."""
    if cores is None:
        yield
        return
    before = os.sched_getaffinity(0)
    with suppress(OSError):  # where it is not permitted, they share the core of the loop
        os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def take_real_time_priority() -> list[str]:
    """Give this thread real-time priority (SCHED_FIFO), and keep the memory of the process from being swapped out.

    Threads that are started later have ordinary priority. Returns one line for each refusal, with its remedy.
    """
    sys.setswitchinterval(SWITCH_S)
    refusals = []
    if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK != os.SCHED_FIFO:
        try:
            policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(0, policy, os.sched_param(PRIORITY))
        except OSError as error:
            cause, remedy = fifo_refusal(PRIORITY)
            refusals.append(f"ordinary priority: SCHED_FIFO is not permitted: {cause or error.strerror}; {remedy}")
    cause = _lock_memory()
    if cause:
        refusals.append(f"memory may be swapped out: {cause}; set LimitMEMLOCK=infinity in the unit, or ulimit -l")
    return refusals


def fifo_refusal(priority: int, proc: Path = Path("/proc"), groups: Path = Path("/sys/fs/cgroup")) -> tuple[str, str]:
    """Cause for which the kernel refuses SCHED_FIFO, empty if only a right is missing, and remedy."""
    if content(proc / "sys/kernel/sched_rt_runtime_us").strip() == "0":
        return "it is switched off (sched_rt_runtime_us 0)", "sysctl -w kernel.sched_rt_runtime_us=950000"
    for controllers, path in (line.split(":", 2)[1:] for line in content(proc / "self/cgroup").splitlines()):
        share = groups / controllers / path.lstrip("/") / "cpu.rt_runtime_us"
        if "cpu" in controllers.split(",") and content(share).strip() == "0":
            remedy = "write microseconds there, first in the groups above it, or go without"
            return f"this control group has no real-time share ({share} 0)", remedy
    rights = re.search(r"CapEff:\s*([0-9a-f]+)", content(proc / "self/status"))
    if resource.getrlimit(resource.RLIMIT_RTPRIO)[0] < priority and not (rights and int(rights[1], 16) >> _NICE & 1):
        return "", f"set LimitRTPRIO={priority} in the unit, or ulimit -r {priority}"
    cause = "this process has the right to it, but its control group (CONFIG_RT_GROUP_SCHED) or a filter has not"
    return cause, "boot with rt_group_sched=0, set RestrictRealtime=no in the unit, or go without"


def serve_loop(cores: frozenset[int] | None) -> str:
    """Move this thread to these cores, with real-time priority if the loop has it; returns a refusal with remedy.

    An ordinary thread that is preempted while it holds the interpreter keeps the loop waiting, even on another core.
    """
    if cores:
        with suppress(OSError):  # where it is not permitted, it stays where the process is
            os.sched_setaffinity(0, cores)
    loop = os.getpid()
    if os.sched_getscheduler(loop) & ~os.SCHED_RESET_ON_FORK != os.SCHED_FIFO:
        return ""
    priority = max(os.sched_getparam(loop).sched_priority - 1, 1)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError as error:
        remedy = f"set LimitRTPRIO={priority} in the unit, or ulimit -r"
        return f"ordinary priority of the receiving thread: SCHED_FIFO is not permitted ({error.strerror}); {remedy}"
    return ""


def _lock_memory() -> str:
    """Lock all pages in memory once they are used; returns the cause of a refusal."""
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] != resource.RLIM_INFINITY:
        return "the limit of locked memory is finite"  # beyond it, allocations would fail later
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT):
        return os.strerror(ctypes.get_errno())
    return ""


def resident_mb() -> float:
    """Resident memory of this process [MB]."""
    return float(psutil.Process().memory_info().rss) / 2**20


def usage(core: int | None) -> dict[str, object]:
    """Threads and memory of this process by the kernel's accounts, and whether it has kept to its core."""
    process = psutil.Process()
    used = {t.id: t.user_time + t.system_time for t in process.threads()}
    cores: set[int] = set()
    for thread in used:
        with suppress(ProcessLookupError):  # it has ended meanwhile
            cores |= os.sched_getaffinity(thread)
    main_s = used.get(process.pid, 0.0)
    others_s = sum(used.values()) - main_s
    return {
        "core": core,
        "one_core_verified": cores == {core} and others_s <= _MAX_HELPER_SHARE * main_s,
        "threads": len(used),
        "other_threads_cpu_s": others_s,
        "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def keep_freed_pages() -> None:
    """Make the C library reuse the memory of one sweep for the next.

    glibc returns large blocks to the kernel when they are freed, and every sweep would pay for fresh pages. After a
    block of almost 32 MB is freed once (untouched, at no cost), glibc keeps them.
    """
    bytes(31 << 20)


def release_freed_pages() -> None:
    """Return free memory to the kernel, after large parts were replaced. Takes a millisecond with glibc."""
    with suppress(AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def description() -> dict[str, object]:
    """The machine and its clock policy."""
    cpu = Path("/sys/devices/system/cpu/cpu0/cpufreq")
    return {
        "machine": platform.machine(),
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "memory_mb": psutil.virtual_memory().total // 2**20,
        "system": f"{platform.system()} {platform.release()}",
        "governor": content(cpu / "scaling_governor").strip() or "unavailable",
        "frequency_khz": content(cpu / "scaling_cur_freq").strip() or "unavailable",
    }


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries."""
    found = {"python": platform.python_version()}
    for library in _LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            found[library] = "not installed as a package"
    return found


def _cpu_model() -> str:
    lines = (line.partition(":") for line in content(Path("/proc/cpuinfo")).splitlines())
    fields = {key.strip(): value.strip() for key, _, value in lines}
    return fields.get("model name") or fields.get("Model") or platform.processor() or "unknown"


def core_list(text: str) -> set[int]:
    """Cores of a list as the kernel writes it, such as 0-2,5."""
    ranges = (part.partition("-") for part in text.strip().split(",") if part)
    return {core for first, _, last in ranges for core in range(int(first), int(last or first) + 1)}


def content(path: Path) -> str:
    """Text of a file, empty where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
