"""models/ and profiles/ are found from a checkout, an editable install and a wheel alike."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy
import pytest

from tests.sources.packets.simulated import packets
from tools import deps
from tools.send.pcap_writer import write_capture

CHECKOUT = Path(__file__).resolve().parents[1]
PROBE = """
import pathlib
import modt
from modt import assets, profile
print(pathlib.Path(modt.__file__).parent)
print([p.name for kind, suffix in (("models", ".onnx"), ("profiles", ".yaml")) for p in assets.shipped(kind, suffix)])
profile.load()
pipeline = modt.Pipeline.from_profile("vlp-16", mode="accurate")
assert len(pipeline.step([[5.0, 0.0, 0.0, 0.0]], 0.0)) == 0
"""


def probe(python: str, *, path: Path | None = None, cwd: Path, kernels: str = "auto") -> tuple[str, str]:
    """Folder from which modt is imported, and the files it finds."""
    env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"MODT_KERNELS": kernels}
    if path is not None:
        env["PYTHONPATH"] = str(path)
    done = subprocess.run([python, "-c", PROBE], check=False, capture_output=True, text=True, env=env, cwd=cwd)
    assert done.returncode == 0, done.stderr
    package, files = done.stdout.splitlines()
    return package, files


def built(folder: Path, **variables: str) -> Path:
    """A wheel of the checkout."""
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(CHECKOUT)]
    subprocess.run(build, check=True, capture_output=True, env=os.environ | variables)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def expected(tmp_path_factory) -> str:
    """Files that a checkout finds."""
    package, files = probe(sys.executable, path=CHECKOUT / "runtime", cwd=tmp_path_factory.getbasetemp())
    assert package == str(CHECKOUT / "runtime" / "modt")
    assert "hdl-64e.yaml" in files
    return files


def bare_environment(folder: Path) -> Path:
    """A fresh environment that sees this one's libraries, but not this one's modt."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    site = next((folder / "lib").glob("python3*")) / "site-packages"
    (site / "libraries.pth").write_text(str(Path(numpy.__file__).parents[1]) + "\n")
    return folder


@pytest.fixture
def environment(tmp_path) -> Path:
    return bare_environment(tmp_path / "environment")


def install(environment: Path, *what: str, **variables: str) -> None:
    """Install with this environment's pip, from what is on this machine alone."""
    python = environment / "bin" / "python"
    command = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index"]
    quiet = ["--disable-pip-version-check", "--no-build-isolation", "--ignore-installed"]
    subprocess.run([*command, *quiet, *what], check=True, capture_output=True, text=True, env=os.environ | variables)


@pytest.mark.install
def test_from_a_wheel(expected, environment, tmp_path):
    wheel = built(tmp_path)
    compiled = "py3-none-any" not in wheel.name
    assert compiled == (shutil.which("cc") is not None)
    install(environment, str(wheel))
    kernels = "native" if compiled else "numpy"
    package, files = probe(str(environment / "bin" / "python"), cwd=tmp_path, kernels=kernels)
    assert package.startswith(str(environment))
    assert files == expected
    write_capture(tmp_path / "drive.pcap", packets("xt-32"), 2368)
    replay = [environment / "bin" / "modt", "replay", "drive.pcap", "--out", "run", "--quiet"]
    subprocess.run(replay, cwd=tmp_path, check=True, capture_output=True)
    assert b'"class":"car"' in (tmp_path / "run" / "tracks.jsonl").read_bytes()
    command = [environment / "bin" / "modt", "service", "install", "--root", tmp_path, "--prefix", "/opt/modt"]
    subprocess.run(command, check=True, capture_output=True)
    assert (tmp_path / "etc/systemd/system/modt.service").is_file()


@pytest.mark.install
def test_from_a_wheel_made_without_a_compiler(expected, environment, tmp_path):
    wheel = built(tmp_path, CC="no-such-compiler")
    assert wheel.name.endswith("py3-none-any.whl")
    install(environment, str(wheel))
    assert probe(str(environment / "bin" / "python"), cwd=tmp_path)[1] == expected


@pytest.mark.install
def test_a_wheel_is_the_same_wherever_and_whenever_it_is_built():
    assert deps.wheel() == 0
