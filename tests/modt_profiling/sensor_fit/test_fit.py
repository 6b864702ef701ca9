"""Profiles from recordings: the keys besides the beams."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from modt import profile
from modt.sources.recognise import open_stream
from modt_profiling.sensor_fit.findings import Recording, doubts, profile_text
from modt_profiling.sensor_fit.fit import fit
from modt_simulation.sensors import sensor
from tests.sensor_fit.recordings import recording, with_mast, with_scale


@cache
def fitted(name, scene="street"):
    """Profile and findings of a recording as it is."""
    config, findings = fit(recording(name, scene))
    return config, tuple(findings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "scene"), [("vlp-16", "street"), ("hdl-64e", "hall"), ("pandar64", "street"), ("mid-360", "hall")]
)
def test_the_height_is_found(name, scene):
    config, _ = fitted(name, scene)
    assert config.sensor.height_m == pytest.approx(sensor(name).height_m, abs=0.1)


@pytest.mark.slow
def test_the_period_is_the_median_step_of_the_stamps():
    recorded = recording("vlp-16")
    stamps_s = np.cumsum(np.random.default_rng(0).normal(0.1, 0.002, 30)).tolist()
    config, findings = fit(dataclasses.replace(recorded, stamps_s=stamps_s))
    assert config.sensor.period_s == pytest.approx(0.1, rel=0.05)
    assert not any("period_s" in doubt for doubt in doubts(findings))
    _, findings = fit(dataclasses.replace(recorded, stamps_s=[0.1 * k for k in range(30)]))
    assert any("period_s" in doubt for doubt in doubts(findings))


@pytest.mark.slow
def test_a_mast_of_the_robot_is_a_blind_sector():
    config, _ = fit(with_mast(recording("vlp-16", "street"), 150.0, 1.9))
    first, last = config.sensor.blind_sectors_deg
    assert first == pytest.approx(145, abs=3)
    assert last == pytest.approx(155, abs=3)
    assert 1.9 < config.sensor.blind_range_m < 2.3
    assert fitted("vlp-16")[0].sensor.blind_sectors_deg is None


@pytest.mark.slow
def test_a_recording_that_stands_still_does_not_tell_the_robot_from_what_is_around_it():
    recorded = with_mast(recording("vlp-16", "street", 1), 150.0, 1.9)
    _, findings = fit(Recording([*recorded.sweeps] * 6, [0.1 * k for k in range(6)]))
    assert not any(f.key == "blind_sectors_deg" for f in findings)
    assert any("min_range_m" in doubt and "stands still" in doubt for doubt in doubts(findings))


def without_reflectance(recorded):
    swept = [np.column_stack([p[:, :3], np.full(len(p), -1, np.float32)]) for p in recorded.sweeps]
    return Recording(swept, recorded.stamps_s)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change", "scale", "evidence"),
    [
        ("hdl-64e", None, "hdl-64e", ""),
        ("vlp-16", None, "none", ""),
        ("pandar64", lambda recorded: with_scale(recorded, "pandar64"), "pandar64", "as of the pandar64"),
        ("vlp-16", lambda recorded: with_scale(recorded, "pandar64"), "none", "other beams"),
        ("hdl-64e", without_reflectance, "none", "none is recorded"),
    ],
)
def test_the_scale_of_the_reflectance_is_found_where_the_beams_are_known(name, change, scale, evidence):
    config, findings = fit(change(recording(name))) if change else fitted(name)
    assert config.sensor.reflectance == scale
    assert evidence in next(f.evidence for f in findings if f.key == "reflectance")


def test_the_text_is_the_profile():
    config, findings = fit(with_mast(recording("vlp-16"), 150.0, 1.9))
    text = profile_text("a sensor", findings)
    assert profile.parse(text) == config
    assert text.count("check this") == len(doubts(findings)) > 0
    assert max(map(len, text.split("\n"))) < 200


@pytest.mark.kitti
@pytest.mark.parametrize(
    ("path", "height_m", "reflectance"),
    [
        ("raw/2011_09_26/2011_09_26_drive_0005_sync", 1.73, "hdl-64e"),
        ("pandaset_002/scans", 2.13, "pandar64"),
    ],
)
def test_real_sensors(kitti_root, path, height_m, reflectance):
    frames = list(open_stream(kitti_root / path).between(0, 40))
    config, _ = fit(Recording([f.points for f in frames[::5]], [f.stamp_s for f in frames]))
    assert config.sensor.height_m == pytest.approx(height_m, abs=0.1)
    assert config.sensor.period_s == pytest.approx(0.1, rel=0.05)
    assert config.sensor.reflectance == reflectance
