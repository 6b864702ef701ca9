"""Weather, gait and faults of the sensor in simulated sweeps."""

import numpy as np
import pytest

from modt.cli.main import main
from modt.errors import MisuseError
from modt.sources.recognise import open_stream
from modt_simulation.gait import Gait
from modt_simulation.sensors import SENSORS
from modt_simulation.simulator import AIR_SEMANTIC
from modt_simulation.synthetic_stream import SyntheticStream
from modt_simulation.weather import Dust, Fog, rain, snow

WEATHER = ("rain:25", "snow:2.5", "fog:50", "dust:1.5")


def sweep(index=4, sensor="vlp-16", **conditions):
    return SyntheticStream("yard", sensor, 2.0, 7, **conditions).simulator.sweep(index)


def beams(frame):
    """(N,) number of the beam of each point."""
    elevation = np.arctan2(frame.points[:, 2], np.hypot(*frame.points[:, :2].T))
    return np.abs(elevation[:, None] - SENSORS["vlp-16"].elevation_rad).argmin(axis=1)


@pytest.mark.parametrize("weather", WEATHER)
def test_the_air_returns_in_front_of_surfaces_and_is_labelled(weather):
    clear, clear_truth = sweep()
    frame, truth = sweep(weather=weather)
    of_air = truth.semantic == AIR_SEMANTIC
    assert not (clear_truth.semantic == AIR_SEMANTIC).any()
    assert 0.01 < of_air.mean() < 0.7
    assert (truth.instance[of_air] == -1).all()
    range_m = np.linalg.norm(frame.points[of_air, :3], axis=1)
    assert range_m.max() < 17
    assert np.median(range_m) < 6
    assert (~of_air).sum() <= 1.01 * len(clear.points)
    again, _ = sweep(weather=weather)
    assert again.points.tobytes() == frame.points.tobytes()


def test_far_glossy_cars_return_fewer_points_and_all_else_the_same():
    streams = [SyntheticStream("street", "hdl-64e", 0.5, 3, glossy=glossy) for glossy in (False, True)]
    (plain, truth), (glossy, glossy_truth) = (stream.simulator.sweep(2) for stream in streams)
    is_car = np.array([kind.name == "Car" for kind in truth.kinds])
    range_m = np.hypot(*truth.boxes[:, :2].T)
    far = is_car & (range_m > 30)
    near = is_car & (range_m < 20)
    assert far.sum() >= 5
    assert glossy_truth.points[far].sum() < 0.75 * truth.points[far].sum()
    assert glossy_truth.points[near].sum() > 0.9 * truth.points[near].sum()
    ground = [frame.points[t.instance == -1] for frame, t in ((plain, truth), (glossy, glossy_truth))]
    assert abs(len(ground[0]) - len(ground[1])) < 0.001 * len(ground[0])


def test_weather_and_faults_begin_at_their_time():
    clear, _ = sweep()
    before, _ = sweep(weather="fog:50@0.5", faults=["beam:3@0.5"])
    after, truth = sweep(5, weather="fog:50@0.5", faults=["beam:3@0.5"])
    assert before.points.tobytes() == clear.points.tobytes()
    assert (truth.semantic == AIR_SEMANTIC).any()
    assert not (beams(after) == 3).any()


def test_extinction_and_numbers_are_those_of_the_models():
    assert np.exp(-Fog(100.0).extinction_per_m * 100) == pytest.approx(0.05)
    # light rain is nearly clear, heavy snow of 2.5 mm/h hides what is beyond a kilometre
    assert 3 / rain(5.0).extinction_per_m > 2000
    assert 300 < 3 / snow(2.5).extinction_per_m < 1000
    assert snow(2.5).extinction_per_m > snow(0.5).extinction_per_m > rain(5.0).extinction_per_m


def test_stronger_weather_returns_more():
    for kind, values in (("snow", (0.5, 2.5)), ("rain", (5, 50)), ("fog", (200, 50)), ("dust", (0.3, 2.0))):
        light, heavy = ((sweep(weather=f"{kind}:{value}")[1].semantic == AIR_SEMANTIC).sum() for value in values)
        assert light < heavy


def test_dust_comes_in_clouds():
    frame, truth = sweep(12, weather="dust:1.5")
    cloud = frame.points[truth.semantic == AIR_SEMANTIC, :2]
    middle = np.median(cloud, axis=0)
    assert np.median(np.linalg.norm(cloud - middle, axis=1)) < 2.0
    assert 0.5 * Dust.AWAY_M[0] < np.linalg.norm(middle) < 1.5 * Dust.AWAY_M[1]


def test_a_gait_swings_roll_pitch_and_height():
    walk = Gait.of("6:2", np.random.default_rng(1))
    poses = np.array([walk.pose(t) for t in np.arange(0, 10, 0.01)])
    pitch_deg = np.rad2deg(-np.arcsin(poses[:, 2, 0]))
    roll_deg = np.rad2deg(np.arctan2(poses[:, 2, 1], poses[:, 2, 2]))
    for angle_deg in (pitch_deg, roll_deg):
        assert np.abs(angle_deg).max() == pytest.approx(6.0, abs=0.1)
    assert (np.diff(np.sign(pitch_deg)) > 0).sum() in (19, 20, 21)
    assert np.ptp(poses[:, 2, 3]) == pytest.approx(0.08, abs=0.01)
    still = SyntheticStream("yard", "vlp-16", 1.0, 3).simulator.world.ego_pose(0.3)
    stream = SyntheticStream("yard", "vlp-16", 1.0, 3, gait="6")
    walking = stream.simulator.world.ego_pose(0.3)
    np.testing.assert_allclose(walking, still @ stream.simulator.world.gait.pose(0.3))


def test_faults_take_returns_away_and_add_noise():
    clear, _ = sweep()
    number = np.bincount(beams(clear), minlength=16)
    dead, _ = sweep(faults=["beam:7", "beam:2"])
    assert np.bincount(beams(dead), minlength=16).tolist() == [0 if k in (2, 7) else n for k, n in enumerate(number)]
    covered, _ = sweep(faults=["sector:20:30"])
    bearing_deg = np.rad2deg(np.arctan2(clear.points[:, 1], clear.points[:, 0]))
    hidden = (bearing_deg > 20) & (bearing_deg < 50)
    assert len(covered.points) == pytest.approx((~hidden).sum(), abs=40)
    lossy, _ = sweep(faults=["dropout:0.3"])
    assert len(lossy.points) == pytest.approx(0.7 * len(clear.points), rel=0.03)
    weak, _ = sweep(faults=["range:0.5"])
    far = np.hypot(*clear.points[:, :2].T) > 30
    assert (np.hypot(*weak.points[:, :2].T) > 30).sum() < 0.8 * far.sum()
    noisy, _ = sweep(faults=["noise:0.1"])
    assert len(noisy.points) == len(clear.points)
    off_m = np.linalg.norm(noisy.points[:, :3], axis=1) - np.linalg.norm(clear.points[:, :3], axis=1)
    assert np.std(off_m) == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize(
    "conditions",
    [
        {"weather": "hail:3"},
        {"weather": "fog"},
        {"weather": "fog:thick"},
        {"weather": "fog:0"},
        {"weather": "fog:-50"},
        {"gait": "trot"},
        {"gait": "6:0"},
        {"gait": "60"},
        {"faults": ["beam:16"]},
        {"faults": ["beam:1.5"]},
        {"faults": ["sector:20"]},
        {"faults": ["dropout:nan"]},
        {"faults": ["noise:0.1@soon"]},
    ],
)
def test_invalid_conditions_are_refused(conditions):
    with pytest.raises(MisuseError):
        SyntheticStream("yard", "vlp-16", 0.1, 7, **conditions)


def test_the_command_takes_conditions(tmp_path):
    texts = ["--weather", "fog:50", "--gait", "6", "--fault", "beam:7", "--fault", "dropout:0.1"]
    arguments = ["simulate", "--scene", "yard", "--sensor", "vlp-16", "--seconds", "0.1", "--seed", "7"]
    assert main([*arguments, *texts, "--out", str(tmp_path)]) == 0
    drive = next(tmp_path.glob("*/*_sync"))
    (frame,) = open_stream(drive)
    stream = SyntheticStream("yard", "vlp-16", 0.1, 7, weather="fog:50", gait="6", faults=["beam:7", "dropout:0.1"])
    np.testing.assert_array_equal(frame.points, next(iter(stream)).points)
