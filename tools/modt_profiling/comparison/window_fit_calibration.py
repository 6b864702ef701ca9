"""Calibration of a board: a fit over windows of varied load, and bursts of one stage as a cross-check."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np

from modt.app import assembly, inputs
from modt.app.chosen_profile import choose
from modt.classification.call_cost import padded_size
from modt.config import ProfileConfig
from modt.energy.ledger import Ledger, StageWork
from modt.energy.meters.discovery import discover
from modt.energy.meters.meter import Conditions, Facts
from modt.energy.windows import Clocks, EnergyWindow, Windows
from modt.errors import ModtError
from modt.geometry import FieldOfView
from modt.profile import resolve
from modt.types import Float32, Float64, Frame, Int, Proposals
from modt_profiling.energy.board_fit import CLASS, IDLE, SEG, Fit, fit, unit_energy_J, usable_windows
from modt_profiling.energy.named_meter import choose_meter

_BURSTS = 5
"""Bursts of each stage; the median counts."""


@dataclass(frozen=True)
class Calibration:
    """Result of a calibration."""

    fit: Fit
    seg_burst_J: float | None  # energy of one segmentation, from bursts of segmentation
    class_burst_J: float | None  # energy of one classification of mean size, from bursts
    class_fit_J: float  # energy of one classification of mean size by the fit
    busy_W: float  # idle power plus energy above idling over CPU time

    @property
    def board(self) -> dict[str, float]:
        """Powers and energies by the keys of a profile's stage `energy`."""
        return {
            "idle_W": round(max(self.fit["idle_W"].value, 0.0), 6),
            "busy_W": round(self.busy_W, 6),
            **{key: self.fit[key].value for key in ("seg_J", "class_J", "point_J")},
        }


@dataclass(frozen=True)
class Workload:
    """The work that a calibration varies."""

    frames: Sequence[Frame]
    segment: Callable[[Float32], Proposals]
    classify: Callable[[Float32, Proposals, Int], Float64]
    size: Callable[[Int], int]  # points that the network processes for proposals of (R,) points
    ledger: Ledger
    windows: Windows  # closed explicitly
    meter: Facts

    def calibrate(self, windows: int, window_s: float, burst_s: float, random: np.random.Generator) -> Calibration:
        """Run the windows of varied load, fit them, and run the bursts.

        Raises:
            FitError: the windows do not determine the coefficients.
        """
        frames = cycle(self.frames)
        found = fit([self._varied(frames, window_s, random) for _ in range(windows)], random)
        idle_W = found["idle_W"].value
        work = cycle([(f, p, np.arange(len(p))) for f in self.frames for p in [self.segment(f.points)]])
        segmented = [self._window(burst_s, lambda: self._segment(next(frames))) for _ in range(_BURSTS)]
        classified = [self._window(burst_s, lambda: self._classify(*next(work))) for _ in range(_BURSTS)]
        total = StageWork()
        for window in usable_windows(classified):
            total.add(window.stages.get("classification", StageWork()))
        busy = [window for window in usable_windows([*segmented, *classified]) if window.process_ns]
        above_W = [1e9 * ((w.energy_J or 0.0) - idle_W * IDLE.count(w)) / w.process_ns for w in busy]
        return Calibration(
            fit=found,
            seg_burst_J=unit_energy_J(segmented, idle_W, SEG),
            class_burst_J=unit_energy_J(classified, idle_W, CLASS),
            class_fit_J=found["class_J"].value + found["point_J"].value * total.points / max(total.items, 1),
            busy_W=idle_W + (float(np.median(above_W)) if above_W else 0.0),
        )

    def _varied(self, frames: Iterator[Frame], seconds: float, random: np.random.Generator) -> EnergyWindow:
        """A window of random load: share of waiting, classifications a frame, largest or smallest proposals first."""
        load = int(random.integers(0, 60))
        waiting = float(random.uniform(0.0, 0.9))
        order = -1 if random.random() < 0.5 else 1

        def task() -> None:
            began_s = time.monotonic()
            frame = next(frames)
            proposals = self._segment(frame)
            self._classify(frame, proposals, np.argsort(proposals.count, kind="stable")[::order][:load])
            time.sleep((time.monotonic() - began_s) * waiting / (1.0 - waiting))

        return self._window(seconds, task)

    def _window(self, seconds: float, task: Callable[[], object]) -> EnergyWindow:
        """A window of one repeated task."""
        self.ledger.close_frame(0)
        self.windows.close()
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            task()
            self.windows.add(self.ledger.close_frame(0))
        return self.windows.close()

    def _segment(self, frame: Frame) -> Proposals:
        return self.ledger.run("segmentation", self.segment, frame.points)

    def _classify(self, frame: Frame, proposals: Proposals, which: Int) -> None:
        if len(which):
            self.ledger.run("classification", self.classify, frame.points, proposals, which)
            self.ledger.count("classification", points=self.size(proposals.count[which]))


def open_workload(
    request: inputs.Request, meter_name: str | None, core: int | None
) -> tuple[Workload, ProfileConfig]:
    """The work of a stream, and the profile of its sensor.

    Raises:
        ModtError: no usable frame, or no such meter.
    """
    stream = inputs.stream(request)
    frames = list(stream)
    if not frames:
        raise ModtError(stream.info.name, "no usable frame", "give a stream that modt replay can work on")
    profile = choose(resolve(request.profile), frames[0], stream.info).config
    meters = choose_meter(discover(profile.energy), meter_name).meters
    kernels = assembly.chosen_kernels(profile.segmentation.kernels)
    workload = Workload(
        frames,
        segment=assembly.segmenter(profile, FieldOfView(), kernels).segment,
        classify=assembly.network(profile.classification, profile.sensor).classify,
        size=padded_size(profile.classification),
        ledger=Ledger(),
        windows=Windows(meters, Clocks(), Conditions(core or 0), math.inf),
        meter=meters[0].facts,
    )
    return workload, profile
