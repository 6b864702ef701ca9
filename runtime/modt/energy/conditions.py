"""What the energy of a computation depends on beside the computation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from modt.energy.meters.meter import MeterLostError, known, read_number


@dataclass(frozen=True, slots=True)
class Conditions:
    """Clock policy, clock and temperature of a core.

    Attributes:
        core: number of the core.
        sys: where sysfs is mounted.
    """

    core: int = 0
    sys: Path = Path("/sys")

    def read(self) -> dict[str, str | float | None]:
        """Governor, frequency [MHz] and temperature [degrees Celsius]; None where the machine does not say."""
        cpufreq = self.sys / "devices" / "system" / "cpu" / f"cpu{self.core}" / "cpufreq"
        return {
            "governor": known(cpufreq / "scaling_governor"),
            "frequency_MHz": _scaled(cpufreq / "scaling_cur_freq"),
            "temperature_C": _scaled(self.sys / "class" / "thermal" / "thermal_zone0" / "temp"),
        }


def _scaled(path: Path) -> float | None:
    try:
        return 1e-3 * read_number(path)
    except MeterLostError:
        return None
