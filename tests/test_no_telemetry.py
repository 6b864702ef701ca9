"""Commands and library write and send only what was asked for, although ONNX Runtime would report to its maker."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.cli.commands import environment, modt

pytestmark = pytest.mark.command

ROOT = Path(__file__).resolve().parents[1]
IMPORT = r"^\s*(import|from) onnxruntime"
VARIABLE = "ORT_DISABLE_TELEMETRY"
CHANGES = "/^(open|creat|mk|rename|link|symlink|unlink|rmdir|truncate)"
TRACED = "strace", "-ff", "-qq", "-y", "-e", f"trace=%network,{CHANGES}", "-o"
FRAMES = "--frames", "0:3"
LIBRARY = """
import modt, numpy as np
modt.Pipeline.from_profile("vlp-16").step(np.zeros((3, 4)), 0.0)
"""
RUN_S = 15  # ONNX Runtime looks its host up some 10 s after the start
COMMANDS = {
    "replay": ("-m", "modt", "replay", *FRAMES, "--out", "{out}/replay"),
    "run": ("-m", "modt", "run", "--out", "{out}/run"),
    "check": ("-m", "modt", "check", "--out", "{out}/run"),
    "meters": ("-m", "modt_commands.profile", "meters"),
    "report": ("-m", "modt_commands.profile", "report", "{out}/recorded", "--html", "{out}/report.html"),
    "library": ("-c", LIBRARY),
}


@dataclass
class Observed:
    """Folders of a finished command, and the system calls of its threads; None where they cannot be traced."""

    home: Path
    cwd: Path
    out: Path
    calls: list[str] | None


def traceable() -> bool:
    """Whether strace is installed and may trace."""
    probe = ["strace", "-qq", "-o", "/dev/null", "true"]
    return bool(shutil.which("strace")) and subprocess.run(probe, check=False).returncode == 0


def permissive(**own: object) -> dict[str, str]:
    """Environment in which the variable has the value that would permit reports."""
    return {**environment(), "PYTHONDONTWRITEBYTECODE": "1", VARIABLE: "0", **{k: str(v) for k, v in own.items()}}


@pytest.fixture(scope="module", params=[pytest.param(n, marks=[pytest.mark.slow] * (n == "run")) for n in COMMANDS])
def observed(request, tmp_path_factory) -> Observed:
    """A command that ran with a home, a working folder and a folder for results of its own."""
    folder = tmp_path_factory.mktemp(request.param)
    home, cwd, out = places = [folder / name for name in ("home", "cwd", "out")]
    for place in places:
        place.mkdir()
    if request.param == "report":
        assert modt("replay", *FRAMES, "--out", out / "recorded", cwd=folder).returncode == 0
    arguments = [word.format(out=out) for word in COMMANDS[request.param]]
    limit = ["timeout", "--preserve-status", str(RUN_S)] * (request.param == "run")
    tracer = [*TRACED, str(folder / "calls")] * traceable()
    env = permissive(HOME=home, XDG_CACHE_HOME=home / ".cache")
    command = [*tracer, *limit, sys.executable, *arguments]
    done = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    calls = [line for path in folder.glob("calls.*") for line in path.read_text().splitlines()]
    return Observed(home, cwd, out, calls if tracer else None)


@pytest.fixture
def calls(observed) -> list[str]:
    """System calls of the command that create, change or open files, and those of sockets."""
    if observed.calls is None:
        pytest.skip("strace is not installed, or may not trace here")
    assert any("onnxruntime" in call or "/modt/" in call for call in observed.calls)
    return observed.calls


def changed(call: str, cwd: Path) -> set[str]:
    """Paths that a system call wrote to, created or removed."""
    name = call.partition("(")[0]
    if call.rpartition(" = ")[2].startswith("-1"):
        return set()
    if name.startswith("open"):
        return set(re.findall(r" = \d+<(.*)>$", call)) if re.search("O_(WRONLY|RDWR|CREAT|TRUNC)", call) else set()
    if not re.match(CHANGES.strip("/"), name):
        return set()
    return {os.path.join(base or cwd, path) for base, path in re.findall(r'(?:<([^<>]*)>, )?"([^"]*)"', call)}


def test_home_and_working_folder_stay_empty(observed):
    assert [*observed.home.iterdir(), *observed.cwd.iterdir()] == []


def test_only_what_was_asked_for_is_written(observed, calls):
    written = set().union(*(changed(call, observed.cwd) for call in calls))
    assert any(path.startswith(f"{observed.out}/") for path in written) == any(observed.out.rglob("*"))
    assert {path for path in written if not path.startswith((f"{observed.out}/", "/dev/", "/proc/"))} == set()


def test_no_socket_is_made_and_no_name_is_looked_up(calls):
    assert [call for call in calls if re.match("socket|connect|send", call)] == []
    assert [call for call in calls if re.search(r'"/etc/(resolv\.conf|hosts|host\.conf)"', call)] == []


def test_the_variable_is_set_before_the_only_import():
    files = [path for place in ("runtime", "tools") for path in (ROOT / place).rglob("*.py")]
    assert [path.name for path in files if re.search(IMPORT, path.read_text(), re.MULTILINE)] == ["network.py"]
    code = f"""
import os, sys
class Watch:
    def find_spec(self, name, *_):
        if name == "onnxruntime":
            print(os.environ["{VARIABLE}"])
sys.meta_path.insert(0, Watch())
import modt.classification.network
"""
    done = subprocess.run([sys.executable, "-c", code], env=permissive(), capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "1\n"), done.stderr
