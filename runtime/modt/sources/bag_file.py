"""A file of a ROS 2 recording, plain or compressed with zstd, and the damage that it has."""

from __future__ import annotations

import os
import tempfile
import weakref
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from modt.errors import MisuseError, ModtError, install

REMEDY = "give a recording by rosbag2 (.db3 or .mcap)"
ZSTD = ".zstd"
"""Suffix of a file that rosbag2 compressed as a whole."""
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of a message that rosbag2 compressed; no message in CDR begins with them."""
DAMAGED = "damaged in the recording"
"""Flaw of a message that the recording lists and no longer holds."""

MAX_RECORD_BYTES = 2**28
"""Largest record of an MCAP file and largest unpacked message; a chunk has a few megabytes."""
ALLOWANCE_BYTES = 16 * 2**20
"""A file may unpack to ALLOWANCE_BYTES plus MAX_EXPANSION times its size."""
MAX_EXPANSION = 64
PIECE_BYTES = 2**18
"""Bytes that are unpacked at once, so that those before a damage are kept."""


class BagMessage(NamedTuple):
    """A recorded message.

    Attributes:
        topic: its topic.
        recorded_s: time of the recording [s].
        data: its bytes; none if it has a flaw.
        flaw: reason why it cannot be read; empty if it can.
    """

    topic: str
    recorded_s: float
    data: bytes
    flaw: str = ""


class Stored(NamedTuple):
    """A message as it is stored, perhaps compressed; otherwise as BagMessage."""

    topic: str
    recorded_ns: int
    data: bytes
    flaw: str = ""


@dataclass(frozen=True)
class BagTopic:
    """A topic of a recording: type of its messages as PACKAGE/NAME, their number, and their encoding."""

    type: str
    count: int
    encoding: str = "cdr"


class BagFile(ABC):
    """One file of a recording.

    Attributes:
        path: the file.
        plain: the file, or what it was unpacked to.
        flaws: damages that the last pass has met, one line each.
        missing: number of messages by topic that the file promises and the last pass did not meet.

    Raises:
        MisuseError: a library that reads it is not installed.
        ModtError: the file cannot be unpacked.
    """

    def __init__(self, path: Path) -> None:
        self.path = self.plain = path
        self.flaws: list[str] = []
        self.missing: Counter[str] = Counter()
        self._most = ALLOWANCE_BYTES + MAX_EXPANSION * path.stat().st_size
        self._left = self._most
        if path.suffix.lower() == ZSTD:
            with self._refusals():
                handle, name = tempfile.mkstemp(suffix=kind_of(path))
                weakref.finalize(self, os.unlink, name)
                self.plain = Path(name)
                self._unpack(handle)

    def topics(self) -> dict[str, BagTopic]:
        """Topics with messages by name.

        Raises:
            ModtError: the file cannot be read.
        """
        with self._refusals():
            found = self._topics().items()
            return {name: BagTopic(t.type.replace("/msg/", "/"), t.count, t.encoding) for name, t in found}

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Messages of these topics in the order of their recording.

        Raises:
            ModtError: the file cannot be read, or not beyond the messages yielded before.
        """
        self.flaws = []
        self.missing = Counter()
        self.renew_allowance()
        with self._refusals():
            for topic, recorded_ns, data, flaw in self._messages(topics):
                message = plain_message(data, min(self._left, MAX_RECORD_BYTES))
                if len(message) != len(data):
                    self.spend(len(message))
                yield BagMessage(topic, 1e-9 * recorded_ns, message, flaw)

    def lost_names(self) -> dict[str, str]:
        """Provisional name and type of each topic whose name is lost."""
        return {}

    def rename(self, provisional: str, name: str) -> None:
        """Give such a topic its name."""
        raise KeyError(provisional)

    @abstractmethod
    def _topics(self) -> dict[str, BagTopic]:
        """Topics by name."""

    @abstractmethod
    def _messages(self, topics: Collection[str]) -> Iterator[Stored]:
        """Messages of these topics in the order of their recording."""

    def renew_allowance(self) -> None:
        """Begin a pass, which may unpack as many bytes as any other."""
        self._left = self._most

    def spend(self, n_bytes: int) -> None:
        """Count bytes that are unpacked.

        Raises:
            ModtError: the limit of a pass is exceeded.
        """
        if n_bytes > self._left:
            most = f"{MAX_EXPANSION} times its size and {ALLOWANCE_BYTES >> 20} MiB"
            raise ModtError(self.path, f"unpacks to more than {most}", "record it with less compression")
        self._left -= n_bytes

    def _unpack(self, handle: int) -> None:
        """Write the content of the compressed file, as far as it can be unpacked."""
        from zstandard import ZstdDecompressor, ZstdError

        packed = ZstdDecompressor().stream_reader(self.path.open("rb"), read_across_frames=True)
        with open(handle, "wb") as file, packed as reader, suppress(ZstdError):
            while piece := reader.read(min(self._left + 1, PIECE_BYTES)):
                self.spend(len(piece))
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


def kind_of(path: Path) -> str:
    """Suffix of a file without that of its compression, in small letters."""
    return Path(path.name.lower().removesuffix(ZSTD)).suffix


def unpacked(compression: str, data: bytes, most: int) -> bytes:
    """Uncompressed data, limited to `most` bytes, and up to the first damage."""
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

        with suppress(RuntimeError):
            return bytes(LZ4FrameDecompressor().decompress(data, max_length=most))
        return b""
    if compression != "zstd":
        return data[:most]
    from zstandard import ZstdDecompressor, ZstdError

    pieces = []
    left = most
    with ZstdDecompressor().stream_reader(data) as reader, suppress(ZstdError):
        while left and (piece := reader.read(min(left, PIECE_BYTES))):
            pieces.append(piece)
            left -= len(piece)
    return b"".join(pieces)


def plain_message(data: bytes, most: int) -> bytes:
    """Uncompressed message; one that cannot be unpacked is returned unchanged."""
    if data.startswith(ZSTD_MAGIC):
        whole = unpacked("zstd", data, most + 1)
        with suppress(Exception):
            from zstandard import get_frame_parameters

            stated = get_frame_parameters(data).content_size
            return whole if len(whole) <= most and stated in (len(whole), 2**64 - 1) else data
    return data
