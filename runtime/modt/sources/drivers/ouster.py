"""Sweeps from Ouster's packets, by Ouster's SDK."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from http.client import HTTPException
from pathlib import Path
from typing import Any

import numpy as np

from modt import assets
from modt.errors import MisuseError
from modt.sources.drivers import Driver
from modt.sources.packets.device_clock import DeviceClock
from modt.sources.packets.packet_decoder import PacketDecoder, import_extra, one_line
from modt.sources.packets.turn_decoder import points_of
from modt.sources.stream import Sweep
from modt.sources.text_file import read_text
from modt.types import Bool, Float32

METADATA = "http://{host}/api/v1/sensor/metadata"
"""Address of a sensor's metadata."""
TIMEOUT_S = 5.0
MAX_METADATA_BYTES = 2**20
MAX_LOST_FRAMES = 20
"""Greatest number of consecutive frames that count as lost; beyond it the sensor was restarted."""
RESTARTED_BY = 20
"""Number of consecutive packets of earlier frames after which the sensor was restarted, or a number was false."""


class OusterDecoder(PacketDecoder):
    """Turns packets into frames of the SDK, which are sweeps that begin behind the sensor and turn clockwise.

    A sweep is complete with the last packet of its window. A sweep that began before the first received packet is
    discarded. The first of two returns of a firing is taken.
    """

    _late: int  # number of consecutive packets of earlier frames

    def __init__(self, name: str, metadata: Path | str) -> None:
        """Make a decoder for the source of a name; `metadata`: a file, or the host name of the sensor.

        Raises:
            MisuseError: ouster-sdk is missing, or the metadata cannot be read.
        """
        self._sdk = import_extra("ouster.sdk.core", "ouster")
        self._info, self._format, self._project = self._read(metadata)
        info = self._info
        self._width = info.format.columns_per_frame
        self._columns = info.format.columns_per_packet
        self._awaited = _awaited(info.format.column_window, self._width, self._columns)
        self.elevations_deg = tuple(map(float, info.beam_altitude_angles))
        self.period_s = 1.0 / (info.format.fps or 10)
        self.profile = _profile(info.prod_line)
        super().__init__(name)

    def accepts(self, payload: bytes) -> bool:
        """Whether a payload is a packet of points that fits the metadata."""
        return self._flaw(payload) is None

    def decode(self, received_s: float, payload: bytes) -> Sequence[Sweep]:
        """Sweeps completed by a packet."""
        flaw = self._flaw(payload)
        if flaw is not None:
            self.refuse(flaw)
            return []
        packet = self._sdk.LidarPacket(self._format)  # a new one each time, as the batcher keeps it
        packet.buf[:] = np.frombuffer(payload, np.uint8)
        packet.host_timestamp = round(received_s * 1e9)
        valid = packet.validate(self._info, self._format) == self._sdk.PacketValidationFailure.NONE
        if not valid and self._format.prod_sn(packet.buf) != self._info.sn:  # the number of a start may differ
            self.refuse("of another sensor than the metadata")
            return []
        if self._ended(self._format.frame_id(packet.buf)):
            self.refuse("late: its frame has ended")
            self._late += 1
            if self._late < RESTARTED_BY:
                return []
            self._reset()
        self._late = 0
        return self._sweeps() if self._batcher.batch(packet, self._frame) else []

    def _ended(self, number: int) -> bool:
        """Whether the number of a frame is before that of the present one; the batcher ignores such packets."""
        numbers = self._format.max_frame_id + 1
        present = self._frame.frame_id
        return bool(present >= 0 and 0 < (present - number) % numbers < numbers // 2)

    def _reset(self) -> None:
        used = [kind for kind in self._sdk.get_field_types(self._info) if kind.name in ("RANGE", "REFLECTIVITY")]
        self._batcher = self._sdk.FrameBatcher(self._info)
        self._frame = self._sdk.LidarFrame(self._info, used)
        self._clock = DeviceClock()
        self._last_id: int | None = None
        self._late = 0

    def _read(self, metadata: Path | str) -> tuple[Any, Any, Any]:
        """SDK's objects for the metadata: sensor, format of its packets, and projection."""
        remedy = "save the sensor's answer at /api/v1/sensor/metadata"
        text = _asked(metadata) if isinstance(metadata, str) else read_text(metadata, remedy)
        try:
            info = self._sdk.SensorInfo(text)
            packet_format = self._sdk.PacketFormat(info)
            projection = self._sdk.XYZLutFloat(info, False)
        except Exception as error:  # errors of the SDK's parser have no common type
            raise MisuseError(metadata, f"no metadata of an Ouster ({one_line(error)})", remedy) from None
        width = info.format.columns_per_frame
        columns = info.format.columns_per_packet
        if columns < 1 or width % columns:
            raise MisuseError(metadata, f"no metadata of an Ouster ({width} columns in packets of {columns})", remedy)
        return info, packet_format, projection

    def _flaw(self, payload: bytes) -> str | None:
        """Reason why a payload is no packet of points that fits the metadata; None if it is one."""
        if len(payload) != self._format.lidar_packet_size:
            return f"not the {self._format.lidar_packet_size} bytes of the metadata's format"
        header = self._sdk.ColHeader.MEASUREMENT_ID
        columns = self._format.packet_header(header, np.frombuffer(payload, np.uint8)).astype(np.int64)
        begins = int(columns[0])
        if begins % self._columns or begins >= self._width or (np.diff(columns) != 1).any():
            return "no packet of an Ouster"
        return None

    def _sweeps(self) -> Sequence[Sweep]:
        frame = self._frame
        missing: Bool = np.logical_and(self._awaited, frame.packet_timestamp == 0)
        last_id = self._last_id
        self._last_id = frame.frame_id
        if last_id is None and missing[self._awaited.argmax()]:
            return []
        lost = int(missing.sum())
        passed = 0 if last_id is None else (frame.frame_id - last_id) % (self._format.max_frame_id + 1) - 1
        if 0 <= passed <= MAX_LOST_FRAMES:
            lost += passed * int(self._awaited.sum())
        self.reception.lost += lost
        if not (frame.timestamp.astype(np.int64) > 0).any():
            self.refuse("a whole frame without stamps, or with stamps beyond the year 2262")
            return []
        stamp_s, turn_s = self._times()
        return [Sweep(stamp_s, self._points(), turn_s, complete=not missing.any())]

    def _times(self) -> tuple[float, float]:
        """Stamp and duration of the frame [s]."""
        frame = self._frame
        time_ns = frame.timestamp.astype(np.int64)
        seen = np.flatnonzero(time_ns > 0)
        time_ns = time_ns[seen]
        per_column_s = float(time_ns[-1] - time_ns[0]) * 1e-9 / max(int(seen[-1] - seen[0]), 1)
        near = int(np.abs(seen - self._width // 2).argmin())
        ahead_s = float(time_ns[near]) * 1e-9 + (self._width / 2 - float(seen[near])) * per_column_s
        sent_ns = frame.timestamp.astype(np.int64).reshape(-1, self._columns).max(axis=1)
        received_ns = frame.packet_timestamp.astype(np.int64)
        known = (sent_ns > 0) & (received_ns > 0)
        delay_s = float((received_ns - sent_ns)[known].min()) * 1e-9
        last_s = float(time_ns[-1]) * 1e-9
        self._clock.unwrapped(last_s, last_s + delay_s)
        return ahead_s + self._clock.offset_s, per_column_s * self._width

    def _points(self) -> Float32:
        distance = self._frame.field("RANGE")
        kept = np.flatnonzero(distance)
        x, y, z = self._project(distance).reshape(-1, 3)[kept].T
        return points_of(x, y, z, self._frame.field("REFLECTIVITY").reshape(-1)[kept])


def _asked(host: str) -> str:
    """Metadata from the sensor itself."""
    from urllib.request import ProxyHandler, build_opener  # imported here, as it loads many modules

    address = METADATA.format(host=host)
    try:
        with build_opener(ProxyHandler({})).open(address, timeout=TIMEOUT_S) as answer:
            text: str = answer.read(MAX_METADATA_BYTES).decode("utf-8", "replace")
    except (OSError, ValueError, HTTPException) as error:
        remedy = "check the sensor's address and this machine's network, or save its answer and add ?metadata=FILE"
        raise MisuseError(address, f"the sensor does not give its metadata ({one_line(error)})", remedy) from None
    return text


def _awaited(window: tuple[int, int], width: int, columns: int) -> Bool:
    """(packets of a frame,) whether a packet holds a column of the window, which may reach over the seam."""
    first, last = window
    within = np.asarray((np.arange(width) - first) % width <= (last - first) % width)
    return np.asarray(within.reshape(-1, columns).any(axis=1))


def _profile(product_line: str) -> str | None:
    """Shipped profile for a product line, such as OS-1-64-U13; None without one."""
    line = re.match(r"OS-?(\w+)-(\d+)", product_line)
    name = f"os{line[1]}-{line[2]}".lower() if line else ""
    return name if (assets.folder("profiles") / f"{name}.yaml").is_file() else None


def _decoder(name: str, options: Mapping[str, str], host: str) -> OusterDecoder:
    metadata = options.get("metadata")
    if not metadata and not host:
        remedy = "write ouster://HOST, the sensor's address, to have it asked, or add ?metadata=FILE"
        raise MisuseError(name, "its packets cannot be read without the sensor's metadata", remedy)
    return OusterDecoder(name, Path(metadata) if metadata else host)


DRIVER = Driver(
    maker="Ouster",
    port=7502,
    recognises=lambda payload: False,  # the metadata have the size and layout of the packets
    decoder=_decoder,
    options={"metadata": "FILE"},
    identified_by="metadata",
    beside={"metadata": ".json"},
    extra="ouster",
)
