"""The steps of the Dockerfile in a folder with a Debian system of its own, where no container can be built."""

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

SUITE = "bookworm"
MIRROR = "http://deb.debian.org/debian"
PACKAGES = "ca-certificates,python3,python3-dev,python3-venv"
CERTIFICATES = Path("etc/ssl/certs/ca-certificates.crt")


def reason_against() -> str | None:
    """Why this machine cannot do it, or None."""
    if os.geteuid():
        return "neither a Docker daemon nor root"
    missing = [name for name in ("debootstrap", "chroot", "unshare") if shutil.which(name) is None]
    if missing:
        return f"neither a Docker daemon nor {missing[0]}"
    if subprocess.run(["unshare", "--mount", "true"], check=False, capture_output=True).returncode:
        return "neither a Docker daemon nor the right to mount"
    return None


def make(root: Path) -> bool:
    """Install Debian, with a Python as the image has it at /usr/local; returns whether the mirror answers."""
    command = ["debootstrap", "--variant=minbase", f"--include={PACKAGES}", SUITE, str(root), MIRROR]
    if subprocess.run(command, check=False, capture_output=True).returncode:
        return False
    for path in (Path("etc/resolv.conf"), CERTIFICATES):
        shutil.copyfile("/" / path, root / path)
    run(root, "python3 -m venv /usr/local")
    return True


def run(root: Path, command: str, user: str = "root") -> str:
    """Output of a shell command in the system.

    Raises:
        CalledProcessError: it failed.
    """
    inner = shlex.join(["chroot", f"--userspec={user}", str(root), "sh", "-e", "-c", command])
    mounted = f"mount --rbind /proc {shlex.quote(str(root / 'proc'))} && exec {inner}"
    own = {"PATH": "/usr/local/bin:/usr/bin:/bin:/usr/sbin:/sbin", "HOME": "/tmp", "PIP_CERT": f"/{CERTIFICATES}"}
    done = subprocess.run(
        ["unshare", "--mount", "sh", "-c", mounted], check=False, capture_output=True, text=True, env=own
    )
    assert done.returncode == 0, f"{command}: {done.stdout[-1000:]} {done.stderr[-2000:]}"
    return done.stdout


def steps(dockerfile: str) -> Iterator[tuple[str, str]]:
    """Kind and text of each instruction."""
    for line in re.sub(r"\\\n", " ", dockerfile).splitlines():
        if line and not line.startswith("#"):
            kind, _, text = line.partition(" ")
            yield kind, text.strip()


def build(root: Path, source: Path) -> str:
    """Do the steps of the Dockerfile of a folder; returns the user that the image runs as."""
    user = "root"
    for kind, text in steps((source / "Dockerfile").read_text()):
        if kind == "RUN":
            run(root, text)
        elif kind == "COPY" and not text.startswith("--from"):
            _copy(source, *text.split(), root)
        elif kind == "COPY":  # of another stage: both stages share this system
            _, before, after = text.split()
            shutil.copytree(root / before.strip("/"), root / after.strip("/"))
        elif kind == "USER":
            user = text
    return user


def _copy(source: Path, what: str, where: str, root: Path) -> None:
    """Copy what .dockerignore leaves over, or one file."""
    target = root / where.strip("/")
    if what != ".":
        shutil.copyfile(source / what, target)
        return
    lines = (source / ".dockerignore").read_text().splitlines()
    ignored = shutil.ignore_patterns(*(line.removeprefix("**/") for line in lines if line.startswith("**/")))
    for pattern in (line[1:] for line in lines if line.startswith("!")):
        for path in source.glob(pattern):
            place = target / path.relative_to(source)
            place.parent.mkdir(parents=True, exist_ok=True)
            if path.is_dir():
                shutil.copytree(path, place, ignore=ignored)
            else:
                shutil.copyfile(path, place)
