"""Whether two commits write the same tracks, byte for byte.

    python -m tools.same_tracks BASE [RECORDING=PROFILE ...] [--modes accurate ...] [--kernels native numpy]

The commit BASE is checked out and compiled in a temporary folder. It simulates a drive of each of six sensors. The
base and this working tree then replay every drive, and every recording given, in each mode and on each kind of
kernels. One line is printed for each replay. The exit status is 1 if a track differs.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

from tools.options import parser

ROOT = Path(__file__).resolve().parents[1]
DRIVES = (
    ("street", "hdl-64e", ()),
    ("crossing", "os1-64", ()),
    ("yard", "vlp-16", ("--distort",)),
    ("corridor", "mid-360", ()),
    ("crowd", "pandar64", ()),
    ("ramp", "xt-32", ()),
)
"""Scene and sensor of each simulated drive, and further options of `modt simulate`."""
DRIVE_SECONDS = 6
COMPILE = "from modt.native import build; build.compile_all(build.FOLDER)"


def run(tree: Path, *command: str, kernels: str = "") -> None:
    """Run Python on the packages of a checkout.

    Raises:
        subprocess.CalledProcessError: it failed; its output was printed.
    """
    packages = os.pathsep.join(str(tree / folder) for folder in ("runtime", "tools"))
    environment = os.environ | {"PYTHONPATH": packages, "MODT_KERNELS": kernels}
    try:
        subprocess.run([sys.executable, *command], env=environment, cwd=tree, check=True, capture_output=True)
    except subprocess.CalledProcessError as error:
        print(error.stderr.decode(), file=sys.stderr)
        raise


def digest(tree: Path, recording: Path, profile: str, mode: str, kernels: str, *options: str) -> str:
    """Start of the hash of the tracks that a checkout writes."""
    with TemporaryDirectory() as out:
        where = ("--profile", profile, "--mode", mode, "--out", out)
        run(tree, "-m", "modt", "replay", str(recording), *where, *options, kernels=kernels)
        return hashlib.sha256((Path(out) / "tracks.jsonl").read_bytes()).hexdigest()[:12]


def simulate(tree: Path, folder: Path) -> Iterator[tuple[Path, str]]:
    """Recording and profile of each simulated drive, made by a checkout."""
    for seed, (scene, sensor, options) in enumerate(DRIVES, start=41):
        out = folder / sensor
        command = ("simulate", "--scene", scene, "--sensor", sensor, "--seed", str(seed), "--out", str(out))
        run(tree, "-m", "modt", *command, "--seconds", str(DRIVE_SECONDS), "--all-around", *options)
        yield next(out.glob("*/*_drive_*")), sensor


def check_out(commit: str, folder: Path) -> None:
    """Lay a commit out in a folder, and compile its kernels."""
    archive = subprocess.run(["git", "archive", commit], cwd=ROOT, check=True, capture_output=True).stdout
    folder.mkdir()
    subprocess.run(["tar", "-x", "-C", str(folder)], input=archive, check=True)
    run(folder, "-c", COMPILE)


def main(argv: Sequence[str] | None = None) -> int:
    arguments = parser(__doc__)
    arguments.add_argument("base")
    arguments.add_argument("recordings", nargs="*", metavar="RECORDING=PROFILE")
    arguments.add_argument("--modes", nargs="+", default=["accurate", "efficient", "conventional"])
    arguments.add_argument("--kernels", nargs="+", default=["native", "numpy"])
    asked = arguments.parse_args(argv)
    different = 0
    with TemporaryDirectory() as folder:
        base = Path(folder) / "base"
        check_out(asked.base, base)
        run(ROOT, "-c", COMPILE)
        recordings = [*simulate(base, Path(folder) / "drives")]
        for given in asked.recordings:
            path, _, profile = given.partition("=")
            recordings.append((Path(path).resolve(), profile))
        for (recording, profile), mode, kernels in product(recordings, asked.modes, asked.kernels):
            # Every other drive is replayed without poses, so that registration is compared as well.
            options = ("--odometry", "none") if profile in ("xt-32", "os1-64", "mid-360") else ()
            before, now = (digest(tree, recording, profile, mode, kernels, *options) for tree in (base, ROOT))
            different += before != now
            outcome = "same" if before == now else f"DIFFERENT, was {before}"
            print(f"{now} {profile:9} {mode:12} {kernels:7} {recording.name}: {outcome}", flush=True)
    return min(different, 1)


if __name__ == "__main__":
    raise SystemExit(main())
