"""Tracks, points and energy as Foxglove's messages, on the channels of a Foxglove context."""

from __future__ import annotations

import logging
import math
from typing import Any

import foxglove
import numpy as np
from foxglove.channels import FrameTransformChannel, PointCloudChannel, SceneUpdateChannel
from foxglove.messages import (
    ArrowPrimitive,
    Color,
    CubePrimitive,
    FrameTransform,
    KeyValuePair,
    PackedElementField,
    PackedElementFieldNumericType,
    PointCloud,
    Pose,
    Quaternion,
    SceneEntity,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
    TextPrimitive,
    Timestamp,
    Vector3,
)

from modt.classes import CLASS_NAMES, CLASSES, ObjectClass
from modt.energy import ledger, windows
from modt.energy.attribution import usable
from modt.geometry import quaternion_of, yaw_of
from modt.types import NONE, FrameResult

logging.getLogger("foxglove").setLevel(
    logging.ERROR
)  # it warns of each message that cannot be written, we count them

FRAME, WORLD = "sensor", "world"
"""Frame of reference of all other messages, and its parent in /tf."""
MIN_ARROW_MPS = 0.3
ENERGY = {"mJ_per_frame": "number", "watts": "number", "kind": "string"}
STAGES = {"cpu_ms": "number", **{f"{stage}_ms": "number" for stage in ledger.STAGES}}
_ALPHA = 0.4
_FIELDS = [
    PackedElementField(name=name, offset=4 * k, type=PackedElementFieldNumericType.Float32)
    for k, name in enumerate(("x", "y", "z", "reflectance"))
]
_WHITE = Color(r=1.0, g=1.0, b=1.0, a=1.0)


def _colour(class_: ObjectClass, alpha: float) -> Color:
    r, g, b = (value / 255 for value in bytes.fromhex(CLASSES[class_].colour[1:]))
    return Color(r=r, g=g, b=b, a=alpha)


_FILL = [_colour(class_, _ALPHA) for class_ in CLASSES]
_EDGE = [_colour(class_, 1.0) for class_ in CLASSES]


class Scene:
    """Channels /tf (foxglove.FrameTransform), /tracks (foxglove.SceneUpdate), /points (foxglove.PointCloud), /energy
    and /stages (JSON).

    Times are the stamps of the frames. A message is made only while somebody takes it.
    """

    def __init__(self, context: foxglove.Context, *, points: bool) -> None:
        self._transforms = FrameTransformChannel("/tf", context=context)
        self._tracks = SceneUpdateChannel("/tracks", context=context)
        self._points = PointCloudChannel("/points", context=context) if points else None
        self._energy = foxglove.Channel("/energy", schema=_json("modt.Energy", ENERGY), context=context)
        self._stages = foxglove.Channel("/stages", schema=_json("modt.Stages", STAGES), context=context)
        self._stamp_ns = 0

    def write(self, result: FrameResult) -> None:
        """Publish a frame: the pose of the sensor, a cube, text and arrow for each object in view, and the points."""
        self._stamp_ns = round(1e9 * result.frame.stamp_s)
        stamp = Timestamp(*divmod(self._stamp_ns, 10**9))
        if self._transforms.has_sinks():
            self._transforms.log(placed(result, stamp), log_time=self._stamp_ns)
        if self._tracks.has_sinks():
            everything = SceneEntityDeletion(timestamp=stamp, type=SceneEntityDeletionType.All)
            update = SceneUpdate(deletions=[everything], entities=entities(result, stamp))
            self._tracks.log(update, log_time=self._stamp_ns)
        if self._points is not None and self._points.has_sinks():
            self._points.log(cloud(result, stamp), log_time=self._stamp_ns)

    def ledger(self, record: dict[str, Any]) -> None:
        """Publish the mean energy a frame of a window, or the CPU time of a frame's stages, at the last stamp."""
        if record["schema"] == windows.SCHEMA and usable(record) and record["frames"][2]:
            self._energy.log(energy(record), log_time=self._stamp_ns)
        elif record["schema"] == ledger.SCHEMA:
            cpu_ms = {f"{stage}_ms": 1e-6 * row["cpu_ns"] for stage, row in record["stages"].items()}
            self._stages.log({"cpu_ms": 1e-6 * record.get("cpu_ns", 0), **cpu_ms}, log_time=self._stamp_ns)


def entities(result: FrameResult, stamp: Timestamp) -> list[SceneEntity]:
    """An entity for every track of an object in view; its id is that of the track."""
    tracks = result.tracks
    rows = np.flatnonzero((tracks.proposal != NONE) & (tracks.object_class != ObjectClass.BACKGROUND))
    boxes = result.proposals.box[tracks.proposal[rows]]
    speed = tracks.x[rows, 3]
    heading = tracks.x[rows, 2] - yaw_of(result.T_world_sensor) + np.pi * (speed < 0)
    columns = (tracks.id[rows], tracks.object_class[rows], np.abs(speed), heading, boxes)
    return [_entity(stamp, *row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def _entity(
    stamp: Timestamp, id_: int, class_: int, speed_mps: float, heading: float, box: list[float]
) -> SceneEntity:
    x, y, z, length, width, height, yaw = box
    size, centre = Vector3(x=length, y=width, z=height), Vector3(x=x, y=y, z=z)
    cube = CubePrimitive(pose=Pose(position=centre, orientation=_about_z(yaw)), size=size, color=_FILL[class_])
    above = Pose(position=Vector3(x=x, y=y, z=z + height / 2 + 0.3), orientation=_about_z(0.0))
    words = f"{CLASS_NAMES[class_]} {id_}: {speed_mps:.1f} m/s"
    text = TextPrimitive(pose=above, billboard=True, font_size=14.0, scale_invariant=True, color=_WHITE, text=words)
    arrow = ArrowPrimitive(
        pose=Pose(position=centre, orientation=_about_z(heading)),
        shaft_length=speed_mps,
        shaft_diameter=0.1,
        head_length=0.3,
        head_diameter=0.25,
        color=_EDGE[class_],
    )
    return SceneEntity(
        timestamp=stamp,
        frame_id=FRAME,
        id=str(id_),
        metadata=[KeyValuePair(key="class", value=CLASS_NAMES[class_])],
        cubes=[cube],
        texts=[text],
        arrows=[arrow] if speed_mps >= MIN_ARROW_MPS else [],
    )


def placed(result: FrameResult, stamp: Timestamp) -> FrameTransform:
    """The pose of the sensor in the world."""
    x, y, z = result.T_world_sensor[:3, 3].tolist()
    qx, qy, qz, qw = quaternion_of(result.T_world_sensor).tolist()
    return FrameTransform(
        timestamp=stamp,
        parent_frame_id=WORLD,
        child_frame_id=FRAME,
        translation=Vector3(x=x, y=y, z=z),
        rotation=Quaternion(x=qx, y=qy, z=qz, w=qw),
    )


def cloud(result: FrameResult, stamp: Timestamp) -> PointCloud:
    """The points of the frame."""
    here = Pose(position=Vector3(), orientation=_about_z(0.0))
    data = result.frame.points.tobytes()
    return PointCloud(timestamp=stamp, frame_id=FRAME, pose=here, point_stride=16, fields=_FIELDS, data=data)


def energy(record: dict[str, Any]) -> dict[str, Any]:
    """Mean energy a frame [mJ] and power [W] of a window, and whether they are measured."""
    energy_J, n_frames = record["energy_J"], record["frames"][2]
    watts = energy_J / (1e-9 * record["wall_ns"]) if record["wall_ns"] else 0.0
    return {"mJ_per_frame": 1e3 * energy_J / n_frames, "watts": watts, "kind": record["kind"]}


def _about_z(yaw: float) -> Quaternion:
    return Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def _json(title: str, kinds: dict[str, str]) -> dict[str, Any]:
    return {"title": title, "type": "object", "properties": {name: {"type": kind} for name, kind in kinds.items()}}
