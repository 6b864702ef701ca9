"""The trust in several sensors: the checks of each by its own sweeps, and one verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from modt.config import MountedSensor, SensorConfig
from modt.trust.tuning import TrustTuning
from modt.trust.watch import Debounced, Finding, TrustWatch
from modt.types import Float64, Frame, Reason, Trust, TrustLevel

SILENT_S = 0.5
"""Time without a sweep of a sensor, while others have some, after which it is reported as silent [s]."""
UNSEEN = "returns"
"""Check of a sensor that sees less than it should. Another sensor may see what it does not."""
REMEDY = "check its power, cable, address and port; the other sensors go on"


class JointWatch:
    """Judges the sweeps of several sensors; the interface is that of TrustWatch.

    What a sensor does not see degrades the trust as long as another one sees. What a sensor reports wrongly, since it
    was knocked or repeats a sweep, counts as it does for one sensor.

    Args:
        sensors: the sensors, with the configuration of each, in the order of the sweeps of a frame.
        tuning: what is expected.
    """

    def __init__(
        self, sensors: Sequence[tuple[MountedSensor, SensorConfig]], tuning: TrustTuning = TrustTuning()
    ) -> None:
        self._names = [mounted.name for mounted, _ in sensors]
        self._T_robot_level = [mounted.T_robot_level for mounted, _ in sensors]
        self._watches = [TrustWatch(config, tuning) for _, config in sensors]
        self._seen_s: list[float | None] = [None] * len(sensors)  # time of the last sweep of each
        self._tuning = tuning
        self._others = Debounced(tuning.looks, tuning.back_looks)  # findings that are of no sensor
        self._looked_s = float("-inf")
        self.dead_deg: tuple[float, ...] = ()  # of no sensor alone
        self.compare_profiles = False  # the profiles of several sensors are given, not found
        self.trust = Trust()

    @property
    def displaced(self) -> bool:
        """Whether ground or scene of a sensor have moved."""
        return any(watch.displaced for watch in self._watches)

    def add(
        self, frame: Frame, T_world_robot: Float64, others: Mapping[str, Finding] = MappingProxyType({})
    ) -> Trust:
        """The trust after another frame; arguments as in TrustWatch.add, with the pose of the robot."""
        now_s = frame.time_s
        for k, sweep in enumerate(frame.sweeps):
            if sweep is not None:
                self._watches[k].add(sweep, T_world_robot @ self._T_robot_level[k])
                self._seen_s[k] = now_s
            elif self._seen_s[k] is None:
                self._seen_s[k] = now_s  # it is waited for from the first frame on
        if not 0 <= now_s - self._looked_s < self._tuning.look_s:
            self._looked_s = now_s
            self._others.update(dict(others), now_s, frozenset())
        self.trust = self.trust.after([*self._others.reasons.values(), *self._of_sensors(now_s)], now_s)
        return self.trust

    def _of_sensors(self, now_s: float) -> Iterator[Reason]:
        """Reasons of the sensors, whose checks are named SENSOR/CHECK."""
        silent = [seen_s is not None and now_s - seen_s > SILENT_S for seen_s in self._seen_s]
        blind = [
            gone or watch.trust.level is TrustLevel.BLIND for gone, watch in zip(silent, self._watches, strict=True)
        ]
        for name, watch, gone, seen_s in zip(self._names, self._watches, silent, self._seen_s, strict=True):
            if gone and seen_s is not None:
                cause = f"sensor {name} is silent since {seen_s:.1f} s"
                yield Reason(f"{name}/silent", TrustLevel.DEGRADED, cause, REMEDY, seen_s)
                continue
            for reason in watch.trust.reasons:
                level = reason.level
                if reason.key == UNSEEN and not all(blind):
                    level = min(level, TrustLevel.DEGRADED)
                cause = f"sensor {name}: {reason.cause}"
                yield replace(reason, key=f"{name}/{reason.key}", level=level, cause=cause)
