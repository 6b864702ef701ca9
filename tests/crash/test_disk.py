"""Full and read-only disks, and descriptors used up, as the system itself has them: lines are lost and counted."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
from contextlib import contextmanager, suppress

import pytest

from modt.app.status import SCHEMA as STATUS_SCHEMA
from modt.cli.status import read
from modt.config import RecordingConfig
from modt.sinks.recording import RETRY_S, AtOnce, Recording
from modt.sinks.run_directory import RunDirectory, status_paths
from modt.sinks.tracks import SCHEMA
from modt_desk.reporting.records import read_records
from tests.crash.test_power_cut import OURS
from tests.results import CAR, result
from tests.sinks.test_recording import Time


@pytest.fixture(autouse=True)
def memory(tmp_path, monkeypatch):
    """A folder in the place of that in memory."""
    (tmp_path / "memory").mkdir()
    monkeypatch.setattr("modt.sinks.run_directory.MEMORY", tmp_path / "memory")


def mount(*arguments):
    done = subprocess.run(["mount", *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"nothing can be mounted here: {done.stderr.strip()}")


@pytest.fixture(name="disk")
def disks(tmp_path):
    """A disk of 256 KiB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount("-t", "tmpfs", "-o", "size=256k", "tmpfs", folder)
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)


class Service:
    """A recording of ten frames a second, and what became of them."""

    def __init__(self, folder):
        self.time, self.n = Time(), 0
        self.path = folder / "run"
        config = RecordingConfig(disk_mb=10.0, keep="tracks")
        self.recording = Recording(RunDirectory(self.path), config, AtOnce(), lambda: OURS, self.time)
        self.recording.start()

    def run(self, frames):
        for _ in range(frames):
            self.time.now += 0.1
            self.recording.write(result(self.n, [5, 4], {0: 1, 1: 2}, {1: CAR}))
            self.n += 1
            if self.n % 10 == 0:
                self.recording.state(json.dumps({"schema": STATUS_SCHEMA, "frames": self.n}))

    def lost(self):
        parts = sorted(
            self.path.parent.glob("run*/tracks.jsonl"), key=lambda part: part.parent.name.replace("~", " ")
        )
        kept = [record["frame"] for part in parts for record in read_records(part, SCHEMA)]
        assert len(kept) == len({*kept})
        assert self.recording.health()["lost_lines"] == self.n - len(kept)
        return sorted({*range(self.n)} - {*kept})


def test_a_disk_that_becomes_read_only_costs_the_lines_meanwhile(disk):
    service = Service(disk)
    mount("-o", "remount,ro", disk)
    service.run(50)
    assert "Read-only" in service.recording.health()["failing"]
    mount("-o", "remount,rw", disk)
    service.run(50)
    service.recording.finish()
    lost = service.lost()
    assert lost == list(range(len(lost)))
    assert 50 <= len(lost) <= 51 + RETRY_S / 0.1


def test_removed_records_are_begun_anew_within_a_second_and_their_lines_counted(tmp_path):
    service = Service(tmp_path)
    service.run(35)
    shutil.rmtree(service.path)
    service.run(35)
    for name in ("tracks.jsonl", "run.yaml"):
        (service.path / name).unlink()
        service.run(35)
    service.path.rename(tmp_path / "run-moved")
    service.run(35)
    service.recording.finish()
    lost = service.lost()
    assert (service.path / "run.yaml").read_text() == OURS
    assert service.recording.health()["failing"] is None
    assert all(n in lost for n in range(70))
    assert not any(n in lost for n in range(90, 175))


@pytest.mark.parametrize("seconds", [0, 5])
def test_a_disk_that_is_unmounted_costs_the_lines_meanwhile_and_nothing_is_written_below_it(disk, seconds, tmp_path):
    service = Service(disk)
    service.run(25)
    other = tmp_path / "other"
    other.mkdir()
    mount("--bind", disk, other)
    subprocess.run(["umount", "--lazy", disk], check=True)
    service.run(15 + 10 * seconds)
    assert "is not mounted" in service.recording.health()["failing"]
    assert not [*disk.iterdir()]
    mount("--bind", other, disk)
    subprocess.run(["umount", other], check=True)
    back = service.n
    service.run(25)
    service.recording.finish()
    assert max(service.lost(), default=0) <= back + RETRY_S / 0.1 + 10


@pytest.mark.parametrize("fault", ["full", "read-only", "full at start", "removed folder"])
def test_the_status_stays_readable(disk, fault):
    def fail():
        if fault == "read-only":
            mount("-o", "remount,ro", disk)
        elif fault == "removed folder":
            shutil.rmtree(disk / "run")
            (disk / "run").write_text("")
        else:
            (disk / "others").write_bytes(bytes(140_000))
            with suppress(OSError):
                (disk / "more").write_bytes(bytes(300_000))

    if fault == "full at start":
        fail()
    service = Service(disk)
    with service.recording.directory.locked():
        if fault != "read-only":  # a disk with open files cannot be made so
            service.run(10)
        if fault != "full at start":
            fail()
        service.run(500)
        assert service.recording.health()["failing"]
        assert read(service.path)["frames"] == service.n
        mount("-o", "remount,rw", disk)
        for name in ("others", "more"):
            (disk / name).unlink(missing_ok=True)
        if service.path.is_file():
            service.path.unlink()
        service.run(20)
        assert service.recording.health()["failing"] is None
        assert read(service.path)["frames"] == service.n
        service.recording.finish()
    assert not status_paths(service.path)[1].exists()


@contextmanager
def no_more_descriptors():
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    taken = [os.open(os.devnull, os.O_RDONLY)]
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(map(int, os.listdir("/proc/self/fd"))) + 1, hard))
    with suppress(OSError):
        while True:  # until the gaps below the limit are filled
            taken.append(os.dup(taken[0]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        for number in taken:
            os.close(number)


def test_without_descriptors_open_files_go_on_and_a_new_part_waits(tmp_path):
    service = Service(tmp_path)
    service.run(20)
    with no_more_descriptors():
        service.run(20)
        assert service.recording.health()["lost_lines"] == 0
        service.recording._bytes = 100_000_000  # the part is full
        service.run(20)
        assert "Too many open files" in service.recording.health()["failing"]
    service.run(40)
    service.recording.finish()
    assert 20 <= service.recording.health()["lost_lines"] <= 20 + RETRY_S / 0.1
    kept = [r["frame"] for p in ("run~1", "run") for r in read_records(tmp_path / p / "tracks.jsonl", SCHEMA)]
    assert kept[:40] == list(range(40))
    assert kept[-1] == 99
