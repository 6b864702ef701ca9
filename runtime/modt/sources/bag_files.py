"""Files of ROS 2 recordings: rosbag2's SQLite databases and MCAP, plain or compressed with zstd."""

from __future__ import annotations

import math
import os
import sqlite3
import sys
import tempfile
import weakref
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from heapq import heappop, heappush
from itertools import chain, count, repeat
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple
from urllib.parse import quote

from modt.errors import MisuseError, ModtError, install

REMEDY = "give a recording by rosbag2 (.db3 or .mcap) that was closed"
ZSTD = ".zstd"
"""Suffix of a file that rosbag2 compressed as a whole."""
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a message that rosbag2 compressed; no message in CDR begins with them."""

MAX_RECORD_BYTES = 2**28
"""Largest record of an MCAP file and largest unpacked message; a chunk has a few megabytes."""
ALLOWANCE_BYTES = 16 * 2**20
"""A file may unpack to ALLOWANCE_BYTES plus MAX_EXPANSION times its size."""
MAX_EXPANSION = 64
FOOTER_BYTES = 37
"""Size of the last record of a closed MCAP file and of what follows it."""
STEPS = 10_000
"""Instructions of a database between two checks of their number. Their limit is that of the unpacked bytes."""


class BagMessage(NamedTuple):
    """A recorded message."""

    topic: str
    recorded_s: float
    data: bytes


@dataclass(frozen=True, slots=True)
class BagTopic:
    """A topic of a recording, with the type of its messages as PACKAGE/NAME, and their number."""

    type: str
    count: int


class BagFile(ABC):
    """One file of a recording.

    Raises:
        MisuseError: a library that reads it is not installed.
        ModtError: the file cannot be unpacked.
    """

    def __init__(self, path: Path) -> None:
        self.path = self._plain = path
        self._most = ALLOWANCE_BYTES + MAX_EXPANSION * path.stat().st_size
        if path.suffix == ZSTD:
            with self._refusals():
                handle, unpacked = tempfile.mkstemp(suffix=_kind(path))
                weakref.finalize(self, os.unlink, unpacked)
                self._plain = Path(unpacked)
                self._unpack(handle)

    def topics(self) -> dict[str, BagTopic]:
        """Topics with messages in CDR by name.

        Raises:
            ModtError: the file cannot be read.
        """
        with self._refusals():
            return {name: BagTopic(kind.replace("/msg/", "/"), count) for name, kind, count in self._topics()}

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Messages of these topics in the order of their recording.

        Raises:
            ModtError: the file cannot be read, or not beyond the messages yielded before.
        """
        left = self._most
        with self._refusals():
            for name, recorded_ns, data in self._messages(topics):
                message = _message(data, min(left, MAX_RECORD_BYTES))
                left = self._less(left, len(message))
                yield BagMessage(name, 1e-9 * recorded_ns, message)

    @abstractmethod
    def _topics(self) -> Iterable[tuple[str, str, int]]:
        """Name, type and number of messages of each topic."""

    @abstractmethod
    def _messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        """Topic, time of the recording [ns] and bytes of each message."""

    def _less(self, left: int, size: int) -> int:
        """Number of bytes that may still be unpacked after `size` bytes.

        Raises:
            ModtError: the limit is exceeded.
        """
        if size > left:
            most = f"{MAX_EXPANSION} times its size and {ALLOWANCE_BYTES >> 20} MiB"
            raise ModtError(self.path, f"unpacks to more than {most}", "record it with less compression")
        return left - size

    def _unpack(self, handle: int) -> None:
        """Write the content of the compressed file."""
        from zstandard import ZstdDecompressor

        left = self._most
        packed = ZstdDecompressor().stream_reader(self.path.open("rb"), read_across_frames=True)
        with open(handle, "wb") as file, packed as reader:
            while piece := reader.read(min(left + 1, 2**20)):
                left = self._less(left, len(piece))
                file.write(piece)

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        """Turn any failure of a library into an error that names the file; its bytes may be anything."""
        try:
            yield
        except ModtError:
            raise
        except ImportError as error:
            raise MisuseError(self.path, f"needs the library {error.name}", install("ros2")) from None
        except Exception as error:
            raise ModtError(self.path, f"cannot be read ({str(error) or type(error).__name__})", REMEDY) from None


class DatabaseFile(BagFile):
    """A .db3 file; it may hold plain tables only, because views and triggers are programs."""

    def _topics(self) -> Iterator[tuple[str, str, int]]:
        yield from self._rows(
            "SELECT name, type, coalesce(n, 0) FROM topics LEFT JOIN "
            "(SELECT topic_id, count(*) AS n FROM messages GROUP BY topic_id) ON topic_id = topics.id "
            "WHERE serialization_format IN ('cdr', '') AND typeof(name) = 'text' AND typeof(type) = 'text'"
        )

    def _messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        yield from self._rows(
            "SELECT name, timestamp, data FROM messages JOIN topics ON topic_id = topics.id "
            f"WHERE name IN ({', '.join('?' * len(topics))}) AND typeof(data) = 'blob' "
            "AND typeof(timestamp) = 'integer' ORDER BY timestamp",
            *topics,
        )

    def _rows(self, query: str, *values: str) -> Iterator[Any]:
        address = f"file:{quote(str(self._plain))}?immutable=1"
        left = iter(range(self._most // STEPS))
        with closing(sqlite3.connect(address, uri=True, check_same_thread=False)) as database:
            if sys.version_info >= (3, 11):
                database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(MAX_RECORD_BYTES, self._plain.stat().st_size))
            database.set_progress_handler(lambda: next(left, None) is None, STEPS)
            database.execute("PRAGMA trusted_schema = OFF")
            for (name,) in database.execute(NO_TABLES):
                raise ModtError(self.path, f"holds {name!r}, which is no table", REMEDY)
            yield from database.execute(query, values)


NO_TABLES = (
    "SELECT name FROM sqlite_master WHERE type != 'index' AND (type != 'table' OR sql NOT LIKE 'CREATE TABLE%')"
)


class McapFile(BagFile):
    """An .mcap file; a truncated one is read up to its end."""

    def _topics(self) -> list[tuple[str, str, int]]:
        summary, counts = self._summary
        found = [(summary.schemas.get(channel.schema_id), channel) for channel in summary.channels.values()]
        return [
            (channel.topic, schema.name, counts.get(channel.id, 0))
            for schema, channel in found
            if schema is not None and channel.message_encoding == "cdr"
        ]

    def _messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        """Messages ordered by recorded time; without an index, chunks come in the order of the file."""
        from mcap.records import Message

        summary, _ = self._summary
        channels = summary.channels
        index = []
        for chunk in summary.chunk_indexes:
            held = {channels[number].topic for number in chunk.message_index_offsets}
            if not held or held & {*topics}:
                index.append(chunk)
        index.sort(key=lambda chunk: (chunk.message_start_time, chunk.chunk_start_offset))
        waiting: list[tuple[int, int, Any]] = []
        order = count()
        with self._plain.open("rb") as file:
            chunks = (next(_records(file, chunk.chunk_start_offset)) for chunk in index)
            contents = self._parts(chunks if summary.chunk_indexes else _records(file, 0))
            next_ns = chain((chunk.message_start_time for chunk in index[1:]), repeat(math.inf))
            # chunks may overlap: a message waits until no later chunk can hold an earlier one
            for parts, until_ns in zip(contents, next_ns, strict=False):
                for part in parts:
                    if isinstance(part, Message) and channels[part.channel_id].topic in topics:
                        heappush(waiting, (part.log_time, next(order), part))
                while waiting and waiting[0][0] < until_ns:
                    _, _, message = heappop(waiting)
                    yield channels[message.channel_id].topic, message.log_time, message.data

    @cached_property
    def _summary(self) -> tuple[Any, Mapping[int, int]]:
        """Schemas, channels and index of chunks, and number of messages by channel.

        A recording that was not closed has no index, and is read up to its end.
        """
        from mcap.summary import Summary

        start = 0
        cause = ""
        with self._plain.open("rb") as file:
            with suppress(Exception):
                start = next(_records(file, file.seek(-FOOTER_BYTES, os.SEEK_END))).summary_start
            for at in dict.fromkeys((start, 0)):
                summary = Summary()
                counts = Counter[int]()
                try:
                    for record in chain.from_iterable(self._parts(_records(file, at))):
                        _register(record, summary, counts)
                except Exception as error:  # at the broken end of the file
                    cause = f" ({error.cause})" if isinstance(error, ModtError) else ""
                if counts:
                    return summary, counts
        raise ModtError(self.path, f"holds no message{cause}", REMEDY)

    def _parts(self, records: Iterable[Any]) -> Iterator[list[Any]]:
        """Content of each chunk, and each record outside of one by itself."""
        from mcap.records import Chunk
        from mcap.stream_reader import breakup_chunk

        left = self._most
        for record in records:
            if isinstance(record, Chunk):
                self._less(min(left, MAX_RECORD_BYTES), record.uncompressed_size)
                record.data = _unpacked(record.compression, record.data, record.uncompressed_size)
                record.compression = ""
                left = self._less(left, len(record.data))
            yield breakup_chunk(record) if isinstance(record, Chunk) else [record]


def _register(record: Any, summary: Any, counts: Counter[int]) -> None:
    """Add a record of an MCAP file to its summary and to the numbers of messages by channel."""
    from mcap.records import Channel, ChunkIndex, Message, Schema, Statistics

    if isinstance(record, Schema):
        summary.schemas[record.id] = record
    elif isinstance(record, Channel):
        summary.channels[record.id] = record
    elif isinstance(record, ChunkIndex):
        summary.chunk_indexes.append(record)
    elif isinstance(record, Statistics):
        counts.clear()
        counts.update(record.channel_message_counts)
    elif isinstance(record, Message):
        counts[record.channel_id] += 1


KINDS: dict[str, type[BagFile]] = {".db3": DatabaseFile, ".mcap": McapFile}


def bag_files(path: Path) -> list[BagFile]:
    """Files of a recording, which is a file or a folder, in their order."""
    within = path.iterdir() if path.is_dir() else [path]
    files = [p for p in within if _kind(p) in KINDS and p.is_file()]
    return [KINDS[_kind(file)](file) for file in sorted(files, key=lambda p: (len(p.name), p.name))]


def messages_of(files: list[BagFile], topics: set[str]) -> Iterator[BagMessage]:
    """Messages of these topics, file by file."""
    return (message for file in files for message in file.messages(topics))


def _kind(path: Path) -> str:
    """Suffix of a file without that of its compression."""
    return Path(path.name.removesuffix(ZSTD)).suffix


def _records(file: BinaryIO, at: int) -> Iterator[Any]:
    """Records of an MCAP file from an offset on; chunks are not unpacked."""
    from mcap.stream_reader import StreamReader

    file.seek(at)
    records = StreamReader(file, skip_magic=at > 0, emit_chunks=True, record_size_limit=MAX_RECORD_BYTES).records
    return iter(records)


def _unpacked(compression: str, data: bytes, most: int) -> bytes:
    """Uncompressed data, limited to `most` bytes."""
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

        return bytes(LZ4FrameDecompressor().decompress(data, max_length=most))
    if compression == "zstd":
        from zstandard import ZstdDecompressor

        return bytes(ZstdDecompressor().stream_reader(data).read(most))
    return data


def _message(data: bytes, most: int) -> bytes:
    """Uncompressed message; one that cannot be unpacked is returned unchanged."""
    if data.startswith(ZSTD_MAGIC):
        with suppress(Exception):
            unpacked = _unpacked("zstd", data, most + 1)
            return unpacked if len(unpacked) <= most else data
    return data
