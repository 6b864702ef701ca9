"""Contract of every sink."""

import socket
import threading

import pytest

from modt.energy.ledger import StageWork
from modt.errors import ModtError
from modt.schemes import SINKS, open_sink
from modt.sinks.kitti import KittiResults, PointLabels
from modt.sinks.output import LedgerSink, LineFile
from modt.sinks.tracks import frame_line
from tests.results import CAR, TWO, ledger_line, result

FILES = {
    "tracks": lambda root: LineFile(root / "tracks.jsonl", frame_line),
    "kitti": lambda root: KittiResults(root / "kitti" / "0000.txt", None),
    "labels": lambda root: PointLabels(root / "labels"),
}
"""Sinks of a run directory, whose files hold a frame when write returns."""
ADDRESSES = {
    "file": lambda root: open_sink(f"file://{root}/lines.jsonl"),
    "mcap": lambda root: open_sink(f"mcap://{root}/run.mcap"),
    "unix": lambda root: open_sink(f"unix://{root}/lines.sock"),
    "udp": lambda root: open_sink("udp://127.0.0.1:9"),
    "foxglove": lambda root: open_sink("foxglove://:0"),
    "view": lambda root: open_sink("view://:0"),
}
"""Sinks by their addresses, where nobody reads."""
EXTRAS = {"mcap": "foxglove", "foxglove": "foxglove"}
FRAMES = [
    result(0, [], {}),
    result(1, *TWO),
    result(2, [4], {0: 1}, {1: CAR}, lost=(2,)),
    result(7, [], {}, lost=(1, 2)),
]
LEDGER = ledger_line(1, 10, sink=StageWork(cpu_ns=10))


def opened(kind, root):
    if kind in EXTRAS:
        pytest.importorskip(EXTRAS[kind])
    return {**FILES, **ADDRESSES}[kind](root)


def content(root):
    return {str(p.relative_to(root)): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


@pytest.mark.parametrize("kind", FILES)
def test_a_frame_is_in_the_file_when_write_returns(kind, tmp_path):
    sink = FILES[kind](tmp_path)
    before = content(tmp_path)
    sink.write(FRAMES[1])
    written = content(tmp_path)
    sink.close()
    assert written != before
    assert content(tmp_path) == written


@pytest.mark.parametrize("kind", [*FILES, "file", "mcap"])
def test_the_same_frames_give_the_same_bytes(kind, tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        sink = opened(kind, tmp_path / name)
        for frame in FRAMES:
            sink.write(frame)
        sink.close()
    assert content(tmp_path / "a") == content(tmp_path / "b")
    assert content(tmp_path / "a")


@pytest.mark.parametrize("kind", [*FILES, "file", "mcap"])
def test_a_path_that_cannot_be_written_is_an_error(kind, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.write_text("")
    with pytest.raises(ModtError, match="cannot be written"):
        opened(kind, blocked)


@pytest.mark.parametrize("kind", ADDRESSES)
def test_its_health_accounts_for_every_frame(kind, tmp_path):
    sink = opened(kind, tmp_path)
    for frame in FRAMES[1:3]:
        sink.write(frame)
    sink.close()
    health = sink.health()
    assert all(isinstance(value, int | str) for value in health.values())
    assert health["written"] + health.get("failed", 0) + health.get("dropped", 0) == 2
    assert health["written"] == (0 if kind == "unix" else 2)


@pytest.mark.parametrize("kind", ADDRESSES)
def test_nobody_who_reads_and_the_lines_of_the_ledger_hold_nothing_up(kind, tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as stalled:
        stalled.bind(str(tmp_path / "lines.sock"))
        sink = opened(kind, tmp_path)

        def use():
            for frame in FRAMES * 100:
                sink.write(frame)
                if isinstance(sink, LedgerSink):
                    sink.ledger(LEDGER)
            sink.close()

        user = threading.Thread(target=use, daemon=True)
        user.start()
        user.join(60)
        assert not user.is_alive()


def test_every_scheme_has_its_contract_tested():
    other_tests = {"stdout", "ros2"}  # test_frame_lines.py, and beside its sink
    assert ADDRESSES.keys() | other_tests == SINKS.keys()
