"""Sweeps from the packets of a Livox Mid-360 (protocol of Livox SDK2)."""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Any

import numpy as np

from modt.sources.drivers import Driver
from modt.sources.packets.device_clock import DeviceClock
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import Sweep
from modt.types import Float32

HEADER = Struct("<BH2xH3xB13x4xQ")
"""Version, number of bytes, number of points, data type, time of the first point [ns]."""
_TAIL = [("reflectance", "u1"), ("tag", "u1")]
_AXES = ("x", "y", "z")
POINTS: dict[int, tuple[np.dtype[Any], float]] = {
    1: (np.dtype([*((axis, "<i4") for axis in _AXES), *_TAIL]), 0.001),
    2: (np.dtype([*((axis, "<i2") for axis in _AXES), *_TAIL]), 0.01),
    3: (np.dtype([("depth", "<u4"), ("zenith", "<u2"), ("azimuth", "<u2"), *_TAIL]), 0.001),
}
"""Row of a point and its unit of length [m] by data type; type 3 has angles [0.01 deg]."""
LOW_CONFIDENCE = np.array([any(tag >> bit & 3 == 2 for bit in (0, 2, 4)) for tag in range(256)])
"""Whether a tag marks a point between two objects, or of rain, fog or dust, by tag."""
SWEEP_NS = 100_000_000
"""Duration of a sweep, that of the profile; the sensor never repeats its pattern."""
MAX_PACKETS = 1000
"""Greatest number of packets in a sweep; a Mid-360 sends 208."""
MAX_GAP = 10
"""Greatest number of sweeps between two packets; beyond it the sensor was off, or its clock was set."""


class LivoxDecoder(PacketDecoder):
    """Cuts sweeps by the sensor's clock; a sweep that began before the first received packet is discarded.

    Points that the sensor marks as unlikely are left out.
    """

    profile = "mid-360"
    _window: int  # number of the present sweep, since time 0 of the sensor
    _before_ns: int | None  # time of the last packet of the sweep before; None where it was not received
    _packets: dict[int, bytes]  # packets of the present sweep by their time [ns]

    def accepts(self, payload: bytes) -> bool:
        """Whether a payload is a packet of points of a Livox."""
        return is_packet(payload)

    def decode(self, received_s: float, payload: bytes) -> Sequence[Sweep]:
        """Sweeps completed by a packet."""
        if not is_packet(payload):
            self.refuse("no packet of points of a Livox")
            return []
        stamp_ns = HEADER.unpack_from(payload)[-1]
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
        points = np.concatenate([_points(self._packets[stamp_ns]) for stamp_ns in stamps_ns])
        middle_s = (self._window + 0.5) * SWEEP_NS * 1e-9
        return [Sweep(middle_s + self._clock.offset_s, points, complete=lost == 0)]


def is_packet(payload: bytes) -> bool:
    """Whether a payload is a packet of points of a Livox."""
    if len(payload) <= HEADER.size:
        return False
    version, length, points, kind, _ = HEADER.unpack_from(payload)
    if version != 0 or kind not in POINTS or length != len(payload):
        return False
    return bool(length == HEADER.size + points * POINTS[kind][0].itemsize)


def _points(payload: bytes) -> Float32:
    """(N, 4) points of a packet."""
    row, unit_m = POINTS[payload[10]]
    table = np.frombuffer(payload, row, offset=HEADER.size)
    table = table[~LOW_CONFIDENCE[table["tag"]]]
    points = np.empty((len(table), 4), np.float32)
    if "depth" in (row.names or ()):
        zenith = np.deg2rad(table["zenith"] * 0.01)
        azimuth = np.deg2rad(table["azimuth"] * 0.01)
        across = table["depth"] * np.sin(zenith)
        columns = [across * np.cos(azimuth), across * np.sin(azimuth), table["depth"] * np.cos(zenith)]
    else:
        columns = [table[axis] for axis in _AXES]
    for i, column in enumerate(columns):
        points[:, i] = column * unit_m
    points[:, 3] = table["reflectance"] / 255
    return points[points[:, :3].any(axis=1)]


DRIVER = Driver(
    maker="Livox",
    port=56301,
    recognises=is_packet,
    decoder=lambda name, _options, _host: LivoxDecoder(name),
)
