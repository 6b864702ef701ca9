"""`modt view`: a recorded run from above, as a page that plays it, a picture of a frame, or a film."""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from modt.cli import options
from modt.errors import MisuseError, ModtError
from modt_desk.cli.view_forms import FORMS, GIF, MP4, PICTURE, PLAYER, View

if TYPE_CHECKING:
    from modt.sources.stream import Stream
    from modt_desk.viewer.recorded_run import RecordedRun


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("view", help="show a recorded run from above, with the points of its source")
    p.add_argument("run_directory", type=Path, metavar="RUN", help="directory written by modt replay or modt run")
    which = p.add_mutually_exclusive_group()
    frame = "draw one frame, or begin there (default: a page at its first object, a film at its first frame)"
    which.add_argument("--frame", type=options.integer(0, 10**9, "the number of a frame"), metavar="N", help=frame)
    film = "make a film, RUN/view.mp4, or RUN/view.gif where ffmpeg is not installed"
    which.add_argument("--animate", action="store_true", help=film)
    track = "explain how the class of a track was decided (default: RUN/track-ID.html)"
    which.add_argument("--track", type=options.integer(0, 10**9, "the number of a track"), metavar="ID", help=track)
    out = (
        "FILE.html, a page that plays the run (default: RUN/view.html); of one frame FILE.svg (with --frame: "
        "RUN/view-N.svg) or FILE.png; a film, FILE.gif or FILE.mp4"
    )
    options.add_capture_option(p)
    truth = "labels to compare with, as for modt evaluate (default: those that lie with its source)"
    p.add_argument("--truth", type=Path, metavar="TRUTH", help=truth)
    p.add_argument("--out", type=Path, metavar="FILE", help=out)
    options.add_examples(
        p,
        "modt view RUN                                      a page that plays the run",
        "modt view RUN --frame 20 --out frame.png           one frame",
        "modt view RUN --track 40                           how the class of a track was decided",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Write the page, the picture or the film.

    Raises:
        MisuseError: no run, a frame that is not recorded, a file of another kind, or a missing extra.
        ModtError: the file cannot be written.
    """
    from modt_desk.viewer.recorded_run import RecordedRun
    from modt_desk.viewer.sweeps import Grid

    directory = arguments.run_directory
    if arguments.track is not None:
        return tell(arguments)
    out: Path = arguments.out or directory / default_name(arguments.frame, arguments.animate)
    if out.suffix not in FORMS:
        raise MisuseError(out, "no kind of picture", f"give a name that ends with {', '.join(FORMS)}")
    recorded = RecordedRun.read(directory)
    if arguments.frame is not None:
        at = recorded.position(arguments.frame)
    else:
        at = 0 if out.suffix in (GIF, MP4) else recorded.first_object
    stream = mark_truth(recorded, directory, arguments.truth, source(recorded, arguments.capture))
    if stream is None and recorded.live:
        print("modt: without points: a live source cannot be read again; --truth may have scans", file=sys.stderr)
    FORMS[out.suffix](View(recorded, at, stream, Grid(recorded.config), out))
    print(f"{out} ({out.stat().st_size / 1e6:.1f} MB)")
    return 0


def tell(arguments: argparse.Namespace) -> int:
    """Write the page of a track.

    Raises:
        MisuseError: no run, or no such track.
        ModtError: the file cannot be written.
    """
    from modt_desk.reporting.document import save
    from modt_desk.viewer.recorded_run import RecordedRun
    from modt_desk.viewer.track_page import rows_of, track_page, views

    directory, out = arguments.run_directory, arguments.out
    recorded = RecordedRun.read(directory)
    rows = rows_of(recorded, arguments.track)
    out = out or directory / f"track-{arguments.track}{PLAYER}"
    save(out, track_page(recorded, rows, views(recorded, rows, source(recorded, arguments.capture))))
    print(out)
    return 0


def default_name(frame: int | None, animate: bool) -> str:
    """Default name of the file."""
    if animate:
        return f"view{MP4 if shutil.which('ffmpeg') else GIF}"
    return f"view{PLAYER}" if frame is None else f"view-{frame}{PICTURE}"


def mark_truth(recorded: RecordedRun, directory: Path, labels: Path | None, stream: Stream | None) -> Stream | None:
    """Mark the frames with their truth, by the given labels or those beside the source of the run.

    Returns:
        the stream, of a live run the scans of its truth.

    Raises:
        MisuseError: labels are given that cannot be used.
    """
    from modt_desk.evaluation.run_record import RunRecord
    from modt_desk.evaluation.truth import by_stamp
    from modt_desk.evaluation.truth_files import labels_beside, open_truth
    from modt_desk.viewer.truth_marks import truth_marks

    try:
        run = RunRecord.open(directory)
        found = labels or (labels_beside(run.stream) if run.stream else None)
        if found is None:
            return stream
        truth = open_truth(found, run.stream)
        if recorded.live:
            truth = by_stamp(truth, {frame["frame"]: frame["stamp_s"] for frame in recorded.frames})
            stream = truth.scans
        marks = truth_marks(run, truth, stream)
    except ModtError as error:
        if labels is not None:
            raise
        print(f"modt: without truth: {error}", file=sys.stderr)
        return stream
    for frame in recorded.frames:
        frame.update(marks.get(frame["frame"], {}))
    return stream


def source(recorded: RecordedRun, capture: Sequence[tuple[str, str]]) -> Stream | None:
    """The stream of a run, None if it was live or cannot be found."""
    from modt.app import inputs
    from modt_desk.evaluation.run_record import LevelStream, recorded_mount

    if recorded.live:
        return None
    facts = recorded.facts["stream"]
    try:
        path = Path(facts["path"]) if facts["path"] else None
        stream = inputs.stream(inputs.Request(path=path, capture=capture))
    except ModtError as error:
        print(f"modt: without points: {error}", file=sys.stderr)
        return None
    if stream.info.name == facts["name"]:
        return LevelStream(stream, recorded_mount(recorded.facts))
    print(f"modt: without points: {facts['name']} cannot be read again", file=sys.stderr)
    return None
