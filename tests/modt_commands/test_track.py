import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.classes import ObjectClass
from modt.geometry import inverse, rotation_zyx, se3, transform_boxes
from modt_evaluation.box_tracking.detections import T_LEVEL_CAMERA, Detections, boxes_to_kitti, read
from modt_evaluation.box_tracking.sequences import track_sequence
from tests.cli.commands import here, refusal


def parked(n, T_world_level):
    """Boxes of a parked and of a moving car, from n poses."""
    for i in range(n):
        world = np.array([[20.0, 3.0, -1.0, 4.0, 1.8, 1.5, 0.2], [10.0 + i, -3.0, -1.0, 4.2, 1.7, 1.6, 0.0]])
        yield transform_boxes(inverse(T_world_level(i)), world)


def write(path, n=20, T_world_level=lambda i: np.eye(4), score=9):
    with path.open("w") as out:
        for i, boxes in enumerate(parked(n, T_world_level)):
            for d in boxes_to_kitti(boxes):
                print(i, 2, 100, 100, 200, 200, score, *d, 0, sep=",", file=out)


def run(*arguments):
    return here("track", *arguments)


def turning(i):
    return se3(rotation_zyx(0, 0, 0.05 * i), np.array([0.8 * i, 0.0, 0.0]))


def test_results_are_read_back(tmp_path, capsys):
    source = tmp_path / "0003.txt"
    write(source)
    assert run(source, "--out", tmp_path / "out") == 0
    (found,) = read([tmp_path / "out" / "0003.txt"])
    assert found.n_frames == 20
    np.testing.assert_allclose(found.box[found.frame == 19][:, :2], [[20, 3], [29, -3]], atol=0.2)
    ids = {line.split()[1] for line in (tmp_path / "out" / "0003.txt").read_text().splitlines()}
    assert len(ids) == 2
    assert "20 frames, 2 tracks" in capsys.readouterr().out


def test_poses_place_detections_in_the_world(tmp_path):
    source = tmp_path / "a.txt"
    poses = tmp_path / "poses.txt"
    write(source, T_world_level=turning)
    T_camera = [inverse(T_LEVEL_CAMERA) @ turning(i) @ T_LEVEL_CAMERA for i in range(20)]
    np.savetxt(poses, [T[:3].ravel() for T in T_camera])
    run(source, "--out", tmp_path / "out", "--poses", poses, "--quiet")
    (found,) = read([tmp_path / "out" / "a.txt"])
    world = transform_boxes(turning(19), found.box[found.frame == 19])
    np.testing.assert_allclose(world[:, :2], [[20, 3], [29, -3]], atol=0.2)


@given(
    st.lists(st.lists(st.tuples(st.floats(-20, 20), st.floats(-2, 12)), max_size=4), min_size=2, max_size=9),
    st.data(),
)
def test_online_the_results_of_a_frame_do_not_depend_on_later_frames(scene, data):
    rows = [(i, x, score) for i, seen in enumerate(scene) for x, score in seen]
    box = np.array([[x, 2.0, -1.0, 4.0, 1.8, 1.5, 0.0] for _, x, _ in rows]).reshape(-1, 7)
    frame = np.array([i for i, _, _ in rows], np.int64)
    score = np.array([s for _, _, s in rows], np.float64)
    whole = Detections("a", frame, np.full(len(rows), ObjectClass.CAR), np.zeros((len(rows), 4)), score, box)
    until = data.draw(st.integers(0, len(scene) - 1))
    online = track_sequence(whole, None, 0.1, online=True)[0].splitlines()
    early = [line for line in online if int(line.split()[0]) <= until]
    assert track_sequence(whole.take(frame <= until), None, 0.1, online=True)[0].splitlines() == early


def test_tracks_of_low_confidence_are_written_on_request(tmp_path, caplog):
    write(tmp_path / "a.txt", score=1.5)
    run(tmp_path / "a.txt", "--out", tmp_path / "none", "--quiet")
    assert (tmp_path / "none/a.txt").read_text() == ""
    assert "lower --sure" in caplog.text
    run(tmp_path / "a.txt", "--out", tmp_path / "all", "--quiet", "--sure", "-1000")
    assert len((tmp_path / "all/a.txt").read_text().splitlines()) == 2 * 20


@pytest.mark.parametrize(("options", "first"), [((), 0), (("--online",), 5)])
def test_a_track_is_judged_whole_but_online_frame_by_frame(tmp_path, options, first):
    write(tmp_path / "a.txt")
    lines = (tmp_path / "a.txt").read_text().splitlines()[::2]
    scored = [line.replace(",9,", f",{6 if i < 5 else 11},", 1) for i, line in enumerate(lines)]
    (tmp_path / "a.txt").write_text("\n".join(scored) + "\n")
    run(tmp_path / "a.txt", "--out", tmp_path / "out", "--quiet", "--sure", "10", *options)
    frames = [int(line.split()[0]) for line in (tmp_path / "out" / "a.txt").read_text().splitlines()]
    assert frames == list(range(first, 20))


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--poses", "absent.txt"), "is missing"),
        (("--poses", "short.txt"), "1 poses for 20 frames"),
        (("--poses", "bad.txt"), "bad.txt:1: 3 numbers"),
        (("--period", "0"), "--period"),
        (("--sure", "nan"), "--sure"),
    ],
)
def test_misuse_is_one_line(tmp_path, monkeypatch, capsys, options, named):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "a.txt")
    np.savetxt("short.txt", np.eye(4)[:3].reshape(1, 12))
    (tmp_path / "bad.txt").write_text("1 2 3\n")
    assert named in refusal(capsys, "track", "a.txt", "--out", "out", *options)
