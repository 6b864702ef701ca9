"""Faults of a sensor: dead and dirty parts, lost returns, noise and a weak receiver."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from modt.errors import MisuseError
from modt.types import Bool
from modt_simulation.options import Condition
from modt_simulation.sensors import SensorModel


def _beam(sensor: SensorModel, number: float) -> SensorModel:
    """The laser of a beam gives no returns; beams are counted from 0, the highest."""
    if number != int(number) or number >= sensor.shape[0]:
        raise MisuseError(f"beam:{number:g}", "no such beam", f"give 0 to {sensor.shape[0] - 1}")
    blind = np.zeros(sensor.shape, np.bool_)
    blind[int(number)] = True
    return _blinded(sensor, blind)


def _sector(sensor: SensorModel, bearing_deg: float, width_deg: float) -> SensorModel:
    """A lens that is covered from a bearing on, counter-clockwise from straight ahead, gives no returns there."""
    inside_rad = (sensor.azimuth_rad - np.deg2rad(bearing_deg)) % (2 * np.pi)
    blind = np.broadcast_to(inside_rad < np.deg2rad(width_deg), sensor.shape)
    return _blinded(sensor, blind)


def _blinded(sensor: SensorModel, blind: Bool) -> SensorModel:
    return replace(sensor, blind=blind if sensor.blind is None else sensor.blind | blind)


def _dropout(sensor: SensorModel, share: float) -> SensorModel:
    """A share of the returns is lost at random, besides those that the sensor loses anyway."""
    return replace(sensor, dropout=1 - (1 - sensor.dropout) * (1 - min(share, 1.0)))


def _noise(sensor: SensorModel, sigma_m: float) -> SensorModel:
    """Ranges have noise of a standard deviation, besides the sensor's own."""
    return replace(sensor, range_sigma_m=float(np.hypot(sensor.range_sigma_m, sigma_m)))


def _range(sensor: SensorModel, share: float) -> SensorModel:
    """A weak laser or a dirty lens: every surface is detected within a share of the distance only."""
    return replace(sensor, detect_m=sensor.detect_m * min(share, 1.0))


FAULTS: dict[str, tuple[Callable[..., SensorModel], tuple[str, ...]]] = {
    "beam": (_beam, ("NUMBER",)),
    "sector": (_sector, ("BEARING_DEG", "WIDTH_DEG")),
    "dropout": (_dropout, ("SHARE",)),
    "noise": (_noise, ("METRES",)),
    "range": (_range, ("SHARE",)),
}
"""Change of the sensor by the name of a fault, and the names of its values."""


def read_faults(texts: Sequence[str]) -> list[Condition]:
    """Faults by their texts, such as `beam:7` or `sector:20:30@10`.

    Raises:
        MisuseError: a text is no fault.
    """
    kinds = {name: values for name, (_, values) in FAULTS.items()}
    return [Condition.of(text, kinds) for text in texts]


def faulty(sensor: SensorModel, faults: Sequence[Condition], time_s: float) -> SensorModel:
    """The sensor with the faults that have begun by a time.

    Raises:
        MisuseError: the sensor has no such beam.
    """
    for fault in faults:
        if time_s >= fault.from_s:
            change, _ = FAULTS[fault.name]
            sensor = change(sensor, *fault.values)
    return sensor
