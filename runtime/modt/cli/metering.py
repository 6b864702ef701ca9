"""Assembly of the energy meters of this machine."""

from __future__ import annotations

import time

from modt.config import EnergyConfig, WindowConfig
from modt.energy.conditions import Conditions
from modt.energy.meters.discovery import Discovery, discover
from modt.energy.meters.meter import Facts, Kind
from modt.energy.meters.model import model_meter
from modt.energy.windows import Clocks, Windows


def meters(config: EnergyConfig) -> Discovery:
    """All meters, the model of the board among them."""
    return discover(model_meter(config.idle_W, config.busy_W, time.monotonic_ns, time.process_time_ns))


def windows(
    config: EnergyConfig, core: int | None, meter: str | None = None, window: WindowConfig | None = None
) -> Windows:
    """Windows over the best meter, or the one named.

    Raises:
        MisuseError: the one named is not usable.
    """
    return Windows(meters(config).choose(meter).meters, Clocks(), Conditions(core or 0), window or config.windows)


def facts(config: EnergyConfig, meter: str | None = None) -> Facts:
    """Facts of the best meter, or of the one named."""
    return meters(config).choose(meter).meters[0].facts


def is_estimated(config: EnergyConfig, meter: str | None = None) -> bool:
    """Whether that meter is a model."""
    return facts(config, meter).kind is Kind.ESTIMATED
