"""Conditions under which energy was measured: clock policy, frequency, temperature."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modt.energy.meters.meter import number_or_none, text_or_none


@dataclass(frozen=True, slots=True)
class Conditions:
    """Clock policy, frequency and temperature of a core, by the sysfs mounted at a path."""

    core: int = 0
    sys: Path = Path("/sys")

    def read(self) -> dict[str, str | float | None]:
        """Governor, frequency [MHz] and temperature [degrees Celsius]; None where not available."""
        cpufreq = self.sys / "devices" / "system" / "cpu" / f"cpu{self.core}" / "cpufreq"
        frequency_kHz = number_or_none(cpufreq / "scaling_cur_freq")
        temperature_mC = number_or_none(self.sys / "class" / "thermal" / "thermal_zone0" / "temp")
        return {
            "governor": text_or_none(cpufreq / "scaling_governor"),
            "frequency_MHz": None if frequency_kHz is None else 1e-3 * frequency_kHz,
            "temperature_C": None if temperature_mC is None else 1e-3 * temperature_mC,
        }
