"""Poses that another process sends, a datagram each.

Stamps of poses and of frames are seconds of one clock, the stream's: the `stamp_s` of `tracks.jsonl`. No other clock
is read here, so a replay is the same again if it is sent the same poses before the same frames.
"""

from __future__ import annotations

import errno
import logging
import socket
import stat
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.sources.pose_datagram import LARGEST_BYTES, DatagramError, read_datagram
from modt.sources.pose_ring import PoseRing
from modt.sources.stream import StreamInfo
from modt.types import Float64, Frame

log = logging.getLogger(__name__)

FORM = "write recording, none, udp://HOST:PORT or unix:///PATH"


class PoseSocket:
    """Drained once a frame, never waited for; what cannot be used is counted, and logged once of each kind.

    A pose that the sensor cannot have come to at any speed it has is the first of a sender begun anew, whose world is
    another one: what it sent before is forgotten, and the frame says so (`Frame.restarts`).

    Args:
        bound: where the datagrams arrive; it is made non-blocking.
        config: how old a pose may be, how fast the sensor, and how many are kept.
        name: of the socket, for people.
    """

    KINDS = ("malformed", "non_finite", "stale", "out_of_order", "ahead")
    """Counters of what was refused."""

    def __init__(self, bound: socket.socket, config: OdometryConfig, name: str) -> None:
        bound.setblocking(False)
        self.name, self.config, self._socket = name, config, bound
        self._ring = PoseRing(config.capacity, config.max_age_s)
        self.received = self.used = self.restarts = self.posed = self.unposed = 0
        self.refused: Counter[str] = Counter()

    def of_stream(self, info: StreamInfo) -> StreamInfo:
        """Some frames at least have one, if poses are sent."""
        return replace(info, has_poses=True, pose_notes=())

    def place(self, frame: Frame) -> Frame:
        """With T_world_sensor at the frame's stamp, None where the poses sent so far do not tell."""
        self._drain(frame.stamp_s)
        T = self._ring.at(frame.stamp_s)
        self.posed, self.unposed = self.posed + (T is not None), self.unposed + (T is None)
        return replace(frame, T_world_sensor=T, restarts=self.restarts)

    def report(self) -> dict[str, Any]:
        """Datagrams received, used and refused, restarts of the sender, frames with and without a pose."""
        return {
            "source": self.name,
            "received": self.received,
            "used": self.used,
            "refused": {kind: self.refused[kind] for kind in self.KINDS},
            "restarts": self.restarts,
            "frames_posed": self.posed,
            "frames_unposed": self.unposed,
        }

    def close(self) -> None:
        """Give the socket back, and its file away."""
        place = self._socket.getsockname()
        self._socket.close()
        if isinstance(place, str) and place:
            Path(place).unlink(missing_ok=True)

    def _drain(self, now_s: float) -> None:
        """Take what has arrived, at most a ringful: a flood must not hold up the frame."""
        for _ in range(self.config.capacity):
            try:
                raw = self._socket.recv(LARGEST_BYTES + 1)
            except OSError:  # nothing there, or an error of the last sender's that is none of ours
                return
            self.received += 1
            try:
                self._keep(*read_datagram(raw), now_s)
            except DatagramError as error:
                self._refuse(error)

    def _keep(self, stamp_s: float, T: Float64, now_s: float) -> None:
        if stamp_s < now_s - self.config.max_age_s:
            raise DatagramError("stale", f"stamp {stamp_s:.3f} s when the frame's is {now_s:.3f} s")
        if stamp_s > now_s + self.config.max_ahead_s:
            cause = f"stamp {stamp_s:.3f} s when the frame's is {now_s:.3f} s: is it the stream's clock?"
            raise DatagramError("ahead", cause)
        newest_s = self._ring.newest_s
        speed_mps = self._ring.speed_to(stamp_s, T)
        if speed_mps > self.config.max_speed_mps:
            self._begin_anew(f"{speed_mps:.0f} m/s from the pose before, at stamp {stamp_s:.3f} s")
        if not self._ring.add(stamp_s, T):
            raise DatagramError("out_of_order", f"stamp {stamp_s:.3f} s after {newest_s:.3f} s")
        self.used += 1

    def _begin_anew(self, cause: str) -> None:
        self._ring.clear()
        self.restarts += 1
        if self.restarts == 1:
            meaning = "taken for a sender begun anew, tracks stay where they are"
            remedy = "have it keep its origin, or raise odometry.max_speed_mps if the robot is that fast"
            log.warning("%s: %s: %s; %s; more of them are only counted", self.name, cause, meaning, remedy)

    def _refuse(self, error: DatagramError) -> None:
        self.refused[error.kind] += 1
        if self.refused[error.kind] == 1:
            log.warning("%s: pose refused (%s): %s; more of them are only counted", self.name, error.kind, error)


def open_socket(url: str) -> socket.socket:
    """A socket bound to udp://HOST:PORT or unix:///PATH.

    Raises:
        MisuseError: no such address, or it cannot be bound.
    """
    try:
        parts = urlsplit(url)
        scheme, host, port, path = parts.scheme, parts.hostname, parts.port, parts.path
    except ValueError as error:
        raise MisuseError(url, str(error), FORM) from None
    if scheme == "udp" and host and port and path in ("", "/"):
        return _bound_udp(url, host, port)
    if scheme == "unix" and not parts.netloc and len(path) > 1:
        return _bound_unix(url, path)
    raise MisuseError(url, "no address of a socket", FORM)


def _bound_udp(url: str, host: str, port: int) -> socket.socket:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        return _bound(family, address)
    except OSError as error:
        raise MisuseError(url, f"cannot be bound ({error.strerror})", "give a free port of this machine") from None


def _bound_unix(url: str, path: str) -> socket.socket:
    try:
        if _abandoned(path):
            Path(path).unlink()
        return _bound(socket.AF_UNIX, path)
    except OSError as error:
        cause = error.strerror or str(error)
        raise MisuseError(url, f"cannot be bound ({cause})", "give a free path in a folder of yours") from None


def _bound(family: int, address: Any) -> socket.socket:
    made = socket.socket(family, socket.SOCK_DGRAM)
    try:
        made.bind(address)
    except OSError:
        made.close()
        raise
    return made


def _abandoned(path: str) -> bool:
    """Whether a socket lies there that nobody listens to: what a killed run leaves behind."""
    place = Path(path)
    if not place.exists() or not stat.S_ISSOCK(place.stat().st_mode):
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as knock:
        return knock.connect_ex(path) == errno.ECONNREFUSED
