"""Reading of one input within limits of CPU time and memory."""

import resource
import signal
import traceback
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

CPU_TIME_S = 10.0
"""Limit for one input, of all threads of the process; a busy machine does not shorten it."""
HANG_S = 120.0
"""Wall time after which an input counts as hanging, without CPU time."""
MEMORY_BYTES = 1 << 30
"""Limit of memory, in addition to what the process has when the reading begins."""


class DeadlineError(BaseException):
    """An input took too long; no reader catches it."""


@dataclass(frozen=True)
class Finding:
    """An exception that should not have left a reader; findings of one place are one."""

    error: str
    place: str  # innermost line of the program
    trace: str


def execute(call, raw, refusals):
    """Read an input; None where it was read or refused."""
    signal.setitimer(signal.ITIMER_PROF, CPU_TIME_S)
    signal.setitimer(signal.ITIMER_REAL, HANG_S)
    try:
        call(raw)
    except refusals:
        pass
    except (Exception, DeadlineError) as error:
        steps = traceback.extract_tb(error.__traceback__)
        ours = next((s for s in reversed(steps) if "/modt/" in s.filename), steps[-1])
        place = f"{Path(ours.filename).name}:{ours.lineno}"
        said = f"{type(error).__name__}: {error}"[:200]
        return Finding(said, place, "".join(traceback.format_exception(error))[-4000:])
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
    return None


@contextmanager
def limits():
    """The limits of CPU time, wall time and memory; warnings are errors."""

    def late(number, _):
        limit = f"{CPU_TIME_S:g} s of CPU time" if number == signal.SIGPROF else f"{HANG_S:g} s"
        raise DeadlineError(f"longer than {limit}")

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    handlers = {number: signal.signal(number, late) for number in (signal.SIGPROF, signal.SIGALRM)}
    try:
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_BYTES, hard))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
        for number, handler in handlers.items():
            signal.signal(number, handler)
