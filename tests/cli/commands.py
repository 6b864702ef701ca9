"""Running the commands as a user would."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

from modt.app.build import replay
from modt.app.inputs import Request
from modt.app.loop import Loop
from modt.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
PINNED = ("replay", "run", "check", "calibrate", "compare", "predict")
PACKAGES = os.pathsep.join([str(ROOT / "runtime"), str(ROOT / "tools")])


def environment() -> dict[str, str]:
    """The environment of this process, with the checkout's packages and without sizes of thread pools."""
    own = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    return {**own, "PYTHONPATH": PACKAGES, "PYTHONWARNINGS": "error", "PYTHONUNBUFFERED": "1"}


def modt(*arguments: object, cwd: Path, module: str = "modt.cli.main", **options) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    command = [sys.executable, "-m", module, *map(str, arguments)]
    options = {"capture_output": True, "text": True, "env": environment(), "cwd": cwd, **options}
    return subprocess.run(command, check=False, **options)


def succeeded(*arguments: object, **options) -> subprocess.CompletedProcess[str]:
    """Run a command to its end, which is a good one."""
    done = modt(*arguments, **options)
    assert done.returncode == 0, done.stderr
    return done


def begin(*arguments: object, cwd: Path, env: dict[str, str] | None = None, **options) -> subprocess.Popen[str]:
    """Start a command and leave it running."""
    command = [sys.executable, "-m", "modt.cli.main", *map(str, arguments)]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}
    return subprocess.Popen(command, env=env or environment(), cwd=cwd, **options)


def here(command: str, *words: object, program=main) -> int:
    """Run a command in this process, on any core; returns its exit status.

    The real-time priority that `run` and `check` take where they may would starve whatever else is tested.
    """
    free = ["--core", "none"] if command in PINNED else []
    priority = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        return program([command, *free, *map(str, words)])
    except SystemExit as ended:
        return int(ended.code or 0)
    finally:
        os.sched_setscheduler(0, *priority)


def refusal(capsys, *arguments: object, program=main) -> str:
    """The line that a command prints when it is misused, after notes or its usage."""
    assert here(*arguments, program=program) == 2
    said = capsys.readouterr()
    *before, line = said.err.splitlines()
    assert said.out == ""
    assert all(text.startswith(("modt: ", "usage: ", " ")) for text in before)
    assert line.startswith("modt")
    return line


def session(out: Path, frames: int | None, **options) -> Loop:
    """A replay in this process."""
    return replay(Request(mode="efficient", frames=(0, frames), **options), {}, out, None, ["modt"])


def content(path: Path) -> Any:
    """Content of a file of JSON or YAML."""
    return (json.loads if path.suffix == ".json" else yaml.safe_load)(path.read_text())
