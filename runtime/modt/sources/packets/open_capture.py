"""PCAP files as streams."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path

from modt.errors import MisuseError
from modt.sources.live.sweep_reader import Reception, Sweep
from modt.sources.packets import hesai, livox, velodyne
from modt.sources.packets.capture import Capture
from modt.sources.packets.packet_decoder import PacketDecoder, decoder_for
from modt.sources.stamp_check import StampCheck
from modt.sources.stream import Faults, StreamInfo
from modt.types import Frame, Self


class PacketStream:
    """Frames of one sensor's packets in a PCAP file; their number is known after they have been read.

    Attributes:
        info, faults: as in Stream.
        capture, decoder: datagrams of the sensor, and their decoder.
        reception: counts of the last pass.
    """

    def __init__(
        self, info: StreamInfo, capture: Capture, decoder: PacketDecoder, first: int = 0, last: int | None = None
    ) -> None:
        """Select the frames with first <= index < last; each pass decodes with a fresh copy of the decoder."""
        self.info, self.faults, self.reception = info, Faults(), Reception()
        self.capture, self.decoder, self._first, self._last = capture, decoder, first, last

    def __iter__(self) -> Iterator[Frame]:
        self.reception = reception = Reception()
        stamps, path, lost = StampCheck(), str(self.capture.path), 0
        for index, (arrived_s, sweep) in enumerate(islice(self._sweeps(reception), self._last)):
            missing, lost = reception.lost - lost, reception.lost
            if index < self._first:
                stamps.doubt(sweep.stamp_s, arrived_s)
                continue
            flaws = [f"{missing} packets are missing"] if missing else []
            place = (index, path, f"{path}: sweep {index}")
            if frame := stamps.frame(sweep, arrived_s, self.faults, place, flaws):
                yield frame

    def between(self, first: int, last: int | None) -> Self:
        """Frames with first <= index < last; the file is read up to the last one."""
        ends = [end for end in (last, self._last) if end is not None]
        first, end = max(first, self._first), min(ends, default=None)
        nothing = end is not None and end <= first
        info = replace(self.info, end=end, n_frames=0 if nothing else None)
        return type(self)(info, self.capture, self.decoder, first, first if nothing else end)

    def _sweeps(self, reception: Reception) -> Iterator[tuple[float, Sweep]]:
        """Arrival [s] and sweep of each turn; refused packets and a broken end of the file are reported last."""
        index = 0
        for arrived_s, sweep in _decoded(self.capture, self.decoder.again(), reception):
            yield arrived_s, sweep
            index += 1
        flaws = [f"{count} packets refused: {reason}" for reason, count in reception.refused.items()]
        if self.capture.flaw is not None:
            flaws.append(self.capture.flaw)
        for flaw in flaws:
            path = str(self.capture.path)
            self.faults.report(index, path, flaw, skipped=False, place=f"{path}: sweep {index}")


def open_capture(path: Path, options: Mapping[str, str]) -> PacketStream:
    """Stream of the sensor whose packets come first in a PCAP file.

    `options` may name model and calibration of a Velodyne, the calibration of a Hesai, or the file with the metadata
    of an Ouster. The last two default to files with the name of the capture and the suffix .csv or .json.

    Raises:
        MisuseError: no PCAP file, no packets of a sensor, no whole sweep; an invalid option, a missing extra.
    """
    capture = Capture(path)
    if "model" not in options:
        options = _beside(path, metadata=".json") | dict(options)
    maker = _maker(capture, options)
    if maker == "hesai":
        options = _beside(path, calibration=".csv") | dict(options)
    decoder, layout = decoder_for(maker, path.stem, options), maker.capitalize()
    capture.flow = next(((d.source, d.port) for d in capture if decoder.accepts(d.payload)), None)
    if capture.flow is None:
        seen = Counter(f"{len(d.payload)} bytes to port {d.port}" for d in capture)
        there = f"{seen.total()} UDP datagrams, mostly of {seen.most_common(1)[0][0]}" if seen else "no UDP datagram"
        if layout == "Ouster":
            remedy = "give the metadata of the sensor that sent them"
        else:
            remedy = f"for an Ouster, save its metadata as {path.with_suffix('.json')} or give metadata=FILE"
        raise MisuseError(path, f"no packets of a {layout} ({there})", remedy)
    _, first = next(_decoded(capture, decoder, Reception()), (0.0, None))
    if first is None:
        raise MisuseError(path, f"no whole sweep ({layout})", "record at least two turns of the sensor")
    info = StreamInfo(
        path.stem,
        f"{layout} packets",
        period_s=round(first.turn_s, 3) or decoder.period_s,
        profile=decoder.profile,
        elevations_deg=decoder.elevations_deg,
    )
    return PacketStream(info, capture, decoder)


def _beside(path: Path, **suffixes: str) -> dict[str, str]:
    """Options whose files have the name of the capture, where they exist."""
    files = {option: path.with_suffix(suffix) for option, suffix in suffixes.items()}
    return {option: str(file) for option, file in files.items() if file.is_file()}


def _maker(capture: Capture, options: Mapping[str, str]) -> str:
    """Maker of the sensor whose packets come first."""
    if "metadata" in options:
        return "ouster"
    for datagram in capture if "model" not in options else ():
        if velodyne.signature_of(datagram.payload):
            break
        if hesai.model_of(datagram.payload):
            return "hesai"
        if livox.is_packet(datagram.payload):
            return "livox"
    return "velodyne"


def _decoded(capture: Capture, decoder: PacketDecoder, reception: Reception) -> Iterator[tuple[float, Sweep]]:
    """Time of the completing packet [s] and sweep, in the order of the capture."""
    arrived_s = 0.0
    for datagram in capture:
        reception.messages += 1
        arrived_s = datagram.stamp_s
        for sweep in decoder.decode(arrived_s, datagram.payload, reception):
            yield arrived_s, sweep
    for sweep in decoder.finish(reception):
        yield arrived_s, sweep
