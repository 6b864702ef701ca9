"""`modt view`: a recorded run from above, as a page that plays it or as the picture of a frame."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from modt.cli import options
from modt.errors import MisuseError, ModtError

if TYPE_CHECKING:
    from modt.sources.stream import Stream
    from modt.viewer.recorded_run import RecordedRun

PLAYER, PICTURE = ".html", ".svg"


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("view", help="show a recorded run from above, with the points of its source")
    p.add_argument("run_directory", type=Path, metavar="RUN", help="directory written by modt replay or modt run")
    frame = "draw one frame as .svg, or begin a page there"
    p.add_argument("--frame", type=options.integer(0, 10**9, "the number of a frame"), metavar="N", help=frame)
    out = "FILE.html, a page that plays the run (default: RUN/view.html), or FILE.svg (with --frame: RUN/view-N.svg)"
    options.add_capture_option(p)
    truth = "labels to compare with, as for modt evaluate (default: those that lie with its source)"
    p.add_argument("--truth", type=Path, metavar="TRUTH", help=truth)
    p.add_argument("--out", type=Path, metavar="FILE", help=out)
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Write the page or the picture.

    Raises:
        MisuseError: no run, a frame that is not recorded, or a file of another kind.
        ModtError: the file cannot be written.
    """
    from modt.viewer.picture import MOST_CELLS, save_picture
    from modt.viewer.player import most_cells, save_player
    from modt.viewer.point_cells import Grid
    from modt.viewer.recorded_run import RecordedRun
    from modt.viewer.sweeps import sweeps

    directory, frame = arguments.run_directory, arguments.frame
    default = directory / (f"view{PLAYER}" if frame is None else f"view-{frame}{PICTURE}")
    out: Path = arguments.out or default
    if out.suffix not in (PLAYER, PICTURE):
        raise MisuseError(out, "no kind of picture", f"give a name that ends with {PLAYER} or {PICTURE}")
    recorded = RecordedRun.read(directory)
    at = 0 if frame is None else recorded.position(frame)
    mark_truth(recorded, directory, arguments.truth)
    whole = out.suffix == PLAYER
    numbers = recorded.numbers if whole else recorded.numbers[at : at + 1]
    stream, grid = source(recorded, arguments.capture), Grid(recorded.config)
    most = most_cells(len(numbers)) if whole else MOST_CELLS
    cells = None if stream is None else sweeps(numbers, stream, grid, most)
    if whole:
        save_player(out, recorded, at, grid.step_cm, cells)
    else:
        save_picture(out, recorded, at, grid.step_cm, None if cells is None else next(cells))
    print(f"{out} ({out.stat().st_size / 1e6:.1f} MB)")
    return 0


def mark_truth(recorded: RecordedRun, directory: Path, labels: Path | None) -> None:
    """Add to the frames what is true of them, by labels or by those that lie with the source of the run.

    Raises:
        MisuseError: labels are given that cannot be used.
    """
    from modt.evaluation.run_record import RunRecord
    from modt.evaluation.truth_files import labels_beside, open_truth
    from modt.viewer.truth_marks import truth_marks

    run = RunRecord.open(directory)
    found = labels or (labels_beside(run.stream) if run.stream else None)
    if found is None:
        return
    try:
        marks = truth_marks(run, open_truth(found, run.stream))
    except ModtError as error:
        if labels is not None:
            raise
        print(f"modt: without truth: {error}", file=sys.stderr)
        return
    for frame in recorded.frames:
        frame.update(marks[frame["frame"]])


def source(recorded: RecordedRun, capture: Sequence[tuple[str, str]]) -> Stream | None:
    """The stream that a run was made of, None where it is not found any more."""
    from modt.cli import assemble

    facts = recorded.facts["stream"]
    try:
        path = Path(facts["path"]) if facts["path"] else None
        stream = assemble.stream(assemble.Request(path=path, capture=capture))
    except ModtError as error:
        print(f"modt: without points: {error}", file=sys.stderr)
        return None
    if stream.info.name == facts["name"]:
        return stream
    print(f"modt: without points: {facts['name']} cannot be read again", file=sys.stderr)
    return None
