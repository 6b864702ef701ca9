"""A recorded run, read back frame by frame beside its truth and its source."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from modt.app import inputs
from modt.energy.ledger import LedgerLine
from modt.energy.windows import EnergyWindow
from modt.errors import MisuseError
from modt.geometry import FieldOfView
from modt.placement import LEVEL, Mount
from modt.profile import parse, to_yaml
from modt.sinks.records import BROKEN
from modt.sinks.run_directory import LEDGER, RUN, TRACKS
from modt.sinks.tracks import SCHEMA
from modt.sources.stream import Reading, Stream
from modt.types import Float32, Frame, Int, Self
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.recorded_result import recorded_result
from modt_evaluation.truth import Truth
from modt_profiling.reporting.records import read_ledger, read_records, read_windows
from modt_profiling.reporting.run_sums import GIVE, run_facts


class LevelStream:
    """The frames of a stream, and its camera, for level points."""

    def __init__(self, stream: Stream, mount: Mount) -> None:
        self._stream = stream
        self._mount = mount
        camera = stream.info.camera
        self.info = replace(stream.info, camera=camera and mount.camera(camera))
        self.faults = stream.faults

    @property
    def reading(self) -> Reading:
        """Counts of what was read."""
        return self._stream.reading

    def __iter__(self) -> Iterator[Frame]:
        """The frames."""
        return map(self._mount.level, self._stream)

    def between(self, first: int, last: int | None) -> Self:
        """The frames with first <= index < last."""
        return type(self)(self._stream.between(first, last), self._mount)


class FramesByNumber:
    """Gives frames by ascending number and skips those between."""

    def __init__(self, stream: Stream) -> None:
        self._stream = stream
        self._frames: Iterator[Frame] | None = None  # begins with the first number that is asked for
        self._next: Frame | None = None

    def get(self, number: int) -> Frame | None:
        """The frame, None if the stream does not hold it."""
        if self._frames is None:
            self._frames = iter(self._stream.between(number, None))
            self._next = next(self._frames, None)
        while self._next is not None and self._next.index < number:
            self._next = next(self._frames, None)
        return self._next if self._next is not None and self._next.index == number else None

    def points(self, number: int, place: str) -> Float32:
        """(N, 4) points of a frame whose record is at a place.

        Raises:
            MisuseError: the stream does not hold it.
        """
        frame = self.get(number)
        if frame is None:
            cause = f"{self._stream.info.name} has no sweep {number} that can be read"
            raise MisuseError(place, cause, f"restore it, or {WRONG_TRUTH}")
        return frame.points


LABELS = "labels"
"""Folder of the labels that replay --labels writes."""
WRONG_TRUTH = "give the truth of the run's own recording"
Record = tuple[str, dict[str, Any]]
"""File and line of a record, and the record of a frame."""
Proposed = Callable[[dict[str, Any], Float32], Int]
"""(N,) proposal of each point, NONE where it belongs to none, by the record of a frame and its (N, 4) points."""


@dataclass(frozen=True)
class RunRecord:
    """The directory of a run."""

    path: Path
    facts: dict[str, Any]  # content of run.yaml
    stream: Path | None  # path of its scans, None for the embedded stream
    sensor: str  # name of its profile
    mount: Mount  # mount of its sensor

    @classmethod
    def open(cls, path: Path) -> RunRecord:
        """The run of a directory.

        Raises:
            MisuseError: it is none.
        """
        facts = run_facts(path)
        try:
            _ = facts["mode"], facts["fov"], facts["stream"]["name"]
            stream = facts["stream"]["path"]
            sensor = Path(facts["recognition"]["used"]).stem
            placed = facts["profile"]["sensor"]
            several = "sensors" in facts["profile"]  # the frames of their robot are level
            mount = LEVEL if several else Mount.of(placed["roll_deg"], placed["pitch_deg"])
            return cls(path, facts, Path(stream) if stream else None, sensor, mount)
        except (TypeError, KeyError) as error:
            raise MisuseError(path / RUN, f"describes no run ({error})", GIVE) from None

    @property
    def live(self) -> bool:
        """Whether its source was live, so that it cannot be read again."""
        return self.stream is None and bool(self.facts.get("service", False))

    def source(
        self, capture: Sequence[tuple[str, str]], frames: tuple[int, int | None] = (0, None)
    ) -> LevelStream | None:
        """The stream that the run read, opened again and turned level. None for a live one.

        Raises:
            MisuseError: it is gone.
        """
        if self.live:
            return None
        recorded = self.facts["profile"]
        config = parse(to_yaml(recorded), self.path / RUN) if "sensors" in recorded else None
        request = inputs.Request(path=self.stream, capture=capture, frames=frames)
        return LevelStream(inputs.stream(request, config), self.mount)

    def records(self) -> Iterator[Record]:
        """The record of every frame.

        Raises:
            MisuseError: the run is empty.
        """
        number = 0
        for number, record in enumerate(read_records(self.path / TRACKS, SCHEMA), 1):
            yield f"{self.path / TRACKS}:{number}", record
        if not number:
            raise MisuseError(self.path / TRACKS, "no frames are recorded", "give the directory of a longer run")

    def ledger_lines(self) -> dict[int | None, list[LedgerLine | EnergyWindow]]:
        """The lines of the ledger by the frame after which each was written; none where no ledger was kept."""
        path = self.path / LEDGER
        lines: defaultdict[int | None, list[LedgerLine | EnergyWindow]] = defaultdict(list)
        if path.exists():
            for line in read_ledger(path):
                lines[line.frame].append(line)
            for window in read_windows(path):
                lines[window.frames[1]].append(window)
        return lines

    def frames(
        self,
        truth: Truth,
        proposed: Proposed | None = None,
        stream: Stream | None = None,
        records: Iterable[Record] | None = None,
    ) -> Iterator[JudgedFrame]:
        """Every recorded frame beside its truth.

        Args:
            truth: labels of the recording of the run.
            proposed: assigns points to proposals; None: the labels that replay --labels has written.
            stream: the recording; None: the scans of the truth, or those of all sensors of the robot.
            records: records of labelled frames; None for all records.

        Raises:
            MisuseError: the run is of another recording, empty or without labels, or a record is broken.
        """
        stream = truth.scans if stream is None else stream
        if stream is None and "sensors" in self.facts["profile"]:
            stream = self.source(())
        if stream is None:
            raise MisuseError(self.path, "its scans are not found", "bring them back to where the run read them")
        fov = self._fov(stream)
        sweeps = FramesByNumber(stream)
        for place, record in self.records() if records is None else records:
            try:
                result = recorded_result(record)
                n_classified = int(record["classifications"])
            except BROKEN as error:
                raise broken(place, error) from None
            index = result.frame.index
            labels = truth.frames.get(index)
            if labels is None and truth.key_frames:
                continue
            if labels is None:
                cause = f"frame {index} is not in the truth, which has {len(truth.frames)} frames"
                raise MisuseError(place, cause, WRONG_TRUTH)
            points = sweeps.points(index, place)
            proposals = self.proposals(index) if proposed is None else proposed(record, points)
            if len(proposals) != len(points):
                cause = f"{len(proposals)} labels for a scan of {len(points)} points"
                raise MisuseError(self._labels(index), cause, WRONG_TRUTH)
            judged = JudgedFrame.of_result(result, labels, fov)
            yield replace(judged, points=points, proposal=proposals, classified=n_classified)

    def _fov(self, stream: Stream) -> FieldOfView:
        """The field of view of the run.

        Raises:
            MisuseError: it is that of a camera, which is not found.
        """
        if self.facts["fov"] != "camera":
            return FieldOfView()
        if stream.info.camera is None:
            raise MisuseError(self.path, "the camera of its field of view is not found", "restore the calibration")
        return FieldOfView.of_camera(stream.info.camera)

    def proposals(self, index: int) -> Int:
        """(N,) proposal of each point of a frame, NONE where it belongs to none.

        Raises:
            MisuseError: the run was made without --labels.
        """
        path = self._labels(index)
        try:
            return (np.fromfile(path, np.uint32) >> 16).astype(np.int64) - 1
        except OSError as error:
            cause = f"cannot be read ({error.strerror})"
            raise MisuseError(path, cause, "run it again with `modt replay --labels`") from None

    def _labels(self, index: int) -> Path:
        return self.path / LABELS / f"{index:06d}.label"


def broken(place: str, error: Exception) -> MisuseError:
    """The error of an incomplete record."""
    return MisuseError(place, f"no record of a frame ({error!r})", "run it again")
