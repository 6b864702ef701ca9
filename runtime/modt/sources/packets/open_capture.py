"""A PCAP file as a stream."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from modt.errors import MisuseError
from modt.sources.live.sweep_reader import Reception, Sweep
from modt.sources.packets.capture import Capture
from modt.sources.packets.packet_decoder import PacketDecoder, decoder_for
from modt.sources.packets.packet_stream import PacketStream
from modt.sources.stream import StreamInfo


def open_capture(path: Path, options: Mapping[str, str]) -> PacketStream:
    """The stream of the sensor whose packets come first in a PCAP file.

    `options` may have model and calibration of a Velodyne, the calibration of a Hesai, or the file with the metadata
    of an Ouster. The last two are by default the files with the name of the capture and the suffix .csv or .json.

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
    first = _first_sweep(capture, decoder)
    if first is None:
        raise MisuseError(path, f"no whole sweep of a {layout}", "record at least two turns of the sensor")
    info = StreamInfo(
        name=path.stem,
        layout=f"{layout} packets",
        sequence=0,
        n_frames=None,
        period_s=round(first.turn_s, 3) or decoder.period_s,
        camera=None,
        has_poses=False,
        profile=decoder.profile,
        elevations_deg=decoder.elevations_deg,
    )
    return PacketStream(info, capture, decoder)


def _beside(path: Path, **suffixes: str) -> dict[str, str]:
    """Options that are files with the name of the capture, where these are."""
    files = {option: path.with_suffix(suffix) for option, suffix in suffixes.items()}
    return {option: str(file) for option, file in files.items() if file.is_file()}


def _maker(capture: Capture, options: Mapping[str, str]) -> str:
    """Who made the sensor whose packets come first."""
    from modt.sources.packets import hesai, livox, velodyne_models

    if "metadata" in options:
        return "ouster"
    for datagram in capture if "model" not in options else ():
        if velodyne_models.signature_of(datagram.payload):
            break
        if hesai.model_of(datagram.payload):
            return "hesai"
        if livox.is_packet(datagram.payload):
            return "livox"
    return "velodyne"


def _first_sweep(capture: Capture, decoder: PacketDecoder) -> Sweep | None:
    reception = Reception()
    for datagram in capture:
        for sweep in decoder.decode(datagram.stamp_s, datagram.payload, reception):
            return sweep
    return next(iter(decoder.finish(reception)), None)
