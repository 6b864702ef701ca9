"""Judgement of the unit by systemd itself."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from modt.cli.main import main

pytestmark = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed here")
SYSTEM = Path("/usr/lib/systemd/system")


@pytest.fixture(name="analyze")
def analysis(tmp_path):
    """systemd-analyze on the unit with some drop-ins, below a root of its own."""

    def analyze(verb, *drop_ins):
        words = (word for name in drop_ins for word in ("--with", name))
        main(["service", "install", "--root", str(tmp_path), "--prefix", "/opt/modt", *words])
        for program in ("opt/modt/bin/modt", "bin/kill"):
            path = tmp_path / program
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("")
            path.chmod(0o755)
        shutil.copytree(SYSTEM, tmp_path / SYSTEM.relative_to("/"), symlinks=True)
        command = ["systemd-analyze", *verb, f"--root={tmp_path}", "modt.service"]
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)

    return analyze


@pytest.mark.parametrize(
    ("drop_ins", "most"),
    [((), 1.0), (("lan-sensor",), 1.6), (("rapl",), 1.3), (("lan-sensor", "ros2", "foxglove"), 1.6)],
)
def test_the_exposure_is_small(analyze, drop_ins, most):
    done = analyze(["security", "--offline=true", "--no-pager", f"--threshold={round(10 * most)}"], *drop_ins)
    found = re.search(r"exposure level for modt.service: ([\d.]+)", done.stdout)
    assert found, done.stderr
    assert float(found[1]) <= most


@pytest.mark.parametrize("drop_ins", [(), ("lan-sensor", "ros2", "foxglove", "rapl", "raspberry-pi")])
def test_the_unit_is_verified_in_silence(analyze, drop_ins):
    done = analyze(["verify"], *drop_ins)
    assert (done.returncode, done.stdout + done.stderr) == (0, "")
