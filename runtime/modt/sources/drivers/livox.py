"""Sweeps from the packets of a Livox Mid-360 or HAP (protocol of Livox SDK2), or Avia (Livox SDK)."""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.sources.drivers import Driver
from modt.sources.packets.device_clock import DeviceClock
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import Sweep
from modt.types import Float32, Float64

HEADER = Struct("<BHHH3xB13x4xQ")
"""Version, number of bytes, time from the first to the last point [0.1 us], number of points, data type, time of the
first point [ns]."""
OLD_HEADER = Struct("<B7xBBQ")
"""Version, type of the time, data type and time of the first point in packets of the first SDK."""
OLD_VERSION = 5
UTC = 3
"""Type of a time that is a date: year, month, day and hour (a byte each), and the time since the hour [us]."""
_TAIL = [("reflectance", "u1"), ("tag", "u1")]
_AXES = ("x", "y", "z")
_MM = [(axis, "<i4") for axis in _AXES]
_ANGLES = [("zenith", "<u2"), ("azimuth", "<u2")]
_DEPTH = [("depth", "<u4")]


def _echoes(number: int, fields: Sequence[tuple[str, str]], before: Sequence[tuple[str, str]] = ()) -> np.dtype[Any]:
    """Row of a point with so many returns; `before` are fields that all of them share."""
    return np.dtype([*before, ("echoes", list(fields), (number,))])


POINTS: dict[int, tuple[np.dtype[Any], float]] = {
    1: (_echoes(1, [*_MM, *_TAIL]), 0.001),
    2: (_echoes(1, [*((axis, "<i2") for axis in _AXES), *_TAIL]), 0.01),
    3: (_echoes(1, [*_DEPTH, *_ANGLES, *_TAIL]), 0.001),
}
"""Row of a point and its unit of length [m] by data type; angles are in 0.01 deg."""
OLD_POINTS: dict[int, tuple[np.dtype[Any], int]] = {
    0: (_echoes(1, [*_MM, *_TAIL[:1]]), 100),
    1: (_echoes(1, [*_DEPTH, *_ANGLES, *_TAIL[:1]]), 100),
    2: (_echoes(1, [*_MM, *_TAIL]), 96),
    3: (_echoes(1, [*_DEPTH, *_ANGLES, *_TAIL]), 96),
    4: (_echoes(2, [*_MM, *_TAIL]), 48),
    5: (_echoes(2, [*_DEPTH, *_TAIL], _ANGLES), 48),
    7: (_echoes(3, [*_MM, *_TAIL]), 30),
    8: (_echoes(3, [*_DEPTH, *_TAIL], _ANGLES), 30),
}
"""Row of a point and number of points in a packet of the first SDK by data type; lengths are in mm."""
MID_360 = "mid-360"
HAP = "hap"
AVIA = "avia"
"""Profiles of the sensors."""
FAST_US = 3.5
"""Time from point to point below which a sensor is a HAP (2.2), else a Mid-360 (5) [us]."""
LOW_CONFIDENCE = np.array([any(tag >> bit & 3 == 2 for bit in (0, 2, 4)) for tag in range(256)])
"""Whether a tag of a Mid-360 marks a point between two objects, or of rain, fog or dust, by tag."""
NOISE = np.array([any(tag >> bit & 3 == 1 for bit in (0, 2)) for tag in range(256)])
"""Whether a tag of an Avia or a HAP marks a point as noise, by tag."""
SWEEP_NS = 100_000_000
"""Duration of a sweep, that of the profile; the sensor never repeats its pattern."""
MAX_PACKETS = 1000
"""Greatest number of packets in a sweep; a Mid-360 sends 208, a HAP 471, an Avia 800 with three returns."""
MAX_GAP = 10
"""Greatest number of sweeps between two packets; beyond it the sensor was off, or its clock was set."""


class LivoxDecoder(PacketDecoder):
    """Cuts sweeps by the sensor's clock; a sweep that began before the first received packet is discarded.

    Points that the sensor marks as unlikely are left out.
    """

    _window: int  # number of the present sweep, since time 0 of the sensor
    _before_ns: int | None  # time of the last packet of the sweep before; None where it was not received
    _packets: dict[int, bytes]  # packets of the present sweep by their time [ns]

    @staticmethod
    def accepts(payload: bytes) -> bool:
        """Whether a payload is a packet of points of a Livox."""
        return sender_of(payload) is not None

    def decode(self, received_s: float, payload: bytes) -> Sequence[Sweep]:
        """Sweeps completed by a packet."""
        sender = sender_of(payload)
        if sender is None:
            self.refuse("no packet of points of a Livox")
            return []
        self.profile = sender
        stamp_ns = stamp_ns_of(payload)
        window = stamp_ns // SWEEP_NS
        ahead = window - self._window
        late = ahead == -1 or stamp_ns in self._packets
        if late or (ahead == 0 and len(self._packets) >= MAX_PACKETS):
            reason = "late or twice" if late else "more than a turn has; do several sensors send to this port?"
            self.refuse(reason)
            return []
        self._clock.unwrapped(stamp_ns * 1e-9, received_s)
        sweeps = []
        if not 0 <= ahead <= MAX_GAP:
            self._before_ns = None
        elif ahead:
            sweeps = self._sweep()
        if ahead:
            self._window = window
            self._packets = {}
        self._packets[stamp_ns] = payload
        return sweeps

    def finish(self) -> Sequence[Sweep]:
        """Last sweep, if only the packet after it is missing."""
        sweeps: list[Sweep] = []
        if len(self._packets) > 1:
            *_, before_ns, last_ns = sorted(self._packets)
            next_ns = last_ns + (last_ns - before_ns)
            if next_ns // SWEEP_NS > self._window:
                sweeps = self._sweep()
        self._reset()
        return sweeps

    def _reset(self) -> None:
        self._clock = DeviceClock()
        self._window = -2 * MAX_GAP
        self._before_ns = None
        self._packets = {}

    def _sweep(self) -> list[Sweep]:
        """Sweep of the packets kept, if its begin was received."""
        stamps_ns = sorted(self._packets)
        before_ns = self._before_ns
        self._before_ns = stamps_ns[-1]
        if before_ns is None:
            return []
        gaps_ns = np.diff([before_ns, *stamps_ns])
        lost = int(np.maximum(np.rint(gaps_ns / np.median(gaps_ns)) - 1, 0).sum())  # lying stamps have gaps near 0
        self.reception.lost += lost
        parts = [_points(self._packets[stamp_ns]) for stamp_ns in stamps_ns]
        middle_ns = self._window * SWEEP_NS + SWEEP_NS // 2
        delays_s = np.array([(stamp_ns - middle_ns) * 1e-9 for stamp_ns in stamps_ns], np.float32)
        delay_s = delays_s.repeat([len(part) for part in parts])
        stamp_s = middle_ns * 1e-9 + self._clock.offset_s
        return [Sweep(stamp_s, np.concatenate(parts), complete=lost == 0, delay_s=delay_s)]


def sender_of(payload: bytes) -> str | None:
    """Profile of the sensor that sent a packet; None if it is no packet of points of a Livox."""
    if len(payload) <= HEADER.size:
        return None
    if payload[0] == OLD_VERSION:
        row, number = OLD_POINTS.get(payload[9], (None, 0))
        return AVIA if row is not None and len(payload) == OLD_HEADER.size + number * row.itemsize else None
    version, length, span, points, kind, _ = HEADER.unpack_from(payload)
    if version != 0 or kind not in POINTS or length != len(payload):
        return None
    if length != HEADER.size + points * POINTS[kind][0].itemsize:
        return None
    return HAP if 0 < span * 0.1 < FAST_US * points else MID_360


def stamp_ns_of(payload: bytes) -> int:
    """Time of the first point of a packet [ns]; a date begins again with each month."""
    if payload[0] != OLD_VERSION:
        return int(HEADER.unpack_from(payload)[-1])
    _, form, _, stamp_ns = OLD_HEADER.unpack_from(payload)
    if form != UTC:
        return int(stamp_ns)
    _, _, day, hour = payload[10:14]
    return (day * 24 + hour) * 3600 * 10**9 + int.from_bytes(payload[14:18], "little") * 1000


def _points(payload: bytes) -> Float32:
    """(N, 4) points of a packet; the return with the greatest reflectance represents a point."""
    if payload[0] == OLD_VERSION:
        row = OLD_POINTS[payload[9]][0]
        unit_m = 0.001
        table = np.frombuffer(payload, row, offset=OLD_HEADER.size)
    else:
        row, unit_m = POINTS[payload[10]]
        table = np.frombuffer(payload, row, offset=HEADER.size)
    echoes = table["echoes"]
    best = echoes[np.arange(len(echoes)), echoes["reflectance"].argmax(axis=1)]
    names = best.dtype.names or ()
    angles = best if "zenith" in names else table
    if "tag" in names:
        sure = ~(LOW_CONFIDENCE if sender_of(payload) == MID_360 else NOISE)[best["tag"]]
        best = best[sure]
        angles = angles[sure]
    points = np.empty((len(best), 4), np.float32)
    for i, column in enumerate(_xyz(best, angles) if "depth" in names else (best[axis] for axis in _AXES)):
        points[:, i] = column * unit_m
    points[:, 3] = best["reflectance"] / 255
    return points[points[:, :3].any(axis=1)]


def _xyz(best: NDArray[Any], angles: NDArray[Any]) -> tuple[Float64, Float64, Float64]:
    """Coordinates of returns by their depth and angles."""
    zenith = np.deg2rad(angles["zenith"] * 0.01)
    azimuth = np.deg2rad(angles["azimuth"] * 0.01)
    across = best["depth"] * np.sin(zenith)
    return across * np.cos(azimuth), across * np.sin(azimuth), best["depth"] * np.cos(zenith)


DRIVER = Driver(
    maker="Livox",
    port=56301,
    recognises=LivoxDecoder.accepts,
    decoder=lambda name, _options, _host: LivoxDecoder(name),
)
