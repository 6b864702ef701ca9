"""Drives of experiments, their replays, and how these are shared."""

import pickle

import numpy as np
import pytest

from modt.app import assembly
from modt.errors import MisuseError
from modt.profile import load
from modt_evaluation.engine import Engine
from modt_evaluation.evaluation import collect
from modt_evaluation.experiments.catalogue import EXPERIMENTS, chosen
from modt_evaluation.experiments.drives import completed, kitti_drives, simulated_drives
from modt_evaluation.experiments.figures import ObjectLengths
from modt_evaluation.experiments.judged import NetworkReplay
from modt_evaluation.experiments.study import Study
from modt_evaluation.frame import JudgedFrame
from modt_evaluation.rules import KITTI_RULES
from modt_evaluation.truth import Role
from modt_simulation.synthetic_stream import SyntheticStream
from tests.recorded import written


def test_further_objects_make_another_drive_of_the_one_that_has_its_sweeps(tmp_path):
    written(tmp_path, SyntheticStream("street", "vlp-16", 0.2, seed=2))
    table = tmp_path / "further.csv"
    head = "frame,object,type,x,y,z_bottom,length,width,height,yaw"
    table.write_text(f"{head}\n0,0,Pedestrian,9,0,-1.7,0.6,0.6,1.7,0\n")
    drives = kitti_drives(tmp_path)
    whole = completed(drives, table)
    before = drives[0].labels()[0]
    after = whole.labels()[0]
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
    rows = study.rows(Engine(), lambda name: None)
    found = {row.streams: row for row in rows if row.experiment == "table3" and row.quantity == "N_go"}
    lives = {"0005, tracking 0000": 34.9, "0014, tracking 0004": 26.9, "0001": 33.1, "0059, tracking 0011": 63.3}
    assert {name: round(found[name].value, 1) for name in lives} == lives
    assert [found[name].paper for name in lives] == [34.9, 27.1, 32.4, 61.9]
    beta = [row.value for row in rows if row.streams == "0059, tracking 0011" and row.experiment == "fig8"]
    assert beta == sorted(beta, reverse=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hdl-64e", "paper"])
def test_a_replay_of_segmented_sweeps_is_judged_as_the_sweeps_are(name):
    config = load(name)
    found = NetworkReplay(config).judged(DRIVE)
    mode = assembly.MODES["accurate"]
    pipeline = assembly.pipeline(mode, config, DRIVE.fov())
    whole = collect(
        (
            JudgedFrame.of_result(pipeline.step(frame, mode.budget(config)), truth, DRIVE.fov())
            for frame, truth in DRIVE.sweeps()
        ),
        DRIVE.rules(),
    )
    np.testing.assert_array_equal(found.proposals, whole.proposals)
    for name in found.objects.dtype.names:
        assert found.objects[name].tolist() == whole.objects[name].tolist(), name
    assert len(found.calls) == whole.classified


DRIVE = simulated_drives(1, 0.6)[0]


@pytest.mark.slow
def test_the_ideal_tracker_never_breaks_a_life_that_it_follows():
    ideal = NetworkReplay(load("hdl-64e"), ideal=True).judged(DRIVE)
    found = ideal.objects[ideal.objects["outcome"] == 0]
    for id_ in np.unique(found["id"]):
        assert len(np.unique(found["track"][found["id"] == id_])) == 1
    assert ObjectLengths.of(ideal).followed.sum() > 0


def test_beyond_the_range_of_interest_there_is_nothing():
    for ideal in (True, False):
        replay = NetworkReplay(load("hdl-64e"), "conventional", ideal=ideal, range_m=20.0)
        judged = replay.judged(DRIVE)
        found = judged.proposals
        assert found["range_m"][found["label"] == 0].max() <= 25.0
        assert len(judged.calls) == judged.frames["proposals"].sum(), "tracking by detection calls every proposal"


def test_a_replay_that_experiments_share_is_made_once():
    names = ["table5", "fig14", "table6"]
    drives = simulated_drives(1, 0.4)
    apart = [Study([EXPERIMENTS[name]], drives, [()]).tasks() for name in names]
    assert [len(tasks) for tasks in apart] == [2, 2, 2]
    assert len(Study(chosen(names), drives, [()]).tasks()) == 3, "conventional, accurate and efficient"


def test_drives_and_profiles_have_tasks_of_their_own():
    study = Study(chosen(["fig11"]), simulated_drives(2, 0.4), [(), ("small-robot",)])
    assert len(study.tasks()) == 4 * len(Study(study.experiments, study.drives[:1], [()]).tasks())


class Elsewhere(Engine):
    """Other processes: tasks and results are pickled, and end in any order."""

    local = False

    def outcomes(self, function, tasks):
        for task in reversed(tasks):
            yield task, pickle.loads(pickle.dumps(function(pickle.loads(pickle.dumps(task)))))


@pytest.mark.slow
def test_other_processes_give_the_same_rows():
    done = []
    study = Study(chosen(["table5"]), simulated_drives(2, 0.2), [()])
    assert study.rows(Elsewhere(), done.append) == study.rows(Engine(), done.append)
    assert len(done) == 2 * len(study.tasks()) == 8
