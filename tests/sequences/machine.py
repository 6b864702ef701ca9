"""Random sequences of frames by hypothesis, with a rule for each kind of frame."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from modt.app.assembly import MODES
from modt.errors import ScanError
from modt.sources.scan_file import sanitised
from modt.types import Budget, Float32, Frame
from tests.sequences.promises import Run, config
from tests.sequences.world import SENSORS, World, broken

SEED = st.integers(0, 9)
GAPS_S = st.sampled_from([0.0, 5e-324, 1e-9, 0.01, 0.1, 0.5, 0.95, 60.0, 3600.0]) | st.floats(0.0, 3600.0)
LIMITS_MS = st.sampled_from([None, 0.0, 1e-6, 0.02, 0.3, 5.0])
BUDGETS = st.builds(Budget, st.sampled_from([None, 0, 1, 3, 16]), LIMITS_MS, LIMITS_MS)


class Sequences(RuleBasedStateMachine):
    """A pipeline and its twin, which are fed alike."""

    @initialize(
        mode=st.sampled_from(list(MODES)),
        sensor=st.sampled_from(["vlp-16", "hdl-64e"]),
        association=st.sampled_from(["kdop", "kdop", "paper"]),
        budget=BUDGETS,
        posed=st.booleans(),
        turn_s=st.sampled_from([0.0, 0.1, -0.1]),
        back=st.sampled_from([0, 5_000, 10**9]),
    )
    def begin(self, mode, sensor, association, budget, posed, turn_s, back) -> None:
        self.world = World(posed=posed, turn_s=turn_s)
        self.runs = [Run(mode, config(sensor, association), budget, back) for _ in range(2)]

    def feed(self, points: Float32) -> None:
        try:
            usable, _ = sanitised(points, "sweep")
        except ScanError:  # such a sweep reaches no pipeline
            return
        self.step(self.world.frame(usable))
        self.world.stamp_s += self.world.step_s

    def step(self, frame: Frame) -> None:
        for run in self.runs:
            run.step(frame)

    @rule(seed=SEED)
    def sweep(self, seed: int) -> None:
        self.world.move(1.0, 0.0, 0.02)
        self.feed(self.world.sweep(seed))

    @rule(seed=SEED, n=st.integers(2, 6))
    def drive(self, seed: int, n: int) -> None:
        for _ in range(n):
            self.sweep(seed)

    @rule(n=st.sampled_from([0, 1, 4]))
    def hardly_a_point(self, n: int) -> None:
        self.feed(np.full((n, 4), 5.0, np.float32))

    @rule(seed=SEED, share=st.sampled_from([0.001, 0.01, 0.3, 1.0]))
    def odd_values(self, seed: int, share: float) -> None:
        self.feed(broken(self.world.sweep(seed), seed, share))

    @rule(seed=SEED, scale_m=st.sampled_from([1e-30, 0.01, 1.0, 30.0, 1e3]), n=st.sampled_from([100, 8000]))
    def dust(self, seed: int, scale_m: float, n: int) -> None:
        points = np.random.default_rng(seed).normal(0.0, scale_m, (n, 4)).astype(np.float32)
        points[:, 3] = np.abs(np.tanh(points[:, 3]))
        self.feed(np.clip(points, -1000, 1000))

    @rule(seed=SEED, side_m=st.sampled_from([0.0, 0.5, 3.0]))
    def wall_of_points(self, seed: int, side_m: float) -> None:
        points = np.random.default_rng(seed).uniform(0, 1, (3000, 4)) * [side_m, side_m, side_m, 1] + [4, 0, -1, 0]
        self.feed(points.astype(np.float32))

    @precondition(lambda self: self.world.frames)
    @rule(back=st.integers(1, 8))
    def an_earlier_frame_again(self, back: int) -> None:
        self.step(self.world.frames[-min(back, len(self.world.frames))])

    @rule(gap_s=GAPS_S)
    def time_passes(self, gap_s: float) -> None:
        self.world.stamp_s += gap_s

    @rule(step_s=st.sampled_from([0.0, 1e-9, 0.03, 0.1, 1.0]))
    def another_rate(self, step_s: float) -> None:
        self.world.step_s = step_s

    @rule(gap_s=GAPS_S)
    def the_clock_is_set_back(self, gap_s: float) -> None:
        self.world.stamp_s -= gap_s

    @rule(sensor=st.integers(0, len(SENSORS) - 1))
    def another_sensor(self, sensor: int) -> None:
        self.world.sensor = sensor

    @rule(x_m=st.floats(-2e5, 2e5), y_m=st.sampled_from([0.0, 5.0, 1e5, 5.4e6, -8e7]), yaw=st.floats(-4, 4))
    def teleport(self, x_m: float, y_m: float, yaw: float) -> None:
        self.world.move(x_m, y_m, yaw)

    @rule(posed=st.booleans())
    def the_odometry_ends_or_begins(self, posed: bool) -> None:
        self.world.restarts += posed and not self.world.posed
        self.world.posed = posed

    @rule()
    def the_odometry_begins_anew(self) -> None:
        self.world.restarts += 1
        self.world.pose = np.eye(4)

    def teardown(self) -> None:
        if hasattr(self, "runs"):
            first, second = (run.text for run in self.runs)
            assert first == second
