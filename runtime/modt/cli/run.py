"""`modt run`: follow a live source for as long as it runs."""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from modt import host
from modt.cli import options
from modt.cli.command import INTERRUPTED

if TYPE_CHECKING:
    from modt.app.loop import Service
    from modt.app.status import Status
    from modt.sinks.recording import RecordingHealth

log = logging.getLogger(__name__)


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("run", help="follow a live source: the service of a robot")
    source = "address of a sensor, or a recording to play: PATH, PATH?loop=yes (default: a synthetic stream)"
    p.add_argument("source", nargs="?", default="", metavar="SOURCE", help=source)
    options.add(p, "sink")
    view = "show the run to browsers at http://HOST:PORT/ (default: 127.0.0.1:8766, which no other machine reaches)"
    p.add_argument("--view", nargs="?", const="", metavar="HOST:PORT", help=view)
    options.add(p, "profile", "core", "mode", "odometry", "out")
    p.add_argument("--metrics", type=Path, metavar="FILE", help="file of metrics for Prometheus")
    options.add_examples(
        p,
        "modt run velodyne://                               a Velodyne that sends to port 2368 of this machine",
        "modt run ouster://os-122250001234.local --view     an Ouster, shown to a browser on this machine",
        "modt run hesai://192.168.1.201                     the Hesai at an address, asked for its calibration",
        "modt run livox://                                  a Livox Mid-360 that sends to port 56301",
        "modt run robosense://                              a RoboSense that sends to port 6699",
        "modt run ros2:///points --odometry ros2:///odom    topics of ROS 2",
        "modt run 'DRIVE?loop=yes' --sink foxglove://       a recording as if it were live",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Follow; SIGTERM ends it with exit status 0, SIGINT with 130, both with complete records."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # there is nothing to reload yet; the loop handles later ones
    cores = host.other_cores(arguments.core)
    pinned = host.pin_to_core(arguments.core)
    # NumPy is imported from here on, after the process is pinned.
    from modt.app.account import closing_lines
    from modt.app.log_output import LogOutput
    from modt.app.systemd import notifier_of

    notifier = notifier_of(os.environ)
    with host.threads_on(cores):
        output = LogOutput()
    with closing(output):
        refusals = host.take_real_time_priority()
        for refusal in refusals:
            log.warning("%s", refusal)
        # The receiver and the writers start their threads here, on the cores that the loop leaves free.
        with host.threads_on(cores):
            loop = _service(arguments, cores, pinned, refusals)
        loop.writers["log"] = output.writer
        status = loop.run(notifier)["status"]
        for line in closing_lines(loop.summary["read"]):
            output.say(f"modt: {line}")
        output.say(f"modt: {_last_words(status, loop.recording.health(), arguments.out)}")
    return INTERRUPTED if loop.stop.signal == "SIGINT" else 0


def _service(
    arguments: argparse.Namespace, cores: frozenset[int] | None, pinned: int | None, refusals: Sequence[str]
) -> Service:
    """The service that was asked for; its receiver runs on `cores`."""
    from modt.app.build import service
    from modt.app.inputs import Request, live_source
    from modt.schemes import open_sinks

    source, path = live_source(arguments.source, cores, arguments.profile)
    sinks = open_sinks([*arguments.sink, *([] if arguments.view is None else [f"view://{arguments.view}"])])
    request = replace(Request.of(arguments), path=path)
    command = ["modt", *sys.argv[1:]]
    return service(request, source, sinks, arguments.out, arguments.metrics, pinned, command, refusals)


def _last_words(status: Status, recording: RecordingHealth, out: Path) -> str:
    """Frames, rate and power of a service that has ended, and whether its records are whole."""
    from modt.app.status import one_line

    records = f"records in {out}" if recording.parts else "nothing is recorded"
    if recording.lost_lines:
        records += f", {recording.lost_lines} lines are lost"
    if recording.failing:
        records += f": {recording.failing}"
    return f"{status.counts.frames} frames; {one_line(status)}; {records}"
