"""Recordings damaged at random places: what other readers still give is read, and what is not read is counted."""

import random
import sqlite3
from contextlib import closing, suppress

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType

from modt.errors import ModtError
from modt.sources.recognise import open_stream
from tests.ros2 import messages
from tests.sources.bags import BEGAN_S, CLOUD, write_mcap, write_rosbag2

N = 24
POINTS = 300
"""Number of points of the first sweep; each later one has one more."""


def sweep(k):
    stamp_s = BEGAN_S + k / 10
    data = messages.encode(messages.cloud(messages.xyzi(POINTS + k), stamp_s=stamp_s))
    return "/points", CLOUD, stamp_s + 0.03, data


RECORDED = [sweep(k) for k in range(N)]
NUMBER = {message[3]: k for k, message in enumerate(RECORDED)}


def damaged(raw, chance, first=8):
    """The bytes with flipped bits, overwritten, inserted or removed parts, or cut off."""
    raw = bytearray(raw)
    kind = chance.choice(["flip", "flip", "overwrite", "erase", "insert", "remove", "cut"])
    for _ in range(chance.choice([1, 1, 2, 5])):
        at = chance.randrange(first, len(raw))
        size = chance.choice([1, 16, 700, 5000])
        if kind == "flip":
            raw[at] ^= 1 << chance.randrange(8)
        elif kind == "overwrite":
            raw[at : at + size] = chance.randbytes(len(raw[at : at + size]))
        elif kind == "erase":
            raw[at : at + size] = bytes(len(raw[at : at + size]))
        elif kind == "insert":
            raw[at:at] = chance.randbytes(size)
        elif kind == "remove":
            del raw[at : at + size]
    if kind == "cut":
        del raw[chance.randrange(len(raw) // 10, len(raw)) :]
    return bytes(raw)


def by_mcap(path):
    """Numbers of the sweeps that the library finds from the begin on, passing over bad chunks, and by the index."""
    found = set()
    channels = set()
    with suppress(Exception), path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True, record_size_limit=2**28).records:
            within = [record]
            if isinstance(record, Chunk):
                within = []
                with suppress(Exception):
                    within = breakup_chunk(record, validate_crc=True)
            channels |= {one.id for one in within if isinstance(one, Channel)}
            found |= {NUMBER.get(m.data) for m in within if isinstance(m, Message) and m.channel_id in channels}
    with suppress(Exception), path.open("rb") as file:
        found |= {NUMBER.get(message.data) for _, _, message in make_reader(file).iter_messages()}
    return found - {None}


def by_sqlite(path):
    """Numbers of the sweeps that SQLite reads row by row."""
    found = set()
    with suppress(sqlite3.Error), closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
        found |= {NUMBER.get(data) for (data,) in database.execute("SELECT data FROM messages NOT INDEXED")}
    return found - {None}


def check(path, expected):
    """Read a damaged recording; all sweeps are read, or some are and the loss is counted, or an error names it."""
    try:
        stream = open_stream(path)
        frames = list(stream)
    except ModtError:
        assert not expected
        return
    whole = {len(f.points) - POINTS for f in frames if _is_whole(f.points)}
    assert whole >= expected, stream.faults.left_out
    if len(frames) < N:
        assert stream.faults.left_out
    lost = sum(n for why, n in stream.faults.left_out.items() if "damaged in the" in why or "missing" in why)
    assert len(frames) + lost <= N


def _is_whole(points):
    k = len(points) - POINTS
    return 0 <= k < N and np.array_equal(points, messages.xyzi(POINTS + k).view(np.float32).reshape(-1, 4))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("form", ["zstd", "plain", "bare", "unclosed"])
def test_damaged_mcap(tmp_path, form, seed):
    options = {"chunk_size": 12_000, "compression": CompressionType.NONE if form == "plain" else CompressionType.ZSTD}
    path = write_mcap(tmp_path / "drive", RECORDED, use_chunking=form != "bare", **options)
    raw = path.read_bytes()
    chance = random.Random(f"{form} {seed}")
    path.write_bytes(damaged(raw[: len(raw) * 9 // 10] if form == "unclosed" else raw, chance))
    check(path, by_mcap(path))


@pytest.mark.parametrize("seed", range(40))
def test_damaged_database(tmp_path, seed):
    (path,) = write_rosbag2(tmp_path / "drive", RECORDED).glob("*.db3")
    copy = tmp_path / "damaged.db3"
    copy.write_bytes(damaged(path.read_bytes(), random.Random(seed), first=16))
    check(copy, by_sqlite(copy))


@pytest.mark.parametrize("seed", range(15))
def test_damaged_and_lost_files_of_a_split_recording(tmp_path, seed):
    chance = random.Random(seed)
    paths = [write_mcap(tmp_path / f"drive_{k}", RECORDED[6 * k : 6 * k + 6], chunk_size=9000) for k in range(4)]
    files = "".join(f"  - {path.name}\n" for path in paths)
    (tmp_path / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  relative_file_paths:\n{files}  topics_with_message_count:\n"
        f"  - topic_metadata: {{name: /points}}\n    message_count: {N}\n"
    )
    for path in chance.sample(paths, chance.choice([1, 2])):
        if chance.random() < 0.4:
            path.unlink()
        else:
            path.write_bytes(damaged(path.read_bytes(), chance, first=0))
    check(tmp_path, {k for path in paths if path.exists() for k in by_mcap(path)})
