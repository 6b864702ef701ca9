"""`modt profile fit`: the profile of an unknown sensor, from a recording of it."""

from __future__ import annotations

import argparse
from pathlib import Path
from shlex import quote

from modt.cli import options
from modt.errors import MisuseError, ModtError

MOST_FRAMES = 1000
"""Frames of a recording of which the sweeps are taken."""


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("fit", help="fit a profile to a recording of an unknown sensor")
    stream = "a recording, as for modt replay; best of a drive that moves"
    p.add_argument("path", type=Path, metavar="RECORDING", help=stream)
    options.add(p, "capture")
    p.add_argument("--name", metavar="NAME", help="name of the profile (default: that of the recording)")
    p.add_argument("--out", type=Path, metavar="FILE", help="profile to write (default: NAME.yaml)")
    count = options.bounded(int, 1, MOST_FRAMES, "a count")
    spread = f"number of sweeps, spread evenly over its first {MOST_FRAMES} frames"
    p.add_argument("--sweeps", type=count, default=20, metavar="N", help=f"{spread} (default: %(default)s)")
    options.add_examples(
        p,
        "modt profile fit DRIVE --out my-robot.yaml       beams, range, height and tilt of a sensor",
        "modt profile fit a.pcap --capture model=VLP-16   of a capture",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Fit a profile and write it."""
    from modt.sinks.output import writing
    from modt.sources.recognise import open_stream
    from modt_profiling.sensor_fit.findings import doubts, profile_text
    from modt_profiling.sensor_fit.fit import FINDERS, find_class_frequency, fit, spread_sweeps

    stream = open_stream(arguments.path, capture=dict(arguments.capture))
    name = arguments.name or stream.info.name.replace(" ", "-")
    out: Path = arguments.out or Path(f"{name}.yaml")
    if out.exists():
        raise MisuseError(out, "exists already", "remove it, or give another --out")
    recording = spread_sweeps(stream, arguments.sweeps, MOST_FRAMES)
    if not sum(map(len, recording.sweeps)):
        raise ModtError(stream.info.name, "no usable frame", "give a stream that modt replay can work on")
    _, findings = fit(recording, (*FINDERS, find_class_frequency))
    swept = f"{len(recording.sweeps)} of {len(recording.stamps_s)} sweeps of {stream.info.name}"
    text = profile_text(f"{name}, fitted by `modt profile fit` to {swept}.", findings)
    with writing(out):
        out.write_text(text, encoding="utf-8")
    print(text)
    for doubt in doubts(findings):
        print(f"  to be checked: {doubt}")
    print(f"  written to {out}; use it as --profile {quote(str(out))}")
    return 0
