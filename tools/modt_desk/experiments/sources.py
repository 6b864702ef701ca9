"""Commit, models, machine and energy calibrations that results come from."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path

from modt import host, profile
from modt.classification.pointnet import PointNet
from modt.config import EnergyConfig

_PROCESSOR = re.compile(r"AMD EPYC|AMD Ryzen|Intel\(R\) Xeon|Intel\(R\) Core|Cortex-A\d+")
"""Make and line of a processor; results name no more of it."""


def sources(profiles: Sequence[Sequence[str]], boards: Iterable[EnergyConfig]) -> str:
    """A sentence, for these profiles and calibrations."""
    configs = [profile.load(list(names)) for names in profiles]
    facts = [PointNet(config.classification, config.sensor).facts() for config in configs]
    models = ", ".join(dict.fromkeys(f"{found['file']} ({found['sha256'][:12]})" for found in facts))
    described = host.description()
    processor = _PROCESSOR.search(str(described["cpu"]))
    machine = processor[0].replace("(R)", "") if processor else described["machine"]
    energy = "; ".join(f"{board.board}, {board.meter}" for board in boards)
    return f"Commit {_commit()}, model {models}, {machine}" + (f"; energy of {energy}" if energy else "")


def _commit() -> str:
    """Commit of the checkout, else the version."""
    git = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        return subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return f"version {host.versions()['modt']}"
