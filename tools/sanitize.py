"""Run the tests of the compiled kernels under AddressSanitizer and UndefinedBehaviorSanitizer.

    python -m tools.sanitize [-- PYTEST-OPTION ...]

Needs gcc. The kernels are built with their assertions, and any finding ends the tests.
"""

from __future__ import annotations

import os
import subprocess
import sys

from tools import options

TESTS = "tests/segmentation/test_native_kernels.py"


def main() -> int:
    parser = options.parser(__doc__)
    parser.add_argument("options", nargs="*", metavar="PYTEST-OPTION")
    chosen = parser.parse_args().options
    command = ["gcc", "-print-file-name=libasan.so"]
    runtime = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    environment = os.environ | {
        "MODT_SANITIZED": "1",
        "CC": "gcc",
        "LD_PRELOAD": runtime,
        "ASAN_OPTIONS": "detect_leaks=0",  # Python's own
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }
    tests = [sys.executable, "-m", "pytest", TESTS, *chosen]
    return subprocess.run(tests, check=False, env=environment).returncode


if __name__ == "__main__":
    raise SystemExit(main())
