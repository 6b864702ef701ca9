"""Order and times of scans by their names."""

import os
import random
import socket
from datetime import datetime, timezone

import pytest

from modt.errors import MisuseError
from modt.sources.file_names import times_ns
from modt.sources.recognise import open_stream
from tests.sources import layouts
from tests.sources.point_clouds import pcd, ply, table

ROWS = table(x="f4", y="f4", z="f4", i="u1")
CONTENTS = {".bin": layouts.scan(0).tobytes(), ".pcd": pcd(ROWS), ".ply": ply(ROWS)}
BEGAN_NS = 1_673_400_472_038_016_708


def folder_of(root, names, suffix):
    folder = root / "scans"
    folder.mkdir()
    for name in random.Random(1).sample(names, len(names)):
        (folder / f"{name}{suffix}").write_bytes(CONTENTS[suffix])
    return folder


@pytest.mark.parametrize("suffix", CONTENTS)
@pytest.mark.parametrize("form", ["{}", "scan{}_raw", "{:06d}", "2_{}"])
def test_numbers_are_played_in_their_order(tmp_path, form, suffix):
    names = [form.format(k) for k in range(12)]
    stream = open_stream(folder_of(tmp_path, names, suffix), period_s=0.05)
    assert [scan.path.name for scan in stream.scans] == [f"{name}{suffix}" for name in names]
    assert [frame.index for frame in stream] == list(range(12))
    assert [frame.stamp_s for frame in stream] == pytest.approx([0.05 * k for k in range(12)])
    assert any("0.05 s apart in the order of their names" in note for note in stream.info.notes)


FORMS = {
    "seconds": lambda t: str(t // 10**9),
    "sec.nsec": lambda t: f"{t // 10**9}.{t % 10**9:09d}",
    "sec_nsec": lambda t: f"{t // 10**9}_{t % 10**9:09d}",
    "sec_nsec without zeros": lambda t: f"{t // 10**9}_{t % 10**9}",
    "sec-usec without zeros": lambda t: f"{t // 10**9}-{t % 10**9 // 1000}",
    "nanoseconds": str,
    "milliseconds": lambda t: str(t // 10**6),
    "prefix and suffix": lambda t: f"cloud_{t}_lidar_top",
    "since the begin": lambda t: f"{(t - BEGAN_NS) // 10**9}.{(t - BEGAN_NS) % 10**9 // 10**6:03d}",
}
CALENDARS = ("%Y-%m-%dT%H:%M:%S.%fZ", "%Y%m%d_%H%M%S_%f", "%Y%m%d%H%M%S%f", "lidar-%Y.%m.%d-%H.%M.%S.%f")


def calendar(form):
    def name(t):
        return datetime.fromtimestamp(t // 10**9, timezone.utc).replace(microsecond=t % 10**9 // 1000).strftime(form)

    return name


FORMS |= {form: calendar(form) for form in CALENDARS}


@pytest.mark.parametrize("form", FORMS)
def test_times_are_stamps(tmp_path, form):
    step_ns = 10**9 if form == "seconds" else 10**8
    names = [FORMS[form](BEGAN_NS + k * step_ns) for k in (*range(12), 20)]
    stream = open_stream(folder_of(tmp_path, names, ".bin"))
    assert [scan.path.stem for scan in stream.scans] == names
    assert [frame.index for frame in stream] == list(range(13))
    wanted = [k * step_ns * 1e-9 for k in (*range(12), 20)]
    assert [frame.stamp_s for frame in stream] == pytest.approx(wanted, abs=1e-3)
    assert any("stamped by their names" in note for note in stream.info.notes)


@pytest.mark.parametrize(
    "names", [["a", "b"], ["1", "2"], ["0.1", "0.10"], ["2011-09-26-13-02-61"] * 2, ["²", "³"], []]
)
def test_names_without_a_time_give_none(names):
    assert times_ns(names) is None


@pytest.mark.parametrize("names", [["²", "³"], ["1", "01"], ["0", "9999999999"], ["9" * 30, "1" * 60]])
def test_odd_numbers_end_nothing(tmp_path, names):
    stream = open_stream(folder_of(tmp_path, names, ".bin"))
    assert len({frame.index for frame in stream}) == 2


def test_only_regular_files_are_scans(tmp_path):
    folder = folder_of(tmp_path, [], ".bin")
    os.mkfifo(folder / "2.bin")
    (folder / "3.bin").mkdir()
    (folder / "4.bin").symlink_to("/dev/zero")
    (folder / "._1.bin").write_bytes(b"of another system")
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(folder / "6.bin"))
        with pytest.raises(MisuseError, match="no stream of scans"):
            open_stream(folder)
        (folder / "1.bin").write_bytes(CONTENTS[".bin"])
        (folder / "5.bin").symlink_to(folder / "1.bin")
        assert [scan.path.name for scan in open_stream(folder).scans] == ["1.bin", "5.bin"]


def test_the_date_of_the_log_does_not_hide_the_times_of_its_sweeps():
    log = "n008-2018-08-01-15-16-36-0400__LIDAR_TOP__"
    stamps_us = [1_533_151_603_547_590, 1_533_151_603_597_900]
    assert times_ns([f"{log}{stamp_us}.pcd" for stamp_us in stamps_us]) == [1000 * stamp_us for stamp_us in stamps_us]
