"""The power management chip of the Raspberry Pi 5, through the firmware's command."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass

from modt.energy.meters.candidate import Candidate, probe
from modt.energy.meters.meter import Facts, Kind, Measurand, MeterLostError, Scope

_RAIL_VALUE = re.compile(r"(\S+)_([AV])\s+(?:current|volt)\(\d+\)=([0-9.]+)[AV]")


@dataclass(frozen=True, slots=True)
class Pmic:
    """Power summed over the rails with both voltage and current.

    Loads on the 5 V rail itself (USB, HATs, the fan) and the loss of the chip are not included.
    """

    command: str

    @property
    def facts(self) -> Facts:
        """Resolution from the width of the converter; a reading takes a few milliseconds of another process."""
        return Facts(
            name="Raspberry Pi 5 PMIC",
            measurand=Measurand.POWER,
            unit="V x A",
            resolution=0.02,
            max_W=50.0,
            scope=Scope.BOARD,
            kind=Kind.INTEGRATED,
            privilege="group video",
        )

    def read(self) -> float:
        """Present power [W]."""
        try:
            done = subprocess.run(
                [self.command, "pmic_read_adc"], capture_output=True, text=True, timeout=2.0, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise MeterLostError(f"{self.command}: {error}") from None
        if done.returncode:
            output = (done.stderr or done.stdout).strip().splitlines()
            raise MeterLostError(f"{self.command}: {output[0] if output else f'exit status {done.returncode}'}")
        return rail_power_W(done.stdout)


def rail_power_W(text: str) -> float:
    """Sum of voltage times current over the rails of `vcgencmd pmic_read_adc`.

    Raises:
        MeterLostError: no rail has both.
    """
    amperes: dict[str, float] = {}
    volts: dict[str, float] = {}
    for rail, quantity, value in _RAIL_VALUE.findall(text):
        (amperes if quantity == "A" else volts)[rail] = float(value)
    rails = amperes.keys() & volts.keys()
    if not rails:
        raise MeterLostError("pmic_read_adc shows no rail with voltage and current (only a Raspberry Pi 5 does)")
    return sum(amperes[rail] * volts[rail] for rail in sorted(rails))


def find_pmic(command: str = "vcgencmd") -> list[Candidate]:
    """The chip, where the firmware's command is installed."""
    path = shutil.which(command)
    name = "Raspberry Pi 5 PMIC"
    if path is None:
        return [Candidate(name, (), f"no {command} here", "on a Raspberry Pi 5, install raspi-utils")]
    return [probe(name, (Pmic(path),), "on a Raspberry Pi 5, add the user to group video")]
