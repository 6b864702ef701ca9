"""The steps of tools.deploy.proof, which systemd runs inside the copy of the system with Python alone."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

UNIT = "modt.service"
PROFILE = Path("/srv/modt/robot.yaml")
END = "end\n"
RECORDS = Path("/var/lib/modt/run")
PROBE = """
import ctypes, json, os, socket
def tried(what):
    try:
        what()
    except OSError as error:
        return error.strerror
    return "done"
libc = ctypes.CDLL(None, use_errno=True)
def call(name, *arguments):
    if getattr(libc, name)(*arguments) < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
tries = {
    "write to /etc": lambda: open("/etc/modt-probe", "w"),
    "write to /usr": lambda: open("/usr/modt-probe", "w"),
    "look into /root": lambda: os.listdir("/root"),
    "open an internet socket": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM).close(),
    "become root": lambda: os.setuid(0),
    "make a namespace": lambda: call("unshare", 0x10000000),
    "mount": lambda: call("mount", b"none", b"/tmp", b"tmpfs", 0, None),
    "trace a process": lambda: call("ptrace", 16, 1, 0, 0),
    "set the clock": lambda: call("clock_settime", 0, ctypes.create_string_buffer(16)),
    "see other processes": lambda: os.stat("/proc/1/cmdline"),
    "write its state": lambda: open(os.environ["STATE_DIRECTORY"] + "/probe", "w").close(),
}
print(json.dumps({name: tried(what) for name, what in tries.items()}))
"""
ALLOWED = "write its state"
REFUSED = "not permitted to this copy of the system"


class Report:
    """Report of the proof, each line on disk at once."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "report.txt"

    def add(self, what: str, good: bool, figure: str = "") -> None:
        """Add a line."""
        with self._path.open("a") as file:
            file.write(f"{'ok' if good else 'fail':<5} {what}{': ' if figure else ''}{figure}\n")


def systemctl(*arguments: str) -> str:
    """Output of systemctl."""
    return subprocess.run(["systemctl", *arguments], capture_output=True, text=True, check=False).stdout.strip()


def shown(name: str) -> str:
    """A property of the unit."""
    return systemctl("show", UNIT, f"--property={name}", "--value")


def until(holds: Callable[[], bool], seconds: float) -> float | None:
    """Time until a condition holds [s], None if it does not hold in time."""
    begin_s = time.monotonic()
    while time.monotonic() - begin_s < seconds:
        if holds():
            return time.monotonic() - begin_s
        time.sleep(0.02)
    return None


def figure(seconds: float | None) -> str:
    """A time as text."""
    return "never" if seconds is None else f"{seconds:.2f} s"


def active() -> bool:
    """Whether the unit is up."""
    return shown("ActiveState") == "active" and shown("SubState") == "running"


def restarted(before: str) -> bool:
    """Whether a new process is up and has recorded some frames."""
    try:
        status = json.loads((RECORDS / "status.json").read_text())
    except (OSError, ValueError):
        return False
    pid = shown("MainPID")
    return active() and pid != before and str(status["pid"]) == pid and status["counts"]["frames"] > 5


def reload(text: str) -> str:
    """Reload with a profile, and return the state of the loop."""
    PROFILE.write_text(text)
    systemctl("reload", UNIT)
    until(lambda: active() and shown("SubState") == "running", 5.0)
    time.sleep(1.5)
    return str(json.loads((RECORDS / "status.json").read_text())["loop"])


def steps(folder: Path) -> None:
    """All steps in order."""
    report = Report(folder)
    starts(report)
    is_confined(report)
    reloads(report)
    comes_back(report)
    stops(report)
    probe(report)
    with (folder / "report.txt").open("a") as file:
        file.write(END)


def starts(report: Report) -> None:
    """Start the unit."""
    begin_s = time.monotonic()
    systemctl("start", UNIT)
    report.add("starts, and notifies that it is ready", active(), figure(time.monotonic() - begin_s))
    took_s = until(lambda: "Hz" in shown("StatusText"), 10.0)
    report.add("reports its status", took_s is not None, shown("StatusText"))


def is_confined(report: Report) -> None:
    """Look at the user, the filter of system calls, the priority and the memory of the process."""
    pid = shown("MainPID")
    status = Path(f"/proc/{pid}/status").read_text()
    fields = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
    report.add("runs as a user of its own", not fields["Uid"].startswith("0\t"), fields["Uid"])
    report.add("runs with a filter of system calls", fields["Seccomp"] == "2")
    threads = os.listdir(f"/proc/{pid}/task")
    prompt = sum(os.sched_getscheduler(int(thread)) & 7 == os.SCHED_FIFO for thread in threads)
    permitted = resource.getrlimit(resource.RLIMIT_RTPRIO)[1] > 0
    receiver = "the receiver too" if prompt == 2 else "the receiver not" if permitted else f"the receiver {REFUSED}"
    report.add("runs at real-time priority", prompt == 1 + permitted, receiver)
    permitted = resource.getrlimit(resource.RLIMIT_MEMLOCK)[1] == resource.RLIM_INFINITY
    locked = fields["VmLck"].strip() if permitted else REFUSED
    report.add("keeps its memory", locked != "0 kB", locked)


def reloads(report: Report) -> None:
    """Reload a valid and an invalid profile."""
    pid = shown("MainPID")
    profile = PROFILE.read_text()
    loop = reload(profile + "\nscheduler: {calls_per_frame: 3}\n")
    report.add("reloads a profile", "'reloads': 1" in loop and shown("MainPID") == pid)
    loop = reload(profile + "\nscheduler: {calls_per_fraem: 3}\n")
    report.add("refuses an invalid profile", "'refused_reloads': 1" in loop and shown("MainPID") == pid)
    PROFILE.write_text(profile)


def comes_back(report: Report) -> None:
    """Hang the process, then kill it."""
    for what, stop, limit_s in (
        ("is killed when it hangs, and comes back", signal.SIGSTOP, 40.0),
        ("comes back after kill -9", signal.SIGKILL, 10.0),
    ):
        pid = shown("MainPID")
        os.kill(int(pid), stop)
        took_s = until(partial(restarted, pid), limit_s)
        report.add(what, took_s is not None, figure(took_s))
    kept = sorted(path.name for path in RECORDS.resolve().parent.iterdir())
    report.add("keeps the records of all three", {"run", "run~1", "run~2"} <= set(kept), " ".join(kept))


def stops(report: Report) -> None:
    """Stop the unit."""
    begin_s = time.monotonic()
    systemctl("stop", UNIT)
    stop_s = time.monotonic() - begin_s
    report.add("stops within a second", stop_s < 1.0 and shown("Result") == "success", figure(stop_s))


def probe(report: Report) -> None:
    """Report the attempts of a process in the sandbox of the unit."""
    Path("/srv/modt/probe.py").write_text(PROBE)
    drop_in = Path(f"/run/systemd/system/{UNIT}.d/probe.conf")
    drop_in.parent.mkdir(parents=True)
    out = Path("/var/lib/modt-probe.json")
    drop_in.write_text(
        f"[Service]\nType=oneshot\nRestart=no\nExecStart=\nExecStart={sys.executable} /srv/modt/probe.py\n"
        f"StandardOutput=file:{out}\n"
    )
    systemctl("daemon-reload")
    systemctl("start", UNIT)
    for name, outcome in json.loads(out.read_text() or "{}").items():
        permitted = outcome == "done"
        report.add(f"sandbox: {name}", permitted == (name == ALLOWED), outcome)


if __name__ == "__main__":
    try:
        steps(Path(sys.argv[1]))
    except Exception as error:
        journal = subprocess.run(["journalctl", "-u", UNIT, "-n", "30"], capture_output=True, text=True, check=False)
        Report(Path(sys.argv[1])).add(f"{error!r}\n{journal.stdout}", False)
