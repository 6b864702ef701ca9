"""Make a release of wheels, the lock, Debian packages on request, checksums and a page.

    python -m tools.deploy.dist [--out dist] [--deb 3.10 --deb 3.12]

It needs the extra "wheels", whose `ziglang` is the cross compiler. The compiled kernels link no library, so that a
wheel serves glibc and musl. With `--target native` the compiler of this machine makes a wheel for this machine alone.
`--deb VERSION` packs the wheels and their libraries for that Python.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import modt
from modt.native.build import TARGETS
from tools.deploy.deb import ARCHITECTURES, build_deb
from tools.options import parser

ROOT = Path(__file__).resolve().parents[2]
NATIVE = "native"
SUMS = "SHA256SUMS"
PAGE = "release.md"
LOCK = "requirements.txt"


def build_wheel(out: Path, target: str | None) -> Path:
    """A wheel for a machine of TARGETS, or for this machine."""
    before = set(out.glob("*.whl"))
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(ROOT)]
    subprocess.run(command, check=True, env=os.environ | ({} if target is None else {"MODT_TARGET": target}))
    made = set(out.glob("*.whl")) - before
    if len(made) != 1:
        raise SystemExit(f"dist: {out} held this wheel already; give an empty folder")
    return made.pop()


def changes(text: str, version: str) -> str:
    """The section of a version in the changelog."""
    found = re.search(rf"^## \[{re.escape(version)}\].*\n((?:(?!## \[).*\n?)*)", text, re.MULTILINE)
    if found is None:
        raise SystemExit(f"dist: CHANGELOG.md has no section [{version}]")
    return found[1].strip()


def page(files: list[Path], digests: dict[str, str]) -> str:
    """The release page, with the installation, the changes and the files."""
    wheels = [path.name for path in files if path.suffix == ".whl"]
    debs = [path.name for path in files if path.suffix == ".deb"]
    lines = [f"# modt {modt.__version__}", "", "Choose the file of your machine, check it, and install it:", ""]
    lines += [f"    sha256sum --check --ignore-missing {SUMS}", "    python3 -m venv /opt/modt"]
    lines += [f"    /opt/modt/bin/pip install --require-hashes -r {LOCK}   # the libraries as they were tested"]
    lines += [f"    /opt/modt/bin/pip install --no-deps ./{name}   # of your machine" for name in wheels]
    lines += [f"    sudo apt install ./{name}   # instead of the environment" for name in debs]
    lines += ["    /opt/modt/bin/modt replay", "", "## Changes", ""]
    lines += [changes((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), modt.__version__), "", "## Files", ""]
    lines += ["| file | size | SHA-256 |", "|---|---|---|"]
    lines += [f"| {p.name} | {p.stat().st_size / 1e6:.1f} MB | `{digests[p.name]}` |" for p in files]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    options = parser(__doc__)
    options.add_argument("--out", type=Path, default=Path("dist"), help="folder (default: %(default)s)")
    targets = "machine of a wheel; repeatable (default: all but native)"
    options.add_argument("--target", action="append", choices=[*TARGETS, NATIVE], help=targets)
    options.add_argument("--deb", action="append", default=[], metavar="VERSION", help="Python of a Debian package")
    given = options.parse_args(arguments)
    missing = [name for name in ("build", "hatchling", "ziglang") if find_spec(name) is None]
    if missing and given.target != [NATIVE]:
        raise SystemExit(f"dist: {', '.join(missing)} not installed; pip install '.[wheels]'")
    out: Path = given.out
    out.mkdir(parents=True, exist_ok=True)
    files = []
    for target in given.target or TARGETS:
        wheel = build_wheel(out, None if target == NATIVE else target)
        files.append(wheel)
        machine = os.uname().machine if target == NATIVE else target
        files += [build_deb(wheel, out, ARCHITECTURES[machine], python) for python in given.deb]
    files.append(Path(shutil.copy(ROOT / "systemd" / LOCK, out)))
    digests = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
    (out / SUMS).write_text("".join(f"{digest}  {name}\n" for name, digest in digests.items()), encoding="utf-8")
    (out / PAGE).write_text(page(files, digests), encoding="utf-8")
    print(f"{out / PAGE}: {len(files)} files")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
