"""Runs a service under faults by seed, and ends with figures and a verdict.

    python -m tools.deploy.soak DRIVE --minutes 30 --seed 1

A process of its own sends the recording as the packets of a VLP-16 to a UDP port, where the service receives them.

The exit status is 0 if the run keeps these promises. Each fault is counted where the status shows it; a process that
takes the core ("hog") needs to be counted only if results stall. A second after a fault there are results of full
quality again, and 5 s after one of the scene they are trusted. Records are lost only on a full disk. At most one
deadline in 1,000 is missed between faults. Memory and open descriptors stay flat.

`--fifo` runs at the real-time priority of a service; the hog gets a higher one.
"""

from __future__ import annotations

import argparse
import logging
import os
import resource
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from modt import host
from modt.app import build
from modt.app.inputs import Request
from modt.app.load_shedding import Step
from modt.app.loop import Service
from modt.app.systemd import Notifier
from modt.schemes import open_sensor
from modt.sinks.output import Health
from modt.sources.stream import StreamEndedError, Sweep, SweepReader
from modt.types import FrameResult, TrustLevel
from tools.deploy.faults import FAULTS, FULL_DISK, NO_FAULT, Fault, World
from tools.options import parser

WARM_UP_S = 15.0
"""Time before the first fault [s]."""
REST_S = 6.0
"""Least time between two faults [s]."""
SETTLE_S = 2.5
"""Time after a fault in which a missed deadline is its effect [s]."""
MAX_RECOVERY_S = 1.0
"""Greatest time from the end of a fault to whole results [s]."""
MAX_DOUBT_S = 5.0
"""Greatest time from the end of a fault of the scene to results that are trusted [s]."""
MAX_MISSED = 0.001
"""Greatest share of the frames that may miss their deadline between faults."""
MAX_GROWTH = 0.05
"""Greatest growth of the resident memory over the soak, as a share."""
STALL = 1.5
"""A longer time between two results, in periods, is a stall."""


@dataclass(slots=True)
class Episode:
    """One occurrence of a fault: times [s], and its counter before and after."""

    fault: Fault
    begin_s: float
    before: int
    end_s: float = float("inf")
    after: int = 0


class ResultLog:
    """A sink that notes when results come, whether they are trusted, what was missed, memory and open descriptors."""

    def __init__(self) -> None:
        self.service: Service | None = None
        self.times_s: list[float] = []
        self.full: list[bool] = []  # nothing was given up
        self.trusted: list[bool] = []
        self.missed: list[int] = []
        self.resident_mb: list[float] = []
        self.descriptors: list[int] = []

    def write(self, result: FrameResult) -> None:
        """Note a result."""
        assert self.service is not None
        deadlines = self.service.deadlines
        self.times_s.append(time.monotonic())
        self.full.append(deadlines.shedding.step is Step.ALL)
        self.trusted.append(result.trust.level is TrustLevel.GOOD)
        self.missed.append(deadlines.missed)
        if len(self.times_s) % 50 == 0:
            self.resident_mb.append(host.resident_mb())
            self.descriptors.append(len(os.listdir("/proc/self/fd")))

    def health(self) -> Health:
        """Nothing to report."""
        return {}

    def close(self) -> None:
        """No effect."""


class FaultyReader:
    """Reads the sensor for a time, with one fault after the other."""

    def __init__(
        self, reader: SweepReader, sender: subprocess.Popen[str], world: World, seconds: float, seed: int
    ) -> None:
        self.reception = reader.reception
        self._reader = reader
        self._sender = sender
        self._world = world
        self._rng = np.random.default_rng(seed)
        began_s = time.monotonic()
        self._rest_s = began_s + WARM_UP_S  # time until which there is no fault
        self._end_s = began_s + seconds
        self._waiting: list[Fault] = []
        self.service: Service | None = None
        self.episodes: list[Episode] = []
        self._now: Episode | None = None

    @property
    def profile(self) -> str | None:
        """Profile of the sensor."""
        return self._reader.profile

    def read(self, timeout_s: float) -> Sequence[Sweep]:
        """Sweeps as the present fault leaves them."""
        now_s = time.monotonic()
        if now_s > self._end_s:
            self._turn_off(now_s)
            raise StreamEndedError
        if self._now is None and self._rest_s < now_s < self._end_s - 15.0:
            self._turn_on(now_s)
        elif self._now is not None and now_s >= self._now.begin_s + self._now.fault.seconds:
            self._turn_off(now_s)
        return self._reader.read(min(timeout_s, 0.05))

    def close(self) -> None:
        """Release the socket."""
        self._reader.close()

    def ask(self) -> None:
        """Read the counter of the last fault."""
        if self.episodes and self.service is not None:
            self.episodes[-1].after = self.episodes[-1].fault.counter(self.service)

    def _turn_on(self, now_s: float) -> None:
        if not self._waiting:
            self._waiting = [FAULTS[k] for k in self._rng.permutation(len(FAULTS))]
        fault = self._waiting.pop()
        assert self.service is not None
        self.ask()
        self._now = Episode(fault, now_s, fault.counter(self.service))
        self.episodes.append(self._now)
        self._send(fault)
        fault.switch(self._world, True)

    def _turn_off(self, now_s: float) -> None:
        if self._now is not None:
            self._send(NO_FAULT)
            self._now.fault.switch(self._world, False)
            self._now.end_s = time.monotonic()  # a hog is gone
            self._now = None
            self._rest_s = now_s + REST_S + float(self._rng.uniform(0, 2))

    def _send(self, fault: Fault) -> None:
        """Make the sender apply a fault to its packets."""
        assert self._sender.stdin is not None
        print(fault.name, file=self._sender.stdin, flush=True)


def start_sender(drive: Path | None) -> tuple[subprocess.Popen[str], int]:
    """A process that sends packets, and the free UDP port to which it sends them."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bound:
        bound.bind(("127.0.0.1", 0))
        port = int(bound.getsockname()[1])
    command = [sys.executable, "-m", "tools.deploy.sender", str(port), *([str(drive)] if drive else [])]
    sender = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert sender.stdout is not None
    sender.stdout.readline()
    return sender, port


def judge(log: ResultLog, episodes: list[Episode], service: Service) -> list[str]:
    """Print the figures; returns the broken promises."""
    print(f"{'fault':<16}{'times':>6}{'counted':>8}{'recovery':>10}  (s, worst)")
    wrong = [line for fault in FAULTS for line in _of_fault(fault, log, episodes)]
    return [*wrong, *_between_faults(log, episodes, service), *_of_memory(log)]


def _of_fault(fault: Fault, log: ResultLog, episodes: list[Episode]) -> Iterator[str]:
    """Print how often a fault occurred, and whether it was counted and overcome."""
    times_s = np.array(log.times_s)
    whole_s = times_s[np.array(log.trusted if fault.of_scene else log.full)]
    most_s = MAX_DOUBT_S if fault.of_scene else MAX_RECOVERY_S
    gaps_s = np.diff(times_s)
    stalls_s = times_s[1:][gaps_s > STALL * np.median(gaps_s)]
    occurred = [e for e in episodes if e.fault is fault and np.isfinite(e.end_s)]
    recoveries_s = [float(whole_s[whole_s > e.end_s].min(initial=np.inf)) - e.end_s for e in occurred]
    worst_s = max(recoveries_s, default=0.0)
    silent = [e for e in occurred if e.after <= e.before]
    if fault.silent_if_steady:
        silent = [e for e in silent if ((stalls_s > e.begin_s) & (stalls_s < e.end_s)).any()]
    print(f"{fault.name:<16}{len(occurred):>6}{sum(e.after - e.before for e in occurred):>8}{worst_s:>10.2f}")
    if silent:
        yield f"{fault.name}: {len(silent)} of {len(occurred)} were not counted"
    if worst_s > most_s:
        yield f"{fault.name}: recovery took {worst_s:.1f} s"


def _between_faults(log: ResultLog, episodes: list[Episode], service: Service) -> Iterator[str]:
    """Print the deadlines that were missed between faults, and what the recording has lost."""
    times_s = np.array(log.times_s)
    clear = np.ones(len(times_s), np.bool_)
    for e in episodes:
        clear &= (times_s < e.begin_s) | (times_s > e.end_s + SETTLE_S)
    missed = int(np.diff(log.missed, prepend=0)[clear].sum())
    share = missed / max(int(clear.sum()), 1)
    recording = service.recording.health()
    lost = recording.lost_lines - sum(e.after - e.before for e in episodes if e.fault.name == FULL_DISK)
    print(f"frames {len(times_s)}, in {times_s[-1] - times_s[0]:.0f} s; {clear.sum()} of them between faults")
    print(f"deadlines missed between faults: {missed} ({100 * share:.3f} %); {service.status().loop}")
    print(f"recording {recording}")
    if share > MAX_MISSED:
        yield f"{missed} deadlines missed between faults"
    if lost:
        yield f"{lost} records lost but on a full disk"


def _of_memory(log: ResultLog) -> Iterator[str]:
    """Print the memory and the descriptors."""
    memory_mb, late_mb = _thirds(log.resident_mb)
    growth = late_mb / memory_mb - 1
    descriptors, late = _thirds(log.descriptors)
    print(f"memory {max(log.resident_mb):.0f} MB at most, growth {100 * growth:.1f} %")
    print(f"descriptors {max(log.descriptors)} at most, {descriptors:.0f} midway, {late:.0f} at the end")
    if growth > MAX_GROWTH:
        yield f"memory grew by {100 * growth:.1f} %"
    if late > descriptors:
        yield f"{late - descriptors:.0f} descriptors leaked"


def _thirds(values: Sequence[float]) -> tuple[float, float]:
    """Medians of the second and of the last third."""
    third = max(len(values) // 3, 1)
    return float(np.median(values[third : 2 * third] or values)), float(np.median(values[-third:]))


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__)
    options.add_argument("drive", type=Path, nargs="?", help="a recording (default: a synthetic one)")
    options.add_argument("--minutes", type=float, default=5.0)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--profile", help="default: as modt run")
    options.add_argument("--out", type=Path, default=Path("runs/soak"))
    options.add_argument("--fifo", action="store_true", help="with the priority of a service")
    given = options.parse_args(arguments)
    logging.basicConfig(level=logging.ERROR, format="%(message)s", stream=sys.stderr)
    wrong = soak(given)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak memory {peak_mb:.0f} MB")
    print("verdict: " + ("; ".join(wrong) or "good"))
    return int(bool(wrong))


def soak(given: argparse.Namespace) -> list[str]:
    """Run the service under faults and print the figures; returns the broken promises."""
    core = host.last_core()
    others = host.other_cores(core)
    host.pin_to_core(core)
    if given.fifo:
        host.take_real_time_priority()
    world = World(core, fifo=given.fifo)
    world.install()
    build.discover = lambda board: world.meters(time.monotonic)  # type: ignore[attr-defined,assignment,misc]
    log = ResultLog()
    with host.threads_on(others):
        sender, port = start_sender(given.drive)
        source = open_sensor(f"velodyne://127.0.0.1:{port}", others)
        reader = FaultyReader(source.reader, sender, world, 60 * given.minutes, given.seed)
        source.reader = reader
        request = Request(profile=[given.profile] if given.profile else ())
        service = build.service(request, source, {"results": log}, given.out, None, core, ["soak"])
    log.service = service
    reader.service = service
    try:
        service.run(Notifier())
    finally:
        world.set_hog(False)
        sender.kill()
        sender.wait()
    reader.ask()
    return judge(log, reader.episodes, service)


if __name__ == "__main__":
    raise SystemExit(main())
