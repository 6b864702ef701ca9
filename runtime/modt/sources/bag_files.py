"""Files of ROS 2 recordings: rosbag2's SQLite databases, and MCAP."""

from __future__ import annotations

import sqlite3
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol
from urllib.parse import quote

from modt.errors import MisuseError, ModtError

REMEDY = "give a recording by rosbag2 (.db3 or .mcap) that was closed, and not compressed as a whole"

MAX_RECORD_BYTES = 2**28
"""Of an MCAP file: a chunk has a few megabytes."""
TOO_LARGE = (MemoryError, OverflowError)
"""Raised where a length in a file is none."""


class BagMessage(NamedTuple):
    """A recorded message."""

    topic: str
    recorded_s: float
    data: bytes


@dataclass(frozen=True, slots=True)
class BagTopic:
    """A topic of a recording: the type of its messages as PACKAGE/NAME, and their number."""

    type: str
    count: int


class BagFile(Protocol):
    """One file of a recording."""

    path: Path

    def topics(self) -> dict[str, BagTopic]:
        """Topics by name, of messages in CDR.

        Raises:
            ModtError: the file cannot be read.
        """

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Messages of these topics in the order of their recording.

        Raises:
            ModtError: the file cannot be read, or not beyond the messages before.
        """


class DatabaseFile:
    """A .db3 file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def topics(self) -> dict[str, BagTopic]:
        """Topics by name, of messages in CDR."""
        query = (
            "SELECT name, type, (SELECT count(*) FROM messages WHERE topic_id = topics.id) FROM topics "
            "WHERE serialization_format = 'cdr'"
        )
        with self._open() as database:
            return {name: BagTopic(_type(kind), count) for name, kind, count in database.execute(query)}

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Messages of these topics in the order of their recording."""
        query = (
            "SELECT name, timestamp, data FROM messages JOIN topics ON topic_id = topics.id "
            f"WHERE name IN ({', '.join('?' * len(topics))}) AND typeof(data) = 'blob' ORDER BY timestamp"
        )
        with self._open() as database:
            for name, recorded_ns, data in database.execute(query, tuple(topics)):
                yield BagMessage(name, 1e-9 * recorded_ns, data)

    @contextmanager
    def _open(self) -> Iterator[sqlite3.Connection]:
        try:
            address = f"file:{quote(str(self.path))}?immutable=1"
            with closing(sqlite3.connect(address, uri=True, check_same_thread=False)) as database:
                yield database
        except (sqlite3.Error, UnicodeDecodeError, TypeError) as error:  # a column may hold anything
            raise ModtError(self.path, f"cannot be read ({error})", REMEDY) from None


class McapFile:
    """An .mcap file; one that was cut off is read up to there.

    Raises:
        MisuseError: the library `mcap` is not installed.
    """

    def __init__(self, path: Path) -> None:
        try:
            from mcap.exceptions import McapError
            from mcap.reader import NonSeekingReader, SeekingReader
            from zstandard import ZstdError
        except ImportError:
            raise MisuseError(path, "needs the library mcap", "pip install mcap, or 'modt[ros2]'") from None
        # What the library and its decompressors raise where the bytes are no recording, or not all of one.
        self.path, self._errors = (
            path,
            (McapError, ZstdError, struct.error, LookupError, ValueError, RuntimeError, *TOO_LARGE),
        )
        self._indexed, self._sequential = SeekingReader, NonSeekingReader

    def topics(self) -> dict[str, BagTopic]:
        """Topics by name, of messages in CDR."""
        counts: Counter[int] = Counter()
        with self._open() as file:
            summary = self._summary(file)
            if summary is not None:
                counts.update(summary.statistics.channel_message_counts)
                schemas, channels = summary.schemas, summary.channels
                return _topics([(schemas.get(channel.schema_id), channel) for channel in channels.values()], counts)
        with self._open() as file:
            found: dict[int, Any] = {}
            with suppress(*self._errors):  # at its end
                for schema, channel, _ in self._sequential(file, record_size_limit=MAX_RECORD_BYTES).iter_messages(
                    log_time_order=False
                ):
                    found[channel.id] = schema, channel
                    counts[channel.id] += 1
        if not found:
            raise ModtError(self.path, "holds no message", REMEDY)
        return _topics(found.values(), counts)

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Messages of these topics in the order of their recording."""
        with self._open() as file:
            indexed = self._summary(file) is not None
            file.seek(0)
            reader = (self._indexed if indexed else self._sequential)(file, record_size_limit=MAX_RECORD_BYTES)
            for _, channel, message in reader.iter_messages(topics=list(topics), log_time_order=indexed):
                yield BagMessage(channel.topic, 1e-9 * message.log_time, message.data)

    def _summary(self, file: BinaryIO) -> Any:
        """Index and counts, None where the recording was not closed."""
        with suppress(*self._errors, OSError):
            summary = self._indexed(file, record_size_limit=MAX_RECORD_BYTES).get_summary()
            return summary if summary is not None and summary.statistics is not None else None
        return None

    @contextmanager
    def _open(self) -> Iterator[BinaryIO]:
        try:
            with self.path.open("rb") as file:
                yield file
        except (OSError, *self._errors) as error:
            raise ModtError(self.path, f"cannot be read ({error})", REMEDY) from None


KINDS: dict[str, type[DatabaseFile] | type[McapFile]] = {".db3": DatabaseFile, ".mcap": McapFile}


def bag_files(path: Path) -> list[BagFile]:
    """The files of a recording, a file or a folder, in their order; none where there are none."""
    paths = sorted(path.iterdir(), key=lambda p: (len(p.name), p.name)) if path.is_dir() else [path]
    return [KINDS[file.suffix](file) for file in paths if file.suffix in KINDS and file.is_file()]


def is_bag(path: Path) -> bool:
    """Whether a path is a recording: a file, or a folder that `metadata.yaml` joins, or of one file alone."""
    if not path.is_dir():
        return path.is_file() and path.suffix in KINDS
    if (path / "metadata.yaml").is_file():
        return any(p.suffix in KINDS for p in path.iterdir())
    files = [p for p in path.iterdir() if p.is_file()]
    return len(files) == 1 and files[0].suffix in KINDS


def messages_of(files: list[BagFile], topics: set[str]) -> Iterator[BagMessage]:
    """Messages of these topics, file by file."""
    return (message for file in files for message in file.messages(topics))


def _type(name: str) -> str:
    """PACKAGE/NAME of PACKAGE/msg/NAME."""
    return name.replace("/msg/", "/")


def _topics(pairs: Any, counts: Counter[int]) -> dict[str, BagTopic]:
    return {
        channel.topic: BagTopic(_type(schema.name), counts[channel.id])
        for schema, channel in pairs
        if schema is not None and channel.message_encoding == "cdr"
    }
