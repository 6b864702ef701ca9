"""Comparisons and predictions, which the package has written and others may have changed."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from modt.app import assembly
from modt.pipeline import STAGES
from modt_desk.comparison.compare_report import SCHEMA as COMPARE_SCHEMA
from modt_desk.comparison.comparison import COUNTS
from modt_desk.comparison.prediction import forecast
from modt_desk.comparison.prediction_report import (
    against,
    observed_tree,
    prediction_tree,
    read_calibration,
    read_prediction,
)
from modt_desk.evaluation.export import FORMS, Export
from modt_desk.evaluation.run_record import RunRecord
from modt_desk.reporting.quantity import estimate, to_json
from modt_desk.viewer.recorded_run import RecordedRun
from modt_desk.viewer.track_page import rows_of, track_page
from tests.desk.comparison.test_prediction import CALIBRATION, FRAMES, TEST
from tests.desk.reporting.test_run_report import ledger_line, window, write_run
from tests.fuzz.runs import DESCRIPTION, described, frame_record
from tests.fuzz.target import Feed, of_file, target

ITSELF = {"stream": "elsewhere", "path": "/elsewhere"}
ABOUT = {**ITSELF, "fov": "full", "asked": [0, 8], "frames": 8}


def comparison() -> bytes:
    """A comparison over nine frames."""
    found = CALIBRATION[0].take(np.arange(9))
    names = dict(zip(found.runs, (*assembly.MODES, "varied"), strict=True))
    tables = {
        names[name]: {
            "counts": {column: run.counts[:, k].tolist() for k, column in enumerate(COUNTS)},
            "cpu_ms": {stage: (1e3 * run.cost[:, k]).round(4).tolist() for k, stage in enumerate(STAGES)},
        }
        for name, run in found.runs.items()
    }
    facts = {"schema": COMPARE_SCHEMA, "stream": "street", "path": None, "fov": "full", "frames": 9}
    return json.dumps({**facts, "calibration": tables, "observed": observed_tree(found.observed)}).encode()


@target()
def calibrations(folder: Path) -> Feed:
    path = folder / "other.json"
    return of_file(path, lambda: read_calibration(path, ITSELF, "full"), comparison())


@target()
def predictions(folder: Path) -> Feed:
    path = folder / "blind.json"
    found = forecast(CALIBRATION, TEST.observed[:80], FRAMES, np.random.default_rng(0))
    tree = to_json(prediction_tree(found, 3.0, {**ABOUT, "seen": 8, "calibration": ["street"], "core": 0}))
    modes = {name: {"cpu_ms": estimate(7.0, "ms")} for name in assembly.MODES}
    savings = {name: {"gamma_measured_cpu": estimate(1.5)} for name in assembly.MODES}
    return of_file(path, lambda: against(read_prediction(path, ABOUT), modes, savings), json.dumps(tree))


def json_lines(records: Iterable[dict[str, Any]]) -> bytes:
    """A line a record."""
    return "".join(json.dumps(record) + "\n" for record in records).encode()


@target()
def viewed_run(folder: Path) -> Feed:
    """The view of a run from its ledger and its tracks, which a line `---` separates."""
    run = described(write_run(folder / "run", frames=2))
    ledger, tracks, costs = run / "ledger.jsonl", run / "tracks.jsonl", [ledger_line(k, 1) for k in range(2)]
    seed = [*costs, window(0, costs, 1.5)]

    def call(raw: bytes) -> None:
        first, _, second = raw.partition(b"---\n")
        ledger.write_bytes(first)
        tracks.write_bytes(second)
        found = RecordedRun.read(run)
        track_page(found, rows_of(found, 3), {})

    return [b"---\n".join([json_lines(seed), json_lines(map(frame_record, range(2)))])], call


@target()
def exported_run(folder: Path) -> Feed:
    """Its tracks as a table, and as KITTI's results."""
    run, out = folder / "run", folder / "out"
    run.mkdir()
    (run / "run.yaml").write_text(DESCRIPTION + "service: true\n")

    def read() -> None:
        recorded = RunRecord.open(run)
        for form in ("csv", "kitti"):
            FORMS[form](Export(recorded, points=False), out)

    return of_file(run / "tracks.jsonl", read, json_lines(map(frame_record, range(2))))
