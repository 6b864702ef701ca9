"""Assembly of the energy meters of this machine."""

from __future__ import annotations

import time
from collections.abc import Sequence

from modt.config import EnergyConfig
from modt.energy.meters.discovery import Discovery, discover
from modt.energy.meters.meter import Conditions, Meter, model_meter
from modt.energy.windows import MIN_S, Clocks, Windows


def discovery(config: EnergyConfig) -> Discovery:
    """All meters, the model of the board among them."""
    return discover(model_meter(config.idle_W, config.busy_W, time.monotonic_ns, time.process_time_ns))


def windows(meters: Sequence[Meter], core: int | None, min_s: float = MIN_S) -> Windows:
    """Windows over the meters, by the clocks of this machine."""
    return Windows(meters, Clocks(), Conditions(core or 0), min_s)
