"""What a run cost and what it saved, from its records alone: live while it runs, or afterwards from its files."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from modt.classes import CLASS_NAMES, ObjectClass
from modt.energy.windows import SCHEMA as ENERGY_SCHEMA
from modt.pipeline import CLASSIFICATION, SEGMENTATION
from modt.reporting.histogram import Spread
from modt.sinks.records import read_records
from modt.sinks.run_directory import LEDGER, TRACKS
from modt.sinks.tracks import SCHEMA as FRAME_SCHEMA
from modt.types import NONE, FrameResult

SCHEMA = "modt.summary/1"
LEDGER_SCHEMA = "modt.ledger/1"
QUANTILES = {"p50": 0.5, "p95": 0.95, "p99": 0.99}
BACKGROUND = CLASS_NAMES[ObjectClass.BACKGROUND]


class TrackLives:
    """Counts tracks and the frames in which they were seen; remembers only those alive."""

    def __init__(self) -> None:
        self._alive: dict[int, tuple[int, bool]] = {}
        self._ended = {True: [0, 0], False: [0, 0]}  # foreground: tracks, frames seen

    def add(self, tracks: Iterable[tuple[int, bool, bool]]) -> None:
        """The tracks of one frame: id, whether it is seen, whether it is foreground."""
        present: dict[int, tuple[int, bool]] = {}
        for id_, visible, foreground in tracks:
            seen, _ = self._alive.pop(id_, (0, False))
            present[id_] = (seen + visible, foreground)
        for seen, foreground in self._alive.values():
            self._ended[foreground][0] += 1
            self._ended[foreground][1] += seen
        self._alive = present

    def totals(self, *, foreground_only: bool) -> tuple[int, int]:
        """Number of tracks, and the frames in which they were seen, added up; a track's class is its last."""
        groups = (True,) if foreground_only else (True, False)
        tracks = sum(self._ended[g][0] for g in groups)
        frames = sum(self._ended[g][1] for g in groups)
        living = [seen for seen, foreground in self._alive.values() if foreground in groups]
        return tracks + len(living), frames + sum(living)


class Summary:
    """Adds up the records of a run, however long it lasts: what is held is bounded (`Spread`, `TrackLives`)."""

    def __init__(self) -> None:
        self.frames = self.proposals = self.classified = self.deferred = 0
        self.lives = TrackLives()
        self._span: dict[str, dict[str, Spread]] = defaultdict(lambda: {"wall_ns": Spread(), "cpu_ns": Spread()})
        self._calls: dict[str, int] = defaultdict(int)
        self._items: dict[str, int] = defaultdict(int)

    def add_frame(self, record: dict[str, Any]) -> None:
        """A line of tracks.jsonl."""
        self._add_counts(record["proposals"], record["classifications"], record["deferred"])
        self.lives.add((t["id"], t["proposal"] is not None, t["class"] != BACKGROUND) for t in record["tracks"])

    def add_result(self, result: FrameResult) -> None:
        """What add_frame reads in the line of this result."""
        tracks = result.tracks
        self._add_counts(len(result.proposals), result.n_classified, result.n_deferred)
        seen, foreground = tracks.proposal != NONE, tracks.object_class != ObjectClass.BACKGROUND
        self.lives.add(zip(tracks.id.tolist(), seen.tolist(), foreground.tolist(), strict=True))

    def _add_counts(self, proposals: int, classified: int, deferred: int) -> None:
        self.frames += 1
        self.proposals += proposals
        self.classified += classified
        self.deferred += deferred

    def add_ledger(self, record: dict[str, Any]) -> None:
        """A line of ledger.jsonl."""
        for stage, entry in record["stages"].items():
            self._calls[stage] += entry["calls"]
            self._items[stage] += entry["items"]
            for quantity, spread in self._span[stage].items():
                spread.add(entry[quantity])

    def result(self) -> dict[str, Any]:
        """The figures; a ratio without a denominator is null.

        beta is classifications over those that tracking-by-detection would run (section V-A); N_go the frames in
        which a track is seen, averaged over tracks (section IV-C).
        """
        return {
            "schema": SCHEMA,
            "frames": self.frames,
            "proposals": self.proposals,
            "proposals_per_frame": _ratio(self.proposals, self.frames),
            "classifications": self.classified,
            "classifications_by_tracking_by_detection": self.proposals,
            "deferred": self.deferred,
            "beta": _ratio(self.classified, self.proposals),
            "tracks": self._life(foreground_only=False),
            "foreground_tracks": self._life(foreground_only=True),
            "energy_counts": {
                "E_seg": self._calls.get(SEGMENTATION, 0),
                "E_class": self._items.get(CLASSIFICATION, 0),
            },
            "stages": {stage: self._stage(stage) for stage in self._span},
        }

    def _life(self, *, foreground_only: bool) -> dict[str, Any]:
        tracks, frames = self.lives.totals(foreground_only=foreground_only)
        return {"count": tracks, "N_go": _ratio(frames, tracks)}

    def _stage(self, stage: str) -> dict[str, Any]:
        times = {
            quantity.replace("_ns", "_ms"): {
                "mean": spread.mean / 1e6,
                **{name: spread.quantile(q) / 1e6 for name, q in QUANTILES.items()},
                "max": spread.greatest / 1e6,
            }
            for quantity, spread in self._span[stage].items()
        }
        return {"calls": self._calls[stage], "items": self._items[stage], **times}


def summarise(run: Path) -> dict[str, Any]:
    """Summary of a run directory from its records, whether the run ended well, was killed or still goes on.

    Raises:
        MisuseError: there are no such records.
    """
    summary = Summary()
    for record in read_records(run / TRACKS, FRAME_SCHEMA):
        summary.add_frame(record)
    for record in read_records(run / LEDGER, LEDGER_SCHEMA, ignored={ENERGY_SCHEMA}):
        summary.add_ledger(record)
    return summary.result()


def _ratio(a: float, b: float) -> float | None:
    return a / b if b else None
