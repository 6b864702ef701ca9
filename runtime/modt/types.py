"""Data that the stages exchange.

Everything is a structure of arrays, so that the work of a frame is vectorised over points, proposals and tracks. P is
the number of proposals in a frame, M the number of tracks alive, N the number of points.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import IntEnum, IntFlag
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from modt.classes import N_CLASSES

if TYPE_CHECKING:
    from typing_extensions import Self as Self  # noqa: PLC0414  # typing has it from Python 3.11 on
else:
    Self = Any

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int = NDArray[np.int64]
Int8 = NDArray[np.int8]
Bool = NDArray[np.bool_]

NONE = -1
"""Index that stands for no proposal or no track."""
UNRECORDED = -1.0
"""Reflectance of a return whose reflectance was not recorded. Any value below 0 means the same."""
N_REFLECTANCE = 5
"""Number of statistics of a proposal's reflectance."""


DESKEWED = "by the times of the turn"
COMPENSATED = "without times of points"
"""Kinds of the times of sweeps: those of a turn, by which they are deskewed, and none, as if seen at the stamp."""


@dataclass(frozen=True, slots=True)
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

    def __repr__(self) -> str:
        pose = "no" if self.T_world_sensor is None else "its"
        return f"<frame {self.index} at {self.stamp_s:.3f} s: {len(self.points)} points, {pose} pose>"

    @property
    def time_s(self) -> float:
        """Time by which durations are measured [s]."""
        return self.stamp_s if self.steady_s is None else self.steady_s


class Cut(IntFlag):
    """Sides of a proposal that end where the view of the sensor ends. The object may reach beyond them."""

    TOP = 1  # at the highest beam
    BOTTOM = 2  # at the lowest beam
    SIDE = 4  # at the edge of the field of view or of a blind sector
    NEAR = 8  # at the nearest range used


class PointKind(IntEnum):
    """What a point of a frame is. Every point has exactly one kind."""

    MEMBER = 0  # belongs to a proposal
    GROUND = -1
    STRUCTURE = -2  # above the ground, part of a surface that is no object: wall, hedge, shelf, beam
    LOW = -3  # above the ground, of a group too low for an object
    SPARSE = -4  # above the ground, of a group with too few points for an object, or that most rays pass: leaves
    OVERHEAD = -5  # of the ceiling, or higher than what is looked for
    OUT_OF_RANGE = -6  # too near, too far, in a blind sector, or no return
    OUT_OF_VIEW = -7  # outside the field of view
    FOOT = -8  # low, part of a proposal or a structure beside it
    AIRBORNE = -9  # above the ground, where most rays pass, while the air is full of fog, dust or flakes


class MotionState(IntEnum):
    """Whether a track moves."""

    UNKNOWN = 0
    STILL = 1
    MOVING = 2


MOTION_NAMES = tuple(state.name.lower() for state in MotionState)

OBSTACLES = PointKind.STRUCTURE, PointKind.LOW, PointKind.SPARSE, PointKind.AIRBORNE
"""Kinds, besides members of proposals, of what is above the ground and below the ceiling."""
LEFT_OUT: tuple[PointKind, ...] = tuple(kind for kind in PointKind if kind not in (PointKind.MEMBER, PointKind.FOOT))
"""Kinds of the points that belong to no proposal."""


@dataclass(frozen=True, slots=True)
class Proposals:
    """The segments of one frame that could be objects.

    Reflectance is the mean, standard deviation and maximum of a proposal's returns, and the share of bright and of
    dark ones; NaN where none of them has any, None where the sweep carries none.
    """

    members: Int  # (K,) indices of points in the frame, grouped by proposal
    offsets: Int  # (P + 1,) proposal i owns members[offsets[i]:offsets[i + 1]]
    coordinates: Float32  # (3, K) x, y and z of the members [m, sensor frame], gathered once
    centroid: Float64  # (P, 3) mean of each proposal's points [m, sensor frame]
    box: Float64  # (P, 7) minimum box: x, y, z of its centre, l, w, h [m], yaw [rad], sensor frame, l >= w
    cut: Int  # (P,) flags of Cut
    ground_z_m: Float64 | None = None  # (P,) z of the ground beneath each [m, sensor frame], None where not known
    reflectance: Float64 | None = None  # (P, 5)
    kind: Int8 | None = None  # (N,) PointKind of each point of the frame, None where not known
    feet: Int | None = None  # (2, F) points of kind FOOT, and of each a point of what it belongs to

    def lock(self) -> Self:
        """These proposals, whose columns nobody can write to from here on.

        Members, offsets and coordinates are not marked, since C takes read-only arrays several times slower.
        """
        for entries in (self.centroid, self.box, self.cut, self.ground_z_m, self.reflectance):
            if entries is not None:
                entries.setflags(write=False)
        return self

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @property
    def count(self) -> Int:
        """(P,) points of each proposal."""
        return self.offsets[1:] - self.offsets[:-1]

    def label(self, n_points: int) -> Int:
        """(n_points,) proposal of each point of the frame, NONE where it belongs to none."""
        out = np.full(n_points, NONE, np.int64)
        out[self.members] = np.repeat(np.arange(len(self)), self.count)
        return out

    def regrouped(self, members: Int, coordinates: Float32, count: Int, source: Int) -> Proposals:
        """Members in another grouping.

        Args:
            members: (K,) points of the new proposals, one after the other.
            coordinates: (3, K) coordinates of those points.
            count: (Q,) members of each new proposal.
            source: (Q,) proposal whose centroid, box and other columns each new one takes over.
        """
        offsets = np.zeros(len(count) + 1, np.int64)
        count.cumsum(out=offsets[1:])
        return Proposals(
            members=members,
            offsets=offsets,
            coordinates=coordinates,
            centroid=self.centroid.take(source, axis=0),
            box=self.box.take(source, axis=0),
            cut=self.cut[source],
            ground_z_m=None if self.ground_z_m is None else self.ground_z_m.take(source),
            reflectance=None if self.reflectance is None else self.reflectance.take(source, axis=0),
            kind=self.kind,
            feet=self.feet,
        )

    @classmethod
    def empty(cls, kind: Int8 | None = None) -> Proposals:
        """No proposals; with the (N,) PointKind of each point of the frame."""
        return cls(
            members=np.zeros(0, np.int64),
            offsets=np.zeros(1, np.int64),
            coordinates=np.zeros((3, 0), np.float32),
            centroid=np.zeros((0, 3)),
            box=np.zeros((0, 7)),
            cut=np.zeros(0, np.int64),
            kind=kind,
        )


def copy_runs(members: Int, coordinates: Float32, runs: Int) -> tuple[Int, Float32]:
    """Members and (3, ...) coordinates of runs of them, one after the other.

    Args:
        members: (K,) points of the proposals.
        coordinates: (3, K) coordinates of those points.
        runs: (2, R) first row of each run, and the row after its last.
    """
    slices = [slice(*run) for run in runs.T.tolist()]
    return (
        np.concatenate([members[:0], *(members[run] for run in slices)]),
        np.concatenate([coordinates[:, :0], *(coordinates[:, run] for run in slices)], axis=1),
    )


def sort_members(
    members: Int, coordinates: Float32, offsets: Int, label: Int, moved: tuple[Int, Int], n: int
) -> tuple[Int, Float32, Int]:
    """Sort members (K,) and (3, K) coordinates by label, below n, and count (n,) the members of each label.

    Members keep their order within a label. A group, by offsets (G + 1,), has one label (G,). `moved` are rows of the
    members (S,), ascending, that have a label (S,) of their own instead.
    """
    label = label.repeat(offsets[1:] - offsets[:-1])
    member_rows, own_label = moved
    label[member_rows] = own_label
    # In the smallest type that holds n: up to sixteen bits are sorted by radix, which is several times faster.
    order = label.astype(np.min_scalar_type(n)).argsort(kind="stable")
    return members.take(order), coordinates.take(order, axis=1), np.bincount(label, minlength=n)


def column(kind: type, *shape: int, fill: float = 0) -> Any:
    """Column of a track table: type and shape of an entry, and its value in a new row."""
    return field(metadata={"blank": np.full(shape, fill, kind)})


@dataclass(frozen=True)
class Columns:
    """Columns of a track table, one row a track.

    A subclass declares the columns that one stage owns. The owner writes their entries in place; the other stages get
    them read-only, and writing to those raises ValueError. No column is ever replaced by another array.
    """

    def __len__(self) -> int:
        return len(next(iter(vars(self).values())))

    @classmethod
    def blank(cls, m: int = 0) -> Self:
        """M rows without identity, proposal and view, with all classes alike."""
        return cls._made({name: np.repeat(entry[None], m, axis=0) for name, entry in cls._blank_row().items()})

    @classmethod
    def of(cls, table: Columns) -> Self:
        """The columns of this class in a table that has further ones; the arrays are shared."""
        return cls._made({name: getattr(table, name) for name in cls._blank_row()})

    @classmethod
    @cache
    def _blank_row(cls) -> dict[str, NDArray[Any]]:
        return {f.name: f.metadata["blank"] for f in fields(cls)}

    @classmethod
    def _made(cls, columns: dict[str, NDArray[Any]]) -> Self:
        """The table of these columns; the constructor of a frozen dataclass takes several times as long."""
        table = object.__new__(cls)
        vars(table).update(columns)
        return table

    def columns(self) -> dict[str, NDArray[Any]]:
        """Every column by its name."""
        return vars(self).copy()

    def copy(self) -> Self:
        """The same rows, independent of these."""
        return self._made({name: entries.copy() for name, entries in vars(self).items()})

    def renewed(self, kept: Int, n: int) -> Self:
        """The rows kept, by index, then n blank ones."""
        if not len(self):
            return self.blank(n)
        rows = np.concatenate([kept, np.zeros(n, np.int64)])  # room for the blank ones, whatever was there
        columns = {name: entries.take(rows, axis=0) for name, entries in vars(self).items()}
        for name, blank in self._blank_row().items():
            columns[name][len(kept) :] = blank
        return self._made(columns)

    def read_only(self, *parts: type[Columns]) -> Self:
        """The same columns; those of the parts given, by default all, cannot be written to."""
        columns = self.columns()
        for part in parts or (type(self),):
            for name in part._blank_row():
                columns[name] = view = columns[name].view()
                view.setflags(write=False)
        return self._made(columns)

    def lock(self) -> Self:
        """Forbid to write to these columns from here on; returns the table."""
        for entries in vars(self).values():
            entries.setflags(write=False)
        return self


@dataclass(frozen=True)
class Motion(Columns):
    """Columns of the tracker."""

    id: Int = column(int, fill=NONE)  # never used twice in a run
    state: Int = column(int)  # value of the state machine's enumeration
    final: Bool = column(bool)  # the class is confirmed in this state
    x: Float64 = column(float, 4)  # filter state x, y [m, world], heading [rad], speed [m/s] (Equation 1)
    P: Float64 = column(float, 4, 4)  # its covariance
    box: Float64 = column(float, 7)  # last box seen, world frame
    proposal: Int = column(int, fill=NONE)  # proposal in this frame, NONE while lost
    points: Int = column(int)  # points of the last proposal
    age: Int = column(int)  # frames since birth, the birth frame counting as 1
    hits: Int = column(int)  # frames with a proposal
    missed: Int = column(int)  # frames since the last proposal
    moved_m: Float64 = column(float)  # displacement from `lagged_kdop`, along the axis where both ends moved most [m]
    observed_s: Float64 = column(float)  # sum of the steps that ended with a proposal, so a gap adds its last one [s]
    size_m: Float64 = column(float, 3)  # smoothed length, width and height of the boxes seen [m]
    top_cut: Bool = column(bool)  # a person whose upper half the view cuts off
    motion: Int = column(int)  # value of MotionState
    moving_probability: Float64 = column(float, fill=0.5)  # probability that it moves
    velocity: Float64 = column(float, 2)  # velocity, about 0 of what is still [m/s, world]
    velocity_covariance: Float64 = column(float, 2, 2)  # its covariance [m2/s2]

    @property
    def observed(self) -> Bool:
        """(M,) whether the track has a proposal in this frame."""
        observed: Bool = self.proposal != NONE
        return observed

    def row_of_proposal(self, n_proposals: int) -> Int:
        """(n_proposals,) row of the track of each proposal, NONE where there is none."""
        rows = np.full(n_proposals, NONE, np.int64)
        observed = self.observed.nonzero()[0]
        rows[self.proposal[observed]] = observed
        return rows


@dataclass(frozen=True)
class Evidence(Columns):
    """Columns of the fusion: what is known of the class."""

    prior: Float64 = column(float, N_CLASSES, fill=1 / N_CLASSES)  # P(class | box) of the last box seen
    posterior: Float64 = column(float, N_CLASSES, fill=1 / N_CLASSES)  # P(class | views, boxes, motion)
    motion_evidence: Float64 = column(float, N_CLASSES)  # log P(motion | class) over that of background
    box_evidence: Float64 = column(float, N_CLASSES)  # mean log P(box | class) of the boxes seen, up to a constant
    may_be_object: Bool = column(bool)  # the last box seen and the motion allow an object
    view_evidence: Float64 = column(float, N_CLASSES)  # mean log P(view | class) of the views, up to a constant
    # Weight of the past in `view_evidence`: sum of the views' weights, discounted by `view_memory`.
    view_weight: Float64 = column(float)
    views: Int = column(int)  # views fused
    key_points: Int = column(int)  # points at the last view, 0 before any
    key_age: Int = column(int)  # age at the last view

    @property
    def viewed(self) -> Bool:
        """(M,) whether the network has classified it at least once."""
        viewed: Bool = self.key_points > 0
        return viewed


@dataclass(frozen=True)
class Requests(Columns):
    """Column of the scheduler."""

    waiting: Int = column(int)  # frames in a row in which its call was deferred; a coasting track keeps the number


@dataclass(frozen=True)
class Decisions(Columns):
    """Column of the decision."""

    object_class: Int = column(int)  # the reported class


@dataclass(frozen=True)
class ObjectBoxes(Columns):
    """Columns of the boxes of whole objects."""

    whole_box: Float64 = column(float, 7)  # box of the whole object: x, y, z, l, w, h [m], yaw [rad], world frame
    heading_known: Bool = column(bool)  # whether the yaw of `whole_box` is that of its front
    estimated: Bool = column(bool)  # the columns below have been written
    heading: Float64 = column(float, 2)  # unit vector [world]
    heading_variance: Float64 = column(float)  # variance of its angle [rad2]
    axis_evidence: Float64 = column(float)  # log-likelihood ratio of the heading over those across it
    known_m: Float64 = column(float, 3)  # length, width and height known from the views [m]
    centre_offset: Float64 = column(float, 2)  # from the position of the track to the centre of the box [m, world]


@dataclass(frozen=True)
class Tracks(ObjectBoxes, Decisions, Requests, Evidence, Motion):
    """All columns side by side, in the order of the parts from right to left."""


@dataclass(frozen=True, slots=True)
class TrackedFrame:
    """Result of tracking: the tracks by owner, of which each stage writes its own part, and the frame's proposals."""

    motion: Motion  # read-only
    evidence: Evidence  # read-only
    own_evidence: Evidence  # the same arrays, written by the fusion
    requests: Requests  # written by the scheduler
    decisions: Decisions  # written by the decision
    boxes: ObjectBoxes  # written by the stage of the object boxes
    proposals: Proposals  # proposals of the frame after regrouping; each belongs to one track
    wants_class: Bool  # (M,) tracks with a proposal whose state asks for a class


@dataclass(frozen=True, slots=True)
class Budget:
    """Limits of one frame's classification. None means no limit."""

    calls: int | None = None  # proposals classified
    cpu_ms: float | None = None  # CPU time by the cost model [ms]
    mean_ms: float | None = None  # CPU time on average; what is not spent is carried over, for a second at most [ms]


UNLIMITED = Budget()


class TrustLevel(IntEnum):
    """How far what is reported can be believed, from best to worst."""

    GOOD = 0
    DEGRADED = 1  # a part of the view, or a source beside the sweeps, is wrong
    BLIND = 2  # what is reported does not follow from what is around


@dataclass(frozen=True, slots=True)
class Reason:
    """A cause for less than good trust.

    Attributes:
        key: name of the check.
        level: what it makes of the trust.
        cause, remedy: phrases for people.
        since_s: time of the frame with which it began [s].
    """

    key: str
    level: TrustLevel
    cause: str
    remedy: str
    since_s: float


@dataclass(frozen=True, slots=True)
class Trust:
    """Whether what is reported can be believed, since when [s], and the reasons against it."""

    level: TrustLevel = TrustLevel.GOOD
    since_s: float = 0.0
    reasons: tuple[Reason, ...] = ()
    visibility_m: float | None = None  # meteorological visibility, None where it is good or not known

    @property
    def word(self) -> str:
        """The level as it is reported."""
        return self.level.name.lower()

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the checks with a reason, ascending."""
        return tuple(sorted(reason.key for reason in self.reasons))

    def record(self) -> dict[str, Any]:
        """Plain data for records and messages."""
        reasons = [
            {"check": r.key, "level": r.level.name.lower(), "since_s": round(r.since_s, 3), "cause": r.cause}
            for r in self.reasons
        ]
        visibility_m = None if self.visibility_m is None else round(self.visibility_m)
        return {
            "level": self.word,
            "since_s": round(self.since_s, 3),
            "reasons": reasons,
            "visibility_m": visibility_m,
        }


TRUSTED = Trust()


@dataclass(frozen=True, slots=True)
class FrameResult:
    """Result of a frame."""

    frame: Frame  # the frame, turned level. All results in the sensor frame, and the pose, refer to the level frame.
    T_world_sensor: Float64  # (4, 4) pose of the sensor at the stamp, as the odometry placed it
    proposals: Proposals
    tracks: Tracks  # a snapshot of those alive after the frame, read-only
    state_names: tuple[str, ...]  # name of each value of tracks.state
    n_deferred: int  # tracks whose request for a class waits for the next frame's budget
    classified: Int = field(default_factory=lambda: np.zeros(0, np.int64))  # identities of the tracks
    run_id: str = ""  # 16 hexadecimal digits of a service, whose frames and tracks count from 0; "" of a replay
    trust: Trust = TRUSTED

    @property
    def labels(self) -> Int:
        """(N,) identity of the track that each point of the frame belongs to, else its PointKind, which is negative.

        Raises:
            ValueError: the proposals come from a record, which does not hold the kinds of the points.
        """
        kind = self.proposals.kind
        if kind is None:
            raise ValueError("the proposals do not tell the kinds of the points")
        labels = kind.astype(np.int64)
        row_of_proposal = self.tracks.row_of_proposal(len(self.proposals))
        labels[self.proposals.members] = self.tracks.id[row_of_proposal].repeat(self.proposals.count)
        if self.proposals.feet is not None:
            foot, beside = self.proposals.feet
            labels[foot] = labels[beside]
        return labels

    def obstacles(self) -> Int:
        """(K,) rows of the points that stand above the ground and below the ceiling, whatever they belong to."""
        labels = self.labels
        return np.flatnonzero((labels >= 0) | np.isin(labels, OBSTACLES))

    def left_out(self) -> dict[PointKind, int]:
        """Number of points of each kind in LEFT_OUT."""
        kind = self.proposals.kind
        if kind is None:
            return dict.fromkeys(LEFT_OUT, 0)
        # Seven comparisons of bytes take a third of the time of `bincount`, which widens them; so would a PointKind.
        return {each: int(np.count_nonzero(kind == each.value)) for each in LEFT_OUT}
