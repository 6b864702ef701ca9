from __future__ import annotations

import numpy as np
import pytest

from modt.app import assembly
from modt.energy.ledger import NullLedger
from modt.profile import load
from modt.segmentation.kernels import NUMPY
from modt_desk.evaluation.evaluation import collect
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.experiments.replays import NetworkReplay
from modt_desk.experiments.segmented import segmented
from modt_desk.experiments.store import Store
from tests.desk.experiments.drives import short_drives

DRIVE = short_drives(1)[0]


def test_a_stored_drive_is_the_one_that_was_segmented(tmp_path):
    store, config = Store(tmp_path), load("hdl-64e")
    first = segmented(DRIVE, DRIVE.digest(), config, store)
    stored = next(tmp_path.rglob("*.npz"))
    assert stored.stat().st_size > 0
    segmenter = assembly.segmenter(config, DRIVE.fov(), NUMPY)
    for made, (frame, truth) in zip(first.frames, DRIVE.sweeps(), strict=True):
        whole = segmenter.segment(frame.points)
        np.testing.assert_array_equal(made.proposals.coordinates, whole.coordinates)
        np.testing.assert_array_equal(made.proposals.box, whole.box)
        np.testing.assert_array_equal(made.truth.box, truth.box)
        assert made.truth.type_ == truth.type_
        assert len(made.frame.points) < len(frame.points)


@pytest.mark.parametrize("name", ["hdl-64e", "paper"])
def test_a_replay_of_the_points_that_matter_is_judged_as_the_whole_sweeps_are(name, tmp_path):
    config = load(name)
    found = NetworkReplay(config).judged(DRIVE, DRIVE.digest(), Store(tmp_path))
    mode = assembly.MODES["accurate"]
    pipeline = assembly.pipeline(mode, config, DRIVE.fov(), NullLedger())
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


def test_what_is_broken_in_the_store_is_made_again(tmp_path):
    store, config = Store(tmp_path), load("hdl-64e")
    replay = NetworkReplay(config, ideal=True)
    before = replay.judged(DRIVE, DRIVE.digest(), store)
    for path in tmp_path.rglob("*.npz"):
        path.write_bytes(path.read_bytes()[:100])
    after = replay.judged(DRIVE, DRIVE.digest(), store)
    np.testing.assert_array_equal(before.proposals, after.proposals)
