"""Velodyne's packets to sweeps, by velodyne-decoder."""

from __future__ import annotations

import copy
import json
import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from modt.errors import MisuseError
from modt.sources.live.sweep_reader import Reception, Sweep
from modt.sources.packets.packet_decoder import DeviceClock, extra, one_line, refuse
from modt.sources.packets.velodyne_models import (
    IDENTITY_AT,
    STAMP_AT,
    TURN,
    Model,
    Signature,
    azimuths,
    recognised,
    signature_of,
)
from modt.sources.packets.velodyne_turn import AHEAD, SAME_S, Entry, Turn
from modt.types import Float32, Float64, Self

CYCLE, TAIL = 4160, slice(-6, None)
"""Packets in which all of it is sent; stamp, type and value of a status."""


class CalibrationBytes:
    """Collects the ends of packets until they hold a calibration."""

    def __init__(self, library: Any) -> None:
        self._library = library
        self._tails: list[bytes] = []

    def add(self, payload: bytes) -> tuple[str, Any] | None:
        """Member of velodyne_decoder.Model and calibration of the unit, once they have been received whole."""
        self._tails.append(payload[TAIL])
        if len(self._tails) <= CYCLE:
            return None
        tails, self._tails = self._tails, []
        try:
            status = self._library.hdl64e.read_status_info(tails)
        except (ValueError, KeyError):  # packets are missing, or they hold no status
            return None
        if status["Calibration Time"] is None:
            return None
        table = self._library.hdl64e.status_info_to_calib_dict(status)
        del table["status"]
        member = f"HDL64E_{status['Model']}"
        return member, self._library.Calibration.from_string(json.dumps(table))


log = logging.getLogger(__name__)

HOUR_S = 3600.0
"""Time after which the stamps begin again."""
RECOGNISED_BY = 20
"""Packets by which the model is recognised."""
LONGEST_TURN_S = 0.3
"""At the slowest that the heads are set to turn, and half as long again."""
LEAST_TURN = 1000
"""A head that falls back by more has begun another turn [0.01 deg]; by less, it stands still."""
SILENCE_S = 1.0
"""Packets missing for longer are those of a sensor that was off."""
RETURN = 7
"""Column of the library's table: which return of a firing."""
NO_TURN = Turn(0.0, None)


class VelodyneDecoder:
    """Cuts the packets behind the sensor and decodes a turn at a time.

    Each beam's part of a turn is cut where the beam looks backwards, not the head. What is received before the first
    cut is no sweep. Of two returns of a firing the stronger one is taken.
    """

    elevations_deg: tuple[float, ...] | None = None

    def __init__(self, name: str, model: Model | None = None, calibration: Path | None = None) -> None:
        """A decoder for the source of a name; without `model` it is recognised by the first packets.

        Raises:
            MisuseError: velodyne-decoder is missing, or the calibration cannot be read.
        """
        self._library = extra("velodyne_decoder", "velodyne")
        self.name, self.profile = name, model.profile if model else None
        self._declared, self._calibration = model, None if calibration is None else self._read(calibration)
        self._first: list[tuple[float, bytes]] | None = []
        self._signature: Signature | None = None
        self._identity: bytes | None = None
        self._reach, self._packet_s, self._most = 0, 0.0, 0
        self._own: CalibrationBytes | None = None
        self._forget()

    def _forget(self) -> None:
        self._clock = DeviceClock(HOUR_S)
        self._last: Entry | None = None
        self._turn = self._ending = NO_TURN
        self._holes: Float64 | None = None
        self._interval_s, self._longest_s, self._heard_s = 0.0, LONGEST_TURN_S, -math.inf
        self._others: list[tuple[float, bytes]] = []  # packets of another model since this one was heard

    def again(self) -> Self:
        """A decoder of the same sensor that has seen no packet yet."""
        other = copy.copy(self)
        other._first = None if self._first is None else []
        other._own = None if self._own is None else CalibrationBytes(self._library)
        other._forget()
        return other

    def accepts(self, payload: bytes) -> bool:
        """Whether a payload is a packet of points of a Velodyne."""
        return signature_of(payload) is not None

    def decode(self, received_s: float, payload: bytes, reception: Reception) -> Sequence[Sweep]:
        """Sweeps completed by a packet."""
        signature = signature_of(payload)
        if signature is None:
            refuse(reception, self.name, "no packet of a Velodyne")
            return []
        if self._first is None:
            return self._packet(received_s, payload, signature, reception)
        self._first.append((received_s, payload))
        return self._begin(reception) if len(self._first) == RECOGNISED_BY else []

    def pause(self, reception: Reception) -> Sequence[Sweep]:
        """The sweep, if the turn has reached where it ended in the turn before: what the sensor is set not to see."""
        turn = self._turn
        if self._holes is None or not turn.ends_at(self._holes):
            return []
        self._turn = Turn(turn.began_s, None, turn.entries)  # handed over
        return self._sweeps(turn, reception)

    def finish(self, reception: Reception) -> Sequence[Sweep]:
        """The last sweep, if all that it waited for is the packet after it."""
        sweeps = [*self._begin(reception)] if self._first else []
        for turn in (self._ending, self._turn):
            if turn.reaches_seam:
                sweeps += self._sweeps(turn, reception)
        self._forget()
        return sweeps

    def _read(self, calibration: Path) -> Any:
        try:
            return self._library.Calibration.read(str(calibration))
        except Exception as error:  # of the library's YAML parser, of no common type
            remedy = "give a calibration in the format of ROS's velodyne_pointcloud"
            raise MisuseError(calibration, f"no calibration ({one_line(error)})", remedy) from None

    def _begin(self, reception: Reception) -> Sequence[Sweep]:
        """Recognise the model by the packets kept, and decode them."""
        first, self._first = self._first or [], []
        model, signature = recognised([payload for _, payload in first], self.name, self._declared)
        if model is None:
            for _ in first:
                refuse(reception, self.name, "of a model of Velodyne that is unknown; give model=")
            return []
        self._signature, self.profile = signature, model.profile
        self._identity = None if model.signature.identity is None else bytes([model.signature.identity])
        self._reach, self._packet_s = model.reach, model.interval_us * 1e-6
        self._most = math.ceil(2 * LONGEST_TURN_S / self._packet_s)  # of two returns
        calibration, self._own = self._calibration, None
        if calibration is None and model.calibration is not None:
            calibration = self._library.get_bundled_calibration(model.calibration)
            self._own = CalibrationBytes(self._library)
            remedy = "until it has sent its own; better give them by calibration="
            log.warning("%s: beams as of another %s %s", self.name, model.name, remedy)
        self._decoder, self._first = self._scan_decoder(model.member, calibration), None
        return [s for r, p in first for s in self._packet(r, p, signature_of(p), reception)]

    def _scan_decoder(self, member: str, calibration: Any) -> Any:
        config = self._library.Config(model=getattr(self._library.Model, member), calibration=calibration)
        return self._library.ScanDecoder(config)

    def _calibrate(self, own: CalibrationBytes, payload: bytes) -> None:
        """Use the unit's own calibration from the packet on that completes it."""
        found = own.add(payload)
        if found is not None:
            self._decoder, self._own = self._scan_decoder(*found), None
            log.warning("%s: it has sent the calibration of its beams, which is used from now on", self.name)

    def _packet(
        self, received_s: float, payload: bytes, signature: Signature | None, reception: Reception
    ) -> Sequence[Sweep]:
        if signature != self._signature:
            return self._foreign(received_s, payload, reception)
        self._heard_s = received_s
        self._others.clear()
        stamp_s = int.from_bytes(payload[STAMP_AT : STAMP_AT + 4], "little") * 1e-6
        time_s = self._clock.unwrapped(stamp_s, received_s - self._packet_s)  # it is sent when it is full
        if self._own is not None:
            self._calibrate(self._own, payload)
        first, last = azimuths(payload)
        phase = (first + AHEAD) % TURN
        if self._identity is not None:  # the library checks it, and there are packets that lie
            payload = payload[:IDENTITY_AT] + self._identity
        entry = Entry(time_s, phase, phase + (last - first) % TURN, self._library.VelodynePacket(time_s, payload))
        return self._follow(entry, reception)

    def _foreign(self, received_s: float, payload: bytes, reception: Reception) -> Sequence[Sweep]:
        """Refuse a packet of another model; after RECOGNISED_BY while the known one is silent, recognise it anew."""
        refuse(reception, self.name, "of another model than the packets before")
        if abs(received_s - self._heard_s) < SILENCE_S:
            return []
        self._others.append((received_s, payload))
        if len(self._others) < RECOGNISED_BY:
            return []
        log.warning("%s: packets are of another model, and those of the one before have ended", self.name)
        self._first = self._others
        self._forget()
        return self._begin(reception)

    def _follow(self, entry: Entry, reception: Reception) -> Sequence[Sweep]:
        """Add a packet to its turn; the sweep that ends with it."""
        last = self._last
        gap_s = 0.0 if last is None else entry.time_s - last.time_s
        if last is None or max(abs(gap_s), entry.time_s - self._turn.began_s) > self._longest_s:
            if self._interval_s and 0 < gap_s < SILENCE_S:
                reception.lost += max(round(gap_s / self._interval_s) - 1, 0)
            return self._start(entry)
        if len(self._turn.entries) >= self._most:
            refuse(reception, self.name, "more than a turn has; do several sensors send to this port?")
            return [] if gap_s < SAME_S else self._start(entry)
        if gap_s < SAME_S:
            if not self._turn.insert(entry):
                refuse(reception, self.name, "late or twice")
            return []
        self._last = entry
        if entry.phase < last.phase - LEAST_TURN:
            self._ending, self._turn = self._turn, Turn(entry.time_s, last, self._turn.shared(self._reach))
        self._turn.entries.append(entry)
        if not self._ending.entries:
            return []
        if entry.phase < self._reach:
            self._ending.entries.append(entry.turned(TURN))
            return []
        ended, self._ending = self._ending, NO_TURN
        return self._sweeps(ended, reception)

    def _start(self, entry: Entry) -> Sequence[Sweep]:
        """Wait for the next cut: the head may have turned any number of times."""
        self._last, self._turn, self._ending = entry, Turn(entry.time_s, None, [entry]), NO_TURN
        self._longest_s = LONGEST_TURN_S
        return []

    def _sweeps(self, turn: Turn, reception: Reception) -> Sequence[Sweep]:
        if turn.before is None:
            return []
        lost, self._holes, self._interval_s = turn.missing(self._holes)
        reception.lost += lost
        ahead_s, turn_s = turn.times()
        self._longest_s = min(1.5 * turn_s, LONGEST_TURN_S)
        return [Sweep(ahead_s + self._clock.offset_s, self._points(turn.entries), turn_s, complete=lost == 0)]

    def _points(self, entries: Sequence[Entry]) -> Float32:
        """(N, 4) points of a turn: of the packets whose beams look beyond the seam, those on its own side of it."""
        heads = [e for e in entries if e.phase < self._reach]
        tails = [e for e in entries if e.end > TURN - self._reach]
        table = self._table([e for e in entries if e.phase >= self._reach and e.end <= TURN - self._reach])
        left, right = self._table(heads), self._table(tails)
        table = np.concatenate([left[left[:, 1] >= 0], table, right[right[:, 1] < 0]])
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
