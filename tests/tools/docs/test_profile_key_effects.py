"""Every key of a profile has an effect.

A scenario digests the results of a profile: those of a second of a synthetic street, or others beside the pipeline. A
key has an effect if another value of it, half and double the default first, gives another digest.
"""

import dataclasses
import hashlib
import itertools
from collections.abc import Callable, Iterator
from functools import cache, partial
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
from modt_commands.profile_schema import Key, keys
from modt_profiling.reporting.run_report import run_tree
from modt_simulation.synthetic_stream import SyntheticStream
from tests.modt_profiling.reporting.test_run_report import write_run

pytestmark = pytest.mark.slow

BASE = profile.load("vlp-16")
Scenario = Callable[[ProfileConfig, Path], str]


@pytest.fixture(autouse=True)
def a_clock_that_counts_its_readings(monkeypatch):
    """The CPU time of a classification, which its budget depends on, is the same in every replay."""
    monkeypatch.setattr(assembly, "time", type("Clock", (), {"thread_time_ns": itertools.count(0, 400_000).__next__}))


@cache
def frames(seed: int = 3, seconds: float = 1.0) -> tuple[Frame, ...]:
    return tuple(SyntheticStream("street", "vlp-16", seconds, seed))


def changed(config: Any, path: str, value: Any) -> Any:
    """The configuration with another value of a key."""
    head, _, rest = path.partition(".")
    return dataclasses.replace(config, **{head: changed(getattr(config, head), rest, value) if rest else value})


def street(stream: tuple[int, float] = (3, 1.0), also: str = "", value: Any = None) -> Scenario:
    """Digest of the tracks, the proposals, the class frequency and the work of every frame of a street.

    `also` is a key that has another value, too: without it the key under test has nothing to act on.
    """

    def digest_of(config: ProfileConfig, _folder: Path) -> str:
        ledger = Ledger(lambda: 0, lambda: 0)
        mode = assembly.MODES["accurate"]
        config = changed(config, also, value) if also else config
        pipeline = assembly.pipeline(mode, config, FieldOfView(), ledger)
        digest = hashlib.sha256()
        for frame in frames(*stream):
            result = pipeline.step(frame, mode.budget(config))
            columns = [*result.tracks.columns().values()]
            proposals = result.proposals
            columns += [proposals.members, proposals.box, proposals.cut, pipeline.decision.frequency]
            for column in columns:
                digest.update(column.tobytes())
            digest.update(repr(ledger.close_frame(frame.index).stages).encode())
        return digest.hexdigest()

    return digest_of


def report(config: ProfileConfig, folder: Path, *, metered: bool = True) -> str:
    """Report of modt-profile on a run of a calibrated board, with a meter or without one."""
    coefficients = {"seg_J": 0.01, "class_J": 0.002, "point_J": 1e-5}
    given = dataclasses.asdict(config.energy)
    own = {name: value if given[name] is None else given[name] for name, value in coefficients.items()}
    tree = run_tree(write_run(folder, energy=given | own, windows=metered))
    return str({name: value for name, value in tree.items() if name != "run"})


def scan_folder(config: ProfileConfig, folder: Path) -> str:
    """Stamps of a folder of two scans, opened with a profile."""
    (folder / "scans").mkdir(parents=True, exist_ok=True)
    for frame in frames()[:2]:
        frame.points.tofile(folder / "scans" / f"{frame.index:06d}.bin")
    (folder / "own.yaml").write_text(profile.to_yaml(profile.dump(config)))
    request = inputs.Request(path=folder / "scans", profile=[str(folder / "own.yaml")])
    return str([frame.stamp_s for frame in inputs.stream(request)])


PRODUCT = street((6, 2.5), "fusion.rule", "product")
SCENARIOS: dict[str, Scenario] = {
    "": street(),
    "sensor.period_s": scan_folder,
    "sensor.blind_range_m": street(also="sensor.blind_sectors_deg", value=(-60.0, 60.0)),
    "sensor.blind_sectors_deg": street(also="sensor.blind_range_m", value=20.0),
    "fusion.start_frame": PRODUCT,
    "fusion.point_change": PRODUCT,
    "energy.": report,
    "energy.busy_W": partial(report, metered=False),
    "energy.meter": lambda config, _folder: yaml.safe_dump(profile.dump(config)),
}
"""Scenario of each key, by the longest beginning of its path."""
TESTED_BESIDE = ("segmentation.kernels", "odometry.max_speed_mps", "loop.power_W", "recording.", "trust.results")
"""Keys that no scenario of perception or energy shows, by the beginning of their paths. Their tests are
app/test_assembly.py, poses/test_pose_socket.py, cli/test_run.py, sinks/test_recording.py and app/test_loop.py.
"""


OTHER_VALUES: dict[str, Any] = {
    "sensor.elevations_deg": tuple(np.linspace(-15.0, 15.0, 8).tolist()),
    "sensor.elevation_span_deg": (-15.0, -10.0),
    "sensor.blind_sectors_deg": (-15.0, -10.0),
    "classification.model": "pointnet-synthetic",
    "decision.frequency": (0.2, 0.2, 0.2),
    "energy.board": "another",
    "energy.meter": "another",
}
"""Another value of the keys that are neither a number nor a choice."""


def other_values(key: Key) -> Iterator[Any]:
    """Other values of a key, the moderate ones first."""
    value = attrgetter(key.path)(BASE)
    facts = key.facts
    if key.path in OTHER_VALUES:
        yield OTHER_VALUES[key.path]
    elif "options" in facts:
        yield from facts["options"]
    else:
        low = facts["low"]
        high = facts["high"]
        start = np.array(low + (high - low) / 1000 if value is None else value, np.float64)
        for other in (0.5 * start, 2.0 * start, 0.1 * start, 10.0 * start, low, high):
            bounded = np.clip(other, low, high).tolist()
            yield tuple(bounded) if isinstance(bounded, list) else round(bounded) if key.whole else bounded


@cache
def unchanged(path: str, folder: Path) -> str:
    """Digest of the scenario of a path with the unchanged profile, which is the same each time."""
    one, two = (SCENARIOS[path](BASE, folder / f"unchanged-{path}{name}") for name in ("one", "two"))
    assert one == two
    return one


@pytest.mark.parametrize(
    "key", [key for key in keys() if not key.path.startswith(TESTED_BESIDE)], ids=lambda key: key.path
)
def test_a_key_has_an_effect(key, tmp_path, tmp_path_factory):
    path = max(filter(key.path.startswith, SCENARIOS), key=len)
    before = unchanged(path, tmp_path_factory.getbasetemp())
    values = [value for value in other_values(key) if value != attrgetter(key.path)(BASE)]
    assert any(SCENARIOS[path](changed(BASE, key.path, v), tmp_path / str(n)) != before for n, v in enumerate(values))


def test_every_scenario_is_of_a_key():
    assert all(any(key.path.startswith(path) for key in keys()) for path in SCENARIOS)
