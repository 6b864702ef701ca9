"""Tracks that move like road users and have no label."""

import csv
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from modt_evaluation.unlabelled import moving
from tests.cli.commands import here
from tests.recorded import drive_and_run

STAMPS_S = np.arange(30) / 10
RNG = np.random.default_rng(3)


def boxes(x, length=0.6, scatter_m=0.02):
    """(30, 7) boxes along x, seen with some scatter."""
    out = np.tile([0.0, 5.0, 1.0, 0.0, 0.5, 1.7, 0.0], (len(STAMPS_S), 1))
    out[:, 0] = x
    out[:, 3] = length
    out[:, :2] += RNG.normal(0, scatter_m, (len(out), 2))
    return out


WALKER = boxes(1.3 * STAMPS_S)


@pytest.mark.parametrize(
    ("name", "world", "moves"),
    [
        ("walker", WALKER, True),
        ("car", boxes(8 * STAMPS_S, 4.0, 0.1), True),
        ("post, beside a drifting pose", boxes(0.3 * STAMPS_S), False),
        ("wall of which more and more is seen", boxes(2 * STAMPS_S, 1 + 4 * STAMPS_S), False),
        ("parts of a wall in turn", boxes(3 * np.floor(STAMPS_S)), False),
        ("what is scattered", boxes(0 * STAMPS_S, scatter_m=1.0), False),
    ],
)
def test_tracks_that_move_like_road_users(name, world, moves):
    assert moving(STAMPS_S, world).all() == moves == moving(STAMPS_S, world).any(), name


def test_the_frames_of_the_motion_are_found():
    begins = moving(STAMPS_S, boxes(4 * np.maximum(STAMPS_S - 1, 0), scatter_m=0.0))
    assert not begins[:5].any()
    assert begins[12:].all()
    quick = slice(8)  # a track shorter than the window is judged as a whole
    assert moving(STAMPS_S[quick], boxes(5 * STAMPS_S)[quick]).all()
    assert not moving(STAMPS_S[:4], boxes(5 * STAMPS_S)[:4]).any()


@pytest.mark.command
def test_a_label_that_is_left_out_is_found_and_put_back(tmp_path, capsys):
    def listed(folder, *options):
        assert here("evaluate", run, drive, *options, "--unlabelled", tmp_path / folder) == 0
        path = tmp_path / folder / "further.csv"
        return list(csv.DictReader(path.read_text().splitlines())) if path.exists() else []

    run, drive = drive_and_run(tmp_path, seconds=2.5, options=("--all-around",))
    before = {row["object"] for row in listed("before")}
    labels = ET.parse(drive / "tracklet_labels.xml")
    tracklets = labels.find("tracklets")
    removed = next(item for item in tracklets.iter("item") if _walks_near(item))
    tracklets.remove(removed)
    labels.write(drive / "tracklet_labels.xml")
    rows = [row for row in listed("after") if row["object"] not in before]
    ((track, type_),) = {(row["object"], row["type"]) for row in rows}
    assert type_ == "Pedestrian"
    begin = int(removed.findtext("first_frame"))
    poses = removed.findall("poses/item")
    for row in rows:
        pose = poses[int(row["frame"]) - begin]
        off = [float(row[axis]) - float(pose.findtext(f"t{axis}")) for axis in "xy"]
        assert np.hypot(*off) < 0.4
    page = (tmp_path / "after" / "tracks.html").read_text()
    assert f"Track {track}<" in page
    assert page.count("from the side") >= len(rows) / 3
    further = ("--further", tmp_path / "after" / "further.csv")
    assert here("evaluate", run, drive, *further) == 0
    assert f"--further adds {len(before) + 1} objects" in capsys.readouterr().out
    assert listed("completed", *further) == []


def _walks_near(item):
    """Whether a tracklet is of somebody who walks within 20 m in all frames."""
    places = np.array([[float(pose.findtext(f"t{axis}")) for axis in "xy"] for pose in item.iterfind("poses/item")])
    return len(places) == 25 and item.findtext("objectType") == "Pedestrian" and (np.hypot(*places.T) < 20).all()
