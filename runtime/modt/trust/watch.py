"""The watch over the trust: a sample of every frame, and a look at all checks twice a second."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from modt.config import SensorConfig
from modt.trust.ground import GroundCheck
from modt.trust.returns import ReturnsCheck
from modt.trust.sample import Sample, sample
from modt.trust.scene import SAME, Change, agreement, explain
from modt.trust.tuning import TrustTuning
from modt.types import Float64, Frame, Reason, Trust, TrustLevel

CLEAN = "clean and uncover the sensor, and check what stands before it"
MOUNT = "check the mount of the sensor, then start anew"
DRIVER = "restart the sensor and its driver"


@dataclass(frozen=True, slots=True)
class Finding:
    """What a check has against the sweeps at a look."""

    level: TrustLevel
    cause: str
    remedy: str


class Debounced:
    """Reasons that begin after some looks in a row with a finding, and end after some without one."""

    def __init__(self, looks: int) -> None:
        self._looks = looks
        self._found: dict[str, int] = {}  # looks in a row with a finding, or minus those without one
        self.reasons: dict[str, Reason] = {}

    def update(self, findings: dict[str, Finding], now_s: float, at_once: frozenset[str]) -> None:
        """Take the findings of a look; those of the checks in `at_once` count from the first look on."""
        for key in {*findings, *self.reasons, *self._found}:
            finding = findings.get(key)
            before = self._found.get(key, 0)
            in_a_row = max(before, 0) + 1 if finding else min(before, 0) - 1
            self._found[key] = in_a_row
            if finding and (in_a_row >= self._looks or key in at_once or key in self.reasons):
                known = self.reasons.get(key)
                since_s = known.since_s if known else now_s
                self.reasons[key] = Reason(key, finding.level, finding.cause, finding.remedy, since_s)
            elif in_a_row <= -self._looks:
                self.reasons.pop(key, None)
                del self._found[key]


class TrustWatch:
    """Judges whether the sweeps of a sensor are possible, by those before.

    Args:
        sensor: its range and mount.
        tuning: what is expected.
    """

    def __init__(self, sensor: SensorConfig, tuning: TrustTuning = TrustTuning()) -> None:
        self._sensor = sensor
        self._tuning = tuning
        self._returns = ReturnsCheck(tuning.returns)
        self._ground = GroundCheck(tuning.ground, sensor.height_m)
        self._samples: list[Sample] = []  # those since the last look, its own included
        self._debounced = Debounced(tuning.looks)
        self._looked_s = -np.inf
        self._began_s: float | None = None
        self._change = Change(False, 0, 0)  # of the scene, since it was last believed
        self._before: Sample | None = None  # the last frame before that change
        self._agreed = 1.0  # share of the obstacle points that stood still at the last look
        self._scene_looks = 0  # in a row in which the scene is as it was in that frame
        self._moved = ""  # how the ground moved at once, while it is not back
        self._step = np.zeros(3)  # plane by which it moved
        self._ground_looks = 0  # in a row in which it is back
        self._another_s = -np.inf  # when another scene was seen
        self._comparable = True  # the last look showed a whole sweep
        self.trust = Trust()

    def add(
        self, frame: Frame, T_world_sensor: Float64, others: Mapping[str, Finding] = MappingProxyType({})
    ) -> Trust:
        """The trust after another frame.

        Args:
            frame: the level frame.
            T_world_sensor: (4, 4) its pose.
            others: findings of other checks by their names.
        """
        seen = sample(frame, T_world_sensor, self._sensor)
        now_s = seen.time_s
        if self._began_s is None or now_s < self._samples[-1].time_s or now_s - self._samples[-1].time_s > GAP_S:
            self._began_s = now_s if self._began_s is None else self._began_s
            self._samples = [seen]
            self._looked_s = now_s
            return self.trust
        self._samples = [*self._samples[-MOST_SAMPLES:], seen]
        elapsed_s = now_s - self._looked_s
        if elapsed_s < self._tuning.look_s - 1e-3:
            return self.trust
        learning = now_s - self._began_s < self._tuning.learn_s
        findings = dict(others)
        found_here = {} if learning else dict(self._findings(seen))
        findings |= found_here
        self._debounced.update(findings, now_s, AT_ONCE)
        if not found_here and not OWN & self._debounced.reasons.keys():
            self._returns.learn(seen, elapsed_s)
            self._ground.learn(seen, elapsed_s)
        self._samples = [seen]
        self._looked_s = now_s
        self.trust = self._judged(now_s)
        return self.trust

    def _judged(self, now_s: float) -> Trust:
        reasons = tuple(sorted(self._debounced.reasons.values(), key=lambda reason: (-reason.level, reason.since_s)))
        level = reasons[0].level if reasons else TrustLevel.GOOD
        since_s = self.trust.since_s if level == self.trust.level else now_s
        return Trust(level, since_s, reasons)

    def _findings(self, seen: Sample) -> Iterator[tuple[str, Finding]]:
        """Findings of a look by the name of the check."""
        repeated = _repeated(self._samples[-2], seen)
        if repeated:
            yield "frozen", Finding(TrustLevel.BLIND, "the same sweep comes again and again", DRIVER)
        loss = self._returns.loss(self._samples)
        if loss is not None:
            level = TrustLevel.BLIND if loss.blind else TrustLevel.DEGRADED
            yield "returns", Finding(level, loss.what, CLEAN)
        comparable = not repeated and (loss is None or not loss.sectors)
        if comparable and self._comparable:
            was_moved = self._moved
            self._follow_ground(seen)
            if not was_moved and not self._moved:
                self._follow_scene(seen)
        self._comparable = comparable
        if self._moved:
            yield "ground", Finding(TrustLevel.BLIND, self._moved, MOUNT)
        if not self._change.is_none:
            yield "scene", Finding(TrustLevel.BLIND, f"the scene is {self._change} against the one before", MOUNT)
        elif seen.time_s - self._another_s < self._tuning.another_s:
            yield "scene", Finding(TrustLevel.DEGRADED, "another scene than a moment before", MOUNT)

    def _follow_ground(self, seen: Sample) -> None:
        """Notice a ground that moves at once, and one that is back."""
        ground = self._ground
        if not self._moved:
            moved = ground.change(seen)
            step = ground.step(self._pairs()) if moved else None
            if step is not None:
                self._moved = moved
                self._step = step
            return
        step = ground.step(self._pairs())
        if step is not None:
            self._step = self._step + step
        moved = ground.change(seen, BACK_SHARE)
        is_back = not moved and not ground.lost
        self._ground_looks = self._ground_looks + 1 if is_back else 0
        self._moved = moved or self._moved
        if self._ground_looks >= self._tuning.back_looks or not ground.is_step(self._step):
            self._moved = ""

    def _follow_scene(self, seen: Sample) -> None:
        """Notice a scene that changes at once, between two frames, and one that is back."""
        scene = self._tuning.scene
        agreed = self._agreement(self._samples[0], seen)
        fell = agreed < min(scene.suspected, self._agreed - scene.fall)
        self._agreed = agreed
        if fell or agreed < scene.same or not self._change.is_none:
            agreements = [(self._agreement(*pair), pair) for pair in self._pairs()]
            least, pair = min(agreements, key=lambda each: each[0], default=(1.0, None))
            if pair is not None and least < scene.suspected:
                self._explain(*pair, least)
        if self._change.is_none or self._before is None:
            return
        is_back = agreement(self._before, seen, self._ground.plane, SAME.motion(self._before, seen)) >= scene.back
        self._scene_looks = self._scene_looks + 1 if is_back else 0
        if self._scene_looks >= self._tuning.back_looks:
            self._change = SAME

    def _pairs(self) -> list[tuple[Sample, Sample]]:
        """Frames in a row since the last look, unless too much time lies between them."""
        pairs = pairwise(self._samples)
        return [(before, after) for before, after in pairs if after.time_s - before.time_s <= AT_ONCE_S]

    def _agreement(self, before: Sample, after: Sample) -> float:
        """Agreement of two sweeps in the scene as it is changed."""
        return agreement(before, after, self._ground.plane, self._change.motion(before, after))

    def _explain(self, before: Sample, after: Sample, least: float) -> None:
        """Write how the scene changed from one frame to the next."""
        scene = self._tuning.scene
        change, share = explain(before, after, self._ground.plane, self._change.motion(before, after))
        if change.is_none and least >= scene.same:
            return
        another = least < scene.same
        if share < (scene.explained if another else scene.surely_explained) or share < least + scene.better:
            if not another:
                return
            self._another_s = after.time_s
            self._change = SAME
            step = self._ground.step(self._pairs()) if self._ground.lost else None
            if step is not None:
                self._moved = "the ground is out of view at once"
                self._step = step
            return
        if self._change.is_none:
            self._before = before
        self._change = self._change.then(change)


BACK_SHARE = 0.7
"""Share of the limits of the ground within which it is back."""
GAP_S = 1.0
"""Longest time between two frames after which a look is made [s]."""
AT_ONCE_S = 0.25
"""Longest time between two frames of which a step tells that it came at once [s]."""
MOST_SAMPLES = 24
"""Greatest number of frames between two looks that are kept."""
OWN = frozenset({"frozen", "returns", "scene", "ground"})
"""Checks of the sweeps themselves. Nothing is learned while one of them has a reason."""
AT_ONCE = frozenset({"scene", "ground"})
"""Checks whose finding is a step between two frames, which is not waited for twice."""
REPEATED_SHARE = 0.5
"""Share of the points at the same place to the last bit from which a sweep is one before."""


def _repeated(before: Sample, now: Sample) -> bool:
    """Whether a sweep is the one before, to the last bit."""
    if before.xyz.shape != now.xyz.shape or not len(now.counted):
        return False
    same = (before.xyz == now.xyz).all(axis=0).take(now.counted)
    return float(same.mean()) >= REPEATED_SHARE
