"""Full, read-only, removed and unmounted disks: each lost line is counted."""

import json
import shutil
import subprocess
from contextlib import suppress

import pytest

from modt.app.status import SCHEMA as STATUS_SCHEMA
from modt.cli.status import read
from modt.sinks.recording import RETRY_S
from modt.sinks.run_directory import status_paths
from tests.sinks.recordings import OURS, Time, begun, frame, frames


@pytest.fixture(autouse=True)
def memory(tmp_path, monkeypatch):
    """A folder instead of the one in memory."""
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
    """A recording of ten frames a second, and the frames that it lost."""

    def __init__(self, folder):
        self.time = Time()
        self.n = 0
        self.path = folder / "run"
        self.recording = begun(folder, time=self.time, disk_mb=10.0, keep="tracks")

    def run(self, frames):
        for _ in range(frames):
            self.time.now += 0.1
            self.recording.write(frame(self.n))
            self.n += 1
            if self.n % 10 == 0:
                status = json.dumps({"schema": STATUS_SCHEMA, "frames": self.n})
                self.recording.write_status(status)
                self.recording.keep_status(status)

    def lost(self):
        kept = frames(self.path.parent)
        assert len(kept) == len({*kept})
        assert self.recording.health().lost_lines == self.n - len(kept)
        return sorted({*range(self.n)} - {*kept})


def test_removed_records_are_begun_anew_within_a_second_and_their_lines_counted(tmp_path):
    service = Service(tmp_path)
    service.run(35)
    shutil.rmtree(service.path)
    service.run(35)
    for name in ("tracks.jsonl", "run.yaml"):
        (service.path / name).unlink()
        service.run(35)
    service.path.rename(tmp_path / "run~0")
    service.run(35)
    service.recording.finish()
    lost = service.lost()
    assert (service.path / "run.yaml").read_text() == OURS
    assert service.recording.health().failing is None
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
    assert "is not mounted" in service.recording.health().failing
    assert not [*disk.iterdir()]
    mount("--bind", other, disk)
    subprocess.run(["umount", other], check=True)
    back = service.n
    service.run(25)
    service.recording.finish()
    assert max(service.lost(), default=0) <= back + RETRY_S / 0.1 + 10


@pytest.mark.parametrize("fault", ["full", "read-only", "full at start", "removed folder"])
def test_the_status_stays_readable_and_the_lines_meanwhile_are_lost(disk, fault):
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
        assert service.recording.health().failing
        assert read(service.path)["frames"] == service.n
        mount("-o", "remount,rw", disk)
        for name in ("others", "more"):
            (disk / name).unlink(missing_ok=True)
        if service.path.is_file():
            service.path.unlink()
        back = service.n
        service.run(20)
        assert service.recording.health().failing is None
        assert read(service.path)["frames"] == service.n
        service.recording.finish()
    lost = service.lost()
    assert lost == list(range(lost[0], lost[-1] + 1))
    assert back - 1 <= lost[-1] <= back + RETRY_S / 0.1
    assert not status_paths(service.path)[1].exists()
