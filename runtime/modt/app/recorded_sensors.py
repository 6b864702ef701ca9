"""Recordings of a robot with several sensors: where each sensor is in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from modt.address import parse_address
from modt.config import MountedSensor
from modt.errors import MisuseError
from modt.ros2.address import topic_of
from modt.schemes import SENSORS
from modt.sources import drivers
from modt.sources.joining import JointStream
from modt.sources.recognise import open_stream
from modt.sources.stream import Stream


def open_recordings(
    sensors: Sequence[MountedSensor],
    path: Path | None,
    period_s: float,
    capture: Mapping[str, str] = MappingProxyType({}),
) -> JointStream:
    """The sensors of a robot in a recording, or each in its own without a path.

    A folder of the name of a sensor in the path is its recording. Without one, the live address of the sensor says
    where it is: the topic of a recording of ROS 2, or the host and port in a capture. `period_s` is the time between
    scans without time stamps.

    Raises:
        MisuseError: a sensor has no recording there, or there are facts in `capture`, which would be of one sensor.
    """
    if capture:
        cause = f"{min(capture)} does not apply, as the profile has several sensors"
        raise MisuseError("--capture", cause, "state it in the address `source` of the sensor in the profile")
    return JointStream(sensors, [open_recorded(sensor, path, period_s) for sensor in sensors])


def open_recorded(sensor: MountedSensor, path: Path | None, period_s: float) -> Stream:
    """The recorded stream of a sensor; arguments as in `open_recordings`.

    Raises:
        MisuseError: it has no recording there.
    """
    try:
        return _open(sensor, path, period_s)
    except MisuseError as error:
        remedy = f"{error.remedy}; or leave sensor {sensor.name} out of the profile"
        raise MisuseError(error.subject, error.cause, remedy) from None


def _open(sensor: MountedSensor, path: Path | None, period_s: float) -> Stream:
    if path is None:
        if not sensor.source or "://" in sensor.source:
            remedy = "give the path of a recording, or modt run for live sensors"
            raise MisuseError(f"sensors.{sensor.name}.source", f"{sensor.source!r} is no recording", remedy)
        return open_stream(Path(sensor.source), period_s)
    folder = path / sensor.name
    return open_stream(folder, period_s) if folder.is_dir() else open_stream(path, period_s, _place(sensor))


def _place(sensor: MountedSensor) -> dict[str, str]:
    """Options of a recording that choose the sensor with this live address.

    Raises:
        MisuseError: the sensor has no address.
    """
    if "://" not in sensor.source:
        remedy = "give its live address, which says its topic or port, or a folder of its name in the recording"
        raise MisuseError(f"sensors.{sensor.name}.source", f"{sensor.source!r} is no address", remedy)
    address = parse_address(sensor.source, SENSORS)
    if address.scheme == "ros2":
        return {"topic": "/" + topic_of(address)}
    driver = drivers.driver(address.scheme)
    options = {key: value for key, value in address.options.items() if key in driver.options}
    where = {"host": address.host} if address.host else {}
    return {**options, **where, "port": str(address.port or driver.port)}
