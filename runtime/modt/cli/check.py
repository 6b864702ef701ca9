"""`modt check`: find out beforehand what will not work here, and print the remedies."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from modt import host
from modt.cli import options

if TYPE_CHECKING:
    from modt.config.mounted_sensor import MountedSensor
    from modt.sources.live.live_stream import LiveStream


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("check", help="check this machine, and a sensor, for modt run; print remedies")
    source = "address of the sensor to listen to, or a recording (default: none)"
    p.add_argument("source", nargs="?", metavar="SOURCE", help=source)
    options.add(p, "profile", "core", "out")
    options.add_examples(
        p,
        "modt check                                this machine, with the default profile",
        "modt check velodyne:// --profile vlp-16   and whether that sensor sends",
        "modt check --profile robot.yaml           and whether each sensor of a robot sends",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print one line for each check; returns 0 if none fails, else 1."""
    cores = host.other_cores(arguments.core)
    pinned = host.pin_to_core(arguments.core)
    # NumPy is imported from here on, after the process is pinned.
    from modt import profile
    from modt.app import assembly, checks
    from modt.app.inputs import live_sensors, live_source
    from modt.energy.meters.discovery import discover

    config = profile.load(arguments.profile)
    limits = config.classification
    found = [
        checks.core(pinned),
        checks.governor(pinned),
        *checks.permissions(),
        checks.meters(discover(config.energy)),
        checks.kernels(lambda: assembly.chosen_kernels(config.segmentation.kernels).name),
        checks.model(limits, lambda: assembly.network(limits, config.sensor).facts()),
        checks.near(config.sensor),
        checks.disk(arguments.out, config),
        checks.clock(),
    ]
    if arguments.source is not None and not config.sensors:
        found += checks.sensor(lambda: live_source(arguments.source, cores)[0], config=config)

    def opened(mounted: MountedSensor) -> LiveStream:
        """The live stream of one of the profile's sensors."""
        return live_sensors([mounted], arguments.source or "", cores)[0]

    for mounted in config.sensors:
        of_sensor = checks.sensor(partial(opened, mounted), config=assembly.sensor_profile(mounted))
        found += [replace(finding, subject=f"{mounted.name} {finding.subject}") for finding in of_sensor]
    for finding in found:
        print(finding)
    return int(any(finding.level == checks.FAIL for finding in found))
