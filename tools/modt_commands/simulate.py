"""`modt simulate`: write a synthetic drive as a KITTI raw drive with SemanticKITTI labels."""

from __future__ import annotations

import argparse
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from modt.cli import options
from modt.errors import MisuseError, ModtError

if TYPE_CHECKING:
    from modt_simulation.kitti_raw import DriveWriter
    from modt_simulation.synthetic_stream import SyntheticStream


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser("simulate", help="write a synthetic drive with its ground truth")
    p.add_argument("--scene", default="street", metavar="NAME", help="name of the scene (default: %(default)s)")
    p.add_argument("--sensor", default="hdl-64e", metavar="NAME", help="name of the sensor (default: %(default)s)")
    several = "profile of a robot with several sensors, whose profiles name models; each has a drive in DIR/NAME"
    p.add_argument("--profile", metavar="FILE", help=several)
    p.add_argument("--seconds", type=float, default=10.0, metavar="S", help="duration [s] (default: %(default)g)")
    p.add_argument("--seed", type=int, default=0, metavar="K", help="random seed (default: %(default)s)")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="directory in which the drive is written")
    p.add_argument("--all-around", action="store_true", help="annotate objects on all sides, not only in the camera")
    p.add_argument("--distort", action="store_true", help="keep the distortion of scans by the motion of the sensor")
    p.add_argument(
        "--glossy",
        action="store_true",
        help="paint mirrors light away, so far cars return as few points as real ones",
    )
    weather = "rain:25, snow:2.5 [mm/h], fog:50 [m] or dust:1.5; fog:50@10 begins after 10 s, and so does a fault"
    p.add_argument("--weather", metavar="KIND:STRENGTH", help=weather)
    p.add_argument("--gait", metavar="DEG[:HZ]", help="amplitude of roll and pitch of a robot with legs (2 Hz)")
    p.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="KIND:VALUE",
        help="beam:7, sector:20:30 [deg], dropout:0.3, noise:0.1 [m] or range:0.5; repeatable",
    )
    options.add_examples(
        p,
        "modt simulate --sensor vlp-16 --out sim                              a street, ten seconds",
        "modt simulate --scene corridor --sensor mid-360 --seed 3 --out sim   indoors",
        "modt simulate --sensor vlp-16 --weather fog:50@5 --fault beam:7 --out sim    fog after 5 s, a dead laser",
        "modt simulate --scene yard --sensor vlp-16 --gait 6 --distort --out sim      a robot that walks",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Simulate.

    Raises:
        MisuseError: no such scene, sensor or condition, or there is a drive already.
        ModtError: the drive cannot be written.
    """
    out: Path = arguments.out
    if arguments.profile:
        return _simulate_robot(out, arguments)
    writer = _written(out, arguments, arguments.sensor)
    print(f"KITTI raw drive: {writer.drive}\nSemanticKITTI sequence: {writer.sequence}")
    print(f"next: modt replay {quote(str(writer.drive))} --profile {arguments.sensor}")
    return 0


def _simulate_robot(out: Path, arguments: argparse.Namespace) -> int:
    """Simulate the sensors of a robot, and write a profile with their drives as sources.

    Raises:
        MisuseError: the profile has no sensors, or as `run` does.
    """
    from modt import profile
    from modt_simulation.robot_stream import NOISE_SEED_STEP, write_truth

    sensors = profile.load(arguments.profile).sensors
    if not sensors:
        raise MisuseError(arguments.profile, "has no section sensors", "give --sensor for one sensor")
    sources = {}
    for k, mounted in enumerate(sensors):
        noise_seed = arguments.seed + k * NOISE_SEED_STEP
        writer = _written(out / mounted.name, arguments, mounted.profile, mounted=mounted, noise_seed=noise_seed)
        sources[mounted.name] = {"source": str(writer.drive.relative_to(out))}
    write_truth(out, _stream(arguments, sensors[0].profile, mounted=sensors[0]), sensors[0])
    robot = out / "robot.yaml"
    base = str(Path(arguments.profile).resolve())
    robot.write_text(profile.to_yaml({"extends": base, "sensors": sources}), encoding="utf-8")
    print(f"drives of {', '.join(sources)}, their profile: {robot}, and labels in the frame of the robot: {out}")
    print(f"next: modt replay --profile {quote(str(robot))}")
    return 0


def _written(out: Path, arguments: argparse.Namespace, sensor: str, **place: Any) -> DriveWriter:
    """Write the drive of a sensor; `place` are further arguments of SyntheticStream.

    Raises:
        MisuseError: there is a drive already, or a condition is invalid.
        ModtError: the drive cannot be written.
    """
    from modt_simulation.kitti_raw import DATE, DriveWriter
    from modt_simulation.synthetic_stream import CAMERA

    if (out / DATE).exists() or (out / "sequences").exists():
        raise MisuseError(out, "contains a drive already", "give another --out")
    stream = _stream(arguments, sensor, **place)
    try:
        writer = DriveWriter(out, CAMERA, all_around=arguments.all_around)
        for frame, truth in stream.sweeps():
            writer.write(frame, truth)
        writer.close()
    except OSError as error:
        remedy = "free or unlock the disk, or give another --out"
        raise ModtError(out, f"cannot be written ({error.strerror or error})", remedy) from None
    return writer


def _stream(arguments: argparse.Namespace, sensor: str, **place: Any) -> SyntheticStream:
    """The drive of a sensor; `place` are further arguments of SyntheticStream.

    Raises:
        MisuseError: a condition is invalid.
    """
    from modt_simulation.synthetic_stream import SyntheticStream

    return SyntheticStream(
        arguments.scene,
        sensor,
        arguments.seconds,
        arguments.seed,
        distort=arguments.distort,
        glossy=arguments.glossy,
        weather=arguments.weather,
        gait=arguments.gait,
        faults=arguments.fault,
        **place,
    )
