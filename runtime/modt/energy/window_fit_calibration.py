"""Calibration of a board: a fit over windows of varied load, and bursts of one stage as a cross-check."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any, Protocol

import numpy as np

from modt.energy.attribution import CLASS, IDLE, SEG, Fit, fit, unit_energy_J, usable_windows
from modt.energy.instrumentation import Classifier
from modt.energy.ledger import Ledger
from modt.energy.windows import Windows
from modt.types import Float32, Frame, Int, Proposals

MIN_WINDOWS = 12
_BURSTS = 5
"""Bursts of each stage; the median counts."""

Line = dict[str, Any]


class Segmenter(Protocol):
    """Scans to proposals."""

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points."""
        ...


@dataclass(frozen=True, slots=True)
class CalibrationSetup:
    """The parts a calibration runs.

    Attributes:
        frames: processed repeatedly.
        segmenter, classifier: the two costs of Equation 2; the classifier counts its points on the ledger.
        ledger: of both.
        windows: over the meters, closed explicitly.
        sleep: waits [s].
        monotonic_ns: clock [ns].
    """

    frames: Sequence[Frame]
    segmenter: Segmenter
    classifier: Classifier
    ledger: Ledger
    windows: Windows
    sleep: Callable[[float], None]
    monotonic_ns: Callable[[], int]


@dataclass(frozen=True, slots=True)
class Calibration:
    """Result of a calibration.

    Attributes:
        fit: coefficients with intervals.
        seg_burst_J: energy of one segmentation, from bursts of segmentation.
        class_burst_J: energy of one classification of mean points, from bursts of classification.
        class_fit_J: the same by the fit.
        busy_W: power while computing: idle power plus energy above idling over CPU time.
    """

    fit: Fit
    seg_burst_J: float | None
    class_burst_J: float | None
    class_fit_J: float
    busy_W: float


def calibrate(
    setup: CalibrationSetup, windows: int, window_s: float, burst_s: float, random: np.random.Generator
) -> Calibration:
    """Run the varied load, fit it, and run the bursts.

    Args:
        setup: the parts.
        windows: number of varied load, at least MIN_WINDOWS.
        window_s: length of each [s].
        burst_s: length of each burst [s].
        random: draws the loads.

    Raises:
        FitError: the windows do not determine the coefficients.
    """
    stream = cycle(setup.frames)
    found = fit([_varied(setup, stream, window_s, random) for _ in range(max(windows, MIN_WINDOWS))], random)
    idle_W = found["idle_W"].value
    segmentations = cycle([(frame, setup.segmenter.segment(frame.points)) for frame in setup.frames])
    segmented = [_burst(setup, burst_s, lambda: _segment(setup, next(stream))) for _ in range(_BURSTS)]
    classified = [_burst(setup, burst_s, lambda: _classify(setup, *next(segmentations))) for _ in range(_BURSTS)]
    rows = [line["stages"].get("classification", {}) for line in usable_windows(classified)]
    points, items = (sum(row.get(key, 0) for row in rows) for key in ("points", "items"))
    busy = [line for line in usable_windows([*segmented, *classified]) if line["process_ns"]]
    above_W = [1e9 * (line["energy_J"] - idle_W * IDLE.count(line)) / line["process_ns"] for line in busy]
    return Calibration(
        fit=found,
        seg_burst_J=unit_energy_J(segmented, idle_W, SEG),
        class_burst_J=unit_energy_J(classified, idle_W, CLASS),
        class_fit_J=found["class_J"].value + found["point_J"].value * points / max(items, 1),
        busy_W=idle_W + (float(np.median(above_W)) if above_W else 0.0),
    )


def _varied(setup: CalibrationSetup, stream: Iterator[Frame], seconds: float, random: np.random.Generator) -> Line:
    """A window of random load: share of waiting, classifications a frame, largest or smallest proposals first."""
    load, waiting = int(random.integers(0, 60)), float(random.uniform(0.0, 0.9))
    order = -1 if random.random() < 0.5 else 1

    def frame() -> None:
        began_ns = setup.monotonic_ns()
        current = next(stream)
        proposals = _segment(setup, current)
        _classify(setup, current, proposals, np.argsort(proposals.count, kind="stable")[::order][:load])
        setup.sleep(1e-9 * (setup.monotonic_ns() - began_ns) * waiting / (1.0 - waiting))

    return _burst(setup, seconds, frame)


def _burst(setup: CalibrationSetup, seconds: float, task: Callable[[], object]) -> Line:
    """A window of one repeated task."""
    setup.ledger.close_frame(0)
    setup.windows.close()
    end_ns = setup.monotonic_ns() + round(seconds * 1e9)
    while setup.monotonic_ns() < end_ns:
        task()
        setup.windows.add(setup.ledger.close_frame(0))
    return setup.windows.close()


def _segment(setup: CalibrationSetup, frame: Frame) -> Proposals:
    return setup.ledger.run("segmentation", setup.segmenter.segment, frame.points)


def _classify(setup: CalibrationSetup, frame: Frame, proposals: Proposals, which: Int | None = None) -> None:
    rows = np.arange(len(proposals)) if which is None else which
    if len(rows):
        setup.ledger.run("classification", setup.classifier.classify, frame.points, proposals, rows)
