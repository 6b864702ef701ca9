"""Sums and series over a run's records for its report, in bounded memory at any length of the run."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modt import profile
from modt.classes import CLASS_NAMES, ObjectClass
from modt.config import ProfileConfig
from modt.energy.ledger import LedgerLine, StageWork
from modt.errors import MisuseError
from modt.pipeline import CLASSIFICATION, STAGES
from modt.reporting.histogram import Histogram
from modt.sinks.run_directory import RUN
from modt.types import Float64, Int
from modt_profiling.energy.savings import Counts

SCHEMA = "modt.run/1"
GIVE = "give the directory of a run"
POINTS = 512
"""Points held at most; an even number."""


def run_facts(run: Path) -> dict[str, Any]:
    """Content of a run's run.yaml, with defaults for keys missing in its profile.

    Raises:
        MisuseError: it is missing, or describes no run.
    """
    path = run / RUN
    try:
        facts = profile.from_yaml(path.read_text(encoding="utf-8"), path)
        if facts["schema"] != SCHEMA:
            raise MisuseError(path, f"describes no run of this version ({facts['schema']})", GIVE)
        for stage, values in profile.dump(ProfileConfig()).items():
            facts["profile"][stage] = values | (facts["profile"].get(stage) or {})
    except (OSError, UnicodeDecodeError, AttributeError, TypeError, KeyError) as error:
        raise MisuseError(path, f"describes no run ({error})", GIVE) from None
    return dict(facts)


class FrameSeries:
    """Sums of columns over points of equally many frames; when all points are full, neighbours become one."""

    def __init__(self, columns: int, points: int = POINTS) -> None:
        self.frames_a_point = 1
        self.count = 0
        self._sums = np.zeros((points, columns))

    def add(self, row: Sequence[float] | Float64) -> None:
        """Add the (columns,) values of one frame."""
        points = len(self._sums)
        if self.count == points * self.frames_a_point:
            self._sums[: points // 2] = self._sums[::2] + self._sums[1::2]
            self._sums[points // 2 :] = 0.0
            self.frames_a_point *= 2
        self._sums[self.count // self.frames_a_point] += row
        self.count += 1

    @property
    def frames(self) -> Int:
        """(points,) frames of each point; only the last may have fewer."""
        starts = np.arange(0, self.count, self.frames_a_point)
        return np.asarray(np.diff(starts, append=self.count))

    @property
    def means(self) -> Float64:
        """(points, columns) means over the frames of each point."""
        frames = self.frames
        return np.asarray(self._sums[: len(frames)] / frames[:, None])

    @property
    def total(self) -> Float64:
        """(columns,) sums over all frames."""
        return np.asarray(self._sums.sum(axis=0))


_BACKGROUND = CLASS_NAMES[ObjectClass.BACKGROUND]
COLUMNS = (*STAGES, "classified", "deferred", "proposals", "all_points")
"""Columns of the series: CPU time of the stages [s], counts, and points if all proposals were classified."""


class FrameSums:
    """Counts and costs over the lines of ledger.jsonl and tracks.jsonl.

    Of the tracks only those alive are held.
    """

    def __init__(self, size: Callable[[Int], int]) -> None:
        self._size = size  # points that the network processes for proposals of (R,) points
        self.series = FrameSeries(len(COLUMNS))
        self.stages: defaultdict[str, StageWork] = defaultdict(StageWork)  # sums of the ledger's columns
        self.overhead_ns = 0
        self.cpu_ns = 0
        self.marks: set[str] = set()
        self.lengths = Histogram()  # frames with a proposal, of the tracks that ended
        self.foreground = 0  # proposals of objects
        self.tracks = 0
        self.classified_tracks = 0
        # products of calls, items and points with one another, and with CPU time [s]
        self.load_gram = np.zeros((3, 3))
        self.load_moment = np.zeros(3)
        self._length: dict[int, int] = {}  # frames with a proposal by track alive
        self._viewed: set[int] = set()

    def add(self, line: LedgerLine, record: dict[str, Any]) -> None:
        """Add a frame by its two lines."""
        for stage, work in line.stages.items():
            self.stages[stage].add(work)
        self.overhead_ns += line.overhead_ns
        self.cpu_ns += line.cpu_ns
        self.marks.update(line.marks)
        cpu_s = {stage: 1e-9 * line.stages.get(stage, StageWork()).cpu_ns for stage in STAGES}
        classified = line.stages.get(CLASSIFICATION, StageWork())
        load = np.array([classified.calls, record["classifications"], classified.points], float)
        self.load_gram += np.outer(load, load)
        self.load_moment += load * cpu_s[CLASSIFICATION]
        all_points = self._add_tracks(record["tracks"])
        counts = (record["classifications"], record["deferred"], record["proposals"], all_points)
        self.series.add([*cpu_s.values(), *counts])

    def finish(self) -> None:
        """Count the lengths of the tracks that have not ended."""
        self._end(self._length.keys())

    def column(self, name: str) -> float:
        """Sum of a column of the series over all frames."""
        return float(self.series.total[COLUMNS.index(name)])

    def counts(self) -> Counts:
        """The work of the run."""
        row = self.stages[CLASSIFICATION]
        return Counts(
            frames=self.series.count,
            proposals=int(self.column("proposals")),
            foreground=self.foreground,
            tracks=self.tracks,
            classified_tracks=self.classified_tracks,
            classified=int(self.column("classified")),
            reacquired=0,
            points=row.points,
            calls=row.calls,
        )

    def _add_tracks(self, tracks: list[dict[str, Any]]) -> int:
        """Points of all proposals as the network would process them, padding included."""
        alive = {track["id"] for track in tracks}
        self._end(self._length.keys() - alive)
        seen = [track for track in tracks if track["proposal"] is not None]
        self.foreground += sum(track["class"] != _BACKGROUND for track in seen)
        for track in seen:
            length = self._length.get(track["id"], 0)
            self.tracks += not length
            self._length[track["id"]] = length + 1
        viewed = {track["id"] for track in tracks if track["viewed"]}
        self.classified_tracks += len(viewed - self._viewed)
        self._viewed = (self._viewed | viewed) & alive
        sizes = np.array([track["points"] for track in seen], np.int64)
        return self._size(sizes)

    def _end(self, ids: Iterable[int]) -> None:
        for id_ in tuple(ids):
            self.lengths.add(self._length.pop(id_))
