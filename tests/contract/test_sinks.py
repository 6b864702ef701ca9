"""Contract of every sink."""

import pytest

from modt.errors import ModtError
from modt.sinks.kitti import KittiResults
from modt.sinks.labels import PointLabels
from modt.sinks.output import LineFile
from modt.sinks.tracks import frame_line
from tests.results import CAR, result

SINKS = {
    "tracks": lambda root: LineFile(root / "tracks.jsonl", frame_line),
    "kitti": lambda root: KittiResults(root / "kitti" / "0000.txt", None),
    "labels": lambda root: PointLabels(root / "labels"),
}
FRAMES = [
    result(0, [], {}),
    result(1, [5, 4], {0: 1, 1: 2}, {1: CAR}),
    result(2, [4], {0: 1}, {1: CAR}, lost=(2,)),
    result(7, [], {}, lost=(1, 2)),
]


@pytest.fixture(params=SINKS)
def make(request):
    return SINKS[request.param]


def content(root):
    return {str(p.relative_to(root)): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


def test_a_frame_is_in_the_file_when_write_returns(make, tmp_path):
    sink = make(tmp_path)
    before = content(tmp_path)
    sink.write(FRAMES[1])
    written = content(tmp_path)
    sink.close()
    assert written != before
    assert content(tmp_path) == written


def test_the_same_frames_give_the_same_bytes(make, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        sink = make(tmp_path / name)
        for frame in FRAMES:
            sink.write(frame)
        sink.close()
    assert content(tmp_path / "a") == content(tmp_path / "b")
    assert content(tmp_path / "a")


def test_a_path_that_cannot_be_written_is_an_error(make, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(ModtError, match="cannot be written"):
        make(blocked)
