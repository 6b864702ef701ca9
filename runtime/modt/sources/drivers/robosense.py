"""Sweeps from the packets of RoboSense's RS-LiDAR-16, Helios, Bpearl and Airy.

Points come in MSOP packets. The angles of the beams come in DIFOP packets, which the sensor sends to another port.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import repeat
from pathlib import Path
from struct import Struct
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.sources.drivers import Driver
from modt.sources.packets.turn_decoder import TURN, Entry, Turn, TurnDecoder, points_of, strongest
from modt.sources.stream import Sweep
from modt.sources.text_file import read_lines
from modt.types import Float32, Float64

log = logging.getLogger(__name__)

PACKET_BYTES = 1248
HEADER_BYTES = 42
OLD_MSOP = bytes.fromhex("55aa050a5aa550a0")
MSOP = bytes.fromhex("55aa055a")
"""First bytes of the packets of points: of RS-16 and Bpearl, and of later sensors."""
DIFOP = bytes.fromhex("a5ff005a11115555")
"""First bytes of the packets of angles."""
BLOCK = b"\xff\xee"
STAMP_AT = 20
"""Offset of the time: year to second (a byte each), ms and us (2 each), or seconds since 1970 (6) and us (4)."""
TYPE_AT = 31
"""Offset of the type of sensor, which older sensors write into the byte before; its version follows."""
RESOLUTION_AT = 17
"""Offset of the unit of distances of a Helios: 1 for 2.5 mm, 0 for 5 mm; of the return mode of an Airy."""
RETURNS_AT = 300
REVERSED_AT = 337
"""Offsets in DIFOP of the return mode (0: two returns), and of the sense of rotation of a Bpearl."""
ANGLES_AT = 468
"""Offset in DIFOP of the elevations of the beams, which their azimuths follow."""
RS_16_ANGLES_AT = 1165
ANGLE = np.dtype([("negative", "u1"), ("value", ">u2")])
"""Angle of a beam [0.01 deg] in DIFOP."""
CELL = np.dtype([("distance", ">u2"), ("reflectance", "u1")])
MAX_ANGLE_DEG = 90.0
RS_16_DEG = (-15.0, -13.0, -11.0, -9.0, -7.0, -5.0, -3.0, -1.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0)
"""Nominal elevations of an RS-16."""
REMEDY = (
    "record and let through its DIFOP packets (UDP port 7788) too, or give calibration=FILE, a CSV of elevation and "
    "azimuth of each beam"
)


@dataclass(frozen=True)
class Model:
    """A model of sensor.

    Attributes:
        name: name in messages.
        beams: possible numbers of beams.
        firing_us: time from one firing to the next [us].
        fired_us: time of each beam after its firing begins [us], for the greatest number of beams.
        forward_m, up_m: position of the lens, which turns with the head, ahead of and above the origin [m].
        unit_m: unit of distances [m].
        utc: whether the stamps are seconds since 1970.
        blocks, channels: number of blocks in a packet, and of channels in a block.
    """

    name: str
    beams: tuple[int, ...]
    firing_us: float
    fired_us: tuple[float, ...]
    forward_m: float
    up_m: float
    unit_m: float = 0.005
    utc: bool = True
    blocks: int = 12
    channels: int = 32

    @cached_property
    def table(self) -> np.dtype[Any]:
        """Type of the blocks of a packet."""
        block = [("flag", "S2"), ("azimuth", ">u2"), ("cells", CELL, (self.channels,))]
        return np.dtype((block, (self.blocks,)))

    @cached_property
    def azimuths(self) -> Struct:
        """Struct of the azimuths of the blocks."""
        cells = CELL.itemsize * self.channels
        return Struct(f">{HEADER_BYTES}x" + f"2xH{cells}x" * self.blocks)

    def sends(self, payload: bytes) -> bool:
        """Whether the blocks of a packet are those of this model."""
        step = 4 + CELL.itemsize * self.channels
        return all(payload.startswith(BLOCK, HEADER_BYTES + step * block) for block in range(self.blocks))


def _evenly(step_us: float, number: int) -> tuple[float, ...]:
    return tuple(step_us * i for i in range(number))


_BPEARL_US = tuple(begin + t for begin in (0.0, 25.68, 1.28, 26.96) for t in _evenly(2.56, 8))
_AIRY_BEGINS_US = (0.0, 5.712, 12.376, 19.04, 25.704, 33.32, 41.888, 50.456, 59.024, 70.448, 81.872, 93.296)
_AIRY_US = tuple(t for begin in _AIRY_BEGINS_US for t in repeat(begin, 8))
RS_16 = Model("RS-16", (16,), 55.5, _evenly(2.8, 16), 0.03825, 0.0, utc=False)
BPEARL = Model("Bpearl", (32,), 55.52, _BPEARL_US, 0.01473, 0.09427, utc=False)
BPEARL_4 = Model("Bpearl 4", (32,), 55.56, _evenly(1.668, 32), 0.01619, 0.09571, 0.0025)
HELIOS = Model("Helios", (16, 32), 55.56, _evenly(1.73, 32), 0.03498, 0.0)
AIRY = Model("Airy", (96, 48), 111.08, _AIRY_US, 0.0075, 0.04532, blocks=8, channels=48)
OTHER = "another model"
"""Signature of packets that no model here sends."""
VERSION_4 = 4
PROFILES = {("RS-16", 16): "rs-16", ("Helios", 16): "rs-16", ("Helios", 32): "helios-32", ("Airy", 96): "airy"}
PROFILES |= {("Bpearl", 32): "bpearl", ("Bpearl 4", 32): "bpearl"}
"""Shipped profile by model and number of beams."""
MAX_SPAN_DEG = 32.0
"""Greatest span of the beams of a Helios that its profile fits; those of a 5515 are spread over 70 degrees."""


def signature_of(payload: bytes) -> Model | str | None:
    """Model that sent a packet, or OTHER; None if a payload is no packet of points of a RoboSense."""
    if len(payload) != PACKET_BYTES or not payload.startswith((OLD_MSOP, MSOP)):
        return None
    kind = payload[TYPE_AT] or payload[TYPE_AT - 1]
    model: Model | None
    if payload.startswith(MSOP):
        model = AIRY if AIRY.sends(payload) else HELIOS
    elif kind == 3:
        model = BPEARL_4 if payload[TYPE_AT + 1] == VERSION_4 else BPEARL
    else:
        model = RS_16 if kind <= 1 else None
    if model is None or not model.sends(payload):
        return OTHER
    greatest: int = max(model.azimuths.unpack_from(payload))
    return model if greatest <= TURN else None


def angles_of(payload: bytes, model: Model) -> Float64 | None:
    """(beams, 2) elevation and azimuth of the beams [deg] from a DIFOP packet; None where it has none."""
    if model is RS_16:
        parts = np.frombuffer(payload, np.uint8, 48, RS_16_ANGLES_AT).reshape(16, 3).astype(np.int64)
        elevation_deg = parts @ [65_536, 256, 1] * 1e-4 * np.repeat([-1.0, 1.0], 8)
        table = np.column_stack([elevation_deg, np.zeros(16)])
    else:
        raw = np.frombuffer(payload, ANGLE, 2 * max(model.beams), ANGLES_AT).reshape(2, -1)
        table = (raw["value"] * np.where(raw["negative"], -0.01, 0.01)).T
    for beams in sorted(model.beams, reverse=True):
        angles_deg = table[:beams]
        if (np.abs(angles_deg) <= MAX_ANGLE_DEG).all() and len(
            np.unique(angles_deg[:, 0])
        ) > 0.75 * beams:  # unused rows are alike
            return angles_deg
    return None


def read_angles(path: Path) -> Float64:
    """(beams, 2) elevation and azimuth of the beams [deg] from a file with a line a beam.

    Raises:
        MisuseError: the file cannot be read, or is no calibration.
    """
    rows = [line.split(",") for line in read_lines(path, REMEDY) if line.strip()]
    try:
        table = np.array([[float(row[0]), float(row[1]) if len(row) > 1 else 0.0] for row in rows]).reshape(-1, 2)
    except ValueError:
        table = np.zeros((0, 2))
    if len(table) not in (16, 32, 48, 96) or not (np.abs(table) <= MAX_ANGLE_DEG).all():
        raise MisuseError(path, "no calibration of a RoboSense", REMEDY)
    return table


class RobosenseDecoder(TurnDecoder):
    """Turns of a RoboSense; the return with the greatest reflectance represents a firing."""

    maker = "RoboSense"
    wrap_s = 86_400.0
    signature = staticmethod(signature_of)

    def __init__(self, name: str, angles_deg: Float64 | None = None) -> None:
        """`angles_deg`: as in `read_angles`; None takes those of the sensor's DIFOP packets."""
        super().__init__(name)
        self._given_deg = angles_deg
        self._difop = b""
        self._model = RS_16
        self._angles_deg = np.zeros((0, 2))

    def describe(self, payload: bytes) -> bool:
        """Take angles and return mode from a DIFOP packet; whether a payload is one."""
        if len(payload) != PACKET_BYTES or not payload.startswith(DIFOP):
            return False
        self._difop = payload
        if self._given_deg is None and self._signature is not None:
            angles_deg = angles_of(payload, self._model)
            if angles_deg is not None and len(angles_deg) == len(self._angles_deg):
                self._take(angles_deg)
        return True

    def _recognise(self, model: Model | str, _payloads: Sequence[bytes]) -> Model | None:
        if not isinstance(model, Model):
            self.unknown = "of a RoboSense that is not decoded; give the point clouds of its driver, ros2:///TOPIC"
            return None
        return model if self._orient(model) else None

    def _orient(self, model: Model) -> bool:
        """Take the angles of a model's beams; whether they are known."""
        angles_deg = self._given_deg
        if angles_deg is None and self._difop:
            angles_deg = angles_of(self._difop, model)
        if angles_deg is None and model is RS_16:
            log.warning("%s: beams as of any RS-16; %s", self.name, REMEDY)
            angles_deg = np.column_stack([RS_16_DEG, np.zeros(16)])
        if angles_deg is None or len(angles_deg) not in model.beams:
            given = "are not known" if angles_deg is None else f"have {len(angles_deg)} beams"
            self.unknown = f"the angles of this {model.name} {given}; {REMEDY}"
            return False
        self._model = model
        wide = model is HELIOS and np.ptp(angles_deg[:, 0]) > MAX_SPAN_DEG
        self.profile = None if wide else PROFILES.get((model.name, len(angles_deg)))
        self._packet_s = model.blocks * model.channels / len(angles_deg) * model.firing_us * 1e-6
        self._take(angles_deg)
        return True

    def _take(self, angles_deg: Float64) -> None:
        self._angles_deg = angles_deg
        self.elevations_deg = tuple(angles_deg[:, 0].tolist())
        self._reach = math.ceil(100 * np.abs(angles_deg[:, 1]).max()) + 100

    def _entry(self, received_s: float, payload: bytes) -> Entry:
        stamp = payload[STAMP_AT : STAMP_AT + 10]
        if self._model.utc:
            sent_s = int.from_bytes(stamp[:6], "big") % 86_400 + int.from_bytes(stamp[6:], "big") * 1e-6
        else:
            sent_s = stamp[3] * 3600.0 + stamp[4] * 60.0 + stamp[5]
            sent_s += int.from_bytes(stamp[6:8], "big") * 1e-3 + int.from_bytes(stamp[8:], "big") * 1e-6
        time_s = self._clock.unwrapped(sent_s % self.wrap_s, received_s - self._packet_s)
        first, *_, last = self._model.azimuths.unpack_from(payload)
        return Entry.of(time_s, first, last, payload)

    def _returns(self, payload: bytes) -> int:
        """Number of returns of a firing."""
        if self._model is AIRY:
            return 2 if payload[RESOLUTION_AT] == 3 else 1
        return 2 if self._difop and self._difop[RETURNS_AT] == 0 else 1

    def _unit_m(self, payload: bytes) -> float:
        """Unit of distances [m]."""
        return 0.0025 if self._model is HELIOS and payload[RESOLUTION_AT] else self._model.unit_m

    def _sweeps(self, turn: Turn) -> Sequence[Sweep]:
        sweeps = super()._sweeps(turn)
        if self._model in (BPEARL, BPEARL_4) and self._difop and self._difop[REVERSED_AT]:
            mirror = np.array([1, -1, 1, 1], np.float32)
            return [replace(sweep, points=sweep.points * mirror, turn_s=0.0) for sweep in sweeps]
        return sweeps

    def _table(self, entries: Sequence[Entry]) -> Float32:
        model = self._model
        returns = self._returns(entries[0].packet)
        slots = max(len(self._angles_deg), model.channels // returns)  # of a return, in a block or a firing's blocks
        raw = b"".join(entry.packet[HEADER_BYTES : HEADER_BYTES + model.table.itemsize] for entry in entries)
        blocks = np.frombuffer(raw, model.table.base)
        distance, reflectance = strongest(blocks["cells"].reshape(-1, returns, slots))
        firing, slot = np.nonzero(distance)
        begin, step = _turned(blocks["azimuth"][:: len(blocks) // len(distance)].astype(np.float32))
        head = np.deg2rad((begin[firing] + step[firing] * self._shares(slots)[slot]) * np.float32(0.01))
        distance_m = distance[firing, slot] * np.float32(self._unit_m(entries[0].packet))
        elevation, aside = np.deg2rad(self._angles_deg[slot % len(self._angles_deg)].T).astype(np.float32)
        across_m = distance_m * np.cos(elevation)
        x = across_m * np.cos(head + aside) + model.forward_m * np.cos(head)
        y = -across_m * np.sin(head + aside) - model.forward_m * np.sin(head)
        return points_of(x, y, distance_m * np.sin(elevation) + model.up_m, reflectance[firing, slot])

    def _shares(self, slots: int) -> Float32:
        """(slots,) time of each slot since its block begins, as a share of that to the next block."""
        model = self._model
        beams = len(self._angles_deg)
        fired_us = model.fired_us[:: max(model.beams) // beams] if model is AIRY else model.fired_us[:beams]
        firings = slots // beams
        slot_us = np.tile(fired_us, firings) + np.repeat(np.arange(firings) * model.firing_us, beams)
        return (slot_us / (firings * model.firing_us)).astype(np.float32)


def _turned(azimuths: Float32) -> tuple[Float32, Float32]:
    """(n,) azimuth of each block, and angle by which the head turns until the next one [0.01 deg]."""
    step = np.diff(azimuths) % TURN if len(azimuths) > 1 else np.zeros(1, np.float32)
    usual = np.median(step)
    step = np.append(step, usual)
    step[step > 2 * usual] = usual  # a blind sector or a lost packet
    return azimuths, step[: len(azimuths)]


def _decoder(name: str, options: Mapping[str, str], _host: str) -> RobosenseDecoder:
    return RobosenseDecoder(name, read_angles(Path(options["calibration"])) if options.get("calibration") else None)


DRIVER = Driver(
    maker=RobosenseDecoder.maker,
    port=6699,
    recognises=RobosenseDecoder.accepts,
    decoder=_decoder,
    options={"calibration": "FILE"},
    beside={"calibration": ".csv"},
    described_at=7788,
)
