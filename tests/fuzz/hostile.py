"""Small recordings that are made to take time and memory, at random from parts with wrong sizes and contents."""

import random
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing, suppress
from functools import cache
from pathlib import Path
from typing import Any

import zstandard

from tests.ros2 import messages

MOST_BYTES = 65_536
CLOUD = "sensor_msgs/msg/PointCloud2"
ENDLESS = "WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r) SELECT {columns} FROM r"
Chance = random.Random


@cache
def sweep() -> bytes:
    return messages.encode(messages.cloud(messages.xyzi(20), stamp_s=1.5))


@cache
def bombs() -> list[bytes]:
    """Messages of few bytes that stand for many: with their size, without it, and in several layers."""
    sized = zstandard.compress(bytes(2**29))
    unsized = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(2**26))
    return [sized, unsized, zstandard.compress(sized), zstandard.compress(sweep()), b"\x28\xb5\x2f\xfd" + bytes(20)]


TOPICS = "CREATE TABLE topics(id INTEGER{key}, name, type, serialization_format, offered_qos_profiles)"
MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp{stamp}, data{data})"
PLAIN_TOPICS, PLAIN_MESSAGES = TOPICS.format(key=""), MESSAGES.format(stamp="", data="")
VIEWED = "CREATE VIEW messages AS " + ENDLESS
SCHEMAS: list[list[str]] = [
    [PLAIN_TOPICS, PLAIN_MESSAGES],
    [TOPICS.format(key=" PRIMARY KEY"), PLAIN_MESSAGES],
    [PLAIN_TOPICS, VIEWED.format(columns="n id, 1 topic_id, n timestamp, n data")],
    [PLAIN_TOPICS, VIEWED.format(columns="n id, 1 topic_id, n timestamp, zeroblob(1000000000) data")],
    [
        PLAIN_MESSAGES,
        "CREATE VIEW topics AS "
        + ENDLESS.format(columns=f"n id, 'a' || n name, '{CLOUD}' type, 'cdr' serialization_format"),
    ],
    [PLAIN_TOPICS, MESSAGES.format(stamp="", data=" AS (zeroblob(1000000000))")],
    [PLAIN_TOPICS, MESSAGES.format(stamp="", data=" AS (randomblob(60000))")],
    [PLAIN_TOPICS, MESSAGES.format(stamp=" AS (length(hex(hex(zeroblob(500000000)))))", data="")],
    [PLAIN_TOPICS, "CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data)"],
    [
        PLAIN_TOPICS,
        PLAIN_MESSAGES,
        "CREATE TRIGGER t AFTER INSERT ON topics BEGIN INSERT INTO topics VALUES (1, 2, 3, 4, 5); END",
    ],
    [PLAIN_TOPICS],
    [],
]


def database(path: Path, chance: Chance, schema: int | None = None) -> None:
    """A .db3 file."""
    names = ["/points", "/points", None, b"\xff", 7, "", "x" * 5000]
    kinds = [CLOUD, CLOUD, CLOUD, None, 3, "nav_msgs/msg/Odometry"]
    data = [sweep(), sweep(), *bombs(), None, "text", 5, b"", bytes(30_000)]
    stamps = [1_500_000_000, 1_600_000_000, None, "late", 1.5, -(2**63), 2**63 - 1]
    few = chance.choice((3, 3, 600))
    with closing(sqlite3.connect(path)) as file:
        for statement in SCHEMAS[chance.randrange(len(SCHEMAS)) if schema is None else schema]:
            with suppress(sqlite3.OperationalError):  # no such module here
                file.execute(statement)
        for k in range(few):
            row = (chance.choice((k, 1)), chance.choice(names), chance.choice(kinds), "cdr", "")
            with suppress(sqlite3.Error):
                file.execute("INSERT INTO topics VALUES (?, ?, ?, ?, ?)", row)
        for _ in range(few):
            value = b"" if few > 3 and chance.random() < 0.9 else chance.choice(data)
            with suppress(sqlite3.Error):
                row = (chance.choice((0, 1, 1, None)), chance.choice(stamps), value)
                file.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", row)
                file.execute("INSERT INTO messages(topic_id) VALUES (1)")
        file.commit()


MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, STATISTICS, END = 1, 2, 3, 4, 5, 6, 8, 11, 15
LIES = (0, 1, 2**16, 2**31, 2**40, 2**63, 2**64 - 1)


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def record(kind: int, body: bytes, length: int | None = None) -> bytes:
    return struct.pack("<BQ", kind, len(body) if length is None else length) + body


def message(at_ns: int, data: bytes, channel: int = 1) -> bytes:
    return record(MESSAGE, struct.pack("<HIQQ", channel, 0, at_ns, at_ns) + data)


def chunk(chance: Chance, records: bytes, *, honest: bool) -> bytes:
    """A chunk whose sizes and compression may be wrong."""
    import lz4.frame

    packers: dict[bytes, Callable[[bytes], bytes]] = {
        b"zstd": zstandard.compress,
        b"lz4": lz4.frame.compress,
        b"": lambda raw: raw,
    }
    name = chance.choice(list(packers))
    packed = packers[name](records)
    size = len(records) if honest else chance.choice((len(records), *LIES))
    name = name if honest or chance.random() < 0.8 else chance.choice((b"zstd", b"lz4", b"rar", b"\xff"))
    body = struct.pack("<QQQI", 0, 2**40, size, 0) + text(name)
    return record(CHUNK, body + struct.pack("<Q", len(packed)) + packed)


def mcap(path: Path, chance: Chance) -> None:
    """An .mcap file, closed or cut off."""
    name = chance.choice((b"/points", b"/points", b"", b"\xff", b"x" * 5000))
    schema = record(SCHEMA, struct.pack("<H", 1) + text(CLOUD.encode()) + text(b"ros2msg") + text(b""))
    channel = record(
        CHANNEL, struct.pack("<HH", 1, chance.choice((1, 1, 0, 9))) + text(name) + text(b"cdr") + text(b"")
    )
    contents: list[Callable[[], bytes]] = [
        lambda: b"".join(message(k * 10**8, sweep()) for k in range(3)),
        lambda: message(0, b"") * 600_000,  # 18 MB of the smallest records
        lambda: message(0, bytes(2**26)),
        lambda: b"".join(message(k, each) for k, each in enumerate(bombs())),
        lambda: bytes(2**26),
        lambda: record(MESSAGE, b"", 2**62),
        lambda: message(0, sweep(), 7),
    ]
    honest = chance.random() < 0.5
    inner = schema + channel + chance.choice(contents)()
    if chance.random() < 0.2:
        inner = schema + channel + chunk(chance, inner, honest=honest)
    begin = MAGIC + record(HEADER, text(b"ros2") + text(b""))
    part = chunk(chance, inner, honest=honest) if chance.random() < 0.8 or len(inner) > MOST_BYTES else inner
    whole = begin + part * chance.choice((1, 1, 3))
    if chance.random() < 0.6:
        whole = closed(chance, whole, len(begin), part, schema + channel)
    path.write_bytes(whole)


def closed(chance: Chance, whole: bytes, at: int, part: bytes, known: bytes) -> bytes:
    """A file with an index, whose entries may repeat or lead nowhere."""
    summary_at = len(whole) + 13
    counts = struct.pack("<IHQ", 10, 1, chance.choice((3, 600_000, 2**63 - 1)))
    statistics = record(STATISTICS, struct.pack("<QHIIIIQQ", 3, 1, 1, 0, 0, 1, 0, 2**40) + counts)
    place = chance.choice((at, at, at + 3, 2**62, len(whole)))
    offsets = chance.choice((struct.pack("<I", 0), struct.pack("<IHQ", 10, 1, 0)))
    sizes = struct.pack("<Q", 0) + text(b"zstd") + struct.pack("<QQ", len(part), len(part))
    entry = record(INDEX, struct.pack("<QQQQ", 0, 2**40, place, len(part)) + offsets + sizes)
    end = record(END, bytes(4))
    footer = record(FOOTER, struct.pack("<QQI", chance.choice((summary_at, summary_at, 8, at, 0, 2**62)), 0, 0))
    return whole + end + known + statistics + entry * chance.choice((1, 1, 500)) + footer + MAGIC


def packed(path: Path, chance: Chance) -> None:
    """A file that is compressed as a whole."""
    path.write_bytes(chance.choice(packed_zeros()))


@cache
def packed_zeros() -> list[bytes]:
    """Zeros behind the first bytes of each kind of file."""
    return [zstandard.compress(begin + bytes(2**27)) for begin in (b"", b"SQLite format 3\0", MAGIC)]


MAKERS: dict[str, tuple[str, Callable[[Path, Chance], Any]]] = {
    "database": ("a.db3", database),
    "mcap": ("a.mcap", mcap),
    "packed database": ("a.db3.zstd", packed),
    "packed mcap": ("a.mcap.zstd", packed),
}
