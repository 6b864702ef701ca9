"""What results come from: commit, models, machine."""

from __future__ import annotations

import platform
import re
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from modt import host, profile
from modt.classification.pointnet import PointNet
from modt.config import EnergyConfig


@dataclass(frozen=True, slots=True)
class About:
    """What results come from."""

    command: str
    commit: str
    models: dict[str, str]  # hash by file
    processor: str
    energy: tuple[str, ...]  # board and meter of each calibration, with its meter's kind

    @classmethod
    def of(cls, command: str, profiles: Sequence[Sequence[str]], boards: Iterable[EnergyConfig] = ()) -> About:
        """Of this program and machine, with each of the profiles."""
        configs = [profile.load(list(names)) for names in profiles]
        facts = [PointNet(config.classification, config.sensor).facts() for config in configs]
        models = {found["file"]: found["sha256"] for found in facts}
        energy = tuple(f"{board.board}, {board.meter}" for board in boards)
        return cls(command, _commit(), models, _processor(), energy)

    def sources(self) -> str:
        """In a line."""
        models = ", ".join(f"{file} ({sha256[:12]})" for file, sha256 in self.models.items())
        energy = f"; energy of {'; '.join(self.energy)}" if self.energy else ""
        return f"Commit {self.commit}, model {models}, {self.processor}{energy}"


def _commit() -> str:
    """Of the checkout, else the version."""
    git = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--exclude=*"]
    try:
        found = subprocess.run(git, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        found = ""
    return found or f"version {host.versions()['modt']}"


def _processor() -> str:
    """Its make and line, no more."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        text = ""
    named = re.search(r"model name\s*:\s*.*?(AMD EPYC|AMD Ryzen|Intel\(R\) Xeon|Intel\(R\) Core|Cortex-A\d+)", text)
    return named[1].replace("(R)", "") if named else platform.machine()
