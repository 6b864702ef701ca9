"""The gait of a robot with legs: roll, pitch and height that swing with its steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from modt.errors import MisuseError
from modt.geometry import rotation_zyx, se3
from modt.types import Float64, Self

FREQUENCY_HZ = 2.0
"""Frequency of the pitch of a trotting quadruped [Hz]."""
ROLL_SHARE = 0.9
"""Frequency of the roll as a share of that of the pitch; unequal, so that every combination of both occurs."""
YAW_SHARE = 0.13
"""Amplitude of the yaw as a share of that of roll and pitch."""
BOB_M_PER_RAD = 0.4
"""Amplitude of the height over that of roll and pitch [m/rad]; the height swings twice in a period of the pitch."""


@dataclass(frozen=True)
class Gait:
    """A steady gait.

    Attributes:
        amplitude_rad: amplitude of roll and of pitch.
        frequency_hz: frequency of the pitch.
        phase_rad: (2,) phases of pitch and roll at time 0.
    """

    amplitude_rad: float
    frequency_hz: float
    phase_rad: tuple[float, float]

    @classmethod
    def of(cls, text: str, rng: Generator) -> Self:
        """Read `DEGREES` or `DEGREES:HERTZ`; the generator draws the phases.

        Raises:
            MisuseError: the text is no gait.
        """
        amplitude, _, frequency = text.partition(":")
        try:
            amplitude_deg = float(amplitude)
            frequency_hz = float(frequency or FREQUENCY_HZ)
        except ValueError:
            amplitude_deg = frequency_hz = np.nan
        if not (0 <= amplitude_deg <= 30 and 0 < frequency_hz <= 10):
            raise MisuseError(text, "no gait", "give degrees up to 30, as 6, and hertz up to 10, as 6:2")
        pitch_rad, roll_rad = rng.uniform(0, 2 * np.pi, 2).tolist()
        return cls(float(np.deg2rad(amplitude_deg)), frequency_hz, (pitch_rad, roll_rad))

    def pose(self, time_s: float) -> Float64:
        """(4, 4) pose of the sensor, as it walks, in the frame of the sensor at rest."""
        turn_rad = 2 * np.pi * self.frequency_hz * time_s
        pitch_phase_rad, roll_phase_rad = self.phase_rad
        pitch = self.amplitude_rad * np.sin(turn_rad + pitch_phase_rad)
        roll = self.amplitude_rad * np.sin(ROLL_SHARE * turn_rad + roll_phase_rad)
        yaw = YAW_SHARE * self.amplitude_rad * np.sin(turn_rad)
        up_m = BOB_M_PER_RAD * self.amplitude_rad * np.sin(2 * turn_rad)
        return se3(rotation_zyx(float(roll), float(pitch), float(yaw)), np.array([0.0, 0.0, up_m]))
