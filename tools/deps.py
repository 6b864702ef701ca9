"""Check the bounds, lock, bill of materials and known weaknesses of the dependencies, and the wheel itself.

    python -m tools.deps oldest [--python 3.10]   # the fast tests with the lowest versions of pyproject.toml
    python -m tools.deps newest [--python 3.14]   # … and with the newest
    python -m tools.deps lock                     # systemd/requirements.txt, with hashes
    python -m tools.deps sbom                     # dist/modt.cdx.json, CycloneDX, of that lock
    python -m tools.deps audit                    # known weaknesses of that lock (pip-audit)
    python -m tools.deps wheel                    # built twice, compared byte by byte

Needs uv (pip install uv) and a package index.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from tools.options import parser

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "systemd" / "requirements.txt"
EXTRAS = ("velodyne", "ros2", "foxglove")
"""Extras of the service's environment. `ouster` is left out because it brings a web server and a viewer."""
FAST = "not slow and not install and not kitti"
OLDEST = "lowest-direct"
NEWEST = "highest"
EPOCH = "1700000000"
UV = shutil.which("uv") or str(Path(sys.executable).with_name("uv"))


def _uv(*arguments: object, check: bool = True) -> subprocess.CompletedProcess[str]:
    command = [UV, "--no-config", *map(str, arguments)]
    try:
        return subprocess.run(command, check=check, text=True, stdout=subprocess.PIPE, cwd=ROOT)
    except FileNotFoundError:
        raise SystemExit("deps: uv is missing; pip install uv") from None
    except subprocess.CalledProcessError as error:
        raise SystemExit(f"deps: uv {' '.join(command[2:4])} ended with status {error.returncode}") from None


def tested(resolution: str, version: str) -> int:
    """Run the fast tests with the lowest or highest versions allowed, and print these."""
    with tempfile.TemporaryDirectory() as folder:
        python = Path(folder) / "venv" / "bin" / "python"
        _uv("venv", "--quiet", "--python", version, python.parents[1])
        _uv("pip", "install", "--quiet", "--python", python, "--resolution", resolution, "--editable", ".[test]")
        print(_uv("pip", "freeze", "--python", python, "--exclude-editable").stdout)
        command = [str(python), "-m", "pytest", "-m", FAST, "-p", "no:cacheprovider"]
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        return subprocess.run(command, check=False, cwd=ROOT, env=environment).returncode


def lock() -> int:
    """Write the lock of the service's environment for every supported platform and Python."""
    extras = [word for name in EXTRAS for word in ("--extra", name)]
    form = ["--universal", "--generate-hashes", "--no-annotate", "--python-version", "3.10", "--no-header"]
    done = _uv("pip", "compile", "--quiet", "--upgrade", *form, *extras, "pyproject.toml")
    LOCK.write_text(f"# modt[{','.join(EXTRAS)}], written by python -m tools.deps lock\n{done.stdout}")
    return 0


def sbom() -> int:
    """Write the bill of materials of the lock."""
    out = ROOT / "dist" / "modt.cdx.json"
    out.parent.mkdir(exist_ok=True)
    form = ["--of", "JSON", "--output-reproducible", "--pyproject", "pyproject.toml", "-o", out]
    _uv("tool", "run", "--from", "cyclonedx-bom", "cyclonedx-py", "requirements", LOCK, *form)
    print(f"{out}: {len(json.loads(out.read_text())['components'])} components")
    return 0


def audit() -> int:
    """Print the known weaknesses of the lock. A package that the index has no answer for counts as one."""
    form = ["--no-deps", "--disable-pip", "--progress-spinner", "off", "--format", "json"]
    done = _uv("tool", "run", "pip-audit", "--requirement", LOCK, *form, check=False)
    if not done.stdout.startswith("{"):
        raise SystemExit("deps: the index has no answer to pip-audit; run it where https://pypi.org can be reached")
    found = json.loads(done.stdout)["dependencies"]
    weak = [f"{d['name']} {d['version']}: {v['id']}" for d in found for v in d.get("vulns", ())]
    unknown = [d["name"] for d in found if "skip_reason" in d]
    if len(found) > len(unknown):
        print("\n".join(weak) or f"no known weakness in {len(found) - len(unknown)} packages")
    if unknown:
        where = "run it where https://pypi.org can be reached"
        print(f"{len(unknown)} packages of {len(found)} could not be asked about; {where}")
    return int(bool(weak or unknown))


def wheel() -> int:
    """Build the wheel in two places at two times, and compare both."""
    digests = set()
    for _ in range(2):
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "modt"
            ignored = shutil.ignore_patterns(".*", "runs", "dist", "build", "__pycache__")
            shutil.copytree(ROOT, copy, ignore=ignored, copy_function=shutil.copy)  # with other times
            environment = {**os.environ, "SOURCE_DATE_EPOCH": EPOCH}
            command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, str(copy)]
            subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
            digests.add(hashlib.sha256(next(Path(folder).glob("*.whl")).read_bytes()).hexdigest())
    print(f"the wheel is {'the same' if len(digests) == 1 else 'another'} each time: {' '.join(sorted(digests))}")
    return len(digests) - 1


ACTIONS: dict[str, Callable[[], int]] = {"lock": lock, "sbom": sbom, "audit": audit, "wheel": wheel}
RESOLUTIONS = {"oldest": OLDEST, "newest": NEWEST}


def main() -> int:
    options = parser(__doc__)
    options.add_argument("action", choices=[*RESOLUTIONS, *ACTIONS])
    options.add_argument(
        "--python", default="3.10", help="version or path, for oldest and newest (default: %(default)s)"
    )
    given = options.parse_args()
    if given.action in RESOLUTIONS:
        return tested(RESOLUTIONS[given.action], given.python)
    return ACTIONS[given.action]()


if __name__ == "__main__":
    raise SystemExit(main())
