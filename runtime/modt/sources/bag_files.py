"""Files of ROS 2 recordings: rosbag2's SQLite databases and MCAP, plain or compressed with zstd."""

from __future__ import annotations

import os
import sqlite3
import tempfile
import weakref
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple
from urllib.parse import quote

from modt.errors import MisuseError, ModtError

REMEDY = "give a recording by rosbag2 (.db3 or .mcap) that was closed"
ZSTD = ".zstd"
"""Suffix of a file that rosbag2 compressed as a whole."""
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a message that rosbag2 compressed; no message in CDR begins with them."""

MAX_RECORD_BYTES = 2**28
"""Largest record of an MCAP file and largest unpacked message; a chunk has a few megabytes."""


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


class BagFile(ABC):
    """One file of a recording.

    Raises:
        MisuseError: a library that reads it is not installed.
        ModtError: the file cannot be unpacked.
    """

    def __init__(self, path: Path) -> None:
        self.path = self._plain = path
        if path.suffix == ZSTD:
            with self._refusals():
                handle, unpacked = tempfile.mkstemp(suffix=_kind(path))
                os.close(handle)
                weakref.finalize(self, os.unlink, unpacked)
                self._plain = Path(unpacked)
                _unpack(path, unpacked)

    def topics(self) -> dict[str, BagTopic]:
        """Topics by name, of messages in CDR.

        Raises:
            ModtError: the file cannot be read.
        """
        with self._refusals():
            return {name: BagTopic(kind.replace("/msg/", "/"), count) for name, kind, count in self._topics()}

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Messages of these topics in the order of their recording.

        Raises:
            ModtError: the file cannot be read, or not beyond the messages before.
        """
        with self._refusals():
            for name, recorded_ns, data in self._messages(topics):
                yield BagMessage(name, 1e-9 * recorded_ns, _unpacked(data))

    @abstractmethod
    def _topics(self) -> Iterable[tuple[str, str, int]]:
        """Name, type and number of messages of each topic."""

    @abstractmethod
    def _messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        """Topic, time of the recording [ns] and bytes of each message."""

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        """Any failure of a library as an error that names the file: its bytes may be anything."""
        try:
            yield
        except ModtError:
            raise
        except ImportError as error:
            raise MisuseError(self.path, f"needs the library {error.name}", "pip install 'modt[ros2]'") from None
        except Exception as error:
            raise ModtError(self.path, f"cannot be read ({str(error) or type(error).__name__})", REMEDY) from None


class DatabaseFile(BagFile):
    """A .db3 file."""

    def _topics(self) -> Iterator[tuple[str, str, int]]:
        yield from self._rows(
            "SELECT name, type, (SELECT count(*) FROM messages WHERE topic_id = topics.id) FROM topics "
            "WHERE serialization_format = 'cdr'"
        )

    def _messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        yield from self._rows(
            "SELECT name, timestamp, data FROM messages JOIN topics ON topic_id = topics.id "
            f"WHERE name IN ({', '.join('?' * len(topics))}) AND typeof(data) = 'blob' ORDER BY timestamp",
            *topics,
        )

    def _rows(self, query: str, *values: str) -> Iterator[Any]:
        address = f"file:{quote(str(self._plain))}?immutable=1"
        with closing(sqlite3.connect(address, uri=True, check_same_thread=False)) as database:
            yield from database.execute(query, values)


class McapFile(BagFile):
    """An .mcap file; one that was cut off is read up to there."""

    def _topics(self) -> list[tuple[str, str, int]]:
        with self._plain.open("rb") as file:
            reader, summary = _open_mcap(file)
            if summary is not None:
                counts = Counter(summary.statistics.channel_message_counts)
                found = [(summary.schemas.get(channel.schema_id), channel) for channel in summary.channels.values()]
            else:
                counts, seen = Counter(), {}
                with suppress(Exception):  # at its end
                    for schema, channel, _ in reader.iter_messages(log_time_order=False):
                        seen[channel.id] = schema, channel
                        counts[channel.id] += 1
                found = list(seen.values())
        if not found:
            raise ModtError(self.path, "holds no message", REMEDY)
        return [
            (channel.topic, schema.name, counts[channel.id])
            for schema, channel in found
            if schema is not None and channel.message_encoding == "cdr"
        ]

    def _messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, bytes]]:
        with self._plain.open("rb") as file:
            reader, summary = _open_mcap(file)
            for _, channel, message in reader.iter_messages(list(topics), log_time_order=summary is not None):
                yield channel.topic, message.log_time, message.data


KINDS: dict[str, type[BagFile]] = {".db3": DatabaseFile, ".mcap": McapFile}


def bag_files(path: Path) -> list[BagFile]:
    """The files of a recording, a file or a folder, in their order; none where there are none."""
    return [KINDS[_kind(file)](file) for file in sorted(_within(path), key=lambda p: (len(p.name), p.name))]


def messages_of(files: list[BagFile], topics: set[str]) -> Iterator[BagMessage]:
    """Messages of these topics, file by file."""
    return (message for file in files for message in file.messages(topics))


def _within(path: Path) -> list[Path]:
    """The files at a path or in a folder that have the suffix of a recording."""
    return [p for p in (path.iterdir() if path.is_dir() else [path]) if _kind(p) in KINDS and p.is_file()]


def _kind(path: Path) -> str:
    """Suffix of a file, of the one within where it is compressed."""
    return Path(path.name.removesuffix(ZSTD)).suffix


def _open_mcap(file: BinaryIO) -> tuple[Any, Any]:
    """Reader of an MCAP file, and its index and counts: None where the recording was not closed."""
    from mcap.reader import NonSeekingReader, SeekingReader

    with suppress(Exception):
        indexed = SeekingReader(file, record_size_limit=MAX_RECORD_BYTES)
        summary = indexed.get_summary()
        if summary is not None and summary.statistics is not None:
            return indexed, summary
    file.seek(0)
    return NonSeekingReader(file, record_size_limit=MAX_RECORD_BYTES), None


def _unpack(path: Path, target: str) -> None:
    """Write what a compressed file holds."""
    from zstandard import ZstdDecompressor

    with path.open("rb") as packed, open(target, "wb") as file:
        ZstdDecompressor().copy_stream(packed, file)


def _unpacked(data: bytes) -> bytes:
    """A message, uncompressed; one that cannot be unpacked is left as it is."""
    if not data.startswith(ZSTD_MAGIC):
        return data
    from zstandard import ZstdError, decompress, get_frame_parameters

    with suppress(ZstdError, MemoryError):
        if get_frame_parameters(data).content_size <= MAX_RECORD_BYTES:
            return decompress(data)
    return data
