"""Faults of a sensor, its network and the surroundings of a run, and the counter that must report each."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from modt.energy.meters.discovery import Discovery
from modt.energy.meters.meter import Candidate, Facts, Kind, Meter, MeterLostError, Scope
from modt.pipeline import Pipeline
from modt.sinks.output import LineFile, writing
from modt.types import Budget, Float64, Frame, FrameResult
from tools.send.faults import PacketFaults
from tools.send.loops import VelodyneStamps

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
"""Real-time priority of a hog, a process that computes on the core of the loop; above the priority of the loop."""
FULL_DISK = "full disk"
"""The one fault that may cost records."""
BLOCKS = 12
"""Blocks of a Velodyne's packet."""
BLOCK_BYTES = 100
"""Bytes of a block: a head of four bytes and 32 returns."""
LASERS = 16
TURN = 36_000
FEW_LASERS = np.arange(LASERS) % 8 == 0
LOWER_LASERS = np.arange(LASERS) % 2 == 0
"""The lasers of a VLP-16 alternate: -15, 1, -13, 3 deg and so on; from the last to the first they are upside down."""
DOUBTED_S = 6.0
"""Time of a fault that the trust has to tell [s]."""
CELL = np.dtype([("distance", "<u2"), ("reflectance", "u1")])
"""A return in a block."""


class World:
    """Switches by which faults take effect.

    Attributes:
        disk_full, meter_lost, stage_broken: the fault is active.
    """

    def __init__(self, core: int | None, *, fifo: bool) -> None:
        self.disk_full = False
        self.meter_lost = False
        self.stage_broken = False
        self._core = core
        self._fifo = fifo
        self._hog: subprocess.Popen[bytes] | None = None

    def set_hog(self, on: bool) -> None:
        """Begin or end a process that computes on the core of the loop."""
        if on and self._hog is None:
            self._hog = subprocess.Popen([sys.executable, "-c", HOG])
            if self._fifo:
                os.sched_setscheduler(self._hog.pid, os.SCHED_FIFO, os.sched_param(HOG_PRIORITY))
            if self._core is not None:
                os.sched_setaffinity(self._hog.pid, {self._core})
        if not on and self._hog is not None:
            self._hog.kill()
            self._hog.wait()
            self._hog = None

    def install(self) -> None:
        """Put the switches of disk and stages into this process."""
        write = LineFile.write
        step = Pipeline.step
        world = self

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
        """A meter of 5 W that may be lost."""

        def read() -> float:
            if self.meter_lost:
                raise MeterLostError("unplugged")
            return 5.0 * clock()

        facts = Facts(name="soak", unit="J", resolution=1e-3, max_W=100.0, scope=Scope.BOARD, kind=Kind.MEASURED)
        return Discovery((Candidate("soak", (Meter(facts, read),)),))


@dataclass(frozen=True)
class Fault:
    """One kind of fault.

    Attributes:
        seconds: duration.
        counter: the counter that reports it.
        network: faults of packets on their way.
        packet: changes a packet, by a random generator.
        clock_s: step of the sensor's clock when the fault begins [s].
        switch: turns it on and off in the world.
        silent_if_steady: no report is needed while results stay regular.
        of_scene: results go on and are not trusted, so it is over when they are trusted again.
    """

    name: str
    seconds: float
    counter: Callable[[Any], int]
    network: PacketFaults = field(default_factory=PacketFaults)
    packet: Callable[[bytes, np.random.Generator], bytes] = lambda payload, _: payload
    clock_s: float = 0.0
    switch: Callable[[World, bool], None] = lambda world, on: None
    silent_if_steady: bool = False
    of_scene: bool = False


def _of_scene(
    distance: Callable[[Float64, Float64], Float64] = lambda distance, azimuth_deg: distance, turned_deg: float = 0.0
) -> Callable[[bytes, np.random.Generator], bytes]:
    """Fault of the scene in a packet: a turn of the head, and a change of the distances.

    `distance` takes those of the blocks and lasers (BLOCKS, 2, 16), and the azimuths of the blocks (BLOCKS, 1, 1).
    """

    def change(payload: bytes, _rng: np.random.Generator) -> bytes:
        raw = np.frombuffer(payload, np.uint8).copy()
        blocks = raw[: BLOCKS * BLOCK_BYTES].reshape(BLOCKS, BLOCK_BYTES)
        azimuth = blocks[:, 2:4].view("<u2")
        cells = blocks[:, 4:].view(CELL)
        before = cells["distance"].reshape(BLOCKS, -1, LASERS).astype(np.float64)
        after = distance(before, azimuth[..., None] / 100).reshape(cells.shape)
        cells["distance"] = np.minimum(after, np.iinfo(np.uint16).max)
        azimuth[:] = (azimuth + round(100 * turned_deg)) % TURN
        return raw.tobytes()

    return change


def _behind(azimuth_deg: Float64) -> Float64:
    return np.asarray((azimuth_deg > 90) & (azimuth_deg < 270), np.float64)


def _lie(payload: bytes, rng: np.random.Generator) -> bytes:
    stamps = VelodyneStamps()
    ahead_us = 59_000_000 * int(rng.random() < 0.3)
    return stamps.stamped(payload, (stamps.stamp_us(payload) + ahead_us) % stamps.wrap_us)


def _switch(name: str) -> Callable[[World, bool], None]:
    return lambda world, on: setattr(world, name, on)


def _hangup(_world: World, on: bool) -> None:
    if on:
        os.kill(os.getpid(), signal.SIGHUP)


def _late_frames(service: Any) -> int:
    """Frames that began late, and steps of load shedding; a hog need not cost a deadline."""
    lateness = service.deadlines.late_or_later()
    late = max((n for ms, n in zip(lateness["ms"], lateness["frames"], strict=True) if ms > LATE_MS), default=0)
    return int(late) + service.deadlines.changes.total()


def _refused(service: Any) -> int:
    """Messages and sweeps that were not used."""
    return sum(service.source.health()["refused_messages"].values()) + int(service.source.faults.skipped)


def _incomplete(service: Any) -> int:
    health = service.source.health()
    return int(health["incomplete_sweeps"] + health["lost_messages"])


def _doubted(service: Any) -> int:
    """Frames that are not trusted."""
    frames = service.stages.trust.frames
    return int(frames.total() - frames["good"])


SCENE_FAULTS = {
    "covered": _of_scene(lambda d, _: 0 * d),
    "front missing": _of_scene(lambda d, azimuth_deg: d * _behind(azimuth_deg)),
    "upper beams dead": _of_scene(lambda d, _: d * LOWER_LASERS),
    "twice as far": _of_scene(lambda d, _: 2 * d),
    "half as far": _of_scene(lambda d, _: d / 2),
    "upside down": _of_scene(lambda d, _: d[..., ::-1]),
    "turned by 90 deg": _of_scene(turned_deg=90.0),
}
"""Changes of the packets by which the sweeps show what cannot be."""
NO_FAULT = Fault("none", 0.0, lambda s: 0)
FAULTS = (
    Fault("silence", 4.0, lambda s: s.source.silences, PacketFaults(lost=1.0)),
    Fault("garbage", 2.0, _refused, PacketFaults(lost=1.0, garbage=1.0)),
    Fault("loss", 2.0, _incomplete, PacketFaults(lost=0.3)),
    Fault("duplicates", 2.0, _refused, PacketFaults(duplicated=1.0), silent_if_steady=True),
    Fault("reordering", 2.0, _refused, PacketFaults(reordered=0.5), silent_if_steady=True),
    Fault("other sensor", 3.0, lambda s: s.stages.misfits, packet=_of_scene(lambda d, _: 0.9 * d * FEW_LASERS)),
    *(Fault(name, DOUBTED_S, _doubted, packet=packet, of_scene=True) for name, packet in SCENE_FAULTS.items()),
    Fault("lying stamps", 2.0, _refused, packet=_lie),
    Fault("clock set back", 0.2, _refused, clock_s=-100.0),
    Fault(FULL_DISK, 3.0, lambda s: s.recording.health().lost_lines, switch=_switch("disk_full")),
    Fault("meter lost", 3.0, lambda s: s.power.unread_windows, switch=_switch("meter_lost")),
    Fault("failing stage", 1.0, lambda s: s.failures.counts.total(), switch=_switch("stage_broken")),
    Fault("hog", 4.0, _late_frames, switch=World.set_hog, silent_if_steady=True),
    Fault("reload", 0.2, lambda s: s.reloads, switch=_hangup),
)
