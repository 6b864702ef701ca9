"""Shared parts of the decoders of packets: interface, clock of the sensor, import of an extra."""

from __future__ import annotations

import atexit
import copy
import gc
import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from modt.errors import MisuseError, install
from modt.sources.stream import Reception, StreamInfo, Sweep
from modt.types import Self

MAX_DRIFT = 1e-4
"""Greatest drift of a sensor's clock against the host's [s/s]."""
MAX_ERROR_S = 1.0
"""Greatest difference of offsets [s]; beyond it a clock was set, or the sensor was restarted."""
WINDOW_S, STEP_S = 10.0, 0.02
"""If the least delay within WINDOW_S exceeds the known one by STEP_S, the host's clock was set forward [s]."""


class DeviceClock:
    """Follows the least delay between stamp and reception, so that a late reception moves no stamp.

    Attributes:
        offset_s: offset from the unwrapped time of the device to the host's clock [s].
    """

    def __init__(self, wrap_s: float = math.inf) -> None:
        """`wrap_s`: time after which the stamps of the device start over [s]."""
        self.offset_s = 0.0
        self._wrap_s = wrap_s
        self._last_s: float | None = None
        self._since_s, self._least_s = 0.0, math.inf  # begin of a window, and the least offset in it

    def unwrapped(self, device_s: float, received_s: float) -> float:
        """Time of the device [s], continuous beyond `wrap_s`, for a stamp received at a time of the host."""
        if self._last_s is None:
            self._last_s, self._since_s, self.offset_s = device_s, device_s, received_s - device_s
            return device_s
        elapsed_s = math.remainder(device_s - self._last_s, self._wrap_s)
        self._last_s += elapsed_s
        offset_s = received_s - self._last_s
        if abs(offset_s - self.offset_s) > MAX_ERROR_S:
            self.offset_s = offset_s
        else:
            self.offset_s = min(self.offset_s + MAX_DRIFT * max(elapsed_s, 0.0), offset_s)
        self._least_s = min(self._least_s, offset_s)
        if not 0 <= self._last_s - self._since_s < WINDOW_S:
            if self._least_s - self.offset_s > STEP_S:
                self.offset_s = self._least_s
            self._since_s, self._least_s = self._last_s, math.inf
        return self._last_s


MAX_QUOTED = 200

log = logging.getLogger(__name__)


class PacketDecoder(ABC):
    """Turns packets of one sensor into sweeps.

    Attributes:
        name: name of the source, for messages.
        profile: shipped profile of the sensor; None where there is none, or before its packets have identified it.
        elevations_deg: elevations of its beams, where they are known.
        period_s: nominal time of a sweep with factory settings; each sweep has its measured time.
    """

    name: str
    profile: str | None = None
    elevations_deg: tuple[float, ...] | None = None
    period_s = 0.1

    def info(self, name: str, maker: str) -> StreamInfo:
        """Properties of a stream of the sensor's packets."""
        layout, beams = f"{maker} packets", self.elevations_deg
        return StreamInfo(name, layout, period_s=self.period_s, profile=self.profile, elevations_deg=beams)

    def again(self) -> Self:
        """Decoder of the same sensor that has seen no packet yet."""
        other = copy.copy(self)
        other._forget()
        return other

    @abstractmethod
    def _forget(self) -> None:
        """Return to the state before the first packet."""

    @abstractmethod
    def accepts(self, payload: bytes) -> bool:
        """Whether a payload is a packet of points of this kind of sensor."""

    @abstractmethod
    def decode(self, received_s: float, payload: bytes, reception: Reception) -> Sequence[Sweep]:
        """Sweeps completed by a packet; unusable and missing packets are counted, never raised."""

    def pause(self, reception: Reception) -> Sequence[Sweep]:
        """Sweep that is complete because the sensor is blind in the rest of its turn; called in a pause."""
        return []

    def finish(self, reception: Reception) -> Sequence[Sweep]:
        """Last sweep, if only the packet after it is missing."""
        return []


def decoder_for(maker: str, name: str, options: Mapping[str, str], host: str = "") -> PacketDecoder:
    """Decoder for the sensors of a maker, which is the scheme of their addresses.

    `options` may name the model and calibration of a Velodyne, the calibration of a Hesai, the metadata of an Ouster.
    The sensor at `host` is asked for missing options; it is empty where the sensor is not known.

    Raises:
        MisuseError: an option is invalid, there are no metadata, or an extra is missing.
    """
    calibration = Path(options["calibration"]) if options.get("calibration") else None
    if maker == "livox":
        from modt.sources.packets.livox import LivoxDecoder

        return LivoxDecoder(name)
    if maker == "hesai":
        from modt.sources.packets.hesai import HesaiDecoder, asked_angles, read_angles

        if calibration is not None:
            return HesaiDecoder(name, read_angles(calibration))
        return HesaiDecoder(name, asked_angles(host) if host else None)
    if maker == "ouster":
        from modt.sources.packets.ouster import OusterDecoder

        metadata = options.get("metadata")
        if not metadata and not host:
            remedy = "write ouster://HOST, the sensor's address, to have it asked, or add ?metadata=FILE"
            raise MisuseError(name, "its packets cannot be read without the sensor's metadata", remedy)
        return OusterDecoder(name, Path(metadata) if metadata else host)
    from modt.sources.packets.velodyne import VelodyneDecoder, model_named

    return VelodyneDecoder(name, model_named(options["model"]) if options.get("model") else None, calibration)


def extra(module: str, name: str) -> Any:
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


def refuse(reception: Reception, name: str, reason: str) -> None:
    """Count a refused packet; the first one for each reason is logged."""
    if reception.refuse(reason):
        log.warning("%s: packet refused: %s; later ones are only counted", name, reason)
