"""Recordings of 64 KiB, made to take time and memory, are read or refused within what SECURITY.md promises."""

import sqlite3
import struct
import tracemalloc
from contextlib import closing, suppress
from functools import cache

import lz4.frame
import pytest
import zstandard

from modt.errors import ModtError
from modt.sources.recognise import open_stream
from tests.fuzz.execution import execute, limits
from tests.ros2 import messages

MOST_BYTES = 131_072
CLOUD = "sensor_msgs/msg/PointCloud2"


def read(path):
    """Every frame; a refusal for want of memory is none."""
    try:
        assert all(len(frame.points) < 2**21 for frame in open_stream(path))
    except ModtError as error:
        if "MemoryError" in str(error) or "\n" in str(error):
            raise AssertionError(str(error)) from None
        raise


def assert_bounded(path):
    if path.stat().st_size <= MOST_BYTES:
        with limits():
            finding = execute(lambda _: read(path), b"", (ModtError,))
        assert finding is None, f"{finding.error} ({finding.place})"


@cache
def odd_messages():
    """A sweep, bytes that stand for many (with their size, without it, and in several layers), and none at all."""
    sweep = messages.encode(messages.cloud(messages.xyzi(20), stamp_s=1.5))
    sized = zstandard.compress(bytes(2**29))
    unsized = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(2**26))
    bombs = [sized, unsized, zstandard.compress(sized), zstandard.compress(sweep), b"\x28\xb5\x2f\xfd" + bytes(20)]
    return [sweep, *bombs, b"", bytes(3000)]


TOPICS = "CREATE TABLE topics(id INTEGER{key}, name, type, serialization_format, offered_qos_profiles)"
MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp{stamp}, data{data})"
PLAIN_TOPICS = TOPICS.format(key="")
PLAIN_MESSAGES = MESSAGES.format(stamp="", data="")
ENDLESS = "WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r) SELECT {columns} FROM r"
VIEWED = "CREATE VIEW messages AS " + ENDLESS
NO_TABLES = [
    [PLAIN_TOPICS, VIEWED.format(columns="n id, 1 topic_id, n timestamp, n data")],
    [PLAIN_TOPICS, VIEWED.format(columns="n id, 1 topic_id, n timestamp, zeroblob(1000000000) data")],
    [
        PLAIN_MESSAGES,
        "CREATE VIEW topics AS "
        + ENDLESS.format(columns=f"n id, 'a' || n name, '{CLOUD}' type, 'cdr' serialization_format"),
    ],
    [
        PLAIN_TOPICS,
        PLAIN_MESSAGES,
        "CREATE TRIGGER t AFTER INSERT ON topics BEGIN INSERT INTO topics VALUES (1, 2, 3, 4, 5); END",
    ],
]
SCHEMAS = [
    [PLAIN_TOPICS, PLAIN_MESSAGES],
    [TOPICS.format(key=" PRIMARY KEY"), PLAIN_MESSAGES],
    [PLAIN_TOPICS, MESSAGES.format(stamp="", data=" AS (zeroblob(1000000000))")],
    [PLAIN_TOPICS, MESSAGES.format(stamp="", data=" AS (randomblob(60000))")],
    [PLAIN_TOPICS, MESSAGES.format(stamp=" AS (length(hex(hex(zeroblob(500000000)))))", data="")],
    [PLAIN_TOPICS, "CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data)"],
    [PLAIN_TOPICS],
    [],
]
NAMES = ["/points", "/points", None, b"\xff", 7, "", "x" * 500]
KINDS = [CLOUD, CLOUD, CLOUD, None, 3, "nav_msgs/msg/Odometry"]
STAMPS = [1_500_000_000, 1_600_000_000, None, "late", 1.5, -(2**63), 2**63 - 1]


def database(path, schema, n):
    """A .db3 file with n topics and messages of odd values."""
    data = [*odd_messages(), None, "text", 5]
    with closing(sqlite3.connect(path)) as file:
        for statement in schema:
            with suppress(sqlite3.OperationalError):  # no such module here
                file.execute(statement)
        for k in range(n):
            topic = (k % 5, NAMES[k % len(NAMES)], KINDS[k % len(KINDS)], "cdr", "")
            message = ((0, 1, 1, None)[k % 4], STAMPS[k % len(STAMPS)], data[k % len(data)] if k < 20 else b"")
            with suppress(sqlite3.Error):
                file.execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", topic)
            with suppress(sqlite3.Error):
                file.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", message)
        file.commit()
    return path


@pytest.mark.parametrize("n", [1, 30, 600])
@pytest.mark.parametrize("schema", [*SCHEMAS, *NO_TABLES])
def test_a_hostile_database_is_read_or_refused(schema, n, tmp_path):
    assert_bounded(database(tmp_path / "a.db3", schema, n))


@pytest.mark.parametrize("schema", NO_TABLES)
def test_views_and_triggers_are_refused_by_their_name(schema, tmp_path):
    path = database(tmp_path / "a.db3", schema, 3)
    with limits(), pytest.raises(ModtError, match=r"which is no table"):
        open_stream(path)


MAGIC = b"\x89MCAP0\r\n"
HEADER = 1
FOOTER = 2
SCHEMA = 3
CHANNEL = 4
MESSAGE = 5
CHUNK = 6
INDEX = 8
STATISTICS = 11
END = 15
PACKERS = {b"zstd": zstandard.compress, b"lz4": lz4.frame.compress}


def text(value):
    return struct.pack("<I", len(value)) + value


def record(kind, body, length=None):
    return struct.pack("<BQ", kind, len(body) if length is None else length) + body


def message(at_ns, data, channel=1):
    return record(MESSAGE, struct.pack("<HIQQ", channel, 0, at_ns, at_ns) + data)


def chunk(records, packer, size=None):
    """A chunk that is said to unpack to a size."""
    packed = PACKERS[packer](records)
    body = struct.pack("<QQQI", 0, 2**40, len(records) if size is None else size, 0) + text(packer)
    return record(CHUNK, body + struct.pack("<Q", len(packed)) + packed)


CONTENTS = {
    "odd messages": lambda: b"".join(message(k * 10**8, each) for k, each in enumerate(odd_messages())),
    "small messages": lambda: message(0, b"") * 600_000,
    "a long message": lambda: message(0, bytes(2**26)),
    "no records": lambda: bytes(2**26),
    "a record beyond the end": lambda: record(MESSAGE, b"", 2**62),
    "a channel that is not there": lambda: message(0, odd_messages()[0], 7),
}


KNOWN = record(SCHEMA, struct.pack("<H", 1) + text(CLOUD.encode()) + text(b"ros2msg") + text(b""))
KNOWN += record(CHANNEL, struct.pack("<HH", 1, 1) + text(b"/points") + text(b"cdr") + text(b""))
BEGIN = MAGIC + record(HEADER, text(b"ros2") + text(b"")) + KNOWN


def indexed(part, place, entries, count):
    """A closed file whose index says that a chunk lies at a place, as often as there are entries."""
    counts = struct.pack("<IHQ", 10, 1, count)
    statistics = record(STATISTICS, struct.pack("<QHIIIIQQ", 3, 1, 1, 0, 0, 1, 0, 2**40) + counts)
    sizes = struct.pack("<IQ", 0, 0) + text(b"zstd") + struct.pack("<QQ", len(part), len(part))
    entry = record(INDEX, struct.pack("<QQQQ", 0, 2**40, place, len(part)) + sizes)
    whole = BEGIN + part + record(END, bytes(4))
    footer = record(FOOTER, struct.pack("<QQI", len(whole), 0, 0))
    return whole + KNOWN + statistics + entry * entries + footer + MAGIC


@pytest.mark.slow
@pytest.mark.parametrize("packer", PACKERS)
@pytest.mark.parametrize("content", CONTENTS)
def test_a_hostile_mcap_file_is_read_or_refused(content, packer, tmp_path):
    inner = CONTENTS[content]()
    path = tmp_path / "a.mcap"
    whole = chunk(inner, packer)
    files = [BEGIN + chunk(inner, packer, size) * times for size in (None, 0, 2**31, 2**64 - 1) for times in (1, 3)]
    files += [BEGIN + chunk(whole, packer), indexed(whole, len(BEGIN), 500, 2**63 - 1)]
    files += [indexed(whole, place, 1, 600_000) for place in (len(BEGIN), len(BEGIN) + 3, 2**62)]
    for raw in files:
        path.write_bytes(raw)
        assert_bounded(path)


@pytest.mark.parametrize("name", ["a.db3.zstd", "a.mcap.zstd"])
@pytest.mark.parametrize("begin", [b"", b"SQLite format 3\0", MAGIC])
def test_a_file_that_unpacks_to_too_much_is_refused_with_the_limit(name, begin, tmp_path):
    (tmp_path / name).write_bytes(zstandard.compress(begin + bytes(2**27)))
    with limits(), pytest.raises(ModtError, match=r"unpacks to more than 64 times its size and 16 MiB"):
        open_stream(tmp_path / name)


def test_an_index_that_begins_at_a_bomb_unpacks_nothing(tmp_path):
    footer = record(FOOTER, struct.pack("<QQI", 8, 0, 0))
    path = tmp_path / "a.mcap"
    path.write_bytes(MAGIC + chunk(bytes(2**28), b"zstd") + footer + MAGIC)
    tracemalloc.start()
    try:
        with pytest.raises(ModtError, match="unpacks to more than 64 times its size and 16 MiB"):
            open_stream(path)
        assert tracemalloc.get_traced_memory()[1] < 2**26
    finally:
        tracemalloc.stop()
