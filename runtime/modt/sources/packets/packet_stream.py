"""The sweeps of a capture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

from modt.errors import ScanError
from modt.sources.live.sweep_reader import Reception, Sweep
from modt.sources.packets.capture import Capture
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.scan_file import sanitised
from modt.sources.stamp_check import CLOCK_SET, StampCheck
from modt.sources.stream import Fault, Faults, StreamInfo
from modt.types import Frame, Self


class PacketStream:
    """Frames of one sensor's packets in a PCAP file; how many they are is known after they have been read.

    Attributes:
        info, faults: as in Stream.
        capture, decoder: the datagrams of the sensor, and what decodes them.
        reception: counts of the last pass.
    """

    def __init__(
        self,
        info: StreamInfo,
        capture: Capture,
        decoder: PacketDecoder,
        first: int = 0,
        last: int | None = None,
    ) -> None:
        """The frames with first <= index < last; each pass has a decoder of its own, made from this one."""
        self.info, self.faults, self.reception = info, Faults(), Reception()
        self.capture, self.decoder, self._first, self._last = capture, decoder, first, last

    def __iter__(self) -> Iterator[Frame]:
        self.reception = reception = Reception()
        stamps, lost = StampCheck(), 0
        for index, (arrived_s, sweep) in enumerate(islice(self._sweeps(reception), self._last)):
            missing, lost = reception.lost - lost, reception.lost
            steps, doubt = stamps.steps, stamps.doubt(sweep.stamp_s, arrived_s)
            if index < self._first:
                continue
            if doubt:
                self._fault(index, doubt, skipped=True)
                continue
            try:
                points, flaws = sanitised(sweep.points, self.info.name)
            except ScanError as error:
                self._fault(index, error.cause, skipped=True)
                continue
            if missing:
                flaws.append(f"{missing} packets are missing")
            if stamps.steps > steps:
                flaws.append(CLOCK_SET)
            if flaws:
                self._fault(index, "; ".join(flaws), skipped=False)
            yield Frame(index, sweep.stamp_s + stamps.shift_s, points, turn_s=sweep.turn_s)

    def between(self, first: int, last: int | None) -> Self:
        """The frames with first <= index < last; the file is read up to the last one."""
        ends = [end for end in (last, self._last) if end is not None]
        first, end = max(first, self._first), min(ends, default=None)
        nothing = end is not None and end <= first
        info = replace(self.info, end=end, n_frames=0 if nothing else None)
        return type(self)(info, self.capture, self.decoder, first, first if nothing else end)

    def _sweeps(self, reception: Reception) -> Iterator[tuple[float, Sweep]]:
        """Arrival [s] and sweep of each turn; then faults for what was refused and where the file is broken."""
        decoder, index, arrived_s = self.decoder.again(), 0, 0.0
        for datagram in self.capture:
            reception.messages += 1
            arrived_s = datagram.stamp_s
            sweeps = decoder.decode(arrived_s, datagram.payload, reception)
            yield from ((arrived_s, sweep) for sweep in sweeps)
            index += len(sweeps)
        last = decoder.finish(reception)
        yield from ((arrived_s, sweep) for sweep in last)
        index += len(last)
        for reason, count in reception.refused.items():
            self._fault(index, f"{count} packets refused: {reason}", skipped=False)
        if self.capture.flaw is not None:
            self._fault(index, self.capture.flaw, skipped=False)

    def _fault(self, index: int, cause: str, *, skipped: bool) -> None:
        subject = str(self.capture.path)
        self.faults.report(Fault(index, subject, cause, skipped), f"{subject}: sweep {index}")
