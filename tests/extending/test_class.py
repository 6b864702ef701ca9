"""How to add a class (docs/own-classes.md): a fifth row of the table of classes, and a model of five outputs."""

import json
import os
import subprocess
import sys

import numpy as np
import onnx.parser
import pytest
import yaml

TRUCK = {"name": "truck", "kind": "vehicle", "labels": ["Truck"], "semantic_kitti": [18, 258], "missed_cost": 2.0} | {
    "max_length_m": 9.0,
    "max_width_m": 2.7,
    "usual_m": [7.0, 2.4, 2.9],
    "spread_m": [1.0, 0.2, 0.4],
}


@pytest.fixture(name="source")
def a_folder_with_a_table_of_trucks(tmp_path):
    (tmp_path / "classes.json").write_text(json.dumps([TRUCK]))
    return tmp_path


@pytest.fixture(name="profile")
def a_profile_with_a_model_of_five_outputs(source):
    zeros = ", ".join("0" * 15)
    model = onnx.parser.parse_model(f"""
        <ir_version: 8, opset_import: ["": 17]>
        trucks (float[batch, n, 3] points) => (float[batch, 5] probability)
        <float[3, 5] zeros = {{{zeros}}}, float[5] shares = {{0.02, 0.02, 0.02, 0.02, 0.92}}>
        {{
            pooled = ReduceMax <axes = [1], keepdims = 0> (points)
            nothing = MatMul (pooled, zeros)
            probability = Add (nothing, shares)
        }}
    """)
    onnx.save(model, source / "trucks.onnx")
    # The sensor of a Pandar64 states a cost for each of modt's own classes.
    own = {"extends": ["pandar64", "vlp-16"], "classification": {"model": str(source / "trucks.onnx")}}
    profile = source / "trucks.yaml"
    profile.write_text(yaml.safe_dump(own))
    return profile


def run(source, *arguments):
    environment = os.environ | {"MODT_CLASSES": str(source / "classes.json")}
    command = [sys.executable, "-m", *arguments]
    return subprocess.run(command, cwd=source, env=environment, capture_output=True, text=True, check=True).stdout


@pytest.mark.slow
def test_every_mode_and_sink_knows_the_class(source, profile):
    run(source, "modt", "simulate", "--sensor", "vlp-16", "--seconds", "0.6", "--out", "drive")
    drive = next((source / "drive").rglob("velodyne_points")).parent
    for mode in ("conventional", "efficient", "accurate"):
        out = source / mode
        options = ["--profile", str(profile), "--mode", mode, "--labels", "--out", str(out)]
        run(source, "modt", "replay", str(drive), *options)
        *_, last = map(json.loads, (out / "tracks.jsonl").read_text().splitlines())
        trucks = [track for track in last["tracks"] if track["viewed"]]
        assert trucks
        assert {track["class"] for track in trucks} == {"truck"}
        assert {len(track["posterior"]) for track in last["tracks"]} == {5}
        (results,) = (out / "kitti").iterdir()
        assert " Truck " in results.read_text()
        labels = np.fromfile(sorted((out / "labels").iterdir())[-1], np.uint32)
        assert 4 in labels & 0xFFFF
    assert "frames" in run(source, "modt_commands.profile", "report", str(out))
    judged = json.loads(run(source, "modt", "evaluate", str(out), str(drive), "--json"))
    assert "truck" in json.dumps(judged)
