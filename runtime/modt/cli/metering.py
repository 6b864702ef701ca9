"""Puts the energy meters of this machine together."""

from __future__ import annotations

import time

from modt.config import EnergyConfig
from modt.energy.conditions import Conditions
from modt.energy.meters.discovery import Discovery, discover
from modt.energy.meters.meter import Kind
from modt.energy.meters.model import ModelMeter
from modt.energy.windows import Clocks, Windows


def meters(config: EnergyConfig) -> Discovery:
    """Every meter there is; the board's model stands in where there is none."""
    return discover(ModelMeter(config.idle_W, config.busy_W, time.monotonic_ns, time.process_time_ns))


def windows(config: EnergyConfig, core: int | None, meter: str | None = None, least_s: float = 1.0) -> Windows:
    """Windows over the best meter, or the one named.

    Raises:
        MisuseError: the one named is not usable.
    """
    return Windows(meters(config).choose(meter).meters, Clocks(), Conditions(core or 0), least_s)


def is_estimated(config: EnergyConfig, meter: str | None = None) -> bool:
    """Whether nothing better than the model is to be had, or was asked for."""
    facts = meters(config).choose(meter).facts
    return facts is None or facts.kind is Kind.ESTIMATED
