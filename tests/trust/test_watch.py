"""The trust on simulated drives: good while nothing is wrong, and not good soon after each fault of the sweeps."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from modt.geometry import rotation_zyx, se3
from modt.profile import load
from modt.trust.sample import sample
from modt.trust.scene import BEARINGS, SAME, TURN_TOLERANCE, Change, SceneCheck, explain
from modt.trust.tuning import SceneTuning
from modt.trust.watch import Finding, TrustWatch
from modt.types import Frame, TrustLevel
from modt_simulation.synthetic_stream import SyntheticStream

SENSOR = "vlp-16"
ONSET, END = 40, 70
SECOND = 55, 110
SECONDS = 10.0


@cache
def drive(scene, seconds=SECONDS):
    frames = SyntheticStream(scene, SENSOR, seconds, seed=11)
    return [replace(frame, points=frame.points[::3]) for frame in frames]


def judged(scene, fault=None, others=lambda k: {}, second=None, seconds=SECONDS, missing=lambda k: False):
    """Trust after each frame of a drive with a fault from ONSET up to END, and a second one that lasts SECOND.

    Frames that are `missing` repeat the trust before.
    """
    watch = TrustWatch(load(SENSOR).sensor)
    trusts = []
    for k, frame in enumerate(drive(scene, seconds)):
        if missing(k):
            trusts.append(trusts[-1])
            continue
        points = fault(frame.points, k) if fault and ONSET <= k < END else frame.points
        points = second(points, k) if second and SECOND[0] <= k < SECOND[1] else points
        trusts.append(watch.add(replace(frame, points=points), frame.T_world_sensor, others(k)))
    return trusts


def turned(matrix):
    matrix = np.asarray(matrix, np.float32)
    return lambda points, k: np.column_stack([points[:, :3] @ matrix.T, points[:, 3]]).astype(np.float32)


def rotation(roll=0.0, pitch=0.0, yaw=0.0):
    return turned(rotation_zyx(*np.deg2rad([roll, pitch, yaw])))


def bearing(points):
    return np.arctan2(points[:, 1], points[:, 0])


def tangent(points):
    return points[:, 2] / np.hypot(points[:, 0], points[:, 1])


def covered(points, k):
    near = points.copy()
    ahead = points[:, 0] > 0
    near[ahead, :3] *= 0.5 / np.linalg.norm(points[ahead, :3], axis=1, keepdims=True)
    return near


FAULTS = {
    "all distances zero": lambda points, k: np.zeros_like(points),
    "empty": lambda points, k: points[:0],
    "frozen": lambda points, k: drive("street")[ONSET].points,
    "half the view": lambda points, k: points[points[:, 0] < 0],
    "a quarter of the view": lambda points, k: points[np.abs(bearing(points)) > np.pi / 4],
    "two quadrants": lambda points, k: points[points[:, 0] * points[:, 1] > 0],
    "a cover": covered,
    "upper beams dead": lambda points, k: points[tangent(points) < -0.01],
    "lower beams dead": lambda points, k: points[tangent(points) > -0.06],
    "every second point": lambda points, k: points[::2],
    "in millimetres": turned(1000 * np.eye(3)),
    "twice as far": turned(2 * np.eye(3)),
    "half as far": turned(0.5 * np.eye(3)),
    "a fifth farther": turned(1.2 * np.eye(3)),
    "a fifth nearer": turned(0.8 * np.eye(3)),
    "mirrored": turned(np.diag([1, -1, 1])),
    "upside down": turned(np.diag([1, -1, -1])),
    "turned by 90 deg": rotation(yaw=90),
    "turned by 45 deg": rotation(yaw=45),
    "rolled by 15 deg": rotation(roll=15),
    "pitched by -8 deg": rotation(pitch=-8),
}


def assert_reported_and_withdrawn(levels):
    """Good before the fault and at the end, and not good from two seconds after its onset on until it ends."""
    levels = np.array(levels)
    assert (levels[:ONSET] == TrustLevel.GOOD).all()
    assert (levels[ONSET + 20 : END] > TrustLevel.GOOD).all()
    assert levels[-1] == TrustLevel.GOOD


@pytest.mark.parametrize("scene", ["street", "hall"])
def test_a_drive_without_a_fault_is_trusted(scene):
    assert {trust.level for trust in judged(scene)} == {TrustLevel.GOOD}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_reported_within_two_seconds_and_withdrawn_within_three(name):
    assert_reported_and_withdrawn([trust.level for trust in judged("street", FAULTS[name])])


@pytest.mark.parametrize("name", ["all distances zero", "empty", "in millimetres", "frozen"])
def test_a_sensor_that_shows_nothing_new_from_its_start_on_is_blind_until_it_does(name):
    watch = TrustWatch(load(SENSOR).sensor)
    levels = []
    for k, frame in enumerate(drive("street")):
        points = FAULTS[name](frame.points, k) if k < END else frame.points
        levels.append(watch.add(replace(frame, points=points), frame.T_world_sensor).level)
    assert set(levels[15:END]) == {TrustLevel.BLIND}
    assert set(levels[END + 25 :]) == {TrustLevel.GOOD}


@pytest.mark.parametrize("posed", [True, False], ids=["posed", "registered"])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("name", sorted(FAULTS.keys() - {"frozen"}))
def test_a_fault_that_begins_and_ends_within_a_sweep_is_reported_and_withdrawn_like_others(name, share, posed):
    """No sensor is knocked or covered just at its seam. Poses by registration do not contradict a turned sensor."""
    watch = TrustWatch(load(SENSOR).sensor)
    levels = []
    for k, frame in enumerate(drive("street")):
        sweep = faulty_from(FAULTS[name], share, k, frame.points)
        given = replace(frame, points=sweep, T_world_sensor=frame.T_world_sensor if posed else None)
        levels.append(watch.add(given, frame.T_world_sensor).level)
    assert_reported_and_withdrawn(levels)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.7])
@pytest.mark.parametrize("late", range(6))
@pytest.mark.parametrize("name", ["upper beams dead", "a quarter of the view", "rolled by 15 deg", "a fifth farther"])
def test_a_fault_that_begins_within_the_sweep_of_a_look_is_reported_like_others(name, late, share):
    """There is a look each sixth frame."""
    watch = TrustWatch(load(SENSOR).sensor)
    levels = []
    for k, frame in enumerate(drive("street"), -late):
        sweep = faulty_from(FAULTS[name], share, k, frame.points)
        levels.append(watch.add(replace(frame, points=sweep), frame.T_world_sensor).level)
    assert_reported_and_withdrawn(levels[late:])


@pytest.mark.parametrize("scene", ["street", "yard"])
@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_few_beams_are_no_turned_scene(scene, share):
    """With two rings of obstacles the registration is lost, and they are little like the scene before and after."""
    watch = TrustWatch(load(SENSOR).sensor)
    keys = set()
    for k, frame in enumerate(drive(scene)):
        points = faulty_from(few_beams, share, k, frame.points)
        lost = np.deg2rad(25.0) * np.clip(k - ONSET, 0, END - ONSET)
        T_world_sensor = frame.T_world_sensor @ se3(rotation_zyx(0.0, 0.0, float(lost)), np.zeros(3))
        keys.update(watch.add(replace(frame, points=points, T_world_sensor=None), T_world_sensor).keys)
    assert "returns" in keys
    assert "scene" not in keys


@pytest.mark.parametrize("scene", ["street", "yard"])
@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_a_turn_that_registration_takes_for_a_motion_is_reported_and_withdrawn(scene, share):
    """The packets of a turned head leap in azimuth, so the rest of the sweep is lost, and a part of the next."""
    watch = TrustWatch(load(SENSOR).sensor)
    leap = se3(rotation_zyx(0.0, 0.0, 0.09), np.array([-0.9, 1.4, 0.0]))
    T_leapt = np.eye(4)
    levels = []
    for k, frame in enumerate(drive(scene)):
        points = FAULTS["turned by 90 deg"](frame.points, k) if ONSET < k <= END else frame.points
        turn = (np.pi - bearing(points)) / (2 * np.pi)
        if k in (ONSET, END):
            points = points[turn < share]
        if k in (ONSET + 1, END + 1):
            points = points[turn > 0.12]
            T_leapt = T_leapt @ leap
        T_world_sensor = frame.T_world_sensor @ T_leapt
        levels.append(watch.add(replace(frame, points=points, T_world_sensor=None), T_world_sensor).level)
    assert_reported_and_withdrawn(levels)


@pytest.mark.parametrize(("motion_looks", "is_back"), [(1, False), (12, True)])
def test_the_end_of_a_small_turn_far_from_where_it_began_is_known_over_a_longer_way(motion_looks, is_back):
    """The robot moves by half a metre from look to look."""
    frames = drive("crowd", 24.0)[::6]
    samples = [sample(frame, frame.T_world_sensor, load(SENSOR).sensor, np.array([-0.8, 0, 0])) for frame in frames]
    check = SceneCheck(replace(SceneTuning(), motion_looks=motion_looks))
    check.change = Change(mirrored=False, turned=4, scaled=0)
    check.before = samples[30]
    for before, now in pairwise(samples[:20]):
        check.look(before, now, [], back_looks=3)
    assert check.change.is_none == is_back


def test_a_turn_explains_the_points_that_a_broken_sweep_before_could_have_seen():
    """Only those of its obstacles count that the turn brings into view of the sweep before."""
    points = drive("street")[ONSET].points
    broken = points[bearing(points) > -1.5]
    plane = np.array([-load(SENSOR).sensor.height_m, 0.0, 0.0])
    before, after = (
        sample(Frame(k, 0.1 * k, each), np.eye(4), load(SENSOR).sensor, plane)
        for k, each in enumerate((broken, FAULTS["turned by 90 deg"](points, ONSET)))
    )
    change, share = explain(before, after, SAME)
    assert not change.mirrored
    assert abs(change.turned - BEARINGS // 4) <= TURN_TOLERANCE
    assert share > 0.95


def few_beams(points, k):
    """Points of every eighth beam, a tenth nearer."""
    beam = np.rint((np.rad2deg(np.arctan(tangent(points))) + 15) / 2).astype(int)
    few = points[beam % 8 == 0]
    return np.column_stack([0.9 * few[:, :3], few[:, 3]]).astype(np.float32)


def faulty_from(fault, share, k, points):
    """Points of sweep k of a fault that begins and ends after a share of a turn; clockwise, from behind."""
    turned = (np.pi - bearing(points)) / (2 * np.pi)
    faulty = (k + turned > ONSET + share) & (k + turned < END + share)
    return np.concatenate([points[~faulty], fault(points[faulty], k)])


@pytest.mark.parametrize("name", ["rolled by 15 deg", "pitched by -8 deg", "a fifth farther"])
@pytest.mark.parametrize("scene", ["hills", "loading"])
def test_a_ground_that_moves_among_hills_and_ramps_is_reported_and_withdrawn(scene, name):
    """The ground has another shape where the fault ends; neither it nor the scene may be taken for the known one."""
    levels = np.array([trust.level for trust in judged(scene, FAULTS[name], seconds=12.0)])
    assert (levels[ONSET + 20 : END] > TrustLevel.GOOD).all()
    assert (levels[END + 40 :] == TrustLevel.GOOD).all()


@pytest.mark.parametrize("name", ["twice as far", "turned by 90 deg", "upside down"])
def test_a_fault_that_ends_while_every_third_sweep_is_processed_is_withdrawn(name):
    """On a machine that is too busy, the time between two frames is too long for a step."""
    trusts = judged("street", FAULTS[name], missing=lambda k: k > ONSET + 12 and k % 3 > 0)
    assert all(trust.level > TrustLevel.GOOD for trust in trusts[ONSET + 20 : END])
    assert trusts[-1].level == TrustLevel.GOOD


def test_a_knock_under_a_cover_is_reported_when_the_cover_is_gone(rng):
    """The sensor stands: the sweeps before and after the cover show one place."""
    watch = TrustWatch(load(SENSOR).sensor)
    frame = drive("street")[0]
    keys = []
    for k in range(100):
        noise = 1 + rng.normal(0, 1e-3, (len(frame.points), 1))
        points = np.column_stack([frame.points[:, :3] * noise, frame.points[:, 3]]).astype(np.float32)
        points = np.zeros_like(points) if 40 <= k < 60 else points
        points = FAULTS["pitched by -8 deg"](points, k) if 50 <= k < 90 else points
        keys.append(watch.add(Frame(k, 0.1 * k, points), frame.T_world_sensor).keys)
    assert all("ground" in now for now in keys[66:90])


@pytest.mark.parametrize(
    ("name", "second", "key"),
    [
        ("turned by 90 deg", "rolled by 15 deg", "ground"),
        ("a fifth farther", "turned by 90 deg", "scene"),
        ("half the view", "every second point", "returns"),
    ],
)
def test_a_fault_that_begins_during_another_one_is_reported_by_itself_and_withdrawn(name, second, key):
    """The robot drives on for 7 s, so the scene before both is out of view when they end."""
    trusts = judged("street", FAULTS[name], second=FAULTS[second], seconds=15.0)
    assert all(key in trust.keys for trust in trusts[SECOND[0] + 20 : SECOND[1]])
    assert all(trust.keys == (key,) for trust in trusts[END + 30 : SECOND[1]])
    assert not any(trust.keys for trust in trusts[SECOND[1] + 50 :])


def test_reflectance_is_no_matter_of_trust():
    def garbage(points, k):
        return np.column_stack([points[:, :3], np.random.default_rng(k).random(len(points))]).astype(np.float32)

    assert {trust.level for trust in judged("street", garbage)} == {TrustLevel.GOOD}


def test_a_reason_has_cause_remedy_and_the_time_of_its_begin():
    trusts = judged("street", FAULTS["mirrored"])
    begin = next(k for k, trust in enumerate(trusts) if trust.level)
    (reason,) = trusts[begin + 5].reasons
    assert (reason.key, reason.level) == ("scene", TrustLevel.BLIND)
    assert "mirrored" in reason.cause
    assert reason.remedy
    assert reason.since_s == trusts[begin + 5].since_s == pytest.approx(0.1 * begin)


def test_findings_of_other_checks_are_reported_with_their_level():
    poses = {"poses": Finding(TrustLevel.DEGRADED, "poses are wrong", "check them")}
    trusts = judged("street", others=lambda k: poses if ONSET <= k < END else {})
    assert trusts[ONSET + 15].record()["level"] == "degraded"
    assert trusts[ONSET + 15].keys == ("poses",)
    assert trusts[-1].level == TrustLevel.GOOD


@pytest.mark.parametrize("times_s", [(0.0, 0.0), (5.0, 1.0), (0.0, 100.0)], ids=["same", "back", "gap"])
def test_any_order_of_times_is_taken(times_s):
    watch = TrustWatch(load(SENSOR).sensor)
    points = drive("street")[0].points
    for k, time_s in enumerate(times_s * 5):
        assert watch.add(Frame(k, time_s, points), np.eye(4)).level == TrustLevel.GOOD
