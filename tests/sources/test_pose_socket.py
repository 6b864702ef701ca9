"""Poses received by a socket: any bytes are handled, and every datagram is counted once."""

import json
import logging
import socket

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modt.address import parse_address
from modt.config import OdometryConfig
from modt.errors import MisuseError
from modt.geometry import rotation_zyx, se3
from modt.ros2.cdr import MessageError
from modt.schemes import POSES, open_poses
from modt.sources.pose_socket import PoseSocket, open_socket, read_datagram
from modt.sources.received_poses import MAX_AGE_S, PoseBuffer, interpolate
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


@pytest.fixture(name="pair")
def a_pair():
    """A sender and the pose source that receives from it."""
    there, here = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    odometry = PoseSocket(here, CONFIG, "test")
    yield there, odometry
    there.close()
    odometry.close()


numbers = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True), st.integers(-(10**400), 10**400), st.booleans(), st.none()
)
keys = st.sampled_from(["stamp", "x", "y", "yaw", "pose", "other"])
nearly = st.dictionaries(keys, st.one_of(numbers, st.lists(numbers, max_size=17), st.text(max_size=3)))
payload = st.one_of(
    st.binary(max_size=200),
    st.builds(lambda d: json.dumps(d).encode(), nearly),
    st.builds(lambda n: b"[" * n, st.integers(0, 5000)),
    st.builds(planar, st.floats(-5, 5), st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9)),
    st.builds(planar, st.floats(), st.floats(), st.floats(), st.floats()),
)


@given(payload)
def test_any_bytes_are_a_pose_or_refused(raw):
    reason = None
    try:
        stamp_s, T = read_datagram(raw)
    except MessageError as error:
        reason = error.reason
    if reason is None:
        assert np.isfinite(stamp_s)
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=0.02)
        np.testing.assert_array_equal(T[3], [0, 0, 0, 1])
    assert reason in (None, *PoseSocket.REASONS)


@given(st.lists(st.one_of(payload, st.floats(0, 3)), max_size=30))
def test_counters_add_up(events):
    """Events are datagrams or stamps of frames."""
    there, here = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    odometry, sent, frames = PoseSocket(here, CONFIG, "test"), 0, 0
    for event in [*events, 3.0]:
        if isinstance(event, bytes):
            there.send(event)
            sent += 1
        else:
            T = pose_of(odometry, frame(event))
            frames += 1
            assert T is None or np.isfinite(T).all()
    report = odometry.report()
    assert report["received"] == sent == report["used"] + sum(report["refused"].values())
    assert report["frames_posed"] + report["frames_unposed"] == frames
    there.close()
    odometry.close()


def test_both_forms_give_the_same_pose():
    T = matrix([1.0, 2.0, 0.5])
    flat = {"stamp": 1.5, "pose": T.ravel().tolist(), "source": "wheels"}
    short = {"stamp": 1.5, "pose": T[:3].ravel().tolist()}
    for raw in (planar(1.5, 1.0, 2.0, 0.5), json.dumps(flat).encode(), json.dumps(short).encode()):
        stamp_s, read = read_datagram(raw)
        assert stamp_s == 1.5
        np.testing.assert_allclose(read, T, atol=1e-12)


@pytest.mark.parametrize(
    ("raw", "reason", "cause"),
    [
        (b"", "malformed", "no JSON"),
        (b"\xff\xfe", "malformed", "no JSON"),
        (b"[1]", "malformed", "no JSON object"),
        (b'{"stamp": 1}', "malformed", "neither"),
        (b'{"stamp": 1, "x": 0, "pose": []}', "malformed", "or both"),
        (b'{"x": 0, "y": 0, "yaw": 0}', "malformed", "no stamp"),
        (b'{"stamp": 1, "x": 0, "yaw": 0}', "malformed", "no y"),
        (b'{"stamp": true, "x": 0, "y": 0, "yaw": 0}', "malformed", "stamp is no number"),
        (b'{"stamp": 1, "x": NaN, "y": 0, "yaw": 0}', "non_finite", "x is not finite"),
        (b'{"stamp": 1e999, "x": 0, "y": 0, "yaw": 0}', "non_finite", "stamp"),
        (b'{"stamp": 1, "x": 6e8, "y": 0, "yaw": 0}', "malformed", "100000 km"),
        (b'{"stamp": 1, "pose": [1, 2]}', "malformed", "12 or 16"),
        (b'{"stamp": 1, "pose": [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]}', "malformed", "no rotation"),
        (b'{"stamp": 1, "pose": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1]}', "malformed", "last row"),
        (planar(1) + b" " * 5000, "malformed", "4096 bytes"),
    ],
)
def test_the_reason_of_a_refusal_is_given(raw, reason, cause):
    with pytest.raises(MessageError, match=cause) as caught:
        read_datagram(raw)
    assert caught.value.reason == reason


def test_poses_are_extrapolated(pair):
    there, odometry = pair
    for k in range(5):
        there.send(planar(0.1 * k, 1.0 * k, 0.0, 0.02 * k))
    np.testing.assert_allclose(pose_of(odometry, frame(0.5)), matrix([5.0, 0.0, 0.1]), atol=1e-9)
    assert pose_of(odometry, frame(0.4 + MAX_AGE_S + 0.01)) is None
    assert pose_of(odometry, frame(0.4 + MAX_AGE_S - 0.01)) is not None


def test_extrapolation_does_not_amplify_noise():
    ring, rng = PoseBuffer(OdometryConfig()), np.random.default_rng(0)
    for k in range(200):
        ring.add(0.005 * k, matrix([0.05 * k + rng.normal(0, 0.005), 0.0, 0.0]))
    T = ring.at(0.995 + 0.1)
    assert abs(T[0, 3] - 10 * 1.095) < 0.05


def test_one_pose_or_a_long_gap_gives_no_pose_at_other_times(pair):
    there, odometry = pair
    assert pose_of(odometry, frame(0.0)) is None
    there.send(planar(0.1))
    assert pose_of(odometry, frame(0.1)) is not None
    assert pose_of(odometry, frame(0.15)) is None
    there.send(planar(1.0, 5.0))
    assert pose_of(odometry, frame(0.5)) is None
    assert pose_of(odometry, frame(0.95)) is None
    assert pose_of(odometry, frame(1.05)) is None


def test_each_reason_is_counted_and_logged_once(pair, caplog):
    there, odometry = pair
    bad = [b"nonsense", b'{"stamp": NaN, "x": 0, "y": 0, "yaw": 0}', planar(9.0), planar(10.0), planar(1e9)]
    with caplog.at_level(logging.WARNING):
        for raw in [planar(10.0), *bad, *bad]:
            there.send(raw)
        pose_of(odometry, frame(10.0))
    assert odometry.report() == {
        "source": "test",
        "received": 11,
        "overflowed": 0,
        "used": 1,
        "refused": dict.fromkeys(PoseSocket.REASONS, 0)
        | {"malformed": 2, "non_finite": 2, "stale": 2, "repeated": 2, "ahead": 2},
        "restarts": 0,
        "frames_posed": 1,
        "frames_unposed": 0,
    }
    assert len(caplog.records) == 5
    assert "is it the stream's clock?" in caplog.text


def test_a_restarted_sender_is_detected_by_poses_that_go_on_after_a_leap(pair, caplog):
    there, odometry = pair

    def placed(numbers):
        for k in numbers:
            there.send(planar(0.05 * k, (20 if k < 5 else 500 if k > 12 else 0) + 0.1 * k))  # 20 m back in 0.05 s
        return odometry.place(frame(0.05 * numbers[-1] + 0.02))

    with caplog.at_level(logging.WARNING):
        first, doubted, second = (placed(range(*r)) for r in ((5,), (5, 9), (9, 11)))
    assert [p.restarts for p in (first, doubted, second)] == [0, 0, 1]
    x = [p.T_world_sensor[0, 3] for p in (first, doubted, second)]
    np.testing.assert_allclose(x, [20.44, 20.84, 1.04])  # the world before, until the new one is believed
    report = odometry.report()
    assert (report["restarts"], report["used"], report["refused"]["leap"]) == (1, 7, 4)
    assert "odometry.max_speed_mps" in caplog.text
    warnings = len(caplog.records)
    assert placed(range(13, 18)).restarts == 2
    assert len(caplog.records) == warnings


@given(st.lists(st.tuples(st.floats(0.001, 2), st.floats(-1, 1), st.floats(-1, 1)), max_size=40))
def test_no_motion_below_the_speed_limit_is_a_restart(steps):
    there, here = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    odometry, stamp_s, x, y = PoseSocket(here, CONFIG, "test"), 0.0, 0.0, 0.0
    there.send(planar(0.0))
    for dt_s, ahead, left in steps:  # up to the speed allowed, and noise
        stamp_s += dt_s
        x += ahead * CONFIG.max_speed_mps * dt_s / 2
        y += left * CONFIG.max_speed_mps * dt_s / 2
        there.send(planar(stamp_s, x + 0.15 * left, y + 0.15 * ahead))
        assert odometry.place(frame(stamp_s)).restarts == 0
    there.close()
    odometry.close()


def test_of_a_flood_the_newest_are_kept(monkeypatch):
    monkeypatch.setattr("modt.sources.pose_socket.CAPACITY", 4)
    there, here = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    there.setblocking(False)
    odometry = PoseSocket(here, CONFIG, "test")
    for k in range(6):
        there.send(planar(0.1 * k, 1.0 * k))
    assert pose_of(odometry, frame(0.5))[0, 3] == 5.0
    report = odometry.report()
    assert (report["received"], report["used"], report["refused"]["crowded_out"]) == (6, 4, 2)
    there.close()
    odometry.close()


def test_a_unix_socket_is_emptied_between_two_frames(tmp_path):
    """The kernel holds ten datagrams: a sender that waits for room gets through a hundred without a frame."""
    path = tmp_path / "odometry.sock"
    odometry = open_poses(f"unix://{path}", CONFIG)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        sender.settimeout(60)
        for k in range(100):
            sender.sendto(planar(0.0025 * k, 0.02 * k), str(path))
    assert pose_of(odometry, frame(0.2475))[0, 3] == pytest.approx(1.98)
    assert odometry.report()["used"] == 100
    odometry.close()


def test_what_the_kernel_drops_is_counted(free_port):
    url = f"udp://127.0.0.1:{free_port}"
    odometry = open_poses(url, CONFIG)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for k in range(4000):
            sender.sendto(planar(0.001 * k) + b" " * 2000, ("127.0.0.1", free_port))
        pose_of(odometry, frame(4.0))
        sender.sendto(planar(4.1), ("127.0.0.1", free_port))  # datagrams report what was dropped before them
    pose_of(odometry, frame(4.1))
    report = odometry.report()
    assert 200 < report["received"] < 4001
    assert report["received"] + report["overflowed"] == 4001
    assert report["received"] == report["used"] + sum(report["refused"].values())
    odometry.close()


@given(
    st.tuples(*[st.floats(-50, 50)] * 2, st.floats(-3, 3)),
    st.tuples(*[st.floats(-50, 50)] * 2, st.floats(-3, 3)),
    st.floats(-1, 2),
)
def test_planar_interpolation_equals_the_closed_form(a, b, share):
    """Reference: each coordinate by itself, the angle along the shorter arc."""
    turn = (b[2] - a[2] + np.pi) % (2 * np.pi) - np.pi
    if abs(abs(turn) - np.pi) < 1e-6:
        return  # both ways round are as short
    expected = [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * turn]
    np.testing.assert_allclose(interpolate(matrix(a), matrix(b), share), matrix(expected), atol=1e-6)


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


def test_a_udp_socket_receives_and_stays_bound(free_port):
    url = f"udp://127.0.0.1:{free_port}"
    odometry = open_poses(url, CONFIG)
    with pytest.raises(MisuseError, match="cannot be bound"):
        open_poses(url, CONFIG)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(planar(1.0, 4.0), ("127.0.0.1", free_port))
    assert pose_of(odometry, frame(1.0))[0, 3] == 4.0
    odometry.close()


def test_a_unix_socket_is_removed_on_close_and_a_stale_one_replaced(tmp_path):
    path = tmp_path / "odometry.sock"
    killed = open_socket(parse_address(f"unix://{path}", POSES))
    with pytest.raises(MisuseError, match="cannot be bound"):
        open_poses(f"unix://{path}", CONFIG)
    killed.close()
    assert path.exists()
    odometry = open_poses(f"unix://{path}", CONFIG)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        sender.sendto(planar(1.0, 4.0), str(path))
    assert pose_of(odometry, frame(1.0))[0, 3] == 4.0
    odometry.close()
    assert not path.exists()


@pytest.fixture(name="free_port")
def a_free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def test_poses_far_from_their_origin_are_used(pair):
    there, odometry = pair
    for k in range(3):
        there.send(planar(1.0 + 0.1 * k, 458_000.0 + k, 5_430_000.0))
    T = pose_of(odometry, frame(1.15))
    np.testing.assert_allclose(T[:3, 3], [458_001.5, 5_430_000.0, 0.0], rtol=0, atol=1e-6)
    assert odometry.used == 3
