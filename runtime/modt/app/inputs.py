"""Request of a user, and the stream, the poses and the field of view that follow from it."""

from __future__ import annotations

import argparse
import logging
from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl

from modt import profile
from modt.address import forms
from modt.config import MountedSensor, OdometryConfig, ProfileConfig
from modt.errors import MisuseError
from modt.geometry import FieldOfView
from modt.placement import LEVEL, Mount
from modt.poses.pose_source import NoPoses, PoseFile, PoseSource
from modt.schemes import POSES, open_poses, open_sensor
from modt.sources.stream import Stream, StreamInfo

if TYPE_CHECKING:
    from modt.sources.live.joint_live import JointLive
    from modt.sources.live.live_stream import LiveStream

# Values of --odometry that are no addresses
RECORDED = "recording"
NONE = "none"

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Request:
    """Request of a user. Each field is an option of `modt replay`."""

    path: Path | None = None
    capture: Sequence[tuple[str, str]] = ()
    mode: str = "accurate"
    profile: Sequence[str] = ()
    fov: str = "full"
    frames: tuple[int, int | None] = (0, None)
    rate_hz: float | None = None
    labels: bool = False
    odometry: str = RECORDED
    poses: Path | None = None

    @classmethod
    def of(cls, arguments: argparse.Namespace) -> Request:
        """Request by the options of a command, and defaults for the options that it lacks."""
        names = {field.name for field in fields(cls)}
        return cls(**{name: value for name, value in vars(arguments).items() if name in names})


def stream(request: Request, config: ProfileConfig | None = None) -> Stream:
    """The requested stream, or the embedded one without a path; by default with the profile that is asked for.

    Raises:
        MisuseError: the path is no stream, or none is built in.
    """
    config = config or profile.load(request.profile)
    if config.sensors:
        from modt.app.recorded_sensors import open_recordings

        whole: Stream = open_recordings(config.sensors, request.path, config.sensor.period_s, dict(request.capture))
    elif request.path is None:
        embedded = [*entry_points(group="modt.streams", name="embedded")]
        if not embedded:
            raise MisuseError(
                "no recording", "none is built in here", "give one, or install modt with its tools again"
            )
        whole = embedded[0].load()()
    else:
        from modt.sources.recognise import open_stream

        whole = open_stream(request.path, config.sensor.period_s, dict(request.capture))
    cut = whole.between(*request.frames)
    if cut.info.n_frames == 0:
        first, last = request.frames
        asked = f"{first}:{'' if last is None else last}"
        raise MisuseError(whole.info.name, f"no frames in {asked}", f"it holds {whole.info.n_frames} frames")
    return cut


def live_source(
    text: str, cores: frozenset[int] | None, names: profile.Names = None
) -> tuple[LiveStream | JointLive, Path | None]:
    """A sensor by its address, or a recording by its path, played as if it were live. "" is the embedded stream.

    `PATH?loop=yes` plays a recording for ever. The sensors of a profile that has several take the place of the one.

    Returns:
        the source, and the path from which its frames can be read again by number; None if they cannot.

    Raises:
        MisuseError: no such sensor or recording.
    """
    config = profile.load(names)
    if config.sensors:
        from modt.sources.live.joint_live import JointLive

        return JointLive(config.sensors, live_sensors(config.sensors, text, cores)), None
    if "://" in text:
        return open_sensor(text, cores), None
    from modt.sources.live.live_stream import LiveStream, PlayedReader

    path, loop = _recording(text)
    recording = stream(Request(path=path), config)
    return LiveStream(recording.info, PlayedReader(recording, loop=loop), cores=cores), None if loop else path


def live_sensors(sensors: Sequence[MountedSensor], text: str, cores: frozenset[int] | None) -> list[LiveStream]:
    """The sensors of a robot, live, or in recordings that are played as if they were live.

    They are in the recording at a path, or for "" where their `source` says.

    Raises:
        MisuseError: as `live_source`.
    """
    if not text and not all(sensor.source and "://" not in sensor.source for sensor in sensors):
        return [open_sensor(sensor.source, cores) for sensor in sensors]
    if "://" in text:
        raise MisuseError(text, "is one sensor, and the profile has several", "leave it out, or the profile")
    from modt.app.recorded_sensors import open_recorded
    from modt.sources.live.live_stream import LiveStream, PlayedReader, PlayedSince

    path, loop = _recording(text)
    recorded = [open_recorded(sensor, path, profile.load([sensor.profile]).sensor.period_s) for sensor in sensors]
    began_s = min(part.info.began_s for part in recorded)
    since = PlayedSince()
    readers = [PlayedReader(part, loop=loop, later_s=part.info.began_s - began_s, since=since) for part in recorded]
    return [LiveStream(part.info, reader, cores=cores) for part, reader in zip(recorded, readers, strict=True)]


def _recording(text: str) -> tuple[Path | None, bool]:
    """Path of PATH?loop=yes, None for "", and whether the recording is played for ever."""
    place, _, query = text.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    loop = options.pop("loop", "no")
    if options or loop not in ("yes", "no"):
        raise MisuseError(text, f"option {query!r} is unknown", "write PATH or PATH?loop=yes")
    return Path(place) if place else None, loop == "yes"


def odometry(request: Request, info: StreamInfo, config: OdometryConfig) -> PoseSource:
    """Source of the poses of a stream's frames.

    Raises:
        MisuseError: a file of poses cannot be used, or an address is invalid or cannot be bound.
    """
    if request.poses is not None:
        return PoseFile(request.poses, info.camera, info.end)
    if request.odometry == RECORDED:
        return PoseSource()
    if request.odometry == NONE:
        return NoPoses()
    if "://" not in request.odometry:
        remedy = f"write one of {RECORDED}, {NONE}, {forms(POSES)}"
        raise MisuseError(request.odometry, "is no source of poses", remedy)
    return open_poses(request.odometry, config)


def field_of_view(request: Request, info: StreamInfo, mount: Mount = LEVEL) -> FieldOfView:
    """Field of view for the level points of a mounted sensor.

    Raises:
        MisuseError: the view of the camera is requested, and the stream has no camera.
    """
    if request.fov == "full":
        return FieldOfView()
    if info.camera is None:
        missing = next((n for n in info.notes if "camera" in n), "it has no calibration")
        raise MisuseError(info.name, missing, "restore the calibration, or use --fov full")
    return FieldOfView.of_camera(mount.camera(info.camera))
