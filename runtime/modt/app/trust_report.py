"""The trust of a run: its log lines, and its part of status and summary."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from modt.config import SensorConfig
from modt.sources.stream import OTHER_SENSOR
from modt.trust.visibility import VisibilityEstimate
from modt.trust.watch import Finding, TrustWatch
from modt.types import FrameResult, Trust, TrustLevel

if TYPE_CHECKING:
    from modt.app.joint_trust import JointWatch

log = logging.getLogger(__name__)

SILENT = "no sweeps come from the sensor"


class TrustReport:
    """Judges each result, logs each change once, and counts the frames of each level.

    Args:
        sensor: the sensor of the profile.
        watch: the checks; by default those of this sensor.

    Attributes:
        watch: the checks of this sensor.
        visibility: the estimate of the visibility, by this sensor.
        trust: that of the last frame.
        frames: number of frames by level.
    """

    def __init__(self, sensor: SensorConfig, watch: TrustWatch | JointWatch | None = None) -> None:
        self.watch = watch or TrustWatch(sensor)
        self.trust = Trust()
        self.visibility = VisibilityEstimate(sensor)
        self.frames: Counter[str] = Counter({level.name.lower(): 0 for level in TrustLevel})

    def judge(self, result: FrameResult, others: dict[str, Finding]) -> Trust:
        """The trust of a result; `others` are findings of other checks by their names."""
        self.visibility.add(result.proposals.kind, result.frame.time_s)
        findings = others | self.visibility.findings()
        trust = self.watch.add(result.frame, result.T_world_sensor, findings)
        trust = replace(trust, visibility_m=self.visibility.visibility_m)
        self.frames[trust.word] += 1
        if (trust.level, trust.keys) != (self.trust.level, self.trust.keys):
            _log_change(self.trust, trust)
        self.trust = trust
        return trust

    def record(self, *, silent: bool = False) -> dict[str, Any]:
        """The trust and the frames of each level. A sensor that is silent makes it blind."""
        record = self.trust.record()
        if silent:
            record["level"] = TrustLevel.BLIND.name.lower()
            reason = {"check": "silent", "level": record["level"], "since_s": None, "cause": SILENT}
            record["reasons"] = [reason, *record["reasons"]]
        return record | {"frames": dict(self.frames)}


PERIOD_RATIO = 1.4
"""Ratio of the measured and the nominal period of the sweeps, either by the other, from which it is reported."""


def source_findings(health: Mapping[str, Any], before: Mapping[str, Any], nominal_s: float) -> dict[str, Finding]:
    """Findings about a live source, by its health and the one before."""
    findings = {}
    period_s = health["period_s"]
    if max(period_s / nominal_s, nominal_s / max(period_s, 1e-6)) > PERIOD_RATIO:
        cause = f"a sweep comes every {period_s:.3f} s, not every {nominal_s:.3f} s"
        remedy = "set the sensor to that rate, and have one sensor send to a port"
        findings["period"] = Finding(TrustLevel.DEGRADED, cause, remedy)
    refused = health["refused_messages"].get(OTHER_SENSOR, 0)
    if refused > before.get("refused_messages", {}).get(OTHER_SENSOR, 0):
        findings["port"] = Finding(TrustLevel.DEGRADED, f"messages {OTHER_SENSOR}", "give each sensor a port")
    return findings


def _log_change(before: Trust, after: Trust) -> None:
    """One line for each reason that has come, or one for all that have gone."""
    came = [reason for reason in after.reasons if reason.key not in before.keys]
    for reason in came:
        log.warning("trust is %s: %s; %s", after.word, reason.cause, reason.remedy)
    if not came:
        log.warning("trust is %s: it was %s because of %s", after.word, before.word, ", ".join(before.keys))
