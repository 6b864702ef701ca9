"""Poses received by a socket: any bytes are handled, and every datagram is counted once."""

import json
import logging
import socket
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from modt.address import parse_address
from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.geometry import quaternion_of, rotation_zyx, se3
from modt.poses.pose_socket import PoseSocket, open_socket, read_datagram
from modt.ros2.cdr import MessageError
from modt.schemes import POSES, open_poses
from modt.sources.pose_buffer import MAX_AGE_S, PoseBuffer
from modt.types import Frame

CONFIG = OdometryConfig()
EMPTY = np.zeros((0, 4), np.float32)


def frame(stamp_s):
    return Frame(0, stamp_s, EMPTY)


def pose_of(odometry, asked):
    return odometry.place(asked).T_world_sensor


def planar(stamp_s, x=0.0, y=0.0, yaw=0.0):
    return json.dumps({"stamp": stamp_s, "x": x, "y": y, "yaw": yaw}).encode()


def matrix(T):
    return se3(rotation_zyx(0, 0, T[2]), np.array([T[0], T[1], 0.0]))


@contextmanager
def connected():
    """A sender and the pose source that receives from it."""
    there, here = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    there.setblocking(False)
    odometry = PoseSocket(here, CONFIG, "test")
    yield there, odometry
    there.close()
    odometry.close()


@pytest.fixture
def pair():
    with connected() as made:
        yield made


def send_to(address, *payloads):
    """Send datagrams to a path or to a port of this machine, each when there is room."""
    local = isinstance(address, Path)
    with socket.socket(socket.AF_UNIX if local else socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.settimeout(60)
        for payload in payloads:
            sender.sendto(payload, str(address) if local else ("127.0.0.1", address))


payload = st.one_of(
    st.binary(max_size=200),
    st.builds(planar, st.floats(-5, 5), st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9)),
    st.builds(planar, st.floats(), st.floats(), st.floats(), st.floats()),
)


@given(st.lists(st.one_of(payload, st.floats(0, 3)), max_size=30))
def test_any_datagrams_are_counted_once_and_a_pose_is_finite(events):
    """Events are datagrams or stamps of frames."""
    with connected() as (there, odometry):
        sent = frames = 0
        for event in [*events, 3.0]:
            if isinstance(event, bytes):
                there.send(event)
                sent += 1
            else:
                T = pose_of(odometry, frame(event))
                frames += 1
                assert T is None or np.isfinite(T).all()
                assert_allclose(np.eye(3) if T is None else T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=0.02)
        report = odometry.report()
    assert report["received"] == sent == report["used"] + sum(report["refused"].values())
    assert report["frames_posed"] + report["frames_unposed"] == frames


def test_both_forms_give_the_same_pose():
    T = matrix([1.0, 2.0, 0.5])
    flat = {"stamp": 1.5, "pose": T.ravel().tolist(), "source": "wheels"}
    short = {"stamp": 1.5, "pose": T[:3].ravel().tolist()}
    for raw in (planar(1.5, 1.0, 2.0, 0.5), json.dumps(flat).encode(), json.dumps(short).encode()):
        stamp_s, read = read_datagram(raw)
        assert stamp_s == 1.5
        assert_allclose(read, T, atol=1e-12)


def test_an_orientation_gives_roll_and_pitch():
    T = se3(rotation_zyx(0.05, -0.1, 0.5), np.array([1.0, 2.0, 0.0]))
    raw = json.dumps({"stamp": 1.5, "x": 1, "y": 2, "orientation": quaternion_of(T).tolist()}).encode()
    stamp_s, read = read_datagram(raw)
    assert stamp_s == 1.5
    assert_allclose(read, T, atol=1e-12)


@pytest.mark.parametrize(
    ("raw", "reason", "cause"),
    [
        (b"", "malformed", "no JSON"),
        (b'{"stamp": 1, "x": 0, "orientation": [0, 0, 0, 1]}', "malformed", "no y"),
        (b'{"stamp": 1, "x": 0, "y": 0, "yaw": 0, "orientation": [0, 0, 0, 1]}', "malformed", "several"),
        (b'{"stamp": 1, "x": 0, "y": 0, "orientation": [0, 0, 1]}', "malformed", "list of 4"),
        (b'{"stamp": 1, "x": 0, "y": 0, "orientation": [0, 0, 0, 0]}', "malformed", "no rotation"),
        (b'{"stamp": 1, "x": 0, "y": 0, "orientation": [0, 0, 0, NaN]}', "non_finite", "orientation is not finite"),
        (b'{"stamp": 1}', "malformed", "neither"),
        (b'{"stamp": 1, "x": 0, "yaw": 0}', "malformed", "no y"),
        (b'{"stamp": 1, "x": NaN, "y": 0, "yaw": 0}', "non_finite", "x is not finite"),
        (b'{"stamp": 1, "x": 1%s, "y": 0, "yaw": 0}' % (b"0" * 400), "non_finite", "x is not finite"),
        (b'{"stamp": 1, "pose": [1, 2]}', "malformed", "12 or 16"),
        (b'{"stamp": 1, "pose": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1]}', "malformed", "last row"),
        (planar(1) + b" " * 5000, "malformed", "4096 bytes"),
    ],
)
def test_the_reason_of_a_refusal_is_given(raw, reason, cause):
    with pytest.raises(MessageError, match=cause) as caught:
        read_datagram(raw)
    assert caught.value.reason == reason


@pytest.mark.parametrize(
    ("poses", "asked", "x"),
    [
        ([], [0.0], None),
        ([(0.1, 1.0)], [0.1], 1.0),
        ([(0.1, 1.0)], [0.15], None),
        ([(0.1, 0.0), (1.0, 5.0)], [0.5, 0.95, 1.05], None),  # a long gap
        ([(0.1 * k, 1.0 * k) for k in range(5)], [0.5], 5.0),
        ([(0.1 * k, 1.0 * k) for k in range(5)], [0.4 + MAX_AGE_S - 0.01], 6.9),
        ([(0.1 * k, 1.0 * k) for k in range(5)], [0.4 + MAX_AGE_S + 0.01], None),
    ],
)
def test_a_frame_near_enough_to_two_poses_has_one(pair, poses, asked, x):
    there, odometry = pair
    for stamp_s, at_m in poses:
        there.send(planar(stamp_s, at_m))
    for stamp_s in asked:
        T = pose_of(odometry, frame(stamp_s))
        assert (None if T is None else T[0, 3]) == (None if x is None else pytest.approx(x))


def test_extrapolation_does_not_amplify_noise(rng):
    ring = PoseBuffer(OdometryConfig())
    for k in range(200):
        ring.add(0.005 * k, matrix([0.05 * k + rng.normal(0, 0.005), 0.0, 0.0]))
    T = ring.at(0.995 + 0.1)
    assert abs(T[0, 3] - 10 * 1.095) < 0.05


def test_each_reason_is_counted_and_logged_once(pair, caplog):
    there, odometry = pair
    unlike = b'{"stamp": 10, "pose": [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]}'
    bad = [b'{"stamp": NaN, "x": 0, "y": 0, "yaw": 0}', planar(9.0), planar(10.0), planar(1e9)]
    bad += [b"nonsense", planar(10.0, 6e8), unlike]
    with caplog.at_level(logging.WARNING):
        for raw in [planar(10.0), *bad, *bad]:
            there.send(raw)
        pose_of(odometry, frame(10.0))
    report = odometry.report()
    counts = {reason: n for reason, n in report["refused"].items() if n}
    assert counts == dict.fromkeys(("non_finite", "stale", "repeated", "ahead"), 2) | {"malformed": 6}
    assert (report["received"], report["used"], report["frames_posed"], report["frames_unposed"]) == (15, 1, 1, 0)
    assert len(caplog.records) == 5
    assert "is it the stream's clock?" in caplog.text


@given(st.lists(st.tuples(st.floats(0.001, 2), st.floats(-1, 1), st.floats(-1, 1)), max_size=40))
def test_no_motion_below_the_speed_limit_is_a_restart(steps):
    stamp_s = x = y = 0.0
    with connected() as (there, odometry):
        there.send(planar(0.0))
        for dt_s, ahead, left in steps:  # up to the speed allowed, and noise
            stamp_s += dt_s
            x += ahead * CONFIG.max_speed_mps * dt_s / 2
            y += left * CONFIG.max_speed_mps * dt_s / 2
            there.send(planar(stamp_s, x + 0.15 * left, y + 0.15 * ahead))
            assert odometry.place(frame(stamp_s)).restarts == 0


def test_the_newest_poses_of_a_flood_are_kept(monkeypatch):
    monkeypatch.setattr("modt.poses.pose_socket.CAPACITY", 4)
    with connected() as (there, odometry):
        for k in range(6):
            there.send(planar(0.1 * k, 1.0 * k))
        assert pose_of(odometry, frame(0.5))[0, 3] == 5.0
        report = odometry.report()
    assert (report["received"], report["used"], report["refused"]["crowded_out"]) == (6, 4, 2)


def test_a_unix_socket_is_emptied_between_two_frames(tmp_path):
    """The kernel holds ten datagrams: a sender that waits for room gets through a hundred without a frame."""
    odometry = open_poses(f"unix://{tmp_path}/s", CONFIG)
    send_to(tmp_path / "s", *(planar(0.0025 * k, 0.02 * k) for k in range(100)))
    assert pose_of(odometry, frame(0.2475))[0, 3] == pytest.approx(1.98)
    assert odometry.report()["used"] == 100
    odometry.close()


def test_what_the_kernel_drops_is_counted(port):
    odometry = open_poses(f"udp://127.0.0.1:{port}", CONFIG)
    with pytest.raises(MisuseError, match="cannot be bound"):
        open_poses(f"udp://127.0.0.1:{port}", CONFIG)
    send_to(port, *(planar(0.001 * k) + b" " * 2000 for k in range(4000)))
    pose_of(odometry, frame(4.0))
    send_to(port, planar(4.1))  # datagrams report what was dropped before them
    pose_of(odometry, frame(4.1))
    report = odometry.report()
    assert 200 < report["received"] < 4001
    assert report["received"] + report["overflowed"] == 4001
    assert report["received"] == report["used"] + sum(report["refused"].values())
    odometry.close()


@pytest.mark.parametrize("path", ["", "127.0.0.1", "127.0.0.1:99999", "127.0.0.1:x", "[::1:5"])
@pytest.mark.parametrize("scheme", ["udp", "tcp", "unix"])
def test_an_invalid_address_is_refused(path, scheme):
    with pytest.raises(MisuseError, match=r"write (one of )?udp://HOST:PORT"):
        open_poses(f"{scheme}://{path}", CONFIG)


@pytest.mark.parametrize("path", ["no/such/folder/s", "x" * 200, "{mine}"])
def test_a_path_that_cannot_be_bound_is_refused_and_a_file_there_kept(path, tmp_path):
    mine = tmp_path / "mine"
    mine.write_text("mine")
    with pytest.raises(MisuseError, match="cannot be bound"):
        open_poses(f"unix:///{path.format(mine=str(mine)[1:])}", CONFIG)
    assert mine.read_text() == "mine"


def test_a_unix_socket_is_removed_on_close_and_a_stale_one_replaced(tmp_path):
    path = tmp_path / "odometry.sock"
    killed = open_socket(parse_address(f"unix://{path}", POSES))
    with pytest.raises(MisuseError, match="cannot be bound"):
        open_poses(f"unix://{path}", CONFIG)
    killed.close()
    assert path.exists()
    odometry = open_poses(f"unix://{path}", CONFIG)
    send_to(path, planar(1.0, 4.0))
    assert pose_of(odometry, frame(1.0))[0, 3] == 4.0
    odometry.close()
    assert not path.exists()
