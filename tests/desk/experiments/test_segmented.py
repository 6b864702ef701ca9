import numpy as np
import pytest

from modt.app import assembly
from modt.profile import load
from modt_desk.evaluation.evaluation import collect
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.experiments.drives import simulated_drives
from modt_desk.experiments.figures import ObjectLengths
from modt_desk.experiments.judged import NetworkReplay


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hdl-64e", "paper"])
def test_a_replay_of_the_points_that_matter_is_judged_as_the_whole_sweeps_are(name):
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
