"""Wheels with compiled kernels for every machine that modt supports, made on any of them.

    python -m tools.wheels [--out DIR]

Needs the extra "wheels": `ziglang` is the cross compiler. The libraries link nothing: a wheel serves glibc and musl.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from modt.native.build import TARGETS
from tools import options

ROOT = Path(__file__).resolve().parents[1]


def main() -> int:
    parser = options.parser(__doc__)
    parser.add_argument("--out", type=Path, default=Path("dist"))
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(parser.parse_args().out)]
    for target in TARGETS:
        done = subprocess.run([*command, str(ROOT)], check=False, env=os.environ | {"MODT_TARGET": target})
        if done.returncode:
            return done.returncode
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
