"""Sweeps from the packets of Hesai's Pandar40P, 64, QT64, QT128, XT16, XT32 and XT32M."""

from __future__ import annotations

import logging
import math
import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from struct import Struct
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.sources.drivers import Driver
from modt.sources.packets.turn_decoder import TURN, Entry, TurnDecoder, points_of, strongest
from modt.sources.text_file import read_lines
from modt.types import Float32, Float64

log = logging.getLogger(__name__)

UNIT_MM = 4
"""Unit of distances in packets that do not state it [mm]."""
RETURNS = {0x39: 2, 0x3A: 2, 0x3B: 2, 0x3C: 2, 0x3D: 3}
"""Number of returns a firing by return mode; the other modes have one."""
MAX_APPENDED_BYTES = 64
"""Greatest size of the sequence number and signature that follow the tail."""
REMEDY = "give calibration=FILE, the CSV of channel, elevation and azimuth that the sensor's web page offers"


@dataclass(frozen=True)
class Layout:
    """Offsets and sizes in a packet [bytes].

    Attributes:
        begin: offset of the first block.
        unit: offset of the unit of distances [mm]; None where it is UNIT_MM.
        azimuth: offset of the head's azimuth in a block; the channels follow it.
        cell: size of a channel, which holds distance (2), reflectance (1), and others.
        mode, date, micros: offsets in the tail of the return mode, of year to second (a byte each), and of the
            microseconds.
    """

    begin: int
    unit: int | None
    azimuth: int
    cell: int
    mode: int
    date: int
    micros: int


@dataclass(frozen=True)
class Model:
    """A model of sensor.

    Attributes:
        name: name in messages.
        head: offset and value of bytes that only the packets of this model have.
        blocks, channels: number of blocks in a packet, and of channels in a block.
        layout: layout of a packet.
        firing_us: time from one firing to the next [us].
        elevations_deg: elevations for a unit without calibration; empty where units differ too much.
        profile: shipped profile, None where there is none.
    """

    name: str
    head: tuple[tuple[int, int], ...]
    blocks: int
    channels: int
    layout: Layout
    firing_us: float
    elevations_deg: tuple[float, ...] = ()
    profile: str | None = None

    @cached_property
    def body(self) -> np.dtype[Any]:
        """Type of a packet up to its tail."""
        at = self.layout
        cell = np.dtype({"names": ["distance", "reflectance"], "formats": ["<u2", "u1"], "itemsize": at.cell})
        formats = ["<u2", (cell, (self.channels,))]
        offsets = [at.azimuth, at.azimuth + 2]
        block = np.dtype({"names": ["azimuth", "cells"], "formats": formats, "offsets": offsets})
        return np.dtype({"names": ["blocks"], "formats": [(block, (self.blocks,))], "offsets": [at.begin]})

    @cached_property
    def azimuths(self) -> Struct:
        """Struct of the azimuths of the blocks."""
        between = (self.body.itemsize - self.layout.begin) // self.blocks - 2
        return Struct(f"<{self.layout.begin + self.layout.azimuth}x" + f"H{between}x" * self.blocks)

    @cached_property
    def tail(self) -> int:
        """Offset of the tail."""
        return self.body.itemsize

    def sends(self, payload: bytes) -> bool:
        """Whether a payload is a packet of this model."""
        appended = len(payload) - self.tail - max(self.layout.micros + 4, self.layout.date + 6)
        if not 0 <= appended <= MAX_APPENDED_BYTES or any(payload[at] != value for at, value in self.head):
            return False
        greatest: int = max(self.azimuths.unpack_from(payload))
        return greatest <= TURN


def _head(major: int, channels: int, blocks: int) -> tuple[tuple[int, int], ...]:
    """Header of the newer packets, which states number of channels and of blocks."""
    return (0, 0xEE), (1, 0xFF), (2, major), (6, channels), (7, blocks)


_P40 = tuple((at, value) for block in range(10) for at, value in ((124 * block, 0xFF), (124 * block + 1, 0xEE)))
_P64 = (0, 0xEE), (1, 0xFF), (2, 64), (3, 6)
_XT = Layout(12, 9, 0, 4, mode=10, date=13, micros=19)
MODELS = (
    Model("Pandar40P", _P40, 10, 40, Layout(0, None, 2, 3, mode=14, date=16, micros=10), 55.56),
    Model("Pandar64", _P64, 6, 64, Layout(8, 5, 0, 3, mode=14, date=16, micros=10), 55.56, profile="pandar64"),
    Model("PandarQT64", _head(3, 64, 4), 4, 64, Layout(12, 9, 0, 4, mode=16, date=18, micros=12), 166.67),
    Model("PandarQT128", _head(3, 128, 2), 2, 128, Layout(12, 9, 0, 4, mode=33, date=36, micros=42), 111.11),
    Model("PandarXT-16", _head(6, 16, 8), 8, 16, _XT, 50.0, tuple(15.0 - 2 * i for i in range(16))),
    Model("PandarXT-32", _head(6, 32, 8), 8, 32, _XT, 50.0, tuple(15.0 - i for i in range(32)), "xt-32"),
    Model("PandarXT-32M", _head(6, 32, 6), 6, 32, _XT, 50.0, tuple(19.5 - 1.3 * i for i in range(32))),
)


def model_of(payload: bytes) -> Model | None:
    """Model that sent a packet; None if a payload is no packet of points of a Hesai."""
    return next((model for model in MODELS if model.sends(payload)), None)


def read_angles(path: Path) -> Float64:
    """(n, 2) elevation and azimuth of the channels [deg] from a calibration file.

    Raises:
        MisuseError: the file cannot be read, or is no calibration.
    """
    return _angles(path, read_lines(path, REMEDY))


PTC_PORT = 9347
"""TCP port at which a sensor answers requests."""
GET_CALIBRATION = b"\x47\x74\x05\x00" + bytes(4)
"""A request holds magic bytes, a command, 0 and a length. In the answer an error code replaces the 0."""
ANSWER_BYTES = 8
"""Size of the head of an answer."""
TIMEOUT_S = 3.0
MAX_ANSWER_BYTES = 65_536


def asked_angles(host: str, port: int = PTC_PORT) -> Float64 | None:
    """Angles as in `read_angles`, requested from the sensor; None with a warning if it does not answer."""
    try:
        with socket.create_connection((host, port), TIMEOUT_S) as sensor, sensor.makefile("rb") as answer:
            sensor.sendall(GET_CALIBRATION)
            head = answer.read(ANSWER_BYTES)
            size = int.from_bytes(head[4:], "big")
            text = answer.read(min(size, MAX_ANSWER_BYTES)) if head[3:4] == b"\0" else b""
        return _angles(f"{host}:{port}", text.decode("ascii", "replace").splitlines())
    except (OSError, MisuseError, ValueError) as error:
        log.warning("%s: the sensor does not give its calibration on port %d (%s)", host, port, error)
        return None


def _angles(origin: object, lines: Sequence[str]) -> Float64:
    """(n, 2) elevation and azimuth of the channels [deg] from the lines of a calibration."""
    rows = []
    for line in lines:
        try:
            _, *angles = map(float, line.split(",")[:3])
        except ValueError:  # the names of the columns
            continue
        rows.append(angles)
    table = np.array([row for row in rows if len(row) == 2]).reshape(-1, 2)
    if not len(table) or not (np.abs(table) <= 90).all():
        raise MisuseError(origin, "no calibration of a Hesai", REMEDY)
    return table


class HesaiDecoder(TurnDecoder):
    """Turns of a Hesai; the return with the greatest reflectance represents a firing."""

    maker = "Hesai"
    wrap_s = 86_400.0
    signature = staticmethod(model_of)

    def __init__(self, name: str, angles_deg: Float64 | None = None) -> None:
        """`angles_deg`: as in `read_angles`; None takes the angles that all units of the model share, if any."""
        super().__init__(name)
        self._given_deg = angles_deg
        self._model = MODELS[0]
        self.elevations_deg = None if angles_deg is None else tuple(angles_deg[:, 0].tolist())

    def _recognise(self, model: Model, _payloads: Sequence[bytes]) -> Model | None:
        angles_deg = self._given_deg
        if angles_deg is None and model.elevations_deg:
            log.warning("%s: beams as of any %s; %s", self.name, model.name, REMEDY)
            angles_deg = np.column_stack([model.elevations_deg, np.zeros(model.channels)])
        if angles_deg is None or len(angles_deg) != model.channels:
            given = "is not given" if angles_deg is None else f"has {len(angles_deg)} channels"
            self.unknown = f"the calibration of this {model.name} {given}; {REMEDY}"
            return None
        self._model = model
        self.profile = model.profile
        self._azimuth_deg = angles_deg[:, 1].astype(np.float32)
        elevation = np.deg2rad(angles_deg[:, 0])
        self._cos = np.cos(elevation).astype(np.float32)
        self._sin = np.sin(elevation).astype(np.float32)
        self._reach = math.ceil(100 * np.abs(angles_deg[:, 1]).max()) + 10
        self._packet_s = model.blocks * model.firing_us * 1e-6
        return model

    def _entry(self, received_s: float, payload: bytes) -> Entry:
        model = self._model
        tail = payload[model.tail :]
        _, _, _, hour, minute, second = tail[model.layout.date :][:6]
        micros = int.from_bytes(tail[model.layout.micros :][:4], "little")
        sent_s = hour * 3600.0 + minute * 60.0 + second + micros * 1e-6
        firings = model.blocks // self._returns(payload)
        time_s = self._clock.unwrapped(sent_s, received_s) - (firings - 1) * model.firing_us * 1e-6
        first, *_, last = model.azimuths.unpack_from(payload)
        return Entry.of(time_s, first, last, payload[: model.tail + model.layout.mode + 1])

    def _returns(self, payload: bytes) -> int:
        """Number of returns a firing, each in one of as many consecutive blocks."""
        model = self._model
        returns = RETURNS.get(payload[model.tail + model.layout.mode], 1)
        return 1 if model.blocks % returns else returns

    def _table(self, entries: Sequence[Entry]) -> Float32:
        model = self._model
        returns = self._returns(entries[0].packet)
        unit_mm = UNIT_MM if model.layout.unit is None else entries[0].packet[model.layout.unit]
        raw = b"".join(entry.packet[: model.tail] for entry in entries)
        blocks = np.frombuffer(raw, model.body)["blocks"].reshape(-1, returns)
        distance, reflectance = strongest(blocks["cells"])
        firing, channel = np.nonzero(distance)
        azimuth = np.deg2rad(blocks["azimuth"][firing, 0] * np.float32(0.01) + self._azimuth_deg[channel])
        distance_m = distance[firing, channel] * np.float32(unit_mm / 1000)
        across_m = distance_m * self._cos[channel]
        x = across_m * np.cos(azimuth)
        y = -across_m * np.sin(azimuth)
        return points_of(x, y, distance_m * self._sin[channel], reflectance[firing, channel])


def _decoder(name: str, options: Mapping[str, str], host: str) -> HesaiDecoder:
    if options.get("calibration"):
        return HesaiDecoder(name, read_angles(Path(options["calibration"])))
    return HesaiDecoder(name, asked_angles(host) if host else None)


DRIVER = Driver(
    maker=HesaiDecoder.maker,
    port=2368,
    recognises=HesaiDecoder.accepts,
    decoder=_decoder,
    options={"calibration": "FILE"},
    beside={"calibration": ".csv"},
)
