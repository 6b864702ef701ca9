"""Calibration of a board: load varied on purpose, a fit over windows, and bursts of one stage as a cross-check."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from typing import Any, Protocol

import numpy as np

from modt.energy.attribution import CLASS, IDLE, SEG, Fit, burst, fit, usable
from modt.energy.instrumentation import Classifier
from modt.energy.ledger import Ledger
from modt.energy.windows import Windows
from modt.types import Float32, Frame, Int, Proposals

FEWEST_WINDOWS = 12
BURSTS = 5
"""The median of so many counts."""

Line = dict[str, Any]


class Segmenter(Protocol):
    """Sweeps to proposals."""

    def segment(self, points: Float32) -> Proposals:
        """Proposals of (N, 4) points."""
        ...


@dataclass(frozen=True, slots=True)
class Work:
    """What a calibration lets the board do.

    Attributes:
        frames: worked on over and over.
        segmenter, classifier: the two costs of Equation 2; the classifier books its points on the ledger.
        ledger: of both.
        windows: over the meters, closed by hand alone.
        sleep: waits for so many seconds.
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
    """What a calibration found.

    Attributes:
        fit: coefficients with intervals.
        seg_burst_J: of one segmentation, from segmentation alone.
        class_burst_J: of one classification with the points of an average one, from classification alone.
        class_fit_J: the same by the fit.
        busy_W: drawn while computing: what is above idling over CPU time, and idling.
    """

    fit: Fit
    seg_burst_J: float | None
    class_burst_J: float | None
    class_fit_J: float
    busy_W: float


def calibrate(work: Work, windows: int, window_s: float, burst_s: float, random: np.random.Generator) -> Calibration:
    """Runs the varied load, fits it, and runs the bursts.

    Args:
        work: what the board does.
        windows: of varied load, at least FEWEST_WINDOWS.
        window_s: length of each [s].
        burst_s: length of each burst [s].
        random: draws the loads.

    Raises:
        FitError: the windows do not determine the coefficients.
    """
    stream = cycle(work.frames)
    found = fit([_varied(work, stream, window_s, random) for _ in range(max(windows, FEWEST_WINDOWS))], random)
    idle_W = found["idle_W"].value
    ready = cycle([(frame, work.segmenter.segment(frame.points)) for frame in work.frames])
    segmented = [_burst(work, burst_s, lambda: _segment(work, next(stream))) for _ in range(BURSTS)]
    classified = [_burst(work, burst_s, lambda: _classify(work, *next(ready), None)) for _ in range(BURSTS)]
    rows = [line["stages"].get("classification", {}) for line in usable(classified)]
    points, items = (sum(row.get(key, 0) for row in rows) for key in ("points", "items"))
    busy = [line for line in usable([*segmented, *classified]) if line["process_ns"]]
    above_W = [1e9 * (line["energy_J"] - idle_W * IDLE.count(line)) / line["process_ns"] for line in busy]
    return Calibration(
        fit=found,
        seg_burst_J=burst(segmented, idle_W, SEG),
        class_burst_J=burst(classified, idle_W, CLASS),
        class_fit_J=found["class_J"].value + found["point_J"].value * points / max(items, 1),
        busy_W=idle_W + (float(np.median(above_W)) if above_W else 0.0),
    )


def _varied(work: Work, stream: Iterator[Frame], seconds: float, random: np.random.Generator) -> Line:
    """A window of random load: so much waiting, and so many classifications a frame, of large or small proposals."""
    load, rest = int(random.integers(0, 60)), float(random.uniform(0.0, 0.9))
    order = -1 if random.random() < 0.5 else 1

    def frame() -> None:
        began_ns = work.monotonic_ns()
        now = next(stream)
        proposals = _segment(work, now)
        _classify(work, now, proposals, np.argsort(proposals.count, kind="stable")[::order][:load])
        work.sleep(1e-9 * (work.monotonic_ns() - began_ns) * rest / (1.0 - rest))

    return _burst(work, seconds, frame)


def _burst(work: Work, seconds: float, task: Callable[[], object]) -> Line:
    """A window of one task over and over."""
    work.ledger.close_frame(0)
    work.windows.close()
    end_ns = work.monotonic_ns() + round(seconds * 1e9)
    while work.monotonic_ns() < end_ns:
        task()
        work.windows.add(work.ledger.close_frame(0))
    return work.windows.close()


def _segment(work: Work, frame: Frame) -> Proposals:
    return work.ledger.run("segmentation", work.segmenter.segment, frame.points)


def _classify(work: Work, frame: Frame, proposals: Proposals, which: Int | None) -> None:
    rows = np.arange(len(proposals)) if which is None else which
    if len(rows):
        work.ledger.run("classification", work.classifier.classify, frame.points, proposals, rows)
