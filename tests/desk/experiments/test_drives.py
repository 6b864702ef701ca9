import pytest

from modt.errors import MisuseError
from modt_desk.evaluation.rules import KITTI_RULES
from modt_desk.evaluation.truth import Role
from modt_desk.experiments.catalogue import chosen
from modt_desk.experiments.drives import completed, kitti_drives
from modt_desk.experiments.study import Study
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.desk.recorded import written


def test_further_objects_make_another_drive_of_the_one_that_has_its_sweeps(tmp_path):
    written(tmp_path, SyntheticStream("street", "vlp-16", 0.2, seed=2))
    table = tmp_path / "further.csv"
    head = "frame,object,type,x,y,z_bottom,length,width,height,yaw"
    table.write_text(f"{head}\n0,0,Pedestrian,9,0,-1.7,0.6,0.6,1.7,0\n")
    drives = kitti_drives(tmp_path)
    whole = completed(drives, table)
    before, after = drives[0].labels()[0], whole.labels()[0]
    added = after.role == Role.FURTHER
    assert added.sum() == 1
    assert [frame.index for frame, _ in whole.sweeps()] == [0, 1]
    assert (whole.fov().full, whole.rules()) == (False, KITTI_RULES)
    assert not set(after.id[added]) & set(before.id), "its number may be that of a label"
    streams = {name for name, _ in Study([], [*drives, whole], [()])._streams(chosen(["table4"])[0])}
    assert streams == {drives[0].name, whole.name}
    with pytest.raises(MisuseError, match="2 have their sweeps"):
        completed([*drives, *drives], table)
    (tmp_path / "empty").mkdir()
    with pytest.raises(MisuseError, match="no labelled KITTI drives"):
        kitti_drives(tmp_path / "empty")


@pytest.mark.kitti
def test_the_labels_give_table_iii(kitti_root):
    drives = kitti_drives(kitti_root)
    assert [drive.name for drive in drives if drive.scans] == ["0005"], "only those with their sweeps are replayed"
    study = Study(chosen(["table3", "fig8"]), drives, [()])
    rows = study.rows(1, lambda name: None)
    found = {row.streams: row for row in rows if row.experiment == "table3" and row.quantity == "N_go"}
    lives = {"0005, tracking 0000": 34.9, "0014, tracking 0004": 26.9, "0001": 33.1, "0059, tracking 0011": 63.3}
    assert {name: round(found[name].value, 1) for name in lives} == lives
    assert [found[name].paper for name in lives] == [34.9, 27.1, 32.4, 61.9]
    beta = [row.value for row in rows if row.streams == "0059, tracking 0011" and row.experiment == "fig8"]
    assert beta == sorted(beta, reverse=True)
