"""The messages that a client of the Foxglove server receives."""

import base64
import json
import os
import re
import select
import socket
import struct

import psutil
import pytest

from modt.errors import MisuseError
from modt.schemes import open_sink
from modt.sinks.foxglove_sinks import REFUSED, FoxgloveServer
from modt.sinks.topics import TopicOptions, topics
from tests.results import with_kinds
from tests.sinks.test_mcap_file import LEDGER, WINDOW, moving

OPTIONS = TopicOptions(world_frame_id="world", points=True, obstacles=True)
SHOWN = topics(OPTIONS)
"""Topics of a frame; those of energy and CPU time are beside them."""
FRAME = with_kinds(moving(3))


class Client:
    """A WebSocket client that knows as much of the protocol as is needed."""

    def __init__(self, port, protocol="foxglove.sdk.v1"):
        self.socket = socket.create_connection(("127.0.0.1", port), 10.0)
        self.stream = self.socket.makefile("rb")
        key = base64.b64encode(os.urandom(16)).decode()
        lines = ["GET / HTTP/1.1", "Host: here", "Upgrade: websocket", "Connection: Upgrade"]
        lines += [f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13"]
        self.socket.sendall("\r\n".join([*lines, f"Sec-WebSocket-Protocol: {protocol}", "", ""]).encode())
        self.accepted = b"101" in self.stream.readline()
        while self.stream.readline() != b"\r\n":
            pass

    def receive(self):
        """Content of the next message."""
        _, size = self.stream.read(2)
        form = {126: ">H", 127: ">Q"}.get(size)
        if form:
            (size,) = struct.unpack(form, self.stream.read(struct.calcsize(form)))
        return self.stream.read(size)

    def channels(self):
        """The channels that the server advertises, by their ids."""
        while (message := json.loads(self.receive()))["op"] != "advertise":
            pass
        return {channel["id"]: channel for channel in message["channels"]}

    def subscribe(self, ids):
        """Ask for channels; under the newer and the older form of the protocol."""
        numbered = [{"id": id_, "channelId": id_} for id_ in ids]
        text = json.dumps({"op": "subscribe", "channelIds": list(ids), "subscriptions": numbered}).encode()
        self.socket.sendall(b"\x81\xfe" + struct.pack(">H", len(text)) + bytes(4) + text)

    def message(self):
        """Id of the channel and content of the next binary message of a channel."""
        data = self.receive()
        assert data[0] == 1
        return struct.unpack("<I", data[1:5])[0], data[13:]

    def close(self):
        self.stream.close()
        self.socket.close()


def by_schema(channel, data):
    """Content of a message, by the definition that its channel advertises and another implementation's decoder."""
    typesys = pytest.importorskip("rosbags.typesys")
    name = channel["schemaName"]
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(typesys.get_types_from_msg(channel["schema"], name))
    return store.deserialize_cdr(data, name)


@pytest.fixture
def server():
    made = FoxgloveServer("127.0.0.1", 0, OPTIONS)
    yield made
    made.close()


def test_a_client_sees_objects_points_and_energy(server):
    client = Client(server.port)
    channels = client.channels()
    wanted = {topic.name for topic in SHOWN} | {"/modt/energy/watts", "/modt/cpu_ms/tracking"}
    assert {channel["topic"] for channel in channels.values()} >= wanted
    assert {(channel["encoding"], channel["schemaEncoding"]) for channel in channels.values()} == {("cdr", "ros2msg")}
    client.subscribe(channels)
    seen = {}
    for _ in range(1000):  # the subscription takes its time
        server.write(FRAME)
        server.ledger(WINDOW)
        server.ledger(LEDGER)
        while select.select([client.socket], [], [], 0.01)[0] and not seen.keys() >= wanted:
            id_, data = client.message()
            seen[channels[id_]["topic"]] = data
        if seen.keys() >= wanted:
            break
    client.close()
    for topic in SHOWN:
        assert seen[topic.name] == topic.encode(FRAME)
    decoded = {c["topic"]: by_schema(c, seen[c["topic"]]) for c in channels.values() if c["topic"] in wanted}
    assert [found.id for found in decoded["/modt/detections"].detections] == ["11", "12"]
    assert decoded["/modt/points"].width == len(FRAME.frame.points)
    assert decoded["/modt/obstacles"].width == len(FRAME.obstacles()) > 0
    assert decoded["/modt/energy/watts"].data == 0.5
    assert seen["/modt/energy/watts"][4:] == struct.pack("<d", 0.5)
    assert seen["/modt/cpu_ms/tracking"][4:] == struct.pack("<d", 2.0)


def test_the_log_says_where_it_is_and_which_protocol_is_refused(caplog):
    background = open_sink("foxglove://:0")
    (line,) = (record.message for record in caplog.records if "Foxglove connects to" in record.message)
    port = int(re.search(r"ws://127.0.0.1:(\d+) ", line)[1])
    assert REFUSED in line
    for protocol, accepted in (("foxglove.sdk.v1", True), (REFUSED, False)):
        client = Client(port, protocol)
        assert client.accepted is accepted
        client.close()
    background.close()


def listening():
    """Hosts and ports at which this process listens."""
    process = psutil.Process()
    opened = getattr(process, "net_connections", None) or process.connections  # the name before psutil 6
    return {tuple(found.laddr) for found in opened("inet") if found.status == "LISTEN"}


def test_only_this_machine_is_served_unless_another_host_is_given(server):
    before = listening()
    background = open_sink("foxglove://:0")
    assert {host for host, _ in listening() - before} == {"127.0.0.1"}
    background.close()
    with pytest.raises(MisuseError, match="cannot be bound"):
        open_sink(f"foxglove://127.0.0.1:{server.port}")
