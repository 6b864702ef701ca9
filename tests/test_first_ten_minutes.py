"""The first ten minutes of the README, as a new user has them."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.test_assets import bare_environment, install

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("runtime", "tools", "models", "profiles", "systemd")
COPIED += ("pyproject.toml", "hatch_build.py", "Makefile", "README.md", "LICENSE")
TIMEOUT_S = 600.0


def commands() -> str:
    """The block as it is written."""
    (block,) = re.findall(r"## The first ten minutes\n\n((?: {4}.*\n)+)", (ROOT / "README.md").read_text())
    return re.sub(r"^ {4}", "", block, flags=re.MULTILINE)


@pytest.fixture
def checkout(tmp_path) -> Path:
    """A copy of this one whose environment is set up, from the libraries that are here."""
    for name in COPIED:
        place = ROOT / name
        copy = shutil.copytree if place.is_dir() else shutil.copy
        copy(place, tmp_path / name)
    environment = bare_environment(tmp_path / ".venv")
    install(environment, "--editable", str(tmp_path), CC="no-such-compiler")  # the kernels are copied
    (environment / ".run").touch()
    return tmp_path


@pytest.mark.slow
@pytest.mark.install
def test_every_command_works_as_written(checkout):
    text = commands()
    assert len(text.splitlines()) > 5
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}
    done = subprocess.run(
        ["bash", "-e"],
        input=text,
        cwd=checkout,
        env=clean,
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "modt view runs/embedded" in done.stdout
    for path in re.findall(r"(runs/\S+\.(?:html|svg))\b(?! in)", done.stdout):
        assert (checkout / path).stat().st_size > 1000
    assert '"outcome":"missed"' in (checkout / "runs" / "sim" / "view.html").read_text()
