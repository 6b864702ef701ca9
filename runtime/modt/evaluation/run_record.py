"""A recorded run, read back frame by frame beside its truth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from modt.classes import CLASS_NAMES
from modt.errors import MisuseError, ModtError
from modt.evaluation.frame import JudgedFrame
from modt.evaluation.truth import Truth
from modt.geometry import FieldOfView
from modt.profile import from_yaml
from modt.sinks.records import read_records
from modt.sinks.run_directory import RUN, TRACKS
from modt.sinks.tracks import SCHEMA
from modt.sources.scan_file import read_scan
from modt.types import Float32, Float64, Int

LABELS = "labels"


@dataclass(frozen=True, slots=True)
class RunRecord:
    """The directory of a run."""

    path: Path
    stream: Path | None  # where its scans lay, None for the embedded stream
    fov: str  # camera or full
    sensor: str  # name of its profile

    @classmethod
    def open(cls, path: Path) -> RunRecord:
        """The run of a directory.

        Raises:
            MisuseError: it is none, or was made without --labels.
        """
        described = path / RUN
        try:
            facts = from_yaml(described.read_text(encoding="utf-8"), described)
            stream, fov, sensor = facts["stream"]["path"], facts["fov"], facts["recognition"]["used"]
        except (OSError, UnicodeDecodeError, TypeError, KeyError) as error:
            raise MisuseError(described, f"describes no run ({error})", "give the directory of a run") from None
        if not (path / LABELS).is_dir():
            raise MisuseError(path, "holds no point labels of its own", "run it again with `modt replay --labels`")
        return cls(path, Path(stream) if stream else None, fov, Path(sensor).stem)

    def frames(self, truth: Truth) -> Iterator[JudgedFrame]:
        """Every recorded frame beside its truth.

        Raises:
            MisuseError: the run is of another recording or empty, or a record is broken.
        """
        if truth.scans is None:
            raise MisuseError(self.path, "its scans are not found", "bring them back to where the run read them")
        camera = truth.scans.info.camera
        if self.fov == "camera" and camera is None:
            raise MisuseError(self.path, "the camera of its field of view is not found", "restore the calibration")
        fov = FieldOfView.of_camera(camera) if self.fov == "camera" and camera is not None else FieldOfView()
        scans = {scan.index: scan.path for scan in truth.scans.scans}
        number = 0
        for number, record in enumerate(read_records(self.path / TRACKS, SCHEMA), 1):
            place = f"{self.path / TRACKS}:{number}"
            try:
                index = int(record["frame"])
                found = _found(record)
            except (KeyError, TypeError, ValueError, IndexError) as error:
                raise MisuseError(place, f"no record of a frame ({error!r})", "run it again") from None
            labels, scan = truth.frames.get(index), scans.get(index)
            if labels is None or scan is None:
                cause = f"frame {index} is not in the truth, which has {len(truth.frames)} frames"
                raise MisuseError(place, cause, "give the truth of the run's own recording")
            try:
                points, _ = read_scan(scan)
            except ModtError as error:
                raise MisuseError(scan, error.cause, "restore the scan") from None
            yield JudgedFrame(index, points, self._proposals(index, points), *found, labels, fov)
        if not number:
            raise MisuseError(self.path / TRACKS, "no frames are recorded", "give the directory of a longer run")

    def _proposals(self, index: int, points: Float32) -> Int:
        """(N,) proposal of each point."""
        path = self.path / LABELS / f"{index:06d}.label"
        try:
            labels = np.fromfile(path, np.uint32)
        except OSError as error:
            cause = f"cannot be read ({error.strerror})"
            raise MisuseError(path, cause, "run it again with `modt replay --labels`") from None
        if len(labels) != len(points):
            cause = f"{len(labels)} labels for a scan of {len(points)} points"
            raise MisuseError(path, cause, "give the truth of the run's own recording")
        return (labels >> 16).astype(np.int64) - 1


def _found(record: dict[str, Any]) -> tuple[int, int, Int, Int, Int, Float64]:
    """Proposals and those classified; identity, proposal, class and posterior of the tracks that are seen."""
    n_proposals, n_classified = int(record["proposals"]), int(record["classifications"])
    seen = [track for track in record["tracks"] if track["proposal"] is not None]
    said = [CLASS_NAMES.index(track["class"]) for track in seen]
    posterior = np.array([track["posterior"] for track in seen], np.float64).reshape(-1, len(CLASS_NAMES))
    ids, proposals = (np.array([track[key] for track in seen], np.int64) for key in ("id", "proposal"))
    if len(proposals) and not 0 <= proposals.min() <= proposals.max() < n_proposals:
        raise ValueError("a track's proposal is none of the frame's")
    return n_proposals, n_classified, ids, proposals, np.array(said, np.int64), posterior
