"""A sweep with its time and its pose."""

from __future__ import annotations

from dataclasses import dataclass

from modt.types.arrays import Float32, Float64

DESKEWED = "by the times of the turn"
COMPENSATED = "without times of points"
NO_TURN = "their points' times are of no turning head"
"""Kinds of the times of sweeps: those of a turn, by which they are deskewed, none, as if seen at the stamp, and those
in whose middle the stamp is."""


@dataclass(frozen=True)
class Frame:
    """One full sweep.

    Attributes:
        index: number of the frame in its stream (gaps where the stream has gaps).
        stamp_s: time of the sweep [s], never decreasing within a stream.
        points: (N, 4) float32 x, y, z [m, sensor frame: x forward, y left, z up], reflectance [0, 1] or
            UNRECORDED. Finite throughout; a point without a return lies at the origin.
        T_world_sensor: (4, 4) pose of the sensor in the world, or None where no ego-motion is known.
        restarts: number of times that the odometry has begun anew in a world unrelated to the one before.
        turn_s: duration of one turn of the head [s], which faces mid_rad at the stamp and begins and ends opposite to
            it. Clockwise seen from above is positive. With 0 all points are as if seen at the stamp, because they are
            compensated or the sensor does not turn.
        steady_s: time by a clock that is never set [s], if the clock of the stamps may be set; else None.
        R_level_sensor: (3, 3) rotation by which points and pose of a tilted sensor have been turned level.
        frame_id: name of the frame of the points in the messages they came in; "" where those name none.
        mid_rad: bearing that the head faces in the middle of the sweep [rad]; 0 is straight ahead.
        sweeps: sweeps of a robot with several sensors, in their order, each in the frame of its sensor; None for one
            without a sweep at this time. Points and pose are then those of the robot. Empty for one sensor.
        delay_s: (N,) float32 time after the stamp at which each point was seen [s], of a sensor whose head does not
            turn; None where that is not known, and once the points are where they are seen at the stamp.
    """

    index: int
    stamp_s: float
    points: Float32
    T_world_sensor: Float64 | None = None
    restarts: int = 0
    turn_s: float = 0.0
    steady_s: float | None = None
    R_level_sensor: Float64 | None = None
    frame_id: str = ""
    mid_rad: float = 0.0
    sweeps: tuple[Frame | None, ...] = ()
    delay_s: Float32 | None = None

    def __repr__(self) -> str:
        pose = "no" if self.T_world_sensor is None else "its"
        return f"<frame {self.index} at {self.stamp_s:.3f} s: {len(self.points)} points, {pose} pose>"

    @property
    def time_s(self) -> float:
        """Time by which durations are measured [s]."""
        return self.stamp_s if self.steady_s is None else self.steady_s
