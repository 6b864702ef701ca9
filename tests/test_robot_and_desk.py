"""What a robot loads: modules of what it does, and nothing of the desk's package, which is installed beside it."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from modt.app.assembly import chosen_kernels
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tests.cli.commands import environment

MAX_MODULES = 130
"""A robot loads what it uses: the readers of other sensors and recordings are none of it."""
LOADED = """
import atexit, sys
from modt.cli.main import main
names = "modt", "modt_desk", "scipy"
atexit.register(lambda: print(*sorted(name for name in sys.modules if name.partition(".")[0] in names)))
raise SystemExit(main())
"""


def loaded(*arguments: object, cwd: Path, until: Path | None = None) -> list[str]:
    """Modules of the project, and of SciPy, that a command has loaded at its end, or when a file stops it."""
    command = [sys.executable, "-c", LOADED, *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment(), cwd=cwd) as running:
        if until is not None:
            ends_s = time.monotonic() + 60.0
            while not until.exists() and running.poll() is None and time.monotonic() < ends_s:
                time.sleep(0.05)
            running.send_signal(signal.SIGTERM)
        printed, _ = running.communicate(timeout=60)
    assert running.returncode == 0
    return printed.split("\n")[-2].split()


@pytest.fixture(name="scans")
def a_folder_of_scans(tmp_path):
    folder = tmp_path / "scans"
    folder.mkdir()
    random = np.random.default_rng(0)
    for number in range(2):
        random.uniform((-20, -20, -2, 0), (20, 20, 2, 1), (2000, 4)).astype(np.float32).tofile(
            folder / f"{number:06d}.bin"
        )
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "until"),
    [(("run", "velodyne://127.0.0.1:0"), "out/status.json"), (("replay", "scans", "--quiet"), None)],
)
def test_a_robot_loads_what_it_uses_and_nothing_of_the_desk(arguments, until, scans, tmp_path):
    modules = loaded(*arguments, "--core", "none", "--out", "out", cwd=tmp_path, until=until and tmp_path / until)
    assert "modt.pipeline" in modules
    assert [name for name in modules if name.startswith("modt_desk")] == []
    assert len(modules) <= MAX_MODULES


@pytest.mark.slow
@pytest.mark.skipif(chosen_kernels("auto").name == "numpy", reason="the kernels in NumPy use SciPy")
@pytest.mark.parametrize("command", ["run", "replay"])
def test_no_frame_loads_scipy(command, tmp_path):
    drive = SyntheticStream("street", "vlp-16", 1.5, 0)
    (tmp_path / "scans").mkdir()
    for frame in drive:
        frame.points.tofile(tmp_path / "scans" / f"{frame.index:06d}.bin")
    modules = loaded(command, "scans", "--core", "none", "--out", "out", cwd=tmp_path)
    assert "modt.sensor_fit.recognition" in modules
    assert [name for name in modules if name.startswith("scipy")] == []
