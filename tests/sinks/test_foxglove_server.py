"""What a client of the Foxglove server receives."""

import base64
import json
import os
import select
import socket
import struct
from pathlib import Path

import pytest

pytest.importorskip("foxglove")

from modt.errors import MisuseError
from modt.schemes import open_sink
from modt.sinks import foxglove_server
from modt.sinks.foxglove_server import FoxgloveServer
from tests.sinks.foxglove_messages import decoded
from tests.sinks.test_mcap_file import LEDGER, WINDOW, moving

TOPICS = {"/tf", "/tracks", "/points", "/energy", "/stages"}


class Client:
    """A WebSocket client that knows as much of the protocol as is needed."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), 10.0)
        self.stream = self.socket.makefile("rb")
        key = base64.b64encode(os.urandom(16)).decode()
        lines = ["GET / HTTP/1.1", "Host: here", "Upgrade: websocket", "Connection: Upgrade"]
        lines += [f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13"]
        self.socket.sendall("\r\n".join([*lines, "Sec-WebSocket-Protocol: foxglove.sdk.v1", "", ""]).encode())
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


@pytest.fixture
def server():
    made = FoxgloveServer("127.0.0.1", 0, points=True)
    yield made
    made.close()


@pytest.fixture
def client(server):
    made = Client(server.port)
    yield made
    made.close()


def test_a_client_sees_objects_points_and_energy(server, client):
    channels = client.channels()
    assert {channel["topic"] for channel in channels.values()} == TOPICS
    client.subscribe(channels)
    seen = {}
    for k in range(1000):  # the subscription takes its time
        server.write(moving(k))
        server.ledger(WINDOW)
        server.ledger(LEDGER)
        while select.select([client.socket], [], [], 0.01)[0] and seen.keys() != TOPICS:
            id_, data = client.message()
            channel = channels[id_]
            schema = channel["schema"].encode()
            if channel["schemaEncoding"] == "protobuf":
                schema = base64.b64decode(schema)
            seen[channel["topic"]] = decoded(channel["encoding"], channel["schemaName"], schema, data)
        if seen.keys() == TOPICS:
            break
    assert [entity["id"] for entity in seen["/tracks"]["entities"]] == ["11", "12"]
    assert seen["/tf"]["translation"] == {"x": 3.0, "y": -1.0, "z": 0.5}
    assert base64.b64decode(seen["/points"]["data"]) == moving(0).frame.points.tobytes()
    assert seen["/energy"]["mJ_per_frame"] == 50.0
    assert seen["/stages"]["tracking_ms"] == 2.0


def test_without_points_there_is_no_such_topic():
    server = FoxgloveServer("127.0.0.1", 0, points=False)
    client = Client(server.port)
    assert {channel["topic"] for channel in client.channels().values()} == TOPICS - {"/points"}
    client.close()
    server.close()


def test_only_this_machine_is_served_unless_another_host_is_given(monkeypatch):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    monkeypatch.setattr(foxglove_server, "PORT", port)
    background = open_sink("foxglove://")
    listening = [line.split()[1:4] for line in Path("/proc/self/net/tcp").read_text().splitlines()[1:]]
    hosts = {
        local.partition(":")[0] for local, _, state in listening if state == "0A" and local.endswith(f"{port:04X}")
    }
    background.close()
    assert hosts == {"0100007F"}


def test_a_port_that_is_taken_is_misuse(server):
    with pytest.raises(MisuseError, match="cannot be bound"):
        open_sink(f"foxglove://127.0.0.1:{server.port}")
