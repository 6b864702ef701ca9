"""The stages of a service: usable after a failure of any of them, exchanged without losing tracks."""

import dataclasses
import threading
from functools import cache

import numpy as np
import pytest

from modt import assets, profile
from modt.app.chosen_profile import FOUND, choose
from modt.app.inputs import Request
from modt.app.stages import Stages
from modt.energy.ledger import Ledger
from modt.errors import MisuseError
from modt.geometry import rotation_zyx
from modt.segmentation.segmenter import Segmenter
from modt.trust.sample import REACH_SHARE
from modt.trust.watch import TrustWatch
from modt.types import NONE, UNLIMITED, Frame, TrustLevel
from modt_simulation.synthetic_stream import SyntheticStream

INFO = SyntheticStream("street", "vlp-16", 2.0, 0).info


@cache
def frames():
    return tuple(dataclasses.replace(f, T_world_sensor=None) for f in SyntheticStream("street", "vlp-16", 2.0, 0))


def stages_of(**request):
    return Stages(Request(**{"profile": ("vlp-16",), **request}), INFO, Ledger(), live=True)


def step(stages, frame):
    """Result of a whole frame, as many calls as it asks for."""
    return stages.step(frame, UNLIMITED, reduced=False)


CALLS = ("view.segment", "odometry.locate", "tracker.track", "fusion.observe", "fusion.asks", "scheduler.select")
CALLS += ("classifier.classify", "fusion.fuse", "decision.decide", "tracker.confirm")


@pytest.mark.parametrize("after", [False, True], ids=["before its work", "after it"])
@pytest.mark.parametrize("call", CALLS)
def test_a_failure_of_any_stage_costs_its_frame_and_no_track(call, after, monkeypatch):
    stages = stages_of()
    failures = 0
    ids = {}
    stage, method = call.split(".")
    real = getattr(getattr(stages.pipeline, stage), method)

    def fail(*arguments):
        if after:
            real(*arguments)
        raise RuntimeError(call)

    for frame in frames()[:12]:
        with monkeypatch.context() as patch:
            if frame.index in (8, 9):
                patch.setattr(getattr(stages.pipeline, stage), method, fail)
            try:
                result = step(stages, frame)
            except RuntimeError:
                failures += 1
                patch.undo()
                stages.recover(anew=False)
                continue
        tracks = result.tracks
        ids[frame.index] = set(tracks.id.tolist())
        assert len(ids[frame.index]) == len(tracks)
        owned = tracks.proposal[tracks.proposal != NONE]
        assert sorted(owned.tolist()) == list(range(len(result.proposals)))
        assert np.isfinite(tracks.x).all()
    assert failures in (1, 2)  # a call that no track asks for is not made
    assert len(ids[7] & ids[10]) >= 0.7 * len(ids[7])


@pytest.mark.parametrize("posed", [False, True])
def test_a_clock_that_steps_costs_no_track(posed):
    steady = stages_of()
    stepping = stages_of()
    pose = np.eye(4) if posed else None
    for given in frames()[:15]:
        frame = dataclasses.replace(given, T_world_sensor=pose, steady_s=given.stamp_s)
        expected = step(steady, frame)
        step_s = 3600.0 * (frame.index >= 6) - 7200.0 * (frame.index >= 12)
        result = step(stepping, dataclasses.replace(frame, stamp_s=frame.stamp_s + step_s))
        assert result.tracks.id.tolist() == expected.tracks.id.tolist()
        np.testing.assert_array_equal(result.tracks.x, expected.tracks.x)


def ids_of(stages, which):
    """Ids of the tracks in some of the frames."""
    return {i for frame in frames()[which] for i in step(stages, frame).tracks.id.tolist()}


def test_renewed_stages_begin_without_tracks_and_never_give_an_id_twice():
    stages = stages_of()
    before = ids_of(stages, slice(5))
    stages.recover(anew=True)
    assert before.isdisjoint(ids_of(stages, slice(5, 6)))


def test_a_reload_takes_the_new_profile_and_keeps_the_tracks(tmp_path):
    own = tmp_path / "robot.yaml"
    base = profile.load("vlp-16")
    own.write_text(profile.to_yaml(profile.dump(base)))
    stages = stages_of(profile=str(own))
    for frame in frames()[:8]:
        before = step(stages, frame)
    text = own.read_text()
    own.write_text(text.replace("calls_per_frame: 24", "calls_per_frame: 0"))
    stages.reload()
    assert stages.budget.calls == 0
    after = stages.step(frames()[8], stages.budget, reduced=False)
    kept = set(after.tracks.id.tolist())
    held = set(before.tracks.id.tolist())
    assert len(kept & held) >= 0.8 * len(held)
    own.write_text(text.replace("calls_per_frame", "calls_per_fraem"))
    with pytest.raises(MisuseError, match="calls_per_frame"):
        stages.reload()
    assert stages.budget.calls == 0
    stages.step(frames()[9], stages.budget, reduced=False)


def test_a_profile_is_read_at_the_start_and_at_reloads_alone(tmp_path):
    own = tmp_path / "robot.yaml"
    own.write_text("sensor: {height_m: 1.5}")
    stages = stages_of(profile=(own,))
    own.write_text("sensor: {hight_m: 1.5}")
    stages.choose_profile(frames()[0])
    assert stages.config.sensor.height_m == 1.5
    with pytest.raises(MisuseError, match="hight_m"):
        stages.reload()


@pytest.fixture
def installation(monkeypatch):
    """Takes away the files of the installation, and gives them back."""
    there = assets._ROOTS

    def switch(*, gone):
        monkeypatch.setattr(assets, "_ROOTS", () if gone else there)

    return switch


def awaited(stages, frame):
    """Adapt to a sweep of some time, after the comparison that this begins."""
    stages.adapt(frame)
    if stages.comparison is not None:
        stages.comparison.join()
    stages.adapt(frame)


def test_a_first_sweep_that_cannot_be_compared_keeps_the_profile_and_a_later_one_is(installation):
    stages = stages_of(profile=None)
    began_with = stages.chosen
    first = frames()[0]
    installation(gone=True)
    with pytest.raises(MisuseError, match="installation"):
        stages.choose_profile(first)
    assert stages.chosen is began_with
    assert "cannot be compared" in stages._findings()["profile"].cause
    assert len(step(stages, first).proposals)
    with pytest.raises(MisuseError, match="installation"):
        awaited(stages, dataclasses.replace(first, steady_s=2.0))
    installation(gone=False)
    awaited(stages, dataclasses.replace(first, steady_s=4.0))
    assert stages.chosen.recognition.differences
    assert not stages._findings()
    assert stages.misfits == 0


def test_an_exchanged_sensor_that_cannot_be_compared_is_said_until_it_can(installation):
    stages = stages_of(profile=None)
    first = frames()[0]
    stages.choose_profile(first)
    chosen = stages.chosen
    assert not stages._findings()
    other, *_ = SyntheticStream("street", "hdl-64e", 0.1, 0)
    installation(gone=True)
    stages.trust.watch.compare_profiles = True
    with pytest.raises(MisuseError, match="installation"):
        awaited(stages, dataclasses.replace(other, steady_s=2.0))
    assert stages.chosen is chosen
    assert "cannot be compared" in stages._findings()["profile"].cause
    step(stages, dataclasses.replace(other, T_world_sensor=None))
    installation(gone=False)
    awaited(stages, dataclasses.replace(other, steady_s=4.0))
    assert stages.chosen is not chosen
    assert "another sensor" in stages._findings()["profile"].cause


def test_stages_that_cannot_be_renewed_go_on_without_tracks(installation):
    stages = stages_of()
    before = ids_of(stages, slice(5))
    installation(gone=True)
    with pytest.raises(MisuseError, match="installation"):
        stages.recover(anew=True)
    assert before.isdisjoint(ids_of(stages, slice(5, 6)))


def test_a_reload_that_fails_changes_nothing(installation):
    stages = stages_of()
    stages.choose_profile(frames()[0])
    chosen = stages.chosen
    pipeline = stages.pipeline
    installation(gone=True)
    with pytest.raises(MisuseError, match="installation"):
        stages.reload()
    assert stages.chosen is chosen
    assert stages.pipeline is pipeline
    installation(gone=False)
    stages.reload()


def test_profiles_of_several_sensors_are_read_at_the_start_and_at_reloads_alone(tmp_path):
    own = tmp_path / "corner.yaml"
    own.write_text("extends: vlp-16")
    robot = tmp_path / "robot.yaml"
    mounted = f"{{profile: {own}, position_m: [0, 0, 0.8]}}"
    robot.write_text(f"sensors: {{one: {mounted}, other: {mounted}}}")
    stages = stages_of(profile=(robot,))
    own.write_text("extends: vlp-61")
    sweep = frames()[0]
    stages.choose_profile(dataclasses.replace(sweep, sweeps=(sweep, sweep)))
    stages.recover(anew=True)
    with pytest.raises(MisuseError, match="vlp-61"):
        stages.reload()
    assert profile.dump(stages.config)["sensors"]["one"]["profile"] == str(own)


def test_a_reload_keeps_the_sensor_that_the_first_sweep_showed():
    tilted = SyntheticStream("yard", "vlp-16", 0.2, 3, mount_deg=(0.0, 12.0))
    stages = stages_of(profile=None)
    first, _ = tilted
    stages.choose_profile(first)
    sensor = stages.config.sensor
    made = stages.pipeline
    assert sensor.pitch_deg == pytest.approx(12.5, abs=1.0)
    assert stages.step(first, stages.budget, reduced=False).frame.R_level_sensor is not None
    stages.reload()
    assert stages.config.sensor == sensor
    assert stages.pipeline is not made


def test_a_reload_of_another_sensors_profile_is_a_reason_until_the_right_one_is_loaded(tmp_path):
    own = tmp_path / "robot.yaml"

    def write(name):
        own.write_text(profile.to_yaml(profile.dump(profile.load(name))))

    write("vlp-16")
    stages = stages_of(profile=str(own))
    stages.choose_profile(frames()[0])
    assert not stages._findings()
    write("hdl-64e")
    stages.reload()
    (finding,) = stages._findings().values()
    assert finding.level is TrustLevel.DEGRADED
    assert "do not fit the profile" in finding.cause
    write("vlp-16")
    stages.reload()
    assert not stages._findings()


def test_a_reduced_frame_holds_what_is_near():
    stages = stages_of()
    delay_s = np.arange(len(frames()[0].points), dtype=np.float32)
    frame = dataclasses.replace(frames()[0], delay_s=delay_s)
    reach_m = REACH_SHARE * stages.config.sensor.max_range_m
    result = stages.step(frame, UNLIMITED, reduced=True)
    is_near = np.hypot(*frame.points[:, :2].T) <= reach_m
    assert not is_near.all()
    assert result.frame.points.tolist() == frame.points[is_near].tolist()
    assert result.frame.delay_s.tolist() == delay_s[is_near].tolist()


def followed(stages, sweeps):
    """Trust after the last of some sweeps in a row, a comparison with the profile being awaited."""
    for frame in sweeps:
        trust = step(stages, frame).trust
        stages.adapt(frame)
        if stages.comparison is not None:
            stages.comparison.join()
    return trust


def of_drive(sensor, first, n):
    return [
        dataclasses.replace(
            frame, index=first + frame.index, stamp_s=0.1 * (first + frame.index), T_world_sensor=None
        )
        for frame in SyntheticStream("street", sensor, 0.1 * n, 0)
    ]


@pytest.mark.slow
def test_another_sensor_is_noticed_and_followed_and_the_first_one_is_believed_again():
    stages = stages_of(profile=None)
    before, *_ = of_drive("hdl-64e", 0, 1)
    stages.choose_profile(before)
    assert stages.chosen.name == "hdl-64e"
    assert followed(stages, of_drive("hdl-64e", 0, 20)).keys == ()
    trust = followed(stages, of_drive("vlp-16", 20, 30))
    assert stages.misfits == 1
    assert stages.chosen.name == "as found"
    assert stages.config.sensor.elevation_step_deg > 1.0 or stages.config.sensor.elevations_deg
    assert "profile" in trust.keys
    followed(stages, of_drive("hdl-64e", 50, 15))
    assert (stages.misfits, stages.chosen.name) == (2, "hdl-64e")


def with_exchanged_profile():
    """Stages whose profile was exchanged for a sweep that lacks half of its points, and the whole sweep."""
    stages = stages_of(profile="vlp-16")
    first = frames()[0]
    stages.choose_profile(first)
    stages._compare(dataclasses.replace(first, points=first.points[::2]))
    stages.adapt(first)
    return stages, first


def test_a_sensor_that_does_not_fit_the_requested_profile_is_named_until_it_does():
    stages, first = with_exchanged_profile()
    assert list(stages._findings()) == ["profile"]
    stages._compare(first)
    stages.adapt(first)
    assert not stages._findings()
    assert stages.misfits == 2


def test_an_exchange_that_was_the_effect_of_a_fault_is_taken_back_without_another_sign_of_it():
    """The fault began and ended while nothing was seen, so no reason changes when it ends."""
    stages, first = with_exchanged_profile()
    for time_s, found in ((1.9, ["profile"]), (2.0, []), (9.0, [])):
        awaited(stages, dataclasses.replace(first, stamp_s=time_s, steady_s=time_s))
        assert list(stages._findings()) == found
    assert stages.misfits == 2


def test_sensors_that_alternate_are_looked_at_by_one_thread_at_a_time(monkeypatch):
    stages = stages_of()
    may_end = threading.Event()
    looks = []

    def look(frame):
        looks.append(frame.index)
        may_end.wait(60)

    monkeypatch.setattr(stages, "_compare", look)
    for k in range(10):
        stages.trust.watch.compare_profiles = True
        stages.adapt(Frame(k, 0.1 * k, frames()[0].points))
    assert looks == [0]
    may_end.set()
    stages.comparison.join()
    stages.adapt(Frame(10, 1.0, frames()[0].points))
    stages.comparison.join()
    assert looks == [0, 10]  # what it could not look at meanwhile


BEAMS_DEG = (-15.1, *(float(v) for v in range(-13, 14, 2)), 15.2)


@pytest.mark.parametrize(
    ("asked", "named", "sensor", "beams"),
    [
        ((), "vlp-16", "vlp-16", BEAMS_DEG),
        ((), None, FOUND, BEAMS_DEG),
        (("vlp-16",), None, "vlp-16", profile.load("vlp-16").sensor.elevations_deg),
    ],
    ids=["a known sensor", "an unknown one", "a profile that was asked for"],
)
def test_beams_that_the_source_knows_are_used_unless_a_sensor_is_asked_for(asked, named, sensor, beams):
    info = dataclasses.replace(INFO, profile=named, elevations_deg=BEAMS_DEG)
    for first in (None, frames()[0]):
        chosen = choose(profile.resolve(asked), first, info)
        assert chosen.config.sensor.elevations_deg == beams
    assert chosen.sensor == sensor


def faster(frame, every):
    """The frame as of a head that turns `every` times as fast."""
    column = np.rint(np.rad2deg(np.arctan2(frame.points[:, 1], frame.points[:, 0])) / 0.2).astype(int)
    return dataclasses.replace(frame, points=frame.points[column % every == 0])


@pytest.mark.parametrize(("every", "step_deg"), [(1, 0.2), (2, 0.4), (5, 0.2)])
def test_a_head_at_twice_the_speed_of_a_named_profile_has_returns_twice_as_far_apart(every, step_deg, caplog):
    """At other speeds the profile is kept as it was asked for."""
    chosen = choose(profile.resolve("vlp-16"), faster(frames()[0], every), None)
    assert chosen.config.sensor.azimuth_step_deg == pytest.approx(step_deg)
    assert chosen.fits == (every < 5)
    assert ("2 times the speed of profile vlp-16" in caplog.text) == (every == 2)


def test_a_head_at_twice_the_speed_of_the_profile_that_its_source_names_keeps_it():
    chosen = choose(profile.resolve(), faster(frames()[0], 2), dataclasses.replace(INFO, profile="vlp-16"))
    assert chosen.sensor == "vlp-16"
    assert chosen.config.sensor.azimuth_step_deg == pytest.approx(0.4)


def test_a_displaced_sensor_keeps_its_profile_until_it_is_back(monkeypatch):
    stages = stages_of()
    frame = frames()[0]
    monkeypatch.setattr(TrustWatch, "displaced", True)
    stages.trust.watch.compare_profiles = True
    stages.adapt(frame)
    assert stages.comparison is None
    monkeypatch.setattr(TrustWatch, "displaced", False)
    stages.adapt(frame)
    stages.comparison.join()


@pytest.mark.parametrize("tilt_deg", [0.0, 5.0], ids=["level", "tilted"])
def test_a_dead_beam_is_left_out_while_the_sweeps_are_level(tilt_deg, monkeypatch):
    stages = stages_of()
    R_level_sensor = rotation_zyx(0.0, np.deg2rad(tilt_deg), 0.0) if tilt_deg else None
    told = []
    monkeypatch.setattr(TrustWatch, "dead_deg", (1.0,))
    monkeypatch.setattr(Segmenter, "leave_out", lambda segmenter, dead_deg: told.append(dead_deg))
    level = lambda frame: dataclasses.replace(frame, R_level_sensor=R_level_sensor)  # noqa: E731
    monkeypatch.setattr(stages.pipeline.view.leveller, "level", level)
    for frame in frames()[:2]:
        step(stages, frame)
    assert told == 2 * [() if tilt_deg else (1.0,)]
