"""MCAP files. Their records are found by the index, or by a scan of the file where the index is damaged."""

from __future__ import annotations

import math
import mmap
import re
import struct
import zlib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from heapq import heappop, heappush
from io import BytesIO
from itertools import chain, count, repeat
from operator import attrgetter
from typing import Any

from modt.errors import ModtError
from modt.sources.bag_file import DAMAGED, MAX_RECORD_BYTES, REMEDY, BagFile, BagTopic, Stored, unpacked

MAGIC_BYTES = 8
HEAD_BYTES = 9
"""Size of the opcode and the length of a record."""
FOOTER_BYTES = 37
"""Size of the last record of a closed file and of the magic behind it."""
CRC_AT = 25
"""Offset in the footer of the checksum of the summary, which covers the footer up to there."""
MESSAGE = 5
KEPT_BYTES = 32 << 20
"""Longest piece whose messages are kept for the next reading [bytes]."""
CHUNK = 6
MESSAGE_INDEX = 7
LAST_OPCODE = DATA_END = 15
CHUNK_BYTES = 40
"""Size of a chunk without the name of its compression and without its records."""
SET_BACK_NS = 2 * 10**8
"""Time by which the messages of a channel fall back where the clock of the recorder was set [ns]."""
COMPARED = 8
"""Number of pieces before such a place that are compared with those behind it."""
COMPRESSIONS = ("", "zstd", "lz4")
LEAST_MESSAGE_BYTES = 22
_BEGIN = re.compile(rb"[\x05\x06](?=.{4}\0{4})", re.DOTALL)
"""Possible begin of a message or of a chunk below 4 GiB."""


@dataclass(frozen=True)
class Piece:
    """Records that are read together: those in a chunk, or a message outside of one.

    Attributes:
        start_ns: earliest time of its messages [ns].
        at, size: place of its bytes in the file.
        compression, unpacked_bytes: as in the chunk; a message outside of one has no unpacked bytes.
        indices: offsets in the file of the indices of its messages by channel; empty if there are none.
        channel: channel of a message outside of a chunk.
        index_ends: the record behind its indices is there, so that none of them is missing.
    """

    start_ns: int
    at: int
    size: int
    compression: str = ""
    unpacked_bytes: int = 0
    indices: Mapping[int, int] = field(default_factory=dict)
    channel: int | None = None
    index_ends: bool = True

    @property
    def crc_at(self) -> int:
        """Offset in the file of the checksum of a chunk."""
        return self.at - 16 - len(self.compression)


@dataclass(slots=True)
class Contents:
    """Contents of a file.

    Attributes:
        schemas, channels: records by their numbers. The first of a number counts.
        pieces: chunks, and messages outside of them.
        counts: number of messages by channel; None where the file does not state it.
        gaps: offsets at which a scan has met bytes that are no record.
    """

    schemas: dict[int, Any] = field(default_factory=dict)
    channels: dict[int, Any] = field(default_factory=dict)
    pieces: list[Piece] = field(default_factory=list)
    counts: Counter[int] | None = None
    gaps: list[int] = field(default_factory=list)

    def trusts_index_of(self, piece: Piece) -> bool:
        """Whether the indices of a piece tell which channels it has messages of."""
        return bool(piece.indices) and piece.index_ends and piece.indices.keys() <= self.channels.keys()

    def register(self, record: Any) -> None:
        """Add what a record states."""
        from mcap.records import Channel, ChunkIndex, Schema, Statistics

        if isinstance(record, Schema):
            self.schemas.setdefault(record.id, record)
        elif isinstance(record, Channel):
            self.channels.setdefault(record.id, record)
        elif isinstance(record, Statistics):
            self.counts = Counter(record.channel_message_counts)
        elif isinstance(record, ChunkIndex):
            at = record.chunk_start_offset + record.chunk_length - record.compressed_size
            forms = (record.compression, record.uncompressed_size, record.message_index_offsets)
            self.pieces.append(Piece(record.message_start_time, at, record.compressed_size, *forms))


class McapFile(BagFile):
    """An .mcap file. Damaged stretches are left out, and what lies behind them is read."""

    _latest: tuple[int, dict[int, Any]] = (-1, {})
    """Offset of the undamaged piece that was read last, and its messages: a short file is read several times."""

    def _topics(self) -> dict[str, BagTopic]:
        contents = self._contents
        counts = contents.counts or self._counted(contents)
        topics: dict[str, BagTopic] = {}
        for number, channel in contents.channels.items():
            schema = contents.schemas.get(channel.schema_id)
            before = topics[channel.topic].count if channel.topic in topics else 0
            kind = "" if schema is None else schema.name
            topics[channel.topic] = BagTopic(kind, before + counts[number], channel.message_encoding)
        if not any(topic.count for topic in topics.values()):
            raise ModtError(self.path, "holds no message", REMEDY)
        return topics

    def _messages(self, topics: Collection[str]) -> Iterator[Stored]:
        """Messages ordered by recorded time, but for those before and behind a clock that was set back."""
        contents = self._contents
        wanted = {number for number, channel in contents.channels.items() if channel.topic in topics}
        pieces = [p for p in contents.pieces if not contents.trusts_index_of(p) or wanted & {*p.indices}]
        seen = Counter[str]()
        promised = contents.counts
        for section in self._sections(pieces):
            for message in self._merged(contents, section, wanted):
                seen[message.topic] += 1
                yield message
        for at in contents.gaps:
            self.flaws.append(f"the bytes from {at} on are damaged up to the next record")
        if promised is not None:
            for number in wanted:
                self.missing[contents.channels[number].topic] += promised[number]
            self.missing -= seen

    def _sections(self, pieces: Sequence[Piece]) -> Iterator[list[Piece]]:
        """Pieces between the places at which the recorder's clock was set back, so that times of a channel fall."""
        pieces = sorted(pieces, key=attrgetter("at"))
        first = 0  # piece that begins the section
        fallen = 0  # piece since which all begin earlier than one before them
        newest_ns = 0  # latest begin of a piece before that one
        for k, piece in enumerate(pieces):
            if piece.start_ns >= newest_ns - SET_BACK_NS:
                newest_ns = max(newest_ns, piece.start_ns)
                fallen = k + 1
            elif any(self._falls(before, piece) for before in pieces[max(first, fallen - COMPARED) : fallen]):
                yield pieces[first:fallen]
                first = fallen
                fallen = k + 1
                newest_ns = piece.start_ns
        yield pieces[first:]

    def _falls(self, before: Piece, piece: Piece) -> bool:
        """Whether the times of a channel fall from one piece to another."""
        last_ns = dict(self._times_of(before))
        return any(time_ns < last_ns.get(number, 0) - SET_BACK_NS for number, time_ns in self._times_of(piece))

    def _times_of(self, piece: Piece) -> Collection[tuple[int, int]]:
        """Channel and time [ns] of its messages as far as they are indexed."""
        return self._indexed(piece).values() if piece.channel is None else [(piece.channel, piece.start_ns)]

    def _merged(self, contents: Contents, pieces: list[Piece], wanted: Collection[int]) -> Iterator[Stored]:
        """Messages of pieces by their times. A message waits until no later piece can hold an earlier one."""
        pieces.sort(key=lambda piece: (piece.start_ns, piece.at))
        next_ns = chain((piece.start_ns for piece in pieces[1:]), repeat(math.inf))
        waiting: list[tuple[int, int, int, Stored]] = []  # number of set backs before it, time, order, and message
        order = count()
        times_set = 0
        for piece, until_ns in zip(pieces, next_ns, strict=False):
            latest_ns: dict[str, int] = {}  # time of the latest message of the piece by topic
            for message in self._stored(contents, piece, wanted):
                if not message.flaw:
                    times_set += message.recorded_ns < latest_ns.get(message.topic, 0) - SET_BACK_NS
                    latest_ns[message.topic] = message.recorded_ns
                heappush(waiting, (times_set, message.recorded_ns, next(order), message))
            while waiting and waiting[0][:2] < (times_set, until_ns):
                yield heappop(waiting)[-1]

    def _stored(self, contents: Contents, piece: Piece, wanted: Collection[int]) -> Iterator[Stored]:
        """Messages of a piece, and those that its index names and its bytes no longer hold."""
        found, whole = self._found(contents, piece)
        channels = contents.channels
        for record in found.values():
            if record.channel_id in wanted:
                yield Stored(channels[record.channel_id].topic, record.log_time, record.data)
        if whole:
            return
        indexed = self._indexed(piece)
        if not indexed and piece.channel is not None and piece.channel in wanted:
            yield Stored(channels[piece.channel].topic, piece.start_ns, b"", DAMAGED)
        elif not indexed:
            self.flaws.append(
                f"the chunk at byte {piece.at} is damaged; how many of its messages are lost is not known"
            )
        for at, (number, time_ns) in indexed.items():
            if number in wanted and at not in found:
                yield Stored(channels[number].topic, time_ns, b"", DAMAGED)

    def _found(self, contents: Contents, piece: Piece) -> tuple[dict[int, Any], bool]:
        """Messages of a piece by their offsets in it, and whether it is undamaged; its channels are registered."""
        from mcap.records import Message

        at_before, before = self._latest
        if piece.at == at_before:
            return before, True
        n_flaws = len(self.flaws)
        data, whole = self._unpacked(piece)
        indexed: Iterator[int] | None = None  # offsets at which reading can go on behind a damage
        found = {}
        at = 0
        while at < len(data):
            try:
                record, end = record_at(data, at)
            except Exception:  # its bytes may be anything
                whole = False
                indexed = indexed or iter(self._indexed(piece))
                at = next((place for place in indexed if place > at), len(data))
                continue
            if not isinstance(record, Message):
                contents.register(record)
            elif record.channel_id in contents.channels:
                found[at] = record
            at = end
        if whole and len(self.flaws) == n_flaws and len(data) <= KEPT_BYTES:
            self._latest = piece.at, found
        return found, whole

    def _unpacked(self, piece: Piece) -> tuple[bytes, bool]:
        """Bytes of a piece up to the first damage that its compression shows, and whether they are all."""
        if piece.unpacked_bytes > MAX_RECORD_BYTES:
            raise ModtError(self.path, f"has a chunk of {piece.unpacked_bytes} bytes", REMEDY)
        self.spend(piece.unpacked_bytes)
        with self.plain.open("rb") as file:
            file.seek(piece.at)
            packed = file.read(min(piece.size, MAX_RECORD_BYTES))
            if not piece.unpacked_bytes:  # a message outside of a chunk
                return packed, len(packed) == piece.size
            file.seek(piece.crc_at)
            crc = int.from_bytes(file.read(4), "little")
        data = unpacked(piece.compression, packed, piece.unpacked_bytes)
        whole = len(data) == piece.unpacked_bytes
        if whole and crc and zlib.crc32(data) != crc:
            self.flaws.append(
                f"the checksum of the chunk at byte {piece.at} differs; its messages are read as they are"
            )
        return data, whole

    def _indexed(self, piece: Piece) -> dict[int, tuple[int, int]]:
        """Channel and time [ns] of the messages of a piece by their offsets in it, as its indices state them."""
        found: dict[int, tuple[int, int]] = {}
        with self.plain.open("rb") as file:
            for number, place in piece.indices.items():
                with suppress(Exception):  # its bytes may be anything
                    file.seek(place)
                    head = file.read(HEAD_BYTES)
                    record, _ = record_at(head + file.read(min(_length(head, 0), MAX_RECORD_BYTES)), 0)
                    found |= {at: (number, time_ns) for time_ns, at in record.records}
        return dict(sorted(found.items()))

    def _counted(self, contents: Contents) -> Counter[int]:
        """Number of messages by channel, by the indices of the pieces, or by reading those that have none."""
        counts = Counter[int]()
        for piece in contents.pieces:
            numbers = [number for number, _ in self._indexed(piece).values()]
            if not numbers or not contents.trusts_index_of(piece):
                numbers = [record.channel_id for record in self._found(contents, piece)[0].values()]
            counts.update(numbers)
        self.flaws.clear()  # a pass over the messages reports them
        self.renew_allowance()
        return counts

    @cached_property
    def _contents(self) -> Contents:
        """Contents by the summary of a closed file, else by a scan."""
        size = self.plain.stat().st_size
        with self.plain.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as view:
            with suppress(Exception):  # its bytes may be anything
                contents = _summary(view)
                within = all(piece.at + piece.size <= size for piece in contents.pieces)
                named = contents.channels.keys() >= {number for piece in contents.pieces for number in piece.indices}
                if contents.pieces and contents.channels and within and named:
                    return contents
            contents = _scanned(view)
        for piece in contents.pieces:  # a chunk states the channels that begin in it
            if not contents.channels.keys() >= piece.indices.keys():
                self._found(contents, piece)
        self.renew_allowance()
        return contents


View = bytes | mmap.mmap


def _summary(view: View) -> Contents:
    """Contents by the summary at the end of a closed file.

    Raises:
        Exception: there is none, or it is damaged.
    """
    footer_at = len(view) - FOOTER_BYTES
    footer, _ = record_at(view, footer_at)
    if not 0 < footer.summary_start < footer_at:
        raise ValueError("no summary")
    crc = zlib.crc32(view[footer.summary_start : footer_at + CRC_AT])
    if footer.summary_crc not in (0, crc):
        raise ValueError("the checksum of the summary differs")
    contents = Contents()
    at = footer.summary_start
    while at < footer_at:
        record, at = record_at(view, at)
        contents.register(record)
    return contents


def _scanned(view: View) -> Contents:
    """Contents by a walk from record to record. Behind damaged bytes it goes on at the next chunk or message."""
    contents = Contents()
    at = MAGIC_BYTES
    before = at
    ended = False
    while at + HEAD_BYTES <= len(view):
        try:
            end = _scan(view, at, contents)
        except Exception:  # its bytes may be anything
            if not ended:  # behind the end of the data there is but a summary
                contents.gaps.append(at)
                _end_index(contents.pieces)
            # A message has no checksum: its length may be what is damaged, and records lie within what it claimed.
            end = _next_begin(view, before + 1 if view[before] == MESSAGE else at + 1)
        else:
            before = at
            ended = ended or view[at] == DATA_END
        at = end
    if not ended:
        if at < len(view):  # cut off within the head of a record
            contents.gaps.append(at)
        _end_index(contents.pieces)
    contents.pieces = _in_order(contents.pieces)
    return contents


def _scan(view: View, at: int, contents: Contents) -> int:
    """Add the record at an offset to the contents, and return the offset of its end.

    Raises:
        Exception: the bytes are no record.
    """
    from mcap.records import ChunkIndex

    opcode = view[at]
    if opcode in (CHUNK, MESSAGE):
        piece = _chunk_at(view, at) if opcode == CHUNK else _message_at(view, at)
        contents.pieces.append(piece)
        return piece.at + piece.size
    record, end = record_at(view, at)
    if opcode == MESSAGE_INDEX and contents.pieces:
        last = contents.pieces[-1]
        contents.pieces[-1] = replace(last, indices={**last.indices, record.channel_id: at})
    elif not isinstance(record, ChunkIndex) and _consistent(record):
        contents.register(record)
    return end


def _consistent(record: Any) -> bool:
    """Whether statistics, which may be damaged, agree with themselves."""
    counts = getattr(record, "channel_message_counts", None)
    return counts is None or sum(counts.values()) == record.message_count


def _in_order(pieces: list[Piece]) -> list[Piece]:
    """Pieces whose begins are damaged begin with the piece before."""
    begins = [piece.start_ns for piece in pieces]
    for k in range(1, len(begins) - 1):
        if begins[k - 1] <= begins[k + 1] and not begins[k - 1] <= begins[k] <= begins[k + 1]:
            begins[k] = begins[k - 1]
    return [replace(piece, start_ns=begin) for piece, begin in zip(pieces, begins, strict=True)]


def _next_begin(view: View, at: int) -> int:
    """Offset of the next chunk or message outside of one; the end of the file if there is none."""
    for match in _BEGIN.finditer(view, at):
        with suppress(Exception):
            begin = match.start()
            if view[begin] == CHUNK:
                _chunk_at(view, begin)
                return begin
            piece = _message_at(view, begin)
            if piece.at + piece.size <= len(view):
                return begin
    return len(view)


def _chunk_at(view: View, at: int) -> Piece:
    """The chunk at an offset; the last one may be cut off.

    Raises:
        ValueError: there is none.
    """
    body = at + HEAD_BYTES
    start_ns, _, unpacked_bytes, _, name_bytes = struct.unpack_from("<3Q2I", view, body)
    if name_bytes > 4:
        raise ValueError("no chunk")
    compression = bytes(view[body + 32 : body + 32 + name_bytes]).decode()
    size = _u64(view, body + 32 + name_bytes)
    end = body + CHUNK_BYTES + name_bytes + size
    agree = end - body == _length(view, at)
    if not agree and compression:  # one of its two sizes is damaged: that of the records counts if a record follows
        agree = (
            end + HEAD_BYTES <= len(view) and 0 < view[end] <= LAST_OPCODE and _length(view, end) < len(view) - end
        )
    if not agree or compression not in COMPRESSIONS or not unpacked_bytes:
        raise ValueError("no chunk")
    return Piece(start_ns, body + CHUNK_BYTES + name_bytes, size, compression, unpacked_bytes)


def _message_at(view: View, at: int) -> Piece:
    """The message at an offset, with its two times; the last one may be cut off.

    Raises:
        ValueError: there is none.
    """
    body = at + HEAD_BYTES
    length = _length(view, at)
    recorded_ns = _u64(view, body + 6)
    published_ns = _u64(view, body + 14)
    near = abs(recorded_ns - published_ns) < MOST_APART_NS or not published_ns
    if not near or not LEAST_MESSAGE_BYTES <= length <= MAX_RECORD_BYTES:
        raise ValueError("no message")
    return Piece(recorded_ns, at, HEAD_BYTES + length, channel=int.from_bytes(view[body : body + 2], "little"))


MOST_APART_NS = 10**9 * 86_400 * 365
"""Greatest difference of the two times of a message [ns]; beyond it, bytes are no message."""


def _end_index(pieces: list[Piece]) -> None:
    """Note that indices of the last piece may be missing."""
    if pieces:
        pieces[-1] = replace(pieces[-1], index_ends=False)


RECORD_HEAD = struct.Struct("<BQ")
"""Kind of a record, and its length."""
MESSAGE_HEAD = struct.Struct("<HIQQ")
"""Channel, sequence number, and times of recording and of publication of a message [ns]."""


@cache
def _record_kinds() -> dict[int, Any]:
    """Kinds of records that are read, by their numbers."""
    from mcap import records

    return {
        2: records.Footer,
        3: records.Schema,
        4: records.Channel,
        MESSAGE: records.Message,
        MESSAGE_INDEX: records.MessageIndex,
        8: records.ChunkIndex,
        11: records.Statistics,
    }


def record_at(view: View, at: int) -> tuple[Any, int]:
    """Record at an offset, None for a kind that is not read, and the offset of its end.

    Raises:
        Exception: the bytes are no record.
    """
    opcode, length = RECORD_HEAD.unpack_from(view, at)
    end = at + HEAD_BYTES + length
    if not 0 < opcode <= LAST_OPCODE or end > len(view):
        raise ValueError("no record")
    kinds = _record_kinds()
    if opcode == MESSAGE:  # of which there may be hundreds of thousands
        if length < MESSAGE_HEAD.size:
            raise ValueError("no record")
        channel, sequence, log_time, publish_time = MESSAGE_HEAD.unpack_from(view, at + HEAD_BYTES)
        data = bytes(view[at + HEAD_BYTES + MESSAGE_HEAD.size : end])
        return kinds[MESSAGE](channel, log_time, data, publish_time, sequence), end
    if opcode not in kinds:
        return None, end
    from mcap.data_stream import ReadDataStream

    stream = ReadDataStream(BytesIO(view[at + HEAD_BYTES : end]))
    record = kinds[opcode].read(stream)
    if stream.count > length:
        raise ValueError("no record")
    return record, end


def _length(view: View, at: int) -> int:
    return _u64(view, at + 1)


def _u64(view: View, at: int) -> int:
    return int.from_bytes(view[at : at + 8], "little")
