"""Random sequences of the inputs of a live robot by hypothesis, with a rule for each kind of fault."""

from __future__ import annotations

import importlib.util

import numpy as np
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule

from tests.sequences.live_world import LiveWorld, cpu_s, turns
from tests.sequences.makers import usable

SEED = st.integers(0, 9)
ROS = importlib.util.find_spec("cyclonedds") is not None
SOURCES = [*usable(), *["ros2"] * ROS]
STEPS_S = st.sampled_from([-1e9, -3600.0, -1.0, -0.5, -0.05, 0.05, 0.3, 0.7, 0.95, 1.05, 3600.0, 1e9]) | st.floats(
    -5, 5
)
STAMPS_S = st.sampled_from([0.0, 5e-324, -1e300, 1e300, 1.7e308, -5.0, 5.0, 59.0, 1e11, -1e11, 1.7e18, 1e-9])
PLACES_M = st.sampled_from([0.0, 0.4, 5.0, -80.0, 458_000.0, 5_430_000.0, 9.9e7, -1e8, 1e9, np.nan, np.inf])


_of_packets = precondition(lambda self: self.world.maker is not None)


class LiveSequences(RuleBasedStateMachine):
    """A robot that lives through anything."""

    @initialize(
        source=st.deferred(lambda: st.sampled_from(SOURCES)),
        odometry=st.sampled_from(["datagrams", "topic"] if ROS else ["datagrams"]),
        others=st.sampled_from([0, 0, 20]),
    )
    def begin(self, source, odometry, others) -> None:
        self.world = LiveWorld(source, odometry)
        self._cpu_s = cpu_s()
        self._messages = 0
        for payload in turns(source)[-1][:others] if self.world.maker else ():
            self.world.packet(self.world.stamped(payload))

    def check(self) -> None:
        world = self.world
        world.check(cpu_s() - self._cpu_s, world.messages - self._messages)
        self._cpu_s = cpu_s()
        self._messages = world.messages

    @rule(turns=st.integers(1, 12), posed=st.booleans())
    def drive(self, turns, posed) -> None:
        self.world.drive(turns, posed=posed)
        self.check()

    @rule(seconds=st.sampled_from([0.3, 0.9, 1.5, 6.0, 100.0]), posed=st.booleans())
    def the_sensor_is_silent(self, seconds, posed) -> None:
        self.world.drive(min(round(seconds * 10), 60), posed=posed, sensing=False)
        self.world.now_s += max(seconds - 6.0, 0.0)
        self.check()

    @rule(seconds=st.sampled_from([0.3, 1.1, 6.0, 3600.0]), half_s=st.sampled_from([0.0, 0.05]))
    def the_process_is_stopped(self, seconds, half_s) -> None:
        world = self.world
        world.drive(1)
        if world.maker is not None:
            for payload in world.payloads[: round(half_s * 750)]:
                world.packet(world.stamped(payload))
        else:
            world.cloud(world.calendar_s, np.full((10, 4), 5.0, np.float32))
        world.now_s += seconds
        world.take()
        self.check()

    @rule(step_s=STEPS_S)
    def the_calendar_is_set(self, step_s) -> None:
        self.world.set_s = float(np.clip(self.world.set_s + step_s, 0.0, 1.9e9))
        self.world.drive(3)
        self.check()

    @rule(step_s=STEPS_S, turns=st.sampled_from([1, 8]))
    def the_clock_of_the_sensor_is_set(self, step_s, turns) -> None:
        self.world.sensor_s += step_s
        self.world.drive(turns)
        self.check()

    @_of_packets
    @rule(seed=SEED, share=st.sampled_from([0.01, 0.3, 0.9]), turns=st.sampled_from([1, 5]))
    def packets_are_lost_doubled_and_overtaken(self, seed, share, turns) -> None:
        rng = np.random.default_rng(seed)

        def faults(packets):
            kept = [p for p in packets if rng.random() > share / 2]
            kept += [p for p in packets if rng.random() < share / 2]
            late = 0.003 * rng.random(len(kept)) * (rng.random(len(kept)) < share)
            return [(min(at_s + d, 0.1), payload, -d) for (at_s, payload, _), d in zip(kept, late, strict=True)]

        self.world.drive(turns, faults=faults)
        self.check()

    @_of_packets
    @rule(
        seed=SEED,
        scale_s=st.sampled_from([0.0, 1e-6, 0.001, 0.05, 0.3, 3.0, 3600.0]),
        ahead=st.sampled_from([0.0, 0.5]),
        n=st.sampled_from([1, 30, 4000]),
        stands=st.booleans(),
    )
    def valid_packets_of_any_time(self, seed, scale_s, ahead, n, stands) -> None:
        rng = np.random.default_rng(seed)
        world = self.world
        payloads = world.payloads[:1] if stands else world.payloads
        ahead_s = scale_s * rng.uniform(-1, ahead, n)
        for k, by_s in zip(rng.integers(len(payloads), size=n), np.sort(ahead_s) if stands else ahead_s, strict=True):
            world.packet(world.stamped(payloads[k], by_s))
        world.take()
        self.check()

    @precondition(lambda self: self.world.maker is not None and self.world.maker.turned is not None)
    @rule(seed=SEED, azimuth=st.sampled_from([None, 0, 17_999, 18_000, 35_999]), n=st.sampled_from([5, 200]))
    def heads_that_stand_or_leap(self, seed, azimuth, n) -> None:
        rng = np.random.default_rng(seed)
        world = self.world
        for k in range(n):
            chosen = rng.integers(0, 36_000, 12) if azimuth is None else np.full(12, azimuth)
            payload = world.maker.turned(world.payloads[k % len(world.payloads)], chosen.tolist())
            world.now_s += 0.0013
            world.packet(world.stamped(payload))
        world.take()
        self.check()

    @_of_packets
    @rule(model=st.integers(0, 1), n=st.sampled_from([1, 19, 20, 60]))
    def packets_of_some_model(self, model, n) -> None:
        models = turns(self.world.source)
        for payload in models[model % len(models)][:n]:
            self.world.now_s += 0.0005
            self.world.packet(self.world.stamped(payload))
        self.check()

    @_of_packets
    @rule(
        at=st.integers(0, 5),
        value=st.sampled_from([0, 1, 2, 3, 6, 0x10, 0x21, 0x22, 0x28, 0x37, 0x39, 0x3D, 0xA1, 0xEE, 0xFF]),
        n=st.sampled_from([1, 40]),
    )
    def fields_that_decide(self, at, value, n) -> None:
        fields = self.world.maker.fields
        for payload in self.world.payloads[:n]:
            changed = bytearray(self.world.stamped(payload))
            changed[fields[at % len(fields)]] = value
            self.world.now_s += 0.0013
            self.world.packet(bytes(changed))
        self.check()

    @_of_packets
    @rule(seed=SEED, at_ns=st.integers(0, 2**64 - 1), n=st.sampled_from([1, 50]))
    def bytes_of_packets_change(self, seed, at_ns, n) -> None:
        rng = np.random.default_rng(seed)
        world = self.world
        for payload in world.payloads[:n]:
            changed = bytearray(world.stamped(payload))
            for _ in range(int(rng.integers(1, 4))):
                start = int(rng.integers(0, min(len(changed), 64)))
                changed[start : start + 8] = at_ns.to_bytes(8, "little")[: len(changed[start : start + 8])]
            world.packet(bytes(changed))
        world.take()
        self.check()

    @_of_packets
    @rule(seed=SEED, length=st.sampled_from([0, 1, 35, 36, 1205, 1206, 65_000]), n=st.sampled_from([1, 50]))
    def garbage(self, seed, length, n) -> None:
        rng = np.random.default_rng(seed)
        for _ in range(n):
            self.world.packet(rng.bytes(length))
        for payload in self.world.payloads[:n]:
            self.world.packet(payload[: -1 - length % 7] if seed % 2 else payload + rng.bytes(1 + length % 80))
        self.check()

    @precondition(lambda self: self.world.source == "ros2")
    @rule(
        off_s=st.sampled_from([0.0, 1e-9, -0.05, 0.5, -0.5, 3.0, 1e9, -1e9]),
        fill=st.sampled_from([5.0, 0.0, np.nan, np.inf, 5e4]),
        name=st.sampled_from(["lidar", "map", "", "x" * 4000]),
        n=st.sampled_from([1, 20]),
    )
    def clouds_of_any_kind(self, off_s, fill, name, n) -> None:
        world = self.world
        for k in range(n):
            world.now_s += 0.02
            world.cloud(world.calendar_s + off_s, np.full((10, 4), fill, np.float32), f"{name}{k % 2}"[-4000:])
        world.take()
        self.check()

    @rule(off_s=STAMPS_S, honest=st.booleans(), x_m=PLACES_M, y_m=PLACES_M, n=st.sampled_from([1, 7, 60]))
    def poses_that_lie(self, off_s, honest, x_m, y_m, n) -> None:
        world = self.world
        for k in range(n):
            world.now_s += 0.005
            stamp_s = off_s if abs(off_s) > 1e6 else world.calendar_s + off_s
            if honest and k % 3 == 0:
                world.honest_pose()
            world.pose(stamp_s, x_m + 0.001 * k, y_m, 0.1 * k)
        world.drive(1, posed=honest)
        self.check()

    @rule(seed=SEED, n=st.sampled_from([3, 300]), digits=st.integers(0, 9))
    def poses_in_disorder(self, seed, n, digits) -> None:
        rng = np.random.default_rng(seed)
        world = self.world
        for offset_s in rng.normal(0.0, 0.5, n).round(digits):
            world.honest_pose(float(offset_s))
        world.drive(1)
        self.check()

    @rule(x_m=st.sampled_from([0.0, 1.0, -400.0, 458_000.0]), y_m=st.sampled_from([0.0, 5_430_000.0]))
    def the_odometry_begins_anew(self, x_m, y_m) -> None:
        self.world.origin_m = np.array([x_m - 5.0 * self.world.now_s, y_m])
        self.world.drive(6)
        self.check()

    @rule()
    def all_is_well_again(self) -> None:
        self.world.recovers()
        self.check()

    def teardown(self) -> None:
        if hasattr(self, "world"):
            try:
                self.world.recovers()
            finally:
                self.world.close()
