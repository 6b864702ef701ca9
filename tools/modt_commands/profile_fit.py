"""`modt profile fit`: the profile of an unknown sensor, from a recording of it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from modt.cli import options
from modt.errors import MisuseError, ModtError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from modt.config import ProfileConfig
    from modt_profiling.sensor_fit.findings import Finding, Recording

MOST_FRAMES = 1000
"""Frames of a recording of which the sweeps are taken."""
MIN_PROPOSALS = 1000
"""Least number of proposals for a reliable frequency of the classes."""


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("fit", help="fit a profile to a recording of an unknown sensor")
    stream = "KITTI drive, sequence, folder of .bin, .pcd or .ply scans, or PCAP file; best of a drive that moves"
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


def class_frequencies(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """The frequency of the classes among the proposals of a recording, as the decision estimates it."""
    from modt.app import assembly
    from modt.geometry import FieldOfView
    from modt.types import Frame
    from modt_profiling.sensor_fit.findings import Finding

    pipeline = assembly.pipeline(assembly.MODES["conventional"], config, FieldOfView())
    found = 0
    for number, points in enumerate(recording.sweeps):
        found += len(pipeline.step(Frame(number, recording.stamps_s[0] + number, points)).proposals)
    frequency = tuple(round(float(share), 4) for share in pipeline.decision.frequency[1:])
    evidence = f"cars, pedestrians, cyclists among {found} proposals, by their posteriors"
    yield Finding("decision", "frequency", frequency, evidence, reliable=found >= MIN_PROPOSALS)


def run(arguments: argparse.Namespace) -> int:
    """Fit a profile and write it."""
    from itertools import islice

    from modt.sinks.output import writing
    from modt.sources.recognise import open_stream
    from modt_profiling.sensor_fit.findings import Recording, doubts, profile_text
    from modt_profiling.sensor_fit.fit import FINDERS, fit

    stream = open_stream(arguments.path, capture=dict(arguments.capture))
    name = arguments.name or stream.info.name.replace(" ", "-")
    out: Path = arguments.out or Path(f"{name}.yaml")
    if out.exists():
        raise MisuseError(out, "exists already", "remove it, or give another --out")
    n_frames = stream.info.n_frames
    if n_frames is None:
        n_frames = sum(1 for _ in islice(stream, MOST_FRAMES))
    step = max(1, min(n_frames, MOST_FRAMES) // arguments.sweeps)
    stamps_s = []
    sweeps = []
    for number, frame in enumerate(islice(stream, step * arguments.sweeps)):
        stamps_s.append(frame.stamp_s)
        if number % step == 0:
            sweeps.append(frame.points[(frame.points[:, :2] != 0).any(axis=1)])
    if not sum(map(len, sweeps)):
        raise ModtError(stream.info.name, "no usable frame", "give a stream that modt replay can work on")
    _, findings = fit(Recording(sweeps, stamps_s), (*FINDERS, class_frequencies))
    title = f"{name}, fitted by `modt profile fit` to {len(sweeps)} of {len(stamps_s)} sweeps of {stream.info.name}."
    text = profile_text(title, findings)
    with writing(out):
        out.write_text(text, encoding="utf-8")
    print(text)
    for doubt in doubts(findings):
        print(f"  to be checked: {doubt}")
    print(f"  written to {out}; use it as --profile {out}")
    return 0
