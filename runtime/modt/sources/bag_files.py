"""Files of a ROS 2 recording as one: what each of them cannot give is known, and the others are read."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from modt import profile
from modt.errors import MisuseError, ModtError
from modt.sources.bag_file import ZSTD, BagFile, BagMessage, BagTopic, kind_of
from modt.sources.database_file import DatabaseFile
from modt.sources.mcap_file import McapFile

KINDS: dict[str, type[BagFile]] = {".db3": DatabaseFile, ".mcap": McapFile}
METADATA = "metadata.yaml"
_PART = re.compile(r"^(.*?)[_-]?\d*$")
"""Name of the recording in the name of one of its files without its suffix."""
_NUMBER = re.compile(r"_(\d{1,6})$")
"""Number of a file of a split recording in its name without its suffix."""


class Bag:
    """A recording in one file or in several, which follow one another.

    Attributes:
        files: those that can be opened, in their order.
        flaws: what is damaged or absent, one line each, as far as the last pass has met it.
        missing: number of messages by topic that the recording promises and the last pass did not meet.

    Raises:
        MisuseError: a library that reads a file is not installed.
        ModtError: no file can be read.
    """

    def __init__(self, path: Path) -> None:
        self.flaws: list[str] = []
        self.missing: Counter[str] = Counter()
        self.files: list[BagFile] = []
        self._topics: dict[str, BagTopic] = {}
        paths, self._promised = _listed(path)
        self._unread = [f"file number {number} is not there" for number in _missing(paths)]  # flaws of files
        error = ModtError(path, "none of its files is there", "copy the whole folder")
        for file in paths:
            try:
                self._open(file)
            except MisuseError:
                raise
            except ModtError as refusal:
                error = refusal
                self._unread.append(f"{file.name} {refusal.cause}")
        if not self.files:
            raise error
        self._name_topics()
        self.flaws = [*self._unread]

    def topics(self) -> dict[str, BagTopic]:
        """Topics by name, with the number of messages that can be listed."""
        return self._topics

    def messages(self, topics: set[str]) -> Iterator[BagMessage]:
        """Messages of these topics, file by file."""
        self.flaws = [*self._unread]
        seen = Counter[str]()
        within = Counter[str]()
        for file in self.files:
            try:
                for message in file.messages(topics):
                    seen[message.topic] += 1
                    yield message
            except MisuseError:
                raise
            except ModtError as error:
                self.flaws.append(f"{file.path.name} {error.cause}")
            self.flaws += [f"{file.path.name}: {flaw}" for flaw in file.flaws]
            within += file.missing
        promised = Counter({name: self._promised.get(name, 0) for name in topics})
        self.missing = within | (promised - seen)

    def _open(self, path: Path) -> None:
        """Add a file and its topics.

        Raises:
            ModtError: it cannot be read.
        """
        if not path.is_file():
            raise ModtError(path, "is not there", "copy the whole folder")
        if not path.stat().st_size:
            raise ModtError(path, "is empty", "its recorder was killed, or the disk was full")
        file = KINDS[kind_of(path)](path)
        file.topics()
        self.files.append(file)

    def _name_topics(self) -> None:
        """Sum up the topics. One whose name is lost is the only other one of its type, if there is one."""
        lost = {name for file in self.files for name in file.lost_names()}
        named = {
            (name, topic.type) for file in self.files for name, topic in file.topics().items() if name not in lost
        }
        for file in self.files:
            for provisional, kind in file.lost_names().items():
                names = {name for name, other in named if other == kind}
                if len(names) == 1:
                    file.rename(provisional, names.pop())
            for name, topic in file.topics().items():
                before = self._topics[name].count if name in self._topics else 0
                self._topics[name] = BagTopic(topic.type, before + topic.count, topic.encoding)


def bag_in(folder: Path) -> list[Path]:
    """Files of the one recording in a folder, in their order; empty if there are none, or several recordings.

    Files whose names differ by a number alone, as rosbag2 splits a recording, are one. A compressed file beside the
    same file without compression is left out: a recorder that was killed has not finished it.
    """
    files = [file for file in folder.iterdir() if kind_of(file) in KINDS and file.is_file()]
    files = [file for file in files if not file.name.startswith(".")]  # such as those that macOS adds to a copy
    names = {file.name for file in files}
    files = [file for file in files if file.name.removesuffix(ZSTD) not in names - {file.name}]
    if len({_stem(file) for file in files}) > 1 and not (folder / METADATA).is_file():
        return []
    return sorted(files, key=lambda file: (len(file.name.removesuffix(ZSTD)), file.name))


def _missing(paths: list[Path]) -> list[int]:
    """Numbers that are missing between those of the files of a recording."""
    numbers = {int(match[1]) for path in paths if (match := _NUMBER.search(path.name.partition(".")[0]))}
    within = range(min(numbers), max(numbers)) if len(numbers) == len(paths) > 1 else ()
    return [number for number in within if number not in numbers]


def _stem(file: Path) -> str:
    match = _PART.match(file.name.partition(".")[0])
    return match[1] if match else file.name


def _listed(path: Path) -> tuple[list[Path], dict[str, int]]:
    """Files of a recording in their order, and the number of messages by topic that its metadata promise."""
    if not path.is_dir():
        return [path], {}
    there = bag_in(path)
    names: list[str] = []
    counts: dict[str, int] = {}
    try:
        text = (path / METADATA).read_text(encoding="utf-8")
        facts = profile.from_yaml(text, path / METADATA)["rosbag2_bagfile_information"]
        names = [Path(name).name for name in facts["relative_file_paths"]]
        topics = facts.get("topics_with_message_count", ())
        counts = {topic["topic_metadata"]["name"]: int(topic["message_count"]) for topic in topics}
    except (OSError, UnicodeError, ModtError, LookupError, TypeError, ValueError, AttributeError):
        pass  # the files themselves tell as much
    listed = [*dict.fromkeys(_as_stored(path / name) for name in names if kind_of(Path(name)) in KINDS)]
    numbers = [_NUMBER.search(file.name.partition(".")[0]) for file in listed]
    if len({_stem(file) for file in listed}) == 1 and all(numbers):
        listed.sort(key=lambda file: (len(file.name.removesuffix(ZSTD)), file.name))
    stems = {_stem(file) for file in listed}
    further = [file for file in there if file not in listed]
    absent = [file for file in listed if not file.is_file()]
    if len(further) == len(absent) == len(listed):  # a recording that was renamed
        return further, counts
    return [*listed, *(file for file in further if not stems or _stem(file) in stems)], counts


def _as_stored(file: Path) -> Path:
    """The file without the suffix of its compression if it is there, else with it, else as it is listed."""
    plain = file.with_name(file.name.removesuffix(ZSTD))
    return next((other for other in (plain, plain.with_name(plain.name + ZSTD)) if other.is_file()), file)
