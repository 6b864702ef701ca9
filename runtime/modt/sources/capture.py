"""Captures of a sensor's packets as streams."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path

from modt.errors import MisuseError
from modt.sources.drivers import Driver, all_drivers
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.packets.pcap_file import PcapFile
from modt.sources.stamp_check import StampCheck
from modt.sources.stream import Faults, Reading, StreamInfo, Sweep
from modt.types import Frame, Self

CHOICES = frozenset({"host", "port"})
"""Options that choose one of several sensors in a capture."""
PEEKED = 50
"""Number of packets of a flow by which a sensor is recognised."""
SEARCHED = 20_000
"""Number of packets among which other sensors are searched, some seconds of two."""
FOREIGN = {b"\x55\xaa\x5a\xa5": "RoboSense M or E"}
"""Sensors whose packets are not decoded, by the first bytes of a packet."""


class PacketStream:
    """Frames of one sensor's packets in a PCAP file; their number is known after they have been read.

    Attributes:
        info, faults: as in Stream.
        capture, decoder: datagrams of the sensor, and a decoder of the same sensor.
        reception: counts of the last pass.
    """

    def __init__(self, info: StreamInfo, capture: PcapFile, decoder: PacketDecoder, first: int = 0) -> None:
        """Select the frames with first <= index < info.end; each pass decodes with a fresh copy of the decoder."""
        self.info = info
        self.faults = Faults()
        self.reading = Reading()
        self.reception = decoder.reception
        self.capture = capture
        self.decoder = decoder
        self._first = first

    def __iter__(self) -> Iterator[Frame]:
        decoder = self.decoder.fresh()
        self.reception = decoder.reception
        self.reading = Reading()
        path = str(self.capture.path)
        stamps = StampCheck()
        lost = 0
        index = -1
        sweeps = islice(_decoded(self.capture, decoder), self.info.end)
        for index, (arrived_s, sweep) in enumerate(sweeps):
            self.reading.messages = self.reception.messages
            self.reading.sweeps += 1
            self.reading.times[sweep.times] += 1
            missing = self.reception.lost - lost
            lost = self.reception.lost
            if index < self._first:
                stamps.doubt(sweep.stamp_s, arrived_s)
                continue
            flaws = [f"{missing} packets are missing"] if missing else []
            if frame := stamps.frame(sweep, arrived_s, index, path, self.faults, flaws):
                yield frame
        if index + 1 != self.info.end:
            self._account(index + 1, path)

    def _account(self, n_sweeps: int, path: str) -> None:
        """Report what was refused and what is damaged, once the file is read to its end."""
        self.reading.messages = self.reception.messages
        for reason, count in self.reception.refused.items():
            self.faults.report(n_sweeps, path, f"{count} packets refused: {reason}", skipped=False)
        for flaw in self.capture.flaws:
            self.faults.leave_out(n_sweeps, path, flaw)

    def between(self, first: int, last: int | None) -> Self:
        """Frames with first <= index < last; the file is read up to the last one."""
        first = max(first, self._first)
        end = min((index for index in (last, self.info.end) if index is not None), default=None)
        empty = end is not None and end <= first
        info = replace(self.info, end=end, n_frames=0 if empty else None)
        return type(self)(info, self.capture, self.decoder, first)


def open_capture(path: Path, options: Mapping[str, str]) -> PacketStream:
    """Stream of the sensor whose packets come first in a PCAP file.

    `options` are those of the sensor's driver, and `host` and `port`, which choose one of several sensors by the
    address that its packets come from and the port that they go to. Options of a driver default to files with the
    name of the capture.

    Raises:
        MisuseError: no capture, no packets of a sensor, no whole sweep; an invalid option, a missing extra.
    """
    capture = PcapFile(path)
    capture.flow = _asked(capture, options)
    options = {key: value for key, value in options.items() if key not in CHOICES}
    driver = _driver_of(capture, options)
    decoder = driver.decoder(path.stem, driver.options_beside(path) | options, "")
    capture.flow = capture.flow or next(((d.source, d.port) for d in capture if decoder.accepts(d.payload)), None)
    if capture.flow is None:
        raise _without_packets(capture, driver.maker, f"give the {driver.identified_by} of the sensor that sent them")
    if driver.described_at:
        everything = PcapFile(path)
        any(d.source == capture.flow[0] and decoder.describe(d.payload) for d in everything)
    _, first = next(_decoded(capture, decoder), (0.0, None))
    if first is None:
        _refuse_cut(capture)
        refused = decoder.reception.refused
        why, _, remedy = max(refused, key=refused.__getitem__, default="").partition("; ")
        cause = f"no whole sweep ({driver.maker})" + (f", packets are refused: {why}" if why else "")
        raise MisuseError(path, cause, remedy or "record at least two turns of the sensor")
    info = decoder.info(path.stem, driver.maker)
    others = _notes_of_others(PcapFile(path), capture.flow)
    period_s = round(first.turn_s, 3) or info.period_s
    return PacketStream(replace(info, period_s=period_s, notes=(*info.notes, *others)), capture, decoder)


def _asked(capture: PcapFile, options: Mapping[str, str]) -> tuple[str, int] | None:
    """Source and port of the sensor that `host` and `port` choose; None without them.

    Raises:
        MisuseError: no packet is of it.
    """
    host = options.get("host")
    port = options.get("port")
    if host is None and port is None:
        return None
    flows = Counter((d.source, d.port) for d in capture)
    chosen = [flow for flow in flows if host in (None, flow[0]) and port in (None, str(flow[1]))]
    sensors = [flow for flow in chosen if _sends_points(capture, flow)]
    if not chosen:
        there = ", ".join(f"host={source} port={number}" for source, number in flows) or "none"
        raise MisuseError(
            capture.path, f"no packets of host={host or 'any'} port={port or 'any'}", f"there are {there}"
        )
    return (sensors or chosen)[0]


def _sends_points(capture: PcapFile, flow: tuple[str, int]) -> bool:
    """Whether the first packets of a flow are those of a known sensor."""
    capture.flow = flow
    first = [d.payload for d in islice(capture, PEEKED)]
    capture.flow = None
    return any(driver.recognises(payload) for driver in all_drivers() for payload in first)


def _notes_of_others(capture: PcapFile, flow: tuple[str, int]) -> list[str]:
    """A line for each other sensor among the first packets of a capture."""
    drivers = all_drivers()
    makers: dict[tuple[str, int], str] = {}
    for datagram in islice(capture, SEARCHED):
        other = (datagram.source, datagram.port)
        if other != flow and other not in makers:
            driver = next((driver for driver in drivers if driver.recognises(datagram.payload)), None)
            if driver is not None:
                makers[other] = driver.maker
    read = f"the packets of {flow[0]}, port {flow[1]}, are read"
    return [
        f"{read}; another {maker} at {source}, port {port}: --capture host={source} --capture port={port} reads it"
        for (source, port), maker in makers.items()
    ]


def _driver_of(capture: PcapFile, options: Mapping[str, str]) -> Driver:
    """Driver that an option or a file beside the capture identifies, else that of the first packet of a sensor.

    Raises:
        MisuseError: there is no packet of a sensor.
    """
    drivers = all_drivers()
    for given in (options, {option for driver in drivers for option in driver.options_beside(capture.path)}):
        for driver in drivers:
            if driver.identified_by in given:
                return driver
    foreign = ""
    for datagram in capture:
        for driver in drivers:
            if driver.recognises(datagram.payload):
                return driver
        foreign = foreign or FOREIGN.get(datagram.payload[:4], "")
    if foreign:
        remedy = "record the point clouds of its driver in ROS 2 and give that recording, or modt run ros2:///TOPIC"
        raise MisuseError(capture.path, f"packets of a {foreign}, which are not decoded", remedy)
    remedies = [
        f"for an {driver.maker}, save its {option} as {capture.path.with_suffix(suffix)} or give {option}=FILE"
        for driver in drivers
        for option, suffix in driver.beside.items()
        if option == driver.identified_by
    ]
    raise _without_packets(capture, " or ".join(driver.maker for driver in drivers), "; ".join(remedies))


def _without_packets(capture: PcapFile, maker: str, remedy: str) -> MisuseError:
    """Error of a capture without packets of a maker, with what it holds instead."""
    seen = Counter(f"{len(d.payload)} bytes to port {d.port}" for d in capture)
    _refuse_cut(capture)
    there = f"{seen.total()} UDP datagrams, mostly of {seen.most_common(1)[0][0]}" if seen else "no UDP datagram"
    return MisuseError(capture.path, f"no packets of a {maker} ({there})", remedy)


def _refuse_cut(capture: PcapFile) -> None:
    """Refuse a capture whose datagrams were cut short, once they were read.

    Raises:
        MisuseError: some were.
    """
    if capture.cut:
        cause = f"the ends of {capture.cut} UDP datagrams were not captured (a snapshot length that is too short)"
        raise MisuseError(capture.path, cause, "record whole packets: tcpdump -s 0 -w FILE udp")


def _decoded(capture: PcapFile, decoder: PacketDecoder) -> Iterator[tuple[float, Sweep]]:
    """Time of the completing packet [s] and sweep, in the order of the capture."""
    arrived_s = 0.0
    for datagram in capture:
        decoder.reception.messages += 1
        arrived_s = datagram.stamp_s
        for sweep in decoder.decode(arrived_s, datagram.payload):
            yield arrived_s, sweep
    for sweep in decoder.finish():
        yield arrived_s, sweep
