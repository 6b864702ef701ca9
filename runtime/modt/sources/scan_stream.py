"""A stream of scan files of any layout."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from modt.errors import ModtError, ScanError
from modt.sources.scan_file import read_scan
from modt.sources.stream import Faults, StreamInfo
from modt.types import Float64, Frame, Self

PERIOD_S = 0.1
"""Time between scans that have no stamps [s]."""


@dataclass(frozen=True, slots=True)
class ScanReference:
    """A scan on disk."""

    index: int  # frame number
    path: Path  # the file
    stamp_s: float  # its time [s]
    T_world_sensor: Float64 | None  # (4, 4) pose, None where unknown
    turn_s: float = 0.0  # duration of the sweep [s], as in Frame


class ScanStream:
    """Frames of scan files, ordered by time; unusable scans are counted and skipped, the first ones are logged."""

    def __init__(self, info: StreamInfo, scans: list[ScanReference]) -> None:
        self.info = replace(info, n_frames=len(scans), end=scans[-1].index + 1 if scans else 0)
        self.scans = scans
        self.faults = Faults()

    def __iter__(self) -> Iterator[Frame]:
        used = 0
        for scan in self.scans:
            try:
                points, flaws = read_scan(scan.path)
            except ScanError as error:
                self.faults.report(scan.index, scan.path, error.cause, skipped=True)
                continue
            if flaws:
                self.faults.report(scan.index, scan.path, "; ".join(flaws), skipped=False)
            used += 1
            yield Frame(scan.index, scan.stamp_s, points, scan.T_world_sensor, turn_s=scan.turn_s)
        if self.scans and not used:
            cause = f"none of its {len(self.scans)} scans can be used ({self.faults.first[0].cause})"
            raise ModtError(self.info.name, cause, "give a stream of float32 x, y, z, reflectance scans")

    def between(self, first: int, last: int | None) -> Self:
        """Scans with first <= index < last; others are not read."""
        return type(self)(self.info, [s for s in self.scans if s.index >= first and (last is None or s.index < last)])
