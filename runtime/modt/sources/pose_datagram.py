"""A pose as a JSON datagram.

Either {"stamp": s, "x": m, "y": m, "yaw": rad}, or {"stamp": s, "pose": [...]} with the 16 elements of T_world_sensor
in row-major order, or the first 12 of them. Other keys are ignored.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from modt.geometry import rotation_zyx, se3
from modt.sources.pose_file import pose_defect
from modt.types import Float64

MAX_BYTES = 4096
PLANAR = ("x", "y", "yaw")


class DatagramError(ValueError):
    """A refused datagram, with the reason that it is counted by."""

    def __init__(self, reason: str, cause: str) -> None:
        super().__init__(cause)
        self.reason = reason


def read_datagram(raw: bytes) -> tuple[float, Float64]:
    """Stamp [s] and (4, 4) T_world_sensor.

    Raises:
        DatagramError: any other bytes.
    """
    if len(raw) > MAX_BYTES:
        raise DatagramError("malformed", f"more than {MAX_BYTES} bytes")
    try:
        message = json.loads(raw)
    except (ValueError, RecursionError):
        raise DatagramError("malformed", "no JSON") from None
    if not isinstance(message, dict):
        raise DatagramError("malformed", "no JSON object")
    if ("pose" in message) == any(key in message for key in PLANAR):
        raise DatagramError("malformed", "neither x, y, yaw nor pose, or both")
    stamp = _number(message, "stamp")
    if "pose" in message:
        T = _matrix(message["pose"])
    else:
        x, y, yaw = (_number(message, key) for key in PLANAR)
        T = se3(rotation_zyx(0.0, 0.0, math.remainder(yaw, 2 * math.pi)), np.array([x, y, 0.0]))
    defect = pose_defect(T)
    if defect:
        raise DatagramError("malformed", f"pose is {defect}")
    return stamp, T


def _number(message: dict[str, Any], key: str) -> float:
    if key not in message:
        raise DatagramError("malformed", f"no {key}")
    return _finite(message[key], key)


def _finite(value: object, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise DatagramError("malformed", f"{key} is no number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise DatagramError("non_finite", f"{key} is not finite")
    return number


def _matrix(values: object) -> Float64:
    if not isinstance(values, list) or len(values) not in (12, 16):
        raise DatagramError("malformed", "pose is no list of 12 or 16 numbers")
    numbers = np.array([_finite(value, "pose") for value in values])
    if len(numbers) == 16 and np.abs(numbers[12:] - [0, 0, 0, 1]).max() > 1e-6:
        raise DatagramError("malformed", "the last row of pose is not 0 0 0 1")
    T = np.eye(4)
    T[:3] = numbers[:12].reshape(3, 4)
    return T
