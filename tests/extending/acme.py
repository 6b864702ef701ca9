"""A driver of a made-up maker, which the test lays beside the drivers of modt."""

from collections.abc import Sequence

import numpy as np

from modt.sources.drivers import Driver
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import Sweep

MAGIC = b"ACME"


class AcmeDecoder(PacketDecoder):
    """A packet is a whole sweep: float32 rows of x, y, z and reflectance, on a scale that an option states."""

    def __init__(self, name: str, scale: float) -> None:
        super().__init__(name)
        self._scale = np.float32(scale)

    @staticmethod
    def accepts(payload: bytes) -> bool:
        return payload.startswith(MAGIC) and not (len(payload) - len(MAGIC)) % 16

    def decode(self, received_s: float, payload: bytes) -> Sequence[Sweep]:
        if not self.accepts(payload):
            self.refuse("no packet of an Acme")
            return []
        points = np.frombuffer(payload, np.float32, offset=len(MAGIC)).reshape(-1, 4).copy()
        points[:, 3] /= self._scale
        return [Sweep(received_s, points)]

    def _reset(self) -> None:
        """No packet depends on those before it."""


DRIVER = Driver(
    maker="Acme",
    port=4711,
    recognises=AcmeDecoder.accepts,
    decoder=lambda name, options, _host: AcmeDecoder(name, float(options.get("scale", 1.0))),
    options={"scale": "NUMBER"},
)
