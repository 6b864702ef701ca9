"""`modt simulate`: write a synthetic drive as a KITTI raw drive with SemanticKITTI labels."""

from __future__ import annotations

import argparse
from pathlib import Path

from modt.cli import options
from modt.errors import MisuseError, ModtError


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("simulate", help="write a synthetic drive with its ground truth")
    p.add_argument("--scene", default="street", metavar="NAME", help="name of the scene (default: %(default)s)")
    p.add_argument("--sensor", default="hdl-64e", metavar="NAME", help="name of the sensor (default: %(default)s)")
    p.add_argument("--seconds", type=float, default=10.0, metavar="S", help="duration [s] (default: %(default)g)")
    p.add_argument("--seed", type=int, default=0, metavar="K", help="random seed (default: %(default)s)")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="directory in which the drive is written")
    p.add_argument("--all-around", action="store_true", help="annotate objects on all sides, not only in the camera")
    p.add_argument("--distort", action="store_true", help="keep the distortion of scans by the motion of the sensor")
    options.add_examples(
        p,
        "modt simulate --sensor vlp-16 --out sim                              a street, ten seconds",
        "modt simulate --scene corridor --sensor mid-360 --seed 3 --out sim   indoors",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Simulate.

    Raises:
        MisuseError: no such scene or sensor, or there is a drive already.
        ModtError: the drive cannot be written.
    """
    from modt_simulation.kitti_raw import DATE, DriveWriter
    from modt_simulation.synthetic_stream import CAMERA, SyntheticStream

    out: Path = arguments.out
    if (out / DATE).exists() or (out / "sequences").exists():
        raise MisuseError(out, "contains a drive already", "give another --out")
    stream = SyntheticStream(
        arguments.scene, arguments.sensor, arguments.seconds, arguments.seed, distort=arguments.distort
    )
    try:
        writer = DriveWriter(out, CAMERA, all_around=arguments.all_around)
        for frame, truth in stream.sweeps():
            writer.write(frame, truth)
        writer.close()
    except OSError as error:
        remedy = "free or unlock the disk, or give another --out"
        raise ModtError(out, f"cannot be written ({error.strerror or error})", remedy) from None
    print(f"KITTI raw drive: {writer.drive}\nSemanticKITTI sequence: {writer.sequence}")
    print(f"next: modt replay {writer.drive} --profile {arguments.sensor}")
    return 0
