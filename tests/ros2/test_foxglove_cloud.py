"""Point clouds in Foxglove's own schema, encoded by other implementations."""

import base64
import json

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.ros2.cdr import MessageError
from modt.ros2.foxglove_cloud import READERS
from modt.sources.recognise import open_stream
from tests.sources.bags import BEGAN_S

POINTS = np.random.default_rng(0).uniform(0, 1, (30, 4)).astype("<f4")
NAMES = ("x", "y", "z", "intensity")


def in_json(stamp_s):
    return json.dumps(
        {
            "timestamp": {"sec": int(stamp_s), "nsec": round(stamp_s % 1 * 1e9)},
            "frame_id": "lidar",
            "point_stride": 16,
            "fields": [{"name": name, "offset": 4 * k, "type": 7} for k, name in enumerate(NAMES)],
            "data": base64.b64encode(POINTS.tobytes()).decode(),
        }
    ).encode()


def in_protobuf(stamp_s):
    messages = pytest.importorskip("foxglove.messages", reason="needs the extra [foxglove]")
    kind = messages.PackedElementFieldNumericType.Float32
    return messages.PointCloud(
        timestamp=messages.Timestamp(int(stamp_s), round(stamp_s % 1 * 1e9)),
        frame_id="lidar",
        point_stride=16,
        fields=[messages.PackedElementField(name=name, offset=4 * k, type=kind) for k, name in enumerate(NAMES)],
        data=POINTS.tobytes(),
    ).encode()


ENCODERS = {"json": in_json, "protobuf": in_protobuf}


def recorded(path, encoding, kind="foxglove.PointCloud"):
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/lidar", encoding, writer.register_schema(kind, "", b""))
        for k in range(3):
            data = ENCODERS[encoding](BEGAN_S + 0.1 * k) if encoding in ENCODERS else bytes(40)
            writer.add_message(channel, round((BEGAN_S + 0.1 * k) * 1e9), data, 0)
        writer.finish()
    return path


@pytest.mark.parametrize("encoding", ENCODERS)
def test_a_recording_in_foxgloves_schema_is_read(tmp_path, encoding):
    frames = list(open_stream(recorded(tmp_path / "a.mcap", encoding)))
    assert [frame.stamp_s for frame in frames] == pytest.approx([0.0, 0.1, 0.2], abs=1e-6)
    np.testing.assert_array_equal(frames[0].points, POINTS)


@pytest.mark.parametrize(("encoding", "kind"), [("ros1", "sensor_msgs/PointCloud2"), ("cbor", "acme.Cloud")])
def test_what_is_there_instead_is_named_with_its_encoding(tmp_path, encoding, kind):
    with pytest.raises(MisuseError, match=f"it holds {kind} in {encoding}"):
        open_stream(recorded(tmp_path / "a.mcap", encoding, kind))


@pytest.mark.parametrize("encoding", ENCODERS)
def test_a_broken_message_is_refused(encoding):
    whole = ENCODERS[encoding](BEGAN_S)
    for at in range(0, len(whole), 7):
        with pytest.raises(MessageError):
            READERS[encoding](b"\xff" + whole[:at])
