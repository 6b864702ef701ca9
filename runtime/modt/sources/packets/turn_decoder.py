"""Cutting of a rotating head's packets into turns, shared by the decoders of Velodyne, Hesai and RoboSense."""

from __future__ import annotations

import logging
import math
from abc import abstractmethod
from bisect import bisect
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modt.sources.packets.device_clock import DeviceClock
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import OTHER_SENSOR, Sweep
from modt.types import Float32, Float64

log = logging.getLogger(__name__)

TURN = 36_000
"""A turn of the head [0.01 deg]."""
AHEAD = TURN // 2
"""Phase of a head that looks straight ahead; phase 0 is behind the sensor [0.01 deg]."""
MIN_HOLE = 10
"""Least number of consecutive missing packets that may be a configured blind sector."""
SAME_S = 0.5e-6
"""Packets whose times differ by less are the same packet [s]."""


@dataclass(frozen=True)
class Entry:
    """A packet of a turn.

    Attributes:
        time_s: time of its first block, on the clock of the sensor.
        phase, end: phases of the head at its first and last block, clockwise from behind the sensor [0.01 deg]; below
            0 or above TURN in the packets that a turn shares with its neighbours.
        packet: packet in the form that the decoder needs.
    """

    time_s: float
    phase: int
    end: int
    packet: Any

    @classmethod
    def of(cls, time_s: float, first: int, last: int, packet: Any) -> Entry:
        """Entry by the azimuths of the first and the last block of a packet, clockwise from ahead [0.01 deg]."""
        phase = (first + AHEAD) % TURN
        return cls(time_s, phase, phase + (last - first) % TURN, packet)

    def turned(self, by: int) -> Entry:
        """Same packet as part of a neighbouring turn."""
        return replace(self, phase=self.phase + by, end=self.end + by)


@dataclass(slots=True)
class Turn:
    """The packets of a turn, ordered by time.

    Attributes:
        began_s: time of the first of its own packets.
        before: last packet of the turn before; None if the first received packet lies within this turn.
        entries: its own packets, and packets of its neighbours whose beams may reach into it.
    """

    began_s: float
    before: Entry | None
    entries: list[Entry] = field(default_factory=list)

    @property
    def reaches_seam(self) -> bool:
        """Whether the packet after its last one belongs to the next turn."""
        if not self.entries:
            return False
        last = self.entries[-1]
        return last.end + (last.end - last.phase) // 4 > TURN

    def ends_at(self, holes: Float64) -> bool:
        """Whether the turn has reached the begin of one of the `holes` of the turn before."""
        if not self.entries or self.before is None:
            return False
        last = self.entries[-1]
        step = last.phase - self.entries[-2].phase if len(self.entries) > 1 else 0
        return bool((np.abs(last.phase - TURN - holes) <= step / 2).any())

    def insert(self, entry: Entry) -> bool:
        """Add a late packet; False if it is not of this turn, or already there."""
        at = bisect(self.entries, entry.time_s - SAME_S, key=attrgetter("time_s"))
        after_s = self.entries[at].time_s if at < len(self.entries) else math.inf
        if entry.time_s < self.began_s or after_s < entry.time_s + SAME_S:
            return False
        self.entries.insert(at, entry)
        return True

    def shared(self, reach: int) -> list[Entry]:
        """Packets at its end that the next turn needs too."""
        return [entry.turned(-TURN) for entry in self.entries if entry.end > TURN - reach]

    def times(self) -> tuple[float, float]:
        """Time at which the head looks straight ahead, and duration of the turn [s]."""
        first = self.entries[0]
        last = self.entries[-1]
        turn_s = (last.time_s - first.time_s) * TURN / max(last.phase - first.phase, 1)
        nearest = min(self.entries, key=lambda entry: abs(entry.phase - AHEAD))
        ahead_s = nearest.time_s + (AHEAD - nearest.phase) / TURN * turn_s
        return ahead_s, turn_s

    def missing(self, holes: Float64 | None) -> tuple[int, Float64, float]:
        """Number of missing packets, phases at which long holes begin, and interval between packets [s].

        A long hole that begins where one of the `holes` of the turn before did is a blind sector, and its packets are
        not missing. The same holds for every long hole if `holes` is None.
        """
        entries = [entry for entry in self.entries if 0 <= entry.phase < TURN]
        if self.before is not None:
            entries.insert(0, self.before.turned(-TURN))
        times_s, phases = np.array([(entry.time_s, entry.phase) for entry in entries]).T
        gaps_s = np.diff(times_s)
        interval_s = float(np.median(gaps_s)) if len(gaps_s) else 0.0
        if interval_s <= 0:
            return 0, np.zeros(0), 0.0
        missing = np.rint(gaps_s / interval_s) - 1  # by gap
        begins = phases[:-1]
        long = missing >= MIN_HOLE
        if holes is None:
            blind = long
        else:
            tolerance = 2 * float(np.median(np.diff(phases)))
            blind = long & (np.abs(begins[:, None] - holes) <= tolerance).any(axis=1)
        return int(missing[~blind].clip(0).sum()), begins[long], interval_s


Timed = tuple[float, bytes]
"""Time of reception [s] and payload of a packet."""
RECOGNISED_BY = 20
"""Number of packets by which the model is recognised."""
LONGEST_TURN_S = 0.3
"""1.5 times the slowest turn [s]."""
LEAST_TURN = 1000
"""A phase that falls by more begins another turn; if it falls by less, the head stands still [0.01 deg]."""
FASTEST_HZ = 25.0
"""Greatest rate of a head."""
SLACK = 500
"""Angle between two packets beside that which the head turns in the time between them [0.01 deg]."""
SILENCE_S = 1.0
"""Longest gap in which packets count as missing [s]; beyond it the sensor was off."""
NO_TURN = Turn(0.0, None)


class TurnDecoder(PacketDecoder):
    """Cuts the packets behind the sensor and decodes a turn at a time.

    The seam is behind the sensor for each beam, not for the head. Packets before the first cut are
    discarded. The packets of one model are followed; a subclass knows the models and their packets.
    """

    maker: str
    unknown: str
    """Reason of the refusal of packets of a model that cannot be decoded."""
    wrap_s: float
    """Time after which the stamps of the device start over [s]."""
    _last: Entry | None
    _turn: Turn
    _ending: Turn

    def __init__(self, name: str, profile: str | None = None) -> None:
        super().__init__(name)
        self.profile = profile
        self._signature: object = None  # of the model; None until it is recognised
        self._reach = 0  # greatest angle between a beam and the head [0.01 deg]
        self._packet_s = 0.0  # time from one packet to the next
        self._max_packets = 0  # of a turn

    @staticmethod
    @abstractmethod
    def signature(payload: bytes) -> object:
        """Value that all packets of one model share; None if a payload is no packet of points of this maker."""

    @abstractmethod
    def _recognise(self, signature: Any, payloads: Sequence[bytes]) -> object:
        """Prepare for a model, and return its signature; None with a reason in `unknown`.

        `signature` is that of most of the packets.
        """

    @abstractmethod
    def _entry(self, received_s: float, payload: bytes) -> Entry:
        """Entry of a packet of the followed model."""

    @abstractmethod
    def _table(self, entries: Sequence[Entry]) -> Float32:
        """(N, 4 or more) x, y, z [m, sensor frame], reflectance, and other columns of the points in packets."""

    @classmethod
    def accepts(cls, payload: bytes) -> bool:
        """Whether a payload is a packet of points of this maker."""
        return cls.signature(payload) is not None

    def decode(self, received_s: float, payload: bytes) -> Sequence[Sweep]:
        """Sweeps completed by a packet."""
        signature = self.signature(payload)
        if signature is None:
            self.refuse(f"no packet of a {self.maker}")
            return []
        if self._signature is not None:
            return self._of_known_model(received_s, payload, signature)
        self._unrecognised.append((received_s, payload))
        return self._begin() if len(self._unrecognised) == RECOGNISED_BY else []

    def pause(self) -> Sequence[Sweep]:
        """Sweep, if the turn has reached the blind sector in which the turn before ended."""
        turn = self._turn
        if self._holes is None or not turn.ends_at(self._holes):
            return []
        self._turn = Turn(turn.began_s, None, turn.entries)  # handed over
        return self._sweeps(turn)

    def finish(self) -> Sequence[Sweep]:
        """Last sweep, if only the packet after it is missing."""
        sweeps = [*self._begin()] if self._unrecognised else []
        for turn in (self._ending, self._turn):
            if turn.reaches_seam:
                sweeps += self._sweeps(turn)
        self._reset()
        return sweeps

    def _reset(self) -> None:
        self._clock = DeviceClock(self.wrap_s)
        self._unrecognised: list[Timed] = []  # packets kept until the model is recognised
        self._last = None
        self._turn = NO_TURN
        self._ending = NO_TURN
        self._holes: Float64 | None = None  # phases at which long holes of the last turn began
        self._interval_s = 0.0  # between the packets of the last turn
        self._longest_s = LONGEST_TURN_S
        self._received_s = -math.inf  # when the last packet of this model came
        self._foreign: list[Timed] = []  # packets of another model since then

    def _begin(self) -> Sequence[Sweep]:
        """Recognise the model by the packets kept, and decode them."""
        timed = self._unrecognised
        self._unrecognised = []
        payloads = [payload for _, payload in timed]
        ((signature, _),) = Counter(map(self.signature, payloads)).most_common(1)
        self._signature = self._recognise(signature, payloads)
        if self._signature is None:
            for _ in timed:
                self.refuse(self.unknown)
            return []
        self._max_packets = math.ceil(2 * LONGEST_TURN_S / self._packet_s)  # with two returns a firing
        sweeps: list[Sweep] = []
        for received_s, payload in timed:
            sweeps += self._of_known_model(received_s, payload, self.signature(payload))
        return sweeps

    def _of_known_model(self, received_s: float, payload: bytes, signature: object) -> Sequence[Sweep]:
        """Sweeps completed by a packet, once a model is recognised."""
        if signature != self._signature:
            return self._of_foreign_model(received_s, payload)
        entry = self._entry(received_s, payload)
        quiet_s = received_s - self._received_s
        leap_s = 0.0 if self._last is None else entry.time_s - self._last.time_s
        if abs(leap_s) > self._longest_s and not 0 < leap_s < SILENCE_S and quiet_s < SILENCE_S:
            self.refuse("its stamp leaps: the clock was set, or lies")
        self._received_s = received_s
        self._foreign.clear()
        return self._add(entry)

    def _of_foreign_model(self, received_s: float, payload: bytes) -> Sequence[Sweep]:
        """Refuse a packet of another model; adopt that model after RECOGNISED_BY packets without the known one."""
        self.refuse("of another model than the packets before")
        if abs(received_s - self._received_s) < SILENCE_S:
            return []
        self._foreign.append((received_s, payload))
        if len(self._foreign) < RECOGNISED_BY:
            return []
        log.warning("%s: packets are of another model, and those of the one before have ended", self.name)
        foreign = self._foreign
        self._reset()
        self._unrecognised = foreign
        return self._begin()

    def _add(self, entry: Entry) -> Sequence[Sweep]:
        """Add a packet to its turn; return the sweep that ends with it."""
        last = self._last
        gap_s = 0.0 if last is None else entry.time_s - last.time_s
        if last is None or max(abs(gap_s), entry.time_s - self._turn.began_s) > self._longest_s:
            # The sensor was off, or its clock was set: only a short gap is one of lost packets.
            if self._interval_s and 0 < gap_s < SILENCE_S:
                self.reception.lost += max(round(gap_s / self._interval_s) - 1, 0)
            return self._wait_for_cut(entry)
        if len(self._turn.entries) >= self._max_packets:
            self.refuse("more than a turn has; do several sensors send to this port?")
            return [] if gap_s < SAME_S else self._wait_for_cut(entry)
        if gap_s < SAME_S:
            if not self._turn.insert(entry):
                self.refuse("late or twice")
            return []
        if self._is_elsewhere(last, entry, gap_s):
            self.refuse(OTHER_SENSOR)
            return []
        self._last = entry
        if entry.phase < last.phase - LEAST_TURN:  # the head has passed the seam
            self._ending = self._turn
            self._turn = Turn(entry.time_s, last, self._ending.shared(self._reach))
        self._turn.entries.append(entry)
        return self._ended(entry)

    def _is_elsewhere(self, last: Entry, entry: Entry, gap_s: float) -> bool:
        """Whether no head can have turned from a packet to another one in this time."""
        turned = (entry.phase - last.end) % TURN
        return FASTEST_HZ * TURN * gap_s + SLACK < turned < TURN - LEAST_TURN

    def _ended(self, entry: Entry) -> Sequence[Sweep]:
        """Sweep of the turn before, once the latest packet lies beyond the reach of its beams."""
        ending = self._ending
        if not ending.entries:
            return []
        if entry.phase < self._reach:
            ending.entries.append(entry.turned(TURN))
            return []
        self._ending = NO_TURN
        return self._sweeps(ending)

    def _wait_for_cut(self, entry: Entry) -> Sequence[Sweep]:
        """Begin with a packet and wait for the next cut, as the head may have turned any number of times."""
        self._last = entry
        self._turn = Turn(entry.time_s, None, [entry])
        self._ending = NO_TURN
        self._longest_s = LONGEST_TURN_S
        return []

    def _sweeps(self, turn: Turn) -> Sequence[Sweep]:
        if turn.before is None:
            return []
        lost, self._holes, self._interval_s = turn.missing(self._holes)
        self.reception.lost += lost
        ahead_s, turn_s = turn.times()
        self._longest_s = min(1.5 * turn_s, LONGEST_TURN_S)
        return [Sweep(ahead_s + self._clock.offset_s, self._points(turn.entries), turn_s, complete=lost == 0)]

    def _points(self, entries: Sequence[Entry]) -> Float32:
        """Table of a turn, without the points that its first and last packets have beyond the seam."""
        # Clockwise from behind the sensor, a turn begins on its left (y > 0) and ends on its right (y < 0).
        begin = self._reach
        end = TURN - self._reach
        tables = []
        if first := [entry for entry in entries if entry.phase < begin]:
            table = self._table(first)
            tables.append(table[table[:, 1] >= 0])
        if middle := [entry for entry in entries if entry.phase >= begin and entry.end <= end]:
            tables.append(self._table(middle))
        if last := [entry for entry in entries if entry.end > end]:
            table = self._table(last)
            tables.append(table[table[:, 1] < 0])
        return np.concatenate(tables)


def strongest(cells: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """(firings, channels) distance and reflectance of the brightest return, of (firings, returns, channels) cells."""
    best = cells["reflectance"].argmax(axis=1)[:, None]
    return (np.take_along_axis(cells[name], best, axis=1)[:, 0] for name in ("distance", "reflectance"))


def points_of(x: Float32, y: Float32, z: Float32, reflectance: NDArray[np.uint8]) -> Float32:
    """(N, 4) points of their coordinates [m, sensor frame] and of reflectances in bytes."""
    points = np.empty((len(x), 4), np.float32)
    points[:, 0] = x
    points[:, 1] = y
    points[:, 2] = z
    points[:, 3] = reflectance
    points[:, 3] *= np.float32(1 / 255)
    return points
