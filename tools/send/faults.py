"""Faults of a network, by seed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from random import Random

Timed = tuple[float, bytes]
"""Time at which a payload is sent [s], and the payload."""


@dataclass(frozen=True)
class PacketFaults:
    """Shares of the packets that are lost, sent twice, sent after the next one, or followed by random bytes."""

    lost: float = 0.0
    duplicated: float = 0.0
    reordered: float = 0.0
    garbage: float = 0.0
    seed: int = 0

    def applied(self, packets: Iterable[Timed]) -> Iterator[Timed]:
        """Packets with faults, which the seed determines."""
        random = Random(self.seed)
        held: bytes | None = None
        for at_s, payload in packets:
            lost, twice, later, garbage = (random.random() for _ in range(4))
            if lost >= self.lost:
                if held is None and later < self.reordered:
                    held = payload
                    continue
                yield at_s, payload
                if twice < self.duplicated:
                    yield at_s, payload
            if held is not None:
                yield at_s, held
                held = None
            if garbage < self.garbage:
                yield at_s, random.randbytes(len(payload))
