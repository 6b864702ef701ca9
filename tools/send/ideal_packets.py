"""Sweeps as the packets of an ideal VLP-16, HDL-64E, Hesai XT-32 or Livox Mid-360, without errors of its lasers."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import ClassVar

import numpy as np
import yaml
from numpy.typing import NDArray

from modt.types import Float32, Float64, Frame

UNIT_M = 0.002
TURN = 36_000
HOUR_US = 3_600_000_000
DAY_US = 86_400_000_000


@dataclass(frozen=True)
class Layout:
    """Layout of the firings in a Velodyne's packets.

    Attributes:
        elevations_deg: elevations of the lasers, in the order of a firing.
        firing_us: time from one firing to the next [us].
        headers: headers of the blocks of a packet, repeated as often as they fit.
        tail: the last two bytes of a packet.
        blocks, lasers: number of blocks in a packet, and of lasers in a block.
        unit_m: unit of distances [m].
    """

    elevations_deg: tuple[float, ...]
    firing_us: float
    headers: tuple[bytes, ...] = ()
    tail: bytes = b""
    blocks: int = 12
    lasers: int = 32
    unit_m: float = UNIT_M
    cell: ClassVar = np.dtype([("distance", "<u2"), ("reflectance", "u1")])

    @property
    def firings(self) -> int:
        """Number of firings in a packet."""
        return self.blocks * self.lasers // len(self.elevations_deg)

    def packet(self, azimuths: Sequence[int], cells: Float64, at_us: float) -> bytes:
        """Packet for the azimuths of its blocks [0.01 deg], and (blocks, lasers, 2) distances and reflectances."""
        table = self._table(cells)
        body = b""
        for i, azimuth in enumerate(azimuths):
            body += self.headers[i % len(self.headers)] + struct.pack("<H", azimuth) + table[i].tobytes()
        return body + struct.pack("<I", round(at_us) % HOUR_US) + self.tail

    def _table(self, cells: Float64) -> NDArray[np.void]:
        """Cells as they stand in a packet."""
        table = np.zeros(cells.shape[:2], self.cell)
        table["distance"] = cells[..., 0]
        table["reflectance"] = cells[..., 1]
        return table


class HesaiLayout(Layout):
    """Layout of the firings in an XT-32's packets."""

    cell: ClassVar = np.dtype([("distance", "<u2"), ("reflectance", "u1"), ("none", "u1")])

    def packet(self, azimuths: Sequence[int], cells: Float64, at_us: float) -> bytes:
        """Packet as in Layout, stamped with the time of the last firing since midnight."""
        table = self._table(cells)
        head = bytes((0xEE, 0xFF, 6, 1, 0, 0, self.lasers, self.blocks, 1, round(1000 * self.unit_m), 1, 1))
        body = b"".join(struct.pack("<H", a) + row.tobytes() for a, row in zip(azimuths, table, strict=True))
        second, micros = divmod(round(at_us + (self.firings - 1) * self.firing_us) % DAY_US, 1_000_000)
        date = bytes((119, 1, 1, second // 3600, second // 60 % 60, second % 60))
        return head + body + bytes(10) + b"\x37\x58\x02" + date + struct.pack("<IB", micros, 0x42) + bytes(4)


HDL_64E_DEG = (*(2.0 - i / 3 for i in range(32)), *(-8.83 - i / 2 for i in range(32)))
VLP_16_DEG = tuple(float(v) for i in range(8) for v in (-15 + 2 * i, 1 + 2 * i))
LAYOUTS = {
    "hdl-64e": Layout(HDL_64E_DEG, 48.0, (b"\xff\xee", b"\xff\xdd"), b"V\x00"),
    "vlp-16": Layout(VLP_16_DEG, 55.296, (b"\xff\xee",), b"\x37\x22"),
    "xt-32": HesaiLayout(tuple(15.0 - i for i in range(32)), 50.0, blocks=8, unit_m=0.004),
}


MID_360 = "mid-360"
LIVOX_POINTS = 96
MODELS = (*LAYOUTS, MID_360)


def ideal_calibration(layout: Layout) -> str:
    """Calibration of the ideal sensor: Hesai's table, or YAML of ROS's velodyne_pointcloud."""
    if isinstance(layout, HesaiLayout):
        rows = (f"{i},{elevation},0" for i, elevation in enumerate(layout.elevations_deg, 1))
        return "\n".join(("Channel,Elevation,Azimuth", *rows))
    none = ("rot", "dist", "dist_x", "dist_y", "vert_offset", "horiz_offset")
    names = ["rot_correction", *(f"{name}_correction" for name in none[4:]), "dist_correction"]
    names += ["dist_correction_x", "dist_correction_y", "focal_distance", "focal_slope"]
    lasers = [
        {"laser_id": i, "vert_correction": float(np.deg2rad(elevation))} | dict.fromkeys(names, 0.0)
        for i, elevation in enumerate(layout.elevations_deg)
    ]
    return yaml.safe_dump({"num_lasers": len(lasers), "distance_resolution": UNIT_M, "lasers": lasers})


def packets_of(frames: Sequence[Frame], model: str, period_s: float) -> Iterator[tuple[float, bytes]]:
    """Time [s] at which each packet is full, and payload, of sweeps that follow one another without a gap."""
    if model == MID_360:
        return livox_packets_of(frames, period_s)
    return _turning(frames, LAYOUTS[model], period_s)


def livox_packets_of(frames: Sequence[Frame], period_s: float) -> Iterator[tuple[float, bytes]]:
    """Packets as in `packets_of`, for which the points of each sweep are spread over its time, 96 a packet in mm."""
    row = np.dtype([("xyz", "<i4", 3), ("reflectance", "u1"), ("tag", "u1")])
    for k, frame in enumerate(frames):
        n_packets = -(-len(frame.points) // LIVOX_POINTS)
        step_s = period_s / n_packets
        for i in range(n_packets):
            points = frame.points[i * LIVOX_POINTS : (i + 1) * LIVOX_POINTS]
            table = np.zeros(len(points), row)
            table["xyz"] = np.rint(points[:, :3] * 1000)
            table["reflectance"] = np.rint(points[:, 3].clip(0, 1) * 255)
            at_s = k * period_s + i * step_s
            body = table.tobytes()
            span = round(step_s * 1e7 * (len(points) - 1) / LIVOX_POINTS)
            head = struct.pack("<BHHHHBBB12x", 0, 36 + len(body), span, len(points), i, 0, 1, 0)
            stamp = struct.pack("<Q", round(at_s * 1e9))
            yield at_s + step_s, head + struct.pack("<I", zlib.crc32(stamp + body)) + stamp + body


def _turning(frames: Sequence[Frame], layout: Layout, period_s: float) -> Iterator[tuple[float, bytes]]:
    per_turn = round(period_s * 1e6 / layout.firing_us)
    images = (_image(frame.points, layout, per_turn) for frame in frames)
    firings = ((i, *firing) for i, image in enumerate(images) for firing in enumerate(image))
    kept: list[tuple[int, Float64]] = []
    packet = count()
    for sweep, column, firing in firings:
        kept.append((sweep * per_turn + column, firing))
        if len(kept) == layout.firings:
            packet_us = layout.firings * layout.firing_us
            at_us = next(packet) * packet_us
            yield (at_us + packet_us) * 1e-6, _packet(kept, layout, per_turn, at_us)
            kept = []


def _image(points: Float32, layout: Layout, per_turn: int) -> Float64:
    """(per_turn, lasers, 2) distance in units and reflectance in bytes of the nearest point of each firing."""
    x, y, z, reflectance = points.T.astype(np.float64)
    distance = np.sqrt(x * x + y * y + z * z)
    seen = np.flatnonzero((distance > 0) & (distance < layout.unit_m * 65_535))
    seen = seen[np.argsort(-distance[seen], kind="stable")]  # the nearest is written last
    elevation = np.rad2deg(np.arcsin(z[seen] / distance[seen]))
    order = np.argsort(layout.elevations_deg)
    sorted_deg = np.array(layout.elevations_deg)[order]
    laser = order[np.searchsorted((sorted_deg[1:] + sorted_deg[:-1]) / 2, elevation)]
    turned = (np.pi - np.arctan2(y[seen], x[seen])) / (2 * np.pi)  # 0 behind the sensor, clockwise
    column = (turned * per_turn).astype(np.int64) % per_turn
    image = np.zeros((per_turn, len(layout.elevations_deg), 2))
    image[column, laser, 0] = np.rint(distance[seen] / layout.unit_m)
    image[column, laser, 1] = np.rint(255 * reflectance[seen].clip(0, 1))
    return image


def _packet(firings: Sequence[tuple[int, Float64]], layout: Layout, per_turn: int, at_us: float) -> bytes:
    cells = np.concatenate([values for _, values in firings]).reshape(layout.blocks, layout.lasers, 2)
    of_block = [firings[i * layout.lasers // len(layout.elevations_deg)][0] for i in range(layout.blocks)]
    azimuths = [(round((firing + 0.5) * TURN / per_turn) + TURN // 2) % TURN for firing in of_block]
    return layout.packet(azimuths, cells, at_us)
