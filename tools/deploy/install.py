"""Installs or removes the service: the unit, drop-ins that are asked for, and /etc/modt/modt.env.

    python -m tools.deploy.install --with lan-sensor --source velodyne://0.0.0.0:2368
    python -m tools.deploy.install --remove

Doing it again changes nothing. Drop-ins that are not asked for are removed. /etc/modt/modt.env is kept once it
exists, and removed as long as its first line says that it was installed. `--root DIR` installs into an image.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

from tools.options import parser

UNITS = Path(__file__).resolve().parents[2] / "systemd"
UNIT = "modt.service"
DROP_INS = {path.stem: path for path in sorted(UNITS.glob("*.conf"))}
MARK = "# installed by tools.deploy.install\n"


def environment(source: str, options: str) -> str:
    """Text of modt.env."""
    return f"{MARK}MODT_SOURCE={source}\nMODT_OPTIONS={options}\n"


class Installation:
    """Files below a root, and what was done to them."""

    def __init__(self, root: Path, prefix: Path) -> None:
        self.unit = root / "etc/systemd/system" / UNIT
        self.drop_ins = self.unit.with_name(f"{UNIT}.d")
        self.environment = root / "etc/modt/modt.env"
        self._prefix = prefix
        self.changed: list[str] = []

    def install(self, chosen: list[str], environment: str) -> None:
        """Bring the files to what was asked for."""
        self._write(self.unit, (UNITS / UNIT).read_text().replace("/opt/modt/", f"{self._prefix}/"))
        for name, path in DROP_INS.items():
            place = self.drop_ins / path.name
            if name in chosen:
                self._write(place, path.read_text())
            else:
                self._remove(place)
        if not self.environment.exists():
            self._write(self.environment, environment)

    def remove(self) -> None:
        """Remove what was installed, and nothing else."""
        for path in (*(self.drop_ins / path.name for path in DROP_INS.values()), self.unit):
            self._remove(path)
        if self.environment.exists() and self.environment.read_text().startswith(MARK):
            self._remove(self.environment)
        for folder in (self.drop_ins, self.environment.parent):
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()

    def _write(self, path: Path, text: str) -> None:
        if path.exists() and path.read_text() == text:
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.name}.part")
        partial.write_text(text)
        partial.replace(path)
        self.changed.append(f"written {path}")

    def _remove(self, path: Path) -> None:
        if path.exists():
            path.unlink()
            self.changed.append(f"removed {path}")


def main(arguments: list[str] | None = None) -> None:
    options = parser(__doc__)
    options.add_argument("--with", action="append", default=[], choices=DROP_INS, dest="drop_ins", help="drop-in")
    options.add_argument("--source", default="", help="SOURCE of modt run")
    options.add_argument("--options", default="", help="further options of modt run")
    options.add_argument("--prefix", type=Path, default=Path("/opt/modt"), help="environment that holds bin/modt")
    options.add_argument("--root", type=Path, default=Path("/"), help="of the image (default: this system)")
    options.add_argument("--remove", action="store_true", help="remove the service")
    given = options.parse_args(arguments)
    installation, here = Installation(given.root, given.prefix), given.root == Path("/")
    if given.remove:
        if here and installation.unit.exists():
            systemctl("disable", "--now", UNIT)
        installation.remove()
    else:
        installation.install(given.drop_ins, environment(given.source, given.options))
    print("\n".join(installation.changed) or "nothing to change")
    if here and installation.changed:
        systemctl("daemon-reload")
        if not given.remove:
            print(f"start it by: systemctl enable --now {UNIT}")


def systemctl(*arguments: str) -> None:
    """Tell systemd; its own message says what fails."""
    subprocess.run(["systemctl", *arguments], check=False)


if __name__ == "__main__":
    main()
