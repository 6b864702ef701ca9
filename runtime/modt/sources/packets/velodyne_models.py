"""Velodyne's sensors: how their packets tell them apart."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from struct import Struct
from typing import NamedTuple

from modt.errors import MisuseError
from modt.sources.packets.turn_decoder import TURN

log = logging.getLogger(__name__)

PACKET_BYTES = 1206
BANKS, AZIMUTHS = slice(1, 1200, 100), Struct("<" + 12 * "2xH96x")
STAMP_AT, RETURN_AT, IDENTITY_AT = 1200, 1204, 1205
DUAL = 0x39
"""Return mode: two returns of each firing."""
PACE_TOLERANCE = 0.05
UPPER, UPPER_LOWER = frozenset({0xEE}), frozenset({0xEE, 0xDD})
FOUR_BANKS = UPPER_LOWER | {0xCC, 0xBB}


class Signature(NamedTuple):
    """What the packets of one model share.

    Attributes:
        banks: second bytes of the headers of its blocks.
        identity: byte that names it; None where it has another meaning.
    """

    banks: frozenset[int]
    identity: int | None


@dataclass(frozen=True, slots=True)
class Model:
    """A model of sensor.

    Attributes:
        name: in addresses and options.
        member: of velodyne_decoder.Model.
        signature: of its packets.
        interval_us: between packets of one return a firing.
        profile: shipped profile, None where there is none.
        reach: greatest angle between a beam and the head at the first beam of its block [0.01 deg].
        calibration: bundled with velodyne-decoder, for lack of the unit's own; None where all units are alike.
    """

    name: str
    member: str
    signature: Signature
    interval_us: float
    profile: str | None = None
    reach: int = 100
    calibration: str | None = None

    def paces(self, interval_us: float, *, dual: bool) -> bool:
        """Whether packets follow one another as this model's do."""
        expected_us = self.interval_us / 2 if dual else self.interval_us
        return abs(interval_us / expected_us - 1.0) < PACE_TOLERANCE


_HDL_64E = Signature(UPPER_LOWER, None)
_MODELS = (
    Model("vlp-16", "VLP16", Signature(UPPER, 0x22), 1327.1, "vlp-16"),
    Model("puck-hi-res", "PuckHiRes", Signature(UPPER, 0x24), 1327.1),
    Model("vlp-32c", "VLP32C", Signature(UPPER, 0x28), 663.6, "vlp-32c", 450),
    Model("hdl-32e", "HDL32E", Signature(UPPER, 0x21), 552.96, "hdl-32e"),
    Model("hdl-64e", "HDL64E_S3", _HDL_64E, 288.0, "hdl-64e", 900, "HDL-64E_S3-VeloView.yml"),
    Model("hdl-64e-s2", "HDL64E_S2", _HDL_64E, 288.0, "hdl-64e", 900, "HDL-64E_S2.1-sztaki.yml"),
    Model("vls-128", "VLS128", Signature(FOUR_BANKS, 0xA1), 165.9, None, 700),
)
MODELS = {model.name: model for model in _MODELS}


def model_named(name: str) -> Model:
    """The model of a name.

    Raises:
        MisuseError: none has it.
    """
    if name not in MODELS:
        raise MisuseError(f"model={name}", "no model of Velodyne that is known", f"use one of {', '.join(MODELS)}")
    return MODELS[name]


def signature_of(payload: bytes) -> Signature | None:
    """The signature of a packet; None if a payload is no packet of points of a Velodyne."""
    if len(payload) != PACKET_BYTES or payload[0:1200:100] != b"\xff" * 12:
        return None
    banks = frozenset(payload[BANKS])
    if banks not in (UPPER, UPPER_LOWER, FOUR_BANKS) or max(AZIMUTHS.unpack_from(payload)) > TURN:
        return None
    return Signature(banks, None if banks == UPPER_LOWER else payload[IDENTITY_AT])


def azimuths(payload: bytes) -> tuple[int, int]:
    """Of the first and the last block [0.01 deg]."""
    first, *_, last = AZIMUTHS.unpack_from(payload)
    return first, last


def recognised(payloads: Sequence[bytes], name: str, declared: Model | None) -> tuple[Model | None, Signature | None]:
    """The model that sent most of some packets, or the one declared, and the signature of those packets.

    The model is None where it is unknown. Where identity and pace of the packets disagree, the pace is right: it is
    that of the lasers. A contradiction is warned of in a line.
    """
    signatures = [signature_of(payload) for payload in payloads]
    signature, _ = Counter(signatures).most_common(1)[0]
    said = next((model for model in _MODELS if model.signature == signature), None)
    paced = _by_pace([p for p, s in zip(payloads, signatures, strict=True) if s == signature], said)
    used = declared or paced
    if used is not None and not (used.signature == signature and (paced is said or said is None)):
        facts = f"its packets say {said.name if said else 'nothing known'}"
        pace = f" at the pace of {paced.name}" if paced is not said and paced is not None else ""
        remedy = "leave model= out to have it recognised" if declared else "give model= to overrule"
        log.warning("%s: %s%s; decoded as %s; %s", name, facts, pace, used.name, remedy)
    return used, signature


def _by_pace(payloads: Sequence[bytes], said: Model | None) -> Model | None:
    """The model that the interval between the packets tells: the one that they say if it fits."""
    stamps_us = [int.from_bytes(payload[STAMP_AT : STAMP_AT + 4], "little") for payload in payloads]
    gaps_us = [b - a for a, b in pairwise(stamps_us) if b > a]
    if not gaps_us or said is None or said.signature == _HDL_64E:
        return said
    interval_us, dual = median(gaps_us), payloads[0][RETURN_AT] == DUAL
    fitting = [m for m in _MODELS if m.signature.banks == said.signature.banks and m.paces(interval_us, dual=dual)]
    return said if said in fitting or not fitting else fitting[0]
