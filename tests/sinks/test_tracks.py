"""tracks.jsonl."""

from modt.sinks.records import read_records
from modt.sinks.tracks import SCHEMA, TrackLines, frame_record

from ..results import CAR, result


def test_a_record_holds_what_the_format_says():
    record = frame_record(result(3, [7, 5], {0: 11, 1: 12}, {11: CAR}, lost=(9,), classified=2))
    assert record["schema"] == SCHEMA
    assert (record["frame"], record["stamp_s"], record["proposals"]) == (3, 0.3, 2)
    assert (record["classified"], record["deferred"]) == (2, 0)
    seen, unsure, lost = record["tracks"]
    assert seen == {
        "id": 11,
        "state": "tracked",
        "class": "car",
        "posterior": CAR,
        "fixed": False,
        "proposal": 0,
        "points": 0,
        "age": 0,
        "missed": 0,
        "box": {"x": 10.0, "y": 0.0, "z": -1.0, "l": 4.0, "w": 2.0, "h": 1.5, "yaw": 0.0},
        "world": {"x": 0.0, "y": 0.0, "heading": 0.0, "speed_mps": 0.0},
    }
    assert unsure["class"] == "background"
    assert unsure["posterior"] == [0.25] * 4
    assert (lost["proposal"], lost["box"], lost["state"]) == (None, None, "lost")


def test_an_empty_frame_is_a_frame_like_any_other():
    record = frame_record(result(0, [], {}))
    assert record["proposals"] == 0
    assert record["tracks"] == []


def test_lines_are_read_back(tmp_path):
    lines = TrackLines(tmp_path / "tracks.jsonl")
    for f in range(3):
        lines.write(result(f, [4], {0: 1}))
    lines.close()
    read = list(read_records(tmp_path / "tracks.jsonl", SCHEMA))
    assert [r["frame"] for r in read] == [0, 1, 2]
    assert read[-1] == lines.last
