"""`modt service`: install or remove the systemd unit that runs `modt run` on a robot."""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from modt import assets
from modt.cli import options
from modt.errors import MisuseError
from modt.sinks.output import replace_file, writing

UNIT = "modt.service"
PREFIX = "/opt/modt"
"""Environment that the shipped unit names."""
HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")
"""Folders that the unit cannot see (ProtectHome=, PrivateTmp=)."""
MARK = "# installed by modt service install\n"


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    group = commands.add_parser("service", help="install or remove the systemd unit of modt run")
    actions = group.add_subparsers(dest="action", required=True, metavar="COMMAND")
    p = actions.add_parser(
        "install", help="write the unit, its drop-ins and /etc/modt/modt.env; repeating it is safe"
    )
    p.add_argument("--source", default="", metavar="SOURCE", help="source of modt run")
    p.add_argument("--options", default="", metavar="TEXT", help="further options of modt run, as one text")
    drop_in = "grant what the unit withholds; drop-ins that are not named are removed; repeatable"
    p.add_argument("--with", action="append", default=[], choices=drop_ins(), dest="drop_ins", help=drop_in)
    p.add_argument("--prefix", type=Path, metavar="DIR", help="environment that holds bin/modt (default: this one)")
    options.add_examples(
        p,
        "modt service install --source velodyne:// --with lan-sensor   as root: a Velodyne on the robot's network",
        "modt service install --options=--profile=vlp-16   with the profile of the sensor",
    )
    q = actions.add_parser("remove", help="stop the service and remove what install wrote")
    options.add_examples(q, "modt service remove   as root: undo modt service install")
    for parser in (p, q):
        root = "system image (default: this system)"
        parser.add_argument("--root", type=Path, default=Path("/"), metavar="DIR", help=root)
        parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Install or remove, and print what was changed.

    Raises:
        MisuseError: the service could not see the environment.
        ModtError: a file cannot be written.
    """
    here = arguments.root == Path("/")
    if arguments.action == "remove":
        service = Service(arguments.root)
        if here and service.unit.exists():
            _systemctl("disable", "--now", UNIT)
        service.remove()
    else:
        prefix = Path(sys.prefix) if arguments.prefix is None else arguments.prefix
        service = Service(arguments.root, prefix)
        if str(prefix).startswith(tuple(f"{folder}/" for folder in HIDDEN)):
            remedy = f"install modt below {PREFIX}, or give --prefix"
            raise MisuseError(prefix, "a service cannot see this folder", remedy)
        service.install(arguments.drop_ins, arguments.source, arguments.options)
    print("\n".join(service.changed) or "nothing to change")
    if here and service.changed:
        _systemctl("daemon-reload")
        if arguments.action == "install":
            print(f"start it by: systemctl enable --now {UNIT}")
    return 0


def drop_ins() -> dict[str, Path]:
    """The shipped drop-ins by name."""
    return {path.stem: path for path in sorted(assets.folder("systemd").glob("*.conf"))}


class Service:
    """The unit, its drop-ins and /etc/modt/modt.env below a root.

    An existing modt.env is kept, and is removed only while its first line says that this command wrote it.

    Attributes:
        changed: a line for each file that was written or removed.
    """

    def __init__(self, root: Path, prefix: Path = Path(PREFIX)) -> None:
        self.unit = root / "etc/systemd/system" / UNIT
        self.environment = root / "etc/modt/modt.env"
        self.changed: list[str] = []
        self._drop_ins = self.unit.with_name(f"{UNIT}.d")
        self._prefix = prefix

    def install(self, chosen: list[str], source: str, options: str) -> None:
        """Write the unit with the chosen drop-ins, and a first modt.env.

        Raises:
            ModtError: a file cannot be written.
        """
        unit = (assets.folder("systemd") / UNIT).read_text(encoding="utf-8")
        self._write(self.unit, unit.replace(f"{PREFIX}/", f"{self._prefix}/"))
        for name, path in drop_ins().items():
            place = self._drop_ins / path.name
            if name in chosen:
                self._write(place, path.read_text(encoding="utf-8"))
            else:
                self._remove(place)
        if not self.environment.exists():
            self._write(self.environment, f"{MARK}MODT_SOURCE={source}\nMODT_OPTIONS={options}\n")

    def remove(self) -> None:
        """Remove what was installed, and nothing else.

        Raises:
            ModtError: a file cannot be removed.
        """
        for path in (*(self._drop_ins / path.name for path in drop_ins().values()), self.unit):
            self._remove(path)
        if self.environment.exists() and self.environment.read_text(encoding="utf-8").startswith(MARK):
            self._remove(self.environment)
        for folder in (self._drop_ins, self.environment.parent):
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()

    def _write(self, path: Path, text: str) -> None:
        if path.exists() and path.read_text(encoding="utf-8") == text:
            return
        with writing(path, remedy="run it as root"):
            path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, text)
        self.changed.append(f"written {path}")

    def _remove(self, path: Path) -> None:
        if path.exists():
            with writing(path, remedy="run it as root"):
                path.unlink()
            self.changed.append(f"removed {path}")


def _systemctl(*arguments: str) -> None:
    """Run systemctl, which prints its own errors."""
    if shutil.which("systemctl"):
        subprocess.run(["systemctl", *arguments], check=False)
