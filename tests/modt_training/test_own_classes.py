"""The page docs/own-classes.md: its table and its commands, at a small size."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "own-classes.md"
SMALLER = {
    "--seconds 8": "--seconds 0.4",
    " 3 4 5 6 7 8;": ";",
    "--name forklift": "--name forklift --steps 10 --worlds 4",
}


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), re.DOTALL)


@pytest.mark.slow
@pytest.mark.command
def test_a_forklift_from_simulated_recordings_to_a_run_that_reports_it(tmp_path):
    pytest.importorskip("torch", reason="extra [train] is not installed")
    (table,) = blocks("json")
    (program,) = blocks("python")
    (tmp_path / "classes.json").write_text(table)
    (tmp_path / "program.py").write_text(program)
    prose = re.sub("```.*?```", "", PAGE.read_text(), flags=re.DOTALL)
    lines = ["set -e", *re.findall("^    (.*)$", prose, re.MULTILINE), "python program.py"]
    script = "\n".join(lines)
    for whole, small in SMALLER.items():
        assert whole in script
        script = script.replace(whole, small)
    for command, module in (("modt", "-m modt"), ("python", "")):
        script = re.sub(rf"(^|do ){command} ", rf"\1{sys.executable} {module} ", script, flags=re.MULTILINE)
    done = subprocess.run(
        ["bash", "-c", script], check=False, cwd=tmp_path, env=os.environ, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    made = tmp_path / "models" / "forklift"
    assert "classes: background, car, pedestrian, cyclist, forklift" in (made / "forklift.md").read_text()
    assert json.loads((made / "classes.json").read_text())[0]["name"] == "forklift"
    *_, last = (tmp_path / "runs" / "unseen" / "tracks.jsonl").read_text().splitlines()
    assert {len(track["posterior"]) for track in json.loads(last)["tracks"]} == {5}
    assert "forklift" in done.stdout

    def refused(*arguments, **variables):
        words = [sys.executable, "-m", "modt", *arguments]
        return subprocess.run(
            words, check=False, cwd=tmp_path, env=os.environ | variables, capture_output=True, text=True
        ).stderr

    drive = str(next(tmp_path.glob("unseen/*/*_sync")))
    assert "MODT_CLASSES" in refused("replay", drive, "--profile", str(made / "forklift.yaml"))
    other = json.loads(table)
    other[0] |= {"name": "dog", "labels": ["Dog"]}
    (tmp_path / "dogs.json").write_text(json.dumps(other))
    words = ("train", str(tmp_path / "data/1/2020_01_01/2020_01_01_drive_0000_sync"), drive, "--out", "dogs")
    assert "class dog: has examples in 0 of the recordings" in refused(*words, MODT_CLASSES="dogs.json")
