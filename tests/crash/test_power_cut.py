"""After a power cut at any moment: what was synced is there, and a restart works and keeps to its limit."""

import pytest

from tests.crash.power_cut import PowerCuts
from tests.sinks.recordings import begun, frame, frames, parts

FRAMES, A_SECOND = 50, 5


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
                recording.ledger({"schema": "modt.ledger/1", "frame": k})
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
        state.write(disk.number, folder)
        whole = frames(folder)
        assert whole == list(range(len(whole)))
        assert len(whole) >= safe
        recording = begun(folder, disk_mb=1.0)
        recording.write(frame(1000))
        recording.finish()
        assert recording.cause is None
        assert frames(folder)[-1] == 1000
        assert frames(folder)[:-1] == whole
        assert recording.directory.kept() == parts(folder)[:-1]  # all are known as its own, and will be trimmed
