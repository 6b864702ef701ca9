"""Faults of a live source and its surroundings, each with the counter that must report it."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modt.energy.meters.discovery import Discovery
from modt.energy.meters.meter import Candidate, Facts, Kind, Meter, MeterLostError, Scope
from modt.pipeline import Pipeline
from modt.sinks.output import LineFile, writing
from modt.sources.live.sweep_reader import Sweep
from modt.types import Budget, Frame, FrameResult

LATE_MS = 5.0
HOG = """
import time
while True:
    end = time.monotonic() + 0.07
    while time.monotonic() < end:
        pass
    time.sleep(0.02)
"""
HOG_PRIORITY = 20
"""Real-time priority above that of the loop."""
FULL_DISK = "full disk"
"""The one fault that may cost records."""
Sweeps = Sequence[Sweep]


class World:
    """State of the surroundings, which the faults change.

    Attributes:
        disk_full, meter_lost, stage_broken: whether the fault is active.
        back_s: sum of the steps back of the sensor's clock [s].
    """

    def __init__(self, core: int | None, hogs: int, *, fifo: bool) -> None:
        self.disk_full = self.meter_lost = self.stage_broken = False
        self.back_s = 0.0
        self._core, self._n_hogs, self._fifo = core, hogs, fifo
        self._hogs: list[subprocess.Popen[bytes]] = []

    def set_hogs(self, on: bool) -> None:
        """Start or end processes that compute on the core of the loop."""
        while on and len(self._hogs) < self._n_hogs:
            hog = subprocess.Popen([sys.executable, "-c", HOG])
            if self._fifo:
                os.sched_setscheduler(hog.pid, os.SCHED_FIFO, os.sched_param(HOG_PRIORITY))
            if self._core is not None:
                os.sched_setaffinity(hog.pid, {self._core})
            self._hogs.append(hog)
        while not on and self._hogs:
            hog = self._hogs.pop()
            hog.kill()
            hog.wait()

    def install(self) -> None:
        """Have the writers and stages of this process obey the switches."""
        write, step, world = LineFile.write, Pipeline.step, self

        def full(file: LineFile[Any], item: Any) -> None:
            with writing(file.path):
                if world.disk_full:
                    raise OSError(errno.ENOSPC, "No space left on device")
            write(file, item)

        def broken(pipeline: Pipeline, frame: Frame, budget: Budget) -> FrameResult:
            result = step(pipeline, frame, budget)
            if world.stage_broken and frame.index % 3 == 0:
                raise FloatingPointError("injected")
            return result

        LineFile.write = full  # type: ignore[method-assign]
        Pipeline.step = broken  # type: ignore[method-assign, assignment]

    def meters(self, clock: Callable[[], float]) -> Discovery:
        """Discovery of a meter of 5 W that can be lost."""

        def read() -> float:
            if self.meter_lost:
                raise MeterLostError("unplugged")
            return 5.0 * clock()

        facts = Facts(name="soak", unit="J", resolution=1e-3, max_W=100.0, scope=Scope.BOARD, kind=Kind.MEASURED)
        return Discovery((Candidate("soak", (Meter(facts, read),)),))


@dataclass(frozen=True, slots=True)
class Fault:
    """One kind of fault.

    Attributes:
        seconds: duration.
        counter: the counter that reports it.
        sweeps: turns a sweep into faulty ones, by a random generator.
        switch: turns the fault on and off in the world.
        silent_if_steady: no report is needed while results stay regular.
    """

    name: str
    seconds: float
    counter: Callable[[Any], int]
    sweeps: Callable[[Sweep, np.random.Generator], Sweeps] = lambda sweep, _: (sweep,)
    switch: Callable[[World, bool], None] = lambda world, on: None
    silent_if_steady: bool = False


def _with_points(sweep: Sweep, points: Any) -> Sweep:
    return replace(sweep, points=np.ascontiguousarray(points, np.float32))


def _nan(sweep: Sweep, rng: np.random.Generator) -> Sweeps:
    points = sweep.points.copy()
    points[rng.random(len(points)) < 0.2] = np.nan
    return (_with_points(sweep, points),)


def _garbage(sweep: Sweep, rng: np.random.Generator) -> Sweeps:
    return (_with_points(sweep, rng.normal(0.0, 1e5, sweep.points.shape)),)


def _loss(sweep: Sweep, rng: np.random.Generator) -> Sweeps:
    azimuth = np.arctan2(sweep.points[:, 1], sweep.points[:, 0])
    lost = np.abs(azimuth - rng.uniform(-3, 3)) < rng.uniform(0.1, 1.0)
    return (replace(_with_points(sweep, sweep.points[~lost]), complete=False),)


def _other_sensor(sweep: Sweep, _rng: np.random.Generator) -> Sweeps:
    """Every eighth beam, at nine tenths of the range."""
    tangent = sweep.points[:, 2] / np.maximum(np.hypot(sweep.points[:, 0], sweep.points[:, 1]), 0.1)
    return (_with_points(sweep, sweep.points[np.floor(tangent * 140) % 8 == 0] * [0.9, 0.9, 0.9, 1.0]),)


def _late(sweep: Sweep, _rng: np.random.Generator) -> Sweeps:
    return (sweep, replace(sweep, stamp_s=sweep.stamp_s - 0.1))


def _lie(sweep: Sweep, rng: np.random.Generator) -> Sweeps:
    return (replace(sweep, stamp_s=sweep.stamp_s + 59.0 * (rng.random() < 0.3)),)


def _set_back(world: World, on: bool) -> None:
    world.back_s += 100.0 * on


def _switch(name: str) -> Callable[[World, bool], None]:
    return lambda world, on: setattr(world, name, on)


def _hangup(_world: World, on: bool) -> None:
    if on:
        os.kill(os.getpid(), signal.SIGHUP)


def _late_frames(session: Any) -> int:
    """Frames that began late, and steps of the ladder. A hog need not cost a deadline."""
    lateness = session.deadlines.timing.late_or_later()
    late = max((n for ms, n in zip(lateness["ms"], lateness["frames"], strict=True) if ms > LATE_MS), default=0)
    return int(late) + session.deadlines.changes.total()


FAULTS = (
    Fault("silence", 4.0, lambda s: s.source.silences, lambda sweep, rng: ()),
    Fault("not finite", 2.0, lambda s: s.source.faults.count, _nan),
    Fault("garbage", 2.0, lambda s: s.source.faults.skipped, _garbage),
    Fault("loss", 2.0, lambda s: s.source.incomplete, _loss),
    Fault("duplicates", 2.0, lambda s: s.source.dropped + s.source.faults.skipped, lambda sweep, rng: (sweep, sweep)),
    Fault("reordering", 2.0, lambda s: s.source.faults.skipped, _late),
    Fault("other sensor", 3.0, lambda s: s.stages.misfits, _other_sensor),
    Fault("lying stamps", 2.0, lambda s: s.source.faults.skipped, _lie),
    Fault("clock set back", 0.2, lambda s: s.source.health()["time_steps"], switch=_set_back),
    Fault(FULL_DISK, 3.0, lambda s: s.recording.lost, switch=_switch("disk_full")),
    Fault("meter lost", 3.0, lambda s: s.power.unread, switch=_switch("meter_lost")),
    Fault("failing stage", 1.0, lambda s: s.failures.counts.total(), switch=_switch("stage_broken")),
    Fault("hog", 4.0, _late_frames, switch=World.set_hogs, silent_if_steady=True),
    Fault("reload", 0.2, lambda s: s.loop.reloads, switch=_hangup),
)
