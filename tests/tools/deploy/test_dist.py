"""A release, a Debian package and an image, built where the tools are."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import modt
from tests.tools.deploy import debian_root
from tools.deploy import deb, dist

ROOT = Path(__file__).resolve().parents[3]
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"


@pytest.fixture(scope="module")
def release(tmp_path_factory):
    folder = tmp_path_factory.mktemp("dist")
    assert dist.main(["--out", str(folder), "--target", "native"]) == 0
    return folder


@pytest.mark.install
def test_a_release_has_checksums_and_a_page_that_names_each_file(release):
    subprocess.run(["sha256sum", "--check", "--strict", "SHA256SUMS"], cwd=release, check=True, capture_output=True)
    files = {path.name for path in release.iterdir()} - {"SHA256SUMS", "release.md"}
    page = (release / "release.md").read_text()
    assert {name for name in files if f"| {name} |" in page} == files
    (wheel,) = (name for name in files if name.endswith(".whl"))
    assert f"pip install --no-deps ./{wheel}" in page


@pytest.mark.install
@pytest.mark.skipif(shutil.which("dpkg-deb") is None, reason="dpkg-deb is not installed here")
def test_a_debian_package_holds_the_program(release, tmp_path):
    (wheel,) = release.glob("*.whl")
    package = deb.build_deb(wheel, tmp_path, "amd64", PYTHON, libraries=False)
    field = subprocess.run(["dpkg-deb", "--field", package], check=True, capture_output=True, text=True).stdout
    assert {f"Version: {modt.__version__}", f"Depends: python{PYTHON}"} <= set(field.splitlines())
    subprocess.run(["dpkg-deb", "--extract", package, tmp_path / "root"], check=True)
    program = tmp_path / "root/opt/modt/bin/modt"
    assert program.read_text().startswith(f"#!/usr/bin/python{PYTHON}\n")
    where = f"{tmp_path}/root/opt/modt/lib:{Path(np.__file__).parents[1]}"
    command = [sys.executable, program, "--version"]
    done = subprocess.run(command, env={"PYTHONPATH": where}, check=True, capture_output=True, text=True)
    assert done.stdout == f"modt {modt.__version__}\n"
    assert (tmp_path / "root/usr/bin/modt").readlink() == Path("/opt/modt/bin/modt")


def has_daemon():
    quiet = subprocess.DEVNULL
    return shutil.which("docker") and not subprocess.call(["docker", "info"], stdout=quiet, stderr=quiet)


@pytest.mark.install
def test_the_image_runs_modt():
    if not has_daemon():
        pytest.skip("no Docker daemon here")
    subprocess.run(["docker", "build", "--tag", "modt-test", str(ROOT)], check=True)
    done = subprocess.run(["docker", "run", "--rm", "modt-test", "--version"], check=True, capture_output=True)
    assert done.stdout.decode() == f"modt {modt.__version__}\n"


@pytest.mark.install
def test_the_steps_of_the_image_make_a_debian_system_run_modt(tmp_path):
    if has_daemon():
        pytest.skip("the image itself is built here")
    if reason := debian_root.reason_against():
        pytest.skip(reason)
    root = tmp_path / "root"
    try:
        if not debian_root.make(root):
            pytest.skip("Debian's mirror does not answer")
        user = debian_root.build(root, ROOT)
        assert user == "modt"
        assert debian_root.run(root, "modt --version", user) == f"modt {modt.__version__}\n"
        debian_root.run(root, "cd /runs; modt replay --frames 0:2 --core none --quiet --out /runs/try", user)
        assert len((root / "runs/try/tracks.jsonl").read_text().splitlines()) == 2
    finally:
        shutil.rmtree(root, ignore_errors=True)  # a gigabyte
