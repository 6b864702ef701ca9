"""Interface of the decoders of packets, and how an extra is imported."""

from __future__ import annotations

import atexit
import gc
import logging
from collections.abc import Sequence
from importlib import import_module
from typing import Any, Protocol, Self

from modt.errors import MisuseError
from modt.sources.live.sweep_reader import Reception, Sweep

MAX_QUOTED = 200

log = logging.getLogger(__name__)


class PacketDecoder(Protocol):
    """Packets of one sensor to sweeps.

    Attributes:
        name: of the source, for messages.
        profile: shipped profile of the sensor; None where there is none, or before its packets have told.
        elevations_deg: of its beams, where the sensor's metadata have them.
    """

    name: str
    profile: str | None
    elevations_deg: tuple[float, ...] | None

    def accepts(self, payload: bytes) -> bool:
        """Whether a payload is a packet of points of this kind of sensor."""

    def decode(self, received_s: float, payload: bytes, reception: Reception) -> Sequence[Sweep]:
        """Sweeps completed by a packet; what cannot be used or is missing is counted, never raised."""

    def pause(self, reception: Reception) -> Sequence[Sweep]:
        """The sweep, if the sensor is known not to look any further in this turn; called where it sends nothing."""

    def finish(self, reception: Reception) -> Sequence[Sweep]:
        """The last sweep, if all that it waits for is the packet after it."""

    def again(self) -> Self:
        """A decoder of the same sensor that has seen no packet yet."""


def extra(module: str, name: str) -> Any:
    """A module of an extra that is made with nanobind.

    Such a library complains of leaks at exit unless what the loop has frozen is collected.

    Raises:
        MisuseError: it is not installed.
    """
    atexit.register(gc.unfreeze)
    try:
        return import_module(module)
    except ImportError as error:
        raise MisuseError(f"extra [{name}]", f"not installed ({error})", f"pip install 'modt[{name}]'") from None


def one_line(error: Exception) -> str:
    """What a library says, as part of a line."""
    return " ".join(str(error).split())[:MAX_QUOTED]


def refuse(reception: Reception, name: str, reason: str) -> None:
    """Count a refused packet; the first for its reason is logged."""
    if reception.refuse(reason):
        log.warning("%s: packet refused: %s; later ones are only counted", name, reason)
