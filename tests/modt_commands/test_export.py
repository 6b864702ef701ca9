"""`modt export`, opened by the readers of others."""

import csv
import json
import shutil
import sys

import numpy as np
import pytest
import yaml

from modt.classes import CLASS_NAMES, CLASSES, ObjectClass
from modt.sinks.tracks import SCHEMA
from modt_profiling.reporting.records import read_records
from tests.cli.commands import content, here, refusal
from tests.recorded import drive_and_run


def export(run, *arguments):
    return here("export", run, *arguments)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A run on a synthetic drive, and the drive."""
    return drive_and_run(tmp_path_factory.mktemp("recorded"), seconds=0.6)


def records(run):
    return list(read_records(run / "tracks.jsonl", SCHEMA))


def objects(record):
    return {t["id"]: t for t in record["tracks"] if t["proposal"] is not None and t["class"] != "background"}


def messages(path):
    """Topic, time [ns] and content of the messages of an MCAP file."""
    pytest.importorskip("foxglove")
    reader = pytest.importorskip("mcap.reader")
    from tests.ros2.messages import decode

    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file, validate_crcs=True).iter_messages():
            yield channel.topic.removeprefix("/modt/"), message.log_time, decode(message.data, schema.name)


def test_mcap_holds_points_tracks_and_energy_of_every_frame(recorded, tmp_path):
    run, drive = recorded
    assert export(run, "--mcap", tmp_path / "a.mcap") == 0
    found = {}
    for topic, *message in messages(tmp_path / "a.mcap"):
        found.setdefault(topic, []).append(message)
    lines = records(run)
    windows = list(read_records(run / "ledger.jsonl", "modt.energy/1", {"modt.ledger/1"}))
    assert len(found["energy/watts"]) == len(windows)
    every_frame = ("/tf", "detections", "markers", "odometry", "points", "cpu_ms/total")
    assert [len(found[topic]) for topic in every_frame] == [len(lines)] * len(every_frame)
    for (stamp_ns, shown), (_, cloud), record in zip(found["detections"], found["points"], lines, strict=True):
        assert stamp_ns == round(1e9 * record["stamp_s"])
        assert {int(found.id) for found in shown.detections} == objects(record).keys()
        scan = np.fromfile(drive / "velodyne_points" / "data" / f"{record['frame']:010d}.bin", np.float32)
        points = cloud.data.view(np.float32)
        assert (points.reshape(-1, 4)[:, :3] == scan.reshape(-1, 4)[:, :3]).all()


def test_kitti_results_equal_those_of_the_replay(recorded, tmp_path):
    run, _ = recorded
    assert export(run, "--kitti", tmp_path / "a.txt") == 0
    own, found = (
        [line.split() for line in path.read_text().splitlines()]
        for path in (run / "kitti" / "0000.txt", tmp_path / "a.txt")
    )
    assert len(found) > 10
    assert [row[:3] for row in found] == [row[:3] for row in own]
    own, found = (np.array([row[10:] for row in rows], float) for rows in (own, found))
    assert np.abs(found - own).max() < 3e-3  # what tracks.jsonl rounds


def test_semantickitti_labels_every_point_with_class_and_track(recorded, tmp_path):
    run, _ = recorded
    assert export(run, "--semantickitti", tmp_path / "predictions") == 0
    some = 0
    for record in records(run):
        name = f"{record['frame']:06d}.label"
        proposal = (np.fromfile(run / "labels" / name, np.uint32) >> 16).astype(int) - 1
        found = np.fromfile(tmp_path / "predictions" / name, np.uint32)
        expected = np.zeros(len(proposal), np.uint32)
        for id_, track in objects(record).items():
            semantic = CLASSES[ObjectClass(CLASS_NAMES.index(track["class"]))].semantic_kitti[0]
            expected[proposal == track["proposal"]] = (id_ + 1) << 16 | semantic
        assert (found == expected).all()
        some += np.count_nonzero(found)
    assert some > 100


def test_csv_has_a_row_a_track_and_frame(recorded, tmp_path):
    run, _ = recorded
    assert export(run, "--csv", tmp_path / "a.csv") == 0
    with (tmp_path / "a.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    tracks = [(record, track) for record in records(run) for track in record["tracks"]]
    assert len(rows) == len(tracks)
    assert {bool(row["box_x_m"]) for row in rows} == {False, True}
    for row, (record, track) in zip(rows, tracks, strict=True):
        assert None not in row
        assert (int(row["frame"]), float(row["stamp_s"])) == (record["frame"], record["stamp_s"])
        assert (int(row["id"]), row["class"]) == (track["id"], track["class"])
        assert [float(row[f"p_{name}"]) for name in CLASS_NAMES] == track["posterior"]
        assert float(row["world_heading_rad"]) == track["world"]["heading"]
        if track["box"]:
            assert float(row["box_yaw_rad"]) == track["box"]["yaw"]
        else:
            assert row["proposal"] == row["box_yaw_rad"] == ""


def test_parquet_is_the_table_of_csv(recorded, tmp_path):
    pytest.importorskip("pyarrow")
    from pyarrow import parquet

    run, _ = recorded
    assert export(run, "--parquet", tmp_path / "a.parquet") == 0
    table = parquet.read_table(tmp_path / "a.parquet").to_pydict()
    tracks = [track for record in records(run) for track in record["tracks"]]
    assert table["id"] == [track["id"] for track in tracks]
    assert table["box_x_m"] == [track["box"] and track["box"]["x"] for track in tracks]
    assert table["class"] == [track["class"] for track in tracks]


def test_parquet_names_the_extra_that_it_needs(recorded, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    line = refusal(capsys, "export", recorded[0], "--parquet", tmp_path / "a.parquet")
    assert "pip install '.[parquet]'" in line
    assert not list(tmp_path.iterdir())


@pytest.fixture
def copies(recorded, tmp_path):
    """Copies of the run: without its source, its labels, a whole record, and as of a service."""
    run, _ = recorded
    names = ("gone", "bare", "odd", "live")
    made = {name: shutil.copytree(run, tmp_path / "copies" / name) for name in names}
    described = content(run / "run.yaml")
    described["stream"]["path"] += "_gone"
    (made["gone"] / "run.yaml").write_text(yaml.safe_dump(described))
    described["stream"]["path"] = None
    described["service"] = True
    (made["live"] / "run.yaml").write_text(yaml.safe_dump(described))
    shutil.rmtree(made["bare"] / "labels")
    (made["odd"] / "tracks.jsonl").write_text(json.dumps({"schema": SCHEMA, "frame": 1, "tracks": [{}]}) + "\n")
    return made


def test_without_its_source_a_run_is_exported_without_points(copies, tmp_path, capsys):
    assert "give --no-points" in refusal(capsys, "export", copies["live"], "--mcap", tmp_path / "live.mcap")
    assert export(copies["gone"], "--mcap", tmp_path / "a.mcap", "--no-points", "--frames", "2:4") == 0
    found = [(topic, stamp) for topic, stamp, _ in messages(tmp_path / "a.mcap")]
    stamps = [round(1e9 * record["stamp_s"]) for record in records(copies["gone"])[2:4]]
    assert [stamp for topic, stamp in found if topic == "detections"] == stamps
    assert "points" not in dict(found)
    assert export(copies["live"], "--kitti", tmp_path / "live.txt") == 0
    assert (tmp_path / "live.txt").read_text().split()[6:10] == ["-1.00"] * 4, "no camera, no box in its image"


def test_misuse_is_one_line_with_the_remedy(recorded, copies, tmp_path, capsys):
    run, _ = recorded
    (tmp_path / "there").write_text("")
    for path, form, out, message in (
        (copies["bare"], "--semantickitti", "a", "modt replay --labels"),
        (copies["odd"], "--csv", "b", "tracks.jsonl:1: no record of a frame"),
        (copies["odd"], "--kitti", "c", "tracks.jsonl:1: no record of a frame"),
        (copies["gone"], "--kitti", "e", "no such file or directory"),
        (tmp_path, "--csv", "f", "describes no run"),
        (run, "--csv", "there", "exists already"),
    ):
        assert message in refusal(capsys, "export", path, form, tmp_path / out)
    assert "holds none of" in refusal(capsys, "export", run, "--csv", tmp_path / "g", "--frames", "100:")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copies", "there"]
    assert export(run, "--csv", run / "run.yaml" / "a.csv") == 1
    assert "cannot be written" in capsys.readouterr().err
