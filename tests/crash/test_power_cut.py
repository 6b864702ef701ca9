"""A power cut at any moment keeps the synced records; a restart works and keeps to its limit."""

import os
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from tests.results import ledger_line
from tests.sinks.recordings import begun, frame, frames, parts

FRAMES = 50
A_SECOND = 5


@dataclass(frozen=True)
class State:
    """Inodes by number: the names in folders, and the bytes of files."""

    folders: dict[int, dict[str, int]]
    files: dict[int, bytes]

    def write(self, root: int, target: Path) -> None:
        """Write the state below a folder. A file whose content never reached the disk is empty."""
        target.mkdir()
        for name, number in self.folders.get(root, {}).items():
            if number in self.folders:
                self.write(number, target / name)
            else:
                (target / name).write_bytes(self.files.get(number, b""))


class PowerCuts:
    """Watches a folder, and keeps the states that a power cut could leave after every call that changes or syncs it.

    Attributes:
        cuts: the states, each by what the disk did with what was not synced (lost all, kept the names, kept all), and
            with what was safe then.
        safe: number of items that must be there from now on; the test sets it.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.cuts = list[tuple[str, State, int]]()
        self.safe = 0
        self._durable = self._live()

    def note(self) -> None:
        """Keep the states that a power cut could leave now."""
        live = self._live()
        durable = self._durable
        synced = dict(durable.files)
        lost = State({**{number: {} for number in live.folders}, **durable.folders}, synced)
        states = {"lost": lost, "named": State(live.folders, synced), "kept": live}
        cuts = [(kind, state, self.safe) for kind, state in states.items()]
        self.cuts += [cut for cut in cuts if cut not in self.cuts[-len(cuts) :]]

    @contextmanager
    def watch(self) -> Any:
        """Context in which calls of `os` are watched."""
        names = ("fsync", "rename", "replace", "mkdir", "unlink", "rmdir")
        with patch.multiple(os, **{name: self._watched(getattr(os, name)) for name in names}):
            yield

    def _watched(self, call: Any) -> Any:
        def watched(*arguments: Any, **options: Any) -> Any:
            self.note()
            result = call(*arguments, **options)
            if call.__name__ == "fsync":
                number = os.fstat(arguments[0]).st_ino
                live = self._live()
                if number in live.folders:
                    self._durable.folders[number] = live.folders[number]
                else:
                    self._durable.files[number] = live.files[number]
            self.note()
            return result

        return watched

    def _live(self) -> State:
        folders = {}
        files = {}
        for folder, names, found in os.walk(self.root):
            here = Path(folder)
            folders[here.stat().st_ino] = {name: (here / name).stat().st_ino for name in (*names, *found)}
            files.update({(here / name).stat().st_ino: (here / name).read_bytes() for name in found})
        return State(folders, files)


@pytest.fixture(name="disk", scope="module")
def disks(tmp_path_factory):
    """A service that ran for some seconds, was started again, and began new parts on the way."""
    disk = PowerCuts(tmp_path_factory.mktemp("disk"))
    with disk.watch():
        for start in (0, FRAMES // 2):
            recording = begun(disk.root, disk_mb=1.0)
            for k in range(start, start + FRAMES // 2):
                if k % 12 == 11:
                    recording._bytes = 1_000_000  # the part is full
                recording.write(frame(k))
                recording.ledger(ledger_line(k))
                if k % A_SECOND == A_SECOND - 1:
                    recording.sync()
                    disk.safe = k + 1
                disk.note()
            recording.finish()
    return disk


@pytest.mark.parametrize("kind", ["lost", "named", "kept"])
def test_synced_records_survive_and_a_restart_works(disk, kind, tmp_path):
    cuts = [(state, safe) for of, state, safe in disk.cuts if of == kind]
    assert len(cuts) > 20
    for number, (state, safe) in enumerate(cuts):
        folder = tmp_path / str(number)
        state.write(disk.root.stat().st_ino, folder)
        whole = frames(folder)
        assert whole == list(range(len(whole)))
        assert len(whole) >= safe
        recording = begun(folder, disk_mb=1.0)
        recording.write(frame(1000))
        recording.finish()
        assert recording.health().failing is None
        assert frames(folder)[-1] == 1000
        assert frames(folder)[:-1] == whole
        assert recording.directory.kept() == parts(folder)[:-1]  # all are known as its own, and will be trimmed
