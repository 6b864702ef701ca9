"""The synthetic stream: reproducible, with consistent ground truth."""

import numpy as np
import pytest

from modt.errors import MisuseError
from modt.geometry import inverse, rotation_zyx, se3, transform, transform_boxes
from modt.types import NONE
from modt_simulation.sensors import SENSORS
from modt_simulation.simulator import N_SECTORS, sector_delay_s
from modt_simulation.synthetic_stream import SCENES, SyntheticStream, world_of


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_the_same_seed_gives_the_same_bytes_in_any_order(scene):
    a = SyntheticStream(scene, "vlp-16", 0.4, seed=5)
    world_of.cache_clear()
    b = SyntheticStream(scene, "vlp-16", 0.4, seed=5)
    frames = [f.points.tobytes() for f in a]
    assert len(frames) == 4
    assert frames[2] == next(iter(b.between(2, 3))).points.tobytes()
    assert frames[2] != frames[1]
    assert SyntheticStream(scene, "vlp-16", 0.4, seed=6).simulator.sweep(0)[0].points.tobytes() != frames[0]


@pytest.mark.parametrize("sensor", SENSORS)
def test_every_sensor_gives_valid_frames(sensor):
    frame = next(iter(SyntheticStream("street", sensor, 0.2)))
    assert frame.points.dtype == np.float32
    assert len(frame.points) > 5000
    assert np.isfinite(frame.points).all()
    assert 0 <= frame.points[:, 3].min() <= frame.points[:, 3].max() <= 1


@pytest.mark.parametrize("scene", SCENES)
def test_points_of_a_body_lie_in_its_box(scene):
    stream = SyntheticStream(scene, "os1-64", 0.8, seed=1)
    inside = total = 0
    for frame, truth in stream.sweeps():
        for body, box in zip(truth.bodies, truth.boxes, strict=True):
            p = frame.points[truth.instance == body, :3] - box[:3]
            c = np.cos(box[6])
            s = np.sin(box[6])
            u = np.stack([c * p[:, 0] + s * p[:, 1], c * p[:, 1] - s * p[:, 0], p[:, 2]], axis=1)
            inside += int((np.abs(u) < box[3:6] / 2 + 0.2).all(axis=1).sum())
            total += len(p)
    assert total > 1000
    assert inside > 0.98 * total


def test_bodies_at_rest_stay_where_they_are_in_the_world():
    street = SyntheticStream(seconds=4.0, seed=3)
    (first, a), (last, b) = (street.simulator.sweep(i) for i in (0, 39))
    world_a = transform_boxes(first.T_world_sensor, a.boxes)
    world_b = transform_boxes(last.T_world_sensor, b.boxes)
    still = np.array([street.simulator.world.bodies[body].path.at_rest for body in a.bodies])
    np.testing.assert_allclose(world_a[still, :3], world_b[still, :3], atol=1e-6)
    assert np.linalg.norm(world_a[~still, :2] - world_b[~still, :2], axis=1).max() > 5


def own_sector(points, sensor):
    """(N,) sector in which each point of a distorted sweep was measured."""
    bearing = np.arctan2(points[:, 1], points[:, 0]) % (2 * np.pi)
    column = (bearing / (2 * np.pi) * sensor.shape[1]).astype(np.int64)
    return column * N_SECTORS // sensor.shape[1]


@pytest.mark.parametrize("spin_degps", [0.0, 180.0, -180.0])
def test_distorted_scans_are_restored_by_the_motion_during_the_sweep(spin_degps):
    simulator = SyntheticStream("street", "vlp-16", 1.0, seed=2, distort=True).simulator
    plain = SyntheticStream("street", "vlp-16", 1.0, seed=2).simulator
    world = simulator.world
    drive = world.ego_pose

    def spinning(time_s):
        return drive(time_s) @ se3(rotation_zyx(0.0, 0.0, np.deg2rad(spin_degps) * (time_s - 0.5)), np.zeros(3))

    world.ego_pose = spinning
    frame, truth = simulator.sweep(5)
    sensor = simulator.sensor
    part = own_sector(frame.points, sensor)
    mended = np.empty((len(part), 3))
    for k in range(N_SECTORS):
        T = world.ego_pose(frame.stamp_s + sector_delay_s(k, sensor.period_s))
        mended[part == k] = transform(T, frame.points[part == k, :3].astype(np.float64))
    still = (truth.instance == NONE) & (np.hypot(*frame.points[:, :2].T) < 15)
    terrain = world.terrain
    on_ground = np.abs(mended[still, 2] - terrain.heights(*mended[still, :2].T))
    assert np.quantile(on_ground, 0.95) < 0.12
    skewed = transform(frame.T_world_sensor, frame.points[:, :3].astype(np.float64))
    assert np.linalg.norm(skewed - mended, axis=1).max() > 0.2
    # all around in the sensor's own azimuth, each direction once, whatever the carrier does
    seen = np.bincount(part, minlength=N_SECTORS)
    usual = np.bincount(own_sector(plain.sweep(5)[0].points, sensor), minlength=N_SECTORS)
    assert seen.sum() == pytest.approx(usual.sum(), rel=0.05)
    assert seen.min() > 0.5 * usual.min()


def test_beams_of_a_walking_sensor_stay_cones():
    frame, _ = SyntheticStream("yard", "vlp-16", 1.0, 3, distort=True, gait="8").simulator.sweep(3)
    elevation_deg = np.rad2deg(np.arctan2(frame.points[:, 2], np.hypot(*frame.points[:, :2].T)))
    beams_deg = np.rad2deg(SENSORS["vlp-16"].elevation_rad)
    assert np.abs(elevation_deg[:, None] - beams_deg).min(axis=1).max() < 1e-3


def heights_of(frame):
    """(N,) heights of the points of a frame in the world [m]."""
    return transform(frame.T_world_sensor, frame.points[:, :3].astype(np.float64))[:, 2]


@pytest.mark.parametrize("mount_deg", [(0.0, 15.0), (15.0, 0.0), (180.0, 0.0)])
def test_a_turned_sensor_sees_the_floor_where_the_mount_says(mount_deg):
    level, turned = (
        SyntheticStream("yard", "vlp-16", 0.1, 3, height_m=0.5, mount_deg=m).simulator
        for m in ((0.0, 0.0), mount_deg)
    )
    height = []
    for simulator in (level, turned):
        frame, truth = simulator.sweep(0)
        on_floor = (truth.instance == NONE) & (np.hypot(*frame.points[:, :2].T) < 10)
        assert on_floor.sum() > 1000
        height.append(heights_of(frame)[on_floor])
    assert np.abs(np.concatenate(height)).max() < 0.15
    T = inverse(level.world.ego_pose(0.0)) @ turned.world.ego_pose(0.0)
    np.testing.assert_allclose(T[:3, :3], rotation_zyx(*np.deg2rad([*mount_deg, 0.0])), atol=0.01)


@pytest.mark.parametrize("scene", ["hall", "corridor", "lobby", "lift"])
def test_rooms_have_a_ceiling_above_the_sensor(scene):
    frame, _ = SyntheticStream(scene, "os1-64", 0.1, 2, height_m=0.5).simulator.sweep(0)
    z = heights_of(frame)
    top = np.quantile(z, 0.98)
    assert 2.2 < top < 3.6
    assert (np.abs(z - top) < 0.1).mean() > 0.03


@pytest.mark.parametrize(
    "arguments",
    [
        ("moon", "vlp-16", 1.0, 0),
        ("street", "eye", 1.0, 0),
        ("street", "vlp-16", 0.0, 0),
        ("street", "vlp-16", 1.0, -1),
    ],
)
def test_invalid_arguments_are_refused(arguments):
    with pytest.raises(MisuseError):
        SyntheticStream(*arguments)
