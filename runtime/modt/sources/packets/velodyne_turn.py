"""One turn of a Velodyne's head, packet by packet."""

from __future__ import annotations

import math
from bisect import bisect
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np

from modt.sources.packets.velodyne_models import TURN
from modt.types import Float64

AHEAD = TURN // 2
"""Phase of a head that looks straight ahead; it is 0 behind the sensor."""
MIN_HOLE = 10
"""Missing packets in a row that may be what the sensor is set not to see."""
SAME_S = 0.5e-6
"""Packets whose times differ by less are one packet."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A packet of a turn.

    Attributes:
        time_s: of its first block, on the clock of the sensor.
        phase, end: of the head at its first and last block, clockwise from behind the sensor [0.01 deg]; below 0 or
            above TURN in the packets that a turn shares with its neighbours.
        packet: for the decoder.
    """

    time_s: float
    phase: int
    end: int
    packet: Any

    def turned(self, by: int) -> Entry:
        """The same packet as part of a neighbouring turn."""
        return replace(self, phase=self.phase + by, end=self.end + by)


@dataclass(slots=True)
class Turn:
    """The packets of a turn, ordered by time.

    Attributes:
        began_s: time of the first of its own packets.
        before: last packet of the turn before; None: the head was first heard of within this turn.
        entries: its own packets, and those of its neighbours whose beams may have looked into it.
    """

    began_s: float
    before: Entry | None
    entries: list[Entry] = field(default_factory=list)

    @property
    def reaches_seam(self) -> bool:
        """Whether the packet after its last one would be of the next turn."""
        last = self.entries[-1] if self.entries else None
        return last is not None and last.end + (last.end - last.phase) // 4 > TURN

    def ends_at(self, holes: Float64) -> bool:
        """Whether a hole of the turn before, of which it was the beginning, is reached."""
        last = self.entries[-1] if self.entries else None
        if last is None or self.before is None:
            return False
        step = last.phase - self.entries[-2].phase if len(self.entries) > 1 else 0
        return bool((np.abs(last.phase - TURN - holes) <= step / 2).any())

    def insert(self, entry: Entry) -> bool:
        """Add a packet that comes late; whether it is of this turn and new."""
        at = bisect(self.entries, entry.time_s - SAME_S, key=attrgetter("time_s"))
        after_s = self.entries[at].time_s if at < len(self.entries) else math.inf
        if entry.time_s < self.began_s or after_s < entry.time_s + SAME_S:
            return False
        self.entries.insert(at, entry)
        return True

    def shared(self, reach: int) -> list[Entry]:
        """The packets at its end that the next turn needs as well."""
        return [e.turned(-TURN) for e in self.entries if e.end > TURN - reach]

    def times(self) -> tuple[float, float]:
        """Times [s] at which the head looks straight ahead, and in which it turns once."""
        first, last = self.entries[0], self.entries[-1]
        turn_s = (last.time_s - first.time_s) * TURN / max(last.phase - first.phase, 1)
        near = min(self.entries, key=lambda e: abs(e.phase - AHEAD))
        return near.time_s + (AHEAD - near.phase) / TURN * turn_s, turn_s

    def missing(self, holes: Float64 | None) -> tuple[int, Float64, float]:
        """Packets missing, phases at which long holes begin, and the interval between packets [s].

        A long hole that begins where one of the `holes` of the turn before did is not missing, nor is any if that is
        None: the sensor is set not to see there.
        """
        own = [e for e in self.entries if 0 <= e.phase < TURN]
        if self.before is not None:
            own.insert(0, self.before.turned(-TURN))
        times_s, phases = np.array([(e.time_s, e.phase) for e in own]).T
        gaps_s = np.diff(times_s)
        interval_s = float(np.median(gaps_s)) if len(gaps_s) else 0.0
        if interval_s <= 0:
            return 0, np.zeros(0), 0.0
        count = np.rint(gaps_s / interval_s) - 1
        long, begins = count >= MIN_HOLE, phases[:-1]
        if holes is None:
            known = long
        else:
            step = 2 * float(np.median(np.diff(phases)))
            known = long & (np.abs(begins[:, None] - holes) <= step).any(axis=1)
        return int(count[~known].clip(0).sum()), begins[long], interval_s
