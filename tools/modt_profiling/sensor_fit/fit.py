"""A profile from a recording: the finders in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from modt.app import assembly
from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt.geometry.field_of_view import BlindSectors
from modt.sensor_fit.beams import find_beams
from modt.sensor_fit.tilt import find_floor, ground_height_m
from modt.sources.stream import Stream
from modt.types import Float32, Frame
from modt_profiling.sensor_fit.body import BODY_REACH_M, find_body
from modt_profiling.sensor_fit.findings import (
    Finding,
    Recording,
    apply,
    find_height,
    find_reflectance,
    level,
    pattern_findings,
)

MAX_RANGE_M = 100.0
"""Objects farther away have too few returns to be known."""
MAX_MIN_RANGE_M = 2.0
EMPTY_SECTOR_DEG = 10.0
"""Least sector without a return that is mentioned."""
MOST_FLOORS = 10
"""Sweeps whose floor is fitted."""
LEVEL_DEG = 1.0
"""Tilt of a sensor that counts as level."""

MIN_PROPOSALS = 1000
"""Least number of proposals for a reliable frequency of the classes."""

Finder = Callable[[Recording, ProfileConfig], Iterable[Finding]]
"""Finds keys in a recording, given the profile with the keys that earlier finders have set."""


def find_period(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Time between sweeps."""
    steps = np.diff(recording.stamps_s)
    if not len(steps) or np.median(steps) <= 0:
        yield Finding("sensor", "period_s", config.sensor.period_s, "assumed: one sweep", reliable=False)
    elif np.ptp(steps) < 1e-6:
        evidence = "time stamps are exactly even: perhaps made up, as those of a folder of scans"
        yield Finding("sensor", "period_s", round(float(steps[0]), 4), evidence, reliable=False)
    else:
        evidence = f"median of {len(steps)} steps, {steps.min():.3f} to {steps.max():.3f} s"
        yield Finding("sensor", "period_s", round(float(np.median(steps)), 4), evidence)


def find_pattern(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Beams, their spacing, and the size of a cell."""
    pattern = find_beams(recording.sweeps)
    if pattern is None:
        yield Finding(
            "sensor", "elevation_step_deg", config.sensor.elevation_step_deg, "too few points", reliable=False
        )
        return
    yield from pattern_findings(pattern)


def find_mount(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Roll and pitch of the sensor, the median of sweeps."""
    floors = [floor for points in recording.sweeps[:MOST_FLOORS] if (floor := find_floor(points)) is not None]
    if not floors:
        yield Finding(
            "sensor", "roll_deg", None, "no floor in sight: by the first sweep that shows one", reliable=False
        )
        return
    angles = np.median([floor.roll_pitch_deg for floor in floors], axis=0)
    tilt_deg = float(np.median([floor.tilt_deg() for floor in floors]))
    evidence = f"by the floor in {len(floors)} sweeps: the sensor is tilted by {tilt_deg:.1f} deg"
    for key, angle in zip(("roll_deg", "pitch_deg"), angles.tolist(), strict=True):
        yield Finding("sensor", key, round(angle, 1) if tilt_deg > LEVEL_DEG else 0.0, evidence)


def find_body_and_range(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Returns of the robot itself, and the range of the others."""
    recording = level(recording, config)
    points = np.concatenate(recording.sweeps)
    range_m = np.hypot(points[:, 0], points[:, 1])
    height_m = ground_height_m(recording.sweeps, replace(config.sensor, min_range_m=BODY_REACH_M))
    body = None if height_m is None else find_body(recording.sweeps, height_m)
    on_robot = np.zeros(len(points), np.bool_)
    if body is not None and len(body.sectors_deg):
        bounds = tuple(np.round(body.sectors_deg, 1).ravel().tolist())
        evidence = "returns that move with the sensor; a wall along the way would look like that too"
        yield Finding("sensor", "blind_sectors_deg", bounds, evidence, reliable=False)
        yield Finding("sensor", "blind_range_m", round(body.range_m, 2), "farthest of these")
        on_robot = BlindSectors(bounds, body.range_m).contain(points)
    nearest = min(MAX_MIN_RANGE_M, float(np.floor(10 * np.quantile(range_m[~on_robot], 0.001))) / 10)
    evidence = f"of 0.1 % of the returns, at most {MAX_MIN_RANGE_M:g}"
    if body is None:
        evidence += "; whether they are on the robot is not known: the recording stands still or is too short"
    yield Finding("sensor", "min_range_m", nearest, evidence, reliable=body is not None)
    farthest = float(10 * np.ceil(np.quantile(range_m, 0.999) / 10))
    evidence = f"of 99.9 % of the returns, at most {MAX_RANGE_M:g}"
    yield Finding("sensor", "max_range_m", min(MAX_RANGE_M, farthest), f"{evidence}{empty_sectors(points)}")


def empty_sectors(points: Float32) -> str:
    """The sectors without a return, in words; empty where there are none."""
    azimuth_deg = np.sort(np.rad2deg(np.arctan2(points[:, 1], points[:, 0])))
    gap = np.diff(np.append(azimuth_deg, azimuth_deg[0] + 360))
    wide = np.flatnonzero(gap > EMPTY_SECTOR_DEG)
    words = [f"{azimuth_deg[k]:.0f} to {(azimuth_deg[k] + gap[k] + 180) % 360 - 180:.0f}" for k in wide]
    return f"; no returns at all from {' and from '.join(words)} deg" if words else ""


FINDERS: tuple[Finder, ...] = (
    find_period,
    find_pattern,
    find_mount,
    find_body_and_range,
    find_height,
    find_reflectance,
)
"""Finders in order: each uses the keys of those before it."""


def find_class_frequency(recording: Recording, config: ProfileConfig) -> Iterator[Finding]:
    """Frequency of the classes among the proposals of a recording, as the decision estimates it."""
    pipeline = assembly.pipeline(assembly.MODES["conventional"], config, FieldOfView())
    proposals = 0
    for number, points in enumerate(recording.sweeps):
        proposals += len(pipeline.step(Frame(number, recording.stamps_s[0] + number, points)).proposals)
    frequency = tuple(round(float(share), 4) for share in pipeline.decision.frequency[1:])
    evidence = f"cars, pedestrians, cyclists among {proposals} proposals, by their posteriors"
    yield Finding("decision", "frequency", frequency, evidence, reliable=proposals >= MIN_PROPOSALS)


def spread_sweeps(stream: Stream, number: int, max_frames: int) -> Recording:
    """Sweeps of a stream, spread evenly over its first max_frames frames, without points above the sensor itself."""
    n_frames = stream.info.n_frames
    if n_frames is None:
        n_frames = sum(1 for _ in islice(stream, max_frames))
    step = max(1, min(n_frames, max_frames) // number)
    stamps_s = []
    sweeps = []
    for index, frame in enumerate(islice(stream, step * number)):
        stamps_s.append(frame.stamp_s)
        if index % step == 0:
            sweeps.append(frame.points[(frame.points[:, :2] != 0).any(axis=1)])
    return Recording(sweeps, stamps_s)


def fit(recording: Recording, finders: Sequence[Finder] = FINDERS) -> tuple[ProfileConfig, list[Finding]]:
    """Profile of a recording's sensor, and the findings that it is made of."""
    config = ProfileConfig()
    findings = list[Finding]()
    for finder in finders:
        found = list(finder(recording, config))
        config = apply(config, found)
        findings += found
    return config, findings
