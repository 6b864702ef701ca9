"""`modt export`: a recorded run in the formats of others."""

from __future__ import annotations

import argparse
from pathlib import Path

from modt.cli import options
from modt.errors import MisuseError


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("export", help="write a recorded run in the formats of others")
    p.add_argument("directory", type=Path, metavar="RUN", help="directory of the run")
    form = p.add_mutually_exclusive_group(required=True)
    form.add_argument("--mcap", type=Path, metavar="FILE", help="write ROS 2 messages, as --sink mcap:// does")
    form.add_argument("--kitti", type=Path, metavar="FILE", help="write KITTI tracking results")
    labels = "write point labels (of a run of replay --labels)"
    form.add_argument("--semantickitti", type=Path, metavar="DIR", help=labels)
    form.add_argument("--csv", type=Path, metavar="FILE", help="write a table with a row for each track and frame")
    form.add_argument("--parquet", type=Path, metavar="FILE", help="write the same table as Parquet")
    for task in ("detection", "tracking"):
        what = f"write nuScenes' results of {task} (of a run of one of its scenes)"
        form.add_argument(f"--nuscenes-{task}", type=Path, metavar="FILE", help=what)
    options.add_frames_option(p)
    p.add_argument("--no-points", action="store_true", help="write MCAP without points, which needs no source")
    options.add(p, "capture")
    options.add_examples(
        p,
        "modt export RUN --mcap run.mcap    for Foxglove, with the points of the source",
        "modt export RUN --csv tracks.csv   a table for pandas",
        "modt export RUN --kitti 0005.txt   results for KITTI's tracking evaluation",
        "modt export RUN --nuscenes-tracking results.json   for nuScenes' devkit",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Export, and print the name of what was written.

    Raises:
        MisuseError: no run, the target exists, or a part of the run that the format needs is missing.
        ModtError: it cannot be written.
    """
    from modt_evaluation.export import FORMS, Export, whole
    from modt_evaluation.run_record import RunRecord

    name = next(name for name in FORMS if getattr(arguments, name) is not None)
    target: Path = getattr(arguments, name)
    export = Export(
        RunRecord.open(arguments.directory), arguments.frames, arguments.capture, points=not arguments.no_points
    )
    if target.exists():
        raise MisuseError(target, "exists already", "remove it, or give another name")
    with whole(target) as partial:
        FORMS[name](export, partial)
    print(f"{export.n_frames} frames: {target}")
    return 0
