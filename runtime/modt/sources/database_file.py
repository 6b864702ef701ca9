"""SQLite databases of rosbag2, also those that a killed recorder has left, or that are damaged."""

from __future__ import annotations

import shutil
import sqlite3
import sys
import tempfile
import weakref
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import quote

from modt.errors import ModtError
from modt.ros2 import odometry, point_cloud2
from modt.ros2.cdr import MessageError
from modt.sources.bag_file import DAMAGED, MAX_RECORD_BYTES, REMEDY, BagFile, BagTopic, Stored, plain_message
from modt.sources.sqlite_pages import Pages

PROVISIONAL = "/name_lost_"
"""Begin of the name of a topic whose name is lost."""
MOST_APART_NS = 2 * 10**8
"""Greatest difference of the times of messages that were written one after the other [ns]."""
STEPS = 10_000
"""Instructions of a database between two checks of their number. Their limit is that of the unpacked bytes."""
BESIDE = ("-wal", "-journal")
"""Suffixes of files in which a recorder that was killed leaves what is not in its database yet, or must be undone."""
KINDS: dict[str, Callable[[bytes], object]] = {
    point_cloud2.TYPE: point_cloud2.read_cloud,
    odometry.TYPE: odometry.read_odometry,
}
"""Readers by which messages are recognised whose topic is lost."""
TABLES = "SELECT name FROM sqlite_master WHERE type != 'index' AND (type != 'table' OR sql NOT LIKE 'CREATE TABLE%')"
"""Names of what is no plain table; views and triggers are programs."""


@dataclass(frozen=True)
class Listing:
    """Contents of a database.

    Attributes:
        topics: name, type and encoding of each topic by its number.
        messages: time [ns], number, and number of the topic of each message, ordered.
        dropped: number of rows that are no messages.
        damaged: SQLite cannot read the database, so that its pages are read one by one.
    """

    topics: dict[int, tuple[str, str, str]]
    messages: list[tuple[int, int, int]]
    dropped: int
    damaged: bool


class DatabaseFile(BagFile):
    """A .db3 file. Messages are listed first and then read one by one, so that a damage costs those it lies in."""

    def lost_names(self) -> dict[str, str]:
        """Provisional name and type of each topic whose name is lost."""
        return {name: kind for name, kind, _ in self._listing.topics.values() if name.startswith(PROVISIONAL)}

    def rename(self, provisional: str, name: str) -> None:
        """Give such a topic its name."""
        for number, (known, kind, form) in self._listing.topics.items():
            if known == provisional:
                self._listing.topics[number] = (name, kind, form)

    def _topics(self) -> dict[str, BagTopic]:
        listing = self._listing
        counts = Counter(listing.topics[topic][0] for _, _, topic in listing.messages)  # a name may be listed twice
        return {
            name: BagTopic(kind, counts[name], encoding or "cdr") for name, kind, encoding in listing.topics.values()
        }

    def _messages(self, topics: Collection[str]) -> Iterator[Stored]:
        listing = self._listing
        names = {number: name for number, (name, _, _) in listing.topics.items() if name in topics}
        if listing.damaged:
            self.flaws.append("damaged: its pages are read one by one")
        if listing.dropped:
            self.flaws.append(f"{listing.dropped} of its rows are no messages")
        with closing(self._database()) as database:
            for recorded_ns, number, topic in listing.messages:
                if topic in names:
                    data = self._data(database, number)
                    yield Stored(names[topic], recorded_ns, data or b"", DAMAGED if data is None else "")

    def _data(self, database: sqlite3.Connection, number: int) -> bytes | None:
        """Bytes of a message, None if they cannot be read."""
        if not self._listing.damaged:
            with suppress(sqlite3.Error):
                for (data,) in self._run(database, "SELECT data FROM messages WHERE id = ?", number):
                    return data if isinstance(data, bytes) else None
        return self._pages.blob(number)

    @cached_property
    def _pages(self) -> Pages:
        return Pages(self._merged)

    @cached_property
    def _listing(self) -> Listing:
        """Topics and messages by the tables, or by the pages where the tables are damaged."""
        damaged = False
        try:
            topics, messages = self._tables()
        except sqlite3.Error as error:
            damaged = True
            topics = self._pages.topics
            messages = self._pages.messages
            if not messages:
                raise ModtError(self.path, f"cannot be read ({error})", REMEDY) from None
        known = {number: (name, kind, form) for number, name, kind, form in topics if _are(str, name, kind, form)}
        listed = {row[1]: row for row in messages if _are(int, *row)}
        for _, number, topic in listed.values():
            if topic not in known and (kind := self._kind_of(number)):
                known[topic] = (f"{PROVISIONAL}{topic}", kind, "cdr")
        rows = [row for _, row in sorted(listed.items()) if row[2] in known]
        return Listing(known, _by_time(rows), len(messages) - len(rows), damaged)

    def _kind_of(self, number: int) -> str:
        """Type of a message whose topic is lost, by its content; empty if it is none that is read."""
        data = plain_message(self._pages.blob(number) or b"", MAX_RECORD_BYTES)
        for kind, read in KINDS.items():
            with suppress(MessageError):
                read(data)
                return kind
        return ""

    def _tables(self) -> tuple[list[Any], list[Any]]:
        """Rows of the topics and of the messages.

        Raises:
            sqlite3.Error: they are damaged.
            ModtError: there is more than tables.
        """
        with closing(self._database()) as database:
            for (name,) in self._run(database, TABLES):
                raise ModtError(self.path, f"holds {name!r}, which is no table", REMEDY)
            topics = self._run(database, "SELECT id, name, type, serialization_format FROM topics").fetchall()
            # Without the index of times, which may be damaged by itself. It has as many entries if nothing is.
            messages = self._run(database, "SELECT timestamp, id, topic_id FROM messages NOT INDEXED").fetchall()
            indexed = len(messages)
            with suppress(sqlite3.Error):
                indexed = self._run(database, "SELECT count(*) FROM messages INDEXED BY timestamp_idx").fetchone()[0]
            if indexed > len(messages):
                raise sqlite3.DatabaseError("its table has fewer messages than the index of their times")
        return topics, messages

    def _run(self, database: sqlite3.Connection, query: str, *values: int) -> sqlite3.Cursor:
        """A query of limited length."""
        left = iter(range(self._most // STEPS))
        database.set_progress_handler(lambda: next(left, None) is None, STEPS)
        return database.execute(query, values)

    def _database(self) -> sqlite3.Connection:
        """Connection that reads, and changes nothing."""
        database = sqlite3.connect(self._address, uri=True, check_same_thread=False)
        if sys.version_info >= (3, 11):
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(MAX_RECORD_BYTES, self._stored_bytes))
        database.execute("PRAGMA trusted_schema = OFF")
        return database

    @property
    def _stored_bytes(self) -> int:
        """Size of the database with what lies beside it [bytes]."""
        return sum(file.stat().st_size for file in (self.plain, *self._left_beside()))

    @cached_property
    def _address(self) -> str:
        """Address by which SQLite opens the database together with what a killed recorder has left beside it.

        SQLite reads the log of a database in place where it may write an index of it. Otherwise, and where a
        transaction must be undone, it works on a copy.
        """
        if not self._left_beside():
            return f"file:{quote(str(self.plain))}?immutable=1"
        address = f"file:{quote(str(self.plain))}?mode=ro"
        with suppress(sqlite3.Error), closing(sqlite3.connect(address, uri=True)) as database:
            database.execute("SELECT count(*) FROM sqlite_master")
            return address
        return f"file:{quote(str(self._merged))}?mode=ro"

    @cached_property
    def _merged(self) -> Path:
        """The database, or a copy of it that has taken up what lies beside it."""
        left = self._left_beside()
        if not left:
            return self.plain
        folder = tempfile.mkdtemp()
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        copy = Path(folder) / self.plain.name
        for file in (self.plain, *left):
            shutil.copyfile(file, copy.with_name(file.name))
        with suppress(sqlite3.Error), closing(sqlite3.connect(copy)) as database:
            database.execute("SELECT count(*) FROM sqlite_master")  # undoes an unfinished transaction
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        return copy

    def _left_beside(self) -> list[Path]:
        """Files that a killed recorder has left."""
        beside = (self.plain.with_name(self.plain.name + suffix) for suffix in BESIDE)
        return [file for file in beside if file.is_file() and file.stat().st_size]


def _by_time(rows: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """Rows, given in the order of their numbers, by their times; a time far from those around it is damaged.

    Where the clock of the recorder was set back, the times of a topic fall, and what was recorded later comes later.
    """
    times = [row[0] for row in rows]
    for k in range(1, len(times) - 1):
        before, now, after = times[k - 1 : k + 2]
        if 0 <= after - before < MOST_APART_NS and min(abs(now - before), abs(after - now)) > MOST_APART_NS:
            times[k] = before
    latest: dict[int, int] = {}  # time of the latest message of each topic
    times_set = 0
    sections = []
    for time, (_, _, topic) in zip(times, rows, strict=True):
        if time < latest.get(topic, time) - MOST_APART_NS:
            times_set += 1
            latest = {}
        latest[topic] = max(time, latest.get(topic, time))
        sections.append(times_set)
    timed = zip(sections, times, rows, strict=True)
    return [row for _, row in sorted((section, (time, *row[1:])) for section, time, row in timed)]


def _are(kind: type, *values: Any) -> bool:
    return all(isinstance(value, kind) for value in values)
