"""A simulated drive of a robot with several sensors, with its ground truth in the frame of the robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modt.config import MountedSensor
from modt.geometry import inverse
from modt.sources.joining import JointStream
from modt.types import Frame
from modt_simulation.simulator import Truth
from modt_simulation.synthetic_stream import SyntheticStream

NOISE_SEED_STEP = 100_000
"""Step of the seeds of the noise from sensor to sensor."""


class _Kept:
    """A synthetic stream that keeps the truth of its sweeps until it is taken."""

    def __init__(self, stream: SyntheticStream) -> None:
        self.stream = stream
        self.info = stream.info
        self.faults = stream.faults
        self.reading = stream.reading
        self.truths: dict[int, Truth] = {}

    def __iter__(self) -> Iterator[Frame]:
        for frame, truth in self.stream.sweeps():
            self.truths[frame.index] = truth
            yield frame

    def between(self, first: int, last: int | None) -> _Kept:
        """Frames with first <= index < last."""
        return _Kept(self.stream.between(first, last))


class RobotStream:
    """A drive of a robot through a synthetic scene; the profile of each sensor names its model.

    Args:
        scene, seconds, seed: as of SyntheticStream.
        sensors: the sensors.
        of_sensors: further arguments of SyntheticStream by the name of a sensor.
        more: those of all sensors.
    """

    def __init__(
        self,
        scene: str,
        sensors: Sequence[MountedSensor],
        seconds: float = 10.0,
        seed: int = 0,
        of_sensors: Mapping[str, Mapping[str, Any]] | None = None,
        **more: Any,
    ) -> None:
        self.sensors = sensors
        self.streams = [
            SyntheticStream(
                scene,
                mounted.profile,
                seconds,
                seed,
                mounted=mounted,
                noise_seed=seed + k * NOISE_SEED_STEP,
                **more,
                **(of_sensors or {}).get(mounted.name, {}),
            )
            for k, mounted in enumerate(sensors)
        ]

    def sweeps(self) -> Iterator[tuple[Frame, Truth]]:
        """The frames of the robot with their ground truth, which is that of the stamp of the frame."""
        kept = [_Kept(stream) for stream in self.streams]
        for frame in JointStream(self.sensors, kept):
            truths = [
                kept[k].truths.pop(sweep.index) if sweep is not None else None for k, sweep in enumerate(frame.sweeps)
            ]
            yield frame, _joined(frame, [truth for truth in truths if truth is not None])


def write_truth(folder: Path, stream: SyntheticStream, mounted: MountedSensor) -> None:
    """Write the labels of a drive in the frame of the robot, a table of cuboids and the poses of the robot.

    Args:
        folder: where `truth.csv` and `poses.txt` are written.
        stream: the first sensor of the robot.
        mounted: its mount.
    """
    world = stream.simulator.world
    named = [number for number, body in enumerate(world.bodies) if body.kind.name]
    rows = ["frame,track,label,x,y,z,l,w,h,yaw"]
    poses = []
    for index in range(stream.info.end or 0):
        time_s = index * stream.info.period_s
        poses.append((world.ego_pose(time_s) @ inverse(mounted.T_robot_sensor))[:3].ravel())
        boxes = world.boxes(time_s)
        for number in named:
            numbers = ",".join(f"{value:.4f}" for value in boxes[number])
            rows.append(f"{index},{number},{world.bodies[number].kind.name},{numbers}")
    (folder / "truth.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    np.savetxt(folder / "poses.txt", poses, fmt="%.9f")


def _joined(frame: Frame, truths: Sequence[Truth]) -> Truth:
    """The truth of the sweeps of a frame, with the bodies at the stamp of the first."""
    first = truths[0]
    assert frame.T_world_sensor is not None  # the simulation knows it
    return Truth(
        instance=np.concatenate([truth.instance for truth in truths]),
        semantic=np.concatenate([truth.semantic for truth in truths]),
        bodies=first.bodies,
        kinds=first.kinds,
        world_boxes=first.world_boxes,
        T_world_sensor=frame.T_world_sensor,
        points=np.sum([truth.points for truth in truths], axis=0),
    )
