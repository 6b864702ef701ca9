"""Two sensors of a robot, from their sweeps to tracks in the frame of the robot."""

from dataclasses import replace

import numpy as np
import pytest

import modt
from modt.app import assembly
from modt.errors import MisuseError
from modt.geometry import FieldOfView, inverse, se3, transform
from modt.profile import load
from modt.sources.joining import joint_frame
from modt.types import Frame
from modt_simulation.builder import SceneBuilder
from modt_simulation.materials import Material
from modt_simulation.motion import Path
from modt_simulation.robot_stream import RobotStream
from modt_simulation.solids import block
from modt_simulation.synthetic_stream import SCENES, SyntheticStream
from modt_simulation.yard import floor
from tests.robots import CORNERS, mounted, robot

HIDDEN = ["sector:135:90"]
"""The quarter of a turn that the robot hides from a corner sensor."""


def steps(config, frames):
    mode = assembly.MODES["accurate"]
    pipeline = assembly.pipeline(mode, config, FieldOfView())
    return [pipeline.step(frame, mode.budget(config)) for frame in frames]


def drive(seconds=1.5, scene="yard", phase_s=0.04, **more):
    of_sensors = {"front": {"faults": HIDDEN}, "rear": {"faults": HIDDEN, "first_s": phase_s}}
    return [*RobotStream(scene, CORNERS, seconds, 3, of_sensors, **more).sweeps()]


def stepped(frames):
    """Frames with their truths, and the result of each for a robot with a sensor at two corners."""
    return [*zip(frames, steps(robot(*CORNERS), [frame for frame, _ in frames]), strict=True)]


def test_one_sensor_in_the_middle_gives_the_result_of_a_sensor_alone():
    middle = mounted("middle", 0.0, 0.0, 0.0, z=0.6)
    frames = [*SyntheticStream("yard", "vlp-16", 1.0, 3, height_m=0.6)]
    alone = load("vlp-16")
    sensor = replace(alone.sensor, height_m=0.6, roll_deg=0.0, pitch_deg=0.0)
    expected = steps(replace(alone, sensor=sensor), [replace(frame, T_world_sensor=None) for frame in frames])
    joined = [replace(joint_frame(f.index, {0: replace(f, T_world_sensor=None)}, (middle,))) for f in frames]
    found = steps(robot(middle), joined)
    for one, other in zip(expected, found, strict=True):
        assert one.tracks.id.tolist() == other.tracks.id.tolist()
        assert one.tracks.object_class.tolist() == other.tracks.object_class.tolist()
        assert one.tracks.x == pytest.approx(other.tracks.x, abs=1e-3)
        assert other.proposals.box[:, 2] - one.proposals.box[:, 2] == pytest.approx(0.6, abs=1e-3)


@pytest.mark.parametrize("phase_s", [0.0, 0.04])
def test_results_are_in_the_frame_of_the_robot(phase_s):
    frames = drive(0.4, phase_s=phase_s)
    for (frame, truth), result in stepped(frames):
        assert result.T_world_sensor == pytest.approx(frame.T_world_sensor, abs=1e-3)
        assert phase_s or result.frame.points == pytest.approx(frame.points, abs=1e-3)
        assert result.frame.frame_id == "base_footprint"
        ground = result.frame.points[result.labels == modt.PointKind.GROUND]
        near = np.hypot(ground[:, 0], ground[:, 1]) < 6
        assert np.median(ground[near, 2]) == pytest.approx(0.0, abs=0.1)
        assert len(truth.instance) == len(result.frame.points)
        members = result.proposals.members
        assert pytest.approx(result.proposals.coordinates, abs=0.2) == result.frame.points[members, :3].T


def test_points_of_a_sensor_that_turns_later_are_where_they_are_at_the_stamp():
    frames = drive(0.6, scene="street", phase_s=0.05)
    for (frame, truth), result in stepped(frames)[2:]:
        seen = [sweep for sweep in frame.sweeps if sweep is not None]
        world = [transform(sweep.T_world_sensor, sweep.points[:, :3].astype(float)) for sweep in seen]
        placed = transform(result.T_world_sensor, result.frame.points[:, :3].astype(float))
        assert len(truth.instance) == len(placed)
        unmoved = transform(result.T_world_sensor, frame.points[:, :3].astype(float))
        near = np.linalg.norm(result.frame.points[:, :2], axis=1) < 20
        off_m, off_unmoved_m = (
            np.linalg.norm((at - np.concatenate(world))[near, :2], axis=1) for at in (placed, unmoved)
        )
        assert np.quantile(off_unmoved_m, 0.9) > 0.1
        assert np.quantile(off_m, 0.9) < 0.03


def round_the_robot(rng, seconds, height_m):
    """A person walks round the left of the robot: seen by the front sensor, by both, then by the rear one alone."""
    builder = SceneBuilder(rng, seconds)
    builder.walker([(3.0, 4.0), (-4.0, 4.0), (-4.0, -4.0)], 1.5)
    builder.scenery(block((0.3, 30.0, 2.5), Material.WALL), 12.0, 0.0)
    ground = floor(builder.rng, (30.0, 30.0), Material.PAVING, 0.01)
    return builder.world(ground, Path.standing(0.0, 0.0, 0.0), height_m, ego_m=(1.0, 0.7))


def test_a_person_who_walks_from_one_view_into_the_other_keeps_the_track(monkeypatch):
    monkeypatch.setitem(SCENES, "round", round_the_robot)
    frames = drive(7.8, scene="round")
    views = []
    ids = []
    for (frame, truth), result in stepped(frames):
        (person,) = truth.bodies.tolist()
        rows = np.flatnonzero(truth.instance == person)
        of_front = rows < len(frame.sweeps[0].points)
        views.append((bool(of_front.any()), bool((~of_front).any())))
        labels, count = np.unique(result.labels[rows], return_counts=True)
        assert count.max() >= 0.8 * count.sum()  # one proposal, whichever sensors see the person
        ids.append(int(labels[count.argmax()]))
    assert {(True, False), (True, True), (False, True)} <= set(views)
    assert len(set(ids)) == 1
    assert ids[0] >= 0
    row = np.flatnonzero(result.tracks.id == ids[0])[0]
    assert modt.CLASS_NAMES[result.tracks.object_class[row]] == "pedestrian"
    assert result.tracks.velocity[row] == pytest.approx([0.0, -1.5], abs=0.2)


def test_what_rests_stays_where_it_is_while_the_sensors_turn_at_different_times():
    """A robot that moves at the same speed, with distorted sweeps half a period apart: boxes at rest do not swing."""
    frames = drive(2.0, scene="street", distort=True, phase_s=0.05)
    results = steps(robot(*CORNERS), [frame for frame, _ in frames])
    truth = frames[-1][1]
    tracks = results[-1].tracks
    moved = np.hypot(*(truth.world_boxes[:, :2] - frames[-11][1].world_boxes[:, :2]).T) > 0.05
    cars = truth.world_boxes[~moved & (truth.points > 100) & (truth.world_boxes[:, 3] > 3)]
    offset = np.linalg.norm(tracks.whole_box[:, None, :2] - cars[:, :2], axis=2).min(axis=0)
    assert len(cars) >= 2
    assert np.median(offset) < 0.4


def test_a_sensor_without_a_sweep_leaves_the_results_of_the_other():
    frames = [frame for frame, _ in drive(1.0)]
    front_only = [joint_frame(f.index, {0: f.sweeps[0]}, CORNERS) for f in frames[5:]]
    results = steps(robot(*CORNERS), [*frames[:5], *front_only])
    before = set(results[4].tracks.id[results[4].tracks.observed].tolist())
    after = set(results[5].tracks.id[results[5].tracks.observed].tolist())
    assert len(before & after) > 0.5 * len(after)
    assert len(results[-1].frame.points) == len(frames[-1].sweeps[0].points)


def test_frames_of_one_sensor_are_refused_with_the_names_of_those_of_the_profile():
    with pytest.raises(MisuseError, match="holds no sweeps of front, rear"):
        steps(robot(*CORNERS), [Frame(0, 0.0, np.ones((10, 4), np.float32))])


def test_the_library_takes_points_by_the_names_of_the_sensors():
    pipeline = modt.Pipeline(robot(*CORNERS))
    frames = [frame for frame, _ in drive(0.5, phase_s=0.0)]
    for frame in frames:
        front, rear = frame.sweeps
        found = pipeline.step({"front": front.points, "rear": rear.points}, frame.stamp_s, frame.T_world_sensor)
    assert len(found.objects()) > 0
    expected = modt.Pipeline(robot(*CORNERS))
    for frame in frames:
        joined = expected.step(frame)
    assert found.box == pytest.approx(joined.box, abs=1e-6)
    assert found.T_world_sensor == pytest.approx(frames[-1].T_world_sensor)
    with pytest.raises(MisuseError, match="did you mean 'rear'"):
        pipeline.step({"reer": rear.points}, 9.0)


def test_the_pose_of_a_sensor_on_the_robot_moves_its_points():
    front = CORNERS[0]
    ahead = transform(front.T_robot_sensor, np.array([[2.0, 0.0, 0.0]]))[0]
    assert ahead == pytest.approx([0.5 + np.sqrt(2), 0.35 + np.sqrt(2), 0.6])
    assert inverse(front.T_robot_sensor) @ front.T_robot_level == pytest.approx(se3(np.eye(3), np.zeros(3)))
