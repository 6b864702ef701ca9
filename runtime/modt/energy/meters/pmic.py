"""The power management chip of the Raspberry Pi 5, through the firmware's command."""

from __future__ import annotations

import re
import shutil
import subprocess

from modt.energy.meters.meter import Candidate, Facts, Kind, Meter, MeterLostError, Scope, probe

_RAIL_VALUE = re.compile(r"(\S+)_([AV])\s+(?:current|volt)\(\d+\)=([0-9.]+)[AV]")


_FACTS = Facts(
    name="Raspberry Pi 5 PMIC",
    unit="V x A",
    resolution=0.02,  # from the width of the converter
    max_W=50.0,
    scope=Scope.BOARD,
    kind=Kind.INTEGRATED,
    privilege="group video",
)


def find_pmic(command: str = "vcgencmd") -> list[Candidate]:
    """The chip, where the firmware's command is installed.

    Loads on the 5 V rail itself (USB, HATs, the fan) and the loss of the chip are not included. A reading takes a few
    milliseconds of another process.
    """
    path = shutil.which(command)
    if path is None:
        return [Candidate(_FACTS.name, (), f"no {command} here", "on a Raspberry Pi 5, install raspi-utils")]
    meter = Meter(_FACTS, lambda: rail_power_W(_rails(path)))
    return [probe(_FACTS.name, (meter,), "on a Raspberry Pi 5, add the user to group video")]


def _rails(command: str) -> str:
    """Currents and voltages of the rails, as the command prints them."""
    try:
        done = subprocess.run([command, "pmic_read_adc"], capture_output=True, text=True, timeout=2.0, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise MeterLostError(f"{command}: {error}") from None
    if done.returncode:
        output = (done.stderr or done.stdout).strip().splitlines()
        raise MeterLostError(f"{command}: {output[0] if output else f'exit status {done.returncode}'}")
    return done.stdout


def rail_power_W(text: str) -> float:
    """Sum of voltage times current over the rails of `vcgencmd pmic_read_adc`."""
    amperes: dict[str, float] = {}
    volts: dict[str, float] = {}
    for rail, quantity, value in _RAIL_VALUE.findall(text):
        (amperes if quantity == "A" else volts)[rail] = float(value)
    rails = amperes.keys() & volts.keys()
    if not rails:
        raise MeterLostError("pmic_read_adc shows no rail with voltage and current (only a Raspberry Pi 5 does)")
    return sum(amperes[rail] * volts[rail] for rail in sorted(rails))
