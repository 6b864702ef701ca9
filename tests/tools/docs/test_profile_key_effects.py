"""Every key of a profile has an effect.

A scenario digests what comes of a profile: a second of a synthetic street, or what is computed beside the pipeline. A
key has an effect if another value of it, half and double the default first, gives another digest.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import json
from collections.abc import Callable, Iterator
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from modt import profile
from modt.app import assembly, inputs
from modt.config import ProfileConfig
from modt.energy.ledger import Ledger
from modt.geometry import FieldOfView
from modt.types import Frame
from modt_desk.cli.profile_schema import Key, keys
from modt_desk.reporting.run_report import run_tree
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.desk.reporting.test_run_report import write_run

pytestmark = pytest.mark.slow

BASE = profile.load("vlp-16")
Scenario = Callable[[ProfileConfig, Path], str]


@pytest.fixture(autouse=True)
def a_clock_that_counts_its_readings(monkeypatch):
    """The CPU time of a classification, which its budget depends on, is the same in every replay."""
    monkeypatch.setattr(assembly, "time", type("Clock", (), {"thread_time_ns": itertools.count(0, 400_000).__next__}))


@cache
def frames(seed: int, seconds: float) -> tuple[Frame, ...]:
    return tuple(SyntheticStream("street", "vlp-16", seconds, seed))


def replay(
    stream: tuple[Frame, ...],
    config: ProfileConfig,
    mode: str = "accurate",
    view: Any = None,
) -> str:
    """Digest of the tracks, the proposals, the class frequency and the work of every frame."""
    ledger = Ledger(lambda: 0, lambda: 0)
    pipeline = assembly.pipeline(assembly.MODES[mode], config, view or FieldOfView(), ledger)
    digest = hashlib.sha256()
    for frame in stream:
        result = pipeline.step(frame, assembly.MODES[mode].budget(config))
        columns = [column for _, column in result.tracks.columns()]
        proposals = result.proposals
        columns += [proposals.members, proposals.box, proposals.cut, pipeline.decision.frequency]
        for column in columns:
            digest.update(column.tobytes())
        digest.update(json.dumps(ledger.close_frame(frame.index)["stages"]).encode())
    return digest.hexdigest()


def changed(config: Any, path: str, value: Any) -> Any:
    """The configuration with another value of a key."""
    head, _, rest = path.partition(".")
    return dataclasses.replace(config, **{head: changed(getattr(config, head), rest, value) if rest else value})


def street(config: ProfileConfig, _folder: Path) -> str:
    return replay(frames(3, 1.0), config)


def long_street(config: ProfileConfig, _folder: Path) -> str:
    return replay(frames(6, 4.0), config)


def efficient(config: ProfileConfig, _folder: Path) -> str:
    return replay(frames(3, 1.0), config, "efficient")


def product(config: ProfileConfig, _folder: Path) -> str:
    """A street whose views are multiplied."""
    return long_street(changed(config, "fusion.rule", "product"), _folder)


def paper(config: ProfileConfig, _folder: Path) -> str:
    return replay(frames(3, 1.0), changed(config, "tracking.association", "paper"))


def report_of_a_run(config: ProfileConfig, folder: Path, *, metered: bool = True) -> str:
    """Report of modt-profile on a run of a calibrated board, with a meter or without one."""
    coefficients = {"seg_J": 0.01, "class_J": 0.002, "point_J": 1e-5}
    given = dataclasses.asdict(config.energy)
    own = {name: value if given[name] is None else given[name] for name, value in coefficients.items()}
    tree = run_tree(write_run(folder, energy=given | own, windows=metered))
    return str({name: value for name, value in tree.items() if name != "run"})


def report_without_meter(config: ProfileConfig, folder: Path) -> str:
    return report_of_a_run(config, folder, metered=False)


def described(config: ProfileConfig, _folder: Path) -> str:
    return yaml.safe_dump(profile.dump(config))


def scan_folder(config: ProfileConfig, folder: Path) -> str:
    """Stamps of a folder of two scans, opened with a profile."""
    (folder / "scans").mkdir(parents=True, exist_ok=True)
    for frame in frames(3, 1.0)[:2]:
        frame.points.tofile(folder / "scans" / f"{frame.index:06d}.bin")
    (folder / "own.yaml").write_text(profile.to_yaml(profile.dump(config)))
    request = inputs.Request(path=folder / "scans", profile=[str(folder / "own.yaml")])
    return str([frame.stamp_s for frame in inputs.stream(request)])


def near_blind(config: ProfileConfig, _folder: Path) -> str:
    return replay(frames(3, 1.0), changed(config, "sensor.blind_sectors_deg", (-60.0, 60.0)))


def far_blind(config: ProfileConfig, _folder: Path) -> str:
    return replay(frames(3, 1.0), changed(config, "sensor.blind_range_m", 20.0))


SCENARIOS: dict[str, Scenario] = {
    "": street,
    "sensor.period_s": scan_folder,
    "sensor.blind_range_m": near_blind,
    "sensor.blind_sectors_deg": far_blind,
    "tracking.paper.": paper,
    "fusion.start_frame": product,
    "fusion.point_change": product,
    "energy.": report_of_a_run,
    "energy.busy_W": report_without_meter,
    "energy.meter": described,
}
"""Scenario of each key, by the longest beginning of its path."""


TESTED_BESIDE = {
    "segmentation.kernels": "app/test_kernel_choice.py",
    "odometry.max_speed_mps": "sources/test_pose_socket.py",
    "loop.power_W": "app/test_ladder.py",
    "recording.": "sinks/test_recording.py",
}
"""Tests of the keys that no scenario of perception or energy shows, by the beginning of their paths."""


def is_tested_beside(key: Key) -> bool:
    return key.path.startswith(tuple(TESTED_BESIDE))


def scenario_of(key: Key) -> Scenario:
    return SCENARIOS[max(filter(key.path.startswith, SCENARIOS), key=len)]


def others(key: Key) -> Iterator[Any]:
    """Other values of a key, the moderate ones first."""
    value, facts = attrgetter(key.path)(BASE), key.facts
    if "options" in facts:
        yield from (option for option in facts["options"] if option != value)
    elif "length" in facts and value is None:
        yield (0.2,) * facts["length"]
    elif "most" in facts:
        yield tuple(np.linspace(-15.0, 15.0, 8)[: facts["most"]].tolist())
    elif key.kind == "str":
        yield "pointnet-synthetic" if key.path == "classification.model" else "another"
    else:
        low, high = facts["low"], facts["high"]
        start = low + (high - low) / 1000 if value is None else value
        whole = key.kind.startswith("int")

        def bounded(number: float) -> float:
            number = min(max(number, low), high)
            return round(number) if whole else float(number)

        for scale in (0.5, 2.0, 0.1, 10.0):
            yield tuple(bounded(scale * n) for n in start) if isinstance(start, tuple) else bounded(scale * start)
        if not isinstance(start, tuple):
            yield from (bounded(low), bounded(high))


DIGESTS: dict[Scenario, str] = {}
"""Digest of each scenario with the unchanged profile."""


def has_effect(key: Key, scenario: Scenario, folder: Path) -> bool:
    if scenario not in DIGESTS:
        DIGESTS[scenario] = scenario(BASE, folder / "base")
    values = [value for value in others(key) if value != attrgetter(key.path)(BASE)]
    return any(
        scenario(changed(BASE, key.path, value), folder / str(n)) != DIGESTS[scenario]
        for n, value in enumerate(values)
    )


@pytest.mark.parametrize("key", [key for key in keys() if not is_tested_beside(key)], ids=lambda key: key.path)
def test_a_key_has_an_effect(key, tmp_path):
    assert has_effect(key, scenario_of(key), tmp_path)


@pytest.mark.parametrize("key", list(filter(is_tested_beside, keys())), ids=lambda key: key.path)
def test_a_key_without_a_scenario_is_named_by_its_own_test(key):
    (file,) = (file for path, file in TESTED_BESIDE.items() if key.path.startswith(path))
    assert key.path.rpartition(".")[2] in (Path(__file__).parents[2] / file).read_text(encoding="utf-8")


def test_every_scenario_is_of_a_key():
    assert all(any(key.path.startswith(path) for key in keys()) for path in SCENARIOS)


ALL = sorted(set(SCENARIOS.values()), key=lambda scenario: scenario.__name__)


@pytest.mark.parametrize("scenario", ALL, ids=lambda scenario: scenario.__name__)
def test_a_scenario_repeats_itself(scenario, tmp_path):
    assert scenario(BASE, tmp_path / "one") == scenario(BASE, tmp_path / "two")
