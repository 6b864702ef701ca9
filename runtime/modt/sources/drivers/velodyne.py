"""Sweeps from Velodyne's packets, by velodyne-decoder."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from struct import Struct
from typing import Any, NamedTuple

import numpy as np

from modt.errors import MisuseError, refuse_pipe
from modt.sources.drivers import Driver
from modt.sources.packets.packet_decoder import import_extra, one_line
from modt.sources.packets.turn_decoder import TURN, Entry, TurnDecoder
from modt.types import Float32

log = logging.getLogger(__name__)

PACKET_BYTES = 1206
BANKS = slice(1, 1200, 100)
"""Second bytes of the headers of the blocks."""
AZIMUTHS = Struct("<" + 12 * "2xH96x")
"""Azimuths of the blocks."""
STAMP_AT = 1200
"""Offset of the time since the full hour [us, 4 bytes]."""
RETURN_AT = 1204
"""Offset of the return mode."""
IDENTITY_AT = 1205
"""Offset of the byte that names the model."""
DUAL = 0x39
"""Return mode of two returns a firing."""
PACE_TOLERANCE = 0.05
"""Relative difference of the interval between packets, beyond which they are of another model."""
UPPER = frozenset({0xEE})
"""Banks of lasers in a packet of 16 or 32 lasers. Those of 64 and 128 lasers have two and four banks."""
UPPER_LOWER = frozenset({0xEE, 0xDD})
FOUR_BANKS = UPPER_LOWER | {0xCC, 0xBB}
RETURN = 7
"""Column of the library's table that numbers the return of a firing."""


class Signature(NamedTuple):
    """Bytes that all packets of one model share.

    Attributes:
        banks: second bytes of the headers of its blocks.
        identity: byte that names the model; None where it has another meaning.
    """

    banks: frozenset[int]
    identity: int | None


@dataclass(frozen=True)
class Model:
    """A model of sensor.

    Attributes:
        name: name in addresses and options.
        member: name in velodyne_decoder.Model.
        signature: signature of its packets.
        interval_us: time between packets of one return a firing [us].
        profile: shipped profile, None where there is none.
        reach: greatest angle between a beam and the head at the first beam of its block [0.01 deg].
        calibration: file bundled with velodyne-decoder, used without the unit's own; None where all units are alike.
    """

    name: str
    member: str
    signature: Signature
    interval_us: float
    profile: str | None = None
    reach: int = 100
    calibration: str | None = None


_HDL_64E = Signature(UPPER_LOWER, None)
MODELS = (
    Model("vlp-16", "VLP16", Signature(UPPER, 0x22), 1327.1, "vlp-16"),
    Model("puck-hi-res", "PuckHiRes", Signature(UPPER, 0x24), 1327.1),
    Model("vlp-32c", "VLP32C", Signature(UPPER, 0x28), 663.6, "vlp-32c", 450),
    Model("hdl-32e", "HDL32E", Signature(UPPER, 0x21), 552.96, "hdl-32e"),
    Model("hdl-64e", "HDL64E_S3", _HDL_64E, 288.0, "hdl-64e", 900, "HDL-64E_S3-VeloView.yml"),
    Model("hdl-64e-s2", "HDL64E_S2", _HDL_64E, 288.0, "hdl-64e", 900, "HDL-64E_S2.1-sztaki.yml"),
    Model("vls-128", "VLS128", Signature(FOUR_BANKS, 0xA1), 165.9, None, 700),
)


def model_named(name: str) -> Model:
    """Model of a name.

    Raises:
        MisuseError: the name is unknown.
    """
    by_name = {model.name: model for model in MODELS}
    if name not in by_name:
        raise MisuseError(f"model={name}", "no model of Velodyne that is known", f"use one of {', '.join(by_name)}")
    return by_name[name]


def signature_of(payload: bytes) -> Signature | None:
    """Signature of a packet; None if a payload is no packet of points of a Velodyne."""
    if len(payload) != PACKET_BYTES or payload[0:1200:100] != b"\xff" * 12:
        return None
    banks = frozenset(payload[BANKS])
    if banks not in (UPPER, UPPER_LOWER, FOUR_BANKS) or max(AZIMUTHS.unpack_from(payload)) > TURN:
        return None
    return Signature(banks, None if banks == UPPER_LOWER else payload[IDENTITY_AT])


def recognised(signature: Signature, payloads: Sequence[bytes], name: str, declared: Model | None) -> Model | None:
    """Model that sent the packets of a signature among the payloads, or the declared one; None where it is unknown.

    Where the identity of the packets contradicts their pace, the pace decides. A contradiction is logged as a
    warning.
    """
    stated = next((model for model in MODELS if model.signature == signature), None)
    paced = _by_pace([payload for payload in payloads if signature_of(payload) == signature], stated)
    used = declared or paced
    if used is not None and not (used.signature == signature and (paced is stated or stated is None)):
        facts = f"its packets say {stated.name if stated else 'nothing known'}"
        pace = f" at the pace of {paced.name}" if paced is not stated and paced is not None else ""
        remedy = "leave model= out to have it recognised" if declared else "give model= to overrule"
        log.warning("%s: %s%s; decoded as %s; %s", name, facts, pace, used.name, remedy)
    return used


def _by_pace(payloads: Sequence[bytes], stated: Model | None) -> Model | None:
    """Model that fits the interval between the packets; the stated one if it fits."""
    stamps_us = [int.from_bytes(payload[STAMP_AT : STAMP_AT + 4], "little") for payload in payloads]
    gaps_us = [b - a for a, b in pairwise(stamps_us) if b > a]
    if not gaps_us or stated is None or stated.signature == _HDL_64E:
        return stated
    interval_us = median(gaps_us) * (2 if payloads[0][RETURN_AT] == DUAL else 1)
    alike = [model for model in MODELS if model.signature.banks == stated.signature.banks]
    fitting = [model for model in alike if abs(interval_us / model.interval_us - 1.0) < PACE_TOLERANCE]
    return stated if stated in fitting or not fitting else fitting[0]


class VelodyneDecoder(TurnDecoder):
    """Turns of a Velodyne; of two returns of a firing the stronger one is taken."""

    maker = "Velodyne"
    wrap_s = 3600.0
    unknown = "of a model of Velodyne that is unknown; give model="
    signature = staticmethod(signature_of)

    def __init__(self, name: str, model: Model | None = None, calibration: Path | None = None) -> None:
        """Make a decoder for the source of a name; without `model` it is recognised by the first packets.

        Raises:
            MisuseError: velodyne-decoder is missing, or the calibration cannot be read.
        """
        self._library = import_extra("velodyne_decoder", "velodyne")
        self._declared = model
        self._calibration = None if calibration is None else self._read(calibration)
        self._identity: bytes | None = None
        super().__init__(name, model.profile if model else None)

    def _read(self, calibration: Path) -> Any:
        remedy = "give a calibration in the format of ROS's velodyne_pointcloud"
        refuse_pipe(calibration, remedy)
        try:
            return self._library.Calibration.read(str(calibration))
        except Exception as error:  # errors of the library's YAML parser have no common type
            raise MisuseError(calibration, f"no calibration ({one_line(error)})", remedy) from None

    def _recognise(self, signature: Signature, payloads: Sequence[bytes]) -> Signature | None:
        model = recognised(signature, payloads, self.name, self._declared)
        if model is None:
            return None
        self.profile = model.profile
        self._identity = None if model.signature.identity is None else bytes([model.signature.identity])
        self._reach = model.reach
        self._packet_s = model.interval_us * 1e-6
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
        first, *_, last = AZIMUTHS.unpack_from(payload)
        if self._identity is not None:  # the library refuses packets with a wrong identity
            payload = payload[:IDENTITY_AT] + self._identity
        return Entry.of(time_s, first, last, self._library.VelodynePacket(time_s, payload))

    def _points(self, entries: Sequence[Entry]) -> Float32:
        table = super()._points(entries)
        stronger = table[:, RETURN] != self._library.ReturnMode.LAST.value
        points: Float32 = table[stronger, :4] if stronger.any() else table[:, :4].copy()
        points[:, 3] /= 255.0
        return points

    def _table(self, entries: Sequence[Entry]) -> Float32:
        """(N, 8) table of the library."""
        packets = self._library.PacketVector([entry.packet for entry in entries])
        return np.asarray(self._decoder.decode(packets)[1])


def _decoder(name: str, options: Mapping[str, str], _host: str) -> VelodyneDecoder:
    model = model_named(options["model"]) if options.get("model") else None
    calibration = Path(options["calibration"]) if options.get("calibration") else None
    return VelodyneDecoder(name, model, calibration)


DRIVER = Driver(
    maker=VelodyneDecoder.maker,
    port=2368,
    recognises=VelodyneDecoder.accepts,
    decoder=_decoder,
    options={"model": "MODEL", "calibration": "FILE"},
    identified_by="model",
    extra="velodyne",
)
