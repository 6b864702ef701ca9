"""`modt export`: a recorded run in the formats of others."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeVar

from modt.cli import options
from modt.errors import MisuseError, install

if TYPE_CHECKING:
    from modt.sources.stream import Stream
    from modt.types import FrameResult
    from modt_desk.evaluation.run_record import RunRecord

T = TypeVar("T")


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("export", help="write a recorded run in the formats of others")
    p.add_argument("directory", type=Path, metavar="RUN", help="directory of the run")
    form = p.add_mutually_exclusive_group(required=True)
    form.add_argument("--mcap", type=Path, metavar="FILE", help="ROS 2 messages, as of --sink mcap://")
    form.add_argument("--kitti", type=Path, metavar="FILE", help="KITTI tracking results")
    labels = "point labels (of replay --labels)"
    form.add_argument("--semantickitti", type=Path, metavar="DIR", help=labels)
    form.add_argument("--csv", type=Path, metavar="FILE", help="a row a track and frame")
    form.add_argument("--parquet", type=Path, metavar="FILE", help="the same as a Parquet table")
    options.add_frames_option(p)
    p.add_argument("--no-points", action="store_true", help="MCAP without points: needs no source")
    options.add_capture_option(p)
    options.add_examples(
        p,
        "modt export RUN --mcap run.mcap    for Foxglove, with the points of the source",
        "modt export RUN --csv tracks.csv   a table for pandas",
        "modt export RUN --kitti 0005.txt   results for KITTI's tracking evaluation",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Export, and print the name of what was written.

    Raises:
        MisuseError: no run, the target exists, or a part of the run that the format needs is missing.
        ModtError: it cannot be written.
    """
    from modt_desk.evaluation.run_record import RunRecord

    name = next(name for name in FORMS if getattr(arguments, name) is not None)
    target: Path = getattr(arguments, name)
    export = Export(RunRecord.open(arguments.directory), arguments)
    if target.exists():
        raise MisuseError(target, "exists already", "remove it, or give another name")
    with whole(target) as partial:
        FORMS[name](export, partial)
    print(f"{export.n_frames} frames: {target}")
    return 0


@contextmanager
def whole(target: Path) -> Iterator[Path]:
    """A path that takes the target's place once all is written; a failure leaves nothing.

    Raises:
        ModtError: it cannot be written.
    """
    from modt.sinks.output import writing

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
        n_frames: exported so far.
    """

    def __init__(self, run: RunRecord, arguments: argparse.Namespace) -> None:
        self.run, self.points, self.n_frames = run, not arguments.no_points, 0
        self._frames, self._capture = arguments.frames, arguments.capture

    def source(self) -> Stream | None:
        """The stream that the run read, opened again; None where it was live.

        Raises:
            MisuseError: it is gone.
        """
        from modt.app.inputs import Request, stream
        from modt_desk.evaluation.run_record import LevelStream

        if self.run.live:
            return None
        read = stream(Request(path=self.run.stream, capture=self._capture, frames=self._frames))
        return LevelStream(read, self.run.mount)

    def results(self) -> Iterator[FrameResult]:
        """The results without points."""
        from modt_desk.evaluation.recorded_result import recorded_result

        return self.each(recorded_result)

    def each(self, made_of: Callable[[dict[str, Any]], T]) -> Iterator[T]:
        """Apply a function to the record of each frame.

        Raises:
            MisuseError: there are none, or one is incomplete.
        """
        from modt.sinks.records import BROKEN
        from modt_desk.evaluation.run_record import broken

        first, last = self._frames
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
        from modt.sinks.mcap_file import McapFile
    except ModuleNotFoundError as error:
        raise MisuseError("--mcap", f"needs {error.name}", install("foxglove")) from None
    results = _with_points(export) if export.points else export.results()
    lines = export.run.ledger_lines()
    with closing(McapFile(target, points=export.points)) as file:
        for result in results:
            file.write(result)
            for line in lines.get(result.frame.index, ()):
                file.ledger(line)


def _with_points(export: Export) -> Iterator[FrameResult]:
    source = export.source()
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
    from modt.sinks.kitti import KittiResults

    source = export.source()
    with closing(KittiResults(target, source.info.camera if source else None)) as file:
        for result in export.results():
            file.write(result)


def _semantickitti(export: Export, target: Path) -> None:
    from modt.sinks.labels import PointLabels
    from modt_desk.evaluation.recorded_result import semantic_labels

    labels = PointLabels(target)
    for result in export.results():
        index = result.frame.index
        labels.write_labels(index, semantic_labels(result.tracks, export.run.proposals(index)))


def _csv(export: Export, target: Path) -> None:
    from modt.sinks.output import LineFile
    from modt_desk.cli.export_table import HEADER, track_rows

    with closing(LineFile[str](target)) as file:
        file.write(HEADER)
        for rows in export.each(track_rows):
            file.write(rows)


def _parquet(export: Export, target: Path) -> None:
    """The table of --csv, by the reader of Arrow."""
    try:
        from pyarrow import csv, parquet
    except ModuleNotFoundError as error:
        raise MisuseError("--parquet", f"needs {error.name}", install("parquet")) from None
    from modt.sinks.output import writing

    text = target.with_suffix(".csv")
    _csv(export, text)
    table = csv.read_csv(text)
    with writing(target):
        parquet.write_table(table, target)


FORMS: dict[str, Callable[[Export, Path], None]] = {
    "mcap": _mcap,
    "kitti": _kitti,
    "semantickitti": _semantickitti,
    "csv": _csv,
    "parquet": _parquet,
}
