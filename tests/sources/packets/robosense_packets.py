"""RoboSense's packets, by bytes written as the manuals lay them out."""

import struct
from dataclasses import dataclass, field
from math import asin, cos, degrees, hypot, radians, sin

from tests.sources.packets.simulated import BEGAN_S

TURN_S = 0.1
RANGE_M = 10.0
FIRST_S = 36_000.0
"""Time of the day of the first packet [s]."""
NOMINAL_RS_16 = [-15 + 2 * i for i in range(8)] + [15 - 2 * i for i in range(8)]


@dataclass(frozen=True)
class Written:
    """A model's packets: first bytes, type and version, number of blocks and channels, beams, unit, time of a firing.

    `lens_m` is the position of the lens ahead of and above the origin.
    """

    begin: str
    kind: tuple[int, int]
    beams: int
    unit_m: float
    firing_s: float
    lens_m: tuple[float, float]
    blocks: int = 12
    channels: int = 32
    utc: bool = True
    resolution: int = 0
    angles: list = field(default_factory=list)

    def angles_deg(self):
        """Elevation and azimuth of each beam; those of an RS-16 look straight ahead."""
        if self.angles:
            return self.angles
        if self.begin.startswith("55aa050a") and self.beams == 16:
            return [(e, 0.0) for e in NOMINAL_RS_16]
        low, high = (2.0, 88.0) if self.begin != "55aa055a" or self.beams > 32 else (-16.0, 15.0)
        step = (high - low) / (self.beams - 1)
        return [(round(low + step * i, 2), 2.0 * (-1) ** i) for i in range(self.beams)]

    def period_s(self, returns=1):
        """Time from one packet to the next."""
        return self.blocks * self.channels / self.beams / returns * self.firing_s

    def header(self, at_s, returns=1):
        """The 42 bytes before the blocks."""
        head = bytearray(42)
        begin = bytes.fromhex(self.begin)
        head[: len(begin)] = begin
        head[17] = self.resolution
        if self.blocks == 8:
            head[17] = 3 if returns == 2 else 0
        micros = round(at_s * 1e6)
        if self.utc:
            head[20:26] = (1_760_572_800 + micros // 10**6).to_bytes(6, "big")
            head[26:30] = struct.pack(">I", micros % 10**6)
        else:
            second = micros // 10**6
            head[20:26] = bytes((25, 11, 30, second // 3600, second // 60 % 60, second % 60))
            head[26:30] = struct.pack(">HH", micros // 1000 % 1000, micros % 1000)
        head[31:33] = self.kind
        return bytes(head)

    def packet(self, at_s, returns=1, cells=((RANGE_M, 51),)):
        """Packet whose first firing is at a time of the day; the head looks ahead at the end of each turn."""
        out = self.header(at_s, returns)
        per_block = max(self.channels // self.beams // returns, 1)  # firings
        blocks_per_firing = max(self.beams * returns // self.channels, 1)
        for k in range(self.blocks):
            firing = k // blocks_per_firing * per_block
            turned = (at_s + firing * self.firing_s) / TURN_S
            out += b"\xff\xee" + struct.pack(">H", round(turned * 36_000) % 36_000)
            for c in range(self.channels):
                if per_block * returns > 1 and self.beams == 16:
                    echo = c // 16 if returns == 2 else 0
                else:
                    echo = k % blocks_per_firing // max(self.beams // self.channels, 1)
                far_m, bright = cells[echo % len(cells)]
                out += struct.pack(">HB", round(far_m / self.unit_m), bright)
        return out.ljust(1248, b"\0")

    def difop(self, returns=1):
        """Packet with the angles of the beams."""
        out = bytearray(1248)
        out[:8] = bytes.fromhex("a5ff005a11115555")
        out[300] = 0 if returns == 2 else 4
        angles = self.angles_deg()
        if not self.utc and self.beams == 16:
            for i, (elevation, _) in enumerate(angles):
                out[1165 + 3 * i : 1168 + 3 * i] = round(abs(elevation) * 10_000).to_bytes(3, "big")
            return bytes(out)
        room = 96 if self.blocks == 8 else 32
        for column in (0, 1):
            for i, both in enumerate(angles):
                at = 468 + 3 * (room * column + i)
                out[at : at + 3] = struct.pack(">BH", both[column] < 0, round(abs(both[column]) * 100))
        return bytes(out)

    def turns(self, n, returns=1, **said):
        """Packets of so many turns, with the times of their reception."""
        step_s = self.period_s(returns)
        times_s = [FIRST_S + step_s * k for k in range(int(n * TURN_S / step_s))]
        return [(BEGAN_S + at_s + step_s, self.packet(at_s, returns, **said)) for at_s in times_s]

    def elevation_deg(self, elevation, aside):
        """Elevation of a point at RANGE_M as seen from the origin."""
        forward, up = self.lens_m
        flat = RANGE_M * cos(radians(elevation))
        across = hypot(flat * cos(radians(aside)) + forward, flat * sin(radians(aside)))
        high = RANGE_M * sin(radians(elevation)) + up
        return degrees(asin(high / hypot(across, high)))


WRITTEN = {
    "rs-16": Written("55aa050a5aa550a0", (1, 0), 16, 0.005, 55.5e-6, (0.03825, 0.0), utc=False),
    "bpearl": Written("55aa050a5aa550a0", (3, 0), 32, 0.005, 55.52e-6, (0.01473, 0.09427), utc=False),
    "bpearl 4": Written("55aa050a5aa550a0", (3, 4), 32, 0.0025, 55.56e-6, (0.01619, 0.09571)),
    "helios-16": Written("55aa055a", (7, 3), 16, 0.0025, 55.56e-6, (0.03498, 0.0), resolution=1),
    "helios-32": Written("55aa055a", (6, 1), 32, 0.005, 55.56e-6, (0.03498, 0.0)),
    "airy": Written("55aa055a", (0, 2), 96, 0.005, 111.08e-6, (0.0075, 0.04532), blocks=8, channels=48),
    "airy-48": Written("55aa055a", (0, 1), 48, 0.005, 111.08e-6, (0.0075, 0.04532), blocks=8, channels=48),
}
