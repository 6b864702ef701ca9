"""Run the tests on an emulated 64-bit Arm, in a Debian of its own with aarch64 wheels from the package index.

    sudo python -m tools.arm64 [FOLDER] [--tests tests/golden tests/tracking …]

It needs root, debootstrap, qemu-user-static (apt install), uv and the extra "wheels" (pip install), because the tests
run on the kernels of an aarch64 wheel. The userland in FOLDER is kept, so that a second run begins at once. The
emulator is registered with the kernel while this runs. It is some 20 times slower than the machine, and by default
only the tests of perception, golden replays, readers and writers run.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from modt.native import build
from tools.deps import UV
from tools.options import parser

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
SUITE = "bookworm"
PYTHON = "3.11"
PACKAGES = "python3,ca-certificates,gcc,libc6-dev"
PLATFORM = "aarch64-manylinux_2_28"
LIBRARIES = f"usr/local/lib/python{PYTHON}/dist-packages"
LEFT_OUT = {"cyclonedds", "ruff", "mypy"}
"""Packages of the extra [test] that have no wheel for this platform, or no use there."""
TESTS = (
    *("golden", "segmentation", "odometry", "tracking", "geometry", "classification", "energy", "native"),
    *("modt_evaluation/box_tracking", "sources", "sinks", "ros2", "app", "profile", "crash"),
    *("test_library.py", "test_pipeline.py"),
)
NOT_EMULATED = "tests/poses/test_pose_socket.py::test_what_the_kernel_drops_is_counted"
"""Test that fails because the emulator does not pass on the kernel's count of dropped datagrams."""
QEMU = Path("/usr/bin/qemu-aarch64-static")
CPU = "cortex-a72"
CORE = """processor\t: {number}
Features\t: fp asimd evtstrm crc32 cpuid
CPU implementer\t: 0x41
CPU architecture: 8
CPU variant\t: 0x0
CPU part\t: 0xd08
CPU revision\t: 3

"""
"""/proc/cpuinfo of a Raspberry Pi 4. ONNX Runtime ends on that of the host."""
BINFMT = Path("/proc/sys/fs/binfmt_misc")
NAME = "modt-aarch64"
MAGIC = r"\x7fELF\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00"
MASK = r"\xff\xff\xff\xff\xff\xff\xff\x00\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff"


def run(*command: object) -> None:
    """Run a command, and end with an error if it fails."""
    done = subprocess.run([*map(str, command)], check=False)
    if done.returncode:
        raise SystemExit(f"arm64: {command[0]} ended with status {done.returncode}")


@contextmanager
def emulator() -> Iterator[None]:
    """Context in which the kernel runs Arm programs by the emulator."""
    if not (BINFMT / "register").exists():
        run("mount", "-t", "binfmt_misc", "binfmt_misc", BINFMT)
    known = any("aarch64" in entry.name for entry in BINFMT.iterdir())
    if not known:
        (BINFMT / "register").write_text(f":{NAME}:M::{MAGIC}:{MASK}:{QEMU}:F")
    try:
        yield
    finally:
        if not known:
            (BINFMT / NAME).write_text("-1")


@contextmanager
def mounted(what: object, where: Path, *options: str) -> Iterator[None]:
    """Context in which something is mounted."""
    run("mount", *options, what, where)
    try:
        yield
    finally:
        run("umount", "--recursive", "--lazy", where)


def install(root: Path) -> None:
    """Install the userland, and the libraries as wheels."""
    if not (root / "usr/bin/python3").exists():
        run("debootstrap", "--arch=arm64", "--variant=minbase", f"--include={PACKAGES}", SUITE, root)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    wanted = [
        name for name in wanted if name.split(">")[0] not in LEFT_OUT and not name.startswith(("types-", "scipy-"))
    ]
    form = ["--only-binary", ":all:", "--python-platform", PLATFORM, "--python-version", PYTHON]
    run(UV, "--no-config", "pip", "install", "--quiet", *form, "--target", root / LIBRARIES, *wanted)


def compile_kernels(folder: Path) -> Path:
    """Copy modt.native, and compile its libraries for this platform with the compiler of the wheels."""
    shutil.copytree(build.FOLDER, folder, ignore=shutil.ignore_patterns("*.so", "__pycache__"), dirs_exist_ok=True)
    try:
        build.compile_all(folder, "aarch64")
    except build.NoCompilerError as error:
        raise SystemExit(f"arm64: {error}") from None
    return folder


def main() -> int:
    options = parser(__doc__)
    options.add_argument("folder", type=Path, nargs="?", default=Path("/var/tmp/modt-arm64"), metavar="FOLDER")
    options.add_argument("--tests", nargs="+", default=[f"tests/{name}" for name in TESTS])
    given = options.parse_args()
    if os.geteuid() or not shutil.which("debootstrap") or not QEMU.exists():
        raise SystemExit("arm64: needs root, debootstrap and qemu-user-static")
    root = given.folder.resolve()
    with ExitStack() as stack:
        stack.enter_context(emulator())
        install(root)
        (root / "opt/modt").mkdir(exist_ok=True)
        cores = root / "opt/cpuinfo"
        cores.write_text("".join(CORE.format(number=number) for number in range(os.cpu_count() or 1)))
        stack.enter_context(mounted(ROOT, root / "opt/modt", "--bind", "-o", "ro"))
        native = compile_kernels(root / "opt/native")
        stack.enter_context(mounted(native, root / "opt/modt" / build.FOLDER.relative_to(ROOT), "--bind", "-o", "ro"))
        stack.enter_context(mounted("/dev", root / "dev", "--rbind"))
        stack.enter_context(mounted("proc", root / "proc", "-t", "proc"))
        stack.enter_context(mounted("sysfs", root / "sys", "-t", "sysfs", "-o", "ro"))
        stack.enter_context(mounted(cores, root / "proc/cpuinfo", "--bind"))
        environment = {"QEMU_CPU": CPU, "HOME": "/root", "PATH": "/usr/sbin:/usr/bin", "PYTHONDONTWRITEBYTECODE": "1"}
        environment["PYTHONPATH"] = "/opt/modt/runtime"
        chosen = ["-m", "not slow and not install and not kitti", "--durations", "10", "--deselect", NOT_EMULATED]
        tests = [*chosen, "-p", "no:cacheprovider", *given.tests]
        inside = f"cd /opt/modt && exec python3 -m pytest {' '.join(map(repr, tests))}"
        return subprocess.run(["chroot", str(root), "sh", "-c", inside], check=False, env=environment).returncode


if __name__ == "__main__":
    raise SystemExit(main())
