"""`modt view`: a recorded run from above, as a page that plays it, a picture of a frame, or a film."""

from __future__ import annotations

import argparse
from pathlib import Path

from modt.cli import options


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("view", help="show a recorded run from above, with the points of its source")
    p.add_argument("run_directory", type=Path, metavar="RUN", help="directory written by modt replay or modt run")
    which = p.add_mutually_exclusive_group()
    frame = "draw one frame, or begin there (default: a page at its first object, a film at its first frame)"
    which.add_argument(
        "--frame", type=options.bounded(int, 0, 10**9, "the number of a frame"), metavar="N", help=frame
    )
    film = "make a film, RUN/view.mp4, or RUN/view.gif where ffmpeg is not installed"
    which.add_argument("--animate", action="store_true", help=film)
    track = "explain how the class of a track was decided (default: RUN/track-ID.html)"
    which.add_argument(
        "--track", type=options.bounded(int, 0, 10**9, "the number of a track"), metavar="ID", help=track
    )
    out = (
        "FILE.html, a page that plays the run (default: RUN/view.html); of one frame FILE.svg (with --frame: "
        "RUN/view-N.svg) or FILE.png; a film, FILE.gif or FILE.mp4"
    )
    options.add(p, "capture")
    truth = "labels to compare with, as for modt evaluate (default: those that lie with its source)"
    p.add_argument("--truth", type=Path, metavar="TRUTH", help=truth)
    left_out = "colour the points of no proposal by their kind: structure, low or sparse, overhead (in a page: key K)"
    p.add_argument("--left-out", action="store_true", help=left_out)
    p.add_argument("--out", type=Path, metavar="FILE", help=out)
    options.add_examples(
        p,
        "modt view RUN                                      a page that plays the run",
        "modt view RUN --frame 20 --out frame.png           one frame",
        "modt view RUN --frame 20 --left-out                what belongs to no proposal, and why",
        "modt view RUN --track 40                           how the class of a track was decided",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Write the page, the picture or the film, or the page of a track.

    Raises:
        MisuseError: no run, a frame or a track that is not recorded, a file of another kind, or a missing extra.
        ModtError: the file cannot be written.
    """
    from modt_viewer.view import default_name, save_track_page, save_view

    directory = arguments.run_directory
    capture = arguments.capture
    if arguments.track is not None:
        out = arguments.out or directory / f"track-{arguments.track}.html"
        save_track_page(directory, arguments.track, capture, out)
        print(out)
        return 0
    out = arguments.out or directory / default_name(arguments.frame, arguments.animate)
    save_view(directory, arguments.frame, arguments.truth, capture, out, left_out=arguments.left_out)
    print(f"{out} ({out.stat().st_size / 1e3:,.0f} kB)")
    return 0
