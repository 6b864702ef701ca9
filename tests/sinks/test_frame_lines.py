"""Lines of frames to files, pipes and datagrams."""

import json
import os
import socket

import pytest

from modt.schemes import open_sink
from modt.sinks.background import Background
from modt.sinks.frame_lines import MAX_BYTES, Descriptor
from modt.sinks.tracks import frame_line, frame_parts
from tests.results import TWO, frame_record, result
from tests.sinks.test_background import settled

FRAME, LATER = (result(k, *TWO, lost=(7,)) for k in (3, 4))


@pytest.mark.parametrize("rest", ["", '{"schema":"mo'])
@pytest.mark.parametrize("whole", [[FRAME, FRAME], []])
def test_a_file_is_continued_without_the_broken_line_of_a_killed_run(tmp_path, whole, rest):
    (tmp_path / "lines.jsonl").write_text("".join(map(frame_line, whole)) + rest)
    sink = open_sink(f"file://{tmp_path}/lines.jsonl")
    sink.write(LATER)
    sink.close()
    assert (tmp_path / "lines.jsonl").read_text() == "".join(map(frame_line, [*whole, LATER]))


def test_a_reader_that_leaves_is_counted_and_ends_nothing(caplog):
    reader, writer = os.pipe()
    sink = Background("pipe", Descriptor(writer), 3, encode=frame_line, retry_s=0.0)
    os.dup2(writer, reader)  # the reading end is gone, its number is not
    for k in range(2):
        sink.write(FRAME)
        assert settled(sink, failed=k + 1)
    sink.close()
    for end in (reader, writer):
        os.close(end)
    assert "Broken pipe" in str(sink.health()["state"])
    assert len(caplog.records) == 1


def many(n):
    return result(4, [1] * n, {k: k for k in range(n)}, lost=(n,), n_points=n)


@pytest.mark.parametrize("kind", ["udp", "unix"])
def test_a_frame_is_a_datagram_and_a_longer_line_comes_in_parts(kind, tmp_path):
    with socket.socket(socket.AF_INET if kind == "udp" else socket.AF_UNIX, socket.SOCK_DGRAM) as bound:
        bound.settimeout(60.0)
        bound.bind(("127.0.0.1", 0) if kind == "udp" else str(tmp_path / "lines.sock"))
        name = bound.getsockname()
        sink = open_sink(f"unix://{name}" if isinstance(name, str) else "udp://{}:{}".format(*name))

        def received(frame, n):
            sink.write(frame)
            assert sink.health() == {"written": n, "dropped": 0, "failed": 0, "state": "ok"}
            first = bound.recv(1 << 17).decode()
            return [first, *(bound.recv(1 << 17) for _ in range(json.loads(first).get("parts", 1) - 1))]

        parts = [json.loads(datagram) for datagram in received(many(300), 1)]
        assert [part["part"] for part in parts] == list(range(len(parts)))
        whole = {key: value for key, value in parts[0].items() if key not in ("part", "parts")}
        whole["tracks"] = [track for part in parts for track in part["tracks"]]
        assert whole == frame_record(many(300))
        assert received(FRAME, 2) == [frame_line(FRAME)]
        sink.close()


@pytest.mark.parametrize(("n", "max_bytes"), [(0, 10), (1, 10), (300, MAX_BYTES), (300, 2000), (300, 600)])
def test_no_part_is_longer_than_it_may_be_unless_one_track_is(n, max_bytes):
    frame = many(n)
    parts = frame_parts(frame, max_bytes)
    longest = max(len(line) for line in frame_parts(frame, 1))
    assert max(map(len, parts)) <= max(max_bytes, longest)
    ids = [track["id"] for line in parts for track in json.loads(line)["tracks"]]
    assert ids == frame.tracks.id.tolist()


def test_a_receiver_that_is_behind_costs_frames_and_finds_the_newer_ones_later(tmp_path, caplog):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as bound:
        bound.bind(str(tmp_path / "lines.sock"))
        bound.setblocking(False)
        sink = open_sink(f"unix://{tmp_path}/lines.sock")
        for _ in range(2000):
            sink.write(FRAME)
        health = sink.health()
        assert health["dropped"] > 0
        assert health["written"] + health["dropped"] == 2000
        for _ in range(health["written"]):
            bound.recv(1 << 17)
        last = result(9, [5], {0: 1})
        sink.write(last)
        assert bound.recv(1 << 17).decode() == frame_line(last)
        sink.close()
    assert len(caplog.records) == 1
    assert "behind" in caplog.text


def test_a_receiver_that_comes_leaves_and_comes_back(tmp_path, caplog):
    path = tmp_path / "lines.sock"
    sink = open_sink(f"unix://{path}")
    for there in (False, True, False, False, True):
        if there:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as bound:
                bound.bind(str(path))
                bound.settimeout(60.0)
                sink.write(FRAME)
                assert bound.recv(1 << 17).decode() == frame_line(FRAME)
            assert sink.health()["state"] == "ok"
        else:
            sink.write(FRAME)
            path.unlink(missing_ok=True)
    sink.close()
    assert (sink.health()["written"], sink.health()["failed"]) == (2, 3)
    assert len(caplog.records) == 2
