"""Labelled recordings as crops, and what is wrong with them in one line."""

from dataclasses import replace

import numpy as np
import pytest

from modt import profile
from modt.classes import ObjectClass
from modt.errors import MisuseError
from modt.placement import LEVEL, Mount
from modt_evaluation.truth import KITTI_TYPES, FrameTruth
from modt_simulation.kitti_raw import DriveWriter
from modt_simulation.synthetic_stream import CAMERA, SyntheticStream
from modt_training.dataset import load
from modt_training.recordings import _sector, check_examples, labelled_scan, open_recordings, scans_of, write_crops


def drive(folder, seed):
    writer = DriveWriter(folder, CAMERA, all_around=True)
    for frame, truth in SyntheticStream("loading", "vlp-16", 0.3, seed).sweeps():
        writer.write(frame, truth)
    writer.close()
    return writer.drive


@pytest.fixture(name="drives", scope="module")
def two_drives(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drives")
    return [drive(folder / str(seed), seed) for seed in (1, 2)]


def test_recordings_become_crops_of_their_classes_one_fold_a_recording(tmp_path, drives):
    path = tmp_path / "crops.npz"
    done = []
    write_crops(path, open_recordings(drives, []), "vlp-16", profile.load("vlp-16"), done.append)
    data = load(path)
    check_examples(data)
    assert len(done) == len(np.unique(data.drive)) == 2
    found = set(np.unique(data.label[data.trainable]).tolist())
    assert found == {ObjectClass.BACKGROUND, ObjectClass.CAR, ObjectClass.PEDESTRIAN}
    assert data.sensor_names == ("vlp-16",)


def test_labels_may_lie_elsewhere(tmp_path, drives):
    (recording, _) = open_recordings(drives, drives[::-1])
    scan = next(scans_of(recording, 0, "vlp-16", profile.load("vlp-16")))
    assert len(scan.points)


def test_what_is_wrong_with_recordings_is_one_line(tmp_path, drives):
    with pytest.raises(MisuseError, match="makes no fold"):
        open_recordings(drives[:1], [])
    with pytest.raises(MisuseError, match="makes no fold"):
        open_recordings([drives[0], drives[0]], [])
    with pytest.raises(MisuseError, match="has no labels beside it"):
        open_recordings([drives[0], tmp_path], [])
    with pytest.raises(MisuseError, match="1 for 2 recordings"):
        open_recordings(drives, drives[:1])


def test_an_unknown_label_is_named_with_the_known_ones(tmp_path):
    drives = [drive(tmp_path / str(seed), seed) for seed in (1, 2)]
    tracklets = drives[1] / "tracklet_labels.xml"
    tracklets.write_text(tracklets.read_text().replace("Forklift", "Stapler"))
    with pytest.raises(MisuseError, match=r"'Stapler' is unknown.*Forklift"):
        open_recordings(drives, [])


def test_recordings_without_an_object_teach_nothing(tmp_path, drives):
    path = tmp_path / "crops.npz"
    write_crops(path, open_recordings(drives, []), "vlp-16", profile.load("vlp-16"), lambda words: None)
    data = load(path)
    with pytest.raises(MisuseError, match="no object"):
        check_examples(replace(data, label=np.zeros_like(data.label)))


def test_what_lies_between_the_classes_or_out_of_the_sector_is_unlabelled(rng):
    places = np.array([[10.0, 0.0], [0.0, 10.0], [10.0, 3.0]])
    points = np.concatenate([np.c_[p + rng.uniform(-0.3, 0.3, (30, 2)), rng.uniform(-1, 0, (30, 2))] for p in places])
    points = points.astype(np.float32)
    boxes = np.array([[x, y, -0.5, 1.0, 1.0, 2.0, 0.0] for x, y in places])
    truth = FrameTruth.of(KITTI_TYPES | {"Tram": (0, 1)}, [0, 1, 2], ["Pedestrian", "Car", "Tram"], boxes)
    config = profile.load("vlp-16")
    scan = labelled_scan("a", "a", points, truth, _sector(40.0), "vlp-16", config, LEVEL)
    assert scan.kinds == (ObjectClass.PEDESTRIAN, ObjectClass.CAR)
    assert scan.unlabelled.reshape(3, 30).all(axis=1).tolist() == [False, True, True]
    turned = labelled_scan("a", "a", points, truth, _sector(180.0), "vlp-16", config, Mount.of(180.0, 0.0))
    assert [len(members) for members in turned.objects] == [30, 30]  # found before the sweep is turned level
    np.testing.assert_allclose(turned.points[:, 1:3], -points[:, 1:3], atol=1e-5)
