"""Prove the unit under a real systemd, in namespaces of its own and on a throw-away copy of this system.

    sudo python -m tools.deploy.proof

The unit is installed, started on a recording, reloaded, hung, killed and stopped. A probe in the same sandbox tries
what must be refused. Each step prints a line, and the exit status is 0 if all went well. Needs root and systemd.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from pathlib import Path

from modt_commands.service import PREFIX, Service
from modt_simulation.synthetic_stream import SyntheticStream
from tools.deploy.proof_steps import END
from tools.options import parser

ROOT = Path(__file__).resolve().parents[2]
STEPS = Path(__file__).with_name("proof_steps.py")
SCANS = "srv/modt/scans"
PROFILE = "srv/modt/robot.yaml"
PYTHON = "/opt/modt/python"
"""Place of the interpreter in the copy. The unit cannot see a home directory."""
LIBRARIES = "/opt/modt/libraries"
"""Place of its libraries."""
PACKAGE = "/opt/modt/package"
"""Place of this checkout."""
INTERPRETER = f"{PYTHON}/bin/python{sys.version_info.major}.{sys.version_info.minor}"
LIMIT_S = 120.0
"""Time after which the proof ends without a verdict [s]."""
TARGET = """
[Unit]
Requires=proof.service basic.target
After=basic.target
AllowIsolate=yes
"""
DRIVER = """
[Unit]
DefaultDependencies=no
After=basic.target
[Service]
Type=oneshot
ExecStart={python} {steps} /srv/modt/report
"""
BOOT = """
set -e
mount --make-rprivate /
mount -t tmpfs tmpfs {work}
mkdir {work}/upper {work}/work {work}/root
mount -t overlay overlay -o lowerdir={lower},upperdir={work}/upper,workdir={work}/work {work}/root
cd {work}/root
cp -a {prepared}/. .
mkdir -p proc sys dev run tmp
mount -t proc proc proc
mount -t sysfs sysfs sys
mount -t cgroup2 cgroup2 sys/fs/cgroup
mount --rbind /dev dev
mount -t tmpfs tmpfs run
mount -t tmpfs tmpfs tmp
mkdir -p srv/modt/report
mount --bind {report} srv/modt/report
{shared}
container=lxc exec chroot . /lib/systemd/systemd --unit=proof.target --show-status=no
"""


def prepare(root: Path) -> None:
    """Write the files of the copy: the installed unit, a program, a recording, and the driver of the proof."""
    source = f"/{SCANS}?loop=yes"
    Service(root, Path(PREFIX)).install([], source, f"--profile /{PROFILE}")
    scans = root / SCANS
    scans.mkdir(parents=True)
    for frame in SyntheticStream("street", "vlp-16", 1.5, 0):
        frame.points.tofile(scans / f"{frame.index:06d}.bin")
    shutil.copy(ROOT / "profiles" / "vlp-16.yaml", root / PROFILE)
    shutil.copy(STEPS, root / "srv/modt/steps.py")
    program = root / "opt/modt/bin/modt"
    program.parent.mkdir(parents=True)
    path = f"{PACKAGE}/runtime:{LIBRARIES}"
    program.write_text(f'#!/bin/sh\nPYTHONPATH={path} exec {INTERPRETER} -m modt.cli.main "$@"\n')
    program.chmod(0o755)
    units = root / "etc/systemd/system"
    (units / "proof.target").write_text(TARGET)
    (units / "proof.service").write_text(DRIVER.format(python=INTERPRETER, steps="/srv/modt/steps.py"))


def report_of(base: Path) -> str:
    """Boot a copy of this system, whose files lie in a folder, and let it prove the unit; returns the report."""
    for name in ("prepared", "report", "work"):
        (base / name).mkdir()
    prepare(base / "prepared")
    mounts = {PYTHON: Path(sys.base_prefix).resolve(), LIBRARIES: sysconfig.get_path("purelib"), PACKAGE: ROOT}
    shared = "\n".join(f"mkdir -p .{place}; mount --rbind {path} .{place}" for place, path in mounts.items())
    script = BOOT.format(
        lower="/", work=base / "work", prepared=base / "prepared", report=base / "report", shared=shared
    )
    (base / "boot.sh").write_text(script)
    namespaces = ["--mount", "--pid", "--fork", "--kill-child", "--ipc", "--uts", "--cgroup", "--net"]
    command = ["unshare", *namespaces, "sh", str(base / "boot.sh")]
    report = base / "report" / "report.txt"
    end_s = time.monotonic() + LIMIT_S
    text = ""
    system = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        while time.monotonic() < end_s and system.poll() is None and not text.endswith(END):
            time.sleep(0.2)
            text = report.read_text() if report.exists() else ""
    finally:
        system.kill()  # --kill-child ends all its processes
        system.wait()
    return text


def main(arguments: list[str] | None = None) -> int:
    parser(__doc__).parse_args(arguments)
    if os.geteuid() or shutil.which("systemctl") is None:
        raise SystemExit("proof: needs root and systemd")
    with tempfile.TemporaryDirectory() as folder:
        text = report_of(Path(folder))
    print(text.removesuffix(END), end="")
    verdict = "did not come to its end"
    if text.endswith(END):
        verdict = "bad" if "fail " in text else "good"
    print(f"verdict: {verdict}")
    return int(verdict != "good")


if __name__ == "__main__":
    raise SystemExit(main())
