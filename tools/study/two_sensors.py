"""Two sensors at the corners of a robot against one in its middle, on simulated drives with exact truth.

    python -m tools.study.two_sensors [--sensor vlp-16] [--scenes street yard] [--seeds 700:702] [--seconds 6]
                                      [--phase 0.04] [--distort]

The two sensors are at opposite corners, and the robot hides a quarter of the turn of each. The second one turns
`--phase` seconds later. The one sensor is in the middle at the same height, where nothing hides anything from it. The
pose of the robot is left out with --no-poses.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from modt.cli.options import frames as number_range
from modt.config import MountedSensor, ProfileConfig
from modt.profile import load
from modt.types import Frame
from modt_evaluation.evaluation import DriveRows, collect, evaluation
from modt_evaluation.experiments.drives import simulated_truth
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.report import report
from modt_evaluation.rules import CUBOID_RULES
from modt_simulation.robot_stream import RobotStream
from modt_simulation.simulator import Truth
from modt_simulation.synthetic_stream import SCENES
from tools.options import parser
from tools.study.drives import steps_of

HEIGHT_M = 0.6
CORNER_M = (0.5, 0.35)
"""Place of the corner sensors, ahead and beside the middle of the robot."""
HIDDEN_DEG = 90
"""Part of the turn of a corner sensor that the robot hides."""


def corners(profile: str) -> tuple[MountedSensor, ...]:
    """Sensors at the front left and at the rear right corner, each facing away from the robot."""
    x, y = CORNER_M
    front = MountedSensor(
        name="front", profile=profile, position_m=(x, y, HEIGHT_M), roll_pitch_yaw_deg=(0.0, 0.0, 45.0)
    )
    rear = MountedSensor(
        name="rear", profile=profile, position_m=(-x, -y, HEIGHT_M), roll_pitch_yaw_deg=(0.0, 0.0, -135.0)
    )
    return front, rear


def middle(profile: str) -> tuple[MountedSensor, ...]:
    """A sensor in the middle of the robot."""
    return (MountedSensor(name="middle", profile=profile, position_m=(0.0, 0.0, HEIGHT_M)),)


def robot_profile(sensors: Sequence[MountedSensor]) -> ProfileConfig:
    """The profile of a robot with these sensors."""
    return replace(load(sensors[0].profile), sensors=tuple(sensors))


def judged(frames: Iterator[tuple[Frame, Truth]], step: Callable[[Frame], object], number: int) -> DriveRows:
    """Frames processed by the step of a pipeline, and judged."""

    def results() -> Iterator[JudgedFrame]:
        for frame, truth in frames:
            yield JudgedFrame.of_result(step(frame), simulated_truth(truth))  # type: ignore[arg-type]

    return collect(results(), CUBOID_RULES, number)


def main() -> None:
    """Print the evaluations of one and of two sensors, scene by scene."""
    p = parser(__doc__)
    p.add_argument("--sensor", default="vlp-16")
    p.add_argument("--scenes", nargs="+", default=["street", "yard"], choices=SCENES)
    p.add_argument("--seeds", type=number_range, default=(700, 702))
    p.add_argument("--seconds", type=float, default=6.0)
    p.add_argument("--phase", type=float, default=0.04)
    p.add_argument("--distort", action="store_true")
    p.add_argument("--no-poses", action="store_true")
    arguments = p.parse_args()
    hidden = [f"sector:{180 - HIDDEN_DEG // 2}:{HIDDEN_DEG}"]
    of_two = {"front": {"faults": hidden}, "rear": {"faults": hidden, "first_s": arguments.phase}}
    for scene in arguments.scenes:
        scores = {}
        for name, sensors, more in (
            ("one", middle(arguments.sensor), {}),
            ("two", corners(arguments.sensor), of_two),
        ):
            drives = []
            for seed in range(*arguments.seeds):
                stream = RobotStream(scene, sensors, arguments.seconds, seed, more, distort=arguments.distort)
                frames = stream.sweeps()
                if arguments.no_poses:
                    frames = ((replace(frame, T_world_sensor=None), truth) for frame, truth in frames)
                drives.append(judged(frames, steps_of("accurate", robot_profile(sensors)), seed))
            scores[f"{scene}, {name}"] = evaluation(drives)
        print(report(scores))


if __name__ == "__main__":
    main()
