"""The compiled kernels give the bytes of NumPy's, on any input, but for the last bit of a sum."""

from __future__ import annotations

import ctypes
import dataclasses
import os

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from modt import profile
from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.geometry.native_kernels import NativeGeometryKernels
from modt.native import build
from modt.native.library import NotAvailableError, load
from modt.observations import observe
from modt.odometry.pose_estimator import PoseEstimator
from modt.segmentation.cell_clusterer import CellClusterer
from modt.segmentation.cells import AirOfCells
from modt.segmentation.clusters import Clusters
from modt.segmentation.grids import FAR_M, PointColumns, SqrtRangeGrid
from modt.segmentation.groups import Groups, consecutive
from modt.segmentation.kernels import NUMPY, Kernels
from modt.segmentation.native_kernels import NativeKernels
from modt.segmentation.segmenter import Segmenter
from modt.segmentation.tuning import SegmentationTuning
from modt.tracking.extent import extent_update_of
from modt.tracking.sight import sight_of
from modt.tracking.states import ACCURATE
from modt.tracking.tracker import Tracker
from modt.tracking.tuning import SightTuning
from modt.types import NONE, UNRECORDED, PointKind
from modt_simulation.synthetic_stream import SyntheticStream
from tests.geometry.test_kdop import WEIGHTS, random_kdops, random_pairs, random_sights
from tests.segmentation import scans
from tests.segmentation.test_car_merging import strips
from tests.segmentation.test_cells import cloud
from tests.segmentation.test_heads import BICYCLE, TROLLEY, arguments, person
from tests.tracking.test_motion_filter import begun
from tests.tracking.test_motion_filter import step as filter_step
from tests.tracking.test_sight import scene as sight_scene
from tests.tracking.tracking_scenes import frame_of, tracks_at

SANITIZED = "MODT_SANITIZED" in os.environ
"""Set by `python -m tools.sanitize`."""
SENSOR = SensorConfig()
FULL = FieldOfView()
FRONT = FieldOfView(np.array([[0.0, 1.0, 0.0, 0.0]]))
SEEDS = st.integers(0, 10_000)
GENERATORS = st.builds(np.random.default_rng, SEEDS)
UP = np.deg2rad(np.linspace(-24, 20, 40))
HOSTILE = [np.nan, np.inf, -np.inf, 1e-45, -1e-40, 3e38, -3e38, FAR_M, 999.0, 0.0, -0.0]


@pytest.fixture(scope="module")
def kernels(tmp_path_factory):
    path = tmp_path_factory.mktemp("native") / "kernels.so"
    try:
        flags = (*build.CHECKED, *build.SANITIZERS) if SANITIZED else (*build.FLAGS, "-Werror")
        build.compile_library(path, build.BASELINE, flags=flags)
    except build.NoCompilerError as error:
        if "no C compiler" not in str(error):
            raise
        try:
            return NativeKernels(*load())  # of a wheel
        except NotAvailableError:
            pytest.skip(str(error))
    return NativeKernels(ctypes.CDLL(str(path)), build.BASELINE)


def same(one, other):
    """Whether two results are equal: to the byte, signs of zeros apart, but to a part in 10^13 for sums."""
    if dataclasses.is_dataclass(one):
        return all(same(getattr(one, f.name), getattr(other, f.name)) for f in dataclasses.fields(one))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray):
        if one.dtype == np.float64 and one.shape == other.shape:
            return np.allclose(one, other, rtol=1e-13, atol=1e-13, equal_nan=True)
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    return one == other


def both(kernels, points, sensor=SENSOR, fov=FULL, tuning=SegmentationTuning()):
    """Proposals of NumPy's kernels, which those of the compiled ones equal."""
    numpy, native = (
        Segmenter(SegmentationConfig(), sensor, fov, each, tuning).segment(points.copy()) for each in (NUMPY, kernels)
    )
    assert same(numpy, native)
    return numpy


def street(seed, n):
    """(n, 4) points of ground, walls and things that stand on it."""
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 20, (n, 4)).astype(np.float32)
    points[:, 2] = rng.normal(-1.7, 0.05, n)
    for _ in range(12):
        own, centre = rng.random(n) < 0.05, rng.uniform(-30, 30, 2)
        points[own, :2] = centre + rng.uniform(-1, 1, (int(own.sum()), 2)) * rng.uniform(0.2, 3.0, 2)
        points[own, 2] = rng.uniform(-1.7, 0.3, int(own.sum()))
    points[:, 3] = rng.choice([UNRECORDED, 0.0, 0.3, 0.9], n)
    return points


def make_hostile(points, rng, share):
    """Replace a share of the coordinates."""
    values = np.array(HOSTILE, np.float32)[rng.integers(0, len(HOSTILE), (len(points), 3))]
    np.copyto(points[:, :3], values, where=rng.random(values.shape) < share)


@pytest.mark.slow
@given(seed=SEEDS, n=st.integers(0, 3000), front=st.booleans(), share=st.just(0.0) | st.floats(0, 1))
@settings(max_examples=160, deadline=None)
def test_random_sweeps_with_a_share_of_hostile_coordinates(kernels, seed, n, front, share):
    sensor = SensorConfig(reflectance="hdl-64e", height_m=(None, 1.73)[seed % 2])
    points = street(seed, n)
    make_hostile(points, np.random.default_rng(seed), share)
    with np.errstate(all="ignore"):
        both(kernels, points, sensor, FRONT if front else FULL)


@pytest.mark.slow
def test_a_million_points(kernels):
    both(kernels, street(1, 1_000_000))


def test_rows_of_any_width_and_order(kernels):
    points = street(3, 2000)
    wide = np.concatenate([points, points], axis=1)
    assert same(both(kernels, points), both(kernels, wide))
    assert same(both(kernels, points), both(kernels, wide[:, :4]))
    with pytest.raises(ValueError, match="x, y, z and reflectance"):
        both(kernels, np.ascontiguousarray(points[:, :3]))


def test_the_points_of_a_ceiling(kernels):
    points, _ = scans.scan([(5, 0, 0.4, 0.5, 0, 1.75), (0, 0, 40, 40, 2.0, 2.2)], 0.8, elevation=scans.VLP_16)
    kinds = both(kernels, points, SensorConfig(height_m=0.8)).kind
    assert (kinds == PointKind.OVERHEAD).sum() > 1000
    numpy, native = (
        Segmenter(SegmentationConfig(), SensorConfig(height_m=0.8), FULL, each) for each in (NUMPY, kernels)
    )
    assert same(numpy.above_ground(points), native.above_ground(points))


@pytest.mark.parametrize("share", [0.0, 0.3], ids=["clear", "haze"])
@pytest.mark.parametrize("seed", range(4))
def test_people_at_and_in_a_wall_and_below_what_hangs_in_clear_air_and_haze(kernels, seed, share):
    rng = np.random.default_rng(seed)
    wall_m = rng.uniform(3.0, 5.0)
    boxes = []
    for x in np.arange(-9.0, 9.0, 4.0):
        boxes.append((x, wall_m, 3.0, 0.2, 0.0, 2.5))
        boxes.append((x + rng.uniform(-1, 1), wall_m - rng.uniform(0.3, 0.8), 0.4, 0.5, 0.0, rng.uniform(1.2, 1.9)))
        boxes.append((x + 2.0, wall_m + rng.uniform(-0.3, 0.6), 0.4, 0.5, 0.0, 1.75))
    for x, y, low_m in rng.uniform([-8, -8, 1.7], [8, -2, 2.3], (12, 3)):
        boxes.append((x, y, 0.4, 0.5, 0.0, low_m - rng.uniform(0.1, 0.6)))
        boxes.append((x + rng.normal(0, 0.3), y, *rng.uniform(0.4, 1.5, 2), low_m, low_m + 0.3))
    points, _ = scans.scan(boxes, 0.8, UP, step_deg=0.6, seed=seed)
    in_air = rng.random(len(points)) < share
    points[in_air, :3] *= rng.uniform(0.1, 1.0, (in_air.sum(), 1)).astype(np.float32)
    turn_rad = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]])
    points[:, :2] = points[:, :2] @ turn
    both(kernels, points, SensorConfig(height_m=0.8, elevation_step_deg=1.1, azimuth_step_deg=0.6))


@given(seed=SEEDS, dead=st.sets(st.integers(0, 15), max_size=4))
@settings(max_examples=30, deadline=None)
def test_sweeps_with_dead_beams(kernels, seed, dead):
    car = (4.2, 1.8, 0.2, 1.4)
    points, _ = scans.scan([(9.0, 1.0, *car), (14.0, -3.0, *car)], 0.8, scans.VLP_16, seed=seed, step_deg=1.0)
    sensor = profile.load("vlp-16").sensor
    numpy, native = (Segmenter(SegmentationConfig(), sensor, FULL, each) for each in (NUMPY, kernels))
    for each in (numpy, native):
        each.leave_out(tuple(sensor.beam_elevations_deg[k] for k in dead))
    assert same(numpy.above_ground(points), native.above_ground(points))
    assert same(numpy.segment(points), native.segment(points))


def test_every_value_of_the_tuning_reaches_both_kernels_alike(kernels):
    points = street(5, 3000)
    for part in dataclasses.fields(SegmentationTuning()):
        mechanism = getattr(SegmentationTuning(), part.name)
        for field in dataclasses.fields(mechanism):
            value = getattr(mechanism, field.name)
            if isinstance(value, int | float):
                changed = {field.name: value + 1 if isinstance(value, int) else 1.2 * value}
                tuning = dataclasses.replace(
                    SegmentationTuning(), **{part.name: dataclasses.replace(mechanism, **changed)}
                )
                both(kernels, points, tuning=tuning)


@given(seed=SEEDS, n=st.integers(1, 400), sigma=st.floats(0.05, 3.0))
@settings(max_examples=60, deadline=None)
def test_cells_and_components(kernels, seed, n, sigma):
    points = PointColumns.from_array(cloud(seed, n, sigma))
    assume(len(points))
    grid, height = SqrtRangeGrid(0.03, 80.0), points.z + 1.7
    expected, found = (k.occupied_cells(grid, points, height) for k in (NUMPY, kernels))
    assert same(expected, found)
    cells, sample, sampled, cell = expected
    assert (grid.number == NONE).all(), "the grid is empty again"
    rng = np.random.default_rng(seed)
    step_deg, max_extent_m = rng.choice([0.05, 0.2, 2.0]), rng.uniform(1.0, 9.0)
    config = SegmentationConfig(cell_m=0.06 * np.sqrt(10), max_extent_m=max_extent_m)
    clusterer = CellClusterer(SensorConfig(max_range_m=80.0, azimuth_step_deg=step_deg), config)
    beam_m = rng.choice([0.0, 0.05, 0.4], len(cells)).astype(np.float32)
    clustered = [k.cluster(clusterer, cells, sampled, beam_m) for k in (NUMPY, kernels)]
    assert same(*clustered)
    use = rng.random(len(cells)) < rng.choice([0.0, 0.7, 1.0])
    kept, own = np.unique(clustered[0][0][use], return_inverse=True)
    n, used = len(kept), np.full(len(cells), len(kept))
    used[use] = own
    kind = np.zeros(len(cells), np.int8)
    clusters = Clusters(points, height, cell, cells, sample, sampled, used, kind, n + 1, AirOfCells.none(len(cells)))
    number = consecutive(np.append(rng.random(n) < 0.7, [False]))
    assert same(*(k.view_bounds(clusters, number, number.max() + 1) for k in (NUMPY, kernels)))


@given(rng=GENERATORS, sizes=st.lists(st.integers(1, 60), min_size=1, max_size=8), extra=st.integers(0, 9))
@settings(max_examples=60, deadline=None)
def test_groups(kernels, rng, sizes, extra):
    labels = rng.permutation(np.repeat(np.append(np.arange(len(sizes)), NONE), [*sizes, extra]))
    groups = Groups.from_labels(labels, len(sizes))
    assert same(groups, kernels.group(labels, len(sizes)))
    x, y = rng.normal(0, 2, (2, len(labels))).astype(np.float32)
    assert same(*(k.best_headings(x, y, groups, 20, 0.1) for k in (NUMPY, kernels)))
    xyz, yaw = rng.normal(0, 9, (3, len(groups.rows))).astype(np.float32), rng.uniform(-7, 7, len(sizes))
    assert same(*(k.upright_boxes(xyz, groups.offsets, yaw) for k in (NUMPY, kernels)))
    assert same(*(k.group_sums(xyz, groups.offsets) for k in (NUMPY, kernels)))
    points = rng.choice([UNRECORDED, 0.0, 0.001, 0.5, 0.85], (len(labels), 4)).astype(np.float32)
    assert same(*(k.reflectance_statistics(points, groups.rows, groups.offsets) for k in (NUMPY, kernels)))


def some_strips(rng, n):
    return (
        strips(rng, n + 1),
        np.full(n + 1, np.deg2rad(rng.uniform(0.05, 2.0)), np.float32),
        SegmentationTuning().strips,
    )


def some_kdops(rng, n):
    offsets = np.cumsum([0, *rng.integers(1, 61, 1 + n % 8)])
    xyz, axes = (rng.normal(0, 9, shape).astype(np.float32) for shape in ((3, offsets[-1]), (3, 4)))
    return xyz, offsets, axes


def some_runs(rng, n):
    runs = np.sort(rng.integers(0, n + 1, (2, rng.integers(0, 7))), axis=0)
    return rng.permutation(n), rng.normal(0, 9, (3, n)).astype(np.float32), runs


def some_pairs(rng, n):
    return *random_pairs(int(rng.integers(2**16)), n % 13), WEIGHTS


def some_covered(rng, n):
    a, b = random_kdops(rng, 1 + n % 13)
    return *in_some_order(rng, a, b), *rng.integers(0, a.shape[1], (2, n))


def some_overlaps(rng, n):
    """K-DOPs that all overlap are more pairs than there is room for at first."""
    spread, scale = rng.choice([0, 1, 10, 60]), rng.choice([1e-3, 1.0, 100.0])
    a, b = (rng.integers(-spread, spread + 1, (8, m)) * scale for m in (n, rng.integers(0, 61)))
    a[:, :1], a[:, 1:2] = np.inf, np.nan  # overlaps all, overlaps nothing
    return in_some_order(rng, a, b)


def in_some_order(rng, a, b):
    """Both as they are, or with columns that are contiguous instead of rows."""
    return [rng.choice([np.asarray, np.asfortranarray])(kdop) for kdop in (a, b)]


def some_displacements(rng, n):
    return *random_kdops(rng, n), random_sights(rng, n), rng.uniform(0.01, 1.0), rng.uniform(0, 0.5, (4, n))


def some_assignments(rng, n):
    k, ties = rng.integers(1, 13), rng.choice([0, 1, 2, 5, 9])
    rows, columns = np.divmod(rng.permutation(n % 13 * k)[: rng.integers(0, n % 13 * k + 1)], k)
    unequal = np.minimum(rng.uniform(-1, 1, len(rows)), 0.9)
    return rows, columns, rng.integers(0, ties, len(rows)) / 10 if ties else unequal, 1.0


def some_members(rng, n):
    sizes, groups = rng.integers(0, 10, n % 9), int(rng.integers(1, 10))
    offsets, label = np.cumsum([0, *sizes]), rng.integers(0, groups, len(sizes))
    members, xyz = rng.permutation(offsets[-1]), rng.normal(0, 9, (3, offsets[-1])).astype(np.float32)
    moved = (rng.random(offsets[-1]) < rng.choice([0.0, 0.3, 1.0])).nonzero()[0]
    return members, xyz, offsets, label, (moved, rng.integers(0, groups, len(moved))), groups


PASSES = {
    "merge_strips": some_strips,
    "kdop_ends": some_kdops,
    "copy_runs": some_runs,
    "coverage": some_covered,
    "overlapping_pairs": some_overlaps,
    "measured": some_displacements,
    "pair_costs": some_pairs,
    "assign": some_assignments,
    "sort_members": some_members,
}


@pytest.mark.parametrize(("name", "arguments"), PASSES.items())
@given(rng=GENERATORS, n=st.integers(0, 60))
@settings(max_examples=300, deadline=None)
def test_passes_on_random_input(kernels, name, arguments, rng, n):
    given = arguments(rng, n)
    assert same(*(getattr(each, name)(*given) for each in (NUMPY, kernels)))


@given(rng=GENERATORS, n=st.integers(0, 6), dt_s=st.sampled_from([0.0, 0.1, 3.0]))
@settings(max_examples=60, deadline=None)
def test_observed_tracks(kernels, rng, n, dt_s):
    boxes = rng.uniform(-20, 20, (n, 7))
    boxes[:, 3:6] = rng.uniform(0.1, 9.0, (n, 3))
    seen, rows = observe(frame_of(boxes)[1], np.eye(4)), rng.permutation(n)
    few = rows[: n // 2 + 1]
    tables = [tracks_at(np.roll(boxes, 1, axis=0), *range(min(n, 4))) for _ in range(2)]
    for table, each in zip(tables, (NUMPY, kernels), strict=True):
        table.final[::2] = False
        extent_update_of(each)(table, few, np.arange(len(few)), seen, seen.position[: len(few)].copy(), dt_s)
    assert same(*tables)


@given(rng=GENERATORS, m=st.integers(0, 5), dt_s=st.sampled_from([0.0, 0.1, 3.0]))
@settings(max_examples=60, deadline=None)
def test_resting_and_moving_tracks(kernels, rng, m, dt_s):
    start = rng.normal(0, 30, (m, 2))
    later = start + rng.normal(0, 1, (2, m, 2))
    tables = []
    for each in (NUMPY, kernels):
        subject, tracks = begun(start, each)
        for position in later:
            filter_step(subject, tracks, position, dt_s)
        tables.append(tracks)
    assert same(*tables)


@given(rng=GENERATORS, n=st.integers(1, 5), rays=st.sampled_from([1, 500, 10**6]))
@settings(max_examples=40, deadline=None)
def test_lines_of_sight(kernels, rng, n, rays):
    boxes = rng.uniform(-12, 12, (n + 2, 7))
    boxes[:, 2] = rng.uniform(-1, 1, n + 2)
    boxes[:, 3:6] = rng.uniform(0.1, 4.0, (n + 2, 3))
    points, proposals = sight_scene(boxes, [PointKind.MEMBER] * n + [PointKind.STRUCTURE, PointKind.GROUND])
    which = rng.permutation(n)[: rng.integers(0, n + 1)]
    reference, compiled = (sight_of(each, SightTuning(rays=rays)) for each in (NUMPY, kernels))
    nearest = reference.look(points, proposals.kind)
    assert_array_equal(compiled.look(points, proposals.kind), nearest)
    sides = reference.bounded_sides(nearest, proposals, which)
    assert_array_equal(compiled.bounded_sides(nearest, proposals, which), sides)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "fov"), [("vlp-16", FULL), ("hdl-64e", FULL), ("mid-360", FRONT)])
def test_tracks_of_simulated_sweeps(kernels, name, fov):
    config, runs = profile.load(name), []
    for each in (NUMPY, kernels):
        segmenter = Segmenter(config.segmentation, config.sensor, fov, each)
        odometry, tracker = PoseEstimator(each), Tracker(config.tracking, ACCURATE, kernels=each)
        runs.append([])
        for frame in SyntheticStream("street", name, 1.0, 4):
            proposals = segmenter.segment(frame.points)
            located = odometry.locate(frame, proposals, tracker.static_tracks)
            tracked = tracker.track(frame.stamp_s, proposals, located, frame.points)
            tracked.decisions.object_class[:] = tracked.motion.id // 2 % 4  # people and cars grow and lose parts
            runs[-1].append((tracker.confirm(np.zeros(0, np.int64), np.zeros(0, np.bool_)), tracked.proposals))
    assert all(map(same, *runs))
    assert len(runs[0][-1][0]) > 3


def test_another_kind_of_array_is_refused(kernels):
    with pytest.raises(ctypes.ArgumentError, match="contiguous array of float32"):
        kernels.group_sums(np.zeros((1, 4)), np.array([0, 4]))
    with pytest.raises(ctypes.ArgumentError, match="contiguous"):
        kernels.group(np.zeros(8, np.int64)[::2], 1)


def test_every_pass_is_compiled():
    passes = {name for kind in Kernels.__mro__[:-1] for name in vars(kind) if not name.startswith("_")} - {"library"}
    compiled = {name for kind in (NativeKernels, NativeGeometryKernels) for name in vars(kind)}
    assert passes - {"name"} <= compiled


@given(GENERATORS)
def test_people_within_a_cluster_are_the_same(kernels, rng):
    heads = [person(*rng.uniform(-1, 1, 2), rng.uniform(1.2, 2.6)) for _ in range(rng.integers(4))]
    parts = [*heads, *[part for part in (TROLLEY - [5.5, 0, 0, 0, 0], *BICYCLE) if rng.random() < 0.4], person(0, 0)]
    x, y, low, high, points, tuning = arguments(*parts)
    seen = rng.random(len(x)) < rng.uniform(0.3, 1.0)
    high = high + rng.choice([0.0, 0.1], len(x)).astype(np.float32)
    columns = [v[seen] for v in (x, y, low, high, points)]
    assert_array_equal(kernels.find_people(*columns, tuning), NUMPY.find_people(*columns, tuning))
