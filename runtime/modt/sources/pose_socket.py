"""Poses received from another process, one per datagram.

Stamps of poses and frames are on the clock of the stream, `stamp_s` of `tracks.jsonl`. No other clock is read: a
replay is reproducible if it receives the same poses before the same frames.
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
from modt.sources.datagram_queue import DatagramQueue
from modt.sources.pose_datagram import MAX_BYTES, DatagramError, read_datagram
from modt.sources.pose_sequence import PoseSequence
from modt.sources.pose_source import PoseSource
from modt.types import Float64, Frame

log = logging.getLogger(__name__)

FORM = "write recording, none, udp://HOST:PORT or unix:///PATH"


class PoseSocket(PoseSource):
    """Reads the socket once a frame without blocking; refused poses are counted, and logged once of each kind.

    Poses are believed as `PoseSequence` says. A restarted sender with another world frame is passed on in
    `Frame.restarts`.
    """

    has_poses = True  # though frames may lack one
    REASONS = (
        *("malformed", "non_finite", "crowded_out", "stale", "ahead"),
        *("repeated", "out_of_order", "early", "leap"),  # doubts of PoseBuffer
    )
    """Reasons of a refusal; each has a counter."""

    def __init__(self, bound: socket.socket, config: OdometryConfig, name: str) -> None:
        self.name, self.config = name, config
        self._queue = DatagramQueue(bound, config.capacity, MAX_BYTES + 1)
        self._poses = PoseSequence(config)
        self.received = self.used = self.posed = self.unposed = 0
        self.refused: Counter[str] = Counter()

    @property
    def restarts(self) -> int:
        """Times that the sender went on in another world."""
        return self._poses.restarts

    def place(self, frame: Frame) -> Frame:
        """The frame with T_world_sensor at its stamp, None where the poses received are too old."""
        self._drain(frame.stamp_s)
        T = self._poses.believed.at(frame.stamp_s)
        self.posed, self.unposed = self.posed + (T is not None), self.unposed + (T is None)
        return replace(frame, T_world_sensor=T, restarts=self.restarts)

    def report(self) -> dict[str, Any]:
        """Counts of datagrams, of those that the kernel dropped, of restarts, of frames with and without a pose."""
        return {
            "source": self.name,
            "received": self.received,
            "overflowed": self._queue.overflowed,
            "used": self.used,
            "refused": {reason: self.refused[reason] for reason in self.REASONS},
            "restarts": self.restarts,
            "frames_posed": self.posed,
            "frames_unposed": self.unposed,
        }

    def close(self) -> None:
        """Close the socket and remove its file."""
        self._queue.close()

    def _drain(self, now_s: float) -> None:
        """Read what has arrived, the newest `capacity` datagrams: a flood must not delay the frame."""
        taken, crowded_out = self._queue.take()
        self.received += len(taken) + crowded_out
        if crowded_out:
            self._refuse(DatagramError("crowded_out", f"more than {self.config.capacity} a frame"), crowded_out)
        for raw in taken:
            try:
                self._keep(*read_datagram(raw), now_s)
            except DatagramError as error:
                self._refuse(error)

    def _keep(self, stamp_s: float, T: Float64, now_s: float) -> None:
        cause = f"stamp {stamp_s:.3f} s when the frame's is {now_s:.3f} s"
        if stamp_s > now_s + self.config.max_ahead_s:
            raise DatagramError("ahead", f"{cause}: is it the stream's clock?")
        newest_s, restarts = self._poses.believed.newest_s, self.restarts
        doubt = self._poses.add(stamp_s, T, now_s)
        if self.restarts > restarts:
            self._warn_of_restart(f"another place than the sensor can have reached, at stamp {stamp_s:.3f} s")
        if stamp_s < now_s - self.config.max_age_s:
            raise DatagramError("stale", cause)
        if doubt is not None:
            raise DatagramError(doubt, f"stamp {stamp_s:.3f} s after {newest_s:.3f} s")
        self.used += 1

    def _warn_of_restart(self, cause: str) -> None:
        if self.restarts == 1:
            meaning = "the sender seems to have restarted, tracks keep their positions"
            remedy = "let it keep its origin, or raise odometry.max_speed_mps for a faster robot"
            log.warning("%s: %s: %s; %s; later ones are only counted", self.name, cause, meaning, remedy)

    def _refuse(self, error: DatagramError, number: int = 1) -> None:
        self.refused[error.reason] += number
        if self.refused[error.reason] == number:
            log.warning("%s: pose refused (%s): %s; later ones are only counted", self.name, error.reason, error)


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
    try:
        if scheme == "udp" and host and port and path in ("", "/"):
            family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            return _bound(family, address)
        if scheme == "unix" and not parts.netloc and len(path) > 1:
            if _stale(path):
                Path(path).unlink()
            return _bound(socket.AF_UNIX, path)
    except OSError as error:
        remedy = "give a free port of this machine, or a free path in a writable folder"
        raise MisuseError(url, f"cannot be bound ({error.strerror or error})", remedy) from None
    raise MisuseError(url, "is no address of a socket", FORM)


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
