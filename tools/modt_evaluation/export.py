"""Exports of a recorded run in the formats of others; tracks as a CSV table have a row a track and frame."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from modt.classes import CLASS_NAMES
from modt.errors import MisuseError, install
from modt.sinks.kitti import KittiResults
from modt.sinks.output import LineFile, writing
from modt.sinks.records import BROKEN
from modt.sinks.tracks import BOX_KEYS, WORLD_KEYS
from modt.types import FrameResult
from modt_evaluation.nuscenes_results import results_of, scene_of, submission
from modt_evaluation.recorded_result import recorded_result, semantic_labels
from modt_evaluation.run_record import RunRecord, broken

T = TypeVar("T")
Frames = tuple[int, int | None]
Capture = Sequence[tuple[str, str]]
PLAIN = ("id", "state", "class", "viewed", "final", "proposal", "points", "age", "missed")
"""Columns that have their name from tracks.jsonl."""
KINDS = {
    **dict.fromkeys(("frame", "id", "proposal", "points", "age", "missed"), "int64"),
    **dict.fromkeys(("state", "class"), "string"),
    **dict.fromkeys(("viewed", "final"), "bool"),
}
"""Types of the columns in Parquet; the others are numbers of 64 bits."""
BLOCK_BYTES = 1 << 26
"""Size of the part of a table that is converted at once [bytes of CSV]."""
UNITS = {"yaw": "rad", "heading": "rad", "speed_mps": ""}  # other columns: m
NO_BOX = dict.fromkeys(BOX_KEYS)


def _column(key: str) -> str:
    unit = UNITS.get(key, "m")
    return f"{key}_{unit}" if unit else key


COLUMNS = (
    "frame",
    "stamp_s",
    *PLAIN,
    *(f"p_{name}" for name in CLASS_NAMES),
    *(f"box_{_column(key)}" for key in BOX_KEYS),
    *(f"world_{_column(key)}" for key in WORLD_KEYS),
)


def track_rows(record: dict[str, Any]) -> str:
    """The rows of a line of tracks.jsonl. Null becomes an empty cell, booleans 0 and 1.

    Raises:
        KeyError, TypeError: the record is incomplete.
    """
    when = (record["frame"], record["stamp_s"])
    return _text([(*when, *_cells(track)) for track in record["tracks"]])


def _cells(track: dict[str, Any]) -> list[Any]:
    plain = [int(track[key]) if isinstance(track[key], bool) else track[key] for key in PLAIN]
    box = track["box"] or NO_BOX
    world = track["world"]
    return [*plain, *track["posterior"], *(box[key] for key in BOX_KEYS), *(world[key] for key in WORLD_KEYS)]


def _text(rows: list[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


HEADER = _text([COLUMNS])
"""The first line of a table."""


@contextmanager
def whole(target: Path) -> Iterator[Path]:
    """A path to write to, which is renamed to the target at the end. A failure leaves nothing behind.

    Raises:
        ModtError: it cannot be written.
    """
    with writing(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        folder = TemporaryDirectory(prefix=".export-", dir=target.parent)
    with folder as name:
        partial = Path(name) / target.name
        yield partial
        with writing(target):
            partial.rename(target)


class Export:
    """The run, the frames and the points that are exported.

    Attributes:
        n_frames: number of frames exported so far.
    """

    def __init__(
        self, run: RunRecord, frames: Frames = (0, None), capture: Capture = (), *, points: bool = True
    ) -> None:
        self.run = run
        self.frames = frames
        self.capture = capture
        self.points = points
        self.n_frames = 0

    def results(self) -> Iterator[FrameResult]:
        """The results without points."""
        return self.each(recorded_result)

    def each(self, made_of: Callable[[dict[str, Any]], T]) -> Iterator[T]:
        """Apply a function to the record of each frame.

        Raises:
            MisuseError: there are none, or one is incomplete.
        """
        first, last = self.frames
        for place, record in self.run.records():
            try:
                wanted = first <= record["frame"] < (math.inf if last is None else last)
                made = made_of(record) if wanted else None
            except BROKEN as error:
                raise broken(place, error) from None
            if made is not None:
                self.n_frames += 1
                yield made
        if not self.n_frames:
            raise MisuseError(self.run.path, "holds none of these frames", "give other --frames")


def _mcap(export: Export, target: Path) -> None:
    """Write an MCAP file as the sink mcap:///FILE does."""
    try:
        from modt.sinks.foxglove_sinks import McapRecorder
        from modt.sinks.topics import WORLD_FRAME_ID, TopicOptions
    except ModuleNotFoundError as error:
        raise MisuseError("--mcap", f"needs {error.name}", install("foxglove")) from None
    results = _with_points(export) if export.points else export.results()
    lines = export.run.ledger_lines()
    with closing(McapRecorder(target, TopicOptions(world_frame_id=WORLD_FRAME_ID, points=export.points))) as file:
        for result in results:
            file.write(result)
            for line in lines.get(result.frame.index, ()):
                file.ledger(line)


def _with_points(export: Export) -> Iterator[FrameResult]:
    source = export.run.source(export.capture, export.frames)
    if source is None:
        raise MisuseError(export.run.path, "was live, its points are not recorded", "give --no-points")
    sweeps = iter(source)
    for result in export.results():
        index = result.frame.index
        sweep = next((sweep for sweep in sweeps if sweep.index == index), None)
        if sweep is None:
            remedy = "restore what the run read, or give --no-points"
            raise MisuseError(source.info.name, f"frame {index} cannot be read any more", remedy)
        yield replace(result, frame=replace(result.frame, points=sweep.points))


def _kitti(export: Export, target: Path) -> None:
    """Write a KITTI result file as a replay does."""
    source = export.run.source(export.capture, export.frames)
    with closing(KittiResults(target, source.info.camera if source else None)) as file:
        for result in export.results():
            file.write(result)


def _semantickitti(export: Export, target: Path) -> None:
    with writing(target):
        target.mkdir()
    for result in export.results():
        index = result.frame.index
        labels = semantic_labels(result.tracks, export.run.proposals(index)).tobytes()
        with writing(target):
            (target / f"{index:06d}.label").write_bytes(labels)


def _csv(export: Export, target: Path) -> None:
    with closing(LineFile[str](target)) as file:
        file.write(HEADER)
        for rows in export.each(track_rows):
            file.write(rows)


def _parquet(export: Export, target: Path) -> None:
    write_parquet(export, target, {})


def write_parquet(export: Export, target: Path, constants: Mapping[str, str]) -> None:
    """Write the table of --csv as Parquet, by parts. Columns of constants stand in front.

    Raises:
        MisuseError: Arrow is not installed.
        ModtError: the file cannot be written.
    """
    try:
        import pyarrow
        from pyarrow import csv as arrow
        from pyarrow import parquet
    except ModuleNotFoundError as error:
        raise MisuseError("--parquet", f"needs {error.name}", install("parquet")) from None
    text = target.with_suffix(".csv")
    _csv(export, text)
    kinds = {name: KINDS.get(name, "float64") for name in COLUMNS}
    named = {name: pyarrow.type_for_alias(kind) for name, kind in kinds.items()}
    schema = pyarrow.schema([*((name, pyarrow.string()) for name in constants), *named.items()])
    options = arrow.ConvertOptions(column_types=named)
    with writing(target), parquet.ParquetWriter(target, schema) as file:
        for part in arrow.open_csv(text, arrow.ReadOptions(block_size=BLOCK_BYTES), convert_options=options):
            first = [pyarrow.repeat(value, len(part)) for value in constants.values()]
            file.write_table(pyarrow.table([*first, *part.columns], schema))
    text.unlink()


def _nuscenes(export: Export, target: Path, task: str) -> None:
    """Write nuScenes' results of a task."""
    results = results_of(scene_of(export.run.stream), export.run.mount, export.results())
    export.n_frames = len(results)  # the key frames alone
    with writing(target):
        target.write_text(json.dumps(submission(results, task)), encoding="utf-8")


FORMS: dict[str, Callable[[Export, Path], None]] = {
    "mcap": _mcap,
    "kitti": _kitti,
    "semantickitti": _semantickitti,
    "csv": _csv,
    "parquet": _parquet,
    "nuscenes_detection": partial(_nuscenes, task="detection"),
    "nuscenes_tracking": partial(_nuscenes, task="tracking"),
}
