"""The truth of a run whose frames are numbered as they arrived."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from modt.sources.scan_stream import ScanStream
from modt.types import NONE, Float64, Int
from modt_desk.evaluation.truth import Truth


def by_stamp(truth: Truth, stamps_s: Mapping[int, float]) -> Truth:
    """Each frame of a run has the labels and the scan of the nearest stamp, less than half a period away.

    Where no stamps agree, those of the run have another origin: then both count from the first one.

    Args:
        truth: of a recording with scans; without them it is returned as it is.
        stamps_s: by number of the run's frames, of which there is one.
    """
    if truth.scans is None or not truth.scans.scans:
        return truth
    scans, info = truth.scans.scans, truth.scans.info
    run_s, scans_s = np.array([*stamps_s.values()]), np.array([scan.stamp_s for scan in scans])
    scan = _nearest(scans_s, run_s, info.period_s / 2)
    if (scan == NONE).all():
        scan = _nearest(scans_s - scans_s[0], run_s - run_s[0], info.period_s / 2)
    found = {number: scans[k] for number, k in zip(stamps_s, scan.tolist(), strict=True) if k != NONE}
    frames = {number: truth.frames[own.index] for number, own in found.items() if own.index in truth.frames}
    numbered = [replace(own, index=number) for number, own in found.items()]
    return replace(truth, frames=frames, scans=ScanStream(info, numbered))


def _nearest(stamps_s: Float64, wanted_s: Float64, within_s: float) -> Int:
    """(n,) place of the stamp, of ascending ones, that is nearest to each, NONE where none is so near."""
    middles_s = (stamps_s[1:] + stamps_s[:-1]) / 2
    place = np.searchsorted(middles_s, wanted_s)
    return np.where(np.abs(stamps_s[place] - wanted_s) < within_s, place, NONE)
