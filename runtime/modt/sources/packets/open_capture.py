"""A PCAP file as a stream."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from modt.errors import MisuseError
from modt.sources.live.sweep_reader import Reception, Sweep
from modt.sources.packets.capture import Capture
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.packets.packet_stream import PacketStream
from modt.sources.scan_stream import PERIOD_S
from modt.sources.stream import StreamInfo


def open_capture(path: Path, options: Mapping[str, str]) -> PacketStream:
    """The stream of the sensor whose packets come first in a PCAP file.

    `options` may have model and calibration of a Velodyne, the calibration of a Hesai, or the file with the metadata
    of an Ouster. The last two are by default the files with the name of the capture and the suffix .csv or .json.

    Raises:
        MisuseError: no PCAP file, no packets of a sensor, no whole sweep; an invalid option, a missing extra.
    """
    capture = Capture(path)
    decoder, layout = _decoder(capture, options)
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
        period_s=round(first.turn_s, 3) or PERIOD_S,
        camera=None,
        has_poses=False,
        profile=decoder.profile,
        elevations_deg=decoder.elevations_deg,
    )
    return PacketStream(info, capture, decoder)


def _decoder(capture: Capture, options: Mapping[str, str]) -> tuple[PacketDecoder, str]:
    """The decoder of the first packets that are any sensor's, and what the sensor is."""
    from modt.sources.packets import hesai, livox, velodyne_models

    path = capture.path
    beside, angles = path.with_suffix(".json"), path.with_suffix(".csv")
    metadata = options.get("metadata", str(beside) if beside.is_file() and "model" not in options else "")
    if metadata:
        from modt.sources.packets.ouster import OusterDecoder

        return OusterDecoder(path.stem, Path(metadata)), "Ouster"
    calibration = Path(options["calibration"]) if "calibration" in options else None
    for datagram in capture if "model" not in options else ():
        if velodyne_models.signature_of(datagram.payload):
            break
        if livox.is_packet(datagram.payload):
            return livox.LivoxDecoder(path.stem), "Livox"
        if hesai.model_of(datagram.payload):
            calibration = calibration or (angles if angles.is_file() else None)
            return hesai.HesaiDecoder(path.stem, hesai.read_angles(calibration) if calibration else None), "Hesai"
    from modt.sources.packets.velodyne import VelodyneDecoder

    model = velodyne_models.model_named(options["model"]) if "model" in options else None
    return VelodyneDecoder(path.stem, model, calibration), "Velodyne"


def _first_sweep(capture: Capture, decoder: PacketDecoder) -> Sweep | None:
    reception = Reception()
    for datagram in capture:
        for sweep in decoder.decode(datagram.stamp_s, datagram.payload, reception):
            return sweep
    return next(iter(decoder.finish(reception)), None)
