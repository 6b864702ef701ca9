"""A robot loads the modules that it uses, and none of the packages of the tools, which are installed beside it."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from modt.app.assembly import chosen_kernels
from modt.sources import drivers
from modt_simulation.synthetic_stream import SyntheticStream
from tests import recorded
from tests.cli.commands import environment

READERS = (
    *(f"modt.sources.drivers.{name}" for name in drivers.names()),
    *("modt.sources.kitti", "modt.sources.bag", "modt.sources.capture", "modt.sources.point_cloud_file"),
    *("modt.sources.live.packets", "modt.sources.live.ros2", "modt.ros2", "modt.viewer", "modt.poses.received_poses"),
)
"""Modules that a robot loads only if it uses them: the drivers, the readers of recordings and what shows results."""
LOADED = """
import atexit, sys
from modt.cli.main import main
atexit.register(lambda: print(*sorted(name for name in sys.modules if name.startswith(("modt", "scipy")))))
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "until", "used"),
    [
        (
            ("run", "velodyne://127.0.0.1:0"),
            "out/status.json",
            {"modt.sources.drivers.velodyne", "modt.sources.live.packets"},
        ),
        (("run", "scans"), None, {"modt.sources.kitti"}),
        (("replay", "scans", "--quiet"), None, {"modt.sources.kitti"}),
    ],
)
def test_a_robot_loads_what_it_uses_and_nothing_of_the_tools_or_of_scipy(arguments, until, used, tmp_path):
    recorded.scans(tmp_path / "scans", SyntheticStream("street", "vlp-16", 1.5, 0))
    modules = loaded(*arguments, "--core", "none", "--out", "out", cwd=tmp_path, until=until and tmp_path / until)
    assert {"modt.pipeline", "modt.sensor_fit.recognition"} <= set(modules)
    assert [name for name in modules if name.startswith("modt_")] == []
    assert used == set(READERS) & set(modules)
    if chosen_kernels("auto").name != "numpy":  # the kernels in NumPy use SciPy
        assert [name for name in modules if name.startswith("scipy")] == []
