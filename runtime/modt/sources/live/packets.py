"""Live sensors that send packets: Velodyne and Ouster."""

from __future__ import annotations

from pathlib import Path

from modt.address import Address
from modt.errors import MisuseError
from modt.sources.live.live_stream import LiveStream
from modt.sources.live.packet_reader import PacketReader, address_of, bound_socket
from modt.sources.packets.packet_decoder import PacketDecoder
from modt.sources.stream import StreamInfo

VELODYNE_PORT, OUSTER_PORT = 2368, 7502
VELODYNE_PERIOD_S = 0.1
"""As delivered, at 600 turns a minute; a sweep tells its own time."""


def open_velodyne(address: Address, cores: frozenset[int] | None) -> LiveStream:
    """A Velodyne at velodyne://[HOST][:PORT][?model=MODEL&calibration=FILE&group=ADDRESS].

    HOST is the sensor, whose packets alone are used; PORT of this machine, or of a multicast group, is where it sends
    them.
    """
    from modt.sources.packets.velodyne import VelodyneDecoder
    from modt.sources.packets.velodyne_models import model_named

    model = address.option("model")
    calibration = address.option("calibration")
    decoder = VelodyneDecoder(
        address.text, model_named(model) if model else None, Path(calibration) if calibration else None
    )
    return _stream(address, decoder, address.port or VELODYNE_PORT, VELODYNE_PERIOD_S, cores)


def open_ouster(address: Address, cores: frozenset[int] | None) -> LiveStream:
    """An Ouster at ouster://[HOST][:PORT]?metadata=FILE[&group=ADDRESS]; HOST, PORT and group as of a Velodyne.

    Raises:
        MisuseError: no metadata.
    """
    from modt.sources.packets.ouster import OusterDecoder

    metadata = address.option("metadata")
    if not metadata:
        remedy = "add ?metadata=FILE, what the sensor says at /api/v1/sensor/metadata"
        raise MisuseError(address.text, "its packets cannot be read without the sensor's metadata", remedy)
    decoder = OusterDecoder(address.text, Path(metadata))
    return _stream(address, decoder, address.port or OUSTER_PORT, decoder.period_s, cores)


def _stream(
    address: Address, decoder: PacketDecoder, port: int, period_s: float, cores: frozenset[int] | None
) -> LiveStream:
    source = address_of(address.text, address.host)
    reader = PacketReader(bound_socket(address.text, port, address.option("group")), decoder, source)
    info = StreamInfo(
        name=address.text,
        layout=f"{address.scheme} packets",
        sequence=0,
        n_frames=None,
        period_s=period_s,
        camera=None,
        has_poses=False,
        profile=decoder.profile,
        elevations_deg=decoder.elevations_deg,
    )
    return LiveStream(info, reader, cores=cores)
