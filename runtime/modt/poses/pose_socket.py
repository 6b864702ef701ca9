"""Poses received in datagrams of a socket.

A datagram is JSON: {"stamp": s, "x": m, "y": m, "yaw": rad}, or "orientation": [x, y, z, w] instead of the yaw, the
quaternion of the sensor, as an inertial unit gives it; or {"stamp": s, "pose": [...]} with the 16 elements of
T_world_sensor in row-major order, or the first 12 of them. Other keys are ignored.
"""

from __future__ import annotations

import errno
import json
import math
import socket
import stat
import struct
import threading
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from modt.address import Address
from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.geometry import rotation_of, rotation_zyx, se3
from modt.poses.received_poses import ReceivedPoses
from modt.ros2.cdr import MessageError
from modt.sources.pose_buffer import CAPACITY
from modt.types import Float64

MAX_BYTES = 4096
PLANAR = ("x", "y", "yaw")
ORIENTATION = "orientation"
_BUFFER_BYTES = 1 << 20
_READ_AT_ONCE = 4096  # bounds the time of a frame in a flood; the kernel holds about as many
_EMPTIED_S = 0.01
_OVERFLOW = getattr(socket, "SO_RXQ_OVFL", 40)  # Linux counts dropped datagrams; Python does not name the option
_COUNT = struct.Struct("=I")


def read_datagram(raw: bytes) -> tuple[float, Float64]:
    """Stamp [s] and (4, 4) T_world_sensor.

    Raises:
        MessageError: the bytes are no pose.
    """
    if len(raw) > MAX_BYTES:
        raise MessageError("malformed", f"more than {MAX_BYTES} bytes")
    try:
        message = json.loads(raw, parse_int=float)  # a number beyond all floats is infinite
    except (ValueError, RecursionError):
        raise MessageError("malformed", "no JSON") from None
    if not isinstance(message, dict):
        raise MessageError("malformed", "no JSON object")
    turned = ORIENTATION in message
    placed = ("x", "y", ORIENTATION) if turned else PLANAR
    if ("pose" in message) == any(key in message for key in (*PLANAR, ORIENTATION)) or (turned and "yaw" in message):
        raise MessageError("malformed", "neither x, y with yaw or orientation nor pose, or several")
    missing = [key for key in ("stamp", *(() if "pose" in message else placed)) if key not in message]
    if missing:
        raise MessageError("malformed", f"no {missing[0]}")
    stamp = _number(message["stamp"], "stamp")
    if "pose" in message:
        T = _matrix(message["pose"])
    else:
        x, y = (_number(message[key], key) for key in ("x", "y"))
        if turned:
            R = rotation_of(_quaternion(message[ORIENTATION]))
        else:
            R = rotation_zyx(0.0, 0.0, _number(message["yaw"], "yaw"))
        T = se3(R, np.array([x, y, 0.0]))
    return stamp, T


def _number(value: object, key: str) -> float:
    if not isinstance(value, float):
        raise MessageError("malformed", f"{key} is no number")
    if not math.isfinite(value):
        raise MessageError("non_finite", f"{key} is not finite")
    return value


def _quaternion(values: object) -> Float64:
    """(4,) x, y, z, w, about of length 1."""
    if not isinstance(values, list) or len(values) != 4:
        raise MessageError("malformed", f"{ORIENTATION} is no list of 4 numbers")
    quaternion = np.array([_number(value, ORIENTATION) for value in values])
    if not 0.9 < math.hypot(*quaternion) < 1.1:
        raise MessageError("malformed", f"{ORIENTATION} is no rotation")
    return quaternion


def _matrix(values: object) -> Float64:
    if not isinstance(values, list) or len(values) not in (12, 16):
        raise MessageError("malformed", "pose is no list of 12 or 16 numbers")
    numbers = np.array([_number(value, "pose") for value in values])
    if len(numbers) == 16 and np.abs(numbers[12:] - [0, 0, 0, 1]).max() > 1e-6:
        raise MessageError("malformed", "the last row of pose is not 0 0 0 1")
    T = np.eye(4)
    T[:3] = numbers[:12].reshape(3, 4)
    return T


class PoseSocket(ReceivedPoses):
    """Reads the newest datagrams of a socket, which it owns, once a frame without blocking.

    The kernel holds ten datagrams of a Unix socket, whatever its buffer, so a thread empties such a socket between
    two frames.
    """

    def __init__(self, bound: socket.socket, config: OdometryConfig, name: str) -> None:
        super().__init__(config, name)
        bound.setblocking(False)
        self._socket = bound
        self._kept: deque[bytes] = deque(maxlen=CAPACITY)
        self._crowded_out = 0
        with suppress(OSError):
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        with suppress(OSError):
            bound.setsockopt(socket.SOL_SOCKET, _OVERFLOW, 1)
        self._address = bound.getsockname()
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._keep_empty, name="poses", daemon=True)
        if bound.family == socket.AF_UNIX and self._address:
            self._thread.start()

    def close(self) -> None:
        """Close the socket and remove its file."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self._socket.close()
        if isinstance(self._address, str) and self._address:
            Path(self._address).unlink(missing_ok=True)

    def _take(self) -> list[bytes]:
        """Take the newest CAPACITY datagrams; a flood must not delay the frame."""
        with self._lock:
            self._empty()
            taken = list(self._kept)
            crowded_out = self._crowded_out
            self._kept.clear()
            self._crowded_out = 0
        self.received += len(taken) + crowded_out
        if crowded_out:
            self._refuse(MessageError("crowded_out", f"more than {CAPACITY} a frame"), crowded_out)
        return taken

    _read = staticmethod(read_datagram)

    def _keep_empty(self) -> None:
        while not self._ended.wait(_EMPTIED_S):
            with self._lock:
                self._empty()

    def _empty(self) -> None:
        """Move datagrams from the kernel's queue to the newest ones kept."""
        for _ in range(_READ_AT_ONCE):
            try:
                raw, facts, _, _ = self._socket.recvmsg(MAX_BYTES + 1, socket.CMSG_SPACE(_COUNT.size))
            except OSError:  # nothing to read, or an error caused by the last sender
                return
            self._crowded_out += len(self._kept) == self._kept.maxlen
            self._kept.append(raw)
            for level, kind, value in facts:
                if (level, kind) == (socket.SOL_SOCKET, _OVERFLOW):
                    (self.overflowed,) = _COUNT.unpack(value[: _COUNT.size])


def open_socket(address: Address) -> socket.socket:
    """Bind a socket to udp://HOST:PORT or unix:///PATH.

    Raises:
        MisuseError: the address names no socket, or it cannot be bound.
    """
    try:
        if address.scheme == "udp" and address.host and address.port and address.path in ("", "/"):
            family, _, _, _, bound = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)[0]
            return _bound(family, bound)
        if address.scheme == "unix" and not address.host and len(address.path) > 1:
            if _stale(address.path):
                Path(address.path).unlink()
            return _bound(socket.AF_UNIX, address.path)
    except OSError as error:
        remedy = "give a free port of this machine, or a free path in a writable folder"
        raise MisuseError(address.text, f"cannot be bound ({error.strerror or error})", remedy) from None
    raise MisuseError(address.text, "names no socket", "write udp://HOST:PORT or unix:///PATH")


def _bound(family: int, address: Any) -> socket.socket:
    made = socket.socket(family, socket.SOCK_DGRAM)
    try:
        made.bind(address)
    except OSError:
        made.close()
        raise
    return made


def _stale(path: str) -> bool:
    """Whether the path is a socket without a listener, left by an aborted run."""
    if not Path(path).exists() or not stat.S_ISSOCK(Path(path).stat().st_mode):
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        return probe.connect_ex(path) == errno.ECONNREFUSED
