"""The watch over the trust: a sample of every frame, and a look at all checks at intervals of `look_s`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from modt.config import SensorConfig
from modt.trust.ground import GroundCheck
from modt.trust.lasting import BeamHistory, SectorHistory
from modt.trust.mount import MountHistory
from modt.trust.returns import Loss, ReturnsCheck
from modt.trust.sample import Sample, Three, sample
from modt.trust.scene import SceneCheck
from modt.trust.thinning import ThinningHistory
from modt.trust.tuning import TrustTuning
from modt.types import Float64, Frame, Reason, Trust, TrustLevel

POSES = "poses"
"""Name of the check that doubts given poses."""
CLEAN = "clean and uncover the sensor, and check what stands before it"
MOUNT = "check the mount of the sensor, then start anew"
DRIVER = "restart the sensor and its driver"
REPAIR = "have the sensor repaired; things at that height are seen from nearer only"
UNCOVER = "uncover the sensor, or state the sector in sensor.blind_sectors_deg if the robot hides it"


@dataclass(frozen=True)
class Finding:
    """Objection of a check to the sweeps at a look."""

    level: TrustLevel
    cause: str
    remedy: str


class Debounced:
    """Reasons that begin after some looks in a row with a finding, and end after some without one.

    Args:
        looks: looks in a row with a finding that begin a reason.
        back_looks: looks in a row without a finding that end a reason. Reasons of the checks in `sudden` end after
            `looks` of them, since these checks wait themselves.
    """

    def __init__(self, looks: int, back_looks: int) -> None:
        self._looks = looks
        self._back_looks = back_looks
        self._found: dict[str, int] = {}  # looks in a row with a finding, or minus those without one
        self.reasons: dict[str, Reason] = {}

    def update(self, findings: dict[str, Finding], now_s: float, sudden: frozenset[str]) -> None:
        """Take the findings of a look; those of the checks in `sudden` count from the first look on."""
        for key in {*findings, *self.reasons, *self._found}:
            finding = findings.get(key)
            before = self._found.get(key, 0)
            in_a_row = max(before, 0) + 1 if finding else min(before, 0) - 1
            self._found[key] = in_a_row
            if finding and (in_a_row >= self._looks or key in sudden or key in self.reasons):
                known = self.reasons.get(key)
                since_s = known.since_s if known else now_s
                self.reasons[key] = Reason(key, finding.level, finding.cause, finding.remedy, since_s)
            elif in_a_row <= -(self._looks if key in sudden else self._back_looks):
                self.reasons.pop(key, None)
                del self._found[key]


class TrustWatch:
    """Judges whether the sweeps of a sensor are possible, by those before.

    Args:
        sensor: its range and mount.
        tuning: what is expected.

    Attributes:
        compare_profiles: whether the sweeps are to be compared with the profiles. They may be of another sensor where
            the reasons of their own checks change, or they have more returns. Who has compared resets it.
        trust: the last verdict.
    """

    def __init__(self, sensor: SensorConfig, tuning: TrustTuning = TrustTuning()) -> None:
        self._sensor = sensor
        self._tuning = tuning
        self._returns = ReturnsCheck(tuning.returns)
        self._ground = GroundCheck(tuning.ground, sensor.height_m)
        self._mount = MountHistory(tuning.mount)
        self._scene = SceneCheck(tuning.scene)
        self._beams = BeamHistory(sensor, tuning.lasting)
        self._sectors = SectorHistory(sensor, tuning.lasting)
        self._thinning = ThinningHistory(tuning.thinning)
        # The last MOST_SAMPLES + 1 at most since the last look, its own included. If nothing had changed then, the
        # one before it as well, since a fault may have begun at the end of its sweep.
        self._samples: list[Sample] = []
        self._debounced = Debounced(tuning.looks, tuning.back_looks)
        self._looked_s = -np.inf
        self._began_s: float | None = None
        self._begins_anew = False  # whether the next look begins with the sweep of the last one
        self._put_off = False  # the look that was due last
        self._ground_moved = False  # between the last two looks
        self._repeated = False  # the sweep of the last look was one before
        self._before_loss: Sample | None = None  # the last sweep before the view was lost
        self._own_reasons: frozenset[str] = frozenset()  # checks of the sweeps themselves that have a reason
        self.compare_profiles = False
        self.trust = Trust()

    @property
    def displaced(self) -> bool:
        """Whether ground or scene have moved, which a watch without their history would not know."""
        return bool(self._ground.phrase) or not self._scene.change.is_none

    @property
    def dead_deg(self) -> tuple[float, ...]:
        """Elevations of the dead beams, descending."""
        return self._beams.dead_deg

    def adopt(self, other: TrustWatch) -> None:
        """Keep the reasons of another sensor's watch until looks of this one have confirmed or withdrawn them."""
        self._debounced = other._debounced
        self.trust = other.trust

    def add(
        self, frame: Frame, T_world_sensor: Float64, others: Mapping[str, Finding] = MappingProxyType({})
    ) -> Trust:
        """The trust after another frame.

        Args:
            frame: the level frame.
            T_world_sensor: (4, 4) its pose.
            others: findings of other checks by their names.
        """
        before = self._samples[-1] if self._samples else None
        sweep = sample(frame, T_world_sensor, self._sensor, self._ground.present, before)
        if POSES in others:  # the pose is a registered one
            sweep = replace(sweep, pose_given=False)
        now_s = sweep.time_s
        if self._began_s is None:
            self._began_s = now_s
        if not self._samples or not 0 <= now_s - self._samples[-1].time_s <= GAP_S:
            self._samples = [sweep]
            self._looked_s = now_s
            return self.trust
        self._samples = [*self._samples[-MOST_SAMPLES:], sweep]
        elapsed_s = now_s - self._looked_s
        if elapsed_s >= self._tuning.look_s - 1e-3 and not self._changes_now():
            self._look(sweep, elapsed_s, others, learning=now_s - self._began_s < self._tuning.learn_s)
        return self.trust

    def _look(self, sweep: Sample, elapsed_s: float, others: Mapping[str, Finding], *, learning: bool) -> None:
        """Run all checks on a sweep, some time after the last look, and judge by their findings."""
        now_s = sweep.time_s
        self._begins_anew = False
        own_findings = self._check_sweep(sweep, learning=learning)
        self._beams.add(sweep)
        self._sectors.add(sweep)
        lasting = dict(self._lasting_findings())
        self._debounced.update({**others, **lasting, **own_findings}, now_s, SUDDEN_CHECKS)
        own_reasons = OWN_CHECKS & self._debounced.reasons.keys()
        self.compare_profiles |= own_reasons != self._own_reasons or self._returns.gained
        self._own_reasons = own_reasons
        if not own_findings and not own_reasons:
            self._returns.learn(sweep, elapsed_s)
            self._ground.learn(sweep)
            self._thinning.add(sweep)
            if self._ground.known:
                self._mount.add(self._ground.plane, sweep.R_level_sensor)
        self._samples = self._samples[-1:] if self._begins_anew else self._samples[-2:]
        self._looked_s = now_s
        self.trust = self.trust.after(self._debounced.reasons.values(), now_s)

    def _changes_now(self) -> bool:
        """Whether to look at the next sweep instead, since something may have begun within the present one."""
        first = self._samples[0]
        now = self._samples[-1]
        self._ground_moved = self._ground.has_moved(first, now)
        changed = self._ground_moved or self._scene.may_have_changed(first, now)
        soon = now.time_s - self._samples[-2].time_s <= MAX_SUDDEN_S
        self._put_off = changed and soon and not self._put_off
        return self._put_off

    def _check_sweep(self, sweep: Sample, *, learning: bool) -> dict[str, Finding]:
        """Findings of the checks of the sweeps themselves; while learning, of those alone that expect nothing."""
        repeated = _repeated(self._samples[-2], sweep)
        none_yet = self._returns.none_yet(sweep)
        if none_yet:  # what is expected is learned from the first sweep on that has returns
            self._began_s = sweep.time_s
        elif not learning:
            return self._run_own_checks(sweep, repeated=repeated)
        return dict(self._own_findings(none_yet, repeated=repeated))

    def _run_own_checks(self, sweep: Sample, *, repeated: bool) -> dict[str, Finding]:
        """Run the checks of the sweeps themselves, and return their findings by the name of the check.

        `repeated` says whether the sweep is the one before once more.
        """
        n_before = self._returns.n_dead
        loss = self._returns.loss(self._samples)
        n_dead = self._returns.n_dead
        self._begins_anew = repeated or self._repeated
        if not self._begins_anew:
            self._follow(same_beams=n_dead == n_before and n_dead <= MOST_DEAD)
        self._repeated = repeated
        lost = repeated or (loss is not None and loss.blind)
        if not lost and self._before_loss is not None and not self.displaced:
            self._look_past(self._before_loss, sweep)
        self._before_loss = (self._before_loss or self._samples[0]) if lost else None
        return dict(self._own_findings(loss, repeated=repeated))

    def _own_findings(self, loss: Loss | None, *, repeated: bool) -> Iterator[tuple[str, Finding]]:
        """Findings of the checks of the sweeps themselves, as they stand."""
        if repeated:
            yield "frozen", Finding(TrustLevel.BLIND, "the same sweep comes again and again", DRIVER)
        if loss is not None:
            level = TrustLevel.BLIND if loss.blind else TrustLevel.DEGRADED
            yield "returns", Finding(level, loss.what, CLEAN)
        if self._ground.phrase:
            yield "ground", Finding(TrustLevel.BLIND, self._ground.phrase, MOUNT)
        change = self._scene.change
        if not change.is_none:
            yield "scene", Finding(TrustLevel.BLIND, f"the scene is {change} against the one before", MOUNT)

    def _lasting_findings(self) -> Iterator[tuple[str, Finding]]:
        """Findings of the histories over seconds and minutes, as they stand."""
        if dead_deg := self._beams.dead_deg:
            which = ", ".join(f"{each_deg:.1f}" for each_deg in dead_deg)
            what = f"no returns from the beam{'s' * (len(dead_deg) > 1)} at {which} deg of elevation"
            yield "beams", Finding(TrustLevel.DEGRADED, what, REPAIR)
        if missing_share := self._thinning.missing_share:
            what = f"{100 * missing_share:.0f} % of the returns from below are missing, in all directions"
            yield "fading", Finding(TrustLevel.DEGRADED, what, CLEAN)
        if self._mount.is_tilted:
            what = f"the ground has tilted by {self._mount.tilt_deg:.0f} deg since the start"
            yield "mount", Finding(TrustLevel.BLIND, what, MOUNT)
        if self._sectors.blocked_deg:
            from_deg, to_deg = self._sectors.blocked_deg
            what = f"no returns from {from_deg} to {to_deg} deg, counter-clockwise from ahead"
            yield "sectors", Finding(TrustLevel.DEGRADED, what, UNCOVER)

    def _follow(self, *, same_beams: bool) -> None:
        """Compare the sweeps since the last look with one another. Obstacles are told by the ground below them.

        Other beams meet other obstacles, so the scene is not compared at a look at which beams have died or are back.
        The few rings of the last beams are no scene.
        """
        threes = list(_threes(self._samples))
        pairs = [(before, after) for before, _, after in threes]
        first = self._samples[0]
        ground = self._ground.present
        self._ground.look(self._samples[-1], threes if self._ground_moved else (), self._tuning.back_looks)
        moves = bool((self._ground.present != ground).any())
        if moves:  # the obstacles of this sweep, the first one of the next look, stand on it as it is after the step
            self._samples[-1] = replace(self._samples[-1], plane=self._ground.present)
            pairs = [(first, self._samples[-1])]
        now = self._samples[-1]
        if self._ground.undone:  # the returns were learned while the sensor was moved
            self._returns = ReturnsCheck(self._tuning.returns)
        unsure = moves or self._ground.undone or bool(self._ground.phrase)
        self._begins_anew = moves or self._ground.undone or not same_beams
        if not same_beams:
            return
        change = self._scene.change
        changed_after = self._scene.before
        self._scene.look(first, now, pairs, self._tuning.back_looks, unsure=unsure)
        self._begins_anew |= self._scene.change != change
        if changed_after is not None and self._scene.change.is_none:
            begin_s = changed_after.time_s
            self._ground.forget_step_within(begin_s, begin_s + self._tuning.look_s)

    def _look_past(self, before: Sample, now: Sample) -> None:
        """Compare the sweeps before and after a time in which nothing was seen."""
        same_place = bool(np.hypot(*(now.T_world_sensor - before.T_world_sensor)[:2, 3]) < SAME_PLACE_M)
        self._ground.look_past(before, now, same_place=same_place)
        if not self._ground.phrase and same_place:
            # Registration knows of no way from sweeps that show nothing new, so the place may be another one.
            unsure = not (before.pose_given and now.pose_given)
            self._scene.look(before, now, [(before, now)], self._tuning.back_looks, unsure=unsure)


GAP_S = 1.0
"""After a longer time between two frames the samples start anew, and no look is made [s]."""
MAX_SUDDEN_S = 0.25
"""Longest time between two frames of which a step tells that it came at once [s]."""
SAME_PLACE_M = 1.0
"""Greatest way between two sweeps that show the same scene [m]."""
MOST_DEAD = 8
"""Greatest number of dead bands of beams, of 12, with which scenes are compared."""
MOST_SAMPLES = 24
"""Greatest number of frames between two looks that are kept."""
OWN_CHECKS = frozenset({"frozen", "returns", "scene", "ground"})
"""Checks of the sweeps themselves. Nothing is learned while one of them has a reason."""
SUDDEN_CHECKS = frozenset({"scene", "ground"})
"""Checks whose finding is a step between two frames, which is not waited for twice."""
REPEATED_SHARE = 0.5
"""Share of the returns whose x is that of the sweep before, to the last bit, above which a sweep repeats it."""


def _threes(samples: Sequence[Sample]) -> Iterator[Three]:
    """Three sweeps in a row each, of which a step tells that it came at once."""
    for before, between, after in zip(samples, samples[1:], samples[2:], strict=False):
        if max(between.time_s - before.time_s, after.time_s - between.time_s) <= MAX_SUDDEN_S:
            yield before, between, after


def _repeated(before: Sample, now: Sample) -> bool:
    """Whether more than REPEATED_SHARE of the returns have the x of the same row of the sweep before."""
    if before.raw.shape != now.raw.shape:
        return False
    x = now.raw[:, 0]
    of_returns = x != 0
    same = np.count_nonzero((before.raw[:, 0] == x) & of_returns)
    return bool(same > REPEATED_SHARE * np.count_nonzero(of_returns))
