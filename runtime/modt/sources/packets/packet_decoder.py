"""Interface of the decoders of packets, and what they share: counted refusals, and the import of an extra."""

from __future__ import annotations

import atexit
import copy
import gc
import logging
from abc import ABC, abstractmethod
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from modt.errors import MisuseError, install
from modt.sources.stream import Reception, StreamInfo, Sweep
from modt.types import Self

MAX_QUOTED = 200
"""Greatest length of a quoted message of a library's error."""

log = logging.getLogger(__name__)


class PacketDecoder(ABC):
    """Turns packets of one sensor into sweeps.

    Attributes:
        name: name of the source, for messages.
        reception: counts of lost and refused packets, and of received ones, which its user counts.
        profile: shipped profile of the sensor; None where there is none, or before its packets have identified it.
        elevations_deg: elevations of its beams, where they are known.
        period_s: nominal time of a sweep with factory settings; each sweep has its measured time.
    """

    profile: str | None = None
    elevations_deg: tuple[float, ...] | None = None
    period_s = 0.1

    def __init__(self, name: str) -> None:
        """`name`: name of the source."""
        self.name = name
        self.reception = Reception()
        self._reset()

    def info(self, name: str, maker: str) -> StreamInfo:
        """Properties of a stream of the sensor's packets."""
        return StreamInfo(
            name,
            f"{maker} packets",
            period_s=self.period_s,
            profile=self.profile,
            elevations_deg=self.elevations_deg,
        )

    def fresh(self) -> Self:
        """Decoder of the same sensor that has seen no packet yet."""
        other = copy.copy(self)
        other.reception = Reception()
        other._reset()
        return other

    def refuse(self, reason: str) -> None:
        """Count a refused packet; the first one for each reason is logged."""
        if self.reception.refuse(reason):
            log.warning("%s: packet refused: %s; later ones are only counted", self.name, reason)

    @abstractmethod
    def _reset(self) -> None:
        """Return to the state before the first packet."""

    @abstractmethod
    def accepts(self, payload: bytes) -> bool:
        """Whether a payload is a packet of points of this kind of sensor."""

    @abstractmethod
    def decode(self, received_s: float, payload: bytes) -> Sequence[Sweep]:
        """Sweeps completed by a packet; unusable and missing packets are counted, never raised."""

    def describe(self, payload: bytes) -> bool:
        """Take what a sensor tells of itself in packets to another port; whether a payload is such a packet."""
        return False

    def pause(self) -> Sequence[Sweep]:
        """Sweep that is complete because the sensor is blind in the rest of its turn; called in a pause."""
        return []

    def finish(self) -> Sequence[Sweep]:
        """Last sweep, if only the packet after it is missing."""
        return []


def import_extra(module: str, name: str) -> Any:
    """Import a module of an extra that is built with nanobind.

    Such a library reports leaks at exit unless the objects that the loop has frozen are collected.

    Raises:
        MisuseError: the extra is not installed.
    """
    atexit.register(gc.unfreeze)
    try:
        return import_module(module)
    except ImportError as error:
        raise MisuseError(f"extra [{name}]", f"not installed ({error})", install(name)) from None


def one_line(error: Exception) -> str:
    """Message of a library's error, shortened to a part of a line."""
    return " ".join(str(error).split())[:MAX_QUOTED]
