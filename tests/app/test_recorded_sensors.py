"""A robot with two sensors in a recording, and its profile."""

import pytest
import yaml

import modt
from modt import profile
from modt.app.inputs import Request, live_source, stream
from modt.errors import MisuseError
from tests.sources import bags

ROBOT = {
    "front": {"profile": "vlp-16", "source": "ros2:///front/points", "position_m": [0.5, 0.3, 0.6]},
    "rear": {"profile": "vlp-16", "source": "ros2:///rear/points", "position_m": [-0.5, -0.3, 0.6]},
}


def written(tmp_path, sensors=None, **more):
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump({"sensors": ROBOT if sensors is None else sensors, **more}), encoding="utf-8")
    return str(path)


def of_both(*more):
    """Recorded messages of both sensors."""
    return bags.by_time(bags.clouds(topic="/front/points"), bags.clouds(topic="/rear/points"), *more)


def test_two_topics_of_a_recording_are_one_stream_with_the_poses_of_the_robot(tmp_path):
    bag = bags.write_rosbag2(tmp_path / "bag", of_both(bags.poses()))
    frames = [*stream(Request(path=bag, profile=[written(tmp_path)]))]
    assert [[len(sweep.points) for sweep in frame.sweeps] for frame in frames] == [[20 + k] * 2 for k in range(4)]
    assert frames[0].T_world_sensor[:3, 3] == pytest.approx([9.5, -0.3, -0.6], abs=1e-6)


def test_facts_of_one_sensor_are_refused_for_several(tmp_path):
    bag = bags.write_rosbag2(tmp_path / "bag", of_both())
    with pytest.raises(MisuseError, match="topic does not apply, as the profile has several sensors"):
        stream(Request(path=bag, profile=[written(tmp_path)], capture=[("topic", "/front/points")]))
    with pytest.raises(MisuseError, match="topic does not apply, as the profile has several sensors"):
        modt.open(bag, profile=written(tmp_path), topic="/front/points")


def test_a_recording_of_two_sensors_is_played_as_if_they_were_live(tmp_path):
    bag = bags.write_rosbag2(tmp_path / "bag", of_both())
    source, path = live_source(str(bag), None, [written(tmp_path)])
    assert path is None
    assert source.info.name.startswith("front, rear of ")
    source.start()
    try:
        received = next(filter(None, (source.take(1.0) for _ in range(60))))
    finally:
        source.close()
    assert len(received.frame.sweeps) == 2
    folders = {name: {**keys, "source": str(bag)} for name, keys in ROBOT.items()}
    with pytest.raises(MisuseError, match="choose by"):
        live_source("", None, [written(tmp_path, folders)])


def test_a_sensor_that_a_recording_lacks_is_named_with_what_to_do(tmp_path):
    bag = bags.write_rosbag2(tmp_path / "bag", bags.clouds(topic="/front/points"))
    with pytest.raises(MisuseError, match=r"/rear/points.*or leave sensor rear out of the profile"):
        stream(Request(path=bag, profile=[written(tmp_path)]))


def test_a_profile_of_several_sensors_is_based_on_the_first_and_says_so_again(tmp_path):
    path = written(tmp_path, tracking={"max_missed": 5})
    config = profile.load(path)
    assert config.sensor == profile.load("vlp-16").sensor
    assert [sensor.name for sensor in config.sensors] == ["front", "rear"]
    assert profile.parse(profile.to_yaml(profile.dump(config))) == config
    assert profile.resolve(path).used("default") == (path,)
    assert "sensors" not in profile.dump(profile.load("vlp-16"))


def test_a_later_profile_changes_keys_of_a_sensor_and_files_lie_beside_the_profile(tmp_path):
    (tmp_path / "mine.yaml").write_text("extends: vlp-16\nsensor: {min_range_m: 0.9}\n", encoding="utf-8")
    (tmp_path / "scans").mkdir()
    base = written(tmp_path)
    later = tmp_path / "later.yaml"
    later.write_text(
        "sensors: {rear: {profile: mine.yaml, source: scans, roll_pitch_yaw_deg: [0, 0, 180]}}", encoding="utf-8"
    )
    front, rear = profile.load([base, str(later)]).sensors
    assert front.profile == "vlp-16"
    assert (rear.profile, rear.source) == (str(tmp_path / "mine.yaml"), str(tmp_path / "scans"))
    assert rear.position_m == (-0.5, -0.3, 0.6)
    assert rear.roll_pitch_yaw_deg == (0, 0, 180)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sensors": {"front": {"profil": "vlp-16"}}}, "did you mean 'profile'"),
        ({"sensors": {"front": {"profile": "vlp16"}}}, "not among the profiles"),
        ({"sensors": {"front": {}}}, "profile: is missing"),
        ({"sensors": {"front": {"profile": "vlp-16", "position_m": [1, 2]}}}, "3 values"),
        ({"sensors": {"front": {"profile": "vlp-16", "position_m": [1, 2, 0]}}}, "height_m: 0 is out of range"),
        ({"sensors": {"front": {"profile": "vlp-16", "position_m": [1, 2, "x"]}}}, "no number|not a number"),
        ({"sensor": {"height_m": 1.0}}, "stands beside sensors"),
    ],
)
def test_a_wrong_key_or_value_is_named_at_the_start(tmp_path, change, message):
    with pytest.raises(MisuseError, match=message):
        profile.load(written(tmp_path, **change))


def test_a_live_address_is_no_recording_and_one_live_sensor_is_not_two(tmp_path):
    path = written(tmp_path)
    with pytest.raises(MisuseError, match="is no recording"):
        stream(Request(profile=[path]))
    with pytest.raises(MisuseError, match="the profile has several"):
        live_source("velodyne://", None, [path])
    nowhere = {name: {**keys, "source": ""} for name, keys in ROBOT.items()}
    with pytest.raises(MisuseError, match="is no address"):
        stream(Request(path=tmp_path, profile=[written(tmp_path, nowhere)]))
