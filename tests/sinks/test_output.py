"""Properties of all sinks of files."""

import os
import stat
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from modt.errors import MisuseError, ModtError
from modt.schemes import open_sink
from modt.sinks.frame_lines import RotatedFile
from modt.sinks.kitti import PointLabels
from modt.sinks.output import LineFile, close_together, replace_file


def test_sinks_that_hang_are_closed_together():
    meeting = threading.Barrier(3, timeout=60.0)

    class Hanging:
        def close(self):
            meeting.wait()

    close_together([Hanging(), Hanging(), Hanging()])
    assert not meeting.broken


@pytest.mark.parametrize("left", ["a link", "half a file"])
def test_a_file_is_replaced_whatever_was_left_in_its_place(tmp_path, left):
    victim = tmp_path / "victim"
    part = tmp_path / ".run.yaml.part"
    victim.write_text("kept")
    part.symlink_to(victim) if left == "a link" else part.write_text("half")
    replace_file(tmp_path / "run.yaml", "new", lasting=True)
    assert victim.read_text() == "kept"
    assert (tmp_path / "run.yaml").read_text() == "new"
    assert not (tmp_path / "run.yaml").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.yaml", "victim"]


@pytest.mark.parametrize(("public", "mode"), [(False, 0o640), (True, 0o644)])
def test_a_public_file_is_readable_whatever_the_umask(tmp_path, public, mode):
    before = os.umask(0o027)
    try:
        replace_file(tmp_path / "modt.prom", "1", public=public)
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "modt.prom").stat().st_mode) == mode


@pytest.mark.parametrize("rotated", [lambda path: path.rename(f"{path}.1"), lambda path: path.unlink()])
def test_a_rotated_file_begins_anew_under_its_name(tmp_path, rotated):
    path = tmp_path / "tracks.log"
    lines = RotatedFile(path, mode="ab")
    lines.write("a\n")
    rotated(path)
    lines.write("b\n")
    assert path.read_text() == "b\n"
    os.truncate(path, 0)  # copytruncate
    lines.write("c\n")
    assert path.read_text() == "c\n"
    lines.close()


def test_no_output_follows_a_link_that_somebody_put_in_its_place(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("kept\n")
    link = tmp_path / "tracks.log"
    lines = RotatedFile(link, mode="ab")
    link.unlink()
    link.symlink_to(victim)
    with pytest.raises(ModtError, match="cannot be written"):
        lines.write("a\n")
    lines.close()
    with pytest.raises(ModtError, match="cannot be written"):
        LineFile(link)
    with pytest.raises(MisuseError, match="is a symbolic link"):
        open_sink(f"file://{link}")
    labels = PointLabels(tmp_path)
    (tmp_path / "000003.label").symlink_to(victim)
    result = SimpleNamespace(frame=SimpleNamespace(index=3))
    monkeypatch.setattr("modt.sinks.kitti.encode", lambda _: np.zeros(3, np.uint32))
    with pytest.raises(ModtError, match="cannot be written"):
        labels.write(result)
    assert victim.read_text() == "kept\n"
