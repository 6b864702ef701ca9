"""Distance of where things at rest are put from where their returns come from, on recordings of a moving sensor.

    python -m tools.study.deskewing [--sensors vlp-16 ...] [--scenes street ...] [--speeds 6 ...] [--seeds 0:2]
                                    [--seconds 6] [--write]

A sensor drives through a scene at a steady speed. Each of its returns is moved to where the sensor sees it at the
time of that return, and the sweeps are written as a recording of ROS 2 in the form of the sensor's driver, cut ahead,
behind or at a side. The recording is read and its sweeps are placed as those of any other. A row has the 90 %
quantiles of the distance [m] over what is at rest: of the middles of proposals and of their single returns by the
recorded poses, of both by registration, and of both by the recorded poses without the times of the points, so without
deskewing. `--write` writes the table to docs/odometry.md.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from modt.app import assembly
from modt.cli.options import frames as number_range
from modt.geometry import FieldOfView, inverse, transform
from modt.observations import Located, StaticTracks
from modt.pipeline import OdometryStage
from modt.profile import load
from modt.ros2 import odometry, point_cloud2
from modt.sources.bag import open_bag
from modt.types import NONE, Bool, Float64, Frame, Proposals
from modt_evaluation.experiments.markdown import commit
from modt_simulation.motion import Path as Route
from modt_simulation.synthetic_stream import SCENES, SyntheticStream
from tools.docs.sections import DOCS, update
from tools.options import parser

CUTS_DEG = {"ahead": 0.0, "left": 90.0, "behind": 180.0, "right": -90.0}
"""Bearing at which a turning head begins and ends its sweep."""
WITHOUT_CUT = "none"
"""Name of the cut of a sensor that does not turn: its returns come from anywhere at any time of a sweep."""
ITERATIONS = 12
SETTLED_S = 1e-4
"""Greatest change of the time of a return in the last iteration [s]."""
SLOWEST_MPS = 4.0
"""Least speed for which the scenes are long enough."""
FIRST_FRAMES = 3
"""Number of first frames that are left out, since no motion is known at the first."""
AT_REST_SHARE = 0.9
"""Least share of the returns of a proposal that are of bodies at rest."""
POSES_HZ = 50
SENSOR = "lidar"
WORLD = "odom"
MARK = "tools.study.deskewing"
BEGAN_S = 1_700_000_000.0


@dataclass(frozen=True)
class Motion:
    """Poses of the sensor, interpolated between close ones.

    Attributes:
        time_s: (K,) ascending times.
        T_world_sensor: (K, 4, 4) poses at these times.
    """

    time_s: Float64
    T_world_sensor: Float64

    def placed(self, xyz: Float64, time_s: Float64, *, back: bool = False) -> Float64:
        """(N, 3) points in the world, each from the pose at its time (N,); `back` leads to the sensor."""
        time_s = np.clip(time_s, self.time_s[0], self.time_s[-1])
        T = self.T_world_sensor
        place = np.column_stack([np.interp(time_s, self.time_s, T[:, k, 3]) for k in range(3)])
        R = Slerp(self.time_s, Rotation.from_matrix(T[:, :3, :3]))(time_s)
        if back:
            return np.asarray(R.inv().apply(xyz - place))
        return np.asarray(R.apply(xyz) + place)

    def at(self, time_s: float) -> Float64:
        """(4, 4) pose at a time."""
        axes = self.placed(np.vstack([np.zeros(3), np.eye(3)]), np.full(4, time_s))
        T = np.eye(4)
        T[:3, :3] = (axes[1:] - axes[0]).T
        T[:3, 3] = axes[0]
        return T


@dataclass(frozen=True)
class Instant:
    """A sweep as if seen at one instant.

    Attributes:
        stamp_s: that instant.
        world: (N, 3) places of the returns.
        reflectance: (N,).
        at_rest: (N,) whether they are of bodies at rest.
    """

    stamp_s: float
    world: Float64
    reflectance: NDArray[np.float32]
    at_rest: Bool


@dataclass(frozen=True)
class Drive:
    """Sweeps of a drive at a steady speed."""

    sensor: str
    rotating: bool
    period_s: float
    motion: Motion
    sweeps: Sequence[Instant]

    @classmethod
    def simulated(cls, scene: str, sensor: str, speed_mps: float, seconds: float, seed: int) -> Drive:
        """A drive through a scene."""
        built_s = seconds * max(1.0, speed_mps / SLOWEST_MPS)
        stream = SyntheticStream(scene, sensor, built_s, seed)
        world = stream.simulator.world
        world.ego = Route.steady(world.ego.xy, float(world.ego.travelled_m[0]), speed_mps, built_s)
        model = stream.simulator.sensor
        time_s = np.arange(-model.period_s, seconds + model.period_s, 1.0 / 200)
        motion = Motion(time_s, np.array([world.ego_pose(t) for t in time_s]))
        at_rest = np.array([body.path.at_rest for body in world.bodies] + [True])  # the last one is NONE, the ground
        sweeps = []
        for frame, truth in stream.between(1, round(seconds / model.period_s)).sweeps():
            xyz = transform(truth.T_world_sensor, frame.points[:, :3].astype(np.float64))
            of = np.where(truth.instance == NONE, len(world.bodies), truth.instance)
            sweeps.append(Instant(frame.stamp_s, xyz, frame.points[:, 3], at_rest[of]))
        return cls(sensor, model.rotating, model.period_s, motion, sweeps)

    @property
    def cuts(self) -> Sequence[str]:
        """Names of the cuts that this sensor can have."""
        return tuple(CUTS_DEG) if self.rotating else (WITHOUT_CUT,)


@dataclass(frozen=True)
class Seen:
    """A sweep as it was recorded: (N, 3) points where the sensor saw them, (N,) times; the rest as in Instant."""

    xyz: Float64
    time_s: Float64
    of: Instant


def seen(drive: Drive, sweep: Instant, cut: str) -> Seen:
    """A sweep as the moving sensor sees it, in the order of time.

    What overtakes the head at its seam is in none or in two of its sweeps, and is left out.
    """
    half_s = drive.period_s / 2
    if cut == WITHOUT_CUT:
        rng = np.random.default_rng(round(sweep.stamp_s * 1e3))
        time_s = sweep.stamp_s + rng.uniform(-half_s, half_s, len(sweep.world))
        settled = np.ones(len(sweep.world), np.bool_)
    else:
        time_s = np.full(len(sweep.world), sweep.stamp_s)
        settled = np.zeros(len(sweep.world), np.bool_)
        for _ in range(ITERATIONS):  # the time follows from the bearing, which depends on the time
            x, y, _z = drive.motion.placed(sweep.world, time_s, back=True).T
            turned = np.mod(np.deg2rad(CUTS_DEG[cut]) - np.arctan2(y, x), 2 * np.pi) / (2 * np.pi)
            before_s = time_s
            time_s = sweep.stamp_s - half_s + turned * drive.period_s
            settled = np.abs(time_s - before_s) < SETTLED_S
    order = np.argsort(time_s, kind="stable")
    order = order[settled[order]]
    time_s = time_s[order]
    world = sweep.world[order]
    ordered = Instant(sweep.stamp_s, world, sweep.reflectance[order], sweep.at_rest[order])
    return Seen(drive.motion.placed(world, time_s, back=True), time_s, ordered)


@dataclass(frozen=True)
class Form:
    """Times of points in the messages of a driver.

    Attributes:
        name, kind: name and type of their field.
        unit_s: their unit.
        since: time from which they count, by those of the first and the last point; the stamp of the message, too.
        absolute: whether they are times since 1970, and the stamp is that of the first point.
    """

    name: str
    kind: str
    unit_s: float
    since: Callable[[float, float], float]
    absolute: bool = False


FORMS = {
    "vlp-16": Form("time", "<f4", 1.0, lambda first_s, last_s: last_s),  # velodyne_pointcloud
    "os1-64": Form("t", "<u4", 1e-9, lambda first_s, last_s: first_s),  # ouster_ros
    "mid-360": Form("timestamp", "<f8", 1e-9, lambda first_s, last_s: first_s, absolute=True),  # livox_ros_driver2
}


def message(sweep: Seen, form: Form, *, timed: bool) -> bytes:
    """A sweep in the form of its driver, or without the times of its points."""
    names = ["x", "y", "z", "intensity", form.name]
    rows = np.zeros(len(sweep.xyz), np.dtype({"names": names, "formats": ["<f4"] * 4 + [form.kind]}))
    for k, name in enumerate("xyz"):
        rows[name] = sweep.xyz[:, k]
    rows["intensity"] = sweep.of.reflectance
    stamp_s = form.since(float(sweep.time_s[0]), float(sweep.time_s[-1]))
    since_s = -BEGAN_S if form.absolute else stamp_s
    rows[form.name] = (sweep.time_s - since_s) / form.unit_s
    rows = rows if timed else rows[names[:4]].astype(point_cloud2.XYZI)
    return point_cloud2.write_table(BEGAN_S + stamp_s, SENSOR, rows)


def record(path: Path, drive: Drive, sweeps: Sequence[Seen], *, timed: bool = True, posed: bool = True) -> None:
    """Write a recording of the sweeps, and of the poses of the sensor where it is `posed`."""
    topics = ((1, "/points", "sensor_msgs/msg/PointCloud2"), (2, "/odom", "nav_msgs/msg/Odometry"))
    recorded = [(1, float(sweep.time_s[-1]), message(sweep, FORMS[drive.sensor], timed=timed)) for sweep in sweeps]
    step = round(1 / POSES_HZ / float(np.diff(drive.motion.time_s[:2])[0]))
    for time_s, T in zip(drive.motion.time_s[::step], drive.motion.T_world_sensor[::step], strict=True):
        if not posed:
            break
        recorded.append((2, float(time_s), odometry.write_odometry(BEGAN_S + time_s, WORLD, SENSOR, T)))
    rows = [(topic, round((BEGAN_S + time_s) * 1e9), data) for topic, time_s, data in recorded]
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)")
        database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        database.executemany("INSERT INTO topics VALUES (?, ?, ?, 'cdr')", topics)
        database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    database.close()


@dataclass
class Witness:
    """An odometry that keeps what it was given and what it made of it."""

    of: OdometryStage
    proposals: Proposals = field(default_factory=Proposals.empty)
    located: Located | None = None

    def locate(self, frame: Frame, proposals: Proposals, static_tracks: Callable[[float], StaticTracks]) -> Located:
        """The placement of the frame."""
        self.proposals = proposals
        self.located = self.of.locate(frame, proposals, static_tracks)
        return self.located


@dataclass(frozen=True)
class Distances:
    """Distances of what is at rest from where it is truly [m]: of middles of proposals, and of their returns."""

    middles: Float64
    returns: Float64


def distances(path: Path, drive: Drive, sweeps: Sequence[Seen]) -> Distances:
    """Read a recording, place its sweeps, and compare."""
    stream = open_bag(path, drive.period_s)
    profile = load(drive.sensor)
    mode = assembly.MODES["accurate"]
    pipeline = assembly.pipeline(mode, profile, FieldOfView())
    witness = Witness(pipeline.odometry)
    pipeline = replace(pipeline, odometry=witness)
    middles = []
    returns = []
    for frame in stream:
        pipeline.step(frame, mode.budget(profile))
        if frame.index < FIRST_FRAMES:
            continue
        stamp_s = stream.info.began_s + frame.stamp_s - BEGAN_S
        for middle_m, returns_m in _off(witness, drive.motion.at(stamp_s), sweeps[frame.index].of, frame):
            middles.append(middle_m)
            returns.append(returns_m)
    return Distances(np.array(middles), np.concatenate(returns))


def _off(witness: Witness, T_world_true: Float64, truth: Instant, frame: Frame) -> Iterator[tuple[float, Float64]]:
    """Distance of the middle of each proposal at rest from that of its returns, and of each return [m].

    What is placed by registration is compared in the frame of the sensor, so that the drift of its world is left out.
    """
    assert witness.located is not None
    T_true_placed = T_world_true @ inverse(witness.located.placement.T_world_sensor)
    proposals = witness.proposals
    as_seen = transform(witness.located.placement.T_world_sensor, proposals.centroid)[:, :2]
    step = witness.located.observations.centroid - as_seen
    for i, (begin, end) in enumerate(zip(proposals.offsets[:-1], proposals.offsets[1:], strict=True)):
        members = proposals.members[begin:end]
        if np.mean(truth.at_rest[members]) < AT_REST_SHARE:
            continue
        xyz = transform(witness.located.placement.T_world_sensor, frame.points[members, :3].astype(np.float64))
        xyz[:, :2] += step[i]
        off = (transform(T_true_placed, xyz) - truth.world[members])[:, :2]
        yield float(np.hypot(*off.mean(axis=0))), np.hypot(*off.T)


READINGS = {
    "by poses": {},
    "by registration": {"posed": False},
    "without times": {"timed": False},
}
"""Recordings of the same sweeps, by what `record` leaves out."""
QUANTILE = 0.9


def figures(drive: Drive, cut: str) -> dict[str, tuple[float, float]]:
    """Quantiles of the distances of middles and of returns [m], by the name of the reading."""
    sweeps = [seen(drive, sweep, cut) for sweep in drive.sweeps]
    found = {}
    for name, left_out in READINGS.items():
        with TemporaryDirectory() as folder:
            path = Path(folder) / "drive.db3"
            record(path, drive, sweeps, **left_out)
            off = distances(path, drive, sweeps)
        found[name] = (float(np.quantile(off.middles, QUANTILE)), float(np.quantile(off.returns, QUANTILE)))
    return found


def table(rows: Sequence[str]) -> str:
    """Markdown of the rows of drives."""
    columns = ["sensor", "scene", "m/s", "cut", "seed", *(f"{name}: middles, returns" for name in READINGS)]
    return "\n".join([f"| {' | '.join(columns)} |", f"|{'---|' * len(columns)}", *rows])


def main() -> None:
    """Print the table."""
    options = parser(__doc__)
    options.add_argument("--sensors", nargs="+", choices=FORMS, default=[*FORMS])
    options.add_argument("--scenes", nargs="+", choices=SCENES, default=["street", "crossing"])
    options.add_argument("--speeds", nargs="+", type=float, default=[6.0], metavar="M/S")
    options.add_argument("--seeds", type=number_range, default=(0, 1), metavar="A:B")
    options.add_argument("--seconds", type=float, default=6.0)
    options.add_argument("--write", action="store_true")
    args = options.parse_args()
    print(table([]))
    rows = []
    for sensor, scene, speed, seed in product(args.sensors, args.scenes, args.speeds, range(*args.seeds)):
        drive = Drive.simulated(scene, sensor, speed, args.seconds, seed)
        for cut in drive.cuts:
            cells = [f"{middles:.3f}, {returns:.3f}" for middles, returns in figures(drive, cut).values()]
            rows.append(f"| {' | '.join([sensor, scene, f'{speed:g}', cut, str(seed), *cells])} |")
            print(rows[-1], flush=True)
    if args.write:
        made = f"At commit `{commit()}`, {args.seconds:g} s each; made by `python -m {MARK}`; 90 % quantiles [m]."
        update(DOCS / "odometry.md", MARK, f"{made}\n\n{table(rows)}")


if __name__ == "__main__":
    main()
