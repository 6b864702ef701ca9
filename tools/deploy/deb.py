"""Debian package of a wheel and its libraries, for the Python of one distribution.

The program and its libraries lie in /opt/modt/lib, apart from those of the system. `modt service install` sets up the
service, and removing the package removes it. Needs dpkg-deb, uv and a package index.
"""

from __future__ import annotations

import subprocess
import tempfile
import zipfile
from pathlib import Path

from tools.deps import EXTRAS, UV

ARCHITECTURES = {"x86_64": "amd64", "aarch64": "arm64"}
"""Debian's name of each machine."""
PLACE = "opt/modt"
PROGRAM = """#!/usr/bin/python{python}
import sys
sys.path.insert(0, "/{place}/lib")
from {module} import main
raise SystemExit(main())
"""
PROGRAMS = {"modt": "modt.cli.main", "modt-profile": "modt_commands.profile"}
CONTROL = """Package: modt
Version: {version}
Architecture: {architecture}
Depends: python{python}
Section: science
Priority: optional
Maintainer: The maintainers of modt <modt@localhost>
Description: detects, tracks and classifies moving objects in a LiDAR stream
 One process on one CPU core, with an account of its energy.
"""
BEFORE_REMOVAL = """#!/bin/sh
set -e
if [ "$1" = remove ]; then /opt/modt/bin/modt service remove; fi
"""


def build_deb(wheel: Path, out: Path, architecture: str, python: str, *, libraries: bool = True) -> Path:
    """Write the package. Without its libraries it needs those of the system."""
    version = wheel.name.split("-")[1]
    made = out / f"modt_{version}_{architecture}_python{python}.deb"
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        root.chmod(0o755)
        _unpack(wheel, root / PLACE / "lib", architecture, python, libraries=libraries)
        for name, module in PROGRAMS.items():
            program = root / PLACE / "bin" / name
            _write(program, PROGRAM.format(python=python, place=PLACE, module=module), 0o755)
            link = root / "usr/bin" / name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(f"/{PLACE}/bin/{name}")
        control = CONTROL.format(version=version, architecture=architecture, python=python)
        _write(root / "DEBIAN/control", control, 0o644)
        _write(root / "DEBIAN/prerm", BEFORE_REMOVAL, 0o755)
        subprocess.run(["dpkg-deb", "-Zgzip", "--root-owner-group", "--build", str(root), str(made)], check=True)
    return made


def _unpack(wheel: Path, place: Path, architecture: str, python: str, *, libraries: bool) -> None:
    if not libraries:
        with zipfile.ZipFile(wheel) as file:
            file.extractall(place)
        return
    machine = next(machine for machine, name in ARCHITECTURES.items() if name == architecture)
    form = ["--only-binary", ":all:", "--python-platform", f"{machine}-manylinux_2_28", "--python-version", python]
    wanted = f"modt[{','.join(EXTRAS)}] @ {wheel.resolve().as_uri()}"
    command = [UV, "--no-config", "pip", "install", "--quiet", *form, "--target", str(place), wanted]
    try:
        subprocess.run(command, check=True)
    except FileNotFoundError:
        raise SystemExit("deb: uv is missing; pip install uv") from None


def _write(path: Path, text: str, mode: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    path.chmod(mode)
