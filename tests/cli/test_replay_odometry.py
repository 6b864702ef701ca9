"""`modt replay` with poses of a file, of another process, or without poses."""

import json
import socket

import numpy as np
import pytest

from modt.app.systemd import Notifier
from modt.geometry import inverse, rotation_zyx, se3
from modt_simulation.synthetic_stream import SyntheticStream
from tests.sources import layouts

from .commands import content, refusal, session

pytestmark = pytest.mark.command

FRAMES = 10


@pytest.fixture(scope="module", name="street")
def the_embedded_street():
    """Stamps and poses of its first frames."""
    simulator = SyntheticStream("street", "hdl-64e", 10.0, seed=0).simulator
    period_s = simulator.sensor.period_s
    return [(i * period_s, simulator.world.ego_pose(i * period_s)) for i in range(FRAMES)]


def run(out, **options):
    """Summary of a run and the bytes of its tracks."""
    summary = session(out, FRAMES, **options).run(Notifier())
    return summary, (out / "tracks.jsonl").read_bytes()


@pytest.fixture(scope="module", name="recorded")
def a_run_with_its_own_odometry(tmp_path_factory):
    return run(tmp_path_factory.mktemp("recorded") / "run")


def lives(raw):
    """Mean age of the tracks seen in the last frame."""
    return np.mean([t["age"] for t in json.loads(raw.splitlines()[-1])["tracks"] if t["proposal"] is not None])


@pytest.mark.parametrize("restarted", [False, True])
def test_poses_from_a_socket_equal_recorded_poses_and_a_restart_of_the_sender_moves_no_track(
    restarted, tmp_path, street, recorded
):
    T_elsewhere = se3(rotation_zyx(0, 0, 2.0), np.array([400.0, -90.0, 0.0]))
    played = session(tmp_path / "run", FRAMES, odometry=f"unix://{tmp_path / 's'}")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
        for i, (stamp_s, T) in enumerate(street):
            pose = T_elsewhere @ T if restarted and i >= FRAMES // 2 else T
            message = {"stamp": stamp_s, "pose": pose.ravel().tolist()}
            out.sendto(json.dumps(message).encode(), str(tmp_path / "s"))
    received = played.run(Notifier())["odometry"]
    tracks = (tmp_path / "run" / "tracks.jsonl").read_bytes()
    assert not (tmp_path / "s").exists()
    if restarted:
        assert received["restarts"] == 1
        assert lives(tracks) > 0.9 * lives(recorded[1])
    else:
        assert (received["frames_posed"], received["used"]) == (FRAMES, FRAMES)
        assert tracks == recorded[1]


def test_without_poses_they_are_estimated(tmp_path, recorded):
    summary, tracks = run(tmp_path / "run", odometry="none")
    assert summary["odometry"] == {"source": "none", "leaps": 0}
    assert tracks != recorded[1]
    assert lives(tracks) > 0.9 * lives(recorded[1])


def test_poses_of_a_file_equal_recorded_poses(tmp_path, street, recorded):
    """`modt simulate` writes those of the camera, from its start on."""
    camera = SyntheticStream("street", "hdl-64e", 1.0).info.camera.T_camera_sensor
    rows = [(camera @ inverse(street[0][1]) @ T @ inverse(camera))[:3].ravel() for _, T in street]
    np.savetxt(tmp_path / "poses.txt", rows, fmt="%.12e")
    summary, tracks = run(tmp_path / "run", poses=tmp_path / "poses.txt")
    assert summary["odometry"]["source"].endswith("poses.txt")
    assert lives(tracks) > 0.9 * lives(recorded[1])
    placed = [np.reshape(json.loads(line)["T_world_sensor"], (3, 4)) for line in tracks.splitlines()]
    np.testing.assert_allclose(placed, [(inverse(street[0][1]) @ T)[:3] for _, T in street], atol=1e-5)


GOOD = "1 0 0 0 0 1 0 0 0 0 1 0\n"


@pytest.mark.parametrize(
    ("options", "noted"), [({}, True), ({"poses": "poses.txt"}, False), ({"odometry": "unix"}, False)]
)
def test_missing_poses_are_noted_unless_they_come_from_elsewhere(tmp_path, options, noted):
    places = {"poses.txt": tmp_path / "poses.txt", "unix": f"unix://{tmp_path / 's'}"}
    (tmp_path / "poses.txt").write_text(3 * GOOD)
    options = {key: places.get(name, name) for key, name in options.items()}
    made = session(tmp_path / "run", None, path=layouts.bare(tmp_path), **options)
    made.run(Notifier())
    notes = [*made.stages.info.notes, *made.stages.info.pose_notes]
    assert any("no calibration" in note for note in notes)
    assert any("no odometry" in note for note in notes) == noted
    written = content(tmp_path / "run/run.yaml")["stream"]["notes"]
    assert written == notes


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["scans", "--poses", "short.txt"], ["short.txt", "1 poses, too few for frame 2"]),
        (["scans", "--poses", "short.txt", "--odometry", "none"], ["not allowed with"]),
        (["--odometry", "wheels"], ["wheels", "udp://HOST:PORT"]),
        (["--odometry", "udp://127.0.0.1:0"], ["udp://127.0.0.1:0"]),
    ],
)
def test_misuse_is_one_line_and_status_2(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    layouts.bare(tmp_path)
    (tmp_path / "short.txt").write_text(GOOD)
    line = refusal(capsys, "replay", *arguments)
    assert all(word in line for word in words), line
    assert not (tmp_path / "runs").exists()
