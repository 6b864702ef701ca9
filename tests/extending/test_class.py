"""How to add a class (docs/extending.md): a fifth row of the table of classes, and a model of five outputs."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnx.parser
import pytest
import yaml

VALUE = "    CYCLIST = 3\n"
ROW = "    ObjectClass.CYCLIST: ClassSpec("


@pytest.fixture(name="source")
def a_package_with_trucks(tmp_path):
    """A copy of the package whose table of classes has one row more."""
    source = tmp_path / "source"
    root = Path(__file__).parents[2]
    unneeded = shutil.ignore_patterns("__pycache__")
    for package in (root / "runtime" / "modt", *(root / "tools").glob("modt_*")):
        shutil.copytree(package, source / package.relative_to(root), ignore=unneeded)
    (source / "models").mkdir()
    shutil.copytree(root / "profiles", source / "profiles")
    for profile in (source / "profiles").glob("*.yaml"):  # one value more where one is stated by class
        profile.write_text(re.sub(r"(missed_cost: \[[^\]]*)\]", r"\1, 1.0]", profile.read_text()))
    table = source / "runtime" / "modt" / "classes.py"
    text = table.read_text()
    assert text.count(VALUE) == text.count(ROW) == 1
    truck = '    ObjectClass.TRUCK: ClassSpec(("Truck",), (18, 258), 9.0, 2.7, False, 2.0, 0.2, "#7048e8"),\n'
    text = text.replace(VALUE, f"{VALUE}    TRUCK = 4\n")
    table.write_text(text.replace("}\n", f"{truck}}}\n", 1))
    return source


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
    onnx.save(model, source / "models" / "trucks.onnx")
    profile = source / "profiles" / "trucks.yaml"
    vlp_16 = yaml.safe_load((source / "profiles" / "vlp-16.yaml").read_text())
    profile.write_text(yaml.safe_dump(vlp_16 | {"classification": {"model": "trucks"}}))
    return profile


def run(source, *arguments):
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(str(source / folder) for folder in ("runtime", "tools"))
    }
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
