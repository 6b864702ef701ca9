from __future__ import annotations

import pytest

from modt.errors import MisuseError
from modt_desk.experiments.catalogue import chosen
from modt_desk.experiments.drives import kitti_drives
from modt_desk.experiments.study import Study


def test_a_folder_without_labels_is_refused(tmp_path):
    with pytest.raises(MisuseError, match="no labelled KITTI drives"):
        kitti_drives(tmp_path)


@pytest.mark.kitti
def test_the_labels_give_table_iii(kitti_root):
    study = Study(chosen(["table3", "fig8"]), kitti_drives(kitti_root), [()])
    rows = study.rows(1, lambda name: None)
    found = {row.streams: row for row in rows if row.experiment == "table3" and row.quantity == "N_go"}
    lives = {"0005, tracking 0000": 34.9, "0014, tracking 0004": 26.9, "0001": 33.1, "0059, tracking 0011": 63.3}
    assert {name: round(found[name].value, 1) for name in lives} == lives
    assert [found[name].paper for name in lives] == [34.9, 27.1, 32.4, 61.9]
    beta = [row.value for row in rows if row.streams == "0059, tracking 0011" and row.experiment == "fig8"]
    assert beta == sorted(beta, reverse=True)


@pytest.mark.kitti
def test_only_drives_with_their_sweeps_are_replayed(kitti_root):
    assert [drive.name for drive in kitti_drives(kitti_root) if drive.scans] == ["0005"]
