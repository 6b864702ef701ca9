"""Profiles, models, and the directories of runs."""

import json
from argparse import Namespace
from contextlib import redirect_stdout
from io import StringIO

import numpy as np
import onnx.parser

from modt import assets, profile
from modt.app import assembly
from modt.cli import status
from modt.config import ClassificationConfig, ProfileConfig, SensorConfig
from modt.sinks.run_directory import STATUS
from modt.sinks.tracks import BOX_KEYS, WORLD_KEYS
from modt_commands import profile_report
from modt_evaluation.run_record import RunRecord
from modt_evaluation.truth_files import open_truth
from tests.cli.test_top import status as status_record
from tests.fuzz.target import of_file, target, targets_of_files
from tests.modt_evaluation.test_truth_files import tracklets
from tests.modt_profiling.reporting.test_run_report import track, write_run
from tests.sources import layouts

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n"
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)
"""YAML whose aliases expand to nine to the ninth words."""
DESCRIPTION = "schema: modt.run/1\nstream: {name: street, path: null}\nmode: efficient\nfov: full\nprofile: {}\n"
DESCRIPTION += "recognition: {used: vlp-16}\n"
SENSOR_BOMB = f"sensor: {{reflectance: [{', '.join(line[3:] for line in BOMB.splitlines())}]}}\n"


def network():
    """A small model with the inputs and outputs of a shipped one."""
    zeros = ", ".join("0" * 12)
    return onnx.parser.parse_model(f"""
        <ir_version: 8, opset_import: ["": 13]>
        net (float[batch, n, 3] points) => (float[batch, 4] probability) <float[3, 4] w = {{{zeros}}}> {{
            pooled = ReduceMax <axes = [1], keepdims = 0> (points)
            probability = MatMul (pooled, w)
        }}
    """)


def load(path):
    return assembly.network(ClassificationConfig(model=str(path)), SensorConfig())


SHIPPED = [(assets.folder("profiles") / f"{name}.yaml").read_bytes() for name in ("hdl-64e", "vlp-16")]
STAGES = [profile.to_yaml({stage: values}) for stage, values in profile.dump(ProfileConfig()).items()]
targets_of_files(
    {
        "profiles": ("robot.yaml", profile.load, [*SHIPPED, *STAGES, BOMB, SENSOR_BOMB]),
        "models": ("net.onnx", load, [network().SerializeToString()]),
    }
)


@target()
def model_metadata(folder):
    """The classifiers of boxes and of reflectance, and the class frequency, a line each."""
    path = folder / "net.onnx"
    weights = {"network": 0.8, "box": 0.5, "reflectance": 0.3}
    box = {"weights": weights, "layers": [[[[0.1] * 4] * 7, [0.2] * 4]]}
    reflectance = {"hdl-64e": {"weights": weights, "layers": [[[[0.1] * 4] * 12, [0.2] * 4]]}}
    entries = {"box_prior": box, "reflectance": reflectance, "class_frequency": [0.7, 0.1, 0.1, 0.1]}

    def call(raw):
        model = network()
        for key, value in zip(entries, raw.split(b"\n"), strict=False):
            model.metadata_props.add(key=key, value=value.decode("utf-8", "replace"))
        path.write_bytes(model.SerializeToString())
        load(path)

    return ["\n".join(map(json.dumps, entries.values())).encode()], call


def _report(run):
    """The command on a run, without its output."""

    def read():
        with redirect_stdout(StringIO()):
            profile_report.run(Namespace(run_directory=run, html=None, json=False))

    return read


def described(run):
    """The run, with a description of few lines: YAML is slow to read."""
    (run / "run.yaml").write_text(DESCRIPTION)
    return run


def frame_record(k):
    """The record of a frame with a track that is seen and one that is lost."""
    boxes = dict.fromkeys(("box", "seen"), dict.fromkeys(BOX_KEYS, 1.5))
    state = {"witness": [0.0] * 4, "size": [1.5] * 3, "motion": "moving", "moving": 0.9, "heading_known": True}
    velocity = {
        "velocity": [1.0, 0.0],
        "velocity_covariance": [0.1, 0.0, 0.1],
        "world": dict.fromkeys(WORLD_KEYS, 2.5),
    }
    seen = {**track(3, 0, named=True), **boxes, **state, **velocity}
    lost = {**seen, "id": 4, "proposal": None, "box": None, "seen": None, "state": "lost"}
    counts = {"run": None, "proposals": 1, "classifications": 1, "classified": [3], "deferred": 0}
    trust = {"level": "good", "reasons": []}
    facts = {"schema": "modt.frame/4", "T_world_sensor": np.eye(4)[:3].ravel().tolist(), "trust": trust, **counts}
    return {**facts, "frame": k, "stamp_s": 0.1 * k, "tracks": [seen, lost]}


@target()
def run_description(folder):
    path = write_run(folder / "run", frames=5) / "run.yaml"
    return of_file(path, _report(path.parent), path.read_bytes(), DESCRIPTION, BOMB)


@target()
def ledger(folder):
    path = described(write_run(folder / "run", frames=5)) / "ledger.jsonl"
    return of_file(path, _report(path.parent), path.read_bytes())


@target()
def tracks(folder):
    path = described(write_run(folder / "run", frames=2)) / "tracks.jsonl"
    return of_file(path, _report(path.parent), path.read_bytes())


def _judged(folder):
    """A run with labels of points, and its evaluation."""
    truth = open_truth(tracklets(layouts.raw_drive(folder), ("Car", 1, [8, 9])))
    run = folder / "run"
    (run / "labels").mkdir(parents=True)
    for index in range(4):
        (run / "labels" / f"{index:06d}.label").write_bytes(np.full(50, 1 << 16, np.uint32).tobytes())
    return run, lambda: list(RunRecord.open(run).frames(truth))


@target()
def judged_run(folder):
    """Evaluation of a run by its description and its tracks, with a line `---` between."""
    run, judge = _judged(folder)
    lines = "".join(json.dumps(frame_record(index)) + "\n" for index in range(4))

    def call(raw):
        about, _, found = raw.partition(b"---\n")
        (run / "run.yaml").write_bytes(about)
        (run / "tracks.jsonl").write_bytes(found)
        judge()

    return [f"{DESCRIPTION.replace('full', 'camera')}---\n{lines}".encode()], call


@target()
def labels_of_points(folder):
    run, judge = _judged(folder)
    (described(run) / "tracks.jsonl").write_text(json.dumps(frame_record(1)) + "\n")
    path = run / "labels" / "000001.label"
    return of_file(path, judge, path.read_bytes())


@target()
def service_status(folder):
    def read():
        with redirect_stdout(StringIO()):
            status.run(Namespace(directory=folder, json=False))

    return of_file(folder / STATUS, read, json.dumps(status_record() | {"time_s": 1.0}))
