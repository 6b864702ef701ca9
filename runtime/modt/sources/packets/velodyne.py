"""Velodyne's packets to sweeps, by velodyne-decoder."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modt.errors import MisuseError, refuse_pipe
from modt.sources.packets.packet_decoder import extra, one_line
from modt.sources.packets.turn_decoder import AHEAD, TURN, Entry, TurnDecoder
from modt.sources.packets.velodyne_models import (
    IDENTITY_AT,
    STAMP_AT,
    Model,
    Signature,
    azimuths,
    recognised,
    signature_of,
)
from modt.types import Float32

log = logging.getLogger(__name__)

RETURN = 7
"""Column of the library's table: which return of a firing."""


class VelodyneDecoder(TurnDecoder):
    """Turns of a Velodyne; of two returns of a firing the stronger one is taken."""

    maker, wrap_s = "Velodyne", 3600.0
    unknown = "of a model of Velodyne that is unknown; give model="
    signature = staticmethod(signature_of)

    def __init__(self, name: str, model: Model | None = None, calibration: Path | None = None) -> None:
        """A decoder for the source of a name; without `model` it is recognised by the first packets.

        Raises:
            MisuseError: velodyne-decoder is missing, or the calibration cannot be read.
        """
        self._library = extra("velodyne_decoder", "velodyne")
        self._declared, self._calibration = model, None if calibration is None else self._read(calibration)
        self._identity: bytes | None = None
        super().__init__(name, model.profile if model else None)

    def _read(self, calibration: Path) -> Any:
        remedy = "give a calibration in the format of ROS's velodyne_pointcloud"
        refuse_pipe(calibration, remedy)
        try:
            return self._library.Calibration.read(str(calibration))
        except Exception as error:  # of the library's YAML parser, of no common type
            raise MisuseError(calibration, f"no calibration ({one_line(error)})", remedy) from None

    def _recognise(self, payloads: Sequence[bytes]) -> Signature | None:
        model, signature = recognised(payloads, self.name, self._declared)
        if model is None:
            return None
        self.profile = model.profile
        self._identity = None if model.signature.identity is None else bytes([model.signature.identity])
        self._reach, self._packet_s = model.reach, model.interval_us * 1e-6
        calibration = self._calibration
        if calibration is None and model.calibration is not None:
            calibration = self._library.get_bundled_calibration(model.calibration)
            log.warning("%s: beams as of another %s; give its own by calibration=FILE", self.name, model.name)
        member = getattr(self._library.Model, model.member)
        self._decoder = self._library.ScanDecoder(self._library.Config(model=member, calibration=calibration))
        return signature

    def _entry(self, received_s: float, payload: bytes) -> Entry:
        stamp_s = int.from_bytes(payload[STAMP_AT : STAMP_AT + 4], "little") * 1e-6
        time_s = self._clock.unwrapped(stamp_s, received_s - self._packet_s)  # it is sent when it is full
        first, last = azimuths(payload)
        phase = (first + AHEAD) % TURN
        if self._identity is not None:  # the library checks it, and there are packets that lie
            payload = payload[:IDENTITY_AT] + self._identity
        return Entry(time_s, phase, phase + (last - first) % TURN, self._library.VelodynePacket(time_s, payload))

    def _points(self, entries: Sequence[Entry]) -> Float32:
        table = super()._points(entries)
        stronger = table[:, RETURN] != self._library.ReturnMode.LAST.value
        points: Float32 = table[stronger, :4] if stronger.any() else table[:, :4].copy()
        points[:, 3] /= 255.0
        return points

    def _table(self, entries: Sequence[Entry]) -> Float32:
        """(N, 8) table of the library."""
        if not entries:  # the library would crash
            return np.zeros((0, 8), np.float32)
        table: Float32 = self._decoder.decode(self._library.PacketVector([e.packet for e in entries]))[1]
        return table
