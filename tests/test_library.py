"""The library, as a program with its own loop uses it."""

import dataclasses
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import modt
from modt.app import assembly
from modt.errors import MisuseError
from modt.geometry import FieldOfView, inverse, se3
from modt.placement import Mount
from modt.profile import load
from modt.types import NONE, OBSTACLES, PointKind
from modt_simulation.synthetic_stream import SyntheticStream
from tests.sources import layouts


@pytest.fixture(scope="module", name="frames")
def a_second_of_a_street():
    return list(SyntheticStream("street", "vlp-16", 1.0, seed=3))


@pytest.fixture(scope="module", name="found")
def objects_of_the_first_frame(frames):
    return modt.Pipeline.from_profile("vlp-16").step(frames[0].points, frames[0].stamp_s)


def test_importing_the_package_loads_nothing_heavy_and_its_public_names_are_listed():
    code = "import modt, sys; print('numpy' in sys.modules, {*modt.__all__, 'Pipeline'} <= {*dir(modt)})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


@pytest.mark.parametrize("mode", assembly.MODES)
def test_step_returns_what_the_pipeline_finds(frames, mode):
    library = modt.Pipeline.from_profile("vlp-16", mode=mode)
    config = load("vlp-16")
    chosen = assembly.MODES[mode]
    pipeline = assembly.pipeline(chosen, config, FieldOfView())
    for frame in frames:
        found = library.step(frame.points, frame.stamp_s, frame.T_world_sensor)
        result = pipeline.step(frame, chosen.budget(config))
        assert_array_equal(found.id, result.tracks.id)
        assert_array_equal(found.posterior, result.tracks.posterior)
        assert_array_equal(found.visible, result.tracks.proposal != NONE)
        boxes = result.proposals.box[result.tracks.proposal[found.visible]]
        assert_array_equal(found.seen[found.visible], boxes)
        assert np.isnan(found.seen[~found.visible]).all()
        assert_array_equal(found.T_world_sensor, frame.T_world_sensor)
        assert_array_equal(found.labels, result.labels)
        assert_array_equal(found.obstacles(), result.obstacles())
    assert len(found.objects()) > 0
    assert ((found.objects().object_class > 0) | found.objects().moving).all()


def test_labels_have_the_order_of_the_given_points_though_the_sensor_hangs_tilted(frames):
    config = load("vlp-16")
    turned = dataclasses.replace(config, sensor=dataclasses.replace(config.sensor, roll_deg=180.0, pitch_deg=15.0))
    R_level_sensor = Mount.of(180.0, 15.0).R_level_sensor
    level, tilted = (modt.Pipeline(each) for each in (config, turned))
    for frame in frames[:3]:
        points = frame.points.copy()
        points[:, :3] = frame.points[:, :3] @ R_level_sensor
        expected = level.step(frame.points, frame.stamp_s)
        found = tilted.step(points, frame.stamp_s)
        assert found.labels.shape == (len(points),)
        kinds = np.minimum(found.labels, PointKind.MEMBER)
        assert (kinds == np.minimum(expected.labels, PointKind.MEMBER)).mean() > 0.99
        rows = found.obstacles()
        assert len(rows) > 500
        assert_array_equal(rows, np.flatnonzero(np.isin(found.labels, OBSTACLES) | (found.labels >= 0)))


def test_frames_of_a_recording_are_stepped_with_their_poses_and_times(tmp_path):
    drive = modt.open(str(layouts.raw_drive(tmp_path)))
    by_frame, by_hand = (modt.Pipeline.from_profile("hdl-64e") for _ in range(2))
    assert drive.info.has_poses
    for frame in drive:
        found = by_frame.step(frame)
        expected = by_hand.step(frame.points, frame.stamp_s, frame.T_world_sensor, turn_s=frame.turn_s)
        assert found.as_dicts() == expected.as_dicts()
        assert_array_equal(found.T_world_sensor, frame.T_world_sensor)
    assert frame.index == drive.info.end - 1
    with pytest.raises(MisuseError, match="no time"):
        by_hand.step(frame.points)
    with pytest.raises(MisuseError, match="model does not apply"):
        modt.open(tmp_path, model="vlp-16")


def test_the_profile_of_a_recording_states_the_time_between_scans_without_stamps(tmp_path):
    for number in range(3):
        np.ones((9, 4), np.float32).tofile(tmp_path / f"{number:06}.bin")
    slow = tmp_path / "slow.yaml"
    slow.write_text("extends: vlp-16\nsensor: {period_s: 0.2}\n")
    assert [frame.stamp_s for frame in modt.open(tmp_path)] == pytest.approx([0.0, 0.1, 0.2])
    assert [frame.stamp_s for frame in modt.open(tmp_path, profile=slow)] == pytest.approx([0.0, 0.2, 0.4])


def test_without_poses_the_pose_is_the_registered_one(frames):
    library = modt.Pipeline.from_profile("vlp-16")
    start = inverse(frames[0].T_world_sensor)
    for frame in frames:
        found = library.step(frame.points, frame.stamp_s)
        assert_allclose(found.T_world_sensor, start @ frame.T_world_sensor, rtol=0, atol=0.2)
    assert np.linalg.norm(found.T_world_sensor[:3, 3]) > 1.0


def test_poses_of_utm_give_the_tracks_of_poses_near_their_origin(frames):
    utm = se3(np.eye(3), np.array([458_000.25, 5_430_000.5, 120.0]))
    near, far = (modt.Pipeline.from_profile("vlp-16") for _ in range(2))
    begin = frames[0].T_world_sensor[:3, 3]
    for frame in frames:
        expected = near.step(frame.points, frame.stamp_s, frame.T_world_sensor)
        found = far.step(frame.points, frame.stamp_s, utm @ frame.T_world_sensor)
        assert_array_equal(found.id, expected.id)
        assert_allclose(found.position, expected.position - begin[:2], rtol=0, atol=1e-3)
        assert_allclose(found.T_world_sensor[:3, 3], frame.T_world_sensor[:3, 3] - begin, rtol=0, atol=1e-6)


def test_rows_are_had_as_arrays_as_dictionaries_and_by_index(found):
    rows = found.as_dicts()
    assert len(rows) == len(found)
    assert [row["id"] for row in rows] == found.id.tolist()
    assert {row["object_class"] for row in rows} <= set(modt.CLASS_NAMES)
    assert rows[0]["seen"] == found.seen[0].tolist()
    assert found.take(np.array([1])).as_dicts() == rows[1:2]
    assert_array_equal(found.take(np.array([1])).T_world_sensor, np.eye(4))
    assert [str(row) for row in found] == list(map(str, rows))  # by text: NaN is not itself
    assert (str(found[0]), str(found[np.int64(-1)])) == (str(rows[0]), str(rows[-1]))
    for beyond in (len(rows), -len(rows) - 1):
        with pytest.raises(IndexError):
            found[beyond]
    with pytest.raises(TypeError):
        found[0:2]  # several rows: take


def test_the_text_of_results_is_one_short_line(found):
    nothing = found.take(np.zeros(0, np.int64))
    assert f"{np.count_nonzero(found.visible)} visible" in repr(found)
    shown = found, nothing, modt.Pipeline.from_profile("hdl-64e")
    assert all(len(repr(each)) < 120 and "\n" not in repr(each) and " object at " not in repr(each) for each in shown)
    assert found._repr_html_().count("<tr>") == len(found) + 1


def test_pandas_has_the_columns_of_the_dictionaries_though_there_are_no_rows(found, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=lambda rows, columns: (rows, columns)))
    rows, columns = found.to_pandas()
    assert columns == list(found.as_dicts()[0])
    assert str(rows) == str(found.as_dicts())
    assert found.take(np.zeros(0, np.int64)).to_pandas() == ([], columns)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MisuseError, match="needs pandas; pip install pandas"):
        found.to_pandas()


def test_points_without_reflectance_and_without_returns_are_taken(frames):
    library = modt.Pipeline.from_profile("vlp-16")
    points = np.vstack([frames[0].points[:, :3], [[np.nan, 0.0, 0.0]]])
    with_nan = library.step(points.tolist(), 0.0)
    without = modt.Pipeline.from_profile("vlp-16").step(frames[0].points[:, :3], 0.0)
    assert_array_equal(with_nan.box_world, without.box_world)
    assert len(library.step(np.zeros((0, 4)), 0.1).objects()) == 0


@pytest.mark.parametrize("columns", [3, 4])
def test_points_stored_column_by_column_give_the_same_tracks(frames, columns):
    points = frames[0].points[:, :columns]
    expected = modt.Pipeline.from_profile("vlp-16").step(points, 0.0)
    found = modt.Pipeline.from_profile("vlp-16").step(np.asfortranarray(points), 0.0)
    assert len(found) > 0
    assert_array_equal(found.box_world, expected.box_world)


@pytest.fixture(scope="module", name="library")
def a_pipeline_in_use():
    library = modt.Pipeline.from_profile("vlp-16")
    library.step(np.zeros((3, 4)), 0.0)
    return library


@pytest.mark.parametrize(
    ("points", "stamp_s", "T", "subject"),
    [
        (np.zeros((3, 5)), 1.0, None, "points"),
        (np.zeros(12), 1.0, None, "points"),
        (np.zeros((3, 4)), -1.0, None, "stamp"),
        (np.zeros((3, 4)), np.nan, None, "stamp"),
        (np.zeros((3, 4)), 1.0, np.eye(3), "T_world_sensor"),
        (np.zeros((3, 4)), 1.0, 2 * np.eye(4), "T_world_sensor"),
        (np.zeros((3, 4)), 1.0, np.full((4, 4), np.nan), "T_world_sensor"),
    ],
)
def test_wrong_arguments_are_named(points, stamp_s, T, subject, library):
    with pytest.raises(MisuseError, match=subject):
        library.step(points, stamp_s, T)
    library.step(np.zeros((3, 4)), 0.0)  # nothing was broken by it


def test_an_unknown_mode_is_named():
    with pytest.raises(MisuseError, match="accurate"):
        modt.Pipeline.from_profile("vlp-16", mode="fast")
    with pytest.raises(AttributeError, match="nothing"):
        _ = modt.nothing


@pytest.mark.parametrize("profiles", [[], ["raspberry-pi-5"]])
def test_without_a_profile_of_a_sensor_the_first_sweep_shows_which_it_is(frames, profiles, caplog):
    library = modt.Pipeline.from_profile(profiles)
    library.step(frames[0].points, 0.0)
    assert library.config.sensor.elevation_step_deg == pytest.approx(2.0, rel=0.02)
    assert library.config.energy == load(*profiles).energy
    assert [record.message.count("used instead") for record in caplog.records] == [1]


def test_a_sensor_that_is_covered_at_first_is_recognised_when_it_is_uncovered(frames):
    library = modt.Pipeline.from_profile()
    for k in range(3):
        library.step(np.zeros((100, 4)), 0.1 * k)
    library.step(frames[0].points, 0.3)
    assert library.config.sensor.elevation_step_deg == pytest.approx(2.0, rel=0.02)
